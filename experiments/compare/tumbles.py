"""Two tumbles on one grid of time: where they were, what held them up, how far they went apart."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from experiments.platform.numbers import tip_angles, tip_depth
from experiments.runs.folder import read_series
from experiments.runs.result import quantities_of
from experiments.runs.types import Json

from .settings import say

__all__ = [
    "ENERGIES", "Entries", "Moved", "all_gaps", "compared_columns", "deepest", "gap_entries", "gaps", "mean_over",
    "on_one_grid", "read_moved", "row_sinkage", "told_apart",
]  # fmt: skip

Array = NDArray[np.float64]
INTERVAL = 1e-3
"""Between rows of series/compared.csv [s]; longer where that would be more than MOST_ROWS."""
MOST_ROWS = 20_000
WINDOW = 5e-3
"""Over which forces are averaged [s], as states are read off forces."""
CHANNELS = ("x_m", "y_m", "theta_rad", "vx_m_s", "vy_m_s", "omega_rad_s")
ENERGIES = ("kinetic_J", "potential_J", "stored_J", "energy_J", "torque_work_J", "dissipated_J")


@dataclass(frozen=True)
class Moved:
    """A tumble as its run folder has it."""

    series: Mapping[str, Array]  # of trajectory.csv, `state` among them
    motion: Mapping[str, Array]
    count: int  # rows of spikes
    sinkage: Array  # depth of the lowest point of each row [m], 0 above the surface, shape [time, row]
    load: Array | None  # on each row, upwards [N], shape [time, row]; None where it is not known
    lift: Array | None  # the ground's force, upwards [N], shape [time]
    push: Array | None  # the same, along x [N]
    weight: float = 0.0  # (m + m_b) g_sim [N]
    notes: list[str] = field(default_factory=list)

    @property
    def time(self) -> Array:
        """[s], shape [time]."""
        return self.series["t_s"]


def read_moved(folder: Path, result: Mapping[str, Any]) -> Moved:
    """What the run in `folder` did. Raises ValueError where a series is missing."""
    try:
        series = read_series(folder / "trajectory.csv")
        motion = read_series(folder / "series" / "motion.csv")
    except OSError as error:
        raise ValueError(f"runs: {str(folder)!r} has no {Path(str(error.filename)).name}: run it again") from None
    trial = {name: entry["value"] for name, entry in result["trial"].items()}
    count = int(result["spike_count"])
    path = folder / "series" / "feet.csv"
    feet = read_series(path) if path.exists() else None
    angle = tip_angles(count, series["theta_rad"])
    # A result of before `tip_radius` was written has it among its effects.
    of_effects = (effect["parameters"]["radius"] for effect in result["effects"] if effect["id"] == "tip-radius")
    radius, length = float(result.get("tip_radius", next(of_effects, 0.0))), trial["spike_length"]
    depth = tip_depth(series["theta_rad"], series["y_m"], count=count, length=length, radius=radius)
    sinkage, load = np.maximum(depth, 0.0), None
    notes = []
    effects = bool(result["effects"])
    if feet is not None:
        sinkage = np.column_stack([feet[f"sinkage_{row}_m"] for row in range(count)])
        load = np.column_stack([feet[f"normal_{row}_N"] for row in range(count)])
    elif result["ground"] == "spring-damper" and not effects:
        # docs/planar.md: K delta + C max(0, rate of delta), of a tip at the end of each row
        rate = -series["vy_m_s"][:, None] - length * np.sin(angle) * series["omega_rad_s"][:, None]
        load = np.where(depth > 0, trial["stiffness"] * depth + trial["damping"] * np.maximum(rate, 0.0), 0.0)
    else:
        notes.append(say("no_load"))
    lift = push = None
    if effects:
        notes.append(say("with_effects"))
    else:
        lift = (trial["mass"] + trial["counterweight"]) * motion["ay_m_s2"] + trial["weight"]
        push = trial["mass"] * motion["ax_m_s2"]
    return Moved(series, motion, count, sinkage, load, lift, push, trial["weight"], notes)


def compared_columns(first: Moved, second: Moved) -> Json:
    """Both on one grid, `_1` and `_2`: as long as both last; forces are means over 5 ms."""
    columns = on_one_grid(first.series, second.series, CHANNELS)
    time = columns["t_s"]
    for number, one in enumerate((first, second), 1):
        for row in range(one.count):
            columns[f"sinkage_{row}_m_{number}"] = np.interp(time, one.time, one.sinkage[:, row])
            if one.load is not None:
                columns[f"load_{row}_N_{number}"] = mean_over(time, one.time, one.load[:, row])
        for name, values in (("lift_N", one.lift), ("push_N", one.push)):
            if values is not None:
                columns[f"{name}_{number}"] = mean_over(time, one.time, values)
        for name in ENERGIES:
            columns[f"{name}_{number}"] = np.interp(time, one.motion["t_s"], one.motion[name])
    return columns


def on_one_grid(first: Mapping[str, Array], second: Mapping[str, Array], channels: Sequence[str]) -> Json:
    """`t_s` as long as both trajectories last, their channels `_1` and `_2` there, and the state that each is in."""
    end = float(min(first["t_s"][-1], second["t_s"][-1]))
    step = max(INTERVAL, end / MOST_ROWS)
    time: Array = np.asarray(np.arange(math.floor(end / step + 1e-9) + 1) * step, dtype=float)
    columns: Json = {"t_s": time}
    for number, one in enumerate((first, second), 1):
        for name in channels:
            columns[f"{name}_{number}"] = np.interp(time, one["t_s"], one[name])
        nearest = np.clip(np.searchsorted(one["t_s"], time, side="right") - 1, 0, len(one["t_s"]) - 1)
        columns[f"state_{number}"] = np.asarray(one["state"])[nearest]
    return columns


def mean_over(at: Array, time: Array, values: Array) -> Array:
    """Mean over WINDOW about each time, by the trapezoidal rule; over what there is of it at the ends."""
    whole = np.concatenate([[0.0], np.cumsum(0.5 * np.diff(time) * (values[1:] + values[:-1]))])
    low, high = np.maximum(at - 0.5 * WINDOW, time[0]), np.minimum(at + 0.5 * WINDOW, time[-1])
    return np.asarray((np.interp(high, time, whole) - np.interp(low, time, whole)) / np.maximum(high - low, 1e-12))


def gaps(columns: Mapping[str, Any]) -> dict[str, Json]:
    """How far the two went apart, as quantities of a result."""
    return all_gaps(columns, gap_entries(columns, (("x", "m"), ("y", "m"), ("theta", "rad"))), say("row_gap"))


Entries = dict[str, tuple[float, str, str]]
"""Name -> value, unit and note of a quantity."""


def gap_entries(columns: Mapping[str, Any], channels: Sequence[tuple[str, str]]) -> Entries:
    """Largest difference of each channel (name and unit), and that at the end."""
    time = columns["t_s"]
    found: Entries = {}
    for name, unit in channels:
        # Second less first; of the path, each from its own start: a body sinks before its torque begins.
        one, other = (np.asarray(columns[f"{name}_{unit}_{number}"]) for number in (1, 2))
        away = other - one - (other[0] - one[0] if unit == "m" else 0.0)
        at = int(np.argmax(np.abs(away)))
        found[f"gap_{name}"] = (float(np.abs(away[at])), unit, f"largest over time, at {time[at]:.4g} s")
        found[f"gap_{name}_end"] = (float(away[-1]), unit, f"second less first at {time[-1]:.4g} s")
    return found


def all_gaps(columns: Mapping[str, Any], found: Entries, of_sinkage: str) -> dict[str, Json]:
    """As quantities: these, the share of time in which both are in the same state, the gap of the deepest sinkage."""
    same = np.asarray(columns["state_1"]) == np.asarray(columns["state_2"])
    found["same_state"] = float(same.mean()), "1", "share of the time in which both are in the same state"
    found["gap_sinkage"] = deepest(columns, 2) - deepest(columns, 1), "m", of_sinkage
    return quantities_of(found)


def deepest(columns: Mapping[str, Any], number: int) -> float:
    """Largest sinkage of any row of the one run [m]."""
    rows = [values for name, values in columns.items() if name.startswith("sinkage_") and name.endswith(f"_{number}")]
    return float(np.max(rows))


def row_sinkage(columns: Mapping[str, Any], count: int) -> list[Json]:
    """Largest sinkage [m] of each of `count` rows that goes in, in either run, while both last: row, first, second."""
    found = []
    for row in range(count):
        first, second = (float(np.max(columns[f"sinkage_{row}_m_{number}"])) for number in (1, 2))
        if first > 0 or second > 0:
            found.append({"row": row, "first": first, "second": second})
    return found


def told_apart(columns: Mapping[str, Any], labels: tuple[str, str]) -> list[str]:
    """What a reader wants to hear of the two."""
    found = {name: float(entry["value"]) for name, entry in gaps(columns).items()}
    ahead, up, turned = 1e3 * found["gap_x_end"], 1e3 * found["gap_y_end"], math.degrees(found["gap_theta_end"])
    first, second = (1e3 * deepest(columns, number) for number in (1, 2))
    return [
        say(
            "at_the_end", end=float(columns["t_s"][-1]), labels=labels, ahead=abs(ahead), up=abs(up),
            turned=abs(turned), along="ahead" if ahead > 0 else "behind", height="higher" if up > 0 else "lower",
            more="more" if turned > 0 else "less",
        ),
        say(
            "on_the_way", x=1e3 * found["gap_x"], y=1e3 * found["gap_y"], theta=math.degrees(found["gap_theta"]),
            same=100 * found["same_state"],
        ),
        say("deepest_row", first=first, second=second, labels=labels),
    ]  # fmt: skip
