"""Curves beside a scene: which columns of a run's series are drawn over time, thinned to what a page can show.

Forces of grains on a platform or robot are running means, and the label says over how long."""

from __future__ import annotations

import math
from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any, TypedDict

import numpy as np

from vis.page.folder import Run, read_columns
from vis.page.plots import AXES, BED, INK, MODEL, STATES, Array, line_styles, mean_over
from vis.page.states import States, state_runs
from vis.pictures.frames import Frames

__all__ = [
    "MOST_LINES", "Band", "Line", "Panel", "bands", "joint_columns", "law_beside", "line", "of_frames",
    "of_penetration", "of_robot", "of_space", "of_tumble", "panel",
]  # fmt: skip


class Line(TypedDict):
    """Times [s] and values of one line."""

    name: str
    colour: str
    dashed: bool
    t: list[float]
    y: list[float]


class Panel(TypedDict):
    """Lines over time; the label has their unit. ``down``: larger values are lower, as depths are."""

    label: str
    lines: list[Line]
    down: bool


Band = TypedDict("Band", {"from": float, "to": float, "state": str, "colour": str})
"""A state from one time to another [s]."""
MOST_LINES = 10
"""Feet or joints in one panel."""
_BINS = 300
"""A line keeps the least and the largest value of each of so many parts of its time."""
_SMOOTH = 5e-3
"""Forces on a platform or robot are means over this [s], as in its report."""
_DASHED = "y"
"""The axis whose line is dashed, so that the one of x shows below it where both are 0."""
_MEAN = f"mean over {1e3 * _SMOOTH:g} ms"
"""In the label of each panel of such a mean."""

_VALUES = {
    "depth": ("depth of the tip [mm]", 1e3), "velocity": ("velocity, downwards [mm/s]", 1e3),
    "force": ("force of the ground [N]", 1.0), "theta_deg": ("θ [degrees]", 1.0),
    **{f"force_{axis}": (f"force of the ground, {axis} [N]", 1.0) for axis in AXES},
}  # fmt: skip
"""Of the values in frames: label and factor from the unit there."""


def line(name: str, time: Array, values: Array, *, colour: str = BED, dashed: bool = False) -> Line:
    """A line of at most `2 * _BINS` points; what is not finite is left out. Peaks of `values` are kept."""
    known = np.isfinite(time) & np.isfinite(values)
    time, values = np.asarray(time, dtype=float)[known], np.asarray(values, dtype=float)[known]
    if len(time) > 2 * _BINS:
        edges = np.linspace(0, len(time), _BINS + 1).astype(int)
        rows = {low + int(place(values[low:high])) for low, high in pairwise(edges) for place in (np.argmin, np.argmax)}
        kept = sorted({0, len(time) - 1, *rows})
        time, values = time[kept], values[kept]
    return {
        "name": name, "colour": colour, "dashed": dashed,
        "t": [float(f"{t:.6g}") for t in time], "y": [float(f"{y:.{_digits(values)}g}") for y in values],
    }  # fmt: skip


def _digits(values: Array) -> int:
    """Digits with which the range of values has a thousand steps at least; at most 7, so that noise stays hidden."""
    reach = float(np.ptp(values)) if len(values) else 0.0
    beside = float(np.abs(values).max()) / reach if reach > 0 else 1.0
    return min(7, 4 + math.ceil(math.log10(max(1.0, beside))))


def panel(label: str, *lines: Line) -> list[Panel]:
    """The lines that have two points at least, in one panel; none where there are none."""
    shown = [one for one in lines if len(one["t"]) > 1]
    return [{"label": label, "lines": shown, "down": label.startswith("depth")}] if shown else []


def bands(time: Array, states: States) -> list[Band]:
    """States over time: `from` and `to` [s], `state` and its colour."""
    last = len(time) - 1
    return [
        {"from": float(time[low]), "to": float(time[min(high, last)]), "state": name, "colour": STATES.get(name, INK)}
        for low, high, name in state_runs(states)
    ]


def of_penetration(run: Run) -> list[Panel]:
    """Depth and force of a spike in the bed and on the spring-damper."""
    there = [
        (name, series, colour)
        for name, series, colour in (("bed", run.bed, BED), ("spring-damper", run.model, MODEL))
        if series is not None
    ]

    def each(column: str, scale: float = 1.0) -> list[Line]:
        return [
            line(name, series.time, scale * getattr(series, column), colour=colour, dashed=colour == MODEL)
            for name, series, colour in there
        ]

    return [
        *panel("depth of the tip [mm]", *each("depth", 1e3)),
        *panel("force of the ground [N]", *each("force")),
        *panel("velocity, downwards [mm/s]", *each("velocity", 1e3)),
    ]


def of_tumble(folder: Path, series: Mapping[str, Array], name: str) -> list[Panel]:
    """Angle, height and speed of a platform in the plane, called `name`, and of the spring-damper beside it if kept."""
    runs = [(name, series, BED, False)]
    beside = folder / "series" / "spring-damper.csv"
    if beside.exists():
        runs.append(("spring-damper", read_columns(beside)[0], MODEL, True))

    def each(values: Any) -> list[Line]:
        return [line(own, s["t_s"], values(s), colour=colour, dashed=dashed) for own, s, colour, dashed in runs]

    return [
        *panel("θ [degrees]", *each(lambda s: np.degrees(s["theta_rad"]))),
        *panel("height of the centre [mm]", *each(lambda s: 1e3 * s["y_m"])),
        *panel("speed of the centre [mm/s]", *each(lambda s: 1e3 * np.hypot(s["vx_m_s"], s["vy_m_s"]))),
        *_load(folder),
    ]


def of_space(folder: Path, series: Mapping[str, Array]) -> list[Panel]:
    """Turn, height, speed and force of a platform in space."""
    time = series["t_s"]
    speed = np.sqrt(sum(series[f"v{axis}_m_s"] ** 2 for axis in "xyz"))
    turn = panel("rotation from the start [degrees]", line("", time, np.degrees(series["turn_rad"])))
    motion = folder / "series" / "motion.csv"
    force: list[Panel] = []
    if motion.exists():
        columns, _ = read_columns(motion)
        (mean,) = mean_over(_SMOOTH, columns["t_s"], [columns["fz_N"]])
        force = panel(f"vertical force of the ground, {_MEAN} [N]", line("", columns["t_s"], mean))
    return [
        *turn,
        *panel("height of the centre of mass [mm]", line("", time, 1e3 * series["z_m"])),
        *panel("speed of the centre of mass [mm/s]", line("", time, 1e3 * speed)),
        *force,
    ]


def of_robot(folder: Path) -> list[Panel]:
    """Way, force, depths of feet, joints and motors of a robot; dashed is the law beside a bed, if kept."""
    motion, feet, joints = (read_columns(folder / "series" / f"{name}.csv")[0] for name in ("motion", "feet", "joints"))
    time = motion["t_s"]
    ways = [
        line(axis, time, 1e3 * (motion[f"{axis}_m"] - motion[f"{axis}_m"][0]), colour=colour, dashed=axis == _DASHED)
        for axis, colour in AXES.items()
    ]
    forces = [
        line(axis, time, mean, colour=colour, dashed=axis == _DASHED)
        for (axis, colour), mean in zip(
            AXES.items(), mean_over(_SMOOTH, time, [motion[f"f{axis}_N"] for axis in AXES]), strict=True
        )
    ]
    if (name := law_beside(folder)) is not None:
        law = read_columns(folder / "series" / f"{name}.csv")[0]
        ways.append(line(f"z, {name}", law["t_s"], 1e3 * (law["z_m"] - law["z_m"][0]), colour=INK, dashed=True))
        (mean,) = mean_over(_SMOOTH, law["t_s"], [law["fz_N"]])
        forces.append(line(f"z, {name}", law["t_s"], mean, colour=INK, dashed=True))
    depths = [name for name in feet if name.endswith("_depth_m")][:MOST_LINES]
    moved, driven = joint_columns(joints)
    return [
        *panel("displacement of the centre of mass [mm]", *ways),
        *panel(f"force of the ground, {_MEAN} [N]", *forces),
        *_many("depth of the feet [mm]", feet, depths, "_depth_m", 1e3),
        *panel("feet that touch", line("", time, motion["touching"], colour=INK)),
        *_many("joints [rad, m]", joints, moved),
        *_many("force of the motors [N, N m]", joints, driven, "_force"),
    ]


def law_beside(folder: Path) -> str | None:
    """Name of the surface law whose series stands beside that of a robot on grains; None on a law."""
    return next((law for law in ("rft", "spring-damper") if (folder / "series" / f"{law}.csv").exists()), None)


def joint_columns(joints: Mapping[str, Array]) -> tuple[list[str], list[str]]:
    """Of series/joints.csv: positions of hinges and slides that move, forces of actuators; `MOST_LINES` of each."""
    moved = [
        name for name in joints
        if name.endswith(("_rad", "_m")) and not name.endswith(("_x_m", "_y_m", "_z_m")) and np.ptp(joints[name]) > 0
    ]  # fmt: skip
    return moved[:MOST_LINES], [name for name in joints if name.endswith("_force")][:MOST_LINES]


def _many(
    label: str, columns: Mapping[str, Array], names: list[str], ending: str = "", scale: float = 1.0
) -> list[Panel]:
    """A panel of columns over t_s, called by their names less `ending`, or less the unit; one alone is in the label."""
    called = [name.removesuffix(ending) if ending else name.rpartition("_")[0] for name in names]
    lines = [
        line(own, columns["t_s"], scale * columns[name], colour=str(style["color"]), dashed=style["ls"] != "-")
        for own, name, style in zip(called, names, line_styles(names, beside_axes=True).values(), strict=True)
    ]
    return panel(f"{label}: {called[0]}" if len(lines) == 1 else label, *lines)


def of_frames(frames: Frames) -> list[Panel]:
    """The values that the frames themselves hold, such as depth [m] and force [N]."""
    rows = [frame.values for frame in frames]
    names = list(dict.fromkeys(name for row in rows for name in row))
    return [
        one
        for name in names
        for label, scale in [_VALUES.get(name, (name, 1.0))]
        for one in panel(label, line("", frames.times, scale * np.array([row.get(name, np.nan) for row in rows])))
    ]


def _load(folder: Path) -> list[Panel]:
    """The normal force on all rows of spikes of a platform on grains."""
    path = folder / "series" / "feet.csv"
    if not path.exists():
        return []
    feet, _ = read_columns(path)
    total = np.sum([values for name, values in feet.items() if name.startswith("normal_")], axis=0)
    (mean,) = mean_over(_SMOOTH, feet["t_s"], [total])
    return panel(f"force of the ground, normal, {_MEAN} [N]", line("bed of grains", feet["t_s"], mean))
