"""`hedgebed tumble --ground bed`: the platform on a bed of grains, beside the same trial on the spring-damper.

In the rig the grains are at 1 g and the platform hangs on its counterweight; with ``gravity`` both are at that. The
spring-damper's trial is integrated first: it says how far and deep the bed must reach, and stands beside the result.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from coupling import MOST_REVERSAL, BedFooting, CoupledTumble, LawFooting, platform_members
from dem import Bed, Sleep
from dem.materials import Material
from dem.materials import material as find_material
from dem.prepare import fingerprint
from rigid.planar import simulate
from rigid.rig import STANDARD_GRAVITY
from rigid.trajectory import Trajectory
from rigid.trial import Trial

from .bed_progress import BedProgress
from .progress import Progress
from .reporting import write_report
from .runfolder import RunFolder, write_series
from .settings import expected_grain_count
from .softening import Softening, soften_material
from .stopping import held_back
from .surfaces import find_surface, surface_names
from .tumble_bed_settings import TumbleBedSettings
from .tumble_grains_frames import TumbleFrames
from .tumble_platform import torque_within_limit
from .tumble_settings import TumbleSettings
from .tumble_steppers import is_plain, own_quantities, stepper_of, words
from .tumble_trial import TumblePlan, plan_tumble

__all__ = ["Forecast", "check_on_grains", "tumble_on_grains"]

COPIES = 2.0
"""Spikes in a row: the bed holds one of them and the sand that it has for itself."""
MARGIN = 3.0
"""Sand beyond the outermost footprint, over a spike's diameter [1]."""
RAIN = 2.5
"""Height of the loose column that a bed is rained from, over the bed's depth [1]."""
TOUCH = 1e-3
"""Force on a row that counts as touching for the torque, over the weight [1]."""
MOST_GRAINS = 3e6
"""More are refused: the run would take days."""
HULL_SHARE = 0.95
"""The hull's cylinder over the distance of its sides from the axis, so that it never stands out of the hull [1]."""
CHECKPOINT = "tumble"


@dataclass(frozen=True)
class Forecast:
    """The same trial on the spring-damper, and what it says of the bed."""

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


def check_on_grains(settings: TumbleSettings) -> None:
    """Raise ValueError, naming key, value and what would do, for a bed that will not do for this trial."""
    plan = _plan(settings)
    _material(plan)
    _members(settings, plan)
    _check_bed(settings, _forecast(settings, plan))


def tumble_on_grains(settings: TumbleSettings, folder: RunFolder, progress: Progress) -> dict[str, Any]:
    """Carry it out in `folder`, from its checkpoint where there is one; the result."""
    with folder.lock():
        plan = _plan(settings)
        for sentence in (*_sentences(settings, plan), *(f"warning: {warning}" for warning in plan.warnings)):
            progress.message(sentence)
        forecast = _forecast(settings, plan)
        softening = _softness(settings, plan, forecast)
        step_time = settings.duration + 0.3  # with the setting down
        progress.plan({"bed": 1.0, "tumble": step_time}, seconds={"report": 10.0})
        try:
            bed = _prepare(settings, plan, softening, progress)
        except RuntimeError as error:
            raise RuntimeError(f"the bed could not be prepared: {error}; change young, max_overlap or seed") from error
        run = _stepper(settings, plan, bed, forecast)
        series = _follow(settings, run, folder, progress)
        result = _conclude(settings, plan, run, series, forecast, softening, folder)
        folder.write_result(result)
        progress.stage("report", total=1.0)
        write_report(folder.path, progress)
        folder.drop_checkpoint(CHECKPOINT)
    return result


def _sentences(settings: TumbleSettings, plan: TumblePlan) -> list[str]:
    """What was left at its default, and what the spring-damper's numbers are for."""
    own = [text for text in plan.sentences() if not text.startswith(("ground =", "method =", "effects =", "sample_"))]
    fields = TumbleBedSettings.model_fields
    given = {*settings.bed_settings_given(), "lowering_speed"}
    own += [f"{name} = {getattr(settings, name)} (default)" for name in fields if name not in given]
    if settings.lowering_speed is None:
        own.append(f"lowering_speed = {_lowering_speed(settings, plan):.4g} m/s (default: sqrt(g grain) of the grains)")
    return [*own, "stiffness, damping: of the spring-damper beside; mu_d: also what tells sliding from sticking"]


# Before it -----------------------------------------------------------------------------------------------------------


def _plan(settings: TumbleSettings) -> TumblePlan:
    """The numbers of the trial: those of the spring-damper, of which grains take all but K, C and friction."""
    return plan_tumble(_beside(settings))


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
    """As set, or the speed of a grain that has fallen half its diameter [m/s], slow for sand in any gravity.

    Its dynamic pressure, 1.1 rho g d, is what sand bears at a depth of a fiftieth of a grain (3D-RFT, `softening`).
    """
    return settings.lowering_speed or math.sqrt(_grain_gravity(plan.trial) * settings.grain)


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
    half = math.pi / trial.spike_count
    angles = found.theta[:, None] + half + 2 * half * np.arange(trial.spike_count)
    tips_x = found.x[:, None] - trial.spike_length * np.sin(angles)
    depth = trial.spike_length * np.cos(angles) - found.y[:, None]
    near = depth > -0.5 * settings.spike_diameter
    speed = np.hypot(
        found.vx[:, None] - found.omega[:, None] * trial.spike_length * np.cos(angles),
        found.vy[:, None] + found.omega[:, None] * trial.spike_length * np.sin(angles),
    )
    return Forecast(
        found, full, float(tips_x[near].min()), float(tips_x[near].max()), float(depth.max()),
        float(speed[near].max()),
    )  # fmt: skip


def _check_bed(settings: TumbleSettings, forecast: Forecast) -> None:
    spike, (length, width, depth) = settings.spike_diameter, settings.bed_size
    margin = MARGIN * spike
    need = forecast.ahead - forecast.behind + 2 * margin
    if length < need:
        raise ValueError(
            f"bed_size = {length:g} m along the motion is too short: on the spring-damper tips come down from "
            f"{forecast.behind:.3g} to {forecast.ahead:.3g} m of the start within duration = {settings.duration:g} s, "
            f"so with {margin:g} m to spare at both ends {math.ceil(100 * need) / 100:g} m or a shorter one would do"
        )
    if width < 3 * spike * (1 - 1e-9):
        raise ValueError(
            f"bed_size = {width:g} m across is narrow for a spike of {spike:g} m: {3 * spike:g} m would do"
        )
    least = forecast.deepest + 2 * spike
    if depth < least:
        raise ValueError(
            f"bed_size = {depth:g} m deep is too shallow: on the spring-damper a tip goes {forecast.deepest:.2g} m "
            f"deep, so with two spikes' diameters below it {least:.2g} m would do"
        )
    if settings.grain > spike:
        raise ValueError(f"grain = {settings.grain:g} m is larger than the spike: at most {spike:g} m would do")
    count = expected_grain_count(settings.bed_size, settings.grain, settings.spread)
    if count > MOST_GRAINS:
        larger = settings.grain * (count / MOST_GRAINS) ** (1 / 3)
        raise ValueError(
            f"grain = {settings.grain:g} m makes about {count:.3g} grains: {larger:.2g} m or a smaller bed would do"
        )


def _softness(settings: TumbleSettings, plan: TumblePlan, forecast: Forecast) -> Softening:
    """The modulus of the grains for this run (`experiments.softening`), or the one that is set."""
    return soften_material(
        _material(plan),
        young=settings.young,
        max_overlap=settings.max_overlap,
        grain=settings.grain,
        gravity=_grain_gravity(plan.trial),
        bed_height=settings.bed_size[2],
        depth=1.5 * forecast.deepest,
        speed=max(1.5 * forecast.fastest, _lowering_speed(settings, plan)),
        pressure=plan.trial.weight / COPIES / (0.25 * math.pi * settings.spike_diameter**2),
        fall=RAIN * settings.bed_size[2],
    )


def _prepare(settings: TumbleSettings, plan: TumblePlan, softening: Softening, progress: Progress) -> Bed:
    with held_back() as asked_to_stop:
        return Bed.prepare(
            _material(plan),
            size=settings.bed_size,
            grain=settings.grain,
            spread=settings.spread,
            gravity=_grain_gravity(plan.trial),
            seed=settings.seed,
            young=softening.young,
            max_overlap=settings.max_overlap,
            threads=settings.threads,
            cache=settings.cache,
            progress=BedProgress(progress, "bed", asked_to_stop),
        )


def _members(settings: TumbleSettings, plan: TumblePlan) -> list[Any]:
    trial = plan.trial
    sides = (trial.spike_length - settings.spike_clear) * math.cos(math.pi / trial.spike_count)
    return platform_members(
        spike_length=trial.spike_length, count=trial.spike_count, diameter=settings.spike_diameter,
        clear=settings.spike_clear, hull_radius=HULL_SHARE * max(sides, 0.0), width=settings.bed_size[1],
    )  # fmt: skip


def _stepper(settings: TumbleSettings, plan: TumblePlan, bed: Bed, forecast: Forecast) -> CoupledTumble:
    """The run, the footprints expected put in the middle of the bed."""
    middle = 0.5 * (forecast.behind + forecast.ahead)
    footing = BedFooting(
        bed, _members(settings, plan), origin=(0.5 * bed.size[0] - middle, 0.5 * bed.size[1]), copies=COPIES,
        touch=TOUCH * plan.trial.weight / COPIES, friction=settings.spike_friction,
        restitution=settings.spike_restitution,
    )  # fmt: skip
    bed.max_overlap = 0.0
    bed.mark_origin()
    if settings.sleep:
        bed.let_sleep(Sleep(force=settings.sleep_force))
    return stepper_of(
        settings, plan.trial, footing, duration=settings.duration, substeps=settings.substeps,
        extrapolation=settings.extrapolation, iterations=settings.iterations, tip_radius=0.5 * settings.spike_diameter,
        lowering_speed=_lowering_speed(settings, plan), max_wheel_speed=plan.max_wheel_speed,
    )  # fmt: skip


# The run -------------------------------------------------------------------------------------------------------------


def _follow(settings: TumbleSettings, run: CoupledTumble, folder: RunFolder, progress: Progress) -> Trajectory:
    """To its end, kept every `checkpoint_interval`; a failure leaves its state and what there is of the series."""
    kept = folder.load_checkpoint(CHECKPOINT)
    if kept is not None:
        run.restore(kept)
        progress.message(f"goes on at {run.time:.4g} s")
    frames = TumbleFrames(settings, run, folder.path, resumed=kept is not None) if settings.frame_count else None
    progress.stage("tumble", total=1.0)
    saved, in_hand = time.monotonic(), not run.placed

    def on_step(run: CoupledTumble) -> None:
        nonlocal saved, in_hand
        progress.update(run.fraction)
        if in_hand and run.placed:
            in_hand = False
            held = run.placing_steps * run.master.macro_step
            progress.message(f"set down after {held:.3g} s: {1e3 * _sinkage_start(run):.3g} mm deep")
        stop = asked_to_stop()
        if not run.done and (stop or time.monotonic() - saved >= settings.checkpoint_interval):
            folder.save_checkpoint(CHECKPOINT, run.state())
            saved = time.monotonic()
        if stop and not run.done:
            raise KeyboardInterrupt

    try:
        with held_back() as asked_to_stop:
            series = run.run(
                on_step=on_step, on_frame=frames.write if frames else None,
                frame_interval=frames.interval if frames else None,
            )  # fmt: skip
    except RuntimeError as error:  # a grain lost, an overlap past its bound, a spike beyond the bed
        folder.save_checkpoint(f"{CHECKPOINT}.failed", run.state())
        if run.placed:
            write_trajectory(folder.path, run)
        raise RuntimeError(
            f"at {run.time:.4g} s: {error}; a longer or deeper bed_size, a shorter duration or another young would do; "
            f"the state is in checkpoint/{CHECKPOINT}.failed.npz"
        ) from error
    folder.save_checkpoint(CHECKPOINT, run.state())
    return series


def write_trajectory(folder: Path, run: CoupledTumble) -> Trajectory:
    """trajectory.csv and the series of a run, as far as it has come."""
    from .tumble import motion_columns, trajectory_columns

    found = run.trajectory()
    (folder / "series").mkdir(exist_ok=True)
    write_series(folder / "trajectory.csv", trajectory_columns(found))
    write_series(folder / "series" / "motion.csv", motion_columns(found))
    rows = run.columns
    columns: dict[str, Any] = {"t_s": rows["time"], "given_J": rows["given"], "taken_J": rows["taken"]}
    for row in range(run.trial.spike_count):
        for k, (name, unit) in enumerate((("normal", "N"), ("along", "N"), ("slip", "m_s"), ("sinkage", "m"))):
            columns[f"{name}_{row}_{unit}"] = run.feet[:, k, row]
    write_series(folder / "series" / "feet.csv", columns)
    samples = run.samples
    units = {"time": "t_s", "momentum_error": "momentum_error_N_s", "grain_steps": "grain_steps"}
    write_series(folder / "series" / "bed.csv", {units.get(name, f"{name}_J"): v for name, v in samples.items()})
    return found


def _conclude(
    settings: TumbleSettings,
    plan: TumblePlan,
    run: CoupledTumble,
    series: Trajectory,
    forecast: Forecast,
    softening: Softening,
    folder: RunFolder,
) -> dict[str, Any]:
    from .tumble import quantities_of, result_of, trajectory_columns

    write_trajectory(folder.path, run)
    write_series(folder.path / "series" / "spring-damper.csv", trajectory_columns(forecast.trajectory))
    result = result_of(settings, plan, series, run.body.wheel_at_limit)
    bed, books = run.footing.bed, run.master.books  # type: ignore[attr-defined]
    result["title"] = words(settings, f"A tumble on a bed of {plan.surface}: {result['title'].partition(': ')[2]}")
    result["code"] = fingerprint()
    added, rests = own_quantities(run)
    result["quantities"] |= _own_quantities(run) | added
    result |= {"tables": [rests]} if rests is not None else {}
    result["quantities"]["energy_residual"]["note"] += (
        "; dissipated is what the bed took less what it is measured to hold more, so what the bed holds cancels: this "
        "checks platform and coupling, not the grains (dissipation_reversal sees energy that they make)"
    )
    result["grains"] = {
        "mode": "rig: grains at 1 g" if plan.trial.counterweight > 0 else "flight: grains at the platform's gravity",
        "series": {
            "own": "trajectory.csv", "feet": "series/feet.csv", "bed": "series/bed.csv",
            "beside": "series/spring-damper.csv",
        },
        "grain_count": int(bed.grain_count), "packing_fraction": float(bed.packing_fraction),
        "surface": float(bed.surface), "young": softening.young, "softer_than_real": softening.factor,
        "time_step": float(bed.time_step), "macro_step": run.master.macro_step,
        "max_overlap": float(bed.max_overlap), "seed": settings.seed, "steps": run.master.count,
        **_grain_steps(settings, run), "worst_guess": books.worst_guess, "largest_force": books.largest_force,
        "beside": quantities_of(forecast.trajectory),
        "beside_transitions": [
            {"time": float(t), "state": state, "theta": float(theta)}
            for t, state, theta in forecast.trajectory.transitions
        ],
    }  # fmt: skip
    made = run.dissipation_reversal
    if made > MOST_REVERSAL:
        result["warnings"].append(
            f"dissipation_reversal = {made:.2g} is above {MOST_REVERSAL:g}: the bed made energy, so this run's "
            f"numbers are not to be trusted; fewer substeps tell whether it is the coupling"
        )
    across = settings.spike_diameter / settings.grain
    if across < 10:
        result["warnings"].append(
            f"a spike is {across:.2g} grains across: 10 are wanted for a number to be quoted, 5 for a quick look"
        )
    if find_surface(plan.surface).granular:
        result["warnings"].append("one bed of one seed: two valid beds differ, so differences need several seeds")
    return result


def _sinkage_start(run: CoupledTumble) -> float:
    """Mean depth of the two rows that it stands on when the torque begins [m]."""
    return float(run.feet[0, 3, [0, -1]].mean())


def _grain_steps(settings: TumbleSettings, run: CoupledTumble) -> dict[str, Any]:
    """Grains computed, step by step, since the torque began, and how many there would be with all of them awake."""
    done = run.samples["grain_steps"]
    steps = (run.master.count - run.placing_steps) * settings.substeps
    whole = steps * int(run.footing.bed.grain_count)  # type: ignore[attr-defined]
    own = float(done[-1] - done[0])
    return {
        "sleep": settings.sleep, "grain_steps": own, "grain_steps_all_awake": float(whole),
        "awake_share": own / whole if whole else None, "grain_steps_lowering": float(done[0]),
        "lowering_time": run.placing_steps * run.master.macro_step,
    }  # fmt: skip


def _own_quantities(run: CoupledTumble) -> dict[str, dict[str, Any]]:
    """What a tumble on grains has beyond the planar model's numbers."""
    sinkage = run.feet[:, 3]
    gap = run.columns["given"] - run.columns["taken"]
    found = {
        "sinkage_start": (_sinkage_start(run), "m", "of the two rows it stands on, mean, when the torque begins"),
        "sinkage_largest": (float(sinkage.max()), "m", "of any row"),
        "largest_row_force": (float(run.feet[:, 0].max()), "N", "upwards, mean of one macro step"),
        "exchange_residual": (
            float(np.abs(gap - gap[0]).max()) / run.energy_scale, "1",
            "work that the body gives less what the bed takes, largest, over max(|work of the torque|, W l)",
        ),
        "dissipation_reversal": (
            run.dissipation_reversal, "1",
            "largest fall of the dissipated energy below what it was before, over max(|work of the torque|, W l), at "
            f"the times of series/bed.csv: energy that the bed made beyond what it dissipated; a warning above "
            f"{MOST_REVERSAL:g}",
        ),
        "momentum_residual": (
            float(run.samples["momentum_error"].max()), "N s",
            "largest of body and grains together, less the impulses of gravity and floor",
        ),
    }  # fmt: skip
    return {
        name: {"value": value, "std": None, "unit": unit, "note": note} for name, (value, unit, note) in found.items()
    }
