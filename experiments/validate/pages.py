"""docs/validation.md, a table that one reads in five minutes, and docs/notes/validation.md with all numbers of each
case. Both are made from a result; of a checkout, from the kept one (``experiments.validate.experiment.keep``).
"""

import math
import tomllib
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from itertools import groupby
from pathlib import Path
from typing import Any

from experiments.runs.folder import write_text
from experiments.runs.types import Json

__all__ = ["KEPT", "RAN", "UNCOUNTED", "image", "markdown", "notebook", "worst_of", "write_pages"]

KEPT = Path("docs/results/validate/result.json")
RAN = ("pass", "fail", "informational")
UNCOUNTED = ("fail", "informational")
_MARKS = {"fail": "**FAIL**", "informational": "outside, not counted"}
_HEADS = {"fail": "What fails, and why", "informational": "Outside, and not counted"}
_STUDIES = Path(__file__).with_name("studies.toml")


def worst_of(comparisons: Sequence[Json]) -> Json | None:
    """The comparison that takes the largest share of its band."""
    return max(comparisons, key=lambda one: math.inf if one["share"] is None else one["share"], default=None)


def image(case: str, number: int) -> str:
    """Of a figure of a case, from docs/ on."""
    return f"images/validate-{case}-{number}.png"


def write_pages(page: Path, result: Mapping[str, Any], *, command: str) -> None:
    """Write the page of a result, and its details into a file of the same name in the folder notes/ beside it."""
    details = page.parent / "notes" / page.name
    details.parent.mkdir(exist_ok=True)
    write_text(page, markdown(result, command=command, details=f"notes/{page.name}"))
    write_text(details, notebook(result, page=f"../{page.name}"))


def markdown(result: Mapping[str, Any], *, command: str, details: str = "notes/validation.md") -> str:
    """The page: what the suite is, a row for each family, what fails, and a row for each case. `details`: the file of
    `notebook`, from the page's folder."""
    return "\n".join(_page(result, command, details)) + "\n"


def notebook(result: Mapping[str, Any], *, page: str = "../validation.md") -> str:
    """All numbers of each case, with what was remarked and examined. `page`: the file of `markdown`, from its own."""
    return "\n".join(_notes(result, page)) + "\n"


def _page(result: Mapping[str, Any], command: str, details: str) -> Iterator[str]:
    cases = result["cases"]
    ran = [row for row in cases if row["status"] in RAN]
    numbers = [one for row in ran for one in row["comparisons"]]
    yield from ("# Verification of the bed", "")
    yield "This page compares the bed of grains with closed forms, published results, other codes and measurements."
    yield f"It shows how far the bed can be trusted. [{details}]({details}) has all numbers, formulas and sources."
    yield "The page is made by code; do not edit it."
    yield ""
    met = sum(one["passes"] for one in numbers)
    yield f"**{result['title'].partition(': ')[2].capitalize()}.** {met} of {len(numbers)} numbers are in their bands."
    yield f"`{command}` computed them on {result['date']} (version {result['version']}, code {result['code']})."
    if any(row.get("command") for row in cases):
        yield "Cases that were computed alone have a date and a code of their own in the details."
    yield ""
    yield "- The **band** is the largest difference that passes. Some bands are published; the others are ours."
    yield "- A row of a case shows the number that takes the largest share of its band, in its unit or in %."
    yield from ("", "| group | cases | pass | numbers in their bands |", "|---|---|---|---|")
    for family, rows in groupby(cases, key=lambda row: row["family"]):
        yield _family(family, list(rows))
    yield from _failing(cases, details)
    for family, rows in groupby(cases, key=lambda row: row["family"]):
        yield from ("", f"## {family}", "")
        yield "| case | difference | band | |"
        yield "|---|---|---|---|"
        for row in rows:
            yield _overview(row, details)


def _family(name: str, rows: Sequence[Json]) -> str:
    status = Counter(row["status"] for row in rows)
    numbers = [one for row in rows if row["status"] in RAN for one in row["comparisons"]]
    met = sum(one["passes"] for one in numbers)
    return f"| {name} | {len(rows)} | {status['pass']} | {met} of {len(numbers)} |"


def _overview(row: Mapping[str, Any], details: str) -> str:
    cells = " | ".join(_error(row["worst"], units=True)) if row.get("worst") else "– | –"
    why = "" if row.get("worst") else row.get("waits_for") or row.get("skipped") or ""
    mark = ": ".join(filter(None, (_MARKS.get(row["status"], row["status"]), why)))
    name = f"[{row['id']}]({details}#{row['id']})" if row["status"] in RAN else row["id"]
    return f"| {name}: {row['title']} | {cells} | {mark} |"


def _failing(cases: Sequence[Json], details: str) -> Iterator[str]:
    for status, title in _HEADS.items():
        rows = [row for row in cases if row["status"] == status]
        if rows:
            yield from ("", f"## {title}", "")
        for row in rows:
            beyond = sum(not one["passes"] for one in row["comparisons"])
            why = row["reason"] or "not examined yet"
            count = f"{beyond} of {len(row['comparisons'])} numbers outside"
            yield f"- **[{row['id']}]({details}#{row['id']})** ({count}): {why}."


def _cells(row: Mapping[str, Any]) -> str:
    """Expected, found, difference and band."""
    wanted, ours = ("–" if row[key] is None else f"{row[key]:.5g}{_unit(row)}" for key in ("reference", "ours"))
    return " | ".join((wanted, ours, *_error(row)))


def _unit(row: Mapping[str, Any]) -> str:
    return "" if row["unit"] == "1" else f" {row['unit']}"


def _error(row: Mapping[str, Any], *, units: bool = False) -> tuple[str, str]:
    """Difference and band: in per cent of the reference, or in the unit, which is written where `units` is true."""
    scale, sign = (100, " %") if row["relative"] else (1, _unit(row) if units else "")
    difference, band = "not a number", f"±{scale * row['band']:.2g}{sign}"
    if row["difference"] is not None:
        size = abs(row["reference"]) if row["relative"] else 1
        difference = f"{scale * row['difference'] / size:+.2g}{sign}"
    return difference, band


def _notes(result: Mapping[str, Any], page: str) -> Iterator[str]:
    studies = tomllib.loads(_STUDIES.read_text(encoding="utf-8"))
    yield from ("# Notebook: verification of the bed", "")
    yield f"This is the notebook of [{page}]({page}): all numbers, formulas and remarks of each case. Code makes it."
    ran = (row for row in result["cases"] if row["status"] in RAN)
    for family, rows in groupby(ran, key=lambda row: row["family"]):
        yield from ("", f"## {family}")
        for row in rows:
            yield from _details(row)
            if row["status"] in UNCOUNTED and row["id"] in studies:
                yield from ("", *studies[row["id"]].strip().splitlines())


def _details(row: Mapping[str, Any]) -> Iterator[str]:
    yield from ("", f'<a id="{row["id"]}"></a>', f"### {row['id']}: {row['title']}", "")
    by = f" by `{row['command']}`, code {row['code']}" if row.get("command") else ""
    yield f"{row['reference']} ({row['source']}). Run on {row['date']}{by}, {row['seconds']:.0f} s."
    for remark in row["remarks"]:
        yield from ("", remark)
    for k, title in enumerate(row.get("images", ()), 1):
        yield from ("", f"![{title}](../{image(row['id'], k)})")
    if row["comparisons"]:
        yield from ("", "| number | expected | bed | difference | band | |", "|---|---|---|---|---|---|")
        for one in row["comparisons"]:
            yield f"| {one['quantity']} | {_cells(one)} | {'pass' if one['passes'] else '**FAIL**'} |"
