"""Headers of CSV files that other programs wrote: what to rename so that a column is the one that a campaign needs."""

import re
from collections.abc import Iterable, Sequence

__all__ = ["missing_columns"]

_WORDS = {
    "t": ("t", "time"),
    "depth": ("depth", "displacement", "penetration", "z"),
    "force": ("f", "force", "load"),
    "accel": ("a", "accel", "acceleration"),
}
"""Quantity of the format -> words for it, in lower case."""
_UNITS = {"m/s2": "m_s2", "m/s^2": "m_s2", "m/s²": "m_s2"}
"""Unit as other programs write it -> as the format does."""
_NAMED = re.compile(r"\s*([A-Za-z]+)[ _]*[\[(]?([A-Za-z][A-Za-z0-9/^²_]*)[\])]?\s*")
_TIME_OF_A_PUSH = (
    ". A push at one constant speed has the time depth / speed: add the column t_s = depth_m / speed, the speed in m/s"
)


def missing_columns(header: Sequence[str], missing: Sequence[tuple[str, Iterable[str]]]) -> str:
    """That columns are missing, what there is instead, and what to rename where it can be recognised.

    ``missing``: Quantities that have no column, each with the units that it may have.
    """
    wanted = [(name, [f"{name}_{unit}" for unit in units]) for name, units in missing]
    listed = ", ".join(" or ".join(columns) for _, columns in wanted)
    held = ", ".join(column for column in header if column)
    found = [_alike(header, name, columns) for name, columns in wanted]
    renamed = [f"{old} to {new}" for old, new in filter(None, found)]
    several = len(wanted) > 1
    said = f"column{'s' if several else ''} {listed} {'are' if several else 'is'} missing; found {held}"
    said += f"; rename {', '.join(renamed)}" if renamed else ""
    unrenamed = any(name == "t" and pair is None for (name, _), pair in zip(wanted, found, strict=True))
    pushed = unrenamed and any(column.lower().startswith("depth") for column in header)
    return said + (_TIME_OF_A_PUSH if pushed else "")


def _alike(header: Sequence[str], name: str, columns: Sequence[str]) -> tuple[str, str] | None:
    """The only column that is this quantity in a unit of the format by its words, and its name in the format."""
    found = []
    for column in header:
        if (parts := _NAMED.fullmatch(column)) and parts[1].lower() in _WORDS.get(name, ()):
            new = f"{name}_{_UNITS.get(parts[2], parts[2])}"
            found += [(column, new)] if new in columns else []
    return found[0] if len(found) == 1 else None
