"""States of tumbles as pictures: over time and angle, as bands of two runs, as a strip with a cursor.

What they show is the same in the plane and in space; only the angle is another.
"""

from __future__ import annotations

import math
import textwrap
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from vis.page.page import Block, table, text
from vis.page.plots import BED, GREY, INK, MODEL, STATES, Array, handle, legend_above, new_figure, sheet

__all__ = [
    "LINES", "States", "by_state", "draw_bands", "draw_forces", "draw_states", "legend_of_runs", "legend_of_states",
    "panels", "passages", "state_runs", "state_strip",
]  # fmt: skip

States = NDArray[np.str_]
LINES: tuple[Mapping[str, Any], Mapping[str, Any]] = (
    {"color": BED, "lw": 1.7},
    {"color": MODEL, "lw": 1.4, "ls": (0, (4, 2))},
)
"""Of the first of two runs and of the second, which is dashed as well."""
_OF_WEIGHT = (0, (5, 4))
_LABEL = 26
"""Letters of a run's label in a line."""
_LETTER = 0.0063
"""Width of a letter beside the strip, over the picture's [1]."""
_MOST_TOLD = 60
_MOST_STEPS = 60
"""Changes of state that are joined by a line; more would paint the panel grey."""


def panels(
    count: int, height: float, *, widths: tuple[float, ...] | None = None, right: float = 0.985
) -> tuple[Figure, list[Axes]]:
    """Panels side by side, placed by hand: a layout engine would take as long as all the rest."""
    drawing = new_figure(height, layout="none")
    axes = drawing.subplots(1, count, width_ratios=widths)
    drawing.subplots_adjust(left=0.09, right=right, bottom=0.5 / height, top=1 - 0.38 / height, wspace=0.23)
    return drawing, list(np.atleast_1d(axes))


def legend_of_states(drawing: Figure, states: States, more: tuple[Line2D, ...] = (), *, columns: int = 8) -> None:
    """Those that occur, and what else there is."""
    there = [name for name in STATES if name in states]
    handles = [handle(name, STATES[name], lw=3) for name in there]
    drawing.legend(handles=[*handles, *more], loc="upper left", bbox_to_anchor=(0.075, 1.0), ncols=columns)


def legend_of_runs(drawing: Figure, labels: Sequence[str], more: Sequence[Line2D] = (), *, columns: int = 2) -> None:
    """The lines of two runs, and what else there is."""
    legend_above(drawing, [*(handle(name, **style) for name, style in zip(labels, LINES, strict=True)), *more], columns)


def draw_forces(
    weights: Sequence[float], columns: Mapping[str, Array], forces: Mapping[str, str], labels: Sequence[str]
) -> Figure:
    """Forces of the ground in two runs, column and words of each; in the first panel the weights [N] too."""
    drawing, (axes,) = sheet(1, len(forces), 3.0)
    for axis, (name, words) in zip(axes, forces.items(), strict=True):
        for number, style in enumerate(LINES, 1):
            if f"{name}_{number}" in columns:
                axis.plot(columns["t_s"], columns[f"{name}_{number}"], **{**style, "lw": 1.1})
        axis.set(ylabel=words, xlabel="time [s]")
    for weight, style in zip(weights, LINES, strict=True):
        axes[0].axhline(weight, color=INK if weights[0] == weights[1] else style["color"], lw=0.8, ls=_OF_WEIGHT)
    legend_of_runs(drawing, labels, [handle("weight", INK, lw=0.8, ls=_OF_WEIGHT)], columns=3)
    return drawing


def by_state(axis: Axes, x: Array, y: Array, states: States, **style: Any) -> None:
    """A line in the colours of the states, without gaps between them."""
    for low, high, name in state_runs(states):
        axis.plot(x[low : high + 1], y[low : high + 1], color=STATES.get(name, INK), **style)


def draw_states(time: Array, angle: Array, states: States, *, label: str = "θ [degrees]") -> Figure:
    """Left: the angle [degrees] over time. Right: state against angle, as in Figure 6 of the paper."""
    order = list(STATES)
    drawing, (over_time, over_angle) = panels(2, 3.0)
    by_state(over_time, time, angle, states, lw=2.4)
    over_time.set(xlabel="time [s]", ylabel=label)
    stretches = state_runs(states)
    for low, high, name in stretches:
        last = min(high, len(angle) - 1)
        row = order.index(name) if name in order else 0
        here, colour = angle[low : last + 1], STATES.get(name, INK)
        over_angle.plot(here, np.full(len(here), row), color=colour, lw=6, solid_capstyle="butt")
        if np.ptp(here) <= 0.01 * np.ptp(angle):  # too short to be seen
            over_angle.plot(here[:1], [row], "s", color=colour, ms=5)
        if len(stretches) <= _MOST_STEPS and last < len(angle) - 1 and str(states[last]) in order:
            there = [row, order.index(str(states[last]))]
            over_angle.plot([angle[last]] * 2, there, color=GREY, lw=0.7)
    over_angle.set_yticks(range(len(order)), order)
    over_angle.set(ylim=(-0.5, len(order) - 0.5), xlabel=label)
    over_angle.locator_params(axis="x", nbins=6)
    legend_of_states(drawing, states)
    return drawing


def draw_bands(
    runs: Sequence[tuple[Array, Array, States]], labels: Sequence[str], *, label: str = "θ [degrees]"
) -> Figure:
    """Above: angles [degrees] of two runs over time [s]. Below: their states as bands. A run: time, angle, states."""
    drawing, axes = sheet(2, 1, 3.8, sharex=True, height_ratios=(2.2, 1.0))
    above, bands = axes[:, 0]
    for number, ((time, angle, states), style) in enumerate(zip(runs, LINES, strict=True)):
        above.plot(time, angle, **style)
        _band(bands, 1 - number, time, states)
    above.set_ylabel(label)
    bands.set_yticks([1, 0], labels)
    bands.set(ylim=(-0.55, 1.55), xlim=(runs[0][0][0], max(time[-1] for time, _, _ in runs)), xlabel="time [s]")
    bands.grid(False)
    there = [name for name in STATES if any(name in states for _, _, states in runs)]
    legend_of_runs(drawing, labels, [handle(name, STATES[name], lw=6) for name in there], columns=6)
    return drawing


def state_strip(drawing: Figure, runs: Sequence[Mapping[str, Any]], labels: Sequence[str], time: float) -> None:
    """At the foot of a picture: the states of its runs (`t_s`, `state`) over time, a cursor at `time` [s]."""
    count = len(runs)
    names = ["\n".join(textwrap.wrap(label, _LABEL)) for label in labels[::-1]] if count > 1 else [""]
    longest = max(len(line) for name in names for line in name.split("\n"))
    left = max(0.09, 0.02 + _LETTER * longest)
    axis = drawing.add_axes((left, 0.055, 0.87 - left, 0.045 + 0.02 * count))
    for number, run in enumerate(runs):
        _band(axis, count - 1 - number, run["t_s"], run["state"])
    axis.axvline(time, color=INK, lw=2.0)
    axis.set(xlim=(0.0, max(float(run["t_s"][-1]) for run in runs)), ylim=(-0.5, count - 0.5))
    axis.set_yticks(range(count) if count > 1 else [], names if count > 1 else [])
    axis.grid(False)
    axis.set_xlabel("time [s]", labelpad=1)
    there = [name for name in STATES if any(name in run["state"] for run in runs)]
    for place, name in enumerate(there):
        drawing.text(0.885, 0.125 - 0.027 * place, "■", color=STATES[name], fontsize=10)
        drawing.text(0.898, 0.125 - 0.027 * place, name, fontsize=10)


def passages(entries: Sequence[Mapping[str, Any]], *, angle: str, label: str) -> list[Block]:
    """The changes of state as a table, the first of many; `angle` is the key of the angle [rad] that is shown."""
    shown = [
        (f"{entry['time']:.6g}", entry["state"], f"{math.degrees(entry[angle]):.4g}") for entry in entries[:_MOST_TOLD]
    ]
    beyond = len(entries) - len(shown)
    more = [text(f"And {beyond} more, in result.json.", small=True)] if beyond > 0 else []
    return [table(("time [s]", "state", label), shown), *more]


def state_runs(states: States) -> list[tuple[int, int, str]]:
    """Stretches of one state: (first row, row after the last, state)."""
    if not len(states):
        return []
    edges = [0, *(np.flatnonzero(states[1:] != states[:-1]) + 1).tolist(), len(states)]
    return [(low, high, str(states[low])) for low, high in pairwise(edges)]


def _band(axis: Axes, row: int, time: Array, states: States) -> None:
    for low, high, name in state_runs(states):
        last = time[min(high, len(time) - 1)]
        axis.barh(row, last - time[low], left=time[low], height=0.8, color=STATES.get(name, INK))
