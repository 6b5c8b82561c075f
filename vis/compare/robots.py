"""Figures of two runs of one robot: place, force of the ground and of each foot, depth, energy."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.figure import Figure

from vis.page.plots import DASHED, INK, Array, handle, legend_above, shades, sheet
from vis.page.states import LINES, draw_forces, legend_of_runs

__all__ = ["draw_robots"]

Columns = Mapping[str, Array]
Labels = tuple[str, str]
FORCES = {"lift_N": "force upwards [N]", "push_x_N": "force along x [N]", "push_y_N": "force along y [N]"}
MOST_FEET = 6
"""Panels of single feet: those with the largest force come first."""


def draw_robots(columns: Columns, feet: Sequence[str], weights: Sequence[float], labels: Labels) -> dict[str, Figure]:
    """Name of a figure -> the figure, drawn from series/compared.csv; ``weights`` of both [N]."""
    return {
        "path": _draw_path(columns, labels), "forces": draw_forces(weights, columns, FORCES, labels),
        "feet": _draw_feet(columns, feet, labels), "energy": _draw_energy(columns, labels),
    }  # fmt: skip


def _draw_path(columns: Columns, labels: Labels) -> Figure:
    drawing, ((height, way, depth),) = sheet(1, 3, 3.2)
    for number, style in enumerate(LINES, 1):
        x, y, z = (1e3 * (columns[f"{name}_m_{number}"] - columns[f"{name}_m_{number}"][0]) for name in "xyz")
        height.plot(columns["t_s"], z, **style)
        way.plot(columns["t_s"], np.hypot(x, y), **style)
        depth.plot(columns["t_s"], 1e3 * np.maximum(columns[f"sinkage_m_{number}"], 0.0), **style)
    depth.invert_yaxis()
    words = ("z − z(0) of the centre of mass [mm]", "its way along the ground [mm]", "depth of the deepest foot [mm]")
    for axis, label in zip((height, way, depth), words, strict=True):
        axis.set(xlabel="time [s]", ylabel=label)
    legend_of_runs(drawing, labels)
    return drawing


def _draw_feet(columns: Columns, feet: Sequence[str], labels: Labels) -> Figure:
    """Load and depth of each foot, those with the largest loads."""
    most = {name: max(float(np.max(columns[f"load_{name}_N_{number}"])) for number in (1, 2)) for name in feet}
    shown = sorted(feet, key=lambda name: -most[name])[:MOST_FEET]
    drawing, (loads, depths) = sheet(2, 2, 5.4, sharex=True, sharey="row")
    for number, label in enumerate(labels, 1):
        for name, colour in zip(shown, shades(len(shown)), strict=True):
            loads[number - 1].plot(columns["t_s"], columns[f"load_{name}_N_{number}"], color=colour, lw=1.2)
            depth = 1e3 * columns[f"sinkage_{name}_m_{number}"]
            depths[number - 1].plot(columns["t_s"], np.where(depth > 0, depth, np.nan), color=colour, lw=1.4)
        loads[number - 1].set_title(label)
        depths[number - 1].set_xlabel("time [s]")
    loads[0].set_ylabel("force upwards [N]")
    depths[0].set_ylabel("depth [mm]")
    depths[0].invert_yaxis()
    legend_above(drawing, [handle(n, c, lw=2) for n, c in zip(shown, shades(len(shown)), strict=True)], MOST_FEET)
    return drawing


def _draw_energy(columns: Columns, labels: Labels) -> Figure:
    drawing, ((work, ground, rest),) = sheet(1, 3, 3.0)
    time = columns["t_s"]
    for number, style in enumerate(LINES, 1):
        put_in, taken, kinetic, potential = (
            columns[f"{name}_J_{number}"] for name in ("torque_work", "taken", "kinetic", "potential")
        )
        energy = kinetic + potential
        work.plot(time, put_in, **style)
        ground.plot(time, taken - taken[0], **style)
        rest.plot(time, energy - energy[0] - (put_in - put_in[0]) + (taken - taken[0]), **{**style, "lw": 1.0})
    work.axhline(0.0, color=INK, lw=0.6, ls=DASHED)
    for axis, name in ((work, "work in the robot [J]"), (ground, "taken by the ground [J]"), (rest, "left over [J]")):
        axis.set(ylabel=name, xlabel="time [s]")
    rest.ticklabel_format(axis="y", scilimits=(-2, 4))
    legend_of_runs(drawing, labels)
    return drawing
