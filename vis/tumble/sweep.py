"""The sweep of a tumble: figure and table of sweep.csv, a section of the tumble's report."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vis.page.page import Section, listing
from vis.page.plots import Array, Plot, legend_above, sheet
from vis.page.report import Report, Result, tables
from vis.page.sentences import Sentences
from vis.page.style import BED, styled

__all__ = ["sweep_section"]

captions = Sentences(__package__, "figures.toml")
_PANELS = (
    ("trajectory_angle_rad", 180 / math.pi, "trajectory angle [degrees]"),
    ("max_speed_m_s", 1.0, "largest speed [m/s]"),
    ("max_angular_velocity_rad_s", 1.0, "largest dθ/dt [rad/s]"),
)
_MOST_LINES = 7
"""Values of the other key that are drawn as lines; with more, colours stand for the numbers."""


def sweep_section(report: Report) -> Section:
    """The section of the sweep, its figure drawn from the sweep's CSV file."""
    sweep = report.result["sweep"]
    with styled():
        drawing = _draw(sweep["keys"], report.columns(sweep["file"]))
    names = " and ".join(key["key"] for key in sweep["keys"])
    drawn = report.draw(Plot.said(captions, "sweep", drawing, trials=sweep["trials"], names=names))
    told = tables(report.result) if "tables" in report.result else []
    return Section("The sweep", [drawn, *told, listing(sweep["sentences"])])


def _draw(keys: Sequence[Result], columns: Mapping[str, Array]) -> Figure:
    drawing, (axes,) = sheet(1, len(_PANELS), 3.0)
    shape = [len(key["values"]) for key in keys]
    if len(keys) == 1:
        for axis, (name, scale, label) in zip(axes, _PANELS, strict=True):
            axis.plot(columns[keys[0]["column"]], scale * columns[name], "o-", color=BED, ms=3.5, lw=1.4)
            _say_if_empty(axis, keys[0], columns[name])
            _label(axis, keys[0], label)
        return drawing
    along, other = (0, 1) if shape[0] >= shape[1] else (1, 0)
    grids = [scale * np.moveaxis(columns[name].reshape(shape), along, 0) for name, scale, _ in _PANELS]
    if min(shape) > _MOST_LINES:
        for axis, grid, (_, _, label) in zip(axes, grids, _PANELS, strict=True):
            mesh = axis.pcolormesh(keys[along]["values"], keys[other]["values"], grid.T, shading="nearest")
            bar = drawing.colorbar(mesh, ax=axis, location="top", shrink=0.95)
            bar.set_label(label)
            axis.set_xlabel(_words(keys[along]))
            axis.grid(False)
        axes[0].set_ylabel(_words(keys[other]))
        return drawing
    colours = [mpl.colormaps["viridis"](share) for share in np.linspace(0.0, 0.88, min(shape))]
    for axis, grid, (_, _, label) in zip(axes, grids, _PANELS, strict=True):
        for values, colour, value in zip(grid.T, colours, keys[other]["values"], strict=True):
            axis.plot(keys[along]["values"], values, "o-", color=colour, ms=3, lw=1.3, label=f"{value:g}")
        _say_if_empty(axis, keys[along], grid)
        _label(axis, keys[along], label)
    legend_above(drawing, axes[0].lines, _MOST_LINES, title=_words(keys[other]))
    return drawing


def _words(key: Result) -> str:
    return key["key"] if key["unit"] == "1" else f"{key['key']} [{key['unit']}]"


def _label(axis: Axes, key: Result, label: str) -> None:
    axis.set(xlabel=_words(key), ylabel=label)


def _say_if_empty(axis: Axes, key: Result, values: Array) -> None:
    if np.isnan(values).all():
        axis.set_xlim(min(key["values"]), max(key["values"]))
        axis.set_yticks([])
        axis.text(0.5, 0.5, "never 10 mm away", transform=axis.transAxes, ha="center", va="center")
