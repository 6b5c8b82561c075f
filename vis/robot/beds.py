"""The report of a robot on several beds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from vis.page.page import Section, listing, text
from vis.page.plots import BED, DASHED, MODEL, Array, legend_above
from vis.page.report import Report, given, tables
from vis.spatial.report import pair

from .answer import answer_tiles

__all__ = ["draw_beside", "write_beds_report"]

Columns = Mapping[str, Array]
OWN = "Pictures, film and figures of each bed are in the report of its folder: {folders}."


def write_beds_report(report: Report) -> Path:
    """The report of a robot on several beds. Raises FileNotFoundError where the series of a bed is missing."""
    result, law = report.result, report.result["beside_law"]
    folders = [bed["folder"] for bed in result["beds"]]
    runs = [report.columns(f"{folder}/series/motion.csv") for folder in folders]
    beside = report.columns(f"{folders[0]}/series/{law}.csv")
    drawn = report.draw("beds", draw_beside(runs, beside, law, called="each bed"), law=law)
    sections = [
        Section("", [listing(result["departures"]["sentences"])]),
        Section("Over time", [drawn]),
        Section("Each bed", [*tables(result), text(OWN.format(folders=", ".join(folders)), small=True)]),
        Section("The trial", [given(result["trial"])]),
        report.numbers(std=True),
        report.again("hedgebed mujoco run.toml"),
    ]
    return report.write(sections, lead=["mujoco", f"{result['duration']:g} s"], tiles=answer_tiles(result))


def draw_beside(runs: Sequence[Columns], beside: Columns, law: str, *, called: str) -> Figure:
    """Rise and deepest foot over time: a line for each run on grains, `called` so in the legend, and the law."""
    drawing, height, depth = pair("rise of the centre of mass [mm]", "depth of the deepest foot [mm]")
    own: Mapping[str, Any] = {"color": BED, "lw": 0.8} if len(runs) > 1 else {"color": BED}
    styles: list[Mapping[str, Any]] = [*(own for _ in runs), {"color": MODEL, "ls": DASHED}]
    for columns, style in zip([*runs, beside], styles, strict=True):
        height.plot(columns["t_s"], 1e3 * (columns["z_m"] - columns["z_m"][0]), **style)
        depth.plot(columns["t_s"], 1e3 * columns["sinkage_m"], **style)
    height.lines[0].set_label(called)
    height.lines[-1].set_label(law)
    depth.invert_yaxis()
    legend_above(drawing, [height.lines[0], height.lines[-1]], 2)
    return drawing
