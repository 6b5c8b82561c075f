from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from vis.compare.figures import plots
from vis.film.film import ARROWS, draw_in_space, shown
from vis.film.reel import NAME, Reel
from vis.page.folder import read_folder
from vis.page.numbers import short
from vis.page.page import Block, Section, Tile, listing, table, text
from vis.page.plots import Array, Plot, sheet
from vis.page.report import Progress, Report, Result, again, unit_text
from vis.page.sentences import Sentences
from vis.page.states import LINES, States, legend_of_runs
from vis.page.style import styled
from vis.pictures.frames import frame_names
from vis.tumble.pictures import draw_tumbles, moments

__all__ = ["write_compare_report"]

captions = Sentences(__package__, "figures.toml")
Labels = tuple[str, str]


def write_compare_report(folder: str | Path, *, progress: Progress | None = None) -> Path:
    """Make figures/ and report.html (of tumbles also stills and film.gif) of a comparison, and return the report.

    Raises FileNotFoundError where the folder has no result.json, or a run is gone whose pictures are asked for.
    """
    report = Report(folder, progress, dpi=130)
    result = report.result
    labels = (result["runs"][0]["label"], result["runs"][1]["label"])
    penetrations = result["kind"] == "penetrate"
    differs = [Section("What the two were given", [_given(result, labels)])] if result["differs"] else []
    sections = [
        *([Section("", _drives(report, labels))] if penetrations else _tumbles(report, labels)),
        Section("Every number, side by side", _numbers(result, labels)),
        *differs,
        again("hedgebed compare run.toml"),
    ]
    lead = ["compare", *(f"{run['label']}: {run['title']}" for run in result["runs"])]
    return report.write(sections, lead=lead, tiles=_tiles(result), title=f"Compared: {result['title']}")


def _tumbles(report: Report, labels: Labels) -> list[Section]:
    """Figures and pictures of two tumbles."""
    result, in_space = report.result, report.result["kind"] == "tumble spatial"
    path, states, *ground, energy = report.draw_all(plots(result, *_columns(report.folder / result["series"]), labels))
    report.tell(0.3)

    def tell(done: float) -> None:
        report.tell(0.3 + 0.65 * done)

    seen = (_seen_in_space if in_space else _seen)(report, labels, tell) if result["pictures"] else []
    return [
        Section("", [listing(result["departures"]["sentences"]), path]),
        *([Section("Seen side by side", seen)] if seen else []),
        Section("States and angle", [states]),
        Section("Into the ground", [*ground, *_row_sinkage(result, labels)]),
        Section("Energy", [energy]),
    ]


def _columns(path: Path) -> tuple[dict[str, Array], tuple[States, States]]:
    """The columns of compared.csv, and the states of both."""
    head, *rows = [line.split(",") for line in path.read_text(encoding="utf-8").splitlines()]
    by_name = dict(zip(head, zip(*rows, strict=True), strict=True))
    numbers = {name: np.array(values, dtype=float) for name, values in by_name.items() if not name.startswith("state_")}
    return numbers, (np.array(by_name["state_1"]), np.array(by_name["state_2"]))


def _folders(report: Report) -> list[Path]:
    return [(report.folder / run["folder"]).resolve() for run in report.result["runs"]]


def _seen(report: Report, labels: Labels, tell: Progress) -> list[Block]:
    """Stills of both at the same moments, and the film."""
    reels = _alike([Reel.open(folder) for folder in _folders(report)])
    stills = [
        (report.figures / f"seen-{name}.png", f"Both {words}", time,
         "; ".join(f"{one}: {reel.line(reel.nearest(time))}" for one, reel in zip(labels, reels, strict=True)) + ".")
        for name, words, time in moments(reels)
    ]  # fmt: skip
    film, by = report.folder / "film.gif", report.result["colour"]
    drawn = draw_tumbles(reels, stills, film, by=by, labels=labels, progress=tell)
    return [*shown(drawn, first=1), *(text(note, small=True) for note in drawn.notes)]


def _seen_in_space(report: Report, labels: Labels, tell: Progress) -> list[Block]:
    """The same in space; where both have frames."""
    folders = _folders(report)
    without = [label for label, folder in zip(labels, folders, strict=True) if NAME not in frame_names(folder)]
    if without:
        return [text(f"There are no pictures: {' and '.join(without)} kept no frames (frame_count = 0).", small=True)]
    by = report.result["colour"]
    drawn = draw_in_space(folders, report.folder, stem="seen", by=by, film=True, labels=labels, progress=tell)
    return [*shown(drawn), *(text(note, small=True) for note in (ARROWS, *drawn.notes))]


def _alike(reels: Sequence[Reel]) -> list[Reel]:
    """A law knows points only: beside a run on grains of spikes as long its platform is drawn with that one's."""
    known = [reel for reel in reels if reel.frames is not None]
    return [
        replace(reel, like=known[0].spikes)
        if reel.frames is None and known and known[0].number("spike_length") == reel.number("spike_length")
        else reel
        for reel in reels
    ]


def _drives(report: Report, labels: Labels) -> list[Block]:
    """Force against depth of the drives that both have."""
    runs = [{run.id: run for run in read_folder(home).of_kind("driven")} for home in _folders(report)]
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
            axis.set(title=name, xlabel="depth [mm]")
        axes[0].set_ylabel("force on the spike [N]")
        legend_of_runs(drawing, labels)
    return [report.draw(Plot.said(captions, "drives", drawing))]


def _tiles(result: Result) -> list[Tile]:
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


def _numbers(result: Result, labels: Labels) -> list[Block]:
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
            ("quantity", *labels, "unit"),
            [(*row[:3], row[-1]) for row in whole],
            title=f"Of each run as a whole, over its own {lasts} s",
        ),
    ]


def _row(row: Result) -> tuple[str, ...]:
    scale, unit = (180 / math.pi, "°") if row["unit"] == "rad" else (1.0, unit_text(row["unit"]))
    cells = ["–" if row[key] is None else f"{scale * row[key]:.5g}" for key in ("first", "second")]
    difference = "–" if row["difference"] is None else f"{scale * row['difference']:+.4g}"
    share = "–" if row["relative"] is None else f"{100 * row['relative']:+.3g} %"
    return (row["name"], *cells, difference, share, unit)


def _row_sinkage(result: Result, labels: Labels) -> list[Block]:
    """The deepest point of each row, of tumbles in the plane."""
    rows = [
        (str(row["row"]), *(f"{1e3 * row[key]:.3g}" for key in ("first", "second"))) for row in result.get("rows", [])
    ]
    title = "Sinkage of each row while both last, deepest [mm]"
    return [table(("row", *labels), rows, title=title)] if rows else []


def _given(result: Result, labels: Labels) -> Block:
    rows = [(row["key"], row["first"], row["second"], row["unit"]) for row in result["differs"]]
    return table(("key", *labels, "unit"), rows, words=True)
