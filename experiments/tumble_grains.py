"""`hedgebed tumble --ground bed`: the platform on a bed of grains, beside the same trial on the spring-damper.

In the rig the grains are at 1 g and the platform hangs on its counterweight; with ``gravity`` both are at that. The
spring-damper's trial is integrated first: it says how far and deep the bed must reach, and stands beside the result.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from coupling import BedFooting, CoupledTumble, LawFooting, platform_members
from coupling.bed_footing import FEWEST_SLOTS, slots_of
from dem import Bed, Graded, Sleep
from dem.materials import Material
from dem.materials import material as find_material
from rigid.planar import simulate
from rigid.rig import STANDARD_GRAVITY
from rigid.trajectory import Trajectory
from rigid.trial import Trial

from .bed_box import carried_height
from .bed_graded import graded_under
from .bed_progress import BedProgress
from .bed_staged import check_bed_stages, packing_warning, staged_bed
from .following import CHECKPOINT, follow
from .kept_platform import keep_platform
from .lengths import check_lengths
from .progress import Progress
from .reporting import write_report
from .runfolder import RunFolder
from .settings import expected_grain_count
from .softening import PUSHED, Softening, check_young, run_limit, soften_material
from .stopping import held_back
from .surfaces import find_surface, surface_names
from .tips import tip_angles, tip_depth
from .tumble_flight import lies_in_flight
from .tumble_grains_frames import TumbleFrames
from .tumble_grains_result import conclude, sinkage_start, write_trajectory
from .tumble_opening import opening, short_of_way
from .tumble_platform import platform_numbers, spikes_of, torque_within_limit
from .tumble_settings import TumbleSettings
from .tumble_steppers import is_plain, stepper_of
from .tumble_trial import TumblePlan, plan_tumble
from .where import check_where

__all__ = ["Forecast", "check_on_grains", "tumble_on_grains"]

COPIES = 2.0
"""Spikes in a row: the bed holds one of them and the sand that it has for itself."""
MARGIN = 3.0
"""Sand beyond the outermost footprint, over a spike's diameter [1]."""
ROLLED = {"motor": 0.8, "brake": 0.4}
"""Way on grains over that of rolling without slip or loss: 0.64 to 0.78 and 0.3 were met (docs/experiments.md) [1]."""
THROW = 2.0
"""Speed of a grain that a spike throws up, over the spike's [1]: an elastic ball has twice the wall's."""
RAIN = 2.5
"""Height of the loose column that a bed is rained from, over the bed's depth [1]."""
TOUCH = 1e-3
"""Force on a row that counts as touching for the torque, over the weight [1]."""
MOST_GRAINS = 3e6
"""More are refused: the run would take days."""
HULL_SHARE = 0.95
"""The hull's cylinder over the distance of its sides from the axis, so that it never stands out of the hull [1]."""


@dataclass(frozen=True)
class Forecast:
    """The same trial on the spring-damper, and what it says of the bed."""

    plan: TumblePlan
    """What it is of."""
    trajectory: Trajectory
    full: float | None
    """When the wheel comes to its limit [s]."""
    behind: float
    ahead: float
    """Where the tips come down, from the start [m]."""
    deepest: float
    """Depth of the deepest tip [m]."""
    fastest: float
    """Largest speed of a tip in the ground [m/s]."""
    sunk: float
    """Depth of the tips that it stands on before it moves [m]."""
    pushed: float
    """Largest force of the rows together [N]."""
    farthest: float
    """Where tips may come down on grains, which hold a row and the torque with it as long as it acts [m]."""
    margin: float = 1.5
    """What grains may do beyond it: depth and speed for which their modulus is chosen, over these [1]."""
    on: str = "on the spring-damper"
    """What says so, for whom it does not suit."""


def check_on_grains(settings: TumbleSettings) -> None:
    """Raise ValueError, naming key, value and what would do, for a bed that will not do for this trial."""
    plan = _plan(settings)
    material = _material(plan)
    _members(settings, plan)
    check_where(arch=settings.arch, threads=settings.threads)
    forecast = _forecast(settings, plan)
    _check_bed(settings, forecast, material)
    _check_young(settings, plan, forecast)


def tumble_on_grains(settings: TumbleSettings, folder: RunFolder, progress: Progress) -> dict[str, Any]:
    """Carry it out in `folder`, from its checkpoint where there is one; the result."""
    with folder.lock():
        plan = _plan(settings, keep_platform(settings.platform, folder.path, progress.message))
        unlike = packing_warning(find_surface(plan.surface), _material(plan), settings.bed_stages)
        warnings = [*plan.warnings, *([unlike] if unlike else [])]
        forecast = _forecast(settings, plan)
        softening = _softness(settings, plan, forecast)
        for sentence in opening(
            settings, plan, grains=_count(settings, forecast), softening=softening,
            lowering_speed=_lowering_speed(settings, plan),
        ):  # fmt: skip
            progress.message(sentence)
        spikes = _whose_spikes(settings, plan)
        short = short_of_way(settings, plan, forecast.trajectory)
        for said in (*warnings, short, _may_leave(settings, forecast), spikes):
            if said:
                progress.message(f"warning: {said}")
        step_time = settings.duration + 0.3  # with the setting down
        progress.plan({"bed": 1.0, "tumble": step_time}, seconds={"report": 10.0})
        try:
            bed = _prepare(settings, plan, forecast, softening, progress)
            bed = _laid_out(settings, plan, forecast, bed)
            if settings.bed_repeats > 1:
                progress.message(_repeated_told(settings, forecast, bed))
        except RuntimeError as error:
            raise RuntimeError(f"the bed could not be prepared: {error}; change young, max_overlap or seed") from error
        run = _stepper(settings, plan, bed, forecast)
        series = _follow(settings, run, folder, progress)
        graded = _graded(settings, forecast)
        result = conclude(settings, plan, run, series, forecast.trajectory, softening, folder, graded)
        result["warnings"] += [spikes] if spikes else []
        folder.write_result(result)
        progress.stage("report", total=1.0)
        write_report(folder.path, progress)
        folder.drop_checkpoint(CHECKPOINT)
    return result


# Before it -----------------------------------------------------------------------------------------------------------


def _plan(settings: TumbleSettings, platform_file: Path | None = None) -> TumblePlan:
    """The numbers of the trial: those of the spring-damper, of which grains take all but K, C and friction.

    `platform_file` stands in for ``settings.platform``, where that was copied.
    """
    platform = platform_numbers(settings.platform, file=platform_file)
    spikes = spikes_of(settings, platform)
    plan = plan_tumble(_beside(settings), platform=platform, spikes=spikes)
    own = {"spike_diameter": spikes.diameter, "spike_clear": spikes.clear}
    check_lengths(settings, plan.trial.spike_length, **own)
    return plan


def _beside(settings: TumbleSettings) -> TumbleSettings:
    kept = {name: getattr(settings, name) for name in settings.model_fields_set}
    own = set(settings.bed_settings_given()) | {"ground"}
    landing = {"torque": 0.0} if settings.drop_speed is not None else {}
    return TumbleSettings(**{name: value for name, value in kept.items() if name not in own} | landing)


def _material(plan: TumblePlan) -> Material:
    """The grains of the surface. A preset of `dem` that holds for one grain size is scaled when the bed is made."""
    grains = find_surface(plan.surface).grains if plan.surface in surface_names() else None
    if grains is None:
        known = ", ".join(name for name in surface_names() if find_surface(name).grains)
        raise ValueError(f"surface = {plan.surface!r} has no grains for ground = 'bed': {known} would do")
    return find_material(grains)


def _lowering_speed(settings: TumbleSettings, plan: TumblePlan) -> float:
    """As set, or sqrt(g z) [m/s], slow for sand in any gravity: z a grain, in flight how deep it lies.

    Its dynamic pressure, 1.1 rho g z, is what sand bears at a depth of z / 50 (3D-RFT, `softening`).
    """
    if settings.lowering_speed is not None:
        return settings.lowering_speed
    deep = settings.grain if plan.trial.counterweight > 0 else _forecast(settings, plan).sunk
    return math.sqrt(_first_gravity(settings, plan) * deep)


def _first_gravity(settings: TumbleSettings, plan: TumblePlan) -> float:
    """Gravity of the grains when their bed is made and the platform is set down [m/s2]."""
    return settings.settle_gravity or _grain_gravity(plan.trial)


def _grain_gravity(trial: Trial) -> float:
    """Gravity of the grains [m/s2]: the true one in the rig."""
    return STANDARD_GRAVITY if trial.counterweight > 0 else trial.gravity_sim


def _forecast(settings: TumbleSettings, plan: TumblePlan) -> Forecast:
    if is_plain(settings):
        trial, full = torque_within_limit(plan.trial, max_wheel_speed=plan.max_wheel_speed, duration=settings.duration)
        found = simulate(trial, duration=settings.duration, sample_interval=min(1e-3, settings.duration))
    else:  # several tumbles and landings are the master's; ten steps of 0.1 ms
        run = stepper_of(
            settings, plan.trial, LawFooting.of_trial(plan.trial), duration=settings.duration,
            max_wheel_speed=plan.max_wheel_speed,
        )  # fmt: skip
        found, trial, full = run.run(), plan.trial, run.body.wheel_at_limit
    angles = tip_angles(trial.spike_count, found.theta)
    tips_x = found.x[:, None] - trial.spike_length * np.sin(angles)
    depth = tip_depth(found.theta, found.y, count=trial.spike_count, length=trial.spike_length)
    near = depth > -0.5 * plan.spikes.diameter
    speed = np.hypot(
        found.vx[:, None] - found.omega[:, None] * trial.spike_length * np.cos(angles),
        found.vy[:, None] + found.omega[:, None] * trial.spike_length * np.sin(angles),
    )
    forecast = Forecast(
        plan, found, full, float(tips_x[near].min()), float(tips_x[near].max()), float(depth.max()),
        float(speed[near].max()), sunk=float(depth[0].max()),
        pushed=trial.weight + (trial.mass + trial.counterweight) * float(np.gradient(found.vy, found.time).max()),
        farthest=max(float(tips_x[near].max()), _rolled(settings, plan, float(depth.max()))),
    )  # fmt: skip
    return forecast if trial.counterweight > 0 else _in_flight(settings, plan, forecast)


def _rolled(settings: TumbleSettings, plan: TumblePlan, deepest: float) -> float:
    """Where the tip ahead of the next row touches, rolled on l cos(pi / n) for ROLLED of the way [m]; 0 of no tumble.

    On springs a row lets go, and the torque ends with it; sand holds one all the time.
    """
    trial = plan.trial
    if not is_plain(settings):
        return 0.0
    high = trial.spike_length * math.cos(math.pi / trial.spike_count)
    gained = trial.torque * high / (trial.inertia + trial.mass * high**2)
    brake = trial.actuator == "brake"
    room = trial.wheel_speed_0 if brake else plan.max_wheel_speed - trial.wheel_speed_0
    acts = min(settings.duration, trial.torque_until, room * trial.wheel_inertia / max(trial.torque, 1e-12))
    way = gained * acts * (settings.duration - 0.5 * acts)
    return ROLLED[trial.actuator] * way + math.sqrt(max(trial.spike_length**2 - (high - 1.5 * deepest) ** 2, 0.0))


def _in_flight(settings: TumbleSettings, plan: TumblePlan, law: Forecast) -> Forecast:
    """What the spring-damper, with its one K for any gravity, cannot know (`experiments.tumble_flight`)."""
    trial = plan.trial
    lying = lies_in_flight(
        trial, surface=plan.surface, material=_material(plan), hull_radius=_hull_radius(plan),
        width=COPIES * settings.bed_size[1], duration=settings.duration, max_wheel_speed=plan.max_wheel_speed,
    )  # fmt: skip
    pushed = 0.5 * trial.gravity_sim * settings.duration**2  # by sand that pushes ahead with the weight, as at 1e-2 g
    ahead = lying.reach + max(pushed, float(law.trajectory.x.max()))
    landing = settings.drop_speed is not None
    return replace(
        law, behind=min(law.behind, -lying.reach), ahead=max(law.ahead, ahead), deepest=max(law.deepest, lying.deepest),
        fastest=max(law.fastest, lying.fastest), sunk=lying.sunk, farthest=max(law.ahead, ahead),
        margin=1.5 if landing else 1.0,
        on="on the spring-damper, or turning where it lies on its hull," if lying.on_hull else law.on,
    )  # fmt: skip


def _laid_out(settings: TumbleSettings, plan: TumblePlan, forecast: Forecast, bed: Bed) -> Bed:
    """The prepared bed as often as it is to be repeated, in a box as high as its sand may be thrown or carried."""
    rise = float(forecast.trajectory.y.max() - forecast.trajectory.y[0])
    carried = carried_height(_material(plan), reach=plan.trial.spike_length, rise=rise, grain=settings.grain)
    top = bed.surface + max(_thrown(settings, plan, forecast), carried)
    return bed.repeated(settings.bed_repeats, height=top) if settings.bed_repeats > 1 or top > bed.height else bed


def _thrown(settings: TumbleSettings, plan: TumblePlan, forecast: Forecast) -> float:
    """How high over the surface grains are followed [m]: thrown at THROW times the fastest tip's speed.

    No higher than the bed is long: at a small gravity what leaves is not back while a run lasts, and ends it.
    """
    return min((THROW * forecast.fastest) ** 2 / (2 * _grain_gravity(plan.trial)), settings.bed_size[0])


def _check_bed(settings: TumbleSettings, forecast: Forecast, material: Material) -> None:
    spike, (piece, width, depth) = forecast.plan.spikes.diameter, settings.bed_size
    length, repeats = settings.bed_length, settings.bed_repeats
    margin = MARGIN * spike
    need = forecast.ahead - forecast.behind + 2 * margin
    on_grains = _length_on_grains(forecast, margin)
    if length < need:
        said = f"bed_size = {piece:g} m along the motion"
        if repeats > 1:
            said += f" with bed_repeats = {repeats}, {length:g} m in all,"
        wanted = math.ceil(100 * max(need, on_grains)) / 100
        farther = "; on grains it may go farther" if on_grains > need * (1 + 1e-9) else ""
        raise ValueError(
            f"{said} is too short: {forecast.on} tips come down from {forecast.behind:.3g} to {forecast.ahead:.3g} m "
            f"of the start within duration = {settings.duration:g} s, which takes {math.ceil(100 * need) / 100:g} m "
            f"with {margin:g} m to spare at both ends{farther}: {wanted:g} m would do, or a shorter duration"
        )
    if width < 3 * spike * (1 - 1e-9):
        raise ValueError(
            f"bed_size = {width:g} m across is narrow for a spike of {spike:g} m: {3 * spike:g} m would do"
        )
    least = forecast.deepest + 2 * spike
    if depth < least:
        raise ValueError(
            f"bed_size = {depth:g} m deep is too shallow: {forecast.on} a tip goes {forecast.deepest:.2g} m "
            f"deep, so with two spikes' diameters below it {least:.2g} m would do"
        )
    if abs(settings.place) > 0.5 * length:
        raise ValueError(
            f"place = {settings.place:g} m is off the bed, {length:g} m long in all: -{0.5 * length:g} to "
            f"{0.5 * length:g} m from its middle would do"
        )
    if settings.place and settings.coarse is not None:
        raise ValueError(
            f"place = {settings.place:g} m with coarse = {settings.coarse:g} m: a graded bed is fine in its middle, "
            f"where the platform must stand; place = 0 or another seed would do"
        )
    if repeats > 1 and settings.coarse is not None:
        raise ValueError(
            f"bed_repeats = {repeats} with coarse = {settings.coarse:g} m: a graded bed is fine under footprints, "
            f"which are not the same in every copy; one of them would do"
        )
    if settings.bed_stages is not None:
        check_bed_stages(
            settings.bed_stages, material, size=settings.bed_size, grain=settings.grain, spread=settings.spread
        )
    if settings.grain > spike:
        raise ValueError(f"grain = {settings.grain:g} m is larger than the spike: at most {spike:g} m would do")
    count = _count(settings, forecast)
    if count > MOST_GRAINS:
        larger = settings.grain * (count / MOST_GRAINS) ** (1 / 3)
        raise ValueError(
            f"grain = {settings.grain:g} m makes about {count:.3g} grains: {larger:.2g} m or a smaller bed would do"
        )


def _length_on_grains(forecast: Forecast, margin: float) -> float:
    """Of a bed whose footprints expected lie in its middle, with room for the farthest that there may be [m]."""
    return 2 * (forecast.farthest + margin) - forecast.behind - forecast.ahead


def _whose_spikes(settings: TumbleSettings, plan: TumblePlan) -> str | None:
    """That a body of another size than the platform's stands on the platform's spikes, in words."""
    spikes, own = plan.spikes, plan.platform.spike_length
    if not spikes.of_platform or settings.spike_length is None or math.isclose(settings.spike_length, own):
        return None
    return (
        f"spike_length = {settings.spike_length:g} is given and {' and '.join(spikes.of_platform)} not: spikes are "
        f"{1e3 * spikes.diameter:g} mm thick and stand {1e3 * spikes.clear:g} mm clear of the hull, where those of "
        f"platform {settings.platform} are {1e3 * own:.4g} mm from its centre to their tips"
    )


def _may_leave(settings: TumbleSettings, forecast: Forecast) -> str | None:
    """That tips may come down beyond the bed before the end, in words; None where they cannot."""
    ahead, spike = settings.bed_length - _origin(settings, forecast), forecast.plan.spikes.diameter
    if ahead >= forecast.farthest + 0.5 * spike:
        return None
    long = _length_on_grains(forecast, MARGIN * spike) + 2 * abs(settings.place)
    longer = f"bed_size = {math.ceil(100 * long) / 100:g} m along it"
    if settings.coarse is None:
        longer += f", bed_repeats = {math.ceil(long / settings.bed_size[0])}"
    return (
        f"sand holds a row, and the torque with it, where the spring-damper lets go: tips may come down "
        f"{forecast.farthest:.3g} m ahead of the start within duration = {settings.duration:g} s, and the bed reaches "
        f"{ahead:.3g} m; a run that leaves it ends there. {longer} or a shorter duration would make sure"
    )


def _count(settings: TumbleSettings, forecast: Forecast) -> float:
    """About how many grains the whole bed will have. Raises ValueError for sizes by place that do not fit it."""
    graded = _graded(settings, forecast)
    count = settings.bed_repeats * expected_grain_count(settings.bed_size, settings.grain, settings.spread)
    if graded is None:
        return count
    graded.check(settings.bed_size)
    return count * graded.share(settings.bed_size)


def _origin(settings: TumbleSettings, forecast: Forecast) -> float:
    """x in the bed of the platform's start [m]: the footprints expected lie in the middle, or `place` from there."""
    return settings.place + 0.5 * settings.bed_length - 0.5 * (forecast.behind + forecast.ahead)


def _graded(settings: TumbleSettings, forecast: Forecast) -> Graded | None:
    """Fine grains where the forecast's tips come down, two spikes' diameters deeper than they go; None: one size."""
    if settings.coarse is None:
        return None
    spike = forecast.plan.spikes.diameter
    return graded_under(
        forecast.trajectory, length=settings.bed_size[0], origin=_origin(settings, forecast),
        spike_diameter=spike, grain=settings.grain, spread=settings.spread, coarse=settings.coarse,
        depth=min(settings.bed_size[2], forecast.deepest + 2 * spike),
    )  # fmt: skip


def _softness(settings: TumbleSettings, plan: TumblePlan, forecast: Forecast) -> Softening:
    """The modulus of the grains for this run (`experiments.softening`), or the one that is set."""
    load = plan.trial.weight
    if plan.trial.counterweight == 0:
        load = max(load, PUSHED[plan.trial.actuator] * forecast.pushed)
    return soften_material(
        _material(plan),
        young=settings.young,
        max_overlap=settings.max_overlap,
        grain=settings.grain,
        spread=settings.spread,
        gravity=_first_gravity(settings, plan),
        bed_height=settings.bed_size[2],
        depth=forecast.margin * forecast.deepest,
        speed=max(forecast.margin * forecast.fastest, _lowering_speed(settings, plan)),
        pressure=load / COPIES / (0.25 * math.pi * plan.spikes.diameter**2),
        fall=RAIN * settings.bed_size[2],
        fastest="the fastest tip's speed",
    )


def _check_young(settings: TumbleSettings, plan: TumblePlan, forecast: Forecast) -> None:
    chosen = _softness(settings.model_copy(update={"young": None}), plan, forecast).young
    check_young(settings.young, chosen=chosen, max_overlap=settings.max_overlap)


def _prepare(
    settings: TumbleSettings, plan: TumblePlan, forecast: Forecast, softening: Softening, progress: Progress
) -> Bed:
    graded = _graded(settings, forecast)
    options: dict[str, Any] = {
        "size": settings.bed_size,
        "grain": settings.grain if graded is None else graded,
        "spread": settings.spread if graded is None else None,
        "gravity": _first_gravity(settings, plan),
        "seed": settings.seed,
        "young": softening.young,
        "max_overlap": settings.max_overlap,
        "arch": settings.arch,
        "threads": settings.threads,
        "cache": settings.cache,
    }
    with held_back() as asked_to_stop:
        if settings.bed_stages is not None:
            return staged_bed(
                _material(plan), settings.bed_stages, **options, progress=progress, asked_to_stop=asked_to_stop
            )
        return Bed.prepare(_material(plan), **options, progress=BedProgress(progress, "bed", asked_to_stop))


def _repeated_told(settings: TumbleSettings, forecast: Forecast, bed: Bed) -> str:
    piece, way = settings.bed_size[0], forecast.ahead - forecast.behind + forecast.plan.spikes.diameter
    said = f"bed laid end to end {settings.bed_repeats} times: {bed.grain_count} grains, the same every {piece:g} m"
    if way <= piece:
        return said
    return f"warning: {said}; {forecast.on} tips come down over {way:.3g} m, so they meet the same sand again"


def _members(settings: TumbleSettings, plan: TumblePlan) -> list[Any]:
    trial, spikes = plan.trial, plan.spikes
    if slots_of(trial.spike_count) < FEWEST_SLOTS:
        raise ValueError(
            f"platform = {settings.platform!r} has {trial.spike_count} rows of spikes in the plane, too near each "
            f"other for a bed of grains: 6, 8 or 16 would do, or `hedgebed tumble spatial`, which takes any platform"
        )
    return platform_members(
        spike_length=trial.spike_length, count=trial.spike_count, diameter=spikes.diameter, clear=spikes.clear,
        hull_radius=_hull_radius(plan), width=settings.bed_size[1],
    )  # fmt: skip


def _hull_radius(plan: TumblePlan) -> float:
    """Of the cylinder that stands for the hull [m]."""
    trial = plan.trial
    sides = (trial.spike_length - plan.spikes.clear) * math.cos(math.pi / trial.spike_count)
    return HULL_SHARE * max(sides, 0.0)


def _stepper(settings: TumbleSettings, plan: TumblePlan, bed: Bed, forecast: Forecast) -> CoupledTumble:
    """The run, the footprints expected put in the middle of the bed."""
    footing = BedFooting(
        bed, _members(settings, plan), origin=(_origin(settings, forecast), 0.5 * bed.size[1]), begin=settings.place,
        copies=COPIES, touch=TOUCH * plan.trial.weight / COPIES, friction=settings.spike_friction,
        restitution=settings.spike_restitution,
    )  # fmt: skip
    bed.max_overlap, bed.overlap_limit = 0.0, run_limit(settings.max_overlap)
    bed.mark_origin()
    if settings.sleep:
        bed.let_sleep(Sleep(force=settings.sleep_force, share=settings.sleep_share))
    lowered = {"lower_gravity": True} if settings.settle_gravity is not None else {}
    return stepper_of(
        settings, plan.trial, footing, **lowered, duration=settings.duration, substeps=settings.substeps,
        body_steps=settings.body_steps, extrapolation=settings.extrapolation, iterations=settings.iterations,
        tip_radius=0.5 * plan.spikes.diameter, lowering_speed=_lowering_speed(settings, plan),
        max_wheel_speed=plan.max_wheel_speed,
    )  # fmt: skip


# The run -------------------------------------------------------------------------------------------------------------


def _follow(settings: TumbleSettings, run: CoupledTumble, folder: RunFolder, progress: Progress) -> Trajectory:
    """To its end, kept every `checkpoint_interval`; a failure leaves its state and what there is of the series."""

    def frames(resumed: bool) -> TumbleFrames | None:
        return TumbleFrames(settings, run, folder.path, resumed=resumed) if settings.frame_count else None

    found: Trajectory = follow(
        run, folder, progress, frames=frames, checkpoint_interval=settings.checkpoint_interval,
        sinkage=lambda: sinkage_start(run), write_series=lambda: write_trajectory(folder.path, run),
    )  # fmt: skip
    return found
