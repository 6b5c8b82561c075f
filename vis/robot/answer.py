"""The answer of a robot's run: at most six numbers with their errors, in the words of report and terminal."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from vis.page.numbers import between, quantity, quote
from vis.page.page import Tile

__all__ = ["BALLISTIC", "answer_tiles"]

LABELS = {
    "highest": ("Rise", "of the centre of mass after the first touch, over its start"),
    "longest_flight": ("Longest flight", "no foot touches"),
    "clearance_largest": ("Clearance", "lowest point of the highest foot, over the undisturbed surface"),
    "sinkage_largest": ("Sinkage", "largest of any foot"),
    "largest_force": ("Largest force", "of the ground"),
}
"""Number of the answer -> its label and note."""
BALLISTIC = {
    "highest": "rise_ballistic", "longest_flight": "flight_ballistic", "clearance_largest": "clearance_ballistic",
}  # fmt: skip
"""Number of the answer -> the quantity in its place where the end of the run cuts off a flight."""
FROM_LOWEST = ("Rise from its lowest point", "of the centre of mass, after the first touch")
DISTANCE = ("Distance of the hop", "of the centre of mass along the ground, longest flight")
NO_HOP, STAYED = "none", "it did not leave the ground"
SO_FAR = "up to the end of the run, where it is on its way up"
OF_FLIGHT = "ballistic: the flight at the end of the run, continued without the ground"
UNKNOWN, ONE_BED = "not known", "one bed"


def answer_tiles(result: Mapping[str, Any]) -> list[Tile]:
    """Rows of the table at the top of a report, each with its errors in words.

    Of chance: half of the 95 % interval over several beds, "one bed" on one, and on a law the range that its numbers
    leave open. Of grain size: a law has none. The third is the range over the laws of sand, on grains with them. Where
    there are no laws beside grains it is of bed, softness and speed, which no run of a robot has.
    """
    quantities, sure, several = result["quantities"], result.get("sure") or {}, "beds" in result
    on_grains = several or "grains" in result or result.get("ground") == "bed"
    forms = (result.get("forms") or {}).get("ranges") or {}
    ballistic = result.get("ballistic") or any(name in quantities for name in BALLISTIC.values())
    reached = (result.get("feet_reached") or {}).values()
    found = dict(quantities)
    if "clearance_largest" not in quantities and reached:  # of several feet each has its own
        highest = max(foot["clearance_largest"] for foot in reached)
        found["clearance_largest"] = {"value": highest, "std": None, "unit": "m"}
    hop, rising = result.get("hop", True), result.get("rising", False)  # an older hedgebed has neither
    rows = []
    along = (quantities.get("hop_distance") or {}).get("value") is not None
    for name, (label, note) in _labels(hop=hop, several=len(reached) > 1, along=along).items():
        if name not in found:  # a folder of an older hedgebed
            continue
        if rising and name in BALLISTIC:
            label, note = f"{label}, so far", SO_FAR
        if ballistic and name in BALLISTIC:
            label, note = f"{label}, ballistic", OF_FLIGHT
        value, one = quantity(found.get(BALLISTIC.get(name, name), found[name])), sure.get(name)
        chance, third = (ONE_BED if on_grains else ""), UNKNOWN
        if name in forms:
            third = between(forms[name]["low"], forms[name]["high"], forms[name]["unit"])
        if one is not None and several:
            value = quote(one["value"], one["high"] - one["value"], one["unit"])
            chance = "" if "±" in value else "0"  # `vis.page.answer` takes it from the value
        elif one is not None:
            chance = between(one["low"], one["high"], one["unit"])
        if name == "highest" and not hop:
            value, note, chance = NO_HOP, STAYED, chance or ("0" if several else "")
        rows.append(Tile(label, value, note, errors=(chance, UNKNOWN if on_grains else "", third)))
    note = "largest of all beds, of all there was" if several else "of all there was"
    return [*rows, Tile("Energy error", quantity(quantities["energy_residual"]), note)]


def _labels(*, hop: bool, several: bool, along: bool) -> dict[str, tuple[str, str]]:
    """`LABELS`; without a hop the rise from the lowest point is in place of the clearance of a single foot.

    A robot of several feet may lift one while it stands on others: there it is in place of the flight. ``along``: a hop
    has a distance, which is in place of the clearance.
    """
    if hop and along:
        found = {name: words for name, words in LABELS.items() if name != "clearance_largest"}
        return {"highest": found.pop("highest"), "hop_distance": DISTANCE, **found}
    if hop:
        return LABELS
    left_out = "longest_flight" if several else "clearance_largest"
    found = {name: words for name, words in LABELS.items() if name != left_out}
    return {"highest": found.pop("highest"), "rise_from_lowest": FROM_LOWEST, **found}
