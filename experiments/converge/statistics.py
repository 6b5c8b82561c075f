"""Errors of a number that several beds give: chance over beds, and what finer grains would change.

Chance. A mean over n beds lies within t s / sqrt(n) of the mean of infinitely many. Here t is Student's at 95 % and n -
1 degrees of freedom. Two cases are compared bed by bed: the interval is that of the differences.

Grain size. A straight line in x = d / D through the means over beds has the weights n_i / x_i^2, as the scatter of beds
is about proportional to d. Weights from the scatter of a few beds would make the intervals too narrow. At the real
grain it is a = sum c_i m_i, of the variance sum c_i^2 s_i^2 / n_i with the degrees of freedom of Welch and
Satterthwaite: sizes are independent, for beds of other grains are other beds. A size with one bed has the scatter over
x that the others have together. The error of the straight line itself follows from other lines:
    three sizes and more: the larger of what the line without the coarsest grains, and what one in x^2, moves a by;
    two sizes: all of the way from the finest grains to a;
    one size: unknown.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rigid.intervals import student

__all__ = ["Extrapolation", "Interval", "Size", "apart", "extrapolate", "interval_of", "paired"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Interval:
    """A mean and the half-width of its interval of 95 %."""

    mean: float
    half: float | None
    """None for one bed."""
    count: int


def interval_of(values: Sequence[float]) -> Interval | None:
    """Student's interval of the mean of `values`; None of no values."""
    count = len(values)
    if not count:
        return None
    if count == 1:
        return Interval(float(values[0]), None, 1)
    error = float(np.std(values, ddof=1)) / math.sqrt(count)
    return Interval(float(np.mean(values)), student(count - 1) * error, count)


def paired(one: Mapping[int, float], other: Mapping[int, float]) -> Interval | None:
    """`other` less `one`, seed -> value, over the seeds that both have; None where there are none."""
    return interval_of([other[seed] - one[seed] for seed in sorted(one.keys() & other.keys())])


def apart(one: Sequence[float], other: Sequence[float]) -> Interval:
    """Welch's interval of the mean of `other` less that of `one`, of independent beds; no half-width of one bed."""
    samples, shares = (one, other), np.array([-1.0, 1.0])
    counts = np.array([len(sample) for sample in samples])
    difference = float(shares @ np.array([np.mean(sample) for sample in samples]))
    if counts.min() < 2:
        return Interval(difference, None, int(counts.min()))
    errors = np.array([np.std(sample, ddof=1) for sample in samples]) / np.sqrt(counts)
    return Interval(difference, _half(shares, (errors, counts - 1.0)), int(counts.min()))


@dataclass(frozen=True)
class Size:
    """What the beds of one grain size give."""

    x: float  # Grain over tip diameter [1]
    values: tuple[float, ...]


@dataclass(frozen=True)
class Extrapolation:
    """A quantity at the real grain, and the line that leads there."""

    value: float
    chance: float | None
    """Half-width of its interval over beds; None where no size has two beds."""
    grain: float | None
    """What the line may be wrong by; None for one size."""
    slope: float | None
    """Change of the quantity from x = 0 to x = 1; None for one size."""
    without_coarsest: float | None
    squared: float | None
    """The value by the line without the coarsest grains, and by one in x^2; None for fewer than three sizes."""
    misfit: float | None
    """Largest distance of a mean from the line, over the standard error of that mean [1]."""
    line: tuple[tuple[float, float, float | None], ...]
    """Points (x, value, half-width) of the line, from the real grain to the coarsest."""


def extrapolate(sizes: Sequence[Size], to: float, *, points: int = 25) -> Extrapolation | None:
    """The line through `sizes` at x = `to` (see the module), and at so many `points`; None without sizes.

    Raises ValueError where a size has no value, or two have the same x.
    """
    sizes = sorted(sizes, key=lambda size: size.x)
    if not sizes:
        return None
    if any(not size.values for size in sizes) or len({size.x for size in sizes}) < len(sizes):
        raise ValueError(f"each size must have values and an x of its own: {sizes}")
    x, means = np.array([size.x for size in sizes]), np.array([np.mean(size.values) for size in sizes])
    errors = _errors(sizes)
    if len(sizes) == 1:
        only = interval_of(sizes[0].values)
        assert only is not None
        return Extrapolation(only.mean, only.half, None, None, None, None, None, ())
    weights = np.array([len(size.values) for size in sizes]) / x**2
    at = _shares(x, weights, to)
    value = float(at @ means)
    without = squared = None
    if len(sizes) > 2:
        without = float(_shares(x[:-1], weights[:-1], to) @ means[:-1])
        squared = float(_shares(x**2, weights, to**2) @ means)
        grain = max(abs(value - without), abs(value - squared))
    else:
        grain = abs(value - float(means[0]))
    zero, one = (float(_shares(x, weights, end) @ means) for end in (0.0, 1.0))
    drawn = [(float(end), _shares(x, weights, float(end))) for end in np.linspace(to, x[-1], points)]
    misfit = None
    if errors is not None and len(sizes) > 2:
        off = np.array(
            [abs(float(_shares(x, weights, own) @ means) - mean) for own, mean in zip(x, means, strict=True)]
        )
        misfit = float(np.max(off / np.maximum(errors[0], 1e-300)))
    return Extrapolation(
        value, _half(at, errors), grain, one - zero, without, squared, misfit,
        tuple((end, float(shares @ means), _half(shares, errors)) for end, shares in drawn),
    )  # fmt: skip


def _shares(x: Array, weights: Array, to: float) -> Array:
    """The shares c_i of the means in the weighted straight line at `to`, shape [size_count]."""
    matrix = np.column_stack([np.ones_like(x), x])
    normal = matrix.T @ (weights[:, None] * matrix)
    return np.linalg.solve(normal, matrix.T * weights).T @ np.array([1.0, to])


def _errors(sizes: Sequence[Size]) -> tuple[Array, Array] | None:
    """Standard error of each mean and its degrees of freedom, shapes [size_count]; None where no size has two beds."""
    several = [size for size in sizes if len(size.values) > 1]
    if not several:
        return None
    freedoms = [len(size.values) - 1 for size in several]
    relative = [float(np.var(size.values, ddof=1)) / size.x**2 for size in several]
    together = math.sqrt(float(np.average(relative, weights=freedoms)))
    errors, own = [], []
    for size in sizes:
        count = len(size.values)
        std = float(np.std(size.values, ddof=1)) if count > 1 else together * size.x
        errors.append(std / math.sqrt(count))
        own.append(count - 1 if count > 1 else sum(freedoms))
    return np.array(errors), np.array(own, dtype=float)


def _half(shares: Array, errors: tuple[Array, Array] | None) -> float | None:
    """Half-width of the interval of sum c_i m_i."""
    if errors is None:
        return None
    parts = (shares * errors[0]) ** 2
    variance = float(parts.sum())
    if variance == 0:
        return 0.0
    freedom = variance**2 / float((parts**2 / errors[1]).sum())
    return student(freedom) * math.sqrt(variance)
