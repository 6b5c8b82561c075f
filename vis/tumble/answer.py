"""The answer of a tumble: at most six numbers with their errors, in the words of report and terminal."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from vis.page.law_rows import answer_rows, cell_of
from vis.page.page import Tile
from vis.page.sentences import label_of

__all__ = ["answer_tiles"]

_ROWS = {
    "trajectory_angle": ("Trajectory angle", "of the first 10 mm"),
    "max_speed": ("Largest speed", "of the centre"),
    "max_angular_velocity": ("Largest angular velocity", ""),
    "transition_angle_slip": (label_of("transition_angle_slip"), ""),
    "transition_angle_hop": (label_of("transition_angle_hop"), ""),
    "sinkage_largest": ("Largest sinkage", "of any row"),
}
"""Number of the result -> its label and note."""


def answer_tiles(result: Mapping[str, Any]) -> list[Tile]:
    """Rows of the table at the top of a report."""
    return answer_rows(result, _ROWS, lambda entry: cell_of(entry["value"], entry.get("std"), entry["unit"]))
