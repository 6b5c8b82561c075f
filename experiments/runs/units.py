"""Numbers with a unit: ``1e-3g``, ``16mm``, in a case file as text. Every setting that states its unit takes them.

The unit of a setting is the last one in brackets in its description: ``[m/s2]``, or a multiple, ``[9.80665 m/s2]``. A
number without a unit is in that unit. Any unit of the same kind may stand behind it, from `UNITS`.
"""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from rigid.platform.rig import STANDARD_GRAVITY

__all__ = ["UNITS", "Unit", "find_unit", "has_unit", "in_both"]

UNITS: Mapping[str, Mapping[str, float]] = {
    "acceleration": {
        "m/s2": 1.0, "m/s^2": 1.0, "m/s²": 1.0, "mm/s2": 1e-3, "g": STANDARD_GRAVITY, "mg": 1e-3 * STANDARD_GRAVITY,
        "ug": 1e-6 * STANDARD_GRAVITY, "µg": 1e-6 * STANDARD_GRAVITY,
    },
    "length": {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "µm": 1e-6},
    "speed": {"m/s": 1.0, "cm/s": 1e-2, "mm/s": 1e-3, "um/s": 1e-6, "µm/s": 1e-6},
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "min": 60.0, "h": 3600.0},
    "mass": {"kg": 1.0, "g": 1e-3, "mg": 1e-6},
    "force": {"N": 1.0, "mN": 1e-3, "uN": 1e-6, "µN": 1e-6, "kN": 1e3},
    "pressure": {"Pa": 1.0, "kPa": 1e3, "MPa": 1e6, "GPa": 1e9},
    "torque": {"N m": 1.0, "Nm": 1.0, "mN m": 1e-3, "mNm": 1e-3},
    "stiffness": {"N/m": 1.0, "kN/m": 1e3, "mN/m": 1e-3},
    "rate": {"Hz": 1.0, "kHz": 1e3},
}  # fmt: skip
"""Kind -> unit -> how many of the SI unit it is."""

_TYPED = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)(?![eE][+-]?\d)\s*([^\d\s.].*?)\s*")
_STATED = re.compile(r"(?:([0-9.]+) )?(\S.*)")


@dataclass(frozen=True)
class Unit:
    """The unit of a setting: its kind, and how many SI units one of it is."""

    kind: str
    factor: float

    def value_of(self, text: str) -> float:
        """The number that `text` means, in this unit.

        Raises ValueError: a unit that is missing or of another kind, with those that can be used.
        """
        found = _TYPED.fullmatch(text)
        if found is None:
            raise ValueError(f"{text!r} is not a valid number")
        known = UNITS[self.kind]
        if found[2] not in known:
            others = [kind for kind, units in UNITS.items() if found[2] in units]
            what = f"{found[2]!r} is a unit of {others[0]}" if others else f"{found[2]!r} is no unit that is known"
            raise ValueError(f"{what}: give {self.kind} in {', '.join(known)}, or a number without a unit")
        size = known[found[2]] / self.factor
        # 1e-3 g of a rig, whose unit is g, is 0.001 to the last bit.
        return float(found[1]) * (1.0 if abs(size - 1.0) < 1e-12 else size)


def has_unit(text: str) -> bool:
    """Whether `text` is a number with something behind it, as a unit is."""
    return _TYPED.fullmatch(text) is not None


def find_unit(description: str | None) -> Unit | None:
    """The unit that the description of a setting states; None where it states none of `UNITS`."""
    for stated in reversed(re.findall(r"\[([^\[\]]+)\]", description or "")):
        found = _STATED.fullmatch(stated)
        for kind, units in UNITS.items():
            if found and found[2] in units:
                return Unit(kind, float(found[1] or 1.0) * units[found[2]])
    return None


def in_both(name: str, value: Any, unit: Unit | None) -> Iterator[str]:
    """What numbers of gravity mean in m/s2 and in g, a sentence each; of other settings nothing."""
    if unit is None or unit.kind != "acceleration":
        return
    for number in value if isinstance(value, list | tuple) else (value,):
        if isinstance(number, int | float) and not isinstance(number, bool):
            si = number * unit.factor
            yield f"{name}: {si:.4g} m/s2, which is {si / STANDARD_GRAVITY:.4g} g"
