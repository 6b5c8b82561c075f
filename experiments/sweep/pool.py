"""Where the tasks of a sweep are carried out: this process, processes here, or a cluster of dask.distributed.

The scheduler of dask gives a task to a worker, and to another where that one dies. A task is known to it by the name of
its run folder, so that a client that comes back finds what is under way; and it goes on without a client. Only an
interrupted client takes back what has not begun.
"""

import json
import logging
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from .tasks import Outcome, Task, carry_out
from .tools import required

__all__ = ["OnOutcome", "OnShare", "carry_out_all"]

OnOutcome = Callable[[Outcome], None]
OnShare = Callable[[str, float], None]
"""Called with the name of a task under way and its share that is done, 0 to 1."""
_TOPIC = "hedgebed-sweep"
_EVERY = 1.0  # Between two shares that a worker tells [s]
_CONNECT = 30  # [s]
_ONE = threading.Lock()  # Taichi serves one run of a process at a time


def carry_out_all(
    tasks: Sequence[Task],
    *,
    scheduler: str | None,
    workers: int,
    on_outcome: OnOutcome,
    on_share: OnShare,
    say: Callable[[str], None],
) -> None:
    """Carry out all tasks; `on_outcome` is called in this thread as each ends, in whatever order.

    Raises KeyboardInterrupt where this process is told to stop; RuntimeError where the cluster goes away, ValueError
    where it cannot be reached or dask is not there. What was done is in the run folders.
    """
    if scheduler is None and workers == 1:
        for task in tasks:
            on_outcome(carry_out(task, lambda share, name=task.name: on_share(name, share)))  # type: ignore[misc]
        return
    with _client(scheduler, workers) as client:
        client.subscribe_topic(_TOPIC, lambda event: on_share(event[1]["run"], event[1]["share"]))
        if not client.scheduler_info()["workers"]:
            say(f"no worker is at {scheduler} yet: the runs wait for the first")
        futures = [
            client.submit(_on_worker, task, key=task.name, pure=False, priority=-place)
            for place, task in enumerate(tasks)
        ]
        if scheduler is not None:
            required("distributed", "scheduler").fire_and_forget(futures)
        try:
            for future in required("distributed", "scheduler").as_completed(futures):
                on_outcome(_outcome(future, scheduler))
        except KeyboardInterrupt:
            client.cancel(futures, force=True)
            raise


def _outcome(future: Any, scheduler: str | None) -> Outcome:
    """What a future that has ended holds, or why it holds nothing."""
    if future.status == "finished":
        return future.result()
    if future.status == "error":  # a task reports its own faults: this is its worker's
        return Outcome(future.key, fault=f"its worker died: {future.exception()}")
    where = f"scheduler = {scheduler!r}" if scheduler else "the scheduler here"
    raise RuntimeError(f"{where} has gone away ({future.status}); what was done is kept")


@contextmanager
def _client(scheduler: str | None, workers: int) -> Iterator[Any]:
    """A client of the cluster, or of processes here that end with it."""
    distributed = required("distributed", f"scheduler = {scheduler!r}" if scheduler else f"workers = {workers}")
    if scheduler is None:
        with (
            distributed.LocalCluster(
                n_workers=workers, threads_per_worker=1, memory_limit=0, dashboard_address=None,
                silence_logs=logging.CRITICAL,
            ) as cluster,
            distributed.Client(cluster) as client,
        ):  # fmt: skip
            yield client
        return
    given = {"scheduler_file": scheduler} if Path(scheduler).is_file() else {"address": scheduler}
    try:
        client = distributed.Client(**given, timeout=_CONNECT)
    except (OSError, ValueError, json.JSONDecodeError) as error:
        raise ValueError(f"scheduler = {scheduler!r} cannot be reached: {error}") from None
    with client:
        yield client


def _on_worker(task: Task) -> Outcome:
    """The task on a worker, which tells its share to whoever listens."""
    worker, told = required("distributed", "a worker").get_worker(), [0.0]

    def tell(share: float) -> None:
        if time.monotonic() - told[0] >= _EVERY:
            told[0] = time.monotonic()
            worker.log_event(_TOPIC, {"run": task.name, "share": share})

    with _ONE:
        return carry_out(task, tell)
