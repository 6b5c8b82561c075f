"""The answer of a run in space: at most six numbers with their errors, in the words of report and terminal."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from vis.page.law_rows import law_row
from vis.page.limits import kind_of
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
    quantities, on_law = result["quantities"], kind_of(result) == "planar model"
    rows = [
        law_row(result, name, label, note) if on_law else Tile(label, quantity(quantities[name]), note)
        for name, (label, note) in _ROWS.items()
        if name in quantities  # a folder of an older hedgebed has fewer
    ]
    return [*rows, Tile("Energy left over", quantity(quantities["energy_residual"]), "of all there was")]
