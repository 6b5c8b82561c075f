"""What a run of a platform in space leaves: its frames, its series and its result."""

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from coupling import BedGround, SpatialRun
from coupling.members import HULL, spatial_members
from dem.prepare.prepare import fingerprint
from experiments.grains import bed_result as grains
from experiments.grains.softening import Softening
from experiments.grains.spells import spells
from experiments.grains.tracked_frames import PlatformFrames, member_mesh
from experiments.runs.folder import write_series
from experiments.runs.result import Result
from experiments.runs.result import quantities_of as as_quantities
from experiments.runs.types import Json
from experiments.tumble.result import way_through
from rigid.platform.solids import Mesh, merge
from rigid.spatial.quaternions import to_matrix

from . import say
from .leap import Numbers, leap_of
from .settings import SpatialSettings
from .trial import SpatialPlan

__all__ = ["SpatialFrames", "conclude", "sinkage_start", "write_series_of"]

APART = 5e-3  # A hop lasts at least that long [s]: grazed sand loses and regains contact
SLOW = 2e-3  # Centre and tips of what has settled are slower [m/s]
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


Array = NDArray[np.float64]


class SpatialFrames(PlatformFrames[SpatialRun]):
    """All spikes and the hull (grains meet the ball inside); `row_forces` are of each spike that touches."""

    def body_meshes(self, run: SpatialRun) -> dict[str, Mesh]:
        platform = run.trial.platform
        hull = platform.hull()
        found = {"hull": Mesh(hull.vertices - platform.centre_of_mass, hull.faces)}
        if platform.tip_radius > 0:
            spikes = [member for member in spatial_members(platform) if member.row != HULL]
            found["spikes"] = merge([member_mesh(spike, segments=16) for spike in spikes])
        return found

    def values(self, run: SpatialRun) -> dict[str, float]:
        """The ground's force on the platform [N]."""
        return {f"force_{axis}": float(run.master.wrench.force[k]) for k, axis in enumerate("xyz")}

    def row_forces(self, run: SpatialRun, origin: Array) -> tuple[Array, dict[str, Array]]:
        """At the points of the last step's contacts; under a Coulomb bound the normal force alone."""
        contacts = run.master.last.by_member if run.master.last is not None else {}
        at = [origin + contact.point for contact in contacts.values()]
        force = [
            np.array([0.0, 0.0, contact.normal_force])
            + (contact.tangential_force if contact.tangential_force is not None else 0.0)
            for contact in contacts.values()
        ]
        numbers = np.array([float(row) for row in contacts])
        return np.array(at).reshape(-1, 3), {"force": np.array(force).reshape(-1, 3), "row": numbers}


def write_series_of(run: SpatialRun, folder: Path) -> None:
    """trajectory.csv and the series of a run, as far as it has come."""
    write_series(folder / "trajectory.csv", path_columns(run))
    rows = run.columns
    stored = run.stored_by_row
    rows |= {"stored_energy": stored, "energy": rows["kinetic_energy"] + rows["potential_energy"] + stored}
    rows["dissipated"] = run.dissipated_by_row
    rest = {UNITS.get(name, name): values for name, values in rows.items() if name not in OF_THE_PATH[1:]}
    write_series(folder / "series" / "motion.csv", rest)
    write_series(folder / "series" / "feet.csv", feet_columns(run))
    if isinstance(run.ground, BedGround):
        grains.write_bed_series(folder, run)


def sinkage_start(run: SpatialRun) -> float:
    """Depth of the deepest spike when time begins [m]."""
    return float(run.columns["sinkage"][0])


def path_columns(run: SpatialRun) -> Json:
    """The columns of trajectory.csv."""
    rows = run.columns
    path = {UNITS.get(name, name): rows[name] for name in OF_THE_PATH}
    return path | {"turn_rad": run.turned, "state": np.array(run.states)}


def feet_columns(run: SpatialRun) -> Json:
    """The columns of series/feet.csv: force, slip and depth of the spikes that came down, and of the hull if it did.

    Those that never did are left out. So is the hull's depth, which no ground gives, and friction on a law, which gives
    only its bound.
    """
    columns: Json = {"t_s": run.columns["time"]}
    feet, hull = run.feet, len(run.trial.platform.tips)
    for spike in np.flatnonzero(feet.any(axis=(0, 1))):
        name = "hull" if spike == hull else str(spike)
        for k, (what, unit) in enumerate(FEET):
            known = name != "hull" if what == "sinkage" else run.ground.gives_friction or not what.startswith("along")
            if known:
                columns[f"{what}_{name}_{unit}"] = feet[:, k, spike]
    return columns


def conclude(
    settings: SpatialSettings,
    plan: SpatialPlan,
    run: SpatialRun,
    folder: Path,
    *,
    beside: SpatialRun | None = None,
    softening: Softening | None = None,
    spread: Callable[[Json], None] | None = None,
) -> Result:
    """The result, its series written. On grains `beside` is the trial on the spring-damper.

    `spread` adds what the errors of the law change.
    """
    write_series_of(run, folder)
    numbers, trial, in_rig = quantities_of(run), plan.trial, plan.trial.counterweight > 0
    where, what = "rig" if in_rig else "free", "bed of " if settings.on_grains else ""
    title = say("title", plan=plan, what=what, where=where, gravity=plan.numbers["gravity_sim"].value)
    warnings = [*plan.warnings, grains.residual_warning(run.energy_residual), grains.unsettled_warning(run.master)]
    result: Json = {
        "title": title, "status": "done",
        "quantities": numbers, "departures": {"sentences": _sentences(run)},
        "trial": plan.trial_table(float(np.linalg.norm(trial.weight))),
        "surface": plan.surface, "ground": "bed" if settings.on_grains else settings.ground,
        "actuator": settings.actuator,
        "duration": settings.duration, "spike_count": len(trial.platform.tips),
        "transitions": passages(run), "warnings": warnings,
        "macro_step": run.master.macro_step, "steps": run.master.count,
        "lowering_time": run.placing_steps * run.master.macro_step,
    }  # fmt: skip
    if spread is not None:
        spread(result)
    if softening is not None and beside is not None and isinstance(run.ground, BedGround):
        write_series(folder / "series" / "spring-damper.csv", path_columns(beside))
        bed = run.ground.bed
        result["code"] = fingerprint()
        result["grains"] = grains.bed_numbers(settings, run, bed, softening, in_rig=in_rig) | {
            "origin": [float(number) for number in run.ground.origin], "beside": quantities_of(beside),
            "beside_transitions": passages(beside),
        }  # fmt: skip
        warnings += [
            grains.reversal_warning(run.dissipation_reversal),
            grains.overlap_warning(bed, softening, settings.max_overlap),
            *grains.bed_warnings(bed, plan.surface, across=2 * trial.platform.tip_radius / settings.grain),
            say("one_bed"),
        ]  # fmt: skip
    result["warnings"] = [warning for warning in warnings if warning]
    return Result.make("tumble spatial", **result)


def passages(run: SpatialRun) -> list[Json]:
    """The changes of state, as result.json holds them: `turn` is the angle of the one turn from the start."""
    return [{"time": time, "state": state, "turn": turn} for time, state, turn in run.transitions]


def quantities_of(run: SpatialRun) -> dict[str, Json]:
    """The numbers that every run in space has, as result.json holds them; a value is null where there is none."""
    rows = run.columns
    place = np.column_stack([rows[name] for name in "xyz"])
    way = place[-1] - place[0]
    speed = np.linalg.norm([rows[name] for name in ("vx", "vy", "vz")], axis=0)
    spin = np.linalg.norm([rows[name] for name in ("wx", "wy", "wz")], axis=0)
    turns = np.column_stack([rows[f"q{k}"] for k in range(4)])
    force = np.linalg.norm([rows[name] for name in ("fx", "fy", "fz")], axis=0)
    up, balance = float(to_matrix(turns[-1])[2, 2]), run.balance_numbers
    found: dict[str, tuple[float | None, str, str]] = {
        "displacement_x": (float(way[0]), "m", say("displacement")),
        "displacement_y": (float(way[1]), "m", "likewise"),
        "displacement_z": (float(way[2]), "m", "the same, upwards"),
        "max_speed": (float(speed.max()), "m/s", "of the centre of mass"),
        "max_angular_velocity": (float(spin.max()), "rad/s", ""),
        "largest_turn": (float(run.turned.max()), "rad", say("largest_turn")),
        "tilt_end": (math.acos(min(1.0, max(-1.0, up))), "rad", say("tilt")),
        **_landing(run),
        **_first_entries(run),
        **_leap(run),
        "sinkage_start": (float(rows["sinkage"][0]), "m", "of the deepest spike when time begins"),
        "sinkage_largest": (float(rows["sinkage"].max()), "m", "of any spike"),
        "largest_spike_force": (float(run.feet[:, 0].max()), "N", say("spike_force")),
        "largest_force": (float(force.max()), "N", say("whole_force")),
        "energy_residual": (run.energy_residual, "1", say("residual")),
    }
    notes = {"coupling_residual": say("coupling"), "exchange_residual": say("exchange")}
    if isinstance(run.ground, BedGround):
        notes |= {
            "dissipation_reversal": say("reversal"), "momentum_residual": say("momentum"),
            "angular_momentum_residual": say("angular_momentum"),
        } | {f"dissipated_{name}": say("by_grains") for name in run.losses}  # fmt: skip
    found |= {name: (*balance[name], note) for name, note in notes.items()}
    return as_quantities(found, std=None)


def _first_entries(run: SpatialRun) -> dict[str, tuple[float | None, str, str]]:
    """When and how far turned it first slips and hops, by its states; what starts in flight has not hopped yet."""
    found: dict[str, tuple[float | None, str, str]] = {}
    for state, way in (("slip", run.transitions), ("hop", run.transitions[1:])):
        time, turn = next(((time, turn) for time, name, turn in way if name == state), (None, None))
        found[f"transition_time_{state}"] = (time, "s", say("first_entry"))
        found[f"transition_angle_{state}"] = (turn, "rad", say("turn_there"))
    return found


def _leap(run: SpatialRun) -> Numbers:
    """Launch, distance and height of its longest hop, as a parabola."""
    rows, trial = run.columns, run.trial
    gravity = float(np.linalg.norm(trial.weight)) / (trial.platform.mass + trial.counterweight)
    velocity = np.column_stack([rows[name] for name in ("vx", "vy", "vz")])
    lasting = max(1, round(APART / run.master.macro_step))
    return leap_of(rows["touching"], velocity, gravity=gravity, lasting=lasting)


def _landing(run: SpatialRun) -> dict[str, tuple[float | None, str, str]]:
    """When it first touches, leaves and comes to rest, and with which speeds."""
    rows, step = run.columns, run.master.macro_step
    free = rows["touching"] == 0
    touched = int(np.argmin(free)) if not free.all() else None
    left, came, share = None, None, None
    if touched is not None:
        came = max(float(-rows["vz"][touched]), 0.0) if touched else None
        lasting = max(1, round(APART / step))
        left = next((touched + low for low, high in spells(free[touched:]) if high - low >= lasting), None)
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
        "first_touch": (None if touched is None else float(rows["time"][touched]), "s", say("first_touch")),
        "impact_speed": (came, "m/s", say("impact")),
        "first_hop": (None if left is None else float(rows["time"][left]), "s", say("first_hop", apart=1e3 * APART)),
        "restitution": (share, "1", say("restitution")),
        "settling_time": (settled, "s", say("settling")),
    }


def _sentences(run: SpatialRun) -> list[str]:
    """What happened, in words."""
    rows = run.columns
    sentences = []
    if run.placing_steps:
        held = run.placing_steps * run.master.macro_step
        sentences.append(say("placed", held=held, depth=1e3 * rows["sinkage"][0]))
    landing = _landing(run)
    touch, hop, rest = (landing[name][0] for name in ("first_touch", "first_hop", "settling_time"))
    if touch is None:
        sentences.append(say("touches_nothing"))
    elif touch > 0:
        sentences.append(say("comes_down", touch=touch, speed=landing["impact_speed"][0]))
    sentences.append(way_through(run.transitions))
    if hop is not None:
        sentences.append(say("lets_go", hop=hop))
    if rest:
        sentences.append(say("at_rest", rest=rest))
    return sentences
