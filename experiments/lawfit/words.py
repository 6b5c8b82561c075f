"""Tables and sentences of a comparison of laws."""

from collections.abc import Mapping, Sequence

from experiments.runs.types import Json

from .data import Data
from .settings import LawFitSettings, say

__all__ = ["closing", "law_rows", "ranked"]

ALIKE = 1.1
"""Held-out errors that differ by less than this factor are called alike [1]."""
CLEAR = 10.0
"""Difference of the information criterion from which on a law is clearly the better one (Burnham and Anderson,
Sociological Methods and Research 33 (2004), 261)."""


def ranked(laws: Sequence[Json]) -> list[Json]:
    """The laws, best first: by held-out error, and those that are alike there (`ALIKE`) by information criterion.

    A held-out error holds the scatter of the beds as well, in which laws that differ clearly may look alike.
    """
    least = min(law["held_out"]["beds"] for law in laws)

    def place(law: Json) -> tuple[bool, float]:
        alike = law["held_out"]["beds"] < ALIKE * least
        return not alike, law["information"] if alike else law["held_out"]["beds"]

    return sorted(laws, key=place)


def law_rows(laws: Sequence[Json]) -> Json:
    """Head and rows of the table of laws, in the order of their held-out error."""
    least = min(law["information"] for law in laws)
    rows = []
    for law in laws:
        other = law["held_out"]["speeds"]
        sunk = ", ".join(f"{100 * one['error']:+.3g} %" for one in law["sinkage"]) or "-"
        rows.append([
            law["name"], f"{100 * law['held_out']['beds']:.3g} %", "-" if other is None else f"{100 * other:.3g} %",
            f"{law['information'] - least:.1f}", sunk,
        ])  # fmt: skip
    head = ["law", "force, other beds", "force, other speeds", "AICc less the least", "sinkage"]
    return {"head": head, "rows": rows}


def closing(settings: LawFitSettings, data: Data, laws: Mapping[str, Json], best: str) -> list[str]:
    """What a reviewer asks: where the spring-damper holds, how wrong it is beyond, which law is better."""
    pair, winner = laws["spring-damper"], laws[best]
    said = [say("holds", where=text) for text in _where(settings, pair)]
    if pair["sinkage_range"] is not None:
        low, high = pair["sinkage_range"]
        said.append(say("sinkage_holds", percent=100 * settings.sinkage_error, low=low, high=high))
    said += [_of_sinkage(one) for one in pair["sinkage"]]
    own, theirs = (law["held_out"]["beds"] for law in (pair, winner))
    numbers = {"best": best, "own": 100 * own, "theirs": 100 * theirs}
    less = pair["information"] - winner["information"]
    if winner is pair:
        said.append(say("pair_best", own=100 * own))
    elif own < ALIKE * theirs:
        said.append(say("alike" if less < CLEAR else "alike_but", less=less, **numbers))
    else:
        said.append(say("better", **numbers))
    return said


def _where(settings: LawFitSettings, pair: Json) -> list[str]:
    """For each speed where the pair is within the error, and its error at both ends of the depth."""
    texts = []
    for one in pair["within"]:
        ends = {"start": _off(one["at_start"]), "end": _off(one["at_end"])}
        depths = pair["map"]["depth"]
        shallow, deep = (f"{1e3 * depths[place]:.2g}" for place in (0, -1))
        percent = 100 * settings.force_error
        if one["high"] > one["low"]:
            low, high = 1e3 * one["low"], 1e3 * one["high"]
            texts.append(say("within", speed=one["speed"], percent=percent, low=low, high=high, shallow=shallow,
                             deep=deep, **ends))  # fmt: skip
        else:
            texts.append(say("nowhere", speed=one["speed"], percent=percent, shallow=shallow, deep=deep, **ends))
    return texts


def _off(error: float) -> str:
    return f"{100 * abs(error):.2g} % too {'stiff' if error > 0 else 'soft'}"


def _of_sinkage(one: Json) -> str:
    std = "" if one["beds_std"] is None else f" (std between beds {1e3 * one['beds_std']:.2g} mm)"
    return say("sinkage", one=one, beds=1e3 * one["beds"], law=1e3 * one["law"], std=std, error=100 * one["error"])
