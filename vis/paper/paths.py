"""Figures 5 to 7 of the paper with our model: the start on steel, states over the angle, hops as parabolas."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Patch

from vis.page.plots import Array, Plot, handle, legend_above, sheet
from vis.page.report import Result
from vis.page.sentences import Sentences
from vis.page.style import GREY, INK, styled
from vis.page.tumble_series import STATES, state_runs
from vis.paper.run import PaperRun

__all__ = ["figure_5", "figure_6", "figure_7"]

captions = Sentences(__package__, "figures.toml")
_SHOWN = 0.045
"""How far Figure 5 goes [m]: a little more than what the paper trusts."""


def _start(paper: PaperRun, case: Result) -> tuple[Array, Array]:
    """The path from the start to the end of the first hop [mm], as far as Figure 5 goes."""
    numbers, states = paper.rows(case)
    x, y = 1e3 * (numbers["x_m"] - numbers["x_m"][0]), 1e3 * (numbers["y_m"] - numbers["y_m"][0])
    beyond = np.flatnonzero(np.hypot(x, y) > 1e3 * _SHOWN)
    landed = [high for _, high, name in state_runs(states) if name == "hop"]
    end = min([len(x), *beyond[:1].tolist(), *landed[:1]])
    return x[:end], y[:end]


def figure_5(paper: PaperRun) -> Plot | None:
    """Path of the centre from its start, steel, the first gravity."""
    if "steel" not in paper.surfaces:
        return None
    rig, gap = paper.rigs[0], 0.0
    with styled():
        drawing, ((axis,),) = sheet(1, 1, 4.6)
        for stated in (22.5, 60.0):
            reach = 1e3 * _SHOWN
            along = np.array([0.0, reach * math.cos(math.radians(stated))])
            axis.plot(along, along * math.tan(math.radians(stated)), color=GREY, lw=0.9, ls=(0, (5, 3)), zorder=1)
            top = along[1] * math.tan(math.radians(stated))
            axis.annotate(
                f"{stated:g}° in the text", (along[1], top), xytext=(3, 2), textcoords="offset points", color=GREY
            )
        for torque in paper.torques:
            colour = paper.colour(torque)
            low, high = (_start(paper, paper.case("steel", rig, torque, variant)) for variant in ("low", "high"))
            ring = np.concatenate([np.stack(low, axis=1), np.stack(high, axis=1)[::-1]])
            axis.fill(ring[:, 0], ring[:, 1], color=colour, alpha=0.25, lw=0)
            x, y = _start(paper, paper.case("steel", rig, torque))
            axis.plot(x, y, color=colour, lw=2.0)
            fixed = _start(paper, paper.case("steel", rig, torque, "paper"))
            axis.plot(*fixed, color=INK, lw=1.1, ls=(0, (1, 1.6)))
            shared = min(len(x), len(fixed[0]))
            gap = max(gap, float(np.hypot(x[:shared] - fixed[0][:shared], y[:shared] - fixed[1][:shared]).max()))
        axis.plot(0, 0, "o", color=INK, ms=4)
        axis.set(
            aspect="equal",
            xlim=(-2.0, 1.25e3 * _SHOWN),
            ylim=(-1.0, 1.02e3 * _SHOWN),
            xlabel="x of the centre from the start [mm]",
            ylabel="y of the centre from the start [mm]",
        )
        band = Patch(color=GREY, alpha=0.35, lw=0, label="friction band")
        dotted = handle("the paper's 1 ms step", INK, lw=1.1, ls=(0, (1, 1.6)))
        legend_above(drawing, [*paper.handles(), band, dotted], columns=5)
    return Plot.said(captions, "figure5", drawing, rig=rig, shown=1e3 * _SHOWN, gap=gap)


_ROWS = (("low", "μ low"), ("nominal", "μ"), ("high", "μ high"), ("paper", "1 ms step"))


def figure_6(paper: PaperRun) -> Plot | None:
    """State against angle, steel and brick, the first gravity, a row a torque."""
    if not paper.hard:
        return None
    rig, widest = paper.rigs[0], 60.0
    with styled():
        count = len(paper.torques)
        drawing, axes = sheet(count, len(paper.hard), 0.55 + 1.35 * count, sharex=True, sharey=True)
        for i, torque in enumerate(paper.torques):
            for j, surface in enumerate(paper.hard):
                axis: Axes = axes[i, j]
                axis.set_title(f"{surface}, {paper.label(torque)}")
                for row, (variant, _) in enumerate(_ROWS):
                    _state_bar(axis, paper, paper.case(surface, rig, torque, variant), row)
                axis.axvline(0.0, color=GREY, lw=0.6)
                axis.grid(False, axis="y")
        for axis in axes[-1]:
            axis.set_xlabel("θ [degrees]")
        axes[0, 0].set_yticks(range(len(_ROWS)), [label for _, label in _ROWS])
        axes[0, 0].set(ylim=(len(_ROWS) - 0.4, -0.6), xlim=(-2.0, widest))
        handles = [handle(name, colour, lw=6) for name, colour in STATES.items()]
        handles.append(handle("first hop", INK, marker="v", ls="", ms=5))
        legend_above(drawing, handles, columns=5)
    return Plot.said(captions, "figure6", drawing, rig=rig, widest=widest)


def _state_bar(axis: Axes, paper: PaperRun, case: Result, row: int) -> None:
    """One bar of states over the angle; a state too short to be seen is a tick."""
    numbers, states = paper.rows(case)
    theta = np.degrees(numbers["theta_rad"])
    edges = [math.degrees(angle) for _, _, angle in case["transitions"]]
    for low, high, name in state_runs(states):
        start = theta[low] if low == 0 else _nearest(edges, theta[low], theta[low - 1])
        last = theta[high - 1] if high == len(theta) else _nearest(edges, theta[high], theta[high - 1])
        axis.barh(row, last - start, left=start, height=0.62, color=STATES.get(name, INK), lw=0)
    hop = case["transition_angle_hop"]
    if hop is not None:
        axis.plot(math.degrees(hop), row - 0.42, marker="v", color=INK, ms=4.5, clip_on=True)


def _nearest(edges: Sequence[float], one: float, other: float) -> float:
    """The transition between two rows; their middle where none is listed."""
    middle = 0.5 * (one + other)
    between = [edge for edge in edges if min(one, other) - 1e-9 <= edge <= max(one, other) + 1e-9]
    return min(between, key=lambda edge: abs(edge - middle)) if between else middle


def _parabola(launch: Result) -> tuple[Array, Array]:
    """The flight from the launch [m] until it is back at the launch's height, from where it starts."""
    g, vx, vy = launch["gravity"], launch["vx"], launch["vy"]
    time = np.linspace(0.0, 2 * max(vy, 0.0) / g, 120)
    return vx * time, vy * time - 0.5 * g * time**2


def figure_7(paper: PaperRun) -> Plot | None:
    """The first hops extrapolated: motor trials above, all below."""
    if not paper.hard:
        return None
    styles = dict(zip(paper.rigs, ("-", (0, (4, 2)), (0, (1, 1.4))), strict=False))
    flat = []
    with styled():
        drawing, axes = sheet(2, len(paper.hard), 5.4, sharey="row", sharex="row")
        for j, surface in enumerate(paper.hard):
            for i, chosen in enumerate((_motors(paper), paper.torques)):
                axis: Axes = axes[i, j]
                axis.set_title(f"{surface}, {'motor trials' if i == 0 else 'all'}")
                for torque in chosen:
                    for rig, style in styles.items():
                        drawn = _draw_hop(axis, paper, surface, rig, torque, style)
                        if not drawn and i == 0:
                            flat.append(f"{surface}, {rig:g} g, {torque:g} N m")
                axis.plot(0, 0, "o", color=INK, ms=4)
        for axis in axes[-1]:
            axis.set_xlabel("x from the launch [mm]")
        for axis in axes[:, 0]:
            axis.set_ylabel("y from the launch [mm]")
        gravities = [handle(f"{rig:g} g", INK, ls=style, lw=1.6) for rig, style in styles.items()]
        band = Patch(color=GREY, alpha=0.35, lw=0, label="friction band")
        legend_above(drawing, [*paper.handles(), *gravities, band], columns=6)
    missing = f" No hop that rises: {'; '.join(flat)}." if flat else ""
    return Plot.said(captions, "figure7", drawing, missing=missing)


def _motors(paper: PaperRun) -> list[float]:
    return [t for t in paper.torques if any(c["actuator"] == "motor" for c in paper.cases if c["torque"] == t)]


def _draw_hop(axis: Axes, paper: PaperRun, surface: str, rig: float, torque: float, style: Any) -> bool:
    """One hop with its band; False where there is none that rises."""
    low, nominal, high, _ = paper.variants(surface, rig, torque, "launch")
    if nominal is None or nominal["vy"] <= 0:
        return False
    colour = paper.colour(torque)
    if low is not None and high is not None:
        one, other = _parabola(low), _parabola(high)
        ring = np.concatenate([np.stack(one, axis=1), np.stack(other, axis=1)[::-1]])
        axis.fill(1e3 * ring[:, 0], 1e3 * ring[:, 1], color=colour, alpha=0.22, lw=0)
    x, y = _parabola(nominal)
    axis.plot(1e3 * x, 1e3 * y, color=colour, ls=style, lw=1.7)
    return True
