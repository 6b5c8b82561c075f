"""`hedgebed tumble spatial`: a platform in six degrees of freedom on a bed of grains or on the spring-damper.

Both go through the coupling's master. On a bed the same trial on the spring-damper is stepped first: it says how far
and how deep the bed must reach, and stands beside the result.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from coupling import BedFooting, LawFooting, SpatialRun, spatial_members
from dem import Bed, Sleep
from dem.materials import Material
from dem.materials import material as find_material
from rigid.platform import Platform
from rigid.quaternions import from_turn, to_matrix
from rigid.rig import STANDARD_GRAVITY

from .bed_box import carried_height
from .bed_progress import BedProgress
from .following import follow
from .kept_platform import keep_platform
from .lengths import check_lengths
from .progress import Progress
from .reporting import write_report
from .runfolder import RunFolder
from .settings import expected_grain_count
from .softening import PUSHED, Softening, check_young, run_limit, soften_material
from .spatial_frames import SpatialFrames
from .spatial_result import conclude, write_series_of
from .spatial_settings import SpatialSettings
from .spatial_trial import SpatialPlan, plan_spatial
from .stopping import held_back
from .surfaces import find_surface, surface_names
from .tumble_coupled import STEP
from .tumble_grains import MARGIN, MOST_GRAINS, RAIN, TOUCH
from .where import check_where
from .whole_runs import whole_run

__all__ = ["check", "resume", "run"]

LAW_LOWERING, LAW_REST = 0.05, 0.11
"""Of the hand on a law, where it is not set: its least speed [m/s], and the longest time constant with which a platform
comes to rest in it, W / (K speed) on all tips that it stands on [s]; on one of four that still is within 3 s."""


@dataclass(frozen=True)
class Forecast:
    """The same trial on the spring-damper, and what it says of the bed."""

    run: SpatialRun
    low: tuple[float, float]
    high: tuple[float, float]
    """Corners of where tips come down, x and y from the start [m]."""
    deepest: float
    """Depth of the deepest tip [m]."""
    fastest: float
    """Largest speed of a tip in the ground [m/s]."""


def check(settings: SpatialSettings) -> None:
    """Raise ValueError, naming key, value and what would do, for what the settings class cannot see."""
    plan = plan_spatial(settings)
    if settings.ground == "bed":
        check_lengths(settings, plan.trial.platform.stance().spike_length)
        material = _material(plan)
        spatial_members(plan.trial.platform)
        check_where(arch=settings.arch, threads=settings.threads)
        try:
            forecast = _forecast(settings, plan)
        except RuntimeError as error:
            raise ValueError(
                f"the same trial on the spring-damper, which says how large a bed must be, fails: {error}; "
                f"another lowering_speed (m/s), or a height or velocity at the start, would do"
            ) from error
        _check_bed(settings, plan, forecast, material)
        chosen = _softness(settings.model_copy(update={"young": None}), plan, forecast).young
        check_young(settings.young, chosen=chosen, max_overlap=settings.max_overlap)
    else:
        _on_law(settings, plan)


def _carry_out(settings: SpatialSettings, folder: RunFolder, progress: Progress) -> dict[str, Any]:
    """In `folder`, from its checkpoint where there is one; the result."""
    with folder.lock():
        plan = plan_spatial(settings, platform_file=keep_platform(settings.platform, folder.path, progress.message))
        for sentence in (*plan.sentences(), *(f"warning: {warning}" for warning in plan.warnings)):
            progress.message(sentence)
        softening, beside = None, None
        if settings.ground == "bed":
            progress.plan({"bed": 1.0, "tumble": settings.duration + 0.3}, seconds={"report": 10.0})
            forecast = _forecast(settings, plan)
            beside = forecast.run
            softening = _softness(settings, plan, forecast)
            bed = _laid_out(plan, forecast, _prepare(settings, plan, softening, progress), settings.grain)
            run = _on_bed(settings, plan, bed, forecast)
        else:
            run = _on_law(settings, plan)
        follow(
            run, folder, progress, checkpoint_interval=settings.checkpoint_interval,
            frames=lambda resumed: SpatialFrames(settings, run, folder.path, resumed=resumed)
            if settings.frame_count else None,
            sinkage=lambda: float(run.columns["sinkage"][0]), write_series=lambda: write_series_of(folder.path, run),
        )  # fmt: skip
        result = conclude(settings, plan, run, beside, softening, folder.path)
        folder.write_result(result)
        progress.stage("report", total=1.0)
        write_report(folder.path, progress)
        folder.drop_checkpoint("tumble")
    return result


# Before it -----------------------------------------------------------------------------------------------------------


def _start(settings: SpatialSettings, platform: Platform) -> dict[str, Any]:
    """Where and how it starts, as `SpatialRun` takes it."""
    turn = from_turn(settings.turn)
    start: dict[str, Any] = {
        "quaternion": tuple(turn), "velocity": settings.velocity, "angular_velocity": settings.angular_velocity,
    }  # fmt: skip
    if settings.height is not None:
        lowest = float(((platform.tips - platform.centre_of_mass) @ to_matrix(turn)[2]).min())
        start["position"] = (0.0, 0.0, settings.height - lowest)
    return start | {
        "duration": settings.duration, "substeps": settings.substeps, "body_steps": settings.body_steps,
        "extrapolation": settings.extrapolation, "iterations": settings.iterations,
    }  # fmt: skip


def _on_law(settings: SpatialSettings, plan: SpatialPlan) -> SpatialRun:
    footing = LawFooting.of_spatial(plan.trial)
    footing.grounds = [replace(ground, time_step=STEP) for ground in footing.grounds]
    lowering = (settings.lowering_speed or _law_lowering(plan)) if settings.in_a_hand else None
    start = _start(settings, plan.trial.platform)
    if settings.ground == "bed":  # what stands beside it
        start |= {"substeps": 10, "body_steps": 1, "extrapolation": 0, "iterations": 1}
    return SpatialRun(plan.trial, footing, lowering_speed=lowering, energy_interval=1e-3, **start)


def _law_lowering(plan: SpatialPlan) -> float:
    """Speed of the hand on the spring-damper, where it is not set [m/s]: heavier on softer ground is faster."""
    carried = _feet(plan) * plan.numbers["stiffness"].value
    return max(LAW_LOWERING, float(np.linalg.norm(plan.trial.weight)) / (carried * LAW_REST))


def _feet(plan: SpatialPlan) -> int:
    """Spikes that the platform stands on."""
    stance = plan.trial.platform.stance()
    return len(stance.row) + len(stance.rear)


def _material(plan: SpatialPlan) -> Material:
    grains = find_surface(plan.surface).grains
    if grains is None:
        known = ", ".join(name for name in surface_names() if find_surface(name).grains)
        raise ValueError(f"surface = {plan.surface!r} has no grains for ground = 'bed': {known} would do")
    return find_material(grains)


def _grain_gravity(plan: SpatialPlan) -> float:
    """Gravity of the grains [m/s2]: the true one in the rig."""
    return STANDARD_GRAVITY if plan.trial.counterweight > 0 else -float(plan.trial.weight[2]) / plan.trial.platform.mass


def _lowering_speed(settings: SpatialSettings, plan: SpatialPlan) -> float | None:
    """Of the hand, where there is one [m/s]."""
    if not settings.in_a_hand:
        return None
    return settings.lowering_speed or math.sqrt(_grain_gravity(plan) * settings.grain)


def _forecast(settings: SpatialSettings, plan: SpatialPlan) -> Forecast:
    run = _on_law(settings, plan)
    rows = run.run()
    tips = plan.trial.platform.tips - plan.trial.platform.centre_of_mass
    centre = np.column_stack([rows[name] for name in "xyz"])
    turns = np.array([to_matrix(turn) for turn in np.column_stack([rows[f"q{k}"] for k in range(4)])])
    arms = np.einsum("nij,tj->nti", turns, tips)
    places = centre[:, None] + arms
    spins = np.column_stack([rows[name] for name in ("wx", "wy", "wz")])
    speeds = np.column_stack([rows[name] for name in ("vx", "vy", "vz")])[:, None] + np.cross(spins[:, None], arms)
    near = places[..., 2] < plan.trial.platform.tip_radius
    if not near.any():  # it never comes down
        near = places[..., 2] <= places[..., 2].min() + 1e-12
    low, high = places[near].min(axis=0), places[near].max(axis=0)
    return Forecast(
        run, (float(low[0]), float(low[1])), (float(high[0]), float(high[1])), max(float(-places[..., 2].min()), 0.0),
        float(np.linalg.norm(speeds[near], axis=1).max()),
    )  # fmt: skip


def _check_bed(settings: SpatialSettings, plan: SpatialPlan, forecast: Forecast, material: Material) -> None:
    spike = 2 * plan.trial.platform.tip_radius
    margin = MARGIN * spike
    for axis, name in enumerate("xy"):
        need = forecast.high[axis] - forecast.low[axis] + 2 * margin
        if settings.bed_size[axis] < need:
            raise ValueError(
                f"bed_size = {settings.bed_size[axis]:g} m along {name} is too short: on the spring-damper tips come "
                f"down from {forecast.low[axis]:.3g} to {forecast.high[axis]:.3g} m of the start within duration = "
                f"{settings.duration:g} s, so with {margin:g} m to spare at both ends "
                f"{math.ceil(100 * need) / 100:g} m or a shorter one would do"
            )
    least = forecast.deepest + 2 * spike
    if settings.bed_size[2] < least:
        raise ValueError(
            f"bed_size = {settings.bed_size[2]:g} m deep is too shallow: on the spring-damper a tip goes "
            f"{forecast.deepest:.2g} m deep, so with two spikes' diameters below it {least:.2g} m would do"
        )
    if settings.grain > spike:
        raise ValueError(f"grain = {settings.grain:g} m is larger than the spike: at most {spike:g} m would do")
    count = expected_grain_count(settings.bed_size, settings.grain, settings.spread)
    if count > MOST_GRAINS:
        larger = settings.grain * (count / MOST_GRAINS) ** (1 / 3)
        raise ValueError(
            f"grain = {settings.grain:g} m makes about {count:.3g} grains: {larger:.2g} m or a smaller bed would do"
        )


def _softness(settings: SpatialSettings, plan: SpatialPlan, forecast: Forecast) -> Softening:
    """The modulus of the grains for this run (`experiments.softening`), or the one that is set."""
    load = float(np.linalg.norm(plan.trial.weight)) / _feet(plan)
    if plan.trial.counterweight == 0:
        load = max(load, PUSHED[settings.actuator] * plan.numbers["stiffness"].value * forecast.deepest)
    return soften_material(
        _material(plan), young=settings.young, max_overlap=settings.max_overlap, grain=settings.grain,
        spread=settings.spread, gravity=_grain_gravity(plan), bed_height=settings.bed_size[2],
        depth=1.5 * forecast.deepest, speed=max(1.5 * forecast.fastest, _lowering_speed(settings, plan) or 0.0),
        pressure=load / (math.pi * plan.trial.platform.tip_radius**2), fall=RAIN * settings.bed_size[2],
        fastest="the fastest tip's speed",
    )  # fmt: skip


def _prepare(settings: SpatialSettings, plan: SpatialPlan, softening: Softening, progress: Progress) -> Bed:
    try:
        with held_back() as asked_to_stop:
            return Bed.prepare(
                _material(plan), size=settings.bed_size, grain=settings.grain, spread=settings.spread,
                gravity=_grain_gravity(plan), seed=settings.seed, young=softening.young,
                max_overlap=settings.max_overlap, arch=settings.arch, threads=settings.threads, cache=settings.cache,
                progress=BedProgress(progress, "bed", asked_to_stop),
            )  # fmt: skip
    except RuntimeError as error:
        raise RuntimeError(f"the bed could not be prepared: {error}; change young, max_overlap or seed") from error


def _laid_out(plan: SpatialPlan, forecast: Forecast, bed: Bed, grain: float) -> Bed:
    """The bed in a box as high as a platform on which grains stick carries them."""
    height = forecast.run.columns["z"]
    rise = float(height.max() - height[0])
    carried = carried_height(_material(plan), reach=plan.trial.platform.reach, rise=rise, grain=grain)
    return bed.repeated(1, height=bed.surface + carried) if bed.surface + carried > bed.height else bed


def _on_bed(settings: SpatialSettings, plan: SpatialPlan, bed: Bed, forecast: Forecast) -> SpatialRun:
    """The run, the footprints expected put in the middle of the bed."""
    origin = tuple(0.5 * (bed.size[k] - forecast.low[k] - forecast.high[k]) for k in range(2))
    weight = float(np.linalg.norm(plan.trial.weight))
    footing = BedFooting(
        bed, spatial_members(plan.trial.platform), origin=(origin[0], origin[1]), bounded_across=True,
        touch=TOUCH * weight, friction=settings.spike_friction, restitution=settings.spike_restitution,
    )  # fmt: skip
    bed.max_overlap, bed.overlap_limit = 0.0, run_limit(settings.max_overlap)
    bed.mark_origin()
    if settings.sleep:
        bed.let_sleep(Sleep(force=settings.sleep_force, share=settings.sleep_share))
    return SpatialRun(
        plan.trial, footing, lowering_speed=_lowering_speed(settings, plan),
        **_start(settings, plan.trial.platform),
    )  # fmt: skip


run, resume = whole_run("tumble spatial", SpatialSettings, _carry_out, check=check)
