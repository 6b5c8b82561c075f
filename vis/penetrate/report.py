"""The report of a spike in a bed, and that of a run on a model's law without a bed.

In every plot the bed is blue, the spring-damper orange and dashed, the law with added effects green. Depth is in mm,
positive downwards. `templates/report.html` is the page; its content is from `vis.penetrate.summary`.
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from rigid.intervals import half_of
from vis.page.answer import answer
from vis.page.folder import Run, RunFolder, Series, from_python, read_folder
from vis.page.limits import limits_words
from vis.page.numbers import fitted, quote
from vis.page.page import Block, Section, Tile, figure, table, text, write_template
from vis.page.plots import AMENDED, BED, DASHED, GREY, MODEL, handle, legend_above, sheet, styled, title_above
from vis.page.report import Progress, Report, again, report_of, title_of
from vis.penetrate.answer import answer_tiles, words_of_effects
from vis.penetrate.errors import error_words
from vis.penetrate.plot_drag import Plot, drag_plot, gap_plot, work_plot
from vis.penetrate.plot_drops import drop_peaks_plot, drops_plot, set_down_plot, spread_plot
from vis.penetrate.summary import summarise
from vis.penetrate.summary_parts import as_foot, mapping_of, say
from vis.pictures.pictures import Picture, Pictures, make_pictures
from vis.view.page import report_scene

__all__ = ["PLOTS", "draw_amended", "make_plots", "words_of_effects", "write_penetration_report"]

_BEYOND = 1.02
"""Factor beyond the deepest reading of a fit from which on a picture marks where its data end."""
_MOST = 4
"""Panels in a row at most."""
#: Plot -> the kind of run it is of.
_FIRST = 1.0
"""Time after the first touch of drops and set-downs that the figure of a law shows [s]."""
_NEEDS = {"Drag against depth": "driven", "Work in and out": "driven", "Set down under its load": "set_down"}
_NEEDS |= {"Drops": "drop", "Peaks of the drops": "drop"}
#: What is drawn of every run, in the report's order: name in words -> function; None where there is no data.
PLOTS: dict[str, Callable[[RunFolder], Plot | None]] = {
    "Drag against depth": drag_plot,
    "Where the spring-damper departs": gap_plot,
    "Set down under its load": set_down_plot,
    "Drops": drops_plot,
    "Peaks of the drops": drop_peaks_plot,
    "Work in and out": work_plot,
    "Spread between beds": spread_plot,
}


def write_penetration_report(folder: str | Path, *, pictures: bool = True, progress: Progress | None = None) -> Path:
    """Make every plot and picture of the run folder, and its report.html; parameters as those of `vis.write_report`."""
    tell = progress if progress is not None else lambda done: None
    run = read_folder(folder)
    if run.result.get("ground", "bed") != "bed" and (_is_amended(run) or "ground_file" in run.result):
        return _write_law_report(folder, progress=progress)
    plots, undrawn = make_plots(run)
    tell(0.1)
    drawn = Pictures(notes=["No pictures were requested."])
    if pictures:
        try:
            drawn = make_pictures(run.path, progress=lambda done: tell(0.1 + 0.85 * done))
        except (ValueError, KeyError, IndexError, OSError) as error:
            drawn = Pictures(notes=[f"Pictures could not be drawn ({type(error).__name__}: {error})."])
    context = summarise(run)
    context["answer"] = answer([Tile(**tile) for tile in context.pop("tiles")], run.result)
    context["missing"] = [*context["missing"], *(text for text in undrawn if _asked_for(run, text))]
    named = as_foot if context["body"] == "foot" else str
    context["plots"] = {
        plot.name: figure(path, title=named(plot.title), caption=named(plot.caption)) for plot, path in plots
    }
    context["scenes"] = report_scene(run.path) if pictures else []
    context["pictures"] = [_picture(picture) for picture in drawn.stills if picture.file.exists()]
    context["animation"] = _picture(drawn.animation) if drawn.animation and drawn.animation.file.exists() else None
    context |= {"method": drawn.method, "picture_notes": drawn.notes, "limits": limits_words(run.result)}
    report = write_template(run.path / "report.html", "report.html", **context)
    tell(1.0)
    return report


def _asked_for(run: RunFolder, undrawn: str) -> bool:
    """Whether what could not be drawn for want of data was part of this run at all."""
    what, _, why = undrawn.partition(": ")
    if why != "no data." or not run.runs:
        return True
    return not from_python(run) and (what not in _NEEDS or bool(run.of_kind(_NEEDS[what])))


def _picture(picture: Picture) -> Block:
    """The picture for the page, small; stills stay in the folder as PNG."""
    return figure(picture.file, title=picture.title, caption=picture.caption, show_file=True, small=True)


def make_plots(run: RunFolder, folder: str | Path | None = None) -> tuple[list[tuple[Plot, Path]], list[str]]:
    """Draw and write every plot the folder has data for.

    ``run``: The run folder. ``folder``: Where the PNGs go; by default the run's `figures/`. Returns the plots with
    their files, and a sentence on each that could not be drawn.
    """
    target = Path(folder) if folder is not None else run.path / "figures"
    target.mkdir(parents=True, exist_ok=True)
    drawn: list[tuple[Plot, Path]] = []
    missing: list[str] = []
    plans = PLOTS | ({"With what was missing": _amended_plot} if _is_amended(run) else {})
    with styled():
        for what, draw in plans.items():
            try:
                plot = draw(run)
            except (ValueError, TypeError, KeyError, IndexError, ZeroDivisionError, FloatingPointError) as error:
                missing.append(f"{what}: could not be drawn ({type(error).__name__}: {error}).")
                continue
            if plot is None:
                missing.append(f"{what}: no data.")
            else:
                if tip_of(run) == "flat":
                    _label_as_foot(plot.figure)
                title_above(plot.figure, title_of(run.result))
                drawn.append((plot, plot.save(target)))
    return drawn, missing


def tip_of(run: RunFolder) -> str:
    """Kind of the tip; empty where it is not known."""
    return str(mapping_of(run.result.get("spike")).get("tip") or "")


def _label_as_foot(drawing: Figure) -> None:
    """Name a foot on the axes."""
    for axis in drawing.axes:
        axis.set(xlabel=as_foot(axis.get_xlabel()), ylabel=as_foot(axis.get_ylabel()))


# With effects that the spring-damper omits ----------------------------------------------------------------------------


def _is_amended(run: RunFolder) -> bool:
    return any(r.amended is not None for r in run.runs)


def _amended_plot(run: RunFolder) -> Plot | None:
    drawing = draw_amended(run)
    return None if drawing is None else Plot.of("amended", drawing, shown=_shown(run))


def _on_law(run: RunFolder) -> tuple[list[Run], list[Run], list[Run]]:
    """Pushes, drops and set-downs of which there is a motion on the law."""
    alone = "ground_file" in run.result
    driven, drops, stood = (
        [r for r in run.of_kind(kind) if r.amended is not None or alone] for kind in ("driven", "drop", "set_down")
    )
    return driven, drops, stood


def _shown(run: RunFolder) -> str:
    """What the rows of `draw_amended` show."""
    driven, drops, stood = _on_law(run)
    if driven and (drops or stood):
        return say("shown_both")
    return say("shown_pushes" if driven else "shown_falls")


def draw_amended(run: RunFolder, *, base: str = MODEL) -> Figure | None:
    """Force against depth of driven runs, depth against time of drops and set-downs; None where there is no law.

    `base`: colour of the law without effects."""
    alone = "ground_file" in run.result
    driven, drops, stood = _on_law(run)
    groups = [_by_speed(driven), _by_speed(drops) + ([("set down", stood)] if stood else [])]
    groups = [group[:_MOST] for group in groups if group]
    if not groups:
        return None
    drawing, axes = sheet(len(groups), max(map(len, groups)), 2.7 * len(groups))
    deepest, marked = (None, []) if alone else (_fitted_depth(run), list[Any]())
    for row, group in zip(axes, groups, strict=True):
        for axis, (title, runs) in zip(row, group, strict=False):
            axis.set_title(title)
            _draw_panel(axis, runs, base)
            if not alone and runs[0].kind == "driven":
                marked += _draw_peak(axis, runs[0], run.result["quantities"], deepest)
            if axis is not row[0]:
                axis.set_ylabel("")
        for axis in row[len(group) :]:
            axis.set_visible(False)
    handles = [handle("bed", BED, lw=1.0)] if any(r.bed is not None for r in run.runs) else []
    laws = [handle(str(run.result["ground"]) if alone else "spring-damper", base, ls=DASHED)]
    laws += [] if alone else [handle(f"with {words_of_effects(run.result)}", AMENDED)]
    named = {str(mark.get_label()): mark for mark in marked}
    legend_above(drawing, [*handles, *laws, *named.values()], 3)
    return drawing


def _fitted_depth(run: RunFolder) -> float | None:
    """The deepest reading that the model was fitted to [m], from the run's copy of it; None where it has none."""
    path = run.path / "model.toml"
    notes = tomllib.loads(path.read_text(encoding="utf-8")).get("notes", {}) if path.exists() else {}
    found = mapping_of(notes.get("fitted_range")).get("depth_m")
    return float(found) if isinstance(found, int | float) else None


def _draw_peak(axis: Axes, run: Run, numbers: Mapping[str, Any], deepest: float | None) -> list[Any]:
    """The predicted peak force of a push with its number and 95 % interval, and the depth where the data of the fit
    end; what a legend shows of both."""
    law, shown = run.amended, list[Any]()
    if law is None:
        return shown
    entry = numbers.get(f"peak_force_amended@{run.speed:g}", numbers.get("peak_force_amended"))
    if entry is not None and entry["value"] is not None:
        place = 1e3 * float(law.depth[int(np.argmax(law.force))])
        value, half = float(entry["value"]), half_of(entry)
        label = "peak force, 95 % interval" if half else "peak force"
        bar = axis.errorbar(place, value, yerr=half or None, fmt="o", color=AMENDED, capsize=4, ms=4, zorder=5)
        bar.set_label(label)
        shown.append(bar)
        axis.annotate(
            quote(value, half, "N"), (place, value), xytext=(-8, 2), textcoords="offset points", ha="right", fontsize=8
        )
    if deepest is not None and float(law.depth.max()) > _BEYOND * deepest:
        axis.set_xlim(axis.get_xlim())
        axis.axvspan(1e3 * deepest, axis.get_xlim()[1], color="#eeeeee", lw=0, zorder=0)
        shown.append(Patch(color="#dddddd", label="deeper than the data of the fit"))
    return shown


@report_of(named=True)
def _write_law_report(report: Report) -> Path:
    """Make figures/ and report.html of a run without a bed, and return the report."""
    run = read_folder(report.folder)
    numbers, drawing = report.result["quantities"], draw_amended(run)
    of_file = "ground_file" in report.result
    key = "law" if of_file else "amended"
    blocks = [text("There is nothing to draw.")] if drawing is None else [report.draw(key, drawing, shown=_shown(run))]
    rows = [(name.replace("_", " "), fitted(entry), str(entry.get("note", ""))) for name, entry in numbers.items()]
    head = say("value_in_95")
    meant = [] if of_file else [text(error_words(report.result), small=True)]
    whose = f"no bed: the law of {'a ground file' if of_file else 'the model'} only"
    sections = [
        Section("", blocks),
        Section("Numbers", [table(("quantity", head, "note"), rows, words=True), *meant]),
        again("hedgebed penetrate THIS_FOLDER/run.toml", "From where it was started:"),
    ]
    return report.write(sections, lead=["penetrate", whose], tiles=answer_tiles(report.result))


def _by_speed(runs: Sequence[Run]) -> list[tuple[str, list[Run]]]:
    speeds = sorted({r.speed for r in runs if r.speed is not None})
    word = {"driven": "driven", "drop": "dropped"}
    return [
        (f"{word[own[0].kind]} at {speed:g} m/s", own)
        for speed in speeds
        if (own := [r for r in runs if r.speed == speed])
    ]


def _draw_panel(axis: Axes, runs: Sequence[Run], base: str) -> None:
    """Force against depth of driven runs; of the others depth against the time since they came to depth 0."""
    driven = runs[0].kind == "driven"
    bed: Mapping[str, Any] = {"color": BED, "lw": 0.7, "alpha": 0.6} if driven else {"color": BED, "lw": 0.9}
    lines: list[tuple[Series | None, Mapping[str, Any]]] = [(r.bed, bed) for r in runs]
    lines.append((runs[0].model, {"color": base, "ls": DASHED, "lw": 1.8, "zorder": 3}))  # seen on the other law
    lines.append((runs[0].amended, {"color": AMENDED, "lw": 1.8}))
    for series, style in lines:
        if series is None:
            continue
        across, up = 1e3 * series.depth, series.force
        if not driven:
            inside = np.flatnonzero(series.depth > 0)
            start = float(series.time[inside[0]]) if len(inside) else float(series.time[0])
            shown = series.time <= start + _FIRST  # later bounces are too close to be told apart
            across, up = 1e3 * (series.time[shown] - start), 1e3 * series.depth[shown]
        axis.plot(across, up, **style)
    axis.axhline(0.0, color=GREY, lw=0.8)
    if driven:
        axis.set(xlabel="depth of the tip [mm]", ylabel="force of the ground [N]")
    else:
        axis.invert_yaxis()
        axis.set(xlabel="time [ms]", ylabel="depth of the tip [mm]")
