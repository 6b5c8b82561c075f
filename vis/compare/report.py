"""The report of two runs side by side: reads the comparison's folder, and for pictures those of the runs."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from vis.compare import figures as compare_figures
from vis.compare import spatial as compare_spatial
from vis.compare.figures import legend
from vis.page.folder import read_folder
from vis.page.numbers import short
from vis.page.page import Block, Page, Section, Tile, code, figure, listing, table, text, write_page
from vis.page.style import styled
from vis.tumble.pictures import draw_reels, moments
from vis.tumble.reel import Reel
from vis.tumble.state_figures import LINES, sheet

__all__ = ["write_compare_report"]

Array = NDArray[np.float64]
_DPI = 130


def write_compare_report(folder: str | Path, *, progress: Callable[[float], None] | None = None) -> Path:
    """Make figures/ and report.html (of tumbles also stills and film.gif) of a comparison, and return the report.

    Raises FileNotFoundError where the folder has no result.json, or a run is gone whose pictures are asked for.
    """
    tell = progress if progress is not None else lambda done: None
    home = Path(folder)
    result = json.loads((home / "result.json").read_text(encoding="utf-8"))
    labels = (result["runs"][0]["label"], result["runs"][1]["label"])
    (home / "figures").mkdir(exist_ok=True)
    sections: list[Section] = []
    if result["kind"] != "penetrate":
        columns, states = _columns(home / result["series"])
        in_space = result["kind"] == "tumble spatial"
        plans = (compare_spatial if in_space else compare_figures).plans(result, columns, states, labels)
        drawn = [_drawn(home, *plan) for plan in plans]
        tell(0.3)
        see = compare_spatial.side_by_side if in_space else _side_by_side
        seen = see(home, result, labels, lambda done: tell(0.3 + 0.65 * done)) if result["pictures"] else []
        sections = [
            Section("", [listing(result["departures"]["sentences"]), *drawn[:-4]]),
            *([Section("Seen side by side", seen)] if seen else []),
            Section("States and angle", drawn[-4:-3]),
            Section("Into the ground", [*drawn[-3:-1], *_row_sinkage(result, labels)]),
            Section("Energy", drawn[-1:]),
        ]
    else:
        sections = [Section("", _drives(home, result, labels))]
    page = Page(
        title=f"Compared: {result['title']}",
        lead=[
            f"hedgebed {result['version']}",
            "compare",
            *(f"{run['label']}: {run['title']}" for run in result["runs"]),
        ],
        tiles=_tiles(result),
        warnings=[str(warning)[:1].upper() + str(warning)[1:] for warning in result["warnings"]],
        sections=[
            *sections,
            Section("Every number, side by side", _numbers(result, labels)),
            *([Section("What the two were given", [_given(result, labels)])] if result["differs"] else []),
            Section("To do this again", [text("In this folder:"), code("hedgebed compare run.toml")]),
        ],
    )
    report = write_page(home / "report.html", page)
    tell(1.0)
    return report


def _columns(path: Path) -> tuple[dict[str, Array], tuple[NDArray[np.str_], NDArray[np.str_]]]:
    """The columns of compared.csv, and the states of both."""
    head, *rows = [line.split(",") for line in path.read_text(encoding="utf-8").splitlines()]
    by_name = dict(zip(head, zip(*rows, strict=True), strict=True))
    numbers = {name: np.array(values, dtype=float) for name, values in by_name.items() if not name.startswith("state_")}
    return numbers, (np.array(by_name["state_1"]), np.array(by_name["state_2"]))


def _drawn(home: Path, name: str, title: str, caption: str, drawing: Figure) -> Block:
    path = home / "figures" / f"{name}.png"
    with styled():
        drawing.savefig(path, dpi=_DPI)
    return figure(path, title=title, caption=caption)


def _side_by_side(
    home: Path, result: Mapping[str, Any], labels: tuple[str, str], tell: Callable[[float], None]
) -> list[Block]:
    """Stills of both at the same moments, and the film."""
    folders = [(home / run["folder"]).resolve() for run in result["runs"]]
    reels = _alike([Reel.open(folder) for folder in folders])
    stills = [
        (home / "figures" / f"seen-{name}.png", f"Both {words}", time,
         "; ".join(f"{label}: {reel.line(reel.nearest(time))}" for label, reel in zip(labels, reels, strict=True)))
        for name, words, time in moments(reels)
    ]  # fmt: skip
    drawn = draw_reels(reels, stills, home / "film.gif", by=result["colour"], labels=labels, progress=tell)
    blocks = [figure(each.file, title=each.title, caption=each.caption) for each in drawn.stills[1:]]
    if drawn.animation is not None:
        shown = drawn.animation
        blocks.insert(0, figure(shown.file, title=shown.title, caption=shown.caption, show_file=True))
    return [*blocks, *(text(note, small=True) for note in drawn.notes)]


def _alike(reels: list[Reel]) -> list[Reel]:
    """A law knows points only: beside a run on grains of spikes as long its platform is drawn with that one's."""
    known = [reel for reel in reels if reel.frames is not None]
    return [
        replace(reel, like=known[0].spikes)
        if reel.frames is None and known and known[0].number("spike_length") == reel.number("spike_length")
        else reel
        for reel in reels
    ]


# Penetrations ---------------------------------------------------------------------------------------------------------


def _drives(home: Path, result: Mapping[str, Any], labels: tuple[str, str]) -> list[Block]:
    """Force against depth of the drives that both have."""
    runs = [{run.id: run for run in read_folder(home / one["folder"]).of_kind("driven")} for one in result["runs"]]
    shared = [name for name in runs[0] if name in runs[1]]
    if not shared:
        return [text("The two have no drive of the same name: their numbers are compared below.")]
    with styled():
        drawing, (axes,) = sheet(1, min(3, len(shared)), 3.2, sharey=True)
        for axis, name in zip(axes, shared, strict=False):
            for each, style in zip(runs, LINES, strict=True):
                run = each[name]
                series = run.bed if run.bed is not None else run.model
                if series is not None:
                    axis.plot(1e3 * series.depth, series.force, **style)
            axis.set_title(name)
            axis.set_xlabel("depth [mm]")
        axes[0].set_ylabel("force on the spike [N]")
        legend(drawing, labels)
    caption = "The same drives in both: force against depth, in and out."
    return [_drawn(home, "drives", "Drag against depth", caption, drawing)]


# Tables ---------------------------------------------------------------------------------------------------------------


def _tiles(result: Mapping[str, Any]) -> list[Tile]:
    wanted = (
        ("trajectory_angle", "Trajectory angle"), ("max_speed", "Largest speed"), ("largest_turn", "Largest turn"),
        ("sinkage_largest", "Deepest"), ("sinkage", "Sinkage"), ("stiffness", "Stiffness"),
        ("energy_residual", "Energy residual"),
    )  # fmt: skip
    rows = {row["name"]: row for row in result["compared"]}
    end = result.get("compared_over")
    words = "first | second" if end is None else f"first | second, over {end:.3g} s"
    tiles = []
    for name, label in wanted:
        row = rows.get(name)
        if row is None or row["first"] is None or row["second"] is None:
            continue
        values = [_said(row[key], row["unit"]) for key in ("first", "second")]
        tiles.append(Tile(label, f"{values[0]} | {values[1]}", words))
    return tiles[:5]


def _said(value: float, unit: str) -> str:
    if unit == "rad":
        return f"{short(math.degrees(value), 3)}°"
    if unit == "m" and abs(value) < 0.1:
        return f"{short(1e3 * value, 3)} mm"
    return f"{short(value, 3)}{'' if unit == '1' else ' ' + unit}"


def _numbers(result: Mapping[str, Any], labels: tuple[str, str]) -> list[Block]:
    """One table; where one run lasts longer, of the time that both last, and of each as a whole."""
    head = ("quantity", *labels, "difference", "of the first", "unit")
    rows, end = result["compared"], result.get("compared_over")
    if end is None:
        return [table(head, [_row(row) for row in rows])]
    lasts = " and ".join(f"{time:.4g}" for time in result["lasts"])
    shared = [row for row in rows if row["over"] == "shared time"]
    whole = [_row(row | {"first": row["first_whole"], "second": row["second_whole"]}) for row in rows]
    return [
        table(head, [_row(row) for row in shared], title=f"Over the first {end:.4g} s, which both last"),
        table(
            ("quantity", *labels, "unit"), [(*row[:3], row[-1]) for row in whole],
            title=f"Of each run as a whole, over its own {lasts} s",
        ),
    ]  # fmt: skip


def _row(row: Mapping[str, Any]) -> tuple[str, ...]:
    in_degrees = row["unit"] == "rad"
    scale, unit = (180 / math.pi, "°") if in_degrees else (1.0, "" if row["unit"] == "1" else row["unit"])
    cells = ["–" if row[key] is None else f"{scale * row[key]:.5g}" for key in ("first", "second")]
    difference = "–" if row["difference"] is None else f"{scale * row['difference']:+.4g}"
    share = "–" if row["relative"] is None else f"{100 * row['relative']:+.3g} %"
    return (row["name"], *cells, difference, share, unit)


def _row_sinkage(result: Mapping[str, Any], labels: tuple[str, str]) -> list[Block]:
    """The deepest point of each row, of tumbles in the plane."""
    rows = [
        (str(row["row"]), *(f"{1e3 * row[key]:.3g}" for key in ("first", "second"))) for row in result.get("rows", [])
    ]
    title = "Sinkage of each row while both last, deepest [mm]"
    return [table(("row", *labels), rows, title=title)] if rows else []


def _given(result: Mapping[str, Any], labels: tuple[str, str]) -> Block:
    rows = [(row["key"], row["first"], row["second"], row["unit"]) for row in result["differs"]]
    return table(("key", *labels, "unit"), rows, words=True)
