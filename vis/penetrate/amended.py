"""The law with what it lacked, beside the spring-damper and, where there is one, the bed: a plot, and a page.

The bed is blue and thin, the spring-damper orange and dashed, the amended law green and solid.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vis.page.folder import Run, RunFolder, Series, read_folder
from vis.page.numbers import quote
from vis.page.page import Section, Tile, table, text
from vis.page.plots import DASHED, Plot, handle, legend_above, sheet
from vis.page.report import Progress, Report, Result, again
from vis.page.style import BED, GREY, MODEL, styled

__all__ = ["AMENDED", "TITLE", "amended_plot", "is_amended", "words_of_effects", "write_amended_report"]

AMENDED = "#009E73"
"""The amended law (Okabe and Ito's green)."""
TITLE = "With what was missing"
_CAPTION = (
    "Top: the ground's force while the spike is driven in and pulled out. Below: the depth of drops, and of the spike "
    "that is set down, downwards."
)
_MOST = 4
"""Panels in a row at most."""


def is_amended(run: RunFolder) -> bool:
    """Whether a model's law was run."""
    return any(r.amended is not None for r in run.runs)


def words_of_effects(result: Result) -> str:
    """What was added, in words."""
    model = result.get("model")
    effects = model.get("effects") if isinstance(model, Mapping) else None
    return " and ".join(map(str, effects)) if effects else "nothing added"


def amended_plot(run: RunFolder) -> Plot | None:
    """Force against depth of driven runs, depth against time of drops and set-downs; None where there is no law."""
    drawing = _draw(run)
    return None if drawing is None else Plot("amended", TITLE, _CAPTION, drawing)


def _draw(run: RunFolder) -> Figure | None:
    driven, drops, stood = (
        [r for r in run.of_kind(kind) if r.amended is not None] for kind in ("driven", "drop", "set_down")
    )
    groups = [_by_speed(driven), _by_speed(drops) + ([("set down", stood)] if stood else [])]
    groups = [group[:_MOST] for group in groups if group]
    if not groups:
        return None
    with styled():
        drawing, axes = sheet(len(groups), max(map(len, groups)), 2.7 * len(groups))
        for row, group in zip(axes, groups, strict=True):
            for axis, (title, runs) in zip(row, group, strict=False):
                axis.set_title(title)
                (_draw_driven if runs[0].kind == "driven" else _draw_motion)(axis, runs)
            for axis in row[len(group) :]:
                axis.set_visible(False)
        handles = [handle("bed", BED, lw=1.0)] if any(r.bed is not None for r in run.runs) else []
        law = handle(f"with {words_of_effects(run.result)}", AMENDED)
        legend_above(drawing, [*handles, handle("spring-damper", MODEL, ls=DASHED), law], 3)
    return drawing


def write_amended_report(folder: str | Path, *, progress: Progress | None = None) -> Path:
    """Make figures/ and report.html of a run without a bed, and return the report."""
    report = Report(folder, progress)
    numbers = report.result["quantities"]
    plot = amended_plot(read_folder(report.folder))
    blocks = [text("There is nothing to draw.")] if plot is None else [report.draw(plot)]
    report.tell(0.8)
    rows = [
        (name.replace("_", " "), quote(entry["value"], entry["std"], entry["unit"]), str(entry.get("note", "")))
        for name, entry in numbers.items()
    ]
    sunk = [quote(numbers[f"sinkage_{law}"]["value"], None, "m") for law in ("spring_damper", "amended")]
    tiles = [
        Tile("Sinks", sunk[0], "spring-damper"),
        Tile("Sinks", sunk[1], f"with {words_of_effects(report.result)}", second=True),
    ]
    sections = [
        Section("", blocks),
        Section("Numbers", [table(("quantity", "value", "note"), rows, words=True)]),
        again("hedgebed penetrate THIS_FOLDER/run.toml", "From where it was started:"),
    ]
    return report.write(sections, lead=["penetrate", "no bed: the model's law only"], tiles=tiles)


def _by_speed(runs: Sequence[Run]) -> list[tuple[str, list[Run]]]:
    speeds = sorted({r.speed for r in runs if r.speed is not None})
    word = {"driven": "driven", "drop": "dropped"}
    return [
        (f"{word[own[0].kind]} at {speed:g} m/s", own)
        for speed in speeds
        if (own := [r for r in runs if r.speed == speed])
    ]


def _draw_driven(axis: Axes, runs: Sequence[Run]) -> None:
    for r in runs:
        if r.bed is not None:
            axis.plot(1e3 * r.bed.depth, r.bed.force, color=BED, lw=0.7, alpha=0.6)
    for series, colour, style in ((runs[0].model, MODEL, DASHED), (runs[0].amended, AMENDED, "-")):
        if series is not None:
            axis.plot(1e3 * series.depth, series.force, color=colour, ls=style, lw=1.8)
    axis.axhline(0.0, color=GREY, lw=0.8)
    axis.set(xlabel="depth of the tip [mm]", ylabel="force on the spike [N]")


def _draw_motion(axis: Axes, runs: Sequence[Run]) -> None:
    beds = [r.bed for r in runs if r.bed is not None]
    others = [(runs[0].model, MODEL, DASHED, 1.8), (runs[0].amended, AMENDED, "-", 1.8)]
    for series, colour, style, width in [*((bed, BED, "-", 0.9) for bed in beds), *others]:
        if series is not None:
            start = _touch(series)
            axis.plot(1e3 * (series.time - start), 1e3 * series.depth, color=colour, ls=style, lw=width)
    axis.axhline(0.0, color=GREY, lw=0.8)
    axis.invert_yaxis()
    axis.set(xlabel="time [ms]", ylabel="depth of the tip [mm]")


def _touch(series: Series) -> float:
    """When it came to depth 0 [s]."""
    inside = np.flatnonzero(series.depth > 0)
    return float(series.time[inside[0]]) if len(inside) else float(series.time[0])
