"""The answer of a run in space: at most six numbers with their errors, in the words of report and terminal."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from vis.page.law_rows import answer_rows
from vis.page.numbers import quantity
from vis.page.page import Tile

__all__ = ["answer_tiles"]

_ROWS = {
    "max_speed": ("Largest speed", "of the centre of mass"),
    "max_angular_velocity": ("Largest angular velocity", ""),
    "largest_turn": ("Largest turn", "from the start"),
    "sinkage_largest": ("Largest sinkage", "of any spike"),
    "largest_force": ("Largest force", "of the ground"),
}
"""Number of the result -> its label and note."""


def answer_tiles(result: Mapping[str, Any]) -> list[Tile]:
    """Rows of the table at the top of a report."""
    rows = _ROWS
    if result["quantities"].get("hop_distance", {}).get("value") is not None:  # a hop is the answer of one that hops
        rows = {"hop_distance": ("Distance of the hop", "ballistic, level ground")} | _ROWS
        del rows["max_angular_velocity"]
    left_over = Tile("Energy error", quantity(result["quantities"]["energy_residual"]), "of all there was")
    return [*answer_rows(result, rows, quantity), left_over]
