"""`hedgebed sweep`: the runs of a design, each a run folder, then one table, sensitivities and a page.

Finished runs are found again by their folders, so a killed sweep can continue. `hedgebed resume` plans the same runs,
reads the finished ones and gives the others to the workers. A run that fails is reported, and the others are made.
"""

from collections.abc import Mapping
from pathlib import Path

from experiments.pool.tasks import Outcome, task_of
from experiments.pool.together import Planned, Where, run_all
from experiments.pool.tools import required
from experiments.runs.folder import RunFolder
from experiments.runs.memory import cores_there
from experiments.runs.progress import Progress
from experiments.runs.result import Result
from experiments.runs.whole_runs import publish, whole_run

from .costs import cost_words
from .design import design_of
from .result import conclude
from .settings import SweepSettings

__all__ = ["check", "resume", "run"]

_REPORT = 5.0  # What the table and the page take [s]
_ONE_BY_ONE = "one run after the other, without dask: pip install 'hedgebed[sweep]' for several at a time"


def check(settings: SweepSettings) -> None:
    """Raise ValueError, naming run, key and value, for what cannot be run, or what is not installed."""
    design = design_of(settings, check=True)
    _where(settings).check()
    if design.sampled:
        required("SALib", "a sampled setting")


def _where(settings: SweepSettings) -> Where:
    """Where the runs are computed: by default on all cores, since runs of unknown cost may be long."""
    return Where.of(settings).on_all_cores()


def _carry_out(settings: SweepSettings, folder: RunFolder, progress: Progress) -> Result:
    with folder.lock():
        design, where = design_of(settings), _where(settings)
        home = Path(settings.members) if settings.members else folder.path / "members"
        tasks = [task_of(design.experiment, point.settings, home, reports=settings.reports) for point in design.points]
        cores = 1 if where.scheduler is not None else min(where.workers or 1, cores_there())
        costs, words = cost_words(settings.experiment, design.points, cores)
        progress.message(f"{len(tasks)} runs of {settings.experiment}: {words}")
        if where.workers == 1 and Where.of(settings).workers is None and cores_there() > 1:
            progress.message(_ONE_BY_ONE)
        planned = [
            Planned(task, point.words, cost) for task, point, cost in zip(tasks, design.points, costs, strict=True)
        ]
        outcomes = run_all(planned, where=where, progress=progress, report=_REPORT, threads=settings.threads)
        result = publish(folder, conclude(settings, design, tasks, outcomes, folder), progress)
    _refuse_faults(outcomes, folder)
    return result


def _refuse_faults(outcomes: Mapping[str, Outcome], folder: RunFolder) -> None:
    """Raise RuntimeError where a run has no result: the table has the others."""
    if faults := [outcome for outcome in outcomes.values() if outcome.fault]:
        raise RuntimeError(
            f"{len(faults)} of {len(outcomes)} runs have no result, as {faults[0].name}: {faults[0].fault}; the table "
            f"has the others, and `hedgebed resume {folder.path}` tries these again"
        )


run, resume = whole_run("sweep", SweepSettings, _carry_out, check=check)
