"""bench.json as a table: on the terminal, and in Markdown for docs/performance.md.

python -m benchmarks.race.table DIR/bench.json                      # prints the Markdown
python -m benchmarks.race.table DIR/bench.json docs/performance.md  # puts it between the two marks in that file
"""

import json
import sys
from pathlib import Path

from rich import box
from rich.console import Console
from rich.table import Table

from experiments.runs.types import Json

__all__ = ["HEADINGS", "MARKS", "markdown", "rows", "show"]

HEADINGS = ("code", "skin, mm", "threads", "10^6/s", "runs", "ours/this", "touching", "packing", "uJ", "lists", "")
LEGEND = (
    "10^6/s: million grain-steps a second, median of the runs; touching: grains that a grain touches, packing and uJ "
    "(kinetic energy): at the end of the timed steps; lists: neighbour lists made in them."
)
_LEFT = (0, len(HEADINGS) - 1)
MARKS = ("<!-- bench bed: begin -->", "<!-- bench bed: end -->")
_NONE = "-"


def rows(bed: Json) -> list[tuple[str, ...]]:
    """The rows of one bed of bench.json, one for each entrant, in the order of HEADINGS."""
    return [_row(entrant, bed["entrants"][0]["speed"], bed["best_peer"]) for entrant in bed["entrants"]]


def _row(entrant: Json, ours: float | None, best: str | None) -> tuple[str, ...]:
    speed, last = entrant["speed"], entrant["heats"][-1] if entrant["heats"] else {}
    return (
        entrant["name"] + ("" if entrant["precision"] == "float64" else f" {entrant['precision']}"),
        _NONE if entrant["skin"] is None else f"{1e3 * entrant['skin']:g}",
        str(entrant["threads"]),
        _NONE if speed is None else f"{1e-6 * speed:.2f}",
        str(len(entrant["heats"])),
        _NONE if speed is None or ours is None else f"{ours / speed:.2f}",
        f"{last['coordination']:.3f}" if last else _NONE,
        f"{last['packing']:.4f}" if last else _NONE,
        f"{1e6 * last['kinetic_energy']:.3g}" if last else _NONE,
        str(last["list_count"]) if last else _NONE,
        _remark(entrant, best),
    )


def _remark(entrant: Json, best: str | None) -> str:
    if entrant["failure"]:
        return "failed"
    if entrant["other_work"]:
        return f"other work: {entrant['other_work']}"
    if entrant["label"] == best:
        return "best peer"
    if entrant.get("limit"):
        return "how far the machine goes"
    return "" if entrant["counted"] or entrant["ours"] else "shown, not counted"


def _title(bed: Json, bench: Json) -> str:
    ratio = bench["ratios"][str(bed["grain_count"])]
    verdict = "no peer to race against" if ratio is None else f"hedgebed / best peer = {ratio:.2f}"
    limit = bench.get("limits", {}).get(str(bed["grain_count"]))
    verdict += "" if limit is None else f", hedgebed / C loop = {limit:.2f}"
    return f"{bed['grain_count']:,} grains, {bed['steps']} timed steps: {verdict}"


def show(bench: Json, console: Console) -> None:
    """Print a table for each bed, and what was left out or went wrong."""
    for bed in bench["beds"]:
        table = Table(title=_title(bed, bench), title_justify="left", box=box.SIMPLE_HEAD, pad_edge=False)
        for k, heading in enumerate(HEADINGS):
            table.add_column(heading, justify="left" if k in _LEFT else "right", no_wrap=k not in _LEFT)
        for row in rows(bed):
            table.add_row(*row)
        console.print(table, markup=False)
    console.print(LEGEND, markup=False)
    for remark in bench["remarks"]:
        console.print(f"- {remark}", markup=False, highlight=False)


def markdown(bench: Json) -> str:
    """The same in Markdown, with date, machine, versions and command."""
    machine = bench["machine"]
    peers = ", ".join(f"{name} {version}" for name, version in bench["peers"].items() if version)
    rule = "|" + "|".join("---" if k in _LEFT else "---:" for k in range(len(HEADINGS))) + "|"

    def line(cells: tuple[str, ...]) -> str:
        return "| " + " | ".join(cell.replace("|", "/") for cell in cells) + " |"

    lines = [
        f"{bench['date']}, {machine['processor']}, {machine['cores']} cores; hedgebed {bench['version']}, "
        f"Taichi {machine['taichi']}; {peers or 'no peers'}; `{bench['command']}`. Medians of {bench['rounds']} rounds."
    ]
    for bed in bench["beds"]:
        lines += ["", f"**{_title(bed, bench)}**", "", line(HEADINGS), rule, *(line(row) for row in rows(bed))]
    remarks = [f"- {remark}" for remark in bench["remarks"]]
    return "\n".join([*lines, "", LEGEND, *([""] if remarks else []), *remarks]) + "\n"


def insert(text: str, table: str) -> str:
    """A page with what is between its two marks replaced by a table. Raises ValueError where a mark is missing."""
    begin, end = MARKS
    head, first, rest = text.partition(begin)
    _, second, tail = rest.partition(end)
    if not first or not second:
        raise ValueError(f"the page lacks the marks {begin} and {end}")
    return f"{head}{begin}\n{table}{end}{tail}"


def main(arguments: list[str]) -> int:
    """Print the table of a bench.json, or put it into a page."""
    if not 1 <= len(arguments) <= 2:
        print(__doc__, file=sys.stderr)
        return 2
    table = markdown(json.loads(Path(arguments[0]).read_text(encoding="utf-8")))
    if len(arguments) == 1:
        print(table, end="")
        return 0
    page = Path(arguments[1])
    page.write_text(insert(page.read_text(encoding="utf-8"), table), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
