"""The page of `hedgebed validate`: reads result.json and series/ of its run folder."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable, Mapping, Sequence
from itertools import cycle
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from vis.page.page import Block, Page, Section, Tile, figure, listing, table, text, write_page
from vis.page.style import GREY, styled

__all__ = ["write_validation_report"]

_WIDTH, _HEIGHT, _DPI = 5.6, 3.6, 110
_COLOURS = ("#0072B2", "#E69F00", "#CC79A7", "#009E73", "#D55E00", "#56B4E9", "#8a8a8a", "#222222", "#8C564B")
_HEAD = ("wanted", "ours", "difference", "band", "")
#: Entries of a legend that find room in the plot; more stand beneath it, in three columns up to so many characters.
_INSIDE, _THREE_COLUMNS = 4, 24
_LEGEND_ROW = 0.16


def write_validation_report(folder: str | Path, *, progress: Callable[[float], None] | None = None) -> Path:
    """Make figures/ and report.html of the folder, and return the report.

    Raises FileNotFoundError where the folder has no result.json or a series is missing.
    """
    tell = progress if progress is not None else lambda done: None
    folder = Path(folder)
    result = json.loads((folder / "result.json").read_text(encoding="utf-8"))
    (folder / "figures").mkdir(exist_ok=True)
    cases, blocks = result["cases"], {}
    for done, case in enumerate(cases, 1):
        blocks[case["id"]] = [_draw(folder, case, plot, k) for k, plot in enumerate(case.get("plots", ()), 1)]
        tell(done / len(cases))
    return write_page(folder / "report.html", _page(result, blocks))


def _draw(folder: Path, case: Mapping[str, Any], plot: Mapping[str, Any], number: int) -> Block:
    """One plot: references as lines, what the bed did as dots."""
    curves: dict[str, list[tuple[float, float]]] = {}
    with (folder / plot["series"]).open(encoding="utf-8", newline="") as file:
        for row in csv.DictReader(file):
            curves.setdefault(row["curve"], []).append((float(row["x"]), float(row["y"])))
    path = folder / "figures" / f"{case['id']}-{number}.png"
    beneath = len(curves) > _INSIDE
    across = 3 if max(map(len, curves)) <= _THREE_COLUMNS else 2
    below = _LEGEND_ROW * -(-len(curves) // across) if beneath else 0.0
    with styled():
        drawing = Figure(figsize=(_WIDTH, _HEIGHT + below))
        FigureCanvasAgg(drawing)
        axis = drawing.subplots()
        colours = cycle(_COLOURS)
        lines = plot["lines"]
        for label, points in curves.items():
            x, y = np.array(points).T
            colour = GREY if label in lines and len(lines) == 1 else next(colours)
            axis.plot(x, y, "-" if label in lines else "o", color=colour, ms=3.5, lw=1.6, label=label)
        axis.set_xlabel(plot["x"])
        axis.set_ylabel(plot["y"])
        if "x" in plot["log"]:
            axis.set_xscale("log")
        if "y" in plot["log"]:
            axis.set_yscale("log")
        if beneath:
            drawing.legend(fontsize=7, loc="outside lower center", ncols=across)
        else:
            axis.legend(fontsize=7)
        drawing.savefig(path, dpi=_DPI)
    caption = "Lines: the reference; dots: the bed." if plot["lines"] else "Dots: the bed."
    return figure(path, title=plot["title"], caption=caption, half=True)


def _number(value: float | None) -> str:
    return "–" if value is None else f"{value:.5g}"


def _cells(row: Mapping[str, Any]) -> tuple[str, ...]:
    """Wanted, ours, difference, band, verdict of one comparison."""
    unit = "" if row["unit"] == "1" else f" {row['unit']}"
    if row["difference"] is None:
        gap = "not a number"
    elif row["relative"]:
        gap = f"{100 * row['difference'] / abs(row['reference']):+.2g} %"
    else:
        gap = f"{row['difference']:+.2g}"
    band = f"±{100 * row['band']:.2g} %" if row["relative"] else f"±{row['band']:.2g}"
    return _number(row["reference"]) + unit, _number(row["ours"]) + unit, gap, band, "pass" if row["passes"] else "FAIL"


def _page(result: Mapping[str, Any], blocks: Mapping[str, Sequence[Block]]) -> Page:
    cases = result["cases"]
    run = [case for case in cases if case["status"] in ("pass", "fail")]
    numbers = [one for case in run for one in case["comparisons"]]
    tiles = [
        Tile("cases that pass", str(sum(case["status"] == "pass" for case in run)), f"of {len(run)} that were run"),
        Tile(
            "cases that fail",
            str(sum(case["status"] == "fail" for case in run)),
            "each with what is known why",
            second=True,
        ),
        Tile("numbers compared", str(len(numbers)), f"{sum(one['passes'] for one in numbers)} within their bands"),
        Tile("not yet", str(sum(case["status"] == "not yet" for case in cases)), "cases that the bed cannot run"),
    ]
    sections = [_overview(run)]
    if failing := [case for case in run if case["status"] == "fail"]:
        said = [f"{case['id']}: {case['reason'] or 'not looked into yet'}." for case in failing]
        sections.append(Section("What fails, and why", [listing(said)]))
    for family in dict.fromkeys(case["family"] for case in run):
        sections.append(
            Section(family, [block for case in run if case["family"] == family for block in _case(case, blocks)])
        )
    return Page(
        title="Verification of the bed",
        lead=[
            result["title"].partition(": ")[2],
            result["date"],
            f"version {result['version']}, code {result['code']}",
        ],
        sections=sections,
        tiles=tiles,
        warnings=result["warnings"],
        missing=_absent(cases),
    )


def _overview(run: Sequence[Mapping[str, Any]]) -> Section:
    rows = []
    for case in run:
        worst = case["worst"]
        cells = _cells(worst)[:-1] if worst else ("–",) * 4
        wanted = f"{case['reference']} ({case['source']})"
        verdict = "pass" if case["status"] == "pass" else "FAIL"
        rows.append((f"{case['id']}: {case['title']}", *cells, verdict, wanted))
    lead = "A row shows the number of its case that takes the largest share of its band; all numbers follow below."
    head = ("case", *_HEAD, "closed form or figure (source)")
    return Section("Every case", [text(lead), table(head, rows)])


def _case(case: Mapping[str, Any], blocks: Mapping[str, Sequence[Block]]) -> list[Block]:
    found = [text(f"{case['id']}: {case['title']}. {case['reference']} ({case['source']})."), *blocks[case["id"]]]
    if case["comparisons"]:
        rows = [(one["quantity"], *_cells(one)) for one in case["comparisons"]]
        found.append(table(("number", *_HEAD), rows))
    found += [text(remark, small=True) for remark in case["remarks"]]
    return found


def _absent(cases: Sequence[Mapping[str, Any]]) -> list[str]:
    """What is not in the report: each case that could not be run, and in one sentence those that were left out."""
    said, left = [], []
    for case in cases:
        why = case.get("waits_for") or case.get("skipped")
        if why:
            said.append(f"{case['id']} ({case['title']}): {case['status']}, {why}")
        elif case["status"] not in ("pass", "fail"):
            left.append(case["id"])
    return [*said, f"left out of this run: {', '.join(left)}"] if left else said
