"""Two tumbles in space on one grid of time: place, attitude, states, forces on the spikes, and how far they went apart.

An attitude is a quaternion. Two are as far apart as the angle of the one turn that leads from one to the other, at most
pi. `turn` is that angle from each run's own start.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from experiments.runs.folder import read_series
from experiments.runs.types import Json
from rigid.spatial.quaternions import angle_between

from .settings import say
from .tumbles import ENERGIES, all_gaps, deepest, gap_entries, mean_over, on_one_grid

__all__ = ["MovedInSpace", "compared_columns", "gaps", "read_moved", "told_apart"]

Array = NDArray[np.float64]
QUATERNION = ("q0", "q1", "q2", "q3")
CHANNELS = ("x_m", "y_m", "z_m", "vx_m_s", "vy_m_s", "vz_m_s", "wx_rad_s", "wy_rad_s", "wz_rad_s")
FORCES = {"lift_N": "fz_N", "push_x_N": "fx_N", "push_y_N": "fy_N"}
"""Column of series/compared.csv -> of series/motion.csv."""
NEEDED = {
    "trajectory.csv": ("t_s", *CHANNELS, *QUATERNION, "state"),
    "series/motion.csv": ("t_s", *FORCES.values(), *ENERGIES),
    "series/feet.csv": ("t_s",),
}


@dataclass(frozen=True)
class MovedInSpace:
    """A tumble in space as its run folder has it."""

    series: Mapping[str, Array]  # of trajectory.csv, `state` among them
    motion: Mapping[str, Array]
    feet: Mapping[str, Array]
    weight: float  # (m + m_b) g_sim [N]
    spikes: tuple[str, ...]  # numbers of those that came down, and "hull" if it did
    notes: list[str] = field(default_factory=list)

    @property
    def time(self) -> Array:
        """[s], shape [time]."""
        return self.series["t_s"]


def read_moved(folder: Path, result: Mapping[str, Any]) -> MovedInSpace:
    """What the run in `folder` did. Raises ValueError, naming file and column, where a series is missing."""
    found, again = {}, say("again_in_space", file=folder / "run.toml")
    for name, needed in NEEDED.items():
        try:
            found[name] = read_series(folder / name)
        except OSError:
            raise ValueError(say("no_file", folder=str(folder), name=name, again=again)) from None
        if lacking := [column for column in needed if column not in found[name]]:
            raise ValueError(say("no_column", name=name, folder=str(folder), lacking=", ".join(lacking), again=again))
    path, motion, feet = found.values()
    spikes = tuple(name.split("_")[1] for name in feet if name.startswith("normal_"))
    return MovedInSpace(path, motion, feet, float(result["trial"]["weight"]["value"]), spikes)


def compared_columns(first: MovedInSpace, second: MovedInSpace) -> Json:
    """Both on one grid, `_1` and `_2`: as long as both last; forces are means over 5 ms."""
    columns = on_one_grid(first.series, second.series, CHANNELS)
    time = columns["t_s"]
    attitudes = []
    for number, one in enumerate((first, second), 1):
        turns = _attitudes(one, time)
        attitudes.append(turns)
        columns |= {f"{name}_{number}": turns[:, k] for k, name in enumerate(QUATERNION)}
        columns[f"turn_rad_{number}"] = angle_between(turns, turns[:1])
        depths = [np.zeros(len(time))]
        for spike in one.spikes:
            columns[f"load_{spike}_N_{number}"] = mean_over(time, one.time, one.feet[f"normal_{spike}_N"])
            if f"sinkage_{spike}_m" in one.feet:  # the hull's is not told
                depths.append(np.asarray(np.interp(time, one.time, one.feet[f"sinkage_{spike}_m"])))
                columns[f"sinkage_{spike}_m_{number}"] = depths[-1]
        columns[f"sinkage_m_{number}"] = np.max(depths, axis=0)
        for name, own in FORCES.items():
            columns[f"{name}_{number}"] = mean_over(time, one.motion["t_s"], one.motion[own])
        for name in ENERGIES:
            columns[f"{name}_{number}"] = np.interp(time, one.motion["t_s"], one.motion[name])
    columns["apart_rad"] = angle_between(*attitudes)
    return columns


def _attitudes(one: MovedInSpace, at: Array) -> Array:
    """Quaternions at these times, unit, shape [n, 4]: between two rows along the chord, which is as good as the arc."""
    turns = np.column_stack([one.series[name] for name in QUATERNION])
    same_side = np.cumprod(np.concatenate([[1.0], np.where((turns[1:] * turns[:-1]).sum(axis=1) < 0, -1.0, 1.0)]))
    turns = turns * same_side[:, None]
    between = np.column_stack([np.interp(at, one.time, turns[:, k]) for k in range(4)])
    return np.asarray(between / np.linalg.norm(between, axis=1)[:, None])


def gaps(columns: Mapping[str, Any]) -> dict[str, Json]:
    """How far the two went apart, as quantities of a result."""
    time = columns["t_s"]
    found = gap_entries(columns, (("x", "m"), ("y", "m"), ("z", "m"), ("turn", "rad")))
    apart = {
        "place": (_distance(columns, ("x_m", "y_m", "z_m"), from_start=True), "m", say("place_gap")),
        "attitude": (columns["apart_rad"], "rad", say("attitude_gap")),
        "velocity": (_distance(columns, ("vx_m_s", "vy_m_s", "vz_m_s")), "m/s", say("size_gap")),
        "angular_velocity": (_distance(columns, ("wx_rad_s", "wy_rad_s", "wz_rad_s")), "rad/s", say("size_gap")),
    }
    for name, (values, unit, note) in apart.items():
        at = int(np.argmax(values))
        found[f"gap_{name}"] = (float(values[at]), unit, f"{note}, largest over time, at {time[at]:.4g} s")
        found[f"gap_{name}_end"] = (float(values[-1]), unit, f"the same at {time[-1]:.4g} s")
    return all_gaps(columns, found, say("spike_gap"))


def _distance(columns: Mapping[str, Any], names: tuple[str, ...], *, from_start: bool = False) -> Array:
    """Length of the difference of two vectors over time."""
    one, other = (np.column_stack([columns[f"{name}_{number}"] for name in names]) for number in (1, 2))
    away = other - one
    return np.asarray(np.linalg.norm(away - from_start * away[0], axis=1))


def _never_down(columns: Mapping[str, Any], labels: tuple[str, str]) -> list[str]:
    """That one of the two never touches what it is over, while the other does."""
    down = [bool(np.any(columns[f"lift_N_{number}"])) for number in (1, 2)]
    return [] if down[0] == down[1] else [say("never_down", label=labels[down.index(False)])]


def told_apart(columns: Mapping[str, Any], labels: tuple[str, str]) -> list[str]:
    """What a reader wants to hear of the two."""
    found = {name: float(entry["value"]) for name, entry in gaps(columns).items()}
    height, turns = found["gap_z_end"], [math.degrees(columns[f"turn_rad_{number}"][-1]) for number in (1, 2)]
    first, second = (1e3 * deepest(columns, number) for number in (1, 2))
    return [
        say(
            "at_the_end_in_space", end=float(columns["t_s"][-1]), place=1e3 * found["gap_place_end"], labels=labels,
            up=1e3 * abs(height), height="higher" if height > 0 else "lower",
            attitude=math.degrees(found["gap_attitude_end"]), turns=turns,
        ),
        say(
            "on_the_way_in_space", place=1e3 * found["gap_place"], attitude=math.degrees(found["gap_attitude"]),
            same=100 * found["same_state"],
        ),
        say("deepest_spike", first=first, second=second, labels=labels),
        *_never_down(columns, labels),
    ]  # fmt: skip
