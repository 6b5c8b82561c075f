"""Report of `hedgebed bed test repose`: the bed from the side, its profile, and the slopes fitted to it."""

from __future__ import annotations

import math
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

__all__ = ["flank_lines", "write_repose_report"]

METHOD = (
    "The bed is set on a rough plate with a slot along all of its width in y, and drains into a pit below. Once "
    "nothing has drained for two of the times in which a grain falls the bed's height, and the grains are at rest "
    "without drag (1e-5 m g d of kinetic energy each), the slopes on both sides are measured: the drained angle of "
    "repose. The bed is periodic along y, so that the slopes have no side walls.",
    "Profile: solid volume in columns half a mean diameter wide, over their area and the packing fraction of the bed "
    "before. Each slope is fitted by least squares from three diameters, or a fifth of the crest's height, to four "
    "fifths of it: the foot at the slot and the crest are left out. The angle of a run is the mean of both slopes; its "
    "error is that of the fits and half the difference of the slopes, in quadrature.",
)


def write_repose_report(folder: str | Path, *, progress: Callable[[float], None] | None = None) -> Path:
    """Make figures/ and report.html of the folder, and return the report."""
    return write_test_report(folder, plots=_plots, tiles=_tiles, method=METHOD, progress=progress)


def _tiles(result: Mapping[str, Any]) -> list[Tile]:
    quantities, runs = result["quantities"], result["runs"]
    return [
        Tile("Angle of repose", said(quantities["angle_of_repose"], 1.0, "°"), "drained; spread between the runs"),
        Tile("Slopes", f"{2 * len(runs)}", f"{len(runs)} beds, two each"),
        Tile("Crest", said(quantities["crest"], 1e3, " mm"), f"grains of {1e3 * runs[0]['grain']:.3g} mm"),
        Tile("Packing fraction", said(quantities["packing_fraction"]), "before the slot was opened"),
    ]


def flank_lines(
    axis: Axes, run: Mapping[str, Any], *, start: float, period: float, colour: Any, base: float = 0.0
) -> None:
    """The straight lines of both flanks in mm: full where they were fitted, dotted down to ``base`` [m]."""
    for sign, flank in zip((1.0, -1.0), run["flanks"], strict=True):
        slope = math.tan(math.radians(flank["angle"]))
        for ends, style in (
            (np.array([flank["foot"], flank["start"]]), ":"),
            (np.array([flank["start"], flank["end"]]), "-"),
        ):
            x = sign * (start + ends)
            x = np.where(np.abs(x) > 0.5 * period, np.nan, x)
            height = base + slope * (ends - flank["foot"])
            axis.plot(1e3 * x, 1e3 * height, color=colour, ls=style, lw=2.0, zorder=3)


def _plots(folder: Path, result: Mapping[str, Any]) -> list[Plot]:
    return [*_side(folder, result), _profiles(folder, result)]


def _side(folder: Path, result: Mapping[str, Any]) -> list[Plot]:
    run = result["runs"][0]

    def draw(axis: Axes) -> None:
        half, plate = 0.5 * run["slot"], run["plate"]
        flank_lines(axis, run, start=half, period=run["size"][0], colour=MODEL, base=plate)
        for side in (-1.0, 1.0):
            ends = side * np.array([half, half, 0.5 * run["size"][0], 0.5 * run["size"][0]])
            heights = plate - 2.0 * run["grain"] * np.array([0.0, 1.0, 1.0, 0.0])
            axis.fill(1e3 * ends, 1e3 * heights, color="#444444", zorder=2)
        axis.set_title(f"{run['id']}: {run['flanks'][1]['angle']:.1f}° and {run['flanks'][0]['angle']:.1f}°")

    words = (
        "All grains from the side, those in front over those behind, coloured by how far each has moved. Lines: the "
        "fitted slopes, dotted down to the plate; below it the pit with what drained. The lines follow the mean "
        "thickness over y, and single grains lie above them."
    )
    return side_plot(folder, run, draw, title="What the slot left", caption=words)


def _profiles(folder: Path, result: Mapping[str, Any]) -> Plot:
    runs = result["runs"]
    with styled():
        drawing, axes = new_panels(len(runs), height=2.4, sharey=True)
        for axis, run, colour in zip(axes, runs, shades(len(runs)), strict=True):
            columns, _ = read_columns(folder / run["series"])
            axis.plot(1e3 * columns["x_m"], 1e3 * columns["thickness_m"], color=colour, marker=".", ls="none")
            flank_lines(axis, run, start=0.5 * run["slot"], period=run["size"][0], colour=MODEL)
            axis.axhline(1e3 * run["surface"], color="#888888", lw=0.8, ls="--")
            axis.set_title(f"{run['id']}: {run['angle']:.1f} ± {run['error']:.1f}°")
            axis.set_xlabel("x [mm]")
            axis.set_ylim(bottom=0.0)
        axes[0].set_ylabel("thickness [mm]")
        legend_above(
            drawing,
            [
                Line2D([], [], color="black", marker=".", ls="none", label="bed"),
                Line2D([], [], color=MODEL, label="fit"),
                Line2D([], [], color="#888888", ls="--", lw=0.8, label="surface before"),
            ],
        )
    return Plot("profiles", "Profile and fitted slopes, run by run", "Heights are not to the scale of x.", drawing)
