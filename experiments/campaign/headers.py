"""Headers of CSV files that other programs wrote: which column is which quantity of a campaign, and in which unit."""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches

__all__ = ["READ_UNITS", "Column", "column_of", "missing_columns"]

READ_UNITS: Mapping[str, tuple[str, ...]] = {
    "t": ("s", "ms"), "depth": ("m", "mm"), "force": ("N", "mN"), "accel": ("m_s2", "g"),
}  # fmt: skip
"""Quantity of pushes and drops -> units in which its column may be."""
_WORDS = {
    "t": ("t", "time", "elapsed", "timestamp", "zeit", "temps"),
    "depth": ("depth", "displacement", "penetration", "z", "sinkage", "position", "travel", "stroke", "extension"),
    "force": ("f", "fz", "force", "load", "loadcell", "kraft"),
    "accel": ("a", "az", "accel", "acceleration"),
}
"""Quantity of the format -> words for it, in lower case."""
_UNITS = {
    "m/s2": "m_s2", "m/s^2": "m_s2", "m/s²": "m_s2", "m/s/s": "m_s2", "sec": "s", "secs": "s", "second": "s",
    "seconds": "s", "msec": "ms", "millisecond": "ms", "milliseconds": "ms", "millimeter": "mm", "millimeters": "mm",
    "millimetre": "mm", "millimetres": "mm", "meter": "m", "meters": "m", "metre": "m", "metres": "m",
    "newton": "N", "newtons": "N", "millinewton": "mN", "millinewtons": "mN",
}  # fmt: skip
"""Unit as other programs write it -> as the format does."""
_NOT_READ = ("cm", "um", "µm", "μm", "in", "inch", "kN", "lbf", "kgf", "gf", "min", "us", "µs", "μs", "V", "mV")
_SUFFIXES = sorted({unit for units in READ_UNITS.values() for unit in units} | {*_UNITS, *_NOT_READ}, key=len)[::-1]
_BRACKETS = re.compile(r"\s*(.*?)[\s_]*[\[(]\s*([^\])]*?)\s*[\])]\s*")
_CLOSE, _LONG = 0.84, 5  # how alike a misspelt word must be (difflib), and its fewest letters
_TIME_OF_A_PUSH = (
    ". A push at one constant speed has the time depth / speed: add the column t_s = depth_m / speed, the speed in m/s"
)


@dataclass(frozen=True)
class Column:
    """What a heading says of its column."""

    quantity: str  # "t", "depth", "force" or "accel"; empty where its words are of none, or of several
    unit: str  # as the format writes it; empty where the heading has none

    @property
    def name(self) -> str:
        """The heading by the format; empty where quantity or unit are unknown, or the unit is not read."""
        return f"{self.quantity}_{self.unit}" if self.unit in READ_UNITS.get(self.quantity, ()) else ""


def column_of(heading: str) -> Column:
    """Quantity and unit of a heading such as ``force [N]``, ``z_mm``, ``Load cell (kN)`` or ``Time, s``."""
    words, unit = _parted(heading.strip())
    names = [word.lower() for word in re.findall(r"[A-Za-z]+", words)]
    found = {quantity for quantity, known in _WORDS.items() if any(_is_of(name, known) for name in names)}
    return Column(found.pop() if len(found) == 1 else "", _UNITS.get(unit.lower(), unit))


def _parted(heading: str) -> tuple[str, str]:
    """The words of a heading, and its unit: in brackets, or behind a comma, a stroke, a blank or an underscore."""
    if found := _BRACKETS.fullmatch(heading):
        return found[1], found[2]
    for unit in _SUFFIXES:
        words = heading.removesuffix(unit)
        if words != heading and words.rstrip(" _,/") != words and words.rstrip(" _,/"):
            return words.rstrip(" _,/"), unit
    return heading, ""


def _is_of(word: str, known: Sequence[str]) -> bool:
    return word in known or (len(word) >= _LONG and bool(get_close_matches(word, known, 1, _CLOSE)))


def missing_columns(header: Sequence[str], missing: Sequence[tuple[str, Iterable[str]]]) -> str:
    """That columns are missing, what there is instead, and what to rename where it can be recognised.

    ``missing``: Quantities that have no column, each with the units that it may have.
    """
    wanted = [(name, [f"{name}_{unit}" for unit in units]) for name, units in missing]
    listed = ", ".join(" or ".join(columns) for _, columns in wanted)
    held = ", ".join(column for column in header if column)
    found = [_alike(header, columns) for _, columns in wanted]
    renamed = [f"{old} to {new}" for old, new in filter(None, found)]
    several = len(wanted) > 1
    said = f"column{'s' if several else ''} {listed} {'are' if several else 'is'} missing; found {held}"
    said += f"; rename {', '.join(renamed)}" if renamed else ""
    unrenamed = any(name == "t" and pair is None for (name, _), pair in zip(wanted, found, strict=True))
    pushed = unrenamed and any(column.lower().startswith("depth") for column in header)
    return said + (_TIME_OF_A_PUSH if pushed else "")


def _alike(header: Sequence[str], columns: Sequence[str]) -> tuple[str, str] | None:
    """The only column that is this quantity in a unit of the format by its words, and its name in the format."""
    found = [(column, new) for column in header if (new := column_of(column).name) in columns]
    return found[0] if len(found) == 1 else None
