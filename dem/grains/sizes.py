"""Distributions of grain diameters: uniform, normal, log-normal, and a sieve table.

Each has a mean, bounds and a mean cube, and draws diameters. All have bounds, because the smallest grain sets the time
step and the largest the cells of the neighbour search. The normal and the log-normal count grains, as a microscope
does; a sieve table weighs them.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

__all__ = ["Json", "LogNormal", "Normal", "Sieve", "Sizes", "Uniform", "describe", "sizes_of"]


Json = dict[str, Any]  # Plain values by name, as JSON takes them


def _refuse(kind: str, key: str, value: Any, bounds: str) -> None:
    raise ValueError(f"{kind}: {key} = {value} must be {bounds}")


@dataclass(frozen=True)
class _About:
    """Sizes by number about a mean diameter ``mean`` [m]."""

    mean: float

    def __post_init__(self):
        if not 0 < self.mean < math.inf:
            _refuse(type(self).__name__, "mean", self.mean, "a positive diameter [m]")


@dataclass(frozen=True)
class Uniform(_About):
    """Sizes by number, uniform within mean (1 +- spread). ``mean`` [m], ``spread`` [1], at most 0.5."""

    spread: float = 0.15

    def __post_init__(self):
        super().__post_init__()
        if not 0 <= self.spread <= 0.5:
            _refuse("Uniform", "spread", self.spread, "between 0 and 0.5 of the mean diameter")

    @property
    def bounds(self) -> tuple[float, float]:
        """Smallest and largest diameter [m]."""
        return self.mean * (1 - self.spread), self.mean * (1 + self.spread)

    @property
    def mean_cube(self) -> float:
        """Of the diameter [m3]."""
        return self.mean**3 * (1 + self.spread**2)

    def draw(self, rng: np.random.Generator, count: int) -> np.ndarray:
        """Diameters [m], shape [count]."""
        return self.mean * (1 + self.spread * rng.uniform(-1, 1, count))


@dataclass(frozen=True)
class _Cut(_About):
    """Sizes of a normal number, cut off on both sides at ``cut`` standard deviations."""

    deviation: float
    cut: float = 2.0

    def __post_init__(self):
        super().__post_init__()
        if not 0 <= self.deviation <= 1:
            _refuse(type(self).__name__, "deviation", self.deviation, "between 0 and 1")
        if not 0 < self.cut <= 4:
            _refuse(type(self).__name__, "cut", self.cut, "above 0 and at most 4 standard deviations")

    def _normal(self, rng: np.random.Generator, count: int) -> np.ndarray:
        """Standard normal numbers between -cut and cut."""
        low = _below(-self.cut)
        return _quantile(low + (1 - 2 * low) * rng.uniform(0, 1, count))


@dataclass(frozen=True)
class Normal(_Cut):
    """Sizes by number, normal about ``mean`` [m] and cut off on both sides.

    Attributes:
        deviation: standard deviation before the cut over the mean [1].
        cut: where it is cut off, in standard deviations; deviation times cut stays below 0.9.
    """

    def __post_init__(self):
        super().__post_init__()
        if not self.deviation * self.cut < 0.9:
            bounds = f"below {0.9 / self.cut:g} with cut = {self.cut:g}, or the smallest grains vanish"
            _refuse("Normal", "deviation", self.deviation, bounds)

    @property
    def bounds(self) -> tuple[float, float]:
        """Smallest and largest diameter [m]."""
        return self.mean * (1 - self.deviation * self.cut), self.mean * (1 + self.deviation * self.cut)

    @property
    def mean_cube(self) -> float:
        """Of the diameter [m3]: 1 + 3 s^2 E z^2 for a symmetric z, E z^2 = 1 - 2 c phi(c) / (2 Phi(c) - 1)."""
        density = math.exp(-0.5 * self.cut**2) / math.sqrt(2 * math.pi)
        square = 1 - 2 * self.cut * density / (1 - 2 * _below(-self.cut))
        return self.mean**3 * (1 + 3 * self.deviation**2 * square)

    def draw(self, rng: np.random.Generator, count: int) -> np.ndarray:
        """Diameters [m], shape [count]."""
        return self.mean * (1 + self.deviation * self._normal(rng, count))


@dataclass(frozen=True)
class LogNormal(_Cut):
    """Sizes by number, log-normal with the mean diameter ``mean`` [m] and cut off on both sides.

    Attributes:
        deviation: standard deviation of ln(diameter) before the cut [1].
        cut: where it is cut off, in those standard deviations.
    """

    @property
    def median(self) -> float:
        """Half the grains are smaller [m]."""
        return self.mean / self._moment(1)

    def _moment(self, power: int) -> float:
        """Mean of (diameter / median)^power."""
        shift = power * self.deviation
        share = _below(self.cut - shift) - _below(-self.cut - shift)
        return math.exp(0.5 * shift**2) * share / (1 - 2 * _below(-self.cut))

    @property
    def bounds(self) -> tuple[float, float]:
        """Smallest and largest diameter [m]."""
        factor = math.exp(self.deviation * self.cut)
        return self.median / factor, self.median * factor

    @property
    def mean_cube(self) -> float:
        """Of the diameter [m3]."""
        return self.median**3 * self._moment(3)

    def draw(self, rng: np.random.Generator, count: int) -> np.ndarray:
        """Diameters [m], shape [count]."""
        return self.median * np.exp(self.deviation * self._normal(rng, count))


@dataclass(frozen=True)
class Sieve:
    """Sizes by mass, from a sieve table; the grading curve is straight over ln(diameter) between two sieves.

    Attributes:
        openings: of the sieves [m], ascending, two at least.
        passing: share of the mass that passes each [1]; 0 at the first, 1 at the last.
        scale: how much larger than the table's the grains are [1].
    """

    openings: tuple[float, ...]
    passing: tuple[float, ...]
    scale: float = 1.0

    def __post_init__(self):
        object.__setattr__(self, "openings", tuple(float(d) for d in self.openings))
        object.__setattr__(self, "passing", tuple(float(p) for p in self.passing))
        if len(self.openings) < 2:
            _refuse("Sieve", "openings", self.openings, "two or more diameters [m]")
        if len(self.passing) != len(self.openings):
            _refuse("Sieve", "passing", self.passing, f"as many shares as there are openings, {len(self.openings)}")
        if not (self.openings[0] > 0 and math.isfinite(self.openings[-1]) and (np.diff(self.openings) > 0).all()):
            _refuse("Sieve", "openings", self.openings, "positive and ascending [m]")
        if not ((np.diff(self.passing) >= 0).all() and self.passing[0] == 0 and self.passing[-1] == 1):
            _refuse("Sieve", "passing", self.passing, "shares of the mass that rise from 0 to 1")
        if not (math.isfinite(self.scale) and self.scale > 0):
            _refuse("Sieve", "scale", self.scale, "positive")

    def _classes(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Bounds [m], mass shares, and numbers of grains per mass of sizes cubed [1/m3] of the classes between sieves.

        Within a class the mass lies evenly over ln d, so numbers go as d^-3 over ln d.
        """
        d = self.scale * np.array(self.openings)
        low, high = d[:-1], d[1:]
        mass = np.diff(self.passing)
        number = mass * (low**-3 - high**-3) / (3 * np.log(high / low))
        return low, high, mass, number

    @property
    def bounds(self) -> tuple[float, float]:
        """Smallest and largest diameter [m] that there is mass of."""
        low, high, mass, _ = self._classes()
        return float(low[mass > 0][0]), float(high[mass > 0][-1])

    @property
    def mean_cube(self) -> float:
        """Of the diameter, over the grains by number [m3]."""
        return float(1 / self._classes()[3].sum())

    @property
    def mean(self) -> float:
        """Of the diameter, over the grains by number [m]."""
        low, high, mass, number = self._classes()
        first = mass * (low**-2 - high**-2) / (2 * np.log(high / low))
        return float(first.sum() / number.sum())

    def draw(self, rng: np.random.Generator, count: int) -> np.ndarray:
        """Diameters [m], shape [count]."""
        low, high, _, number = self._classes()
        ends = np.cumsum(number / number.sum())
        ends[-1] = 1.0
        which = np.searchsorted(ends, rng.uniform(0, 1, count), side="right")
        a, b = low[which] ** -3, high[which] ** -3
        return (a - (a - b) * rng.uniform(0, 1, count)) ** (-1 / 3)


Sizes = Uniform | Normal | LogNormal | Sieve


def sizes_of(grain: float | Sizes, spread: float | None = None) -> Sizes:
    """The distribution that ``grain`` is, or the uniform one about that mean diameter [m] (spread 0.15 when None).

    Raises ValueError: a grain that is neither, or a spread beside a distribution, which has one of its own.
    """
    if isinstance(grain, Sizes):
        if spread is not None:
            raise ValueError(f"spread = {spread} is for a mean diameter; {type(grain).__name__} has a width of its own")
        return grain
    spread = 0.15 if spread is None else spread
    if isinstance(grain, bool) or not isinstance(grain, (int, float, np.number)):
        raise ValueError(f"grain = {grain!r} must be a mean diameter [m] or one of Uniform, Normal, LogNormal, Sieve")
    if not (math.isfinite(grain) and grain > 0):
        raise ValueError(f"grain = {grain} must be a positive diameter [m]")
    if not 0 <= spread <= 0.5:
        raise ValueError(f"spread = {spread} must be between 0 and 0.5 of the mean diameter")
    return Uniform(float(grain), float(spread))


def describe(sizes: DataclassInstance) -> Json:
    """A distribution, or ``dem.Graded``, in plain values that JSON takes."""
    return {"kind": type(sizes).__name__} | asdict(sizes)


def _below(z: float) -> float:
    """Share of standard normal numbers below `z`."""
    from scipy.special import ndtr  # here, since few scripts need it and it is slow to import

    return float(ndtr(z))


def _quantile(share: np.ndarray) -> np.ndarray:
    """The numbers below which these shares of standard normal numbers are."""
    from scipy.special import ndtri

    return np.asarray(ndtri(share))
