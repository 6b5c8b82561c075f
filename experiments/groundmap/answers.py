"""What a map answers: K, C and sinkage of one spike, each with its standard deviation, and where they hold."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

from rigid.intervals import NORMAL
from vis.page.numbers import foldable, quote

from .settings import say

__all__ = ["SLACK", "Answer", "Asked", "Number", "TooDeepError", "asked_of", "check_depth", "times"]

SLACK = 1e-9


class TooDeepError(ValueError):
    """A load sinks a spike deeper than the map goes: K and C are known, the sinkage is not."""


@dataclass(frozen=True)
class Number:
    """A value with its standard deviation, SI units."""

    value: float
    std: float

    @property
    def half(self) -> float:
        """Half of the 95 % interval of a normal distribution, in the unit of the number."""
        return NORMAL * self.std


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


class _Map(Protocol):
    """What `asked_of` reads of a map."""

    @property
    def name(self) -> str: ...

    @property
    def packing(self) -> float: ...

    @property
    def reference(self) -> Mapping[str, float]: ...

    @property
    def ranges(self) -> Mapping[str, tuple[float, float]]: ...


@dataclass(frozen=True)
class Asked:
    """What a map is asked for, with its own numbers where none are given; SI units."""

    diameter: float
    grain: float
    packing: float
    load: float
    ratio: float  # d / D [1]
    gravities: float  # gravity over that of the reference [1]
    sizes: float  # diameter over that of the reference [1]
    own_load: float  # the load of the reference, scaled


def asked_of(
    table: _Map, *, gravity: float, diameter: float, grain: float | None, packing: float | None, load: float | None
) -> Asked:
    """The question to a map. Raises ValueError, naming the key, for a number beyond its range."""
    packing = table.packing if packing is None else packing
    grain = table.reference["grain"] if grain is None else grain
    ratio = grain / diameter
    asked = {"gravity": gravity, "tip_diameter": diameter, "packing": packing, "grain": ratio}
    for key, value in asked.items():
        low, high = table.ranges[key]
        if not low * (1 - SLACK) <= value <= high * (1 + SLACK):
            raise ValueError(say(f"beyond_{key}", name=table.name, value=value, low=low, high=high, diameter=diameter,
                                 least=low * diameter, most=high * diameter))  # fmt: skip
    g, size = gravity / table.reference["gravity"], diameter / table.reference["diameter"]
    own_load = table.reference["load"] * g * size**3
    return Asked(diameter, grain, packing, own_load if load is None else load, ratio, g, size, own_load)


def check_depth(sinkage: float, asked: Asked, *, most: float) -> None:
    """Refuse a sinkage [m] beyond `most` diameters (TooDeepError), or below a grain under less load (ValueError)."""
    if sinkage > most * asked.diameter:
        about = foldable(quote(sinkage, None, "m", significant=2))
        deepest = 1e3 * most * asked.diameter
        raise TooDeepError(say("beyond_load", load=asked.load, sinkage=about, deepest=deepest, most=most))
    if asked.load < asked.own_load and sinkage < asked.grain:
        raise ValueError(say("below_load", load=asked.load, sinkage=1e3 * sinkage, grain=1e3 * asked.grain))
