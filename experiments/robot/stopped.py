"""The result of a robot's run that was stopped, or whose process was killed: of what it has computed so far."""

from dataclasses import replace
from pathlib import Path

from coupling.robot import RobotRun
from experiments.grains.following import CHECKPOINT
from experiments.platform.ground_file import with_kept_ground
from experiments.runs.folder import RunFolder
from experiments.runs.progress import Progress
from experiments.runs.result import Result

from . import say
from .on_grains import RobotFollowed, RobotOnBed, marked_stopped
from .plan import RobotPlan, plan_robot
from .settings import RobotSettings

__all__ = ["keep_whole_beds", "result_of_checkpoint"]


def keep_whole_beds(settings: RobotSettings, folder: RunFolder) -> Result | None:
    """Write the result over the beds that are done, marked as stopped; None where fewer than two are."""
    from .beds import over_beds  # loads the statistics of SciPy

    homes = {seed: folder.path / "beds" / f"seed-{seed}" for seed in settings.seeds}
    whole = [seed for seed, home in homes.items() if _is_done(home)]
    if len(whole) < 2:
        return None
    found = over_beds(whole, [RunFolder.open(homes[seed]).read_result() for seed in whole])
    result = marked_stopped(found, say("stopped_beds", count=len(whole), of=len(settings.seeds)))
    folder.write_result(result)
    return result


def _is_done(home: Path) -> bool:
    return (home / "run.toml").is_file() and RunFolder.open(home).status == "done"


def result_of_checkpoint(folder: RunFolder, progress: Progress) -> Result | None:
    """Write series and result of a run whose process was killed, up to its last checkpoint; None where it has none.

    Its bed comes from the cache, or is prepared again. Of several beds those that are done count, as of
    `keep_whole_beds`. With grains in LAMMPS there is none.
    """
    settings = with_kept_ground(RobotSettings(**folder.settings), folder.path)
    if len(settings.seeds) > 1:
        return keep_whole_beds(settings, folder)
    kept = folder.load_checkpoint(CHECKPOINT)
    if kept is None or settings.ground == "lammps":
        return None
    plan = plan_robot(settings, folder=folder.path)
    if settings.seeds:
        settings = settings.of_bed(settings.seeds[0])
        plan = replace(plan, settings=settings)
    followed, run = _made(settings, plan, progress)
    run.restore(kept)
    return followed.write_so_far(run, folder)


def _made(settings: RobotSettings, plan: RobotPlan, progress: Progress) -> tuple[RobotFollowed, RobotRun]:
    """A run at its start, and what follows it."""
    if not settings.on_grains:
        followed = RobotFollowed(settings, plan)
        return followed, followed.run_on_law()
    on_bed = RobotOnBed(settings, plan)
    on_bed.progress = progress
    return on_bed, on_bed.stepper(on_bed.bed(on_bed.softening(), progress))
