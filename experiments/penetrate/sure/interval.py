"""95 % intervals of sinkage, K and depth to rest, as far as beds and kept runs determine them.

Chance. Several beds: Student's interval of their mean, t s / sqrt(n). One bed: t s of kept runs with the same kind of
tip, s pooled over their grain sizes (trends.toml). A length scales with the grain diameter d, K is taken in the
logarithm. K of all runs and the mean K of the beds are two estimates, as beds may have different runs: the interval of
K holds both. Where K of a bed is 0 there is no logarithm, and its lower end is Student's of the values, at least 0.

Grain size. By the kept `converge` run of a sphere, K = K_0 (1 + growth (d - d_0) / D). The sinkage is that among real
grains less slope (d - d_0), with D the tip, d_0 the real grain. Its lines through fewer sizes and in (d / D)^2 and its
chance give the farthest end. For another tip, load or gravity both are extrapolations. So the interval reaches from no
effect at all to that farthest end, and the value itself is not corrected. Nothing is known of grains that stick.

Width and depth of the bed, softness and speed are not part of it: `hedgebed converge` measures them.
"""

import math
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from rigid.intervals import half_width, student
from vis.page.numbers import between, foldable, within

__all__ = [
    "Interval", "Trend", "ends_of", "in_words", "interval_of_rest", "interval_of_sinkage", "interval_of_stiffness",
    "known_within", "trends",
]  # fmt: skip

_FILE = Path(__file__).with_name("trends.toml")


@dataclass(frozen=True)
class Trend:
    """What kept runs show of a quantity; lengths over the grain diameter, K in the logarithm."""

    slope: float  # Change from the grains of a bed to real ones: of a length over (d - d_0), of K growth per d / D [1]
    most: float  # The same at the farthest end: of a length over (d - d_0), of K a further factor [1]
    std: dict[str, float]  # Kind of tip -> standard deviation between beds, pooled [1]
    freedom: dict[str, int]  # Kind of tip -> degrees of freedom of it
    source: str


@dataclass(frozen=True)
class Interval:
    """A value with the ends of its 95 % interval, in SI units; a part that nothing determines is None."""

    value: float
    chance: tuple[float, float] | None  # Ends by chance alone
    grain_size: tuple[float, float] | None  # Ends by grain size alone
    low: float | None  # Of both together
    high: float | None
    one_bed: bool  # Chance is that of kept runs


@cache
def trends() -> dict[str, Trend]:
    """The trends of `sinkage` and `stiffness` of kept runs, from trends.toml."""
    return {name: Trend(**table) for name, table in tomllib.loads(_FILE.read_text(encoding="utf-8")).items()}


def interval_of_sinkage(
    values: Sequence[float | None], *, tip: str, grain: float, real: float, cohesive: bool
) -> Interval | None:
    """Interval of the depth at rest [m]; None where no bed has one.

    ``values``: Of each bed [m]. ``tip``: Kind of tip. ``grain``, ``real``: Diameter of the bed's and of real grains
    [m]. ``cohesive``: Whether grains stick.
    """
    known = [value for value in values if value is not None]
    if not known:
        return None
    value, trend = float(np.mean(known)), trends()["sinkage"]
    half = _half(known, None if cohesive else _kept(trend, tip, grain))
    chance = None if half is None else (value - half, value + half)
    size = None if cohesive else (value, value + trend.most * max(0.0, grain - real))
    if half is None or chance is None or size is None:
        return Interval(value, chance, size, None, None, len(known) == 1)
    # Real grains are so small that no foot rests above the surface on them.
    return Interval(value, chance, size, max(0.0, chance[0]), max(0.0, size[1] + half), len(known) == 1)


def interval_of_stiffness(
    value: float, values: Sequence[float], *, tip: str, grain: float, real: float, diameter: float, cohesive: bool
) -> Interval | None:
    """Interval of K [N/m]; None where K is not positive.

    ``value``: Fitted to all beds. ``values``: Of each bed whose runs separate K from C, at least 0; fewer than two of
    them show no chance. ``diameter``: Of the tip [m]; the others as of `interval_of_sinkage`.
    """
    if value <= 0:
        return None
    trend = trends()["stiffness"]
    chance = _chance_of_stiffness(value, values, None if cohesive else _kept(trend, tip, 1.0))
    softer = trend.most * (1.0 + trend.slope * max(0.0, grain - real) / diameter)
    size = None if cohesive else (value / softer, value)
    if chance is None or size is None:
        return Interval(value, chance, size, None, None, len(values) < 2)
    return Interval(value, chance, size, chance[0] / softer, chance[1], len(values) < 2)


def _chance_of_stiffness(
    value: float, values: Sequence[float], kept: tuple[float, int] | None
) -> tuple[float, float] | None:
    """Ends of K by chance [N/m]; of one bed by the spread of ln K of kept runs, None where there are none."""
    if len(values) > 1 and min(values) <= 0:
        mean, half = float(np.mean(values)), _half(values, None) or 0.0
        return max(0.0, min(value, mean) - half), max(value, mean) + half
    known = [math.log(k) for k in values] if len(values) > 1 else [math.log(value)]
    spread = _half(known, kept)
    if spread is None:
        return None
    mean = math.exp(float(np.mean(known)))
    return min(value, mean) * math.exp(-spread), max(value, mean) * math.exp(spread)


def interval_of_rest(load: float, stiffness: Interval, other: float) -> tuple[float, float | None] | None:
    """Ends of the depth load / K [m] with K in its interval and, as a further estimate, an ``other`` depth [m].

    The far end is None where K may be 0.
    """
    if stiffness.low is None or stiffness.high is None:
        return None
    return min(load / stiffness.high, other), max(load / stiffness.low, other) if stiffness.low > 0 else None


def _kept(trend: Trend, tip: str, scale: float) -> tuple[float, int] | None:
    """Standard deviation between beds of kept runs with this kind of tip, times a scale, and its freedom."""
    return (trend.std[tip] * scale, trend.freedom[tip]) if tip in trend.std else None


def _half(values: Sequence[float], kept: tuple[float, int] | None) -> float | None:
    """Half-width of the interval of a mean; one bed has that of kept runs; None where there are none."""
    if len(values) > 1:
        return half_width(float(np.std(values, ddof=1)), len(values))
    return None if kept is None else student(kept[1]) * kept[0]


def in_words(low: float, high: float, unit: str) -> str:
    """Two ends with two digits and one unit, for text that folds: "0 to 7.3 mm"."""
    return foldable(between(low, high, unit))


def ends_of(low: float, high: float, *, digits: int = 3) -> str:
    """Two plain numbers, or one where both read the same: "28.9 to 34.2"."""
    return " to ".join(dict.fromkeys(f"{value:.{digits}g}" for value in (low, high)))


def known_within(low: float, high: float, unit: str) -> str:
    """What an interval of a sinkage or of K shows, for text that folds: "below 7.3 mm" where its lower end is 0.

    That 0 is no result: the half-width is larger than the value.
    """
    return foldable(within(low, high, unit))
