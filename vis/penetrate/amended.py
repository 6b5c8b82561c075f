"""The law with what it lacked, beside the spring-damper and, where there is one, the bed: a plot, and a page.

The bed is blue and thin, the spring-damper orange and dashed, the amended law green and solid.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from vis.page.folder import Run, RunFolder, Series, read_folder
from vis.page.numbers import quote
from vis.page.page import Page, Section, Tile, code, figure, table, text, write_page
from vis.page.style import BED, GREY, MODEL, styled
from vis.penetrate.plot_parts import Plot

__all__ = ["AMENDED", "TITLE", "amended_plot", "is_amended", "words_of_effects", "write_amended_report"]

AMENDED = "#009E73"
"""The amended law (Okabe and Ito's green)."""
TITLE = "With what was missing"
_CAPTION = (
    "Top: the ground's force while the spike is driven in and pulled out. Below: the depth of drops, and of the spike "
    "that is set down, downwards."
)
_WIDTH = 8.6
_MOST = 4
"""Panels in a row at most."""


def is_amended(run: RunFolder) -> bool:
    """Whether a model's law was run."""
    return any(r.amended is not None for r in run.runs)


def words_of_effects(result: Mapping[str, Any]) -> str:
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
        wide = max(map(len, groups))
        drawing = Figure(figsize=(_WIDTH, 2.7 * len(groups)))
        FigureCanvasAgg(drawing)
        axes = drawing.subplots(len(groups), wide, squeeze=False)
        for row, group in zip(axes, groups, strict=True):
            for axis, (title, runs) in zip(row, group, strict=False):
                axis.set_title(title)
                (_draw_driven if runs[0].kind == "driven" else _draw_motion)(axis, runs)
            for axis in row[len(group) :]:
                axis.set_visible(False)
        handles = [Line2D([], [], color=BED, lw=1.0, label="bed")] if any(r.bed is not None for r in run.runs) else []
        handles += [
            Line2D([], [], color=MODEL, ls=(0, (4, 2)), label="spring-damper"),
            Line2D([], [], color=AMENDED, label=f"with {words_of_effects(run.result)}"),
        ]
        drawing.legend(handles=handles, loc="outside upper left", ncols=3)
    return drawing


def write_amended_report(folder: str | Path, *, progress: Callable[[float], None] | None = None) -> Path:
    """Make figures/ and report.html of a run without a bed, and return the report.

    Raises FileNotFoundError where the folder has no result.json.
    """
    folder = Path(folder)
    result = json.loads((folder / "result.json").read_text(encoding="utf-8"))
    run = read_folder(folder)
    figures = folder / "figures"
    figures.mkdir(exist_ok=True)
    plot = amended_plot(run)
    blocks = [] if plot is None else [figure(plot.save(figures), title=plot.title, caption=plot.caption)]
    if progress is not None:
        progress(0.8)
    return write_page(folder / "report.html", _page(result, blocks))


def _page(result: Mapping[str, Any], blocks: Sequence[Any]) -> Page:
    numbers = result["quantities"]
    words = words_of_effects(result)
    rows = [
        (name.replace("_", " "), quote(entry["value"], entry["std"], entry["unit"]), str(entry.get("note", "")))
        for name, entry in numbers.items()
    ]
    return Page(
        title=str(result["title"]),
        lead=[f"hedgebed {result['version']}", "penetrate", "no bed: the model's law only"],
        tiles=[
            Tile("Sinks", quote(numbers["sinkage_spring_damper"]["value"], None, "m"), "spring-damper"),
            Tile("Sinks", quote(numbers["sinkage_amended"]["value"], None, "m"), f"with {words}", second=True),
        ],
        warnings=[str(warning)[:1].upper() + str(warning)[1:] for warning in result["warnings"]],
        sections=[
            Section("", list(blocks) or [text("There is nothing to draw.")]),
            Section("Numbers", [table(("quantity", "value", "note"), rows, words=True)]),
            Section(
                "To do this again",
                [text("From where it was started:"), code("hedgebed penetrate THIS_FOLDER/run.toml")],
            ),
        ],
    )


def _by_speed(runs: Sequence[Run]) -> list[tuple[str, list[Run]]]:
    speeds = sorted({r.speed for r in runs if r.speed is not None})
    word = {"driven": "driven", "drop": "dropped"}
    return [(f"{word[own[0].kind]} at {speed:g} m/s", own) for speed in speeds
            if (own := [r for r in runs if r.speed == speed])]  # fmt: skip


def _draw_driven(axis: Axes, runs: Sequence[Run]) -> None:
    for r in runs:
        if r.bed is not None:
            axis.plot(1e3 * r.bed.depth, r.bed.force, color=BED, lw=0.7, alpha=0.6)
    for series, colour, style in ((runs[0].model, MODEL, (0, (4, 2))), (runs[0].amended, AMENDED, "-")):
        if series is not None:
            axis.plot(1e3 * series.depth, series.force, color=colour, ls=style, lw=1.8)
    axis.axhline(0.0, color=GREY, lw=0.8)
    axis.set_xlabel("depth of the tip [mm]")
    axis.set_ylabel("force on the spike [N]")


def _draw_motion(axis: Axes, runs: Sequence[Run]) -> None:
    beds = [r.bed for r in runs if r.bed is not None]
    others = [(runs[0].model, MODEL, (0, (4, 2)), 1.8), (runs[0].amended, AMENDED, "-", 1.8)]
    for series, colour, style, width in [*((bed, BED, "-", 0.9) for bed in beds), *others]:
        if series is not None:
            start = _touch(series)
            axis.plot(1e3 * (series.time - start), 1e3 * series.depth, color=colour, ls=style, lw=width)
    axis.axhline(0.0, color=GREY, lw=0.8)
    axis.invert_yaxis()
    axis.set_xlabel("time [ms]")
    axis.set_ylabel("depth of the tip [mm]")


def _touch(series: Series) -> float:
    """When it came to depth 0 [s]."""
    inside = np.flatnonzero(series.depth > 0)
    return float(series.time[inside[0]]) if len(inside) else float(series.time[0])
