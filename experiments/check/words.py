"""The findings of odd recordings: a channel and a sentence, and what a ratio of two units means."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from experiments.campaign.tables import DepthSensor
from rigid.platform.rig import STANDARD_GRAVITY
from vis.page.sentences import Sentences

__all__ = ["OFF", "ZERO", "Array", "Finding", "Odd", "factor_words", "oddity", "row_noise", "say", "std_of", "times",
           "unit_words"]  # fmt: skip

Array = NDArray[np.float64]
say = Sentences(__package__)
OFF = 6.0  # standard errors by which a zero or a speed must be off
ZERO = 5.0  # and standard deviations of the sensor
_NEAR = 0.15  # relative distance within which a ratio counts as that of two units
_RATIOS = {
    -1.0: "the sign is reversed",
    180 / math.pi: "it looks like degrees under a heading in radians",
    math.pi / 180: "it looks like radians under a heading in degrees",
    30 / math.pi: "it looks like revolutions per minute under a heading in rad_s",
    1e3: "it looks like thousandths under a heading without them",
}
_RATIOS_OF_ACCELERATION = _RATIOS | {1 / STANDARD_GRAVITY: "it looks like units of g under a heading in m_s2"}

_LENGTHS = {1e3: "mm", 100.0: "cm", 1 / 0.0254: "inches"}
_TURNED = {180 / math.pi: "degrees"}
_RATES = {180 / math.pi: "deg/s", 30 / math.pi: "rpm"}
_READ_IN: dict[str, dict[float, str]] = {
    "force": {1e3: "mN", 1e-3: "kN", 1 / STANDARD_GRAVITY: "kilograms of force",
              1e3 / STANDARD_GRAVITY: "grams of force",
              1 / 4.4482216152605: "pounds of force", STANDARD_GRAVITY: "newtons times 9.81 once more"},
    "accel": {1 / STANDARD_GRAVITY: "g", 1e3: "mm/s2", 100.0: "cm/s2", STANDARD_GRAVITY: "m/s2 times 9.81 once more"},
    "depth": _LENGTHS, "x": _LENGTHS, "y": _LENGTHS, "theta": _TURNED, "gyro": _RATES,
    "wheel": _RATES | {1 / math.tau: "revolutions/s"},
}  # fmt: skip
_READ_IN |= {"ax": _READ_IN["accel"], "ay": _READ_IN["accel"]}
"""Channel -> how many times too large a reading is that was taken in another unit."""
_NEXT_TO = 0.02  # relative distance from such a factor; between 9.807 and 30/pi lie 2.7 %
_SHAPE = 0.1  # share of its size by which a curve may differ from its replicates times such a factor


@dataclass(frozen=True, kw_only=True)
class Finding:
    """Something wrong with the data that was found, and what was done."""

    trial: str
    what: str  # one plain sentence, which also says what was done: set aside, modelled, or kept
    channel: str | None = None
    from_s: float | None = None
    to_s: float | None = None
    set_aside: bool = False
    doubt: bool = False
    """Whether a person has to put it right before a name can be trusted: a unit, a sign, a zero, a clock."""
    maybe_effect: bool = False
    """Whether an effect of the library does the same, so that it need not be a fault of the file."""


class Odd(NamedTuple):
    """One implausible thing."""

    channel: str
    what: str
    maybe_effect: bool = False  # as of a `Finding`


def oddity(channel: str, key: str, /, **values: object) -> Odd:
    """A sentence of the package's file."""
    return Odd(channel, say(key, **values))


def unit_words(ratio: float, *, is_acceleration: bool = False) -> str | None:
    """What a ratio of measured over expected means; None for one that means nothing. Only accelerations are in g."""
    known_ratios = _RATIOS_OF_ACCELERATION if is_acceleration else _RATIOS
    return next((words for known, words in known_ratios.items() if abs(ratio / known - 1) < _NEAR), None)


def times(ratio: float) -> str:
    """24 times, 2.5 times."""
    return f"{ratio:.0f} times" if ratio >= 10 else f"{ratio:.2g} times"


def row_noise(values: Array) -> float:
    """Noise of neighbouring readings, by the median of their fourth differences; `values`: without gaps, shape [n]."""
    return float(np.median(np.abs(np.diff(values, 4)))) / 0.6745 / math.sqrt(70)


def std_of(sensor: DepthSensor | None) -> float:
    """The first std of a table of [sensors]; 0 without one."""
    return 0.0 if sensor is None else float(sensor.std[0])


def factor_words(channel: str, own: Array, others: Sequence[Array]) -> str:
    """What to add to "at odds" where `own` is its replicates' curve, times a factor between two units; else nothing.
    Curves at the same places, shape [n], NaN in gaps."""
    usual = np.median(np.stack(list(others)), axis=0)
    good = np.isfinite(own) & np.isfinite(usual)
    a, b = own[good], usual[good]
    if len(a) < 8 or not a.any() or not b.any():
        return ""
    factor = float(a @ b) / float(b @ b)
    if factor <= 0 or float(np.linalg.norm(a - factor * b)) > _SHAPE * float(np.linalg.norm(a)):
        return ""
    for ratio, unit in _READ_IN.get(channel, {}).items():
        if abs(factor / ratio - 1) < _NEXT_TO:
            return f"; its {channel} is {factor:.4g} times theirs all along, as if it were in {unit}: is it?"
    return ""
