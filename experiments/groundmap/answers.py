"""What a map answers: K, C and sinkage of one spike, each with its standard deviation, and where they hold."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

from vis.page.numbers import foldable, quote

from .settings import say

__all__ = ["SLACK", "Answer", "Number", "TooDeepError", "check_depth", "check_ranges", "times"]

SLACK = 1e-9


class TooDeepError(ValueError):
    """A load sinks a spike deeper than the map goes: K and C are known, the sinkage is not."""


@dataclass(frozen=True)
class Number:
    """A value with its standard deviation, SI units."""

    value: float
    std: float


@dataclass(frozen=True)
class Answer:
    """K [N/m], C [N s/m] and sinkage [m] under `load` [N] of one spike."""

    stiffness: Number
    damping: Number
    sinkage: Number
    load: float
    grain: float  # mean diameter [m]
    ratio: float  # d / D [1]
    packing: float
    speed: float  # of the fastest drives behind it, scaled [m/s]
    deep: bool  # whether the sinkage is within the depths of the drives


def times(number: Number, factor: Number) -> Number:
    """The product of two numbers that are independent."""
    value = number.value * factor.value
    return Number(value, math.hypot(number.std * factor.value, number.value * factor.std))


def check_ranges(
    name: str, ranges: Mapping[str, tuple[float, float]], asked: Mapping[str, float], diameter: float
) -> None:
    """Raise ValueError, naming the key, for a number of `asked` beyond its range; `grain` is d / D."""
    for key, value in asked.items():
        low, high = ranges[key]
        if not low * (1 - SLACK) <= value <= high * (1 + SLACK):
            raise ValueError(say(f"beyond_{key}", name=name, value=value, low=low, high=high, diameter=diameter,
                                 least=low * diameter, most=high * diameter))  # fmt: skip


def check_depth(sinkage: float, *, load: float, own_load: float, grain: float, diameter: float, most: float) -> None:
    """Refuse a sinkage beyond `most` diameters (TooDeepError), or below a grain under less load (ValueError).

    `own_load` [N] is that of the map, `grain` and `diameter` are in m.
    """
    if sinkage > most * diameter:
        about = foldable(quote(sinkage, None, "m", significant=2))
        raise TooDeepError(say("beyond_load", load=load, sinkage=about, deepest=1e3 * most * diameter, most=most))
    if load < own_load and sinkage < grain:
        raise ValueError(say("below_load", load=load, sinkage=1e3 * sinkage, grain=1e3 * grain))
