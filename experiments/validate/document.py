"""docs/validation.md from the result: one row a case, then what lies behind each row."""

from collections.abc import Iterator, Mapping
from typing import Any

__all__ = ["band_of", "difference_of", "markdown", "number"]

MARKS = {"pass": "pass", "fail": "**FAIL**", "skipped": "skipped", "not run": "not run", "not yet": "not yet"}


def number(value: Any) -> str:
    """To five digits; a dash where there is none."""
    return "–" if value is None else f"{value:.5g}"


def difference_of(row: Mapping[str, Any]) -> str:
    """In the terms of the band: per cent of the reference, or the unit."""
    if row["difference"] is None:
        return "not a number"
    if row["relative"]:
        return f"{100 * row['difference'] / abs(row['reference']):+.2g} %"
    return f"{row['difference']:+.2g}"


def band_of(row: Mapping[str, Any]) -> str:
    """As the difference."""
    return f"±{100 * row['band']:.2g} %" if row["relative"] else f"±{row['band']:.2g}"


def _cells(row: Mapping[str, Any]) -> str:
    unit = "" if row["unit"] == "1" else f" {row['unit']}"
    return f"{number(row['reference'])}{unit} | {number(row['ours'])}{unit} | {difference_of(row)} | {band_of(row)}"


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
    family = ""
    for row in result["cases"]:
        if row["status"] not in ("pass", "fail"):
            continue
        if row["family"] != family:
            family = row["family"]
            yield from ("", f"## {family}")
        yield from _details(row)


def _overview(row: Mapping[str, Any]) -> str:
    head = f"| {row['id']} | {row['title']} | {row['reference']} | {row['source']}"
    if row.get("worst"):
        return f"{head} | {_cells(row['worst'])} | {MARKS[row['status']]} |"
    said = row.get("waits_for") or row.get("skipped") or ""
    return f"{head} | – | – | – | – | {MARKS[row['status']]}{f': {said}' if said else ''} |"


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
