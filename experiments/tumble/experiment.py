"""`hedgebed tumble`: one trial of a platform that a flywheel turns over, on any ground.

`ground` and `method` select here the code that computes it: a bed of grains (`on_grains`), the coupling's master
on the spring-damper (`coupled`), or the planar model, for which a sweep and a campaign may follow. The folder holds
trajectory.csv, series/motion.csv (accelerations, wheel, energies), result.json, figures and a report.
"""

from dataclasses import replace
from pathlib import Path
from typing import Literal

from experiments.campaign.files import keep_model
from experiments.platform.ground_file import naming_gravity, range_warnings, with_kept_ground
from experiments.platform.law_spread import (
    Answer,
    Seen,
    moved,
    spread_entries,
    spread_of_law,
    spread_of_surface,
    uncertain_of,
    with_spread,
)
from experiments.platform.numbers import PlatformNumbers, keep_platform, platform_numbers, torque_within_limit
from experiments.platform.settled import of_earth
from experiments.platform.surfaces import find_surface, surface_names
from experiments.runs.folder import RunFolder, write_series
from experiments.runs.progress import Progress
from experiments.runs.result import Result
from experiments.runs.types import Json
from experiments.runs.whole_runs import publish, whole_run
from rigid.ground_file import GroundFile
from rigid.planar.simulate import PAPER_STEP, check_step, simulate
from rigid.planar.trajectory import Trajectory

from . import say
from .result import motion_columns, quantities_of, result_of, trajectory_columns
from .settings import TumbleSettings
from .sweep import Sweep
from .sweep_ranges import swept_gravities
from .synthesis import check_tumble_campaign, write_tumble_campaign
from .trial import TumblePlan, plan_tumble

__all__ = ["check", "resume", "run"]

_SPREAD_OF = {
    "trajectory_angle": "trajectory angle",
    "max_speed": "largest speed",
    "sinkage_largest": "largest sinkage",
}
"""Numbers whose spread a sentence states -> what it calls them."""


def check(settings: TumbleSettings) -> None:
    """Raise ValueError, naming key, value and what is accepted, for faults that the settings class cannot detect."""
    if settings.on_grains:
        from .on_grains import PlanarOnBed  # loads Taichi

        PlanarOnBed(settings).check()
        return
    sweep = Sweep(settings) if settings.sweep else None
    plan = sweep.plans[sweep.shown] if sweep else plan_tumble(settings)
    check_tumble_campaign(settings)
    if settings.method == "coupled":
        from .coupled import check_coupled  # loads Taichi

        check_coupled(settings, plan)
    else:
        _check_planar(settings, plan)


def _carry_out(settings: TumbleSettings, folder: RunFolder, progress: Progress) -> Result:
    with folder.lock():
        if not settings.on_grains:
            return _on_law(settings, folder, progress)
        from .on_grains import PlanarOnBed  # loads Taichi

        copied = keep_platform(settings.platform, folder.path, progress.message)
        return PlanarOnBed(settings, copied).carry_out(folder, progress)


def _check_planar(settings: TumbleSettings, plan: TumblePlan) -> None:
    if settings.method == "paper":
        try:
            check_step(plan.trial, PAPER_STEP)
        except ValueError as error:
            raise ValueError(f"method = 'paper': {error}; method = 'located' is accepted") from None
    with naming_gravity(plan.fitted, plan.trial):
        _integrate(settings, plan, duration=1e-3)


def _integrate(settings: TumbleSettings, plan: TumblePlan, *, duration: float) -> tuple[Trajectory, float | None]:
    """The trajectory, and the time at which the wheel reaches its limit [s], or None."""
    method: Literal["located", "paper"] = "paper" if settings.method == "paper" else "located"
    trial, full = torque_within_limit(
        plan.trial, max_wheel_speed=plan.max_wheel_speed, duration=duration, method=method
    )
    interval = min(settings.sample_interval, duration)
    return simulate(trial, duration=duration, method=method, sample_interval=interval), full


def _add_spread(
    settings: TumbleSettings, plan: TumblePlan, result: Json, trajectory: Trajectory, copied: Path | None,
    platform: PlatformNumbers,
) -> None:  # fmt: skip
    """Add the standard deviations that follow from those of the law's parameters, and a sentence on them.

    With a sweep or the coupling they are not known, since each takes two more trials a parameter.
    """
    best: dict[str, Json] = result["quantities"]
    depends, fitted, surface = _of_the_law(best), plan.fitted, plan.surface

    def answer_of(other: TumblePlan) -> Answer:
        trajectory, _ = _integrate(settings, other, duration=settings.duration)
        return {name: entry["value"] for name, entry in quantities_of(trajectory).items()}

    def of_file(file: GroundFile) -> Answer:
        again = plan_tumble(settings, model_file=copied, platform=platform, fitted=file)
        return answer_of(replace(plan, trial=again.trial))

    def of_surface(name: str, value: float) -> Answer:
        trial = plan.trial
        moved_trial = replace(trial, stiffness=value) if name == "stiffness" else replace(trial, damping=value)
        return answer_of(replace(plan, trial=moved_trial))

    if settings.sweep or settings.method == "coupled":
        if fitted is not None:
            result["quantities"] = with_spread(best, dict.fromkeys(depends))
        return
    beyond = _beyond(plan, trajectory)
    if fitted is not None:
        parameters = [name for name, _, _ in moved(fitted)]
        seen = Seen(of_file)
        stds, law = dict.fromkeys(depends) if beyond else spread_of_law(fitted, seen, depends), "file"
    else:
        uncertain = uncertain_of(plan.numbers, find_surface(surface)) if surface in surface_names() else []
        parameters = [one.name for one in uncertain]
        seen = Seen(of_surface)
        stds, law = (
            dict.fromkeys(depends) if beyond else spread_of_surface(uncertain, seen, depends),
            "" if plan.trial.ground is None else settings.ground,
        )
    if fitted is not None or parameters:
        result["quantities"] = with_spread(best, stds)
    result["law_spread"], sentence = spread_entries(
        result["quantities"], _SPREAD_OF, surface=surface, law=law, parameters=parameters, absent=seen.absent(depends),
        beyond=beyond and bool(parameters),
    )  # fmt: skip
    result["departures"]["sentences"].append(sentence)


def _beyond(plan: TumblePlan, trajectory: Trajectory) -> bool:
    """Whether the tumble leaves the range of the law of its ground file, or has K of 1 g under a small gravity."""
    trial = plan.trial
    if plan.fitted is not None:
        return bool(range_warnings(plan.fitted, trajectory, gravity=trial.gravity, diameter=plan.spikes.diameter))
    if trial.ground is not None or plan.surface not in surface_names():
        return False
    weights = {"weight": trial.weight, "mass": trial.mass, "counterweight": trial.counterweight}
    return bool(of_earth(plan.numbers, plan.surface, **weights))


def _of_the_law(quantities: dict[str, Json]) -> dict[str, float | None]:
    """Values of the quantities that depend on the law of the ground."""
    return {name: quantities[name]["value"] for name in quantities if name != "energy_residual"}


def _on_law(settings: TumbleSettings, folder: RunFolder, progress: Progress) -> Result:
    """A tumble on the spring-damper or another law, with its sweep and its campaign if they are requested."""
    settings = with_kept_ground(settings, folder.path)
    copied = keep_model(settings.model, folder.path)
    platform = platform_numbers(settings.platform, file=keep_platform(settings.platform, folder.path, progress.message))
    sweep = Sweep(settings, model_file=copied, platform=platform) if settings.sweep else None
    plan = sweep.plans[sweep.shown] if sweep else plan_tumble(settings, model_file=copied, platform=platform)
    if settings.threads is not None:
        progress.message(say("threads_on_law", s=settings))
    for sentence in [*(swept_gravities(sweep.ranges) if sweep else ()), *plan.announcement()]:
        progress.message(sentence)
    progress.stage("tumble", total=1.0)
    if settings.method == "coupled":
        from .coupled import compute_coupled  # loads Taichi

        trajectory, result = compute_coupled(settings, plan, folder, progress)
    else:
        trajectory, full = _integrate(settings, plan, duration=settings.duration)
        result = result_of(settings, plan, trajectory, full)
    _add_spread(settings, plan, result, trajectory, copied, platform)
    progress.update(1.0)
    write_series(folder.path / "trajectory.csv", trajectory_columns(trajectory))
    folder.write_series("motion", motion_columns(trajectory))
    if sweep:
        progress.message("the numbers above are those of one trial of the sweep, in its middle or nearest to it")
        progress.stage("sweep")
        swept = sweep.run(folder)
        result["departures"]["sentences"] += swept["sweep"]["sentences"]
        result["title"] += ", one trial of a sweep of " + " and ".join(settings.sweep)
        result |= swept
    made = write_tumble_campaign(settings, plan, folder.path, progress)
    result |= {"campaign": made} if made is not None else {}
    return publish(folder, Result.make("tumble", **result), progress)


run, resume = whole_run("tumble", TumbleSettings, _carry_out, check=check)
