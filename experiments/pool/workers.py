"""Where tasks are carried out: this process, processes here, or a cluster of dask.distributed.

The scheduler of dask gives a task to a worker, and to another where that one dies. A task is known to it by its key, so
that a client that returns finds what is under way. It continues without a client. A client that is interrupted
withdraws what has not begun, and another that waits for the same submits it again. Processes here keep what they have
done before they end.
"""

import json
import logging
import math
import os
import signal
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from experiments.runs.progress import Progress
from experiments.runs.stopping import request_stop, stop_requested

from .tasks import Outcome, Task, carry_out
from .tools import required

__all__ = ["OnOutcome", "OnShare", "SchedulerGoneError", "carry_out_all"]

OnOutcome = Callable[[Outcome], None]
OnShare = Callable[[str, float], None]
"""Called with the name of a task under way and its share that is done, 0 to 1."""
_TOPIC = "hedgebed-runs"
_EVERY = 1.0  # Between two shares that a worker tells [s]
_CONNECT = 30  # [s]
_STOPPED_WITHIN = 120  # What processes here have to keep what is done [s]
_ONE = threading.Lock()  # Taichi serves one run of a process at a time


def carry_out_all(
    tasks: Sequence[Task],
    *,
    scheduler: str | None,
    workers: int,
    cores: int,
    on_outcome: OnOutcome,
    on_share: OnShare,
    progress: Progress,
) -> None:
    """Carry out all tasks; `on_outcome` is called in this thread as each ends, in whatever order.

    `cores`: how many a process here takes for a task whose settings do not state its threads. Raises KeyboardInterrupt
    where this process receives a signal to stop. Raises RuntimeError where the cluster is lost, ValueError where it
    cannot be reached or dask is missing. Finished work is in the run folders.
    """
    if scheduler is None and workers == 1:
        for task in tasks:
            on_outcome(carry_out(task, lambda share, name=task.name: on_share(name, share), progress))  # type: ignore[misc]
        return
    distributed = required("distributed", f"scheduler = {scheduler!r}" if scheduler else f"workers = {workers}")
    every, begun = {task.key: task for task in tasks}, set[str]()

    def told(event: tuple[float, dict[str, Any]]) -> None:
        key, share = event[1]["key"], event[1]["share"]
        if key in every:
            begun.add(key)
            on_share(every[key].name, share)

    with _client(distributed, scheduler, workers) as client:
        client.subscribe_topic(_TOPIC, told)
        if not client.scheduler_info()["workers"]:
            progress.message(f"no worker is at {scheduler} yet: the runs wait for the first")

        def given(place: int, task: Task) -> Any:
            where = None if scheduler else cores
            future = client.submit(_on_worker, task, where, key=task.key, pure=False, priority=-place)
            if scheduler is not None:
                distributed.fire_and_forget(future)
            return future

        futures = {task.key: given(place, task) for place, task in enumerate(tasks)}
        try:
            ended = distributed.as_completed(futures.values())
            for future in ended:
                if future.status == "cancelled" and client.status == "running":  # another client took it back
                    client.cancel([future])  # forget it here: its key can be given again
                    futures[future.key] = again = given(list(every).index(future.key), every[future.key])
                    ended.add(again)
                else:
                    on_outcome(_outcome(every[future.key].name, future, scheduler))
        except KeyboardInterrupt:
            if scheduler is not None:
                waiting = [future for key, future in futures.items() if key not in begun and not future.done()]
                client.cancel(waiting, force=True)  # fire_and_forget wants them too
            else:
                progress.message("stopping as soon as what was done is kept; once more to stop at once")
                client.run(request_stop, on_error="ignore")
                with suppress(TimeoutError):
                    distributed.wait(list(futures.values()), timeout=_STOPPED_WITHIN)
            raise


class SchedulerGoneError(RuntimeError):
    """The scheduler has ended while tasks were with it: another one can go on."""


def _outcome(name: str, future: Any, scheduler: str | None) -> Outcome:
    """What a future that has ended holds, or why it holds nothing."""
    if future.status == "finished":
        return future.result()
    if future.status == "error":  # a task reports its own faults: this is its worker's
        return Outcome(name, fault=f"its worker died: {future.exception()}")
    where = f"scheduler = {scheduler!r}" if scheduler else "the scheduler here"
    raise SchedulerGoneError(f"{where} has gone away ({future.status})")


@contextmanager
def _client(distributed: Any, scheduler: str | None, workers: int) -> Iterator[Any]:
    """A client of the cluster, or of processes here that end with it."""
    if scheduler is None:
        with (  # without a dashboard the scheduler still serves HTTP, on port 8787 unless told 0, any free one
            distributed.LocalCluster(
                n_workers=workers, threads_per_worker=1, memory_limit=0, dashboard_address="127.0.0.1:0",
                scheduler_kwargs={"dashboard": False}, silence_logs=logging.CRITICAL, preload=[__name__],
            ) as cluster,
            distributed.Client(cluster) as client,
        ):  # fmt: skip
            yield client
        return
    is_file = Path(scheduler).is_file()
    if not is_file and "://" not in scheduler and ("/" in scheduler or scheduler.endswith(".json")):
        raise ValueError(f"scheduler = {scheduler!r}: there is no such file")
    given = {"scheduler_file" if is_file else "address": scheduler}
    try:
        client = distributed.Client(**given, timeout=_CONNECT)
    except (OSError, ValueError, json.JSONDecodeError) as error:
        raise ValueError(
            f"scheduler = {scheduler!r} cannot be reached: {error}. The variable HEDGEBED_SCHEDULER names another one"
        ) from None
    with client:
        yield client


def dask_setup(worker: Any) -> None:
    """Called by dask in each process here as it starts: Ctrl-C is for the command, which asks processes to stop."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _on_worker(task: Task, cores: int | None) -> Outcome:
    """Carry out the task on a worker, on so many `cores`, if given. The worker reports the share done, 0 at first."""
    worker, told = required("distributed", "a worker").get_worker(), [-math.inf]

    def tell(share: float) -> None:
        if time.monotonic() - told[0] >= _EVERY:
            told[0] = time.monotonic()
            worker.log_event(_TOPIC, {"key": task.key, "share": share})

    with _ONE:
        if stop_requested():
            return Outcome(task.name, fault="stopped before it began")
        if cores is not None and "threads" not in type(task.settings).model_fields:
            _keep_to(int(worker.name), cores)
        tell(0.0)
        try:
            return carry_out(task, tell)
        except KeyboardInterrupt:  # raised further, it would end the worker
            return Outcome(task.name, fault="stopped")


def _keep_to(place: int, count: int) -> None:
    """Give this thread, and those that it starts, `count` cores: others than those of processes at other places."""
    with suppress(AttributeError, OSError):
        there = sorted(os.sched_getaffinity(os.getpid()))
        os.sched_setaffinity(0, {there[(place * count + k) % len(there)] for k in range(count)})
