"""Figures of two tumbles of one kind side by side; those that are of the plane, and those that space has too."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.figure import Figure

from vis.page.plots import DASHED, Array, Plot, handle, legend_above, sheet
from vis.page.report import Result
from vis.page.sentences import Sentences
from vis.page.states import LINES, States, draw_bands, legend_of_runs
from vis.page.style import BED, GREY, INK, MODEL, as_it_lies, styled

__all__ = ["plots"]

captions = Sentences(__package__, "figures.toml")
Columns = Mapping[str, Array]
Both = tuple[States, States]
Labels = tuple[str, str]
_ROWS = (BED, "#E69F00", "#009E73", "#CC79A7", GREY, "#56B4E9", INK, MODEL)


def plots(result: Result, columns: Columns, states: Both, labels: Labels) -> list[Plot]:
    """The figures of two tumbles, drawn from series/compared.csv."""
    in_space = result["kind"] == "tumble spatial"
    kind, angle, label = ("space", "turn_rad", "turn [degrees]") if in_space else ("plane", "theta_rad", "θ [degrees]")
    forces = {"lift_N": "force upwards [N]", "push_N": "force along the motion [N]"}
    if in_space:
        forces = {"lift_N": "force upwards [N]", "push_x_N": "force along x [N]", "push_y_N": "force along y [N]"}
        names, called = result["spikes"], "spike"
    else:
        names, called = [str(row) for row in range(int(result["spike_count"]))], "row"
    with styled():
        path, in_proportion = _draw_way(columns, labels) if in_space else _draw_path(columns, labels)
        drawings = {
            "path": path,
            "states": _draw_states(columns, angle, states, labels, label),
            "sinkage": _draw_spikes(columns, names, labels, called=called),
            "forces": _draw_forces(result["weights"], columns, forces, labels),
            "energy": _draw_energy(columns, labels),
        }
    shape = "in proportion" if in_proportion else "heights stretched"
    return [Plot.said(captions, f"{kind}_{name}", one, name=name, shape=shape) for name, one in drawings.items()]


def _draw_path(columns: Columns, labels: Labels) -> tuple[Figure, bool]:
    """The figure, and whether the path is in proportion."""
    drawing, ((path, speed, spin),) = sheet(1, 3, 3.2)
    time = columns["t_s"]
    for number, style in enumerate(LINES, 1):
        x, y = (1e3 * columns[f"{name}_m_{number}"] for name in ("x", "y"))
        path.plot(x - x[0], y - y[0], **style)
        speed.plot(time, np.hypot(columns[f"vx_m_s_{number}"], columns[f"vy_m_s_{number}"]), **style)
        spin.plot(time, columns[f"omega_rad_s_{number}"], **style)
    in_proportion = as_it_lies(path)
    path.set(xlabel="x − x(0) [mm]", ylabel="y − y(0) [mm]")
    speed.set_ylabel("speed of the centre [m/s]")
    spin.set_ylabel("dθ/dt [rad/s]")
    for axis in (speed, spin):
        axis.set_xlabel("time [s]")
    legend_of_runs(drawing, labels)
    return drawing, in_proportion


def _draw_way(columns: Columns, labels: Labels) -> tuple[Figure, bool]:
    """The figure; its panels are in proportion, over time as they are."""
    drawing, (ways, rates) = sheet(2, 3, 5.0, sharex=True)
    time = columns["t_s"]
    vectors = ("vx_m_s", "vy_m_s", "vz_m_s"), ("wx_rad_s", "wy_rad_s", "wz_rad_s")
    for number, style in enumerate(LINES, 1):
        for axis, name in zip(ways, "xyz", strict=True):
            way = 1e3 * columns[f"{name}_m_{number}"]
            axis.plot(time, way - way[0], **style)
            axis.set_ylabel(f"{name} − {name}(0) [mm]")
        for axis, names in zip(rates, vectors, strict=False):
            axis.plot(time, np.linalg.norm([columns[f"{name}_{number}"] for name in names], axis=0), **style)
    rates[2].plot(time, np.degrees(columns["apart_rad"]), color=INK, lw=1.4)
    words = ("speed of the centre [m/s]", "angular velocity [rad/s]", "between attitudes [degrees]")
    for axis, label in zip(rates, words, strict=True):
        axis.set(ylabel=label, xlabel="time [s]")
    legend_of_runs(drawing, labels)
    return drawing, True


def _draw_states(columns: Columns, angle: str, states: Both, labels: Labels, label: str) -> Figure:
    """The column `angle` [rad] of both, and their states."""
    angles = (np.degrees(columns[f"{angle}_{number}"]) for number in (1, 2))
    return draw_bands([(columns["t_s"], *run) for run in zip(angles, states, strict=True)], labels, label=label)


def _draw_spikes(columns: Columns, names: Sequence[str], labels: Labels, *, called: str) -> Figure:
    """How deep each row or spike goes, a panel a run; those that never go in are left out."""
    drawing, (axes,) = sheet(1, 2, 3.2, sharey=True)
    none = np.zeros(len(columns["t_s"]))
    depths = [[1e3 * columns.get(f"sinkage_{name}_m_{number}", none) for name in names] for number in (1, 2)]
    there = [k for k in range(len(names)) if any(run[k].any() for run in depths)]
    dashes = ("-", DASHED, (0, (1, 1)))
    styles = [
        {"color": _ROWS[place % len(_ROWS)], "ls": dashes[place // len(_ROWS) % 3]} for place in range(len(there))
    ]
    for axis, run, label in zip(axes, depths, labels, strict=True):
        for k, style in zip(there, styles, strict=True):
            axis.plot(columns["t_s"], np.where(run[k] > 0, run[k], np.nan), lw=1.5, **style)
        axis.set(title=label, xlabel="time [s]")
    axes[0].set_ylabel("sinkage [mm]")
    axes[0].invert_yaxis()
    names = [name if name == "hull" else f"{called} {name}" for name in names]
    handles = [handle(names[k], lw=2, **style) for k, style in zip(there, styles, strict=True)]
    legend_above(drawing, handles, 8)
    return drawing


def _draw_forces(weights: Sequence[float], columns: Columns, forces: Mapping[str, str], labels: Labels) -> Figure:
    """Forces of the ground, column and words of each; in the first panel, that of the lift, the weights [N] too."""
    drawing, (axes,) = sheet(1, len(forces), 3.0)
    for axis, (name, words) in zip(axes, forces.items(), strict=True):
        for number, style in enumerate(LINES, 1):
            if f"{name}_{number}" in columns:
                axis.plot(columns["t_s"], columns[f"{name}_{number}"], **{**style, "lw": 1.1})
        axis.set(ylabel=words, xlabel="time [s]")
    for weight, style in zip(weights, LINES, strict=True):
        axes[0].axhline(weight, color=INK if weights[0] == weights[1] else style["color"], lw=0.8, ls=(0, (5, 4)))
    legend_of_runs(drawing, labels)
    return drawing


def _draw_energy(columns: Columns, labels: Labels) -> Figure:
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
        rest.plot(time, 1e3 * (energy - energy[0] - put_in + taken), **{**style, "lw": 1.0})
    for axis, name in ((work, "work of the torque [mJ]"), (lost, "dissipated [mJ]"), (rest, "left over [µJ]")):
        axis.set(ylabel=name, xlabel="time [s]")
    rest.ticklabel_format(axis="y", scilimits=(-2, 4))
    legend_of_runs(drawing, labels)
    return drawing
