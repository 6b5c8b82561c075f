"""bench.json as tables: on the terminal, and in Markdown for docs/notes/performance.md.

python -m benchmarks.race.table DIR/bench.json                            # prints the Markdown
python -m benchmarks.race.table DIR/bench.json docs/notes/performance.md  # puts it between its two marks in that file
"""

import json
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from rich import box
from rich.console import Console
from rich.table import Table

from experiments.runs.types import Json
from vis.page.marks import insert

__all__ = ["HEADINGS", "MARKS", "PHASES", "Sheet", "insert", "markdown", "marks_of", "print_or_insert", "rows", "show"]

HEADINGS = ("code", "skin, mm", "threads", "10^6/s", "runs", "ours/this", "touching", "packing", "uJ", "lists", "")
LEGEND = (
    "10^6/s: million grain-steps a second, median of the runs; touching: grains that a grain touches, packing and uJ "
    "(kinetic energy): at the end of the timed steps; lists: neighbour lists made in them."
)
PHASES = ("finding", "forces", "moving", "sorting", "listing", "waiting", "else")
PROFILE_HEADINGS = ("code", "threads", *PHASES, "all", "lists/step")
PROFILE_LEGEND = (
    "ns of thread time for a grain and a step: of one thread in our bed processor time, else wall time times threads. "
    "Of ours, sorting and listing are measured each alone; moving, finding (rows looked at) and forces as what a step "
    "of a bed that stands still takes without and with them; all on one that moves; else is inferred. Moving holds "
    "launches and the waiting between phases. The C loop has a clock in it."
)
SCALE_HEADINGS = (
    "grains",
    "steps",
    "10^6/s",
    "lists",
    "GB held",
    "kB/grain held",
    "kB/grain at most",
    "kB/grain fields",
)
SCALE_LEGEND = (
    "10^6/s: million grain-steps a second; held: memory of the process at the end, at most: while the bed was laid end "
    "to end too; kB a grain of both: growth from the first row; fields: what the engine has allocated, its room to "
    "spare included."
)
ANSWER_HEADINGS = ("", "time of the push, s", "times sooner", "grain-steps", "mean force, N", "force, part by part")
ANSWER_LEGEND = (
    "Time: of the whole push, wall. Mean force: over the part that all have run, with the difference to the peer's; "
    "part by part: root mean square of the difference over that mean."
)
MARKS = {
    "beds": ("<!-- bench bed: begin -->", "<!-- bench bed: end -->"),
    "scale": ("<!-- bench bed --scale: begin -->", "<!-- bench bed --scale: end -->"),
    "answer": ("<!-- bench answer: begin -->", "<!-- bench answer: end -->"),
    "profile": ("<!-- bench bed --profile: begin -->", "<!-- bench bed --profile: end -->"),
}
"""Where in a page the table goes, by what a bench.json has."""
_NONE = "-"


@dataclass(frozen=True)
class Sheet:
    """One table: its title, headings, which columns are set to the left, and rows."""

    title: str
    headings: tuple[str, ...]
    left: tuple[int, ...]
    rows: list[tuple[str, ...]]

    def markdown(self) -> list[str]:
        """Its lines, the title left out."""

        def line(cells: tuple[str, ...]) -> str:
            return "| " + " | ".join(cell.replace("|", "/") for cell in cells) + " |"

        rule = "|" + "|".join("---" if k in self.left else "---:" for k in range(len(self.headings))) + "|"
        return [line(self.headings), rule, *(line(row) for row in self.rows)]


def rows(bed: Json) -> list[tuple[str, ...]]:
    """The rows of one bed of bench.json, one for each entrant, in the order of HEADINGS."""
    ours = {entrant["rolling"]: entrant["speed"] for entrant in reversed(bed["entrants"]) if entrant["ours"]}
    best = (bed["best_peer"], bed.get("best_rolling_peer"))
    return [_row(entrant, ours.get(entrant["rolling"]), best) for entrant in bed["entrants"]]


def _row(entrant: Json, ours: float | None, best: tuple[str | None, ...]) -> tuple[str, ...]:
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


def _remark(entrant: Json, best: tuple[str | None, ...]) -> str:
    if entrant["failure"]:
        return "failed"
    if entrant["other_work"]:
        return f"other work: {entrant['other_work']}"
    if entrant["label"] in best:
        return "best peer with rolling" if entrant["rolling"] else "best peer"
    if entrant.get("limit"):
        return "how far the machine goes"
    return "" if entrant["counted"] or entrant["ours"] else "shown, not counted"


def _title(bed: Json, bench: Json) -> str:
    ratio = bench["ratios"][str(bed["grain_count"])]
    verdict = "no peer to race against" if ratio is None else f"hedgebed / best peer = {ratio:.2f}"
    rolling = bench.get("rolling_ratios", {}).get(str(bed["grain_count"]))
    verdict += "" if rolling is None else f", with rolling {rolling:.2f}"
    limit = bench.get("limits", {}).get(str(bed["grain_count"]))
    verdict += "" if limit is None else f", hedgebed / C loop = {limit:.2f}"
    return f"{bed['grain_count']:,} grains, {bed['steps']} timed steps: {verdict}"


def _profile_rows(bed: Json) -> list[tuple[str, ...]]:
    return [
        (
            column["name"],
            str(column["threads"]),
            *(f"{column['phases'][phase]:.1f}" if phase in column["phases"] else _NONE for phase in PHASES),
            f"{column['total']:.1f}",
            f"{column['lists_per_step']:.4f}",
        )
        for column in bed["columns"]
    ]


def _profile_title(bed: Json) -> str:
    counts = bed["counts"]
    return (
        f"{bed['grain_count']:,} grains, {bed['steps']} steps: for each grain {counts['rows']:.2f} rows, of which "
        f"{counts['touching_rows']:.2f} touch, {counts['contacts']:.2f} contacts "
        f"({100 * counts['computed_twice']:.0f} % computed twice, {counts['chunks']} chunks)"
    )


def _scale_row(size: Json) -> tuple[str, ...]:
    grown = [size["held_per_grain"], size["most_per_grain"], size["fields"] / size["grain_count"]]
    return (
        f"{size['grain_count']:,}", str(size["steps"]), f"{1e-6 * size['speed']:.2f}", str(size["list_count"]),
        f"{1e-9 * size['held']:.2f}", *(_NONE if value is None else f"{1e-3 * value:.2f}" for value in grown),
    )  # fmt: skip


def _scale_title(sizes: list[Json]) -> str:
    last = sizes[-1]
    largest = ", ".join(
        f"{name} {size / last['grain_count']:.0f}" for name, size in last["largest_fields"].items()
    )  # fmt: skip
    return f"Flat cost; bytes a grain of the largest fields at {last['grain_count']:,} grains: {largest}"


def _answer_rows(answer: Json) -> list[tuple[str, ...]]:
    few = len(answer["curve"]["awake"])
    whole, peer = answer["peer_s"], answer["curve"]["peer"]

    def row(
        name: str, seconds: float, steps: float, force: list[float], gap: float | None, apart: float | None = None
    ) -> tuple[str, ...]:
        mean = f"{sum(force[:few]) / few:.4g}" + ("" if gap is None else f" ({100 * gap:+.1f} %)")
        sooner = _NONE if whole is None else f"{whole / seconds:.2f}"
        return (
            name,
            f"{seconds:.0f}",
            sooner,
            f"{steps:.3g}",
            mean,
            _NONE if apart is None else f"{100 * apart:.0f} %",
        )

    lines = [
        row("hedgebed, grains sleep", answer["ours_s"], answer["grain_steps"], answer["curve"]["ours"],
            answer["force_difference"], answer["force_scatter"]),
        row("hedgebed, all awake", answer["awake_s"], answer["all_awake"], answer["curve"]["awake"],
            answer["awake_force_difference"]),
    ]  # fmt: skip
    if peer is not None:
        lines.append(row(answer["peer"], whole, answer["all_awake"], peer, None))
    return lines


def _answer_title(answer: Json) -> str:
    part = ""
    if answer["extrapolated"]:
        share = f"{100 * answer['part']:.0f} %"
        part = f"; all but the first row ran the first {share}, their time is that of the part times the steps"
    return (
        f"A spike {2e3 * answer['radius']:g} mm across, {1e3 * answer['depth']:g} mm into {answer['grain_count']:,} "
        f"grains at {answer['speed']:g} m/s, {answer['steps']:,} steps{part}"
    )


def _tables(bench: Json) -> Iterator[Sheet]:
    for bed in bench.get("beds", ()):
        yield Sheet(_title(bed, bench), HEADINGS, (0, len(HEADINGS) - 1), rows(bed))
    for bed in bench.get("profile", ()):
        yield Sheet(_profile_title(bed), PROFILE_HEADINGS, (0,), _profile_rows(bed))
    if "answer" in bench:
        yield Sheet(_answer_title(bench["answer"]), ANSWER_HEADINGS, (0,), _answer_rows(bench["answer"]))
        tumbles = [
            (kept["case"], f"{kept['grain_steps']:.3g}", f"{kept['all_awake']:.3g}", f"{kept['times_fewer']:.1f}")
            for kept in bench["tumbles"]
        ]
        if tumbles:
            headings = ("docs/results/", "grain-steps", "all awake", "times fewer")
            yield Sheet("Tumbles at 0.22 N m and 0.0085 g, as they are kept", headings, (0,), tumbles)
    if "scale" in bench:
        yield Sheet(_scale_title(bench["scale"]), SCALE_HEADINGS, (), [_scale_row(size) for size in bench["scale"]])


def _legend(bench: Json) -> str:
    legends = {"profile": PROFILE_LEGEND, "scale": SCALE_LEGEND, "answer": ANSWER_LEGEND}
    return next((legends[kind] for kind in legends if kind in bench), LEGEND)


def show(bench: Json, console: Console) -> None:
    """Print the tables, and what was left out or went wrong."""
    for sheet in _tables(bench):
        table = Table(title=sheet.title, title_justify="left", box=box.SIMPLE_HEAD, pad_edge=False)
        for k, heading in enumerate(sheet.headings):
            table.add_column(heading, justify="left" if k in sheet.left else "right", no_wrap=k not in sheet.left)
        for row in sheet.rows:
            table.add_row(*row)
        console.print(table, markup=False)
    console.print(_legend(bench), markup=False)
    for remark in bench["remarks"]:
        console.print(f"- {remark}", markup=False, highlight=False)


def markdown(bench: Json) -> str:
    """The same in Markdown, with date, machine, versions and command."""
    machine = bench["machine"]
    versions = [f"hedgebed {bench['version']}, Taichi {machine['taichi']}"]
    if "peers" in bench:
        versions.append(", ".join(f"{name} {said}" for name, said in bench["peers"].items() if said) or "no peers")
    lines = [
        f"{bench['date']}, {machine['processor']}, {machine['cores']} cores; {'; '.join(versions)}; "
        f"`{bench['command']}`." + (f" Medians of {bench['rounds']} rounds." if "rounds" in bench else "")
    ]
    for sheet in _tables(bench):
        lines += ["", f"**{sheet.title}**", "", *sheet.markdown()]
    remarks = [f"- {remark}" for remark in bench["remarks"]]
    return "\n".join([*lines, "", _legend(bench), *([""] if remarks else []), *remarks]) + "\n"


def marks_of(bench: Json) -> tuple[str, str]:
    """The marks between which the table of a bench.json belongs. Raises ValueError for one that has none."""
    found = next((marks for key, marks in MARKS.items() if key in bench), None)
    if found is None:
        raise ValueError(f"this bench.json ({bench.get('what')}) has no table for a page")
    return found


def print_or_insert(
    arguments: list[str],
    usage: str | None,
    markdown: Callable[[Json], str],
    marks_of: Callable[[Json], tuple[str, str]],
) -> int:
    """Print the table of the bench.json named first, or put it between its marks in the page named second.

    Returns the exit status: 2, with ``usage`` printed, for no name or more than two. Raises ValueError: ``insert``.
    """
    if not 1 <= len(arguments) <= 2:
        print(usage, file=sys.stderr)
        return 2
    bench = json.loads(Path(arguments[0]).read_text(encoding="utf-8"))
    table = markdown(bench)
    if len(arguments) == 1:
        print(table, end="")
        return 0
    page = Path(arguments[1])
    page.write_text(insert(page.read_text(encoding="utf-8"), table, marks_of(bench)), encoding="utf-8")
    return 0


def main(arguments: list[str]) -> int:
    """Print the table of a bench.json, or put it into a page."""
    return print_or_insert(arguments, __doc__, markdown, marks_of)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
