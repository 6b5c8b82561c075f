"""The sweep of a tumble: figure and table of sweep.csv, a section of the tumble's report."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from vis.page.page import Section, figure, listing, table
from vis.page.style import BED, styled

__all__ = ["sweep_section"]

_PANELS = (
    ("trajectory_angle_rad", 180 / math.pi, "trajectory angle [degrees]"),
    ("max_speed_m_s", 1.0, "largest speed [m/s]"),
    ("max_angular_velocity_rad_s", 1.0, "largest dθ/dt [rad/s]"),
)
_MOST_LINES = 7
"""Values of the other key that are drawn as lines; with more, colours stand for the numbers."""


def sweep_section(result: Mapping[str, Any], figures: Path, columns: Mapping[str, NDArray[np.float64]]) -> Section:
    """The section of the sweep, its figure drawn into `figures`. `columns` are those of the sweep's CSV file."""
    keys = result["sweep"]["keys"]
    with styled():
        drawing = _draw(keys, columns)
        drawing.savefig(figures / "sweep.png", dpi=130)
    names = " and ".join(key["key"] for key in keys)
    caption = (
        f"{result['sweep']['trials']} trials by the batched model, nothing but {names} changed. Gaps: the centre never "
        f"got 10 mm away, or the platform cannot stand."
    )
    blocks = [figure(figures / "sweep.png", title=f"Over {names}", caption=caption)]
    blocks += [table(shown["head"], shown["rows"], title=shown["title"]) for shown in result.get("tables", [])]
    return Section("The sweep", [*blocks, listing(result["sweep"]["sentences"])])


def _draw(keys: list[dict[str, Any]], columns: Mapping[str, NDArray[np.float64]]) -> Figure:
    with mpl.rc_context({"figure.constrained_layout.use": True}):
        drawing = Figure(figsize=(8.6, 3.0))
    FigureCanvasAgg(drawing)
    axes = drawing.subplots(1, len(_PANELS))
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
    handles, labels = axes[0].get_legend_handles_labels()
    drawing.legend(handles, labels, title=_words(keys[other]), loc="outside upper left", ncols=_MOST_LINES)
    return drawing


def _words(key: Mapping[str, Any]) -> str:
    return key["key"] if key["unit"] == "1" else f"{key['key']} [{key['unit']}]"


def _label(axis: Axes, key: Mapping[str, Any], label: str) -> None:
    axis.set_xlabel(_words(key))
    axis.set_ylabel(label)


def _say_if_empty(axis: Axes, key: Mapping[str, Any], values: NDArray[np.float64]) -> None:
    if np.isnan(values).all():
        axis.set_xlim(min(key["values"]), max(key["values"]))
        axis.set_yticks([])
        axis.text(0.5, 0.5, "never 10 mm away", transform=axis.transAxes, ha="center", va="center")
