"""What the runs of a sweep say beside their numbers: 95 % intervals, and warnings, each kind once."""

import re
from collections.abc import Mapping, Sequence
from typing import Any

from vis.penetrate.errors import in_95

__all__ = ["KIND_OF_INTERVAL", "MOST_WARNINGS", "ends_of", "warnings_of"]

MOST_WARNINGS = 8
"""Kinds of warnings that a sweep shows."""
KIND_OF_INTERVAL = {"penetrate": "95 % by chance", "converge": "95 %, all known errors"}
"""Experiment -> what its intervals contain."""
_NUMBER = re.compile(r"[-−]?\d+(?:[.,]\d+)*(?:e[-+]?\d+)?")
Ends = tuple[float, float]


def ends_of(result: Mapping[str, Any]) -> dict[str, Ends]:
    """Quantity -> both ends of its 95 % interval in SI units, of those whose interval the run has.

    Of `penetrate` the interval by chance: over the beds, of one bed that of kept beds where the run states it. Of
    `converge` the interval of all errors that it knows.
    """
    found: dict[str, Ends] = {}
    if result.get("experiment") == "penetrate":
        for name, entry in in_95(result).items():
            if entry.get("std") and entry.get("value") is not None:
                found[name] = (entry["value"] - entry["std"], entry["value"] + entry["std"])
        for name, sure in result.get("sure", {}).items():
            if sure.get("chance") is not None:
                found[name] = (float(sure["chance"][0]), float(sure["chance"][1]))
    elif result.get("experiment") == "converge":
        for name, entry in result["quantities"].items():
            if entry.get("value") is not None and (half := entry.get("total") or entry.get("chance")):
                found[name] = (entry["value"] - half, entry["value"] + half)
    return found


def warnings_of(results: Sequence[Mapping[str, Any]]) -> list[str]:
    """Each kind of warning of the runs once, with the number of runs that have it; the most frequent ones first.

    Warnings that differ in their numbers alone are of one kind.
    """
    kinds: dict[str, tuple[str, int, bool]] = {}
    for result in results:
        own = {_NUMBER.sub("#", text): text for text in result.get("warnings", [])}
        for kind, text in own.items():
            first, count, same = kinds.get(kind, (text, 0, True))
            kinds[kind] = (first, count + 1, same and text == first)
    ranked = sorted(kinds.values(), key=lambda one: -one[1])
    told = [
        f"in {count} of {len(results)} runs{'' if same else ' (numbers of the first)'}: {text}"
        for text, count, same in ranked[:MOST_WARNINGS]
    ]
    if more := len(ranked) - len(told):
        told.append(f"{more} more kinds of warnings are in result.json of the runs, under members/")
    return told
