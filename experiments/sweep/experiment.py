"""`hedgebed sweep`: the runs of a design, each a run folder, then one table, sensitivities and a page.

What is done is found again by its folder, so that a sweep that was killed goes on: `hedgebed resume` plans the same
runs, reads those that are done and gives the others to the workers. A run that fails is told, and the others are made.
"""

import os
import time
from dataclasses import dataclass, field
from pathlib import Path

from experiments.runs.folder import RunFolder
from experiments.runs.memory import cores_there
from experiments.runs.progress import Progress
from experiments.runs.result import Result
from experiments.runs.whole_runs import publish, whole_run

from .costs import cost_words
from .design import Design, design_of
from .pool import carry_out_all
from .result import conclude
from .settings import SweepSettings
from .tasks import Outcome, Task, done_before, received, task_of
from .tools import required

__all__ = ["check", "resume", "run"]

_VARIABLE = "HEDGEBED_SCHEDULER"
_TOLD_EVERY = 10.0  # Between two messages of how far the runs are [s]
_REPORT = 5.0  # What the table and the page take [s]


def check(settings: SweepSettings) -> None:
    """Raise ValueError, naming run, key and value, for what cannot be run, or what is not installed."""
    design = design_of(settings, check=True)
    if (scheduler := _scheduler(settings)) is not None:
        required("distributed", f"scheduler = {scheduler!r}")
    elif (workers := _workers(settings)) > 1:
        required("distributed", f"workers = {workers}")
    if design.sampled:
        required("SALib", "a sampled setting")


def _scheduler(settings: SweepSettings) -> str | None:
    return os.environ.get(_VARIABLE) or settings.scheduler


def _workers(settings: SweepSettings) -> int:
    return settings.workers or cores_there()


@dataclass
class _Work:
    """The runs of a sweep, and what is known of them."""

    design: Design
    tasks: list[Task]
    costs: dict[str, float]
    progress: Progress
    outcomes: dict[str, Outcome] = field(default_factory=dict)
    shares: dict[str, float] = field(default_factory=dict)
    """Of the runs under way: name -> share that is done."""
    told: float = 0.0

    def end(self, outcome: Outcome) -> None:
        """Take in what became of a run."""
        task = next(task for task in self.tasks if task.name == outcome.name)
        received(task, outcome)
        self.outcomes[outcome.name] = outcome
        self.shares.pop(outcome.name, None)
        if outcome.fault:
            self.progress.message(f"{outcome.name} ({self._words(outcome.name)}) failed: {outcome.fault}")
        self._tell()

    def share(self, name: str, share: float) -> None:
        """Take in how far a run is."""
        if name in self.costs and name not in self.outcomes:
            self.shares[name] = share
            self._tell()

    def _words(self, name: str) -> str:
        return next(p.words for p, task in zip(self.design.points, self.tasks, strict=True) if task.name == name)

    def _tell(self) -> None:
        done = sum(self.costs[name] for name in self.costs if name in self.outcomes)
        self.progress.update(done + sum(self.costs[name] * share for name, share in list(self.shares.items())))
        if time.monotonic() - self.told >= _TOLD_EVERY:
            self.told = time.monotonic()
            under_way = [f"{self._words(name)}: {100 * share:.0f} %" for name, share in sorted(self.shares.items())]
            failed = sum(bool(outcome.fault) for outcome in self.outcomes.values())
            words = f"{len(self.outcomes)} of {len(self.names)} runs are over, {failed} of them failed"
            self.progress.message("; ".join([words, *under_way[:8]]))

    @property
    def names(self) -> list[str]:
        """Of all runs, each once: two rows of a table may be the same run."""
        return list(dict.fromkeys(task.name for task in self.tasks))


def _carry_out(settings: SweepSettings, folder: RunFolder, progress: Progress) -> Result:
    with folder.lock():
        design, scheduler, workers = design_of(settings), _scheduler(settings), _workers(settings)
        home = Path(settings.members) if settings.members else folder.path / "members"
        threads = settings.threads or (1 if scheduler else max(1, cores_there() // workers))
        tasks = [
            task_of(design.experiment, point.settings, home, threads=threads, reports=settings.reports)
            for point in design.points
        ]
        costs, words = cost_words(settings.experiment, design.points, 1 if scheduler else min(workers, cores_there()))
        work = _Work(design, tasks, {task.name: cost for task, cost in zip(tasks, costs, strict=True)}, progress)
        work.outcomes = {task.name: done for task in tasks if (done := done_before(task)) is not None}
        todo = [task for task in {task.name: task for task in tasks}.values() if task.name not in work.outcomes]
        progress.message(f"{len(tasks)} runs of {settings.experiment}: {words}")
        if work.outcomes:
            progress.message(f"{len(work.outcomes)} of them are done already, {len(todo)} are to do")
        work.costs = {task.name: work.costs[task.name] for task in todo}
        whole = sum(work.costs.values())
        progress.plan({"runs": whole}, seconds={"report": _REPORT})
        progress.stage("runs", total=whole or 1.0)
        carry_out_all(
            todo, scheduler=scheduler, workers=min(workers, max(1, len(todo))), on_outcome=work.end,
            on_share=work.share, say=progress.message,
        )  # fmt: skip
        result = publish(folder, conclude(settings, design, tasks, work.outcomes, folder), progress)
        if faults := [outcome for outcome in work.outcomes.values() if outcome.fault]:
            raise RuntimeError(
                f"{len(faults)} of {len(work.names)} runs have no result, as {faults[0].name}: {faults[0].fault}; the "
                f"table has the others, and `hedgebed resume {folder.path}` tries these again"
            )
    return result


run, resume = whole_run("sweep", SweepSettings, _carry_out, check=check)
