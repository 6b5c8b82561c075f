"""The page of `hedgebed validate`: reads result.json and series/ of its run folder."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from itertools import cycle
from pathlib import Path

from rigid.series import read_series
from vis.page.numbers import typeset
from vis.page.page import Block, Section, Tile, figure, listing, table, text
from vis.page.plots import GREY, new_figure, title_above
from vis.page.report import Report, Result, capital, number_text, report_of

__all__ = ["answer_tiles", "write_validation_report"]

_WIDTH, _HEIGHT, _DPI = 5.6, 3.6, 110
_COLOURS = ("#0072B2", "#E69F00", "#CC79A7", "#009E73", "#D55E00", "#56B4E9", "#8a8a8a", "#222222", "#8C564B")
_HEAD = ("expected", "bed", "difference", "band", "")
#: Entries of a legend that find room in the plot; more stand beneath it, in three columns up to so many characters.
_INSIDE, _THREE_COLUMNS = 4, 24
_LEGEND_ROW = 0.16


@report_of()
def write_validation_report(report: Report) -> Path:
    """Make figures/ and report.html of the folder, and return the report."""
    result, cases, blocks = report.result, report.result["cases"], {}
    for done, case in enumerate(cases, 1):
        blocks[case["id"]] = [_draw(report.folder, case, plot, k) for k, plot in enumerate(case.get("plots", ()), 1)]
        report.tell(done / len(cases))
    lead = [result["title"].partition(": ")[2], result["date"], f"version {result['version']}, code {result['code']}"]
    more = {"title": "Verification of the bed", "warnings": result["warnings"], "missing": _absent(cases)}
    return report.write(_sections(cases, blocks), lead=lead, version=False, tiles=answer_tiles(result), **more)


def _draw(folder: Path, case: Result, plot: Result, number: int) -> Block:
    """One plot: references as lines, what the bed did as dots; a line and the dots that it is for have one colour."""
    columns = read_series(folder / plot["series"], text=("curve",))
    curves = dict.fromkeys(columns["curve"].tolist())
    path = folder / "figures" / f"{case['id']}-{number}.png"
    beneath = len(curves) > _INSIDE
    across = 3 if max(map(len, curves)) <= _THREE_COLUMNS else 2
    below = _LEGEND_ROW * -(-len(curves) // across) if beneath else 0.0
    drawing = new_figure(_HEIGHT + below, width=_WIDTH)
    axis = drawing.subplots()
    lines = plot["lines"]
    colours = _colours(curves, lines)
    for label in curves:
        own = columns["curve"] == label
        axis.plot(
            columns["x"][own],
            columns["y"][own],
            "-" if label in lines else "o",
            color=colours[label],
            ms=3.5,
            lw=1.6,
            label=typeset(label.replace("; ", ", ")),
        )
    axis.set(xlabel=typeset(plot["x"]), ylabel=typeset(plot["y"]), title=typeset(plot["title"]))
    if "x" in plot["log"]:
        axis.set_xscale("log")
    if "y" in plot["log"]:
        axis.set_yscale("log")
    if beneath:
        drawing.legend(fontsize=7, loc="outside lower center", ncols=across)
    else:
        axis.legend(fontsize=7)
    title_above(drawing, _titled(case))
    drawing.savefig(path, dpi=_DPI)
    caption = "Lines: the reference; dots: the bed." if plot["lines"] else "Dots: the bed."
    return figure(path, title=plot["title"], caption=caption, half=True)


def _colours(curves: Iterable[str], lines: Collection[str]) -> dict[str, str]:
    """The colour of each curve: grey where it is the only line; one colour for a line and the dots that it is for, as
    "line; 3 mm" and "bed; 3 mm"; else each its own."""
    found: dict[str, str] = {}
    unpaired: dict[tuple[str, bool], str] = {}
    colours = cycle(_COLOURS)
    for label in curves:
        is_line, of = label in lines, label.partition("; ")[2] or label
        if is_line and len(lines) == 1:
            found[label] = GREY
        elif (of, not is_line) in unpaired:
            found[label] = unpaired.pop((of, not is_line))
        else:
            found[label] = unpaired[of, is_line] = next(colours)
    return found


def _titled(case: Result) -> str:
    """What the figures of a case are of: without "Measured", as their dots are simulated; grains and gravity."""
    words = capital(str(case["title"]).removeprefix("Measured: "))
    stuff = case.get("stuff", "")
    return typeset(f"{words}; {stuff}" if stuff else words)


def _cells(row: Result) -> tuple[str, ...]:
    """Wanted, ours, difference, band, verdict of one comparison."""
    unit = "" if row["unit"] == "1" else f" {row['unit']}"
    if row["difference"] is None:
        gap = "not a number"
    elif row["relative"]:
        gap = f"{100 * row['difference'] / abs(row['reference']):+.2g} %"
    else:
        gap = f"{row['difference']:+.2g}"
    band = f"±{100 * row['band']:.2g} %" if row["relative"] else f"±{row['band']:.2g}"
    numbers = (number_text(row[key], 5) + unit for key in ("reference", "ours"))
    return *numbers, gap, band, "pass" if row["passes"] else "FAIL"


def _run(cases: Sequence[Result]) -> list[Result]:
    return [case for case in cases if case["status"] in ("pass", "fail", "informational")]


def answer_tiles(result: Result) -> list[Tile]:
    """How many cases and numbers agree."""
    cases = result["cases"]
    run, many = _run(cases), Counter(case["status"] for case in cases)
    numbers = [one for case in run for one in case["comparisons"]]
    return [
        Tile("Cases that pass", str(many["pass"]), f"of {len(run)} that were run"),
        Tile("Cases that fail", str(many["fail"]), "each with its reason if known"),
        Tile("Numbers compared", str(len(numbers)), f"{sum(one['passes'] for one in numbers)} within their bands"),
        Tile("Not yet", str(many["not yet"]), "cases that the bed cannot compute yet"),
    ]


def _sections(cases: Sequence[Result], blocks: Mapping[str, Sequence[Block]]) -> list[Section]:
    run = _run(cases)
    sections = [_overview(run)]
    for status, title in (("fail", "What fails, and why"), ("informational", "Outside, and not counted")):
        if outside := [case for case in run if case["status"] == status]:
            reasons = [f"{case['id']}: {case['reason'] or 'not examined yet'}." for case in outside]
            sections.append(Section(title, [listing(reasons)]))
    for family in dict.fromkeys(case["family"] for case in run):
        own = [block for case in run if case["family"] == family for block in _case(case, blocks)]
        sections.append(Section(family, own))
    return sections


def _overview(run: Sequence[Result]) -> Section:
    rows = []
    for case in run:
        worst = case["worst"]
        cells = _cells(worst)[:-1] if worst else ("–",) * 4
        wanted = f"{case['reference']} ({case['source']})"
        verdict = "FAIL" if case["status"] == "fail" else case["status"]
        rows.append((f"{case['id']}: {case['title']}", *cells, verdict, wanted))
    lead = "A row shows the number that takes the largest share of its band. All numbers follow below."
    head = ("case", *_HEAD, "closed form or figure (source)")
    return Section("Every case", [text(lead), table(head, rows)])


def _case(case: Result, blocks: Mapping[str, Sequence[Block]]) -> list[Block]:
    found = [text(f"{case['id']}: {case['title']}. {case['reference']} ({case['source']})."), *blocks[case["id"]]]
    if case["comparisons"]:
        rows = [(one["quantity"], *_cells(one)) for one in case["comparisons"]]
        found.append(table(("number", *_HEAD), rows))
    found += [text(remark, small=True) for remark in case["remarks"]]
    return found


def _absent(cases: Sequence[Result]) -> list[str]:
    """What is not in the report: each case that could not be run, and in one sentence those that were left out."""
    reasons, left = [], []
    for case in cases:
        why = case.get("waits_for") or case.get("skipped")
        if why:
            reasons.append(f"{case['id']} ({case['title']}): {case['status']}, {why}")
        elif case["status"] not in ("pass", "fail", "informational"):
            left.append(case["id"])
    return [*reasons, f"left out of this run: {', '.join(left)}"] if left else reasons
