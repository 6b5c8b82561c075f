"""`hedgebed tumble spatial`: a platform in six degrees of freedom on a bed of grains or on the spring-damper.

Both go through the coupling's master. On a bed the same trial on the spring-damper is stepped first: it says how far
and how deep the bed must reach, and stands beside the result.
"""

from experiments.grains.on_bed import finish_run
from experiments.platform.numbers import keep_platform
from experiments.runs.folder import RunFolder
from experiments.runs.progress import Progress
from experiments.runs.result import Result
from experiments.runs.whole_runs import whole_run

from .frames import SpatialFrames
from .on_grains import SpatialOnBed
from .on_law import run_on_law
from .result import conclude, sinkage_start, write_series_of
from .settings import SpatialSettings
from .trial import SpatialPlan, plan_spatial

__all__ = ["check", "resume", "run"]


def check(settings: SpatialSettings) -> None:
    """Raise ValueError, naming key, value and what would do, for what the settings class cannot see."""
    plan = plan_spatial(settings)
    if settings.ground == "bed":
        SpatialOnBed(settings, plan).check()
    else:
        run_on_law(settings, plan)


def _carry_out(settings: SpatialSettings, folder: RunFolder, progress: Progress) -> Result:
    """In `folder`, from its checkpoint where there is one; the result."""
    with folder.lock():
        plan = plan_spatial(settings, platform_file=keep_platform(settings.platform, folder.path, progress.message))
        if settings.ground == "bed":
            on_bed = SpatialOnBed(settings, plan)
            return on_bed.carry_out(folder, progress, sinkage=sinkage_start, write_series=write_series_of)
        return _on_law(settings, plan, folder, progress)


def _on_law(settings: SpatialSettings, plan: SpatialPlan, folder: RunFolder, progress: Progress) -> Result:
    for sentence in plan.announcement():
        progress.message(sentence)
    run = run_on_law(settings, plan)

    def frames(resumed: bool) -> SpatialFrames | None:
        return SpatialFrames(settings, run, folder.path, resumed=resumed) if settings.frame_count else None

    return finish_run(
        run, folder, progress, checkpoint_interval=settings.checkpoint_interval, frames=frames,
        sinkage=sinkage_start, write_series=write_series_of,
        conclude=lambda: conclude(settings, plan, run, None, None, folder.path),
    )  # fmt: skip


run, resume = whole_run("tumble spatial", SpatialSettings, _carry_out, check=check)
