"""What a run shows on the terminal in the end: the table of its report, warnings, first findings.

Everything else is in the report and in result.json, and with ``--verbose`` on the terminal too.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from importlib import import_module
from typing import Any

from vis.page.answer import answer, without_unknown
from vis.page.limits import kind_of
from vis.page.numbers import foldable
from vis.page.page import Tile

from .registry import Experiment, Headline, findings_shown

__all__ = ["headline_of", "headline_of_tiles"]


def headline_of(experiment: Experiment, result: Mapping[str, Any]) -> Headline | None:
    """The short form of a result of the experiment; None where it is shown in full."""
    module, _, name = (experiment.answer or experiment.headline).partition(":")
    if not module or not result.get("quantities"):
        return None
    found = getattr(import_module(module), name)(result)
    if not experiment.answer:
        return found
    shown = headline_of_tiles(found, result)
    tables = tuple(result.get("tables", ()))
    if shown is None or not tables:
        return shown
    return replace(shown, tables=tables) if experiment.tables else replace(shown, more=True)


def headline_of_tiles(tiles: Sequence[Tile], result: Mapping[str, Any]) -> Headline | None:
    """The short form of a result; None without rows. Remarks are shown where the table has no column of errors."""
    if not tiles:
        return None
    table, *notes = answer(tiles, result)
    if any(tile.beside for tile in tiles) or kind_of(result) in ("bed", "platform on grains"):
        table, notes = without_unknown(table, notes)
    end = None if len(table.head) == 3 and any(row[-1] for row in table.rows) else -1
    rows = tuple(tuple(foldable(cell) for cell in row[:end]) for row in table.rows)
    warnings, said = result.get("warnings", []), result.get("departures", {}).get("sentences", [])
    shown = said[: findings_shown(warnings)]
    first = [*result.get("summary", ()), *shown]
    return Headline(
        tuple(table.head[:end]), rows, tuple(map(foldable, warnings)), tuple(map(foldable, first)),
        len(said) - len(shown), tuple(foldable(note.text) for note in notes),
    )  # fmt: skip
