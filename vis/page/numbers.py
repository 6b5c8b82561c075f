"""Numbers as a person would quote them: sensible digits, units with a prefix that fits, uncertainties.

quote(92.31, 4.2, "N/m") == "92 ± 4 N/m"
quote(0.00215, 0.00012, "m") == "2.15 ± 0.12 mm"
quote(0.231, 0.02, "%") == "23.1 ± 2.0 %"

Forces stay in newtons, as they are given: what is compared in one sentence has one unit.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from typing import Any

from rigid.intervals import half_of

__all__ = [
    "beside",
    "between",
    "column",
    "digits_for",
    "fitted",
    "foldable",
    "in_one_unit",
    "in_two_digits",
    "plain",
    "quantity",
    "quote",
    "scale_of",
    "short",
    "split_spread",
    "typeset",
    "with_squares",
    "within",
]

_PREFIXES = ((1e9, "G"), (1e6, "M"), (1e3, "k"), (1.0, ""), (1e-3, "m"), (1e-6, "µ"), (1e-9, "n"))
_SCALED = {"J", "s", "Pa", "W", "kg"}
_AS_THEY_ARE = {
    "1": (1.0, ""), "%": (0.01, "%"), "m/s2": (1.0, "m/s²"), "m/s^2": (1.0, "m/s²"), "kg/m3": (1.0, "kg/m³"),
    "N s/m": (1.0, "N\N{NO-BREAK SPACE}s/m"),
}  # fmt: skip
_SPREAD = re.compile(r"^(?P<mean>[^±]+?)\s±\s(?P<error>\S+)(?P<unit>\s.*)?$")
_RAISED = str.maketrans("0123456789-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻")
_POWER = re.compile(r"(?<=[/\[])(m|s)([23])\b|\^(\d)")
_MINUS, _SPACE = "\N{MINUS SIGN}", "\N{NO-BREAK SPACE}"


def digits_for(std: float) -> int:
    """Decimals at which a number with this uncertainty is quoted: two digits of it below 3.55 (or 35.5), else one.

    The rule of the Particle Data Group (Review of Particle Physics, introduction, 5.3): it changes an error by 13 % at
    most. 0.97 has the digits of 1.0.
    """
    exponent = math.floor(math.log10(std))
    return -exponent + (1 if std / 10.0**exponent < 3.55 else 0)


def _two_digits(std: float) -> int:
    """Decimals at which an uncertainty has two digits: 0.75 ± 1.6 is 0.8 ± 1.6, not 1 ± 2."""
    return 1 - math.floor(math.log10(std))


def beside(value: float, std: float | None) -> str:
    """A number as tables show it next to a column of its standard error: to the digits that `std` allows.

    Of a number smaller than its error as many digits as the error is shown with, two: 0.3749 ± 2.39 is 0.4, not 0.
    ``std``: None where unknown, 0 for what is exact; then four digits.
    """
    if not std or not math.isfinite(std) or not math.isfinite(value):
        return short(value)
    decimals = digits_for(std) if abs(value) >= std else _two_digits(std)
    return f"{value:.{max(decimals, 0)}f}" if decimals <= 9 else short(value)


def plain(value: float, significant: int = 3) -> str:
    """A number without a unit: `significant` digits, whole numbers from 1000 up with spaces between thousands."""
    if not math.isfinite(value):
        return "not a number" if math.isnan(value) else f"{_MINUS if value < 0 else ''}\N{INFINITY}"
    if value == 0.0:
        return "0"
    rounded = float(f"{value:.{significant - 1}e}")  # 0.9997 has the digits of 1.00
    exponent = math.floor(math.log10(abs(rounded)))
    if exponent >= 9 or exponent < -4:
        mantissa, power = f"{value:.{significant - 1}e}".split("e")
        return f"{mantissa.replace('-', _MINUS)}\N{MULTIPLICATION SIGN}10{str(int(power)).translate(_RAISED)}"
    return _fixed(value, max(0, significant - 1 - exponent))


def short(value: float, significant: int = 4) -> str:
    """A number that is exact, without zeros at its end: 3.6, 20, 0.072."""
    return f"{value:.{significant}g}".replace("-", _MINUS) if math.isfinite(value) else plain(value)


def column(
    values: Sequence[float | None], unit: str, *, significant: int = 3, exact: bool = False
) -> tuple[str, list[str]]:
    """Numbers of a table's column in one unit, that of `scale_of`: the unit and the numbers.

    What is None or not finite is shown as a dash. ``exact``: Whether they are without zeros at their ends, as what was
    chosen is.
    """
    scale, shown = scale_of(values, unit)
    dash = "\N{EN DASH}"
    return shown, [
        dash if value is None or not math.isfinite(value) else (short if exact else plain)(value / scale, significant)
        for value in values
    ]


def scale_of(values: Sequence[float | None], unit: str) -> tuple[float, str]:
    """The unit in which readers see these numbers: how many SI units it is, and its name, such as (1e-3, "mm").

    Angles are in degrees; elsewhere the largest finite number sets the prefix. "1" has no name.
    """
    if unit == "rad":
        return math.pi / 180, "degrees"
    known = (abs(value) for value in values if value is not None and math.isfinite(value))
    return _scale(max(known, default=1.0), unit)


def quote(value: float | None, std: float | None = None, unit: str = "1", *, significant: int = 3) -> str:
    """A number with its uncertainty and unit.

    ``value``: The number in SI; None reads "unknown". ``std``: Its standard deviation; 0 for what is exact, None where
    unknown: neither is shown, nor is one below a ten-thousandth of the value. ``unit``: An SI unit; "1" for none, "%"
    for a share to be shown in per cent. ``significant``: Digits where the uncertainty does not set them.
    """
    if value is None:
        return "unknown"
    if std and std < 1e-4 * abs(value):
        std = None
    if std is None and 0 < significant < 3 and math.isfinite(value) and not (unit == "1" and float(value).is_integer()):
        value = float(f"{value:.{significant - 1}e}")  # also before the point: 549 is 550
    scale, shown = _scale(value, unit)
    if unit == "1" and float(value).is_integer() and not std:
        return _fixed(value, 0)
    if std == 0.0 and math.isfinite(value) and abs(value / scale) < 1e4:
        text = short(value / scale)
    elif std is None or std == 0.0 or not math.isfinite(std) or not math.isfinite(value):
        text = plain(value / scale, significant)
    else:
        decimals = digits_for(std / scale) if abs(value) >= std else _two_digits(std / scale)
        text = f"{_fixed(value / scale, decimals)}{_SPACE}±{_SPACE}{_fixed(std / scale, decimals)}"
    return f"{text}{_SPACE}{shown}" if shown else text


def fitted(entry: Mapping[str, Any], *, significant: int = 3) -> str:
    """A fitted number with half of its 95 % interval and its unit.

    ``entry``: `{"value", "std", "unit"}` with the standard error ``std``, None where there is none, and maybe its
    ``freedom`` (`rigid.intervals.half_of`). ``significant``: Digits where no error sets them.
    """
    return quote(entry["value"], half_of(entry), str(entry.get("unit") or "1"), significant=significant)


def between(low: float, high: float, unit: str) -> str:
    """Two ends of an interval in SI units, with two digits each and the unit of the upper: "0 to 7.3 mm".

    A lower end less than a thousandth of the upper below 0 is 0.
    """
    if -1e-3 * high < low < 0:
        low = 0.0
    top = quote(high, None, unit, significant=2)
    scale = _scale(float(f"{high:.1e}"), unit)[0]
    bottom = f"{float(f'{low / scale:.2g}'):g}".replace("-", _MINUS) if low else "0"
    number = top.split(_SPACE)[0]
    same = low and float(bottom.replace(_MINUS, "-")) == float(number.replace(_MINUS, "-"))
    return f"{number if same else bottom} to {top}"


def in_one_unit(values: Sequence[float], unit: str, *, widest: Sequence[float]) -> list[str]:
    """Numbers in SI units, each with the unit in which the largest of `widest` is shown, to three digits of that."""
    largest = max(map(abs, widest))
    scale, shown = _scale(float(f"{largest:.1e}"), unit)
    decimals = max(0, 2 - math.floor(math.log10(largest / scale))) if largest else 0
    texts = (_fixed(value / scale, decimals) for value in values)
    return [f"{text}{_SPACE}{shown}".strip() for text in texts]


def within(low: float, high: float, unit: str) -> str:
    """Two ends as `between`, or "below 7.3 mm" where the lower one is 0, the least that such a number can be."""
    return f"below {quote(high, None, unit, significant=2)}" if low == 0 else between(low, high, unit)


def split_spread(text: str) -> tuple[str, str]:
    """The number of "66 ± 13 N/m" and its spread, both with the unit; an empty spread where there is none."""
    found = _SPREAD.match(text)
    if not found:
        return text, ""
    unit = found["unit"] or ""
    if found["error"].endswith("°") and not found["mean"].endswith("°"):
        return found["mean"] + "°", found["error"]
    return found["mean"] + unit, found["error"] + unit


def foldable(text: str) -> str:
    """With plain spaces for those that do not break, which a terminal cannot fold."""
    return text.replace(_SPACE, " ")


def typeset(words: str) -> str:
    """Words of a title or an axis as a picture has them: typeset("F / (rho g D^3) at 9.81 m/s2") has ρ, D³ and m/s²."""
    raised = _POWER.sub(lambda found: (found[1] or "") + (found[2] or found[3]).translate(_RAISED), words)
    return re.sub(r"\brho\b", "ρ", raised)


def with_squares(words: str) -> str:
    """A sentence with the units m/s² and kg/m³ of its numbers as figures have them, in place of m/s2 and kg/m3."""
    return re.sub(r"(?<=\d[ \N{NO-BREAK SPACE}])(m/s2|kg/m3)\b", lambda found: _AS_THEY_ARE[found[1]][1], words)


def quantity(entry: Any, *, unit: str | None = None, significant: int | None = None) -> str:
    """A quantity of result.json, `{"value", "std", "unit"}` or a bare number; "unknown" where it is missing.

    ``entry``: The quantity. ``unit``: In place of its own unit, such as "%" for a share. ``significant``: Digits where
    the uncertainty does not set them. By default two where that is unknown (a std of null): more would claim what no
    one knows.
    """
    if isinstance(entry, Mapping):
        value, std, own = entry.get("value"), entry.get("std"), str(entry.get("unit") or "1")
        significant = significant or (2 if std is None and "std" in entry else 3)
    else:
        value, std, own = entry, None, "1"
    if isinstance(value, bool) or not isinstance(value, int | float):
        return "unknown" if value is None else str(value)
    return quote(value, std if isinstance(std, int | float) else None, unit or own, significant=significant or 3)


def in_two_digits(entry: Mapping[str, Any]) -> str:
    """A quantity of result.json with two digits of its value and of its std, also where the std is the larger one.

    Without a value: "not known".
    """
    if entry["value"] is None:
        return "not known"
    scale, shown = _scale(entry["value"], entry["unit"])
    value, std = (plain(entry[key] / scale, 2) for key in ("value", "std"))
    return f"{value}{_SPACE}±{_SPACE}{std}{_SPACE}{shown}"


def _scale(value: float, unit: str) -> tuple[float, str]:
    """The unit that a number is shown in: how many SI units it is, and its sign."""
    if unit in _AS_THEY_ARE:
        return _AS_THEY_ARE[unit]
    if unit == "m":
        return (1e-3, "mm") if abs(value) < 1.0 else (1.0, "m")
    if unit not in _SCALED or value == 0.0 or not math.isfinite(value):
        return 1.0, unit
    if unit == "kg":
        return (1e-3, "g") if abs(value) < 1.0 else (1.0, "kg")
    return next(((factor, prefix + unit) for factor, prefix in _PREFIXES if abs(value) >= 0.9995 * factor), (1.0, unit))


def _fixed(value: float, decimals: int) -> str:
    rounded = round(value, decimals)
    if rounded == 0.0:
        rounded = 0.0  # no minus zero
    text = f"{rounded:,.{max(0, decimals)}f}".replace("-", _MINUS)
    return text.replace(",", _SPACE) if abs(rounded) >= 10000.0 else text.replace(",", "")
