"""What an odd recording is called: a channel and a sentence, and what a ratio of two units means."""

from __future__ import annotations

import math
from typing import NamedTuple

from experiments.campaign.tables import DepthSensor
from rigid.platform.rig import STANDARD_GRAVITY
from vis.page.sentences import Sentences

__all__ = ["OFF", "ZERO", "Odd", "said", "say", "std_of", "times", "unit_words"]

say = Sentences(__package__)
OFF = 6.0
"""Standard errors by which a zero or a speed must be off."""
ZERO = 5.0
"""And standard deviations of the sensor."""
_NEAR = 0.15
"""Relative distance within which a ratio counts as that of two units."""
_RATIOS = {
    -1.0: "the sign is reversed",
    180 / math.pi: "it looks like degrees under a heading in radians",
    math.pi / 180: "it looks like radians under a heading in degrees",
    30 / math.pi: "it looks like revolutions per minute under a heading in rad_s",
    1e3: "it looks like thousandths under a heading without them",
    1 / STANDARD_GRAVITY: "it looks like units of g under a heading in m_s2",
}


class Odd(NamedTuple):
    """One thing that cannot be."""

    channel: str
    what: str


def said(channel: str, *parts: str) -> Odd:
    """The parts as one sentence."""
    return Odd(channel, "".join(parts))


def unit_words(ratio: float) -> str | None:
    """What a ratio of measured over expected means; None for one that means nothing."""
    return next((words for known, words in _RATIOS.items() if abs(ratio / known - 1) < _NEAR), None)


def times(ratio: float) -> str:
    """24 times, 2.5 times."""
    return f"{ratio:.0f} times" if ratio >= 10 else f"{ratio:.2g} times"


def std_of(sensor: DepthSensor | None) -> float:
    """The first std of a table of [sensors]; 0 without one."""
    return 0.0 if sensor is None else float(sensor.std[0])
