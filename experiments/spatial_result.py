"""What comes of a platform in space: its series and its result."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from coupling import BedFooting, SpatialRun
from dem.materials import caveat
from dem.prepare import fingerprint
from hedgebed import __version__
from rigid.quaternions import to_matrix

from .runfolder import write_series
from .softening import Softening, stable_overlap
from .spatial_settings import SpatialSettings
from .spatial_trial import SpatialPlan
from .surfaces import find_surface
from .tumble_grains_result import PACKING_OFF
from .tumble_words import residual_warning, reversal_warning, unsettled_warning, way_through

__all__ = ["conclude", "write_series_of"]

APART = 5e-3
"""For how long nothing must touch that it counts as a hop [s]: sand that is only grazed lets go and takes hold."""
SLOW = 2e-3
"""Centre and tips of what has settled are slower [m/s]."""
UNITS = {
    "time": "t_s", "vx": "vx_m_s", "vy": "vy_m_s", "vz": "vz_m_s", "wx": "wx_rad_s", "wy": "wy_rad_s",
    "wz": "wz_rad_s", "wheel_x": "wheel_x_rad_s", "wheel_y": "wheel_y_rad_s", "wheel_z": "wheel_z_rad_s",
    "kinetic_energy": "kinetic_J", "potential_energy": "potential_J", "torque_work": "torque_work_J",
    "stored_energy": "stored_J", "energy": "energy_J", "dissipated": "dissipated_J",
    "given": "given_J", "taken": "taken_J", "fx": "fx_N", "fy": "fy_N", "fz": "fz_N", "sinkage": "sinkage_m",
    "x": "x_m", "y": "y_m", "z": "z_m",
}  # fmt: skip
OF_THE_PATH = ("time", "x", "y", "z", "q0", "q1", "q2", "q3", "vx", "vy", "vz", "wx", "wy", "wz", "touching")
FEET = ("normal", "N"), ("along_x", "N"), ("along_y", "N"), ("slip_x", "m_s"), ("slip_y", "m_s"), ("sinkage", "m")
"""Of each spike in series/feet.csv, as `SpatialRun.feet` has them."""


def write_series_of(folder: Path, run: SpatialRun) -> None:
    """trajectory.csv and the series of a run, as far as it has come."""
    (folder / "series").mkdir(exist_ok=True)
    write_series(folder / "trajectory.csv", path_columns(run))
    rows = run.columns
    stored = run.stored_by_row
    rows |= {"stored_energy": stored, "energy": rows["kinetic_energy"] + rows["potential_energy"] + stored}
    rows["dissipated"] = run.dissipated_by_row
    rest = {UNITS.get(name, name): values for name, values in rows.items() if name not in OF_THE_PATH[1:]}
    write_series(folder / "series" / "motion.csv", rest)
    write_series(folder / "series" / "feet.csv", feet_columns(run))
    if isinstance(run.footing, BedFooting):
        samples = run.samples
        for name, values in run.losses.items():
            samples[f"{name}_lost"] = values
        units = {"time": "t_s", "momentum_error": "momentum_error_N_s", "grain_steps": "grain_steps"}
        units["angular_momentum_error"] = "angular_momentum_error_N_m_s"
        named = {units.get(name, f"{name}_J"): values for name, values in samples.items()}
        write_series(folder / "series" / "bed.csv", named)


def path_columns(run: SpatialRun) -> dict[str, Any]:
    """The columns of trajectory.csv."""
    rows = run.columns
    path = {UNITS.get(name, name): rows[name] for name in OF_THE_PATH}
    return path | {"turn_rad": run.turned, "state": np.array(run.states)}


def feet_columns(run: SpatialRun) -> dict[str, Any]:
    """The columns of series/feet.csv: force, slip and depth of the spikes that came down, and of the hull if it did.

    Those that never did are left out; so are the hull's depth, which no footing tells, and friction on a law, which
    says only how large it may be.
    """
    columns: dict[str, Any] = {"t_s": run.columns["time"]}
    feet, hull = run.feet, len(run.trial.platform.tips)
    for spike in np.flatnonzero(feet.any(axis=(0, 1))):
        name = "hull" if spike == hull else str(spike)
        for k, (what, unit) in enumerate(FEET):
            told = name != "hull" if what == "sinkage" else run.footing.gives_friction or not what.startswith("along")
            if told:
                columns[f"{what}_{name}_{unit}"] = feet[:, k, spike]
    return columns


def conclude(
    settings: SpatialSettings,
    plan: SpatialPlan,
    run: SpatialRun,
    beside: SpatialRun | None,
    softening: Softening | None,
    folder: Path,
) -> dict[str, Any]:
    """The result, its series written. `beside`: the trial on the spring-damper, where the run is on grains."""
    write_series_of(folder, run)
    numbers, trial = quantities_of(run), plan.trial
    gravity = plan.numbers["gravity_sim"].value
    stated = f"rig at {gravity:.4g} m/s2" if trial.counterweight > 0 else f"free at {gravity:.4g} m/s2"
    what = "bed of " if settings.ground == "bed" else ""
    warnings = list(plan.warnings)
    if open_books := residual_warning(run.energy_residual):
        warnings.append(open_books)
    if unsettled := unsettled_warning(run.master):
        warnings.append(unsettled)
    result: dict[str, Any] = {
        "format": "hedgebed-result/1", "experiment": "tumble spatial", "version": __version__,
        "title": f"{trial.platform.name} in space on {what}{plan.surface}, {stated}", "status": "done",
        "quantities": numbers, "departures": {"sentences": _sentences(run)},
        "trial": {
            name: {"value": number.value, "unit": number.unit, "origin": number.origin}
            for name, number in plan.numbers.items()
        } | {"weight": {"value": float(np.linalg.norm(trial.weight)), "unit": "N", "origin": "(m + m_b) g_sim"}},
        "surface": plan.surface, "ground": settings.ground, "actuator": settings.actuator,
        "duration": settings.duration, "spike_count": len(trial.platform.tips),
        "transitions": passages(run), "warnings": warnings,
        "macro_step": run.master.macro_step, "steps": run.master.count,
        "lowering_time": run.placing_steps * run.master.macro_step,
    }  # fmt: skip
    if softening is not None and beside is not None:
        write_series(folder / "series" / "spring-damper.csv", path_columns(beside))
        _add_grains(result, settings, plan, run, beside, softening)
    return result


def passages(run: SpatialRun) -> list[dict[str, Any]]:
    """The changes of state, as result.json holds them: `turn` is the angle of the one turn from the start."""
    return [{"time": time, "state": state, "turn": turn} for time, state, turn in run.transitions]


def quantities_of(run: SpatialRun) -> dict[str, dict[str, Any]]:
    """The numbers that every run in space has, as result.json holds them; a value is null where there is none."""
    rows = run.columns
    place = np.column_stack([rows[name] for name in "xyz"])
    way = place[-1] - place[0]
    speed = np.linalg.norm([rows[name] for name in ("vx", "vy", "vz")], axis=0)
    spin = np.linalg.norm([rows[name] for name in ("wx", "wy", "wz")], axis=0)
    turns = np.column_stack([rows[f"q{k}"] for k in range(4)])
    force = np.linalg.norm([rows[name] for name in ("fx", "fy", "fz")], axis=0)
    up = float(to_matrix(turns[-1])[2, 2])
    gap = rows["given"] - rows["taken"]
    bed = isinstance(run.footing, BedFooting)
    found: dict[str, tuple[float | None, str, str]] = {
        "displacement_x": (float(way[0]), "m", "of the centre of mass at the end, from the start"),
        "displacement_y": (float(way[1]), "m", "likewise"),
        "displacement_z": (float(way[2]), "m", "likewise, upwards"),
        "max_speed": (float(speed.max()), "m/s", "of the centre of mass"),
        "max_angular_velocity": (float(spin.max()), "rad/s", ""),
        "largest_turn": (
            float(run.turned.max()), "rad", "angle of the one turn from the start, largest, at most pi",
        ),
        "tilt_end": (math.acos(min(1.0, max(-1.0, up))), "rad", "of its own z from the vertical at the end"),
        **_landing(run),
        **_first_entries(run),
        "sinkage_start": (float(rows["sinkage"][0]), "m", "of the deepest spike when time begins"),
        "sinkage_largest": (float(rows["sinkage"].max()), "m", "of any spike"),
        "largest_spike_force": (float(run.feet[:, 0].max()), "N", "upwards, on one spike, mean of one macro step"),
        "largest_force": (float(force.max()), "N", "of the ground on the platform, mean of one macro step"),
        "energy_residual": (
            run.energy_residual, "1",
            "largest energy of platform, exchange and ground that is not accounted for, over max(|work of the "
            "torques|, W reach, the kinetic energy at the start)",
        ),
        "coupling_residual": (
            float(np.abs(run.balance).max()) / run.energy_scale, "1", "the same of platform and exchange alone",
        ),
        "exchange_residual": (
            float(np.abs(gap - gap[0]).max()) / run.energy_scale, "1",
            "work that the body gives less what the ground takes, largest",
        ),
    }  # fmt: skip
    if bed:
        found["dissipation_reversal"] = (run.dissipation_reversal, "1", "energy that the bed made, largest")
        found["momentum_residual"] = (
            float(run.samples["momentum_error"].max()), "N s",
            "largest of body and grains together, less the impulses of gravity and floor",
        )  # fmt: skip
        found["angular_momentum_residual"] = (
            float(run.samples["angular_momentum_error"].max()), "N m s",
            "likewise about the start, less the moments of weight, wires and floor, of what crosses the bed's periodic "
            "sides and of sleepers; what the exchange leaves is of first order in the bed's step",
        )  # fmt: skip
        for name, values in run.losses.items():
            found[f"dissipated_{name}"] = (float(values[-1]), "J", "by the grains, measured, at the end")
    return {
        name: {"value": value, "std": None, "unit": unit} | ({"note": note} if note else {})
        for name, (value, unit, note) in found.items()
    }


def _first_entries(run: SpatialRun) -> dict[str, tuple[float | None, str, str]]:
    """When and how far turned it first slips and hops, by its states; what starts in flight has not hopped yet."""
    found: dict[str, tuple[float | None, str, str]] = {}
    for state, way in (("slip", run.transitions), ("hop", run.transitions[1:])):
        time, turn = next(((time, turn) for time, name, turn in way if name == state), (None, None))
        note = "first entry by the states; null if there is none"
        found[f"transition_time_{state}"] = (time, "s", note)
        found[f"transition_angle_{state}"] = (turn, "rad", "angle of the one turn from the start there")
    return found


def _landing(run: SpatialRun) -> dict[str, tuple[float | None, str, str]]:
    """When it first touches, leaves and comes to rest, and with which speeds."""
    rows, step = run.columns, run.master.macro_step
    free = rows["touching"] == 0
    touched = int(np.argmin(free)) if not free.all() else None
    left, came, share = None, None, None
    if touched is not None:
        came = max(float(-rows["vz"][touched]), 0.0) if touched else None
        lasting = max(1, round(APART / step))
        run_length = 0
        for k in range(touched, len(free)):
            run_length = run_length + 1 if free[k] else 0
            if run_length == lasting:
                left = k - lasting + 1
                break
        if left is not None and came and rows["vz"][left] > 0:
            share = float(rows["vz"][left]) / came
    speed = np.linalg.norm([rows[name] for name in ("vx", "vy", "vz")], axis=0)
    spin = np.linalg.norm([rows[name] for name in ("wx", "wy", "wz")], axis=0)
    moving = np.flatnonzero(np.maximum(speed, spin * run.trial.platform.reach) > SLOW)
    if not len(moving):
        settled: float | None = 0.0
    else:
        settled = None if moving[-1] == len(speed) - 1 else float(rows["time"][moving[-1] + 1])
    return {
        "first_touch": (None if touched is None else float(rows["time"][touched]), "s", "null: nothing touches"),
        "impact_speed": (came, "m/s", "of the centre of mass downwards at the first touch; null if from the start"),
        "first_hop": (
            None if left is None else float(rows["time"][left]), "s",
            f"from where nothing touches for {1e3 * APART:g} ms after the first touch; null: it does not leave",
        ),
        "restitution": (share, "1", "upward speed there over impact_speed; null where it does not go up from a drop"),
        "settling_time": (settled, "s", "from where centre and tips stay slower than 2 mm/s; null: they do not"),
    }  # fmt: skip


def _sentences(run: SpatialRun) -> list[str]:
    """What happened, in words."""
    rows = run.columns
    said = []
    if run.placing_steps:
        held = run.placing_steps * run.master.macro_step
        said.append(f"A hand set it down in {held:.3g} s: {1e3 * rows['sinkage'][0]:.3g} mm deep.")
    landing = _landing(run)
    touch, hop, rest = (landing[name][0] for name in ("first_touch", "first_hop", "settling_time"))
    if touch is None:
        said.append("It touches nothing in this time.")
    elif touch > 0:
        said.append(f"It comes down at {touch:.4g} s, its centre at {landing['impact_speed'][0]:.3g} m/s.")
    said.append(way_through(run.transitions))
    if hop is not None:
        said.append(f"Nothing touches from {hop:.4g} s on, for a while at least.")
    if rest:
        said.append(f"At rest from {rest:.4g} s on.")
    return said


def _add_grains(
    result: dict[str, Any],
    settings: SpatialSettings,
    plan: SpatialPlan,
    run: SpatialRun,
    beside: SpatialRun,
    softening: Softening,
) -> None:
    """What a run on grains has beyond: the bed's numbers, warnings, the spring-damper's beside."""
    bed = run.footing.bed  # type: ignore[attr-defined]
    done = run.samples["grain_steps"]
    steps = (run.master.count - run.placing_steps) * settings.substeps
    whole = steps * int(bed.grain_count)
    result["code"] = fingerprint()
    result["grains"] = {
        "mode": "rig: grains at 1 g" if plan.trial.counterweight > 0 else "flight: grains at the platform's gravity",
        "grain_count": int(bed.grain_count), "packing_fraction": float(bed.packing_fraction),
        "surface": float(bed.surface), "young": softening.young, "softer_than_real": softening.factor,
        "time_step": float(bed.time_step), "max_overlap": float(bed.max_overlap), "seed": settings.seed,
        "sleep": settings.sleep, "grain_steps": float(done[-1] - done[0]), "grain_steps_all_awake": float(whole),
        "origin": [float(number) for number in run.footing.origin],  # type: ignore[attr-defined]
        "beside": quantities_of(beside), "beside_transitions": passages(beside),
    }  # fmt: skip
    warnings = result["warnings"]
    if reversed_ := reversal_warning(run.dissipation_reversal):
        warnings.append(reversed_)
    stable = stable_overlap(bed.material, settings.max_overlap)
    if pressed := softening.overlapping(float(bed.max_overlap), settings.max_overlap, stable):
        warnings.append(pressed)
    across = 2 * plan.trial.platform.tip_radius / settings.grain
    if across < 10:
        warnings.append(
            f"a spike is {across:.2g} grains across: 10 are wanted for a number to be quoted, 5 for a quick look"
        )
    surface = find_surface(plan.surface)
    if surface.packing is not None and abs(bed.packing_fraction - surface.packing) > PACKING_OFF:
        warnings.append(
            f"the bed's packing fraction is {bed.packing_fraction:.3g}, and its grains ({surface.grains}) were "
            f"calibrated at {surface.packing:g}: what they show is not {plan.surface}"
        )
    if doubt := caveat(bed.material):
        warnings.append(doubt)
    warnings.append("one bed of one seed: two valid beds differ, so differences need several seeds")
