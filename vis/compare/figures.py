"""Figures of two tumbles of one kind side by side; those that are of the plane, and those that space has too."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from vis.page.style import BED, GREY, INK, MODEL, as_it_lies, styled
from vis.tumble.state_figures import LINES, draw_bands, sheet

__all__ = ["ENERGY", "Plan", "States", "draw_energy", "draw_forces", "draw_spikes", "draw_states", "legend", "plans"]

Array = NDArray[np.float64]
States = tuple[NDArray[np.str_], NDArray[np.str_]]
Plan = tuple[str, str, str, Figure]
"""Name of the file, title, caption, figure."""
ENERGY = (
    "Work of the torque; what was dissipated, in the ground and in friction; and what is left over: energy gained less "
    "the work plus what was dissipated; on grains that is platform and exchange only, since there what was dissipated "
    "is what the bed took less what it holds more."
)
"""Caption of `draw_energy`."""
_ROWS = (BED, "#E69F00", "#009E73", "#CC79A7", GREY, "#56B4E9", INK, MODEL)


def plans(
    result: Mapping[str, Any], columns: Mapping[str, Array], states: States, labels: tuple[str, str]
) -> list[Plan]:
    """The figures of two tumbles in the plane, drawn from series/compared.csv."""
    rows = [str(row) for row in range(int(result["spike_count"]))]
    forces = (("lift_N", "force upwards [N]"), ("push_N", "force along the motion [N]"))
    with styled():
        path, in_proportion = _draw_path(columns, labels)
        shape = "in proportion" if in_proportion else "heights stretched"
        return [
            ("path", "Path and speed", f"Left: the centre from its start, {shape}. Right: its speed, and dθ/dt.", path),
            ("states", "Angle and states", "Above: the angle. Below: the states as bands; stand: two rows or more "
             "stick, pivot: one sticks, slip: all that touch slide, hop: none touches.",
             draw_states(columns, "theta_rad", states, labels)),
            ("sinkage", "Sinkage of each row of spikes", "Depth of the lowest point of each row below the undisturbed "
             "surface. Both panels have the same scale; rows that never touch are left out.",
             draw_spikes(columns, rows, labels, called="row")),
            ("forces", "Forces of the ground", "Left: upwards; the dashed line is the weight. Right: along the motion. "
             "Means over 5 ms, of all rows together, as the platform's acceleration has them.",
             draw_forces(result["weights"], columns, forces, labels)),
            ("energy", "Energy books", ENERGY, draw_energy(columns, labels)),
        ]  # fmt: skip


def legend(drawing: Figure, labels: tuple[str, str]) -> None:
    """The two runs."""
    handles = [Line2D([], [], label=label, **style) for label, style in zip(labels, LINES, strict=True)]
    drawing.legend(handles=handles, loc="outside upper left", ncols=2)


def _draw_path(columns: Mapping[str, Array], labels: tuple[str, str]) -> tuple[Figure, bool]:
    """The figure, and whether the path is in proportion."""
    drawing, ((path, speed, spin),) = sheet(1, 3, 3.2)
    time = columns["t_s"]
    for number, style in enumerate(LINES, 1):
        x, y = (1e3 * columns[f"{name}_m_{number}"] for name in ("x", "y"))
        path.plot(x - x[0], y - y[0], **style)
        speed.plot(time, np.hypot(columns[f"vx_m_s_{number}"], columns[f"vy_m_s_{number}"]), **style)
        spin.plot(time, columns[f"omega_rad_s_{number}"], **style)
    in_proportion = as_it_lies(path)
    path.set_xlabel("x − x(0) [mm]")
    path.set_ylabel("y − y(0) [mm]")
    speed.set_ylabel("speed of the centre [m/s]")
    spin.set_ylabel("dθ/dt [rad/s]")
    for axis in (speed, spin):
        axis.set_xlabel("time [s]")
    legend(drawing, labels)
    return drawing, in_proportion


def draw_states(
    columns: Mapping[str, Array], angle: str, states: States, labels: tuple[str, str], *, label: str = "θ [degrees]"
) -> Figure:
    """The column `angle` [rad] of both, and their states."""
    angles = (np.degrees(columns[f"{angle}_{number}"]) for number in (1, 2))
    return draw_bands([(columns["t_s"], *run) for run in zip(angles, states, strict=True)], labels, label=label)


def draw_spikes(columns: Mapping[str, Array], names: Sequence[str], labels: tuple[str, str], *, called: str) -> Figure:
    """How deep each row or spike goes, a panel a run; those that never go in are left out."""
    drawing, (axes,) = sheet(1, 2, 3.2, sharey=True)
    none = np.zeros(len(columns["t_s"]))
    depths = [[1e3 * columns.get(f"sinkage_{name}_m_{number}", none) for name in names] for number in (1, 2)]
    there = [k for k in range(len(names)) if any(run[k].any() for run in depths)]
    styles: list[dict[str, Any]] = [
        {"color": _ROWS[place % len(_ROWS)], "ls": ("-", (0, (4, 2)), (0, (1, 1)))[place // len(_ROWS) % 3]}
        for place in range(len(there))
    ]
    for axis, run, label in zip(axes, depths, labels, strict=True):
        for k, style in zip(there, styles, strict=True):
            axis.plot(columns["t_s"], np.where(run[k] > 0, run[k], np.nan), lw=1.5, **style)
        axis.set_title(label)
        axis.set_xlabel("time [s]")
    axes[0].set_ylabel("sinkage [mm]")
    axes[0].invert_yaxis()
    handles = [
        Line2D([], [], lw=2, label=names[k] if names[k] == "hull" else f"{called} {names[k]}", **style)
        for k, style in zip(there, styles, strict=True)
    ]
    drawing.legend(handles=handles, loc="outside upper left", ncols=8)
    return drawing


def draw_forces(
    weights: Sequence[float],
    columns: Mapping[str, Array],
    forces: Sequence[tuple[str, str]],
    labels: tuple[str, str],
) -> Figure:
    """Forces of the ground, column and words of each; in the first panel, that of the lift, the weights [N] too."""
    drawing, (axes,) = sheet(1, len(forces), 3.0)
    for axis, (name, words) in zip(axes, forces, strict=True):
        for number, style in enumerate(LINES, 1):
            if f"{name}_{number}" in columns:
                axis.plot(columns["t_s"], columns[f"{name}_{number}"], **(style | {"lw": 1.1}))
        axis.set_ylabel(words)
        axis.set_xlabel("time [s]")
    for weight, style in zip(weights, LINES, strict=True):
        axes[0].axhline(weight, color=INK if weights[0] == weights[1] else style["color"], lw=0.8, ls=(0, (5, 4)))
    legend(drawing, labels)
    return drawing


def draw_energy(columns: Mapping[str, Array], labels: tuple[str, str]) -> Figure:
    """Work of the torque, what was dissipated, what is left over."""
    drawing, ((work, lost, rest),) = sheet(1, 3, 3.0)
    work.sharey(lost)
    time = columns["t_s"]
    for number, style in enumerate(LINES, 1):
        put_in, taken, energy = (
            1e3 * columns[f"{name}_J_{number}"] for name in ("torque_work", "dissipated", "energy")
        )
        work.plot(time, put_in, **style)
        lost.plot(time, taken, **style)
        rest.plot(time, 1e3 * (energy - energy[0] - put_in + taken), **(style | {"lw": 1.0}))
    for axis, name in ((work, "work of the torque [mJ]"), (lost, "dissipated [mJ]"), (rest, "left over [µJ]")):
        axis.set_ylabel(name)
        axis.set_xlabel("time [s]")
    rest.ticklabel_format(axis="y", scilimits=(-2, 4))
    legend(drawing, labels)
    return drawing
