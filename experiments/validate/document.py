"""docs/validation.md from the result: one row a case, then what lies behind each row."""

from collections.abc import Iterator, Mapping
from itertools import groupby
from typing import Any

__all__ = ["markdown"]

MARKS = {"fail": "**FAIL**"}


def _cells(row: Mapping[str, Any]) -> str:
    """What was wanted, ours, difference and band: in per cent of the reference, or in the unit."""
    unit = "" if row["unit"] == "1" else f" {row['unit']}"
    scale, sign = (100, " %") if row["relative"] else (1, "")
    wanted, ours = ("–" if row[key] is None else f"{row[key]:.5g}{unit}" for key in ("reference", "ours"))
    difference, band = "not a number", f"±{scale * row['band']:.2g}{sign}"
    if row["difference"] is not None:
        size = abs(row["reference"]) if row["relative"] else 1
        difference = f"{scale * row['difference'] / size:+.2g}{sign}"
    return f"{wanted} | {ours} | {difference} | {band}"


def markdown(result: Mapping[str, Any], *, command: str) -> str:
    """The whole document."""
    return "\n".join(_lines(result, command)) + "\n"


def _lines(result: Mapping[str, Any], command: str) -> Iterator[str]:
    yield "# Verification of the bed"
    yield ""
    about = f"version {result['version']}, code {result['code']}"
    yield f"Written by `{command}` on {result['date']} ({about}); do not edit."
    alone = any(row.get("command") for row in result["cases"])
    since = " Cases that were run by themselves since say when and with which code." if alone else ""
    yield f"{result['title'].partition(': ')[2].capitalize()}.{since}"
    yield ""
    yield "A row shows the number of its case that takes the largest share of its band; its other numbers are below."
    yield "A case that fails stays here as failing, with what is known of the reason."
    yield ""
    yield "| case | what | closed form or figure | source | wanted | ours | difference | band | |"
    yield "|---|---|---|---|---|---|---|---|---|"
    for row in result["cases"]:
        yield _overview(row)
    yield from _failing(result)
    ran = (row for row in result["cases"] if row["status"] in ("pass", "fail"))
    for family, rows in groupby(ran, key=lambda row: row["family"]):
        yield from ("", f"## {family}")
        for row in rows:
            yield from _details(row)


def _overview(row: Mapping[str, Any]) -> str:
    cells = _cells(row["worst"]) if row.get("worst") else "– | – | – | –"
    why = "" if row.get("worst") else row.get("waits_for") or row.get("skipped") or ""
    mark = ": ".join(filter(None, (MARKS.get(row["status"], row["status"]), why)))
    return f"| {row['id']} | {row['title']} | {row['reference']} | {row['source']} | {cells} | {mark} |"


def _failing(result: Mapping[str, Any]) -> Iterator[str]:
    failing = [row for row in result["cases"] if row["status"] == "fail"]
    if failing:
        yield from ("", "## What fails, and why", "")
        for row in failing:
            beyond = sum(not one["passes"] for one in row["comparisons"])
            why = row["reason"] or "not looked into yet"
            yield f"- **{row['id']}** ({beyond} of {len(row['comparisons'])} numbers): {why}."


def _details(row: Mapping[str, Any]) -> Iterator[str]:
    yield from ("", f"### {row['id']}: {row['title']}", "")
    by = f" by `{row['command']}`, code {row['code']}" if row.get("command") else ""
    yield f"{row['reference']} ({row['source']}). Run on {row['date']}{by}, {row['seconds']:.0f} s."
    for remark in row["remarks"]:
        yield from ("", remark)
    if len(row["comparisons"]) > 1:
        yield from ("", "| number | wanted | ours | difference | band | |", "|---|---|---|---|---|---|")
        for one in row["comparisons"]:
            yield f"| {one['quantity']} | {_cells(one)} | {'pass' if one['passes'] else '**FAIL**'} |"
