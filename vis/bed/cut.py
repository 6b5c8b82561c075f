"""Report of `hedgebed bed test cut`: what gravity a vertical face bore, and what it fell to."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator

from vis.bed.repose import flank_lines
from vis.bed.tests import said, side_plot, write_test_report
from vis.page.page import Tile
from vis.page.style import BED, MODEL, styled
from vis.penetrate.plot_parts import Plot, legend_above, new_panels, shades
from vis.tumble.report import read_columns

__all__ = ["FALLEN_SHARE", "write_cut_report"]

FALLEN_SHARE = 0.2
"""Of a wedge's grains: `dem.measure.cutting`'s, which a test holds it to; reports read run folders only."""

METHOD = (
    "A strip is dug out of a level bed at a tenth of its gravity, which leaves two vertical faces as high as the bed. "
    "Then gravity rises by factors of 1.41, up to four times the bed's own, as in a centrifuge: a face of height h at "
    "n g is loaded as one of n h at g. A face has fallen once a fifth of the grains in front of Rankine's plane behind "
    "it (60 degrees from the horizontal) have moved by more than a diameter; between the last gravity that both faces "
    "bore and the one at which one of them fell the middle is tried as well.",
    "Critical height: geometric middle of the heights, at the bed's own gravity, that stood and that fell. Cohesion by "
    "Terzaghi's plane wedge without tension cracks, c = gamma H / 4 tan(45 + phi / 2); an upper bound solution, so "
    "that the soil may have a little more cohesion than this says. Angle and cohesion are those of Mohr's circle; on "
    "the plane of shear a shear box reads less of both.",
)


def write_cut_report(folder: str | Path, *, progress: Callable[[float], None] | None = None) -> Path:
    """Make figures/ and report.html of the folder, and return the report."""
    return write_test_report(folder, plots=_plots, tiles=_tiles, method=METHOD, progress=progress)


def _tiles(result: Mapping[str, Any]) -> list[Tile]:
    quantities, runs = result["quantities"], result["runs"]
    bounds = [run["low"] for run in runs], [run["high"] for run in runs if run["high"] is not None]
    between = f"more than {1e3 * min(bounds[0]):.3g} mm" if any(bounds[0]) else "no face stood"
    if len(bounds[1]) == len(runs):
        between += f", less than {1e3 * max(bounds[1]):.3g} mm"
    note = str(quantities["cohesion"]["note"]).partition(";")[0]
    angle = f"Terzaghi, with {note.partition(' with ')[2]}" if " with phi" in note else note
    return [
        Tile("Critical height", said(quantities["critical_height"], 1e3, " mm"), between),
        Tile("Cohesion", said(quantities["cohesion"], 1.0, " Pa"), angle),
        Tile("Slumped to", said(quantities["slumped_to"], 1.0, "°"), "slope of a fallen face"),
        Tile("Height of the faces", f"{1e3 * runs[0]['height']:.3g} mm", f"{len(runs)} beds"),
    ]


def _plots(folder: Path, result: Mapping[str, Any]) -> list[Plot]:
    return [*_side(folder, result), _profiles(folder, result), _trials(result)]


def _side(folder: Path, result: Mapping[str, Any]) -> list[Plot]:
    run = result["runs"][0]

    def draw(axis: Axes) -> None:
        high = 1e3 * run["height"]
        axis.set_ylim(top=max(axis.get_ylim()[1], 1.1 * high))
        for side in (-1, 1):
            axis.plot(2 * [5e2 * side * run["width"]], [0.0, high], color=MODEL, lw=1.2, ls="--")
        if run["flanks"]:
            flank_lines(axis, run, start=0.0, period=run["size"][0], colour=MODEL)

    words = (
        "All grains from the side at the end, at the bed's own gravity, coloured by how far each has moved. Dashed: "
        "the faces as they were cut; lines: the slopes that were fitted, if one fell."
    )
    return side_plot(folder, run, draw, title="What became of the faces", caption=words)


def _profiles(folder: Path, result: Mapping[str, Any]) -> Plot:
    runs = result["runs"]
    with styled():
        drawing, axes = new_panels(len(runs), height=2.4, sharey=True)
        for axis, run in zip(axes, runs, strict=True):
            columns, _ = read_columns(folder / run["series"])
            if "thickness_standing_m" in columns:
                axis.step(1e3 * columns["x_m"], 1e3 * columns["thickness_standing_m"], where="mid", color=BED, lw=1.2)
            axis.step(1e3 * columns["x_m"], 1e3 * columns["thickness_m"], where="mid", color=MODEL, lw=1.2, ls="--")
            axis.set_title(run["id"])
            axis.set_xlabel("x [mm]")
            axis.set_ylim(bottom=0.0)
        axes[0].set_ylabel("thickness [mm]")
        legend_above(
            drawing,
            [
                Line2D([], [], color=BED, lw=1.2, label="stood last"),
                Line2D([], [], color=MODEL, ls="--", lw=1.2, label="at the end"),
            ],
        )
    words = (
        "Solid volume over area and packing fraction, in columns of half a diameter. Heights are not to the scale of x."
    )
    return Plot("profiles", "Profiles, run by run", words, drawing)


def _trials(result: Mapping[str, Any]) -> Plot:
    runs = result["runs"]
    with styled():
        drawing, (axis,) = new_panels(1, height=2.6)
        handles = []
        for run, colour in zip(runs, shades(len(runs)), strict=True):
            trials = np.array(sorted(run["trials"]))
            axis.plot(1e3 * run["height"] * trials[:, 0], trials[:, 1], color=colour, marker="o", ms=4)
            handles.append(Line2D([], [], color=colour, marker="o", ms=4, label=run["id"]))
        axis.axhline(FALLEN_SHARE, color=MODEL, lw=1.0, ls="--")
        axis.set_xscale("log")
        heights = [1e3 * run["height"] for run in runs]
        axis.set_xlim(0.09 * min(heights), 4.4 * max(heights))
        axis.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.xaxis.set_major_formatter("{x:g}")
        axis.xaxis.set_minor_formatter("")
        axis.set_ylim(-0.03, 1.03)
        axis.set_xlabel("height of the face at the bed's own gravity [mm]")
        axis.set_ylabel("grains of the wedge\nthat have moved [1]")
        legend_above(drawing, handles)
    words = (
        "Share of the wedge's grains that have moved by more than a diameter; a face has fallen above the dashed line."
    )
    return Plot("trials", "Gravity by gravity", words, drawing)
