"""Rows of an answer that a law gives: no chance, what its parameters leave open, what it was compared with."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

from rigid.intervals import NORMAL
from vis.page.limits import bias_of, kind_of, known_errors
from vis.page.numbers import digits_for, quote, short, split_spread
from vis.page.page import Tile
from vis.page.sentences import Sentences

__all__ = ["answer_rows", "cell_of", "law_row"]

say = Sentences(__package__)
ROUND_OFF = 1e-4
"""An angle below this is 0 in a table [degrees]: rounding leaves 1e-8 where a slip begins at once."""
_ABSENT = {"hop": "no_hop", "slip": "no_slip"}
"""End of the name of a number that a moved law does not have -> what the table says of it."""


def law_row(
    result: Mapping[str, Any], name: str, label: str, note: str = "", *, beside: str = "", law: bool = True
) -> Tile:
    """The row of a number of result.json with its errors in words; "none" for a number that there is not.

    `beside` names another number of the same row, such as the angle of a speed. `law`: whether the parameters of the
    law change the number.
    """
    entry = result["quantities"][name]
    if entry["value"] is None:
        return Tile(label, "none", note)
    names = [one for one in (name, beside) if one and result["quantities"][one]["value"] is not None]
    values, errors = zip(*(_with_error(result, one, law) for one in names), strict=True)
    value, error = (" at ".join(values), " at ".join(errors) if len(set(errors)) > 1 else errors[0])
    return Tile(label, value, note, errors=(say("no_chance"), error, bias_of(result, name) or say("not_validated")))


def answer_rows(
    result: Mapping[str, Any], rows: Mapping[str, tuple[str, str]], shown: Callable[[Mapping[str, Any]], str]
) -> list[Tile]:
    """The rows of a motion on a law or on grains; a folder of an older hedgebed has fewer.

    `rows`: number of result.json -> its label and note. `shown`: how a number on grains reads.
    """
    quantities, on_law = result["quantities"], kind_of(result) == "planar model"
    return [
        law_row(result, name, label, note) if on_law else _row_on_grains(result, name, label, note, shown)
        for name, (label, note) in rows.items()
        if name in quantities
    ]


def _row_on_grains(
    result: Mapping[str, Any], name: str, label: str, note: str, shown: Callable[[Mapping[str, Any]], str]
) -> Tile:
    """The row of a number of a motion on grains, with its errors as far as docs/limits.md has them."""
    entry = result["quantities"][name]
    value = shown(entry)
    if entry["value"] is None:
        return Tile(label, value, note)
    chance, *others = (error or say("not_known") for error in known_errors(result, name))
    return Tile(label, value, note, errors=("" if split_spread(value)[1] else chance, *others))


def cell_of(value: float | None, std: float | None, unit: str) -> str:
    """A number with its spread, where it has one; an angle in degrees, "none" for None.

    An angle is not rounded to tens: 66° ± 48°, beside 65.7 degrees in a sentence.
    """
    if value is None:
        return "none"
    if unit != "rad":
        return quote(value, std, unit, significant=3)
    if not std:
        degrees = math.degrees(value)
        return f"{short(degrees if abs(degrees) >= ROUND_OFF else 0.0, 3)}°"
    angle, half = math.degrees(value), math.degrees(std)
    text = quote(angle, half) if digits_for(half) >= 0 else f"{quote(round(angle))} ± {quote(round(half))}"
    return " ± ".join(f"{part.strip()}°" for part in text.split("±"))


def _with_error(result: Mapping[str, Any], name: str, law: bool) -> tuple[str, str]:
    """The value of a number, and half of the 95 % interval that the errors of the law's parameters give it."""
    entry = result["quantities"][name]
    std = entry.get("std") if law else None
    if std:
        value, error = split_spread(cell_of(entry["value"], NORMAL * std, entry["unit"]))
        if error:
            return value, error
    if law and (result.get("law_spread") or {}).get("beyond"):
        return cell_of(entry["value"], None, entry["unit"]), say("beyond_range")
    if law and name in (result.get("law_spread") or {}).get("absent", ()):
        last = name.split("_")[-1]
        return cell_of(entry["value"], None, entry["unit"]), say(_ABSENT.get(last, "not_there"))
    if std is not None and (result.get("law_spread") or {}).get("parameters"):
        return cell_of(entry["value"], None, entry["unit"]), cell_of(0.0, None, entry["unit"])
    return cell_of(entry["value"], None, entry["unit"]), say("not_known" if law else "no_chance")
