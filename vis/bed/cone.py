"""Report of `hedgebed bed test cone`: cone index against depth, push by push, and the line fitted to each."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from vis.bed.tests import said, side_plot, write_test_report
from vis.page.page import Tile
from vis.page.style import MODEL, styled
from vis.penetrate.plot_parts import Plot, legend_above, new_panels, shades
from vis.tumble.report import read_columns

__all__ = ["write_cone_report"]

METHOD = (
    "A cone on a thinner shaft goes straight down at constant speed into a bed that is periodic sideways, each push "
    "into a fresh copy of its bed. Cone index: vertical force over the area of the cone's base. Depth is that of the "
    "base, 0 where the cone is just all in, counted from the height where the bed's packing falls to half.",
    "Gradient: slope of a straight line by least squares over all depths of the base from 0 on.",
)


def write_cone_report(folder: str | Path, *, progress: Callable[[float], None] | None = None) -> Path:
    """Make figures/ and report.html of the folder, and return the report."""
    return write_test_report(folder, plots=_plots, tiles=_tiles, method=METHOD, progress=progress)


def _tiles(result: Mapping[str, Any]) -> list[Tile]:
    quantities, one = result["quantities"], result["runs"][0]
    return [
        Tile("Gradient of the cone index", said(quantities["gradient"], 1e-6, " MPa/m"), "spread between the pushes"),
        Tile("Over the unit weight", said(quantities["gradient_over_weight"]), "gradient / (bulk density g)"),
        Tile("Cone index at the end", said(quantities["index_at_end"], 1e-3, " kPa"), "last tenth of the way"),
        Tile("Speed", f"{1e3 * one['speed']:.3g} mm/s", f"v / sqrt(g D) = {one['froude']:.2g}"),
    ]


def _plots(folder: Path, result: Mapping[str, Any]) -> list[Plot]:
    return [_indices(folder, result), *_side(folder, result)]


def _indices(folder: Path, result: Mapping[str, Any]) -> Plot:
    runs = result["runs"]
    with styled():
        drawing, (axis, lines) = new_panels(2, height=3.8, sharey=True)
        handles = []
        for run, colour in zip(runs, shades(len(runs)), strict=True):
            columns, _ = read_columns(folder / run["series"])
            depth = 1e3 * columns["base_depth_m"]
            axis.plot(1e-3 * columns["index_Pa"], depth, color=colour, lw=1.2)
            inside = depth >= 0
            lines.plot(1e-3 * columns["index_Pa"][inside], depth[inside], color=colour, lw=0.6, alpha=0.5)
            ends = np.array([0.0, depth[-1]])
            lines.plot(1e-3 * (run["start"] + run["gradient"] * 1e-3 * ends), ends, color=colour, lw=2.0)
            handles.append(Line2D([], [], color=colour, label=run["id"]))
        axis.axhline(0.0, color=MODEL, lw=1.0, ls="--")
        axis.invert_yaxis()
        axis.set_ylabel("depth of the cone's base [mm]")
        axis.set_title("all the way")
        lines.set_title("fitted lines")
        for panel in (axis, lines):
            panel.set_xlim(left=0.0)
            panel.set_xlabel("cone index [kPa]")
        legend_above(drawing, handles)
    words = (
        "Means over a 200th of the way. Dashed: the cone is just all in; before, its index counts the whole base while "
        "only the tip is in the bed."
    )
    return Plot("index", "Cone index against depth", words, drawing)


def _side(folder: Path, result: Mapping[str, Any]) -> list[Plot]:
    run = result["runs"][0]

    def behind(grains: Mapping[str, Any]) -> dict[str, Any]:
        period = np.array(run["size"][:2])
        away = grains["position"][:, :2] - np.array(run["place"])
        away -= period * np.round(away / period)
        kept = {name: np.asarray(values) for name, values in grains.items()}
        kept["position"] = np.column_stack([away, grains["position"][:, 2]])
        return {name: values[away[:, 1] > 0] for name, values in kept.items()}

    def draw(axis: Axes) -> None:
        tip, length, half = 1e3 * (run["surface"] - run["depth"]), 1e3 * run["length"], 5e2 * run["diameter"]
        top = axis.get_ylim()[1]
        axis.fill([0.0, half, -half], [tip, tip + length, tip + length], facecolor="#d9d9d9", edgecolor="black", lw=0.8)
        shaft = 0.5e3 * run["shaft"]
        axis.fill(
            [-shaft, shaft, shaft, -shaft], [tip + length, tip + length, top, top],
            facecolor="#d9d9d9", edgecolor="black", lw=0.8,
        )  # fmt: skip

    words = "The half of the bed behind the cone's axis, grains coloured by how far each has moved."
    return side_plot(folder, run, draw, title="The cone at its deepest", caption=words, top=2.0, shown=behind)
