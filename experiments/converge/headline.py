"""What a sweep shows on the terminal in the end: numbers with their errors, warnings, verdicts."""

from collections.abc import Mapping
from typing import Any

from experiments.runs.registry import Headline

__all__ = ["converge_headline"]


def converge_headline(result: Mapping[str, Any]) -> Headline | None:
    """The short form of a result; None where it has no table of errors."""
    tables = result.get("tables", [])
    if not tables:
        return None
    head, rows = tables[0]["head"], tables[0]["rows"]
    warnings, said = result.get("warnings", []), result.get("departures", {}).get("sentences", [])
    shown = tuple(tuple(str(cell) for cell in row) for row in rows)
    return Headline(tuple(head), shown, tuple(warnings), tuple(said), len(tables) - 1)
