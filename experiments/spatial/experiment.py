"""`hedgebed tumble spatial`: a platform in six degrees of freedom on a bed of grains or on the spring-damper.

Both go through the coupling's master.
"""

from experiments.platform.numbers import keep_platform
from experiments.runs.folder import RunFolder
from experiments.runs.progress import Progress
from experiments.runs.result import Result
from experiments.runs.whole_runs import whole_run

from .on_grains import SpatialFollowed, SpatialOnBed
from .settings import SpatialSettings
from .trial import plan_spatial

__all__ = ["check", "resume", "run"]


def check(settings: SpatialSettings) -> None:
    """Raise ValueError, naming key, value and what is accepted, for what the settings class cannot see."""
    plan = plan_spatial(settings)
    if settings.on_grains:
        SpatialOnBed(settings, plan).check()
    else:
        SpatialFollowed(settings, plan).run_on_law()


def _carry_out(settings: SpatialSettings, folder: RunFolder, progress: Progress) -> Result:
    """In `folder`, from its checkpoint where there is one; the result."""
    with folder.lock():
        plan = plan_spatial(settings, platform_file=keep_platform(settings.platform, folder.path, progress.message))
        if settings.on_grains:
            return SpatialOnBed(settings, plan).carry_out(folder, progress)
        on_law = SpatialFollowed(settings, plan)
        on_law.announce(progress)
        return on_law.finish(on_law.run_on_law(), folder, progress)


run, resume = whole_run("tumble spatial", SpatialSettings, _carry_out, check=check)
