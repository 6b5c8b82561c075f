"""Carries out a list of runs: what is done is read, the others go to processes here or to a cluster, all in one stage
of the progress.
"""

import os
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path
from typing import Protocol

from experiments.runs.memory import cores_there
from experiments.runs.progress import Progress
from experiments.runs.strict import MOST_WORKERS

from .tasks import Outcome, Task, done_before, received
from .tools import required
from .workers import carry_out_all

__all__ = ["Planned", "Where", "run_all", "whole_folder"]

_VARIABLE = "HEDGEBED_SCHEDULER"
_TOLD_EVERY = 60.0  # Between two messages of how far the runs are, unless a run ends [s]
_ENDS_TOLD_EVERY = 10.0  # Between two messages that runs have ended [s]
_WORTH = 60.0
"""Reckoned work [s] from which on processes are started unless `workers` says otherwise. Each imports and compiles for
some seconds before its first run."""


class _Settings(Protocol):
    """Settings that say where runs are computed."""

    @property
    def scheduler(self) -> str | None: ...
    @property
    def workers(self) -> int | None: ...


@dataclass(frozen=True)
class Where:
    """Where runs are computed: on the cluster of `scheduler`, or in `workers` processes here; None: what suits."""

    scheduler: str | None = None
    workers: int | None = None

    @classmethod
    def of(cls, settings: _Settings) -> "Where":
        """What the settings say; the variable HEDGEBED_SCHEDULER, where it is set, replaces that."""
        if scheduler := os.environ.get(_VARIABLE):
            return cls(scheduler)
        return cls(settings.scheduler, settings.workers)

    def check(self) -> None:
        """Raise ValueError for both, for no number of workers, and where dask is needed and not there."""
        if self.workers is not None and not 1 <= self.workers <= MOST_WORKERS:
            raise ValueError(f"workers = {self.workers}: 1 to {MOST_WORKERS} processes were expected")
        if self.scheduler is not None:
            required("distributed", f"scheduler = {self.scheduler!r}")
            if self.workers is not None:
                raise ValueError(f"workers = {self.workers} are processes here: leave it out beside scheduler")
        elif (self.workers or 1) > 1:
            required("distributed", f"workers = {self.workers}", without="workers = 1 needs nothing more")

    def on_all_cores(self) -> "Where":
        """The same; where it is left open, all cores here, or one process where dask is not there."""
        if self.scheduler is not None or self.workers is not None:
            return self
        return Where(workers=1 if find_spec("distributed") is None else cores_there())

    def processes(self, costs: Sequence[float]) -> int:
        """How many processes here compute runs of these reckoned costs [s]: at least 1, at most one for each run.

        Where `workers` is None: as many as there are cores, but 1 where all together takes less than `_WORTH` or dask
        is not there.
        """
        if self.workers is None and (sum(costs) < _WORTH or find_spec("distributed") is None):
            return 1
        return max(1, min(self.workers or cores_there(), len(costs)))


@dataclass(frozen=True)
class Planned:
    """A run of a list: its task, what a message calls it, and its cost [s of one core by estimate, or any unit]."""

    task: Task
    words: str
    cost: float


@dataclass
class _Runs:
    """The runs that are to be made, and what is known of them."""

    planned: Mapping[str, Planned]
    progress: Progress
    on_outcomes: Callable[[Sequence[Outcome]], None]
    over: dict[str, Outcome] = field(default_factory=dict)
    shares: dict[str, float] = field(default_factory=dict)
    """Of the runs under way: name -> share that is done."""
    told: float = field(default_factory=time.monotonic)

    def end(self, outcome: Outcome) -> None:
        """Take in what became of a run."""
        received(self.planned[outcome.name].task, outcome)
        self.over[outcome.name] = outcome
        self.shares.pop(outcome.name, None)
        if outcome.fault:
            words = self.planned[outcome.name].words
            self.progress.message(f"{outcome.name} ({words}) failed: {outcome.fault}")
        self.on_outcomes([outcome])
        self._tell(_ENDS_TOLD_EVERY)

    def share(self, name: str, share: float) -> None:
        """Take in how far a run is."""
        if name in self.planned and name not in self.over:
            self.shares[name] = share
            self._tell(_TOLD_EVERY)

    def _tell(self, every: float) -> None:
        done = sum(self.planned[name].cost for name in self.over)
        under_way = sum(self.planned[name].cost * share for name, share in list(self.shares.items()))
        self.progress.update(done + under_way)
        if time.monotonic() - self.told >= every:
            self.told = time.monotonic()
            shares = [f"{self.planned[name].words}: {100 * share:.0f} %" for name, share in sorted(self.shares.items())]
            failed = sum(bool(outcome.fault) for outcome in self.over.values())
            words = f"{len(self.over)} of {len(self.planned)} runs are over, {failed} of them failed"
            self.progress.message("; ".join([words, *shares[:8]]))


def run_all(
    planned: Sequence[Planned],
    *,
    where: Where,
    progress: Progress,
    on_outcomes: Callable[[Sequence[Outcome]], None] = lambda outcomes: None,
    report: float | None = None,
    unit: float | None = None,
    threads: int | None = None,
    stage: str = "runs",
) -> dict[str, Outcome]:
    """Carry out all runs that are not done; every outcome by the name of its task.

    Args:
        planned: the runs, each once or several times, in the order in which they begin.
        where: where they are computed.
        progress: has one stage, `stage`, for all of them.
        on_outcomes: called in this thread with outcomes: first of all runs that are done already, then as runs end.
        report: time that is needed afterwards [s], for a plan of the whole; None makes no plan.
        unit: a first guess at the time that a unit of cost takes one process [s].
        threads: of each run whose settings leave it open; the cores here shared out, or 1 on a cluster, if None.

    A run that fails is an outcome with a fault, and the others are made. Raises KeyboardInterrupt where this process is
    stopped by a signal, RuntimeError where a cluster is lost, ValueError where it cannot be reached. Runs keep what is
    done.
    """
    every = {one.task.name: one for one in planned}
    found = {name: done_before(one.task, progress.message) for name, one in every.items()}
    before = {name: done for name, done in found.items() if done is not None}
    todo = {name: one for name, one in every.items() if name not in before}
    if before:
        progress.message(f"{len(before)} of {len(every)} runs are done already, {len(todo)} are to do")
        on_outcomes(list(before.values()))
    whole = sum(one.cost for one in todo.values())
    processes = 1 if where.scheduler is not None else where.processes([one.cost for one in todo.values()])
    if report is not None:
        progress.plan({stage: whole}, seconds={"report": report}, unit=None if unit is None else unit / processes)
    if not todo:
        return before
    each = threads or (1 if where.scheduler is not None else max(1, cores_there() // processes))
    progress.stage(stage, total=whole or 1.0)
    runs = _Runs(todo, progress, on_outcomes)
    carry_out_all(
        [one.task.on_threads(each) for one in todo.values()], scheduler=where.scheduler, workers=processes,
        cores=each, on_outcome=runs.end, on_share=runs.share, progress=progress,
    )  # fmt: skip
    return before | runs.over


def whole_folder(task: Task, *names: str) -> Path:
    """The folder of a run that is done, with all of these files.

    Raises RuntimeError, naming file and folder, where one is not there: its worker sees another disk.
    """
    for name in names:
        if not (task.path / name).exists():
            raise RuntimeError(f"{task.path / name} is not there: workers must see {task.home} under this path")
    return task.path
