"""The answer of a hop: at most six numbers with their errors, in the words of report and terminal."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from vis.page.law_rows import cell_of, law_row
from vis.page.page import Tile

__all__ = ["answer_tiles"]

_NONE = ("none", "none", "not validated")


def answer_tiles(result: Mapping[str, Any]) -> list[Tile]:
    """Rows of the table at the top of a report: the hop from rigid ground, and from that of the run."""
    quantities, ground = result["quantities"], result["surface"]
    time = cell_of(quantities["flight_time"]["value"], None, "s")
    by_distance, others = result.get("asks_for", "distance") == "distance", result.get("otherwise", {}).get("mu_s")
    rows = [
        law_row(result, "wheel_speed", "Wheel speed, rigid ground", quantities["wheel_speed"]["note"], law=False),
        law_row(result, "launch_speed", "Launch, rigid ground", beside="launch_angle", law=False),
        law_row(result, "distance", "Distance, rigid ground", f"in {time}", law=False),
        law_row(result, "model_launch_speed", f"Launch from {ground}", "planar model", beside="model_launch_angle"),
        law_row(result, "model_distance", f"Distance from {ground}", "the same wheel"),
    ]
    if quantities["model_wheel_speed"]["value"] is not None:  # sought on ground that gives, and found
        rows.insert(1, law_row(result, "model_wheel_speed", f"Wheel speed, {ground}", "for that distance"))
    if others is not None and result["actuator"] == "brake":
        what, low, high = _friction_span(by_distance, others)
        if by_distance:  # the row of the distance that was asked for makes room
            rows = [row for row in rows if row.label != "Distance, rigid ground"]
            rows.insert(len(rows) - 3, Tile(what, f"{low} / {high}", errors=_NONE))
        else:
            rows = [*rows, Tile(what, f"{low} / {high}", errors=_NONE)]
    return rows


def _friction_span(by_distance: bool, others: Mapping[str, Any]) -> tuple[str, str, str]:
    """Label and both values of the answer on rigid ground with half and twice the friction."""
    low, high = (cell_of(value, None, others["unit"]) for value in others["values"])
    return "Wheel speed, rigid, mu_s half / twice" if by_distance else "Distance, rigid, mu_s half / twice", low, high
