"""Two runs of one robot of MuJoCo on one grid of time: place, forces on the feet, how far they went apart.

The two may be on a law and on grains, on two laws, or on grains here and in LAMMPS. They must have the same feet.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from experiments.grains.spells import spells
from experiments.runs.folder import read_series
from experiments.runs.types import Json

from .settings import say
from .tumbles import all_gaps, deepest, gap_entries, mean_over, on_one_grid

__all__ = ["MovedRobot", "check_alike", "compared_columns", "gaps", "numbers_over_time", "read_moved", "told_apart"]

Array = NDArray[np.float64]
CHANNELS = ("x_m", "y_m", "z_m", "sinkage_m")
FORCES = {"lift_N": "fz_N", "push_x_N": "fx_N", "push_y_N": "fy_N"}
"""Column of series/compared.csv -> of series/motion.csv."""
ENERGIES = ("kinetic_J", "potential_J", "torque_work_J", "actuator_work_J", "given_J", "taken_J")
NEEDED = {"series/motion.csv": ("t_s", *CHANNELS, *FORCES.values(), *ENERGIES, "touching"), "series/feet.csv": ("t_s",)}
APART = 5e-3
"""A flight lasts at least that long [s], as in the result of a robot."""
SAME = 1e-6
"""Relative difference of two masses that is round-off [1]."""


@dataclass(frozen=True)
class MovedRobot:
    """A robot's run as its folder has it."""

    series: Mapping[str, Array]  # of series/motion.csv, and `state`: "touches" or "flies"
    feet: Mapping[str, Array]  # of series/feet.csv
    names: tuple[str, ...]  # of the feet
    weight: float  # [N]
    notes: list[str] = field(default_factory=list)

    @property
    def time(self) -> Array:
        """[s], shape [time]."""
        return self.series["t_s"]


def check_alike(runs: Sequence[str], results: Sequence[Mapping[str, Any]]) -> None:
    """Raise ValueError, naming feet or mass, for two runs that are not of one robot."""
    feet = [", ".join(result["feet"]) for result in results]
    if feet[0] != feet[1]:
        raise ValueError(say("other_feet", runs=runs, first=feet[0], second=feet[1]))
    mass = [float(result["trial"]["mass"]["value"]) for result in results]
    if abs(mass[1] - mass[0]) > SAME * max(mass):
        raise ValueError(say("other_mass", runs=runs, first=mass[0], second=mass[1]))


def read_moved(folder: Path, result: Mapping[str, Any]) -> MovedRobot:
    """What the run in `folder` did. Raises ValueError, naming file and column, where a series is missing."""
    if "beds" in result:
        raise ValueError(say("name_a_bed", folder=str(folder), bed=str(folder / result["beds"][0]["folder"])))
    found, again = {}, say("again_robot", file=folder / "run.toml")
    names = tuple(str(name) for name in result["feet"])
    of_feet = tuple(f"{name}_{what}" for name in names for what in ("fz_N", "depth_m"))
    for name, needed in NEEDED.items():
        try:
            found[name] = read_series(folder / name)
        except OSError:
            raise ValueError(say("no_file", folder=str(folder), name=name, again=again)) from None
        needed += of_feet if name == "series/feet.csv" else ()
        if lacking := [column for column in needed if column not in found[name]]:
            raise ValueError(say("no_column", name=name, folder=str(folder), lacking=", ".join(lacking), again=again))
    motion, feet = found.values()
    motion = {**motion, "state": np.where(motion["touching"] > 0, "touches", "flies")}
    return MovedRobot(motion, feet, names, float(result["trial"]["weight"]["value"]))


def compared_columns(first: MovedRobot, second: MovedRobot) -> Json:
    """Both on one grid, `_1` and `_2`: as long as both last; forces are means over 5 ms."""
    columns = on_one_grid(first.series, second.series, CHANNELS)
    time = columns["t_s"]
    for number, one in enumerate((first, second), 1):
        for name in one.names:
            columns[f"load_{name}_N_{number}"] = mean_over(time, one.time, one.feet[f"{name}_fz_N"])
            depth = np.interp(time, one.time, one.feet[f"{name}_depth_m"])
            columns[f"sinkage_{name}_m_{number}"] = np.maximum(depth, 0.0)
        for name, own in FORCES.items():
            columns[f"{name}_{number}"] = mean_over(time, one.time, one.series[own])
        for name in ENERGIES:
            columns[f"{name}_{number}"] = np.interp(time, one.time, one.series[name])
    return columns


def gaps(columns: Mapping[str, Any]) -> dict[str, Json]:
    """How far the two went apart, as quantities of a result."""
    found = gap_entries(columns, (("x", "m"), ("y", "m"), ("z", "m")))
    one, other = (np.asarray(columns[f"lift_N_{number}"]) for number in (1, 2))
    at = int(np.argmax(np.abs(other - one)))
    when = f"largest over time, at {columns['t_s'][at]:.4g} s; means over 5 ms"
    found["gap_lift"] = (float(abs(other[at] - one[at])), "N", when)
    found["gap_mean_lift"] = (float(other.mean() - one.mean()), "N", say("lift_gap"))
    return all_gaps(columns, found, say("foot_gap"))


def told_apart(columns: Mapping[str, Any], labels: tuple[str, str]) -> list[str]:
    """What a reader wants to hear of the two."""
    found = {name: float(entry["value"]) for name, entry in gaps(columns).items()}
    up, first, second = found["gap_z_end"], *(1e3 * deepest(columns, number) for number in (1, 2))
    forces = [float(np.max(columns[f"lift_N_{number}"])) for number in (1, 2)]
    down = [bool(np.any(columns[f"lift_N_{number}"])) for number in (1, 2)]
    untouched = [say("never_touches", label=label) for label, one in zip(labels, down, strict=True) if not one]
    return [
        say("robot_at_the_end", end=float(columns["t_s"][-1]), labels=labels, up=1e3 * abs(up),
            height="higher" if up > 0 else "lower", most=1e3 * found["gap_z"], same=100 * found["same_state"]),
        say("robot_forces", first=forces[0], second=forces[1], labels=labels),
        say("deepest_foot", first=first, second=second, labels=labels),
        *(untouched if len(untouched) == 1 else []),
    ]  # fmt: skip


def numbers_over_time(
    moved: MovedRobot, end: float
) -> tuple[dict[str, tuple[Array, Array]], dict[str, tuple[Array, Array]], dict[str, float | None], dict[str, float]]:
    """What the numbers of a run are made of: largest values and final ones over time, events, and counts until `end`.

    Times in s; events are None where they never happen.
    """
    series, time = moved.series, moved.time
    touching = series["touching"] > 0
    begun = np.cumsum(touching) > 0
    rise = series["z_m"] - series["z_m"][0]
    largest = {
        "highest": (time, np.where(begun, rise, rise.min()) if begun.any() else rise),
        "sinkage_largest": (time, series["sinkage_m"]),
        "largest_force": (time, np.asarray(np.linalg.norm([series[name] for name in FORCES.values()], axis=0))),
    }  # fmt: skip
    final = {f"displacement_{axis}": (time, series[f"{axis}_m"] - series[f"{axis}_m"][0]) for axis in "xyz"}
    final |= {"sinkage_end": (time, series["sinkage_m"]), "actuator_work": (time, series["actuator_work_J"])}
    final |= {"ground_work": (time, series["taken_J"])}
    first = float(time[int(np.argmax(touching))]) if touching.any() else None
    for name in moved.names:
        one = "" if len(moved.names) == 1 else f"_{name}"
        if (height := moved.feet.get(f"{name}_height_m")) is not None:  # an older run does not have it
            largest[f"clearance_largest{one}"] = time, np.where(begun, np.maximum(height, 0.0), 0.0)
            final[f"clearance_end{one}"] = time, height
        depth = moved.feet[f"{name}_depth_m"]
        largest[f"sinkage_largest{one}"], final[f"sinkage_end{one}"] = (time, depth), (time, depth)
    flights: list[float] = []
    if first is not None:
        within = (time >= first) & (time <= end)
        step = float(np.median(np.diff(time)))
        lengths = [(high - low) * step for low, high in spells(~touching[within])]
        flights = [length for length in lengths if length >= APART * (1 - SAME)]
    counts = {"flights": float(len(flights)), "longest_flight": max(flights, default=0.0)}
    return largest, final, {"first_touch": first}, counts
