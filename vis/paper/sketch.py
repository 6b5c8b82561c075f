"""A labelled sketch of the planar model: `python -m vis.paper.sketch docs` writes docs/images/planar-sketch.png.

Left the platform on its leading row, with the coordinates, the actuation and the contact; right the rig that offloads
gravity. Axes, angles and signs are those of docs/planar.md: x to the right, y up from the undisturbed surface, theta
clockwise. The depth of the tip is exaggerated.
"""

from __future__ import annotations

import math
import sys
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, FancyArrowPatch, Polygon, Rectangle

from vis.page.plots import BED, GREY, INK, MODEL, Array, new_figure, styled
from vis.pictures.canvas import FORCE

__all__ = ["draw_sketch", "main", "tip"]

LENGTH, CLEAR, ROWS = 0.2, 0.04, 8
"""Centre to tip and free length of a spike [m], and rows of spikes, of the Hedgehog (docs/platform.md)."""
THETA, DEPTH = math.radians(12.0), 0.024
"""How far the platform has turned, and how deep its leading tip is [m]."""
LEADING = ROWS - 1
_GROUND, _HULL = "#ece2d2", "#dfe2e6"
_SOFT = "#666666"
_FORCE = str(FORCE["color"])
_FOOT = 0.155
"""Depth of the ground that is drawn [m]."""
Point = tuple[float, float]


def tip(row: int, centre: Point, theta: float, length: float = LENGTH) -> Point:
    """Where the tip of a row is [m]: x - l sin gamma, y - l cos gamma with gamma = theta + pi/8 + row pi/4."""
    gamma = theta + math.pi / ROWS + 2.0 * math.pi / ROWS * row
    return centre[0] - length * math.sin(gamma), centre[1] - length * math.cos(gamma)


def draw_sketch() -> Figure:
    """The figure of two panels."""
    figure = new_figure(4.9, width=9.0, layout="none")
    left = figure.add_axes((0.0, 0.0, 0.575, 0.93))
    right = figure.add_axes((0.575, 0.0, 0.425, 0.93))
    for axis, low, share in ((left, -0.325, 0.575), (right, -0.215, 0.425)):
        span = 0.68 * share / 0.575
        tall = span * 0.93 * 4.9 / (share * 9.0)
        axis.set(xlim=(low, low + span), ylim=(-_FOOT, tall - _FOOT), aspect="equal")
        axis.set_axis_off()
        axis.add_patch(Rectangle((low, -_FOOT), span, _FOOT, color=_GROUND, lw=0, zorder=0))
        axis.plot([low, low + span], [0.0, 0.0], color=INK, lw=0.9, ls=(0, (5, 4)), zorder=1)
    figure.text(0.012, 0.985, "The platform and its contact", fontsize=11, fontweight="bold", va="top")
    figure.text(0.587, 0.985, "The rig that offloads gravity", fontsize=11, fontweight="bold", va="top")
    figure.add_artist(Line2D([0.575, 0.575], [0.0, 0.93], color="white", lw=7.0, zorder=9))
    _platform_panel(left)
    _rig_panel(right)
    return figure


def _platform_panel(axis: Axes) -> None:
    """Coordinates, spikes, flywheel, torque; spring, damper and friction at the leading tip."""
    gamma = THETA + math.pi / ROWS + 2.0 * math.pi / ROWS * LEADING
    centre = (0.0, LENGTH * math.cos(gamma) - DEPTH)
    _platform(axis, centre, THETA, LENGTH)
    _axes(axis, (-0.285, 0.0), 0.07)
    _words(axis, (-0.315, -0.04), "undisturbed surface, y = 0", color=_SOFT, fontsize=8.5)
    _angle_of_body(axis, centre)
    _wheel(axis, centre)
    _arrow(axis, centre, (centre[0], centre[1] - 0.078), colour=_FORCE)
    _words(axis, (centre[0] - 0.006, centre[1] - 0.075), "$W$", color=_FORCE, ha="right", zorder=9)
    axis.plot(*centre, "o", color=INK, ms=5, zorder=8)
    _words(axis, (0.163, 0.375), "geometric centre\nand centre of mass:\n$(x, y)$;  $m$, $J$", va="top")
    axis.annotate("", centre, (0.160, 0.345), zorder=8, arrowprops={
        "arrowstyle": "-", "color": INK, "lw": 0.8, "shrinkA": 0, "shrinkB": 3})  # fmt: skip
    _rows(axis, centre)
    _length(axis, centre)
    _contact(axis, tip(LEADING, centre, THETA))


def _rig_panel(axis: Axes) -> None:
    """The platform on the string that runs over two pulleys to the counterweight."""
    small = 0.55
    centre = (-0.09, small * LENGTH * math.cos(math.pi / ROWS) - 0.008)
    _platform(axis, centre, 0.0, small * LENGTH)
    axis.plot(*centre, "o", color=INK, ms=4, zorder=8)
    _words(axis, (centre[0] + 0.013, centre[1] - 0.002), "shaft", fontsize=8.5, zorder=9)
    top, radius, block = 0.375, 0.019, 0.215
    far = 0.085
    wheels = [(centre[0] + radius, top), (far - radius, top)]
    for middle in wheels:
        axis.add_patch(Circle(middle, radius, facecolor="white", edgecolor=INK, lw=1.3, zorder=4))
        axis.plot(*middle, "o", color=INK, ms=3, zorder=5)
        axis.plot([middle[0], middle[0]], [top, top + 0.037], color=INK, lw=1.2, zorder=3)
    axis.plot([wheels[0][0] - 0.035, wheels[1][0] + 0.035], [top + 0.037] * 2, color=INK, lw=2.2)
    string: dict[str, Any] = {"color": BED, "lw": 1.6, "zorder": 6}
    axis.plot([centre[0]] * 2, [centre[1], top], **string)
    axis.plot([wheels[0][0], wheels[1][0]], [top + radius] * 2, **string)
    axis.plot([far] * 2, [top, block], **string)
    _words(axis, (centre[0] + 0.008, 0.29), "wires", color=BED)
    _words(axis, (0.5 * (wheels[0][0] + wheels[1][0]), top - 0.002), "pulleys", ha="center", va="center")
    axis.add_patch(Rectangle((far - 0.026, block - 0.052), 0.052, 0.052, facecolor=_HULL, edgecolor=INK, lw=1.2))
    _words(axis, (far, block - 0.026), "$m_b$", ha="center", va="center", fontsize=11)
    _words(axis, (far + 0.032, block - 0.026), "counter-\nweight", va="center")
    _arrow(axis, (centre[0] - 0.028, 0.225), (centre[0] - 0.028, 0.275))
    _words(axis, (centre[0] - 0.034, 0.25), "$dy/dt$", ha="right", va="center")
    _arrow(axis, (far + 0.012, block - 0.062), (far + 0.012, block - 0.112))
    _words(axis, (far + 0.02, block - 0.088), "$dy_b/dt = -dy/dt$", va="center")
    _arrow(axis, (0.24, 0.36), (0.24, 0.29), colour=_FORCE)
    _words(axis, (0.248, 0.325), "$g$", color=_FORCE, va="center")
    _axes(axis, (0.19, 0.0), 0.05)
    rules = (
        r"free fall of the pair:  $g_{sim} = g\,(m - m_b)\,/\,(m + m_b)$",
        r"load on the surface:  $W = (m + m_b)\,g_{sim}$",
        "inertia:  $m$ along x,  $m + m_b$ along y",
        r"without a rig:  $m_b = 0$, and $g_{sim}$ is the local gravity",
    )
    for place, rule in enumerate(rules):
        _words(axis, (-0.205, -0.03 - 0.032 * place), rule, va="center", fontsize=8.8)


def _platform(axis: Axes, centre: Point, theta: float, length: float) -> None:
    """Hull and spikes of a platform that has turned by theta [rad]."""
    corner = length * (LENGTH - CLEAR) / LENGTH
    for row in range(ROWS):
        ends = np.array([tip(row, centre, theta, corner), tip(row, centre, theta, length)])
        axis.plot(ends[:, 0], ends[:, 1], color="#6d7278", lw=30 * length, solid_capstyle="round", zorder=4)
    ring = [tip(row, centre, theta, corner) for row in range(ROWS)]
    axis.add_patch(Polygon(ring, closed=True, facecolor=_HULL, edgecolor=INK, lw=1.2, zorder=5))


def _axes(axis: Axes, origin: Point, long: float) -> None:
    """x to the right along the surface, y up from it."""
    for name, end, place in (
        ("$x$", (origin[0] + long, origin[1]), (origin[0] + long - 0.006, origin[1] + 0.016)),
        ("$y$", (origin[0], origin[1] + long), (origin[0] + 0.014, origin[1] + long - 0.006)),
    ):
        _arrow(axis, origin, end)
        _words(axis, place, name, ha="center", va="center", fontsize=11)


def _angle_of_body(axis: Axes, centre: Point) -> None:
    """The body's y axis, (sin theta, cos theta), and theta from the vertical to it, clockwise."""
    reach = 0.238
    up = np.array([0.0, reach]) + centre
    body = reach * np.array([math.sin(THETA), math.cos(THETA)]) + centre
    axis.plot([centre[0], up[0]], [centre[1], up[1]], color=GREY, lw=1.0, ls=(0, (2, 2)), zorder=6)
    axis.plot([centre[0], body[0]], [centre[1], body[1]], color=INK, lw=1.0, ls=(0, (6, 2)), zorder=6)
    _turn(axis, centre, 0.225, 90.0, 90.0 - math.degrees(THETA), INK)
    _words(axis, (body[0] + 0.008, body[1] - 0.012), r"$\theta$, clockwise")


def _wheel(axis: Axes, centre: Point) -> None:
    """The flywheel, what it gets and what the platform gets."""
    axis.add_patch(Circle(centre, 0.052, facecolor="white", edgecolor=INK, lw=1.3, zorder=6))
    _turn(axis, centre, 0.040, -25.0, 115.0, MODEL)
    _words(axis, (centre[0] - 0.042, centre[1] + 0.008), r"$-\tau$", color=MODEL, zorder=9)
    _words(axis, (-0.118, centre[1] - 0.062), "flywheel\n$J_w$, $\\omega_w$", ha="left", fontsize=8.5, zorder=9)
    _turn(axis, centre, 0.103, 155.0, 60.0, MODEL, thick=2.2)
    _words(axis, (centre[0] - 0.058, centre[1] + 0.108), r"$+\tau$", color=MODEL, fontsize=12, ha="right", zorder=9)


def _rows(axis: Axes, centre: Point) -> None:
    """Numbers of the rows that stand at theta = 0, and the angle of the rear one from straight down."""
    rear = tip(0, centre, THETA)
    down = np.array([centre[0], centre[1] - 0.155])
    axis.plot([centre[0], down[0]], [centre[1], down[1]], color=GREY, lw=1.0, ls=(0, (2, 2)), zorder=6)
    axis.plot([centre[0], rear[0]], [centre[1], rear[1]], color=INK, lw=0.8, zorder=6)
    _turn(axis, centre, 0.128, -90.0, -90.0 - math.degrees(THETA + math.pi / ROWS), INK)
    _words(axis, (-0.036, 0.066), r"$\gamma_0$", ha="center", va="center", fontsize=11, zorder=9)
    _words(axis, (rear[0] - 0.012, rear[1] + 0.002), "row 0", ha="right", fontsize=8.5)
    ahead = tip(LEADING, centre, THETA)
    _words(axis, (ahead[0] + 0.024, 0.01), "row 7 leads", fontsize=8.5)
    words = "row $n$:  $\\gamma_n = \\theta + \\pi/8 + n\\,\\pi/4$\nfrom straight down"
    _words(axis, (-0.315, 0.43), words, va="top", fontsize=8.8)


def _length(axis: Axes, centre: Point) -> None:
    """l, from the centre to the tip of the leading row."""
    end = tip(LEADING, centre, THETA)
    axis.plot([centre[0], end[0]], [centre[1], end[1]], color=INK, lw=0.8, zorder=6)
    along = 0.47
    place = (centre[0] + along * (end[0] - centre[0]) + 0.008, centre[1] + along * (end[1] - centre[1]))
    _words(axis, place, "$l$", fontsize=11, zorder=9)


def _contact(axis: Axes, end: Point) -> None:
    """Depth, spring, damper, normal force and friction at a tip."""
    base = end[1] - 0.072
    _spring(axis, end[0] - 0.016, end[1] - 0.008, base)
    _damper(axis, end[0] + 0.016, end[1] - 0.008, base)
    axis.plot([end[0] - 0.016, end[0] + 0.016], [end[1] - 0.008] * 2, color=INK, lw=1.3, zorder=5)
    axis.plot([end[0] - 0.04, end[0] + 0.04], [base, base], color=INK, lw=1.3)
    for place in np.linspace(end[0] - 0.034, end[0] + 0.04, 7):
        axis.plot([place, place - 0.008], [base, base - 0.009], color=INK, lw=0.9)
    _words(axis, (end[0] - 0.03, end[1] - 0.042), "$K$", ha="right", va="center", fontsize=11)
    _words(axis, (end[0] + 0.03, end[1] - 0.042), "$C$", va="center", fontsize=11)
    _arrow(axis, end, (end[0], end[1] + 0.088), colour=_FORCE, thick=2.0, above=True)
    _words(axis, (end[0] + 0.009, end[1] + 0.078), "$N$", color=_FORCE, zorder=9)
    _arrow(axis, end, (end[0] + 0.075, end[1]), colour=_FORCE, thick=2.0, above=True)
    _words(axis, (end[0] + 0.082, end[1]), "$F$", color=_FORCE, va="center", zorder=9)
    left = end[0] - 0.055
    axis.annotate("", (left, 0.0), (left, end[1]), arrowprops={
        "arrowstyle": "<->", "color": INK, "lw": 0.9, "shrinkA": 0, "shrinkB": 0, "mutation_scale": 7})  # fmt: skip
    axis.plot([left - 0.006, end[0]], [end[1]] * 2, color=INK, lw=0.6)
    _words(axis, (left - 0.006, 0.5 * end[1]), r"depth $z = h - y$", ha="right", va="center")
    rules = (
        r"$N = K z + C\,\max(0,\,dz/dt)$",
        r"sticks:  $|F| \leq \mu_s N$",
        r"slips:  $|F| = \mu_d N$, against the slip",
    )
    for place, rule in enumerate(rules):
        _words(axis, (0.091, -0.062 - 0.03 * place), rule, va="center", fontsize=8.8)


def _spring(axis: Axes, x: float, top: float, foot: float) -> None:
    """A zigzag from top to foot [m]."""
    height = np.array([0.0, 0.15, *np.linspace(0.2, 0.8, 9), 0.85, 1.0])
    aside = np.array([0.0, 0.0, *(0.008 * (-1.0) ** np.arange(9)), 0.0, 0.0])
    axis.plot(x + aside, top + height * (foot - top), color=INK, lw=1.2)


def _damper(axis: Axes, x: float, top: float, foot: float) -> None:
    """A piston in a pot that is open above."""
    middle = 0.5 * (top + foot)
    axis.plot([x, x], [top, middle], color=INK, lw=1.2)
    axis.plot([x - 0.006, x + 0.006], [middle, middle], color=INK, lw=2.4)
    sides, edges = x + 0.009 * np.array([-1, -1, 1, 1]), middle + 0.012 * np.array([1, -1, -1, 1])
    axis.plot(sides, edges, color=INK, lw=1.2)
    axis.plot([x, x], [middle - 0.012, foot], color=INK, lw=1.2)


def _arrow(axis: Axes, start: Point, end: Point, *, colour: str = INK, thick: float = 1.4, above: bool = False) -> None:
    """A straight arrow."""
    style = "-|>,head_width=3,head_length=6"
    axis.add_patch(FancyArrowPatch(start, end, arrowstyle=style, color=colour, lw=thick, shrinkA=0, shrinkB=0,
                                   zorder=8 if above else 7))  # fmt: skip


def _turn(axis: Axes, centre: Point, radius: float, begin: float, end: float, colour: str, thick: float = 1.3) -> None:
    """An arc with an arrow at its end, from one angle to another [degrees], counted anticlockwise from the right."""
    angles: Array = np.radians(np.linspace(begin, end, 60))
    path = np.column_stack([centre[0] + radius * np.cos(angles), centre[1] + radius * np.sin(angles)])
    axis.plot(path[:-4, 0], path[:-4, 1], color=colour, lw=thick, zorder=8)
    style = "-|>,head_width=3,head_length=6"
    axis.add_patch(FancyArrowPatch(tuple(path[-6]), tuple(path[-1]), arrowstyle=style, color=colour, lw=thick,
                                   shrinkA=0, shrinkB=0, zorder=8))  # fmt: skip


def _words(axis: Axes, place: Point, words: str, **style: Any) -> None:
    usual: dict[str, Any] = {"fontsize": 9.5, "va": "baseline", "zorder": 7}
    axis.text(*place, words, **(usual | style))


def main(folder: str) -> Path:
    """Write the figure into the documentation in `folder`, and return it."""
    path = Path(folder) / "images" / "planar-sketch.png"
    with styled():
        draw_sketch().savefig(path, dpi=120)
    return path


if __name__ == "__main__":
    print(main(sys.argv[1] if len(sys.argv) > 1 else "docs"))
