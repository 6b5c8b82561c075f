"""The answer of a robot's run: at most six numbers with their errors, in the words of report and terminal."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from vis.page.numbers import between, quantity, quote
from vis.page.page import Tile

__all__ = ["answer_tiles"]

LABELS = {
    "highest": ("Rise", "of the centre of mass after the first touch, over its start"),
    "longest_flight": ("Longest flight", "no foot touches"),
    "clearance_largest": ("Clearance", "lowest point of the highest foot, over the undisturbed surface"),
    "sinkage_largest": ("Sinkage", "largest of any foot"),
    "largest_force": ("Largest force", "of the ground"),
}
"""Number of the answer -> its label and note."""
UNKNOWN, ONE_BED, NO_GRAINS = "not known", "one bed", "no grains"


def answer_tiles(result: Mapping[str, Any]) -> list[Tile]:
    """Rows of the table at the top of a report, each with its errors in words.

    Of chance: half of the 95 % interval over several beds, "one bed" on one, and on a law the range that its numbers
    leave open. Of grain size, and of bed, softness and speed: no run of a robot has them.
    """
    quantities, sure, several = result["quantities"], result.get("sure") or {}, "beds" in result
    on_grains = several or "grains" in result or result.get("ground") == "bed"
    size = UNKNOWN if on_grains else NO_GRAINS
    reached = (result.get("feet_reached") or {}).values()
    found = dict(quantities)
    if "clearance_largest" not in quantities and reached:  # of several feet each has its own
        highest = max(foot["clearance_largest"] for foot in reached)
        found["clearance_largest"] = {"value": highest, "std": None, "unit": "m"}
    rows = []
    for name, (label, note) in LABELS.items():
        if name not in found:  # a folder of an older hedgebed
            continue
        value, one = quantity(found[name]), sure.get(name)
        chance = ONE_BED if on_grains else UNKNOWN
        if one is not None and several:
            value = quote(one["value"], one["high"] - one["value"], one["unit"])
            chance = "" if "±" in value else "0"  # `vis.page.answer` takes it from the value
        elif one is not None:
            chance = between(one["low"], one["high"], one["unit"])
        rows.append(Tile(label, value, note, errors=(chance, size, UNKNOWN)))
    note = "largest of all beds, of all there was" if several else "of all there was"
    return [*rows, Tile("Energy left over", quantity(quantities["energy_residual"]), note)]
