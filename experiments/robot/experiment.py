"""`hedgebed mujoco`: a robot of MuJoCo on a surface law or on a bed of grains."""

from dataclasses import replace

from coupling.robot import RobotRun
from experiments.platform.ground_file import with_kept_ground
from experiments.runs.folder import RunFolder
from experiments.runs.progress import Progress
from experiments.runs.result import Result
from experiments.runs.whole_runs import draw_plots, whole_run

from .energy import growth_warning
from .on_grains import RobotFollowed, RobotOnBed, report_seconds
from .plan import keep_files, plan_robot, try_controller
from .settings import RobotSettings, say
from .stopped import keep_whole_beds

__all__ = ["check", "resume", "run"]


def check(settings: RobotSettings) -> None:
    """Raise ValueError, naming key, value and what is accepted, for what the settings class cannot see."""
    plan = plan_robot(settings)
    try_controller(plan.robot())
    if settings.on_grains:
        RobotOnBed(settings, plan).check()
    else:
        RobotFollowed(settings, plan).run_on_law()


def _carry_out(settings: RobotSettings, folder: RunFolder, progress: Progress) -> Result:
    """In `folder`, from its checkpoint where there is one; the result."""
    with folder.lock():
        keep_files(settings, folder.path)
        settings = with_kept_ground(settings, folder.path)
        plan = plan_robot(settings, folder=folder.path)
        if len(settings.seeds) > 1:
            from .beds import carry_out_beds  # loads the statistics of SciPy

            try:
                return carry_out_beds(settings, plan, folder, progress)
            except KeyboardInterrupt:
                if keep_whole_beds(settings, folder) is not None:
                    draw_plots(folder, progress)
                raise
        if settings.seeds:
            settings = settings.of_bed(settings.seeds[0])
            plan = replace(plan, settings=settings)
        if settings.on_grains:
            return RobotOnBed(settings, plan).carry_out(folder, progress)
        followed = RobotFollowed(settings, plan)
        if settings.threads is not None:
            progress.message(say("threads_on_law", s=settings))
        followed.announce(progress)
        progress.plan({followed.stage: settings.duration}, seconds={"report": report_seconds(settings)})
        run: RobotRun = followed.run_on_law()
        if warning := growth_warning(settings, run):
            progress.message(f"warning: {warning}")
        return followed.finish(run, folder, progress)


run, resume = whole_run("mujoco", RobotSettings, _carry_out, check=check)
