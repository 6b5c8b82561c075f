"""Which unit a recording may be in that reads so many times what its replicates do; said by name, nothing converted."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

__all__ = ["factor_words"]

Array = NDArray[np.float64]

_GRAVITY = 9.80665
_LENGTHS = {1e3: "mm", 100.0: "cm", 1 / 0.0254: "inches"}
_TURNS = {180 / math.pi: "degrees"}
_RATES = {180 / math.pi: "deg/s", 30 / math.pi: "rpm"}
_UNITS: dict[str, dict[float, str]] = {
    "force": {1e3: "mN", 1e-3: "kN", 1 / _GRAVITY: "kilograms of force", 1e3 / _GRAVITY: "grams of force",
              1 / 4.4482216152605: "pounds of force", _GRAVITY: "newtons times 9.81 once more"},
    "accel": {1 / _GRAVITY: "g", 1e3: "mm/s2", 100.0: "cm/s2", _GRAVITY: "m/s2 times 9.81 once more"},
    "depth": _LENGTHS, "x": _LENGTHS, "y": _LENGTHS, "theta": _TURNS, "gyro": _RATES,
    "wheel": _RATES | {1 / math.tau: "revolutions/s"},
}  # fmt: skip
_UNITS |= {"ax": _UNITS["accel"], "ay": _UNITS["accel"]}
"""Channel -> how many times too large a reading is that was taken in another unit."""
_NEAR = 0.02
"""Relative distance from such a factor; between 9.807 and 30/pi lie 2.7 %."""
_SHAPE = 0.1
"""Share of its size by which it may differ from its replicates times that factor: what is left is noise and beds."""


def factor_words(channel: str, own: Array, others: Sequence[Array]) -> str:
    """What to add to "at odds" where `own` is its replicates' curve, times a factor between two units; else nothing.

    Curves at the same places, shape [n], NaN where there is nothing.
    """
    usual = np.median(np.stack(list(others)), axis=0)
    good = np.isfinite(own) & np.isfinite(usual)
    a, b = own[good], usual[good]
    if len(a) < 8 or not a.any() or not b.any():
        return ""
    factor = float(a @ b) / float(b @ b)
    if factor <= 0 or float(np.linalg.norm(a - factor * b)) > _SHAPE * float(np.linalg.norm(a)):
        return ""
    for ratio, unit in _UNITS.get(channel, {}).items():
        if abs(factor / ratio - 1) < _NEAR:
            return f"; its {channel} is {factor:.4g} times theirs all along, as if it were in {unit}: is it?"
    return ""
