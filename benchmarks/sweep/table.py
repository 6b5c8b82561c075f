"""bench.json of ``benchmarks.gpu`` as Markdown, beside what others have published.

python -m benchmarks.sweep.table DIR/bench.json                            # prints the Markdown
python -m benchmarks.sweep.table DIR/bench.json docs/notes/performance.md  # puts it between the two marks there
"""

import sys

from benchmarks.race.table import print_or_insert
from experiments.runs.types import Json

__all__ = ["MARKS", "PUBLISHED", "main", "markdown"]

MARKS = ("<!-- bench gpu: begin -->", "<!-- bench gpu: end -->")

# Code, card, what a grain is, million grain-steps a second, source.
PUBLISHED = (
    ("DEM-Engine", "RTX PRO 6000", "3-sphere clump", "142 to 171", "pull request 80 of it, 152,670 grains"),
    ("DEM-Engine", "AMD MI350X", "3-sphere clump", "279 to 378", "the same, 152,670 to 613,998 grains"),
    ("DEM-Engine", "2 x RTX 3080", "3-sphere clump", "about 280", "its README: 1e6 grains, 1e6 steps, an hour"),
    ("Chrono::DEM", "RTX 5090", "sphere", "141", "issue 807 of chrono: 159,600 grains, 7.1 ns a grain and step"),
    ("phasicFlow", "RTX A4000", "sphere", "46", "its drum benchmark: 1e6 grains, 4e5 steps, 146 minutes"),
)
HEADINGS = (
    "grains",
    "numbers",
    "rolling",
    "10^6/s",
    "ms a step",
    "steps",
    "lists",
    "touching",
    "packing",
    "kB a grain",
)


def markdown(bench: Json) -> str:
    """Date, machine and command; the tests; the sweep; what others have published."""
    gpu, machine = bench["gpu"], bench["machine"]
    lines = [
        f"{bench['date']}, {gpu['name']}, driver {gpu['driver']}, {machine['cores']} cores; hedgebed "
        f"{bench['version']} (commit {bench['commit']}), Taichi {machine['taichi']}; `{bench['command']}`.",
        "",
    ]
    if tests := bench.get("tests"):
        counts = ", ".join(f"{tests[key]} {key}" for key in ("passed", "failed", "skipped"))
        lines += [
            f"Tests of beds (`tests/dem`, `tests/physics`) with `arch = 'cuda'`: {counts}, {tests['wall_s']:.0f} s.",
            *([] if tests.get("ended", True) else ["Their time ended before all had run."]),
            *(f"Failed: `{name}`." for name in tests.get("failures", ())),
            "",
        ]
    lines += ["| " + " | ".join(HEADINGS) + " |", "|" + "---:|" * len(HEADINGS)]
    for row in bench["rows"]:
        lines.append("| " + " | ".join(_cells(row)) + " |")
    lines += ["", "Published by others, on other cards and beds, so to be compared with care:", ""]
    lines += ["| code | card | grain | 10^6/s | source |", "|---|---|---|---:|---|"]
    lines += ["| " + " | ".join(row) + " |" for row in PUBLISHED]
    remarks = [f"- {remark}" for remark in bench["remarks"]]
    return "\n".join([*lines, *([""] if remarks else []), *remarks]) + "\n"


def _cells(row: Json) -> tuple[str, ...]:
    return (
        f"{row['grains']:,}",
        row["precision"],
        "yes" if row["rolling"] else "no",
        f"{1e-6 * row['speed']:.0f}",
        f"{1e3 * row['wall_s'] / row['steps']:.3g}",
        str(row["steps"]),
        str(row["lists"]),
        "-" if row["touching"] is None else f"{row['touching']:.3f}",
        f"{row['packing']:.4f}",
        f"{1e-3 * row['bytes_per_grain']:.2f}",
    )


def main(arguments: list[str]) -> int:
    """Print the table of a bench.json, or put it into a page."""
    return print_or_insert(arguments, __doc__, markdown, lambda bench: MARKS)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
