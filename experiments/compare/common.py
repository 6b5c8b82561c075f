"""Numbers that go with how long a run lasts, over the time that two runs both last: the whole of each is beside.

A largest value, a state at the end and an event are taken from the series that the run folder holds; where the run's
own number was met within that time, it is that number, to the bit.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from experiments.runs.folder import read_series
from experiments.runs.result import quantities_of
from experiments.runs.types import Json
from rigid.planar.trajectory import LAUNCH_DISTANCE

from .spatial import QUATERNION, MovedInSpace
from .tumbles import Moved

__all__ = ["ALIKE", "TIMELESS", "common_time", "numbers_until", "sinkage_of"]

Array = NDArray[np.float64]
ALIKE = 2e-3
"""Runs whose ends are no further apart last equally long [s]."""
TIMELESS = ("tipping_torque", "slip_torque", "sinkage_start")
"""Numbers that do not go with how long a run lasts."""
LOST = ("damping", "friction", "rolling")


@dataclass
class _Numbers:
    """What a run's numbers are made of: largest values and final ones over time, events at a time (None: never)."""

    largest: dict[str, tuple[Array, Array]] = field(default_factory=dict)
    final: dict[str, tuple[Array, Array]] = field(default_factory=dict)
    events: dict[str, float | None] = field(default_factory=dict)


def common_time(moved: list[Moved] | list[MovedInSpace]) -> float | None:
    """How long both runs last [s]; None where they last equally long."""
    ends = [float(one.time[-1]) for one in moved]
    return min(ends) if abs(ends[0] - ends[1]) > ALIKE else None


def numbers_until(
    end: float, moved: Moved | MovedInSpace, result: Mapping[str, Any], folder: Path
) -> dict[str, float | None]:
    """Those of the result's quantities that go with how long it lasts, until `end` [s]; all in SI."""
    own = {name: entry.get("value") for name, entry in result.get("quantities", {}).items()}
    known = _in_space(moved, result) if isinstance(moved, MovedInSpace) else _in_the_plane(moved, result)
    path = folder / "series" / "bed.csv"
    bed = read_series(path) if path.exists() else {}
    known.final |= {
        f"dissipated_{name}": (bed["t_s"], bed[f"{name}_lost_J"]) for name in LOST if f"{name}_lost_J" in bed
    }
    found: dict[str, float | None] = {}
    if float(moved.time[-1]) <= end + ALIKE:
        names = (*known.largest, "time_of_max_speed", *known.final, *known.events)
        return {name: own[name] for name in names if name in own}
    for name, (time, values) in known.largest.items():
        if name not in own:
            continue
        within = float(time[int(np.argmax(values))]) <= end
        found[name] = own[name] if within else float(values[time <= end].max())
    if "max_speed" in known.largest and "time_of_max_speed" in own:
        time, values = known.largest["max_speed"]
        at = float(time[int(np.argmax(np.where(time <= end, values, -1.0)))])
        found["time_of_max_speed"] = own["time_of_max_speed"] if found["max_speed"] == own["max_speed"] else at
    found |= {name: float(np.interp(end, *rows)) for name, rows in known.final.items() if name in own}
    for name, when in known.events.items():
        if name in own:
            found[name] = own[name] if when is not None and when <= end else None
    return found


def sinkage_of(moved: Moved) -> dict[str, Json]:
    """`sinkage_start` and `sinkage_largest` as a tumble on grains has them, of a run whose result lacks them."""
    stood, deepest = float(moved.sinkage[0, [0, -1]].mean()), float(moved.sinkage.max())
    return quantities_of(
        {
            "sinkage_start": (stood, "m", "of the two rows it stands on, mean, when the torque begins"),
            "sinkage_largest": (deepest, "m", "of any row"),
        }
    )


def _in_the_plane(moved: Moved, result: Mapping[str, Any]) -> _Numbers:
    series, time = moved.series, moved.time
    known = _Numbers()
    known.largest["max_speed"] = time, np.hypot(series["vx_m_s"], series["vy_m_s"])
    known.largest["max_angular_velocity"] = time, np.abs(series["omega_rad_s"])
    known.largest["sinkage_largest"] = time, moved.sinkage.max(axis=1)
    if moved.load is not None:
        known.largest["largest_row_force"] = time, moved.load.max(axis=1)
    away = np.hypot(series["x_m"] - series["x_m"][0], series["y_m"] - series["y_m"][0])
    gone = np.flatnonzero(away >= LAUNCH_DISTANCE)
    known.events["trajectory_angle"] = float(time[gone[0]]) if len(gone) else None
    for state in ("slip", "hop"):
        known.events[f"transition_angle_{state}"] = next(
            (float(entry["time"]) for entry in result["transitions"] if entry["state"] == state), None
        )
    return known


def _in_space(moved: MovedInSpace, result: Mapping[str, Any]) -> _Numbers:
    series, time, own = moved.series, moved.time, result["quantities"]
    known = _Numbers()

    def size(columns: Mapping[str, Array], *names: str) -> Array:
        return np.asarray(np.linalg.norm([columns[name] for name in names], axis=0))

    known.largest["max_speed"] = time, size(series, "vx_m_s", "vy_m_s", "vz_m_s")
    known.largest["max_angular_velocity"] = time, size(series, "wx_rad_s", "wy_rad_s", "wz_rad_s")
    known.largest["largest_force"] = moved.motion["t_s"], size(moved.motion, "fx_N", "fy_N", "fz_N")
    if "turn_rad" in series:
        known.largest["largest_turn"] = time, series["turn_rad"]
    feet = moved.feet["t_s"]
    for name, begin in (("sinkage_largest", "sinkage_"), ("largest_spike_force", "normal_")):
        if spikes := [moved.feet[f"{begin}{spike}_{unit}"] for spike in moved.spikes for unit in ("m", "N")
                      if spike != "hull" and f"{begin}{spike}_{unit}" in moved.feet]:  # fmt: skip
            known.largest[name] = feet, np.max(spikes, axis=0)
    for axis in "xyz":
        known.final[f"displacement_{axis}"] = time, series[f"{axis}_m"] - series[f"{axis}_m"][0]
    q = [series[name] for name in QUATERNION]
    up = 1.0 - 2.0 * (q[1] ** 2 + q[2] ** 2) / np.sum(np.square(q), axis=0)
    known.final["tilt_end"] = time, np.arccos(np.clip(up, -1.0, 1.0))

    def when(name: str) -> float | None:
        value = own.get(name, {}).get("value")
        return float(value) if isinstance(value, int | float) and math.isfinite(value) else None

    goes_with = {"first_touch": ("impact_speed",), "first_hop": ("restitution",)}
    goes_with |= {f"transition_time_{state}": (f"transition_angle_{state}",) for state in ("slip", "hop")}
    for name, others in goes_with.items():
        known.events |= dict.fromkeys((name, *others), when(name))
    return known
