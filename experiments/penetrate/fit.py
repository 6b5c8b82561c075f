"""Fits the spring-damper to runs in a bed: F = K z + C max(0, dz/dt) for z > 0, with K and C not below zero.

Least squares on the measured force at the measured depth and speed. Driven runs count while loading, drops up to
their first stop; set-downs, rests and pull-outs do not count. Inside a run every macro step has the same weight (equal
times, which at constant speed is equal depths). Every run has the same weight whatever its length:
    minimise  sum over runs of  mean over its rows of  (F - K z - C max(0, dz/dt))^2.
Standard errors come from leaving out one run at a time (jackknife): var = (n - 1)/n sum (theta_i - mean theta)^2. Rows
of one run are far from independent, so that the scatter of rows would claim much too small an error.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from coupling import Penetration

__all__ = [
    "MOST_CORRELATED",
    "Fit",
    "Moments",
    "drag_gap",
    "fit_moments",
    "fit_rows",
    "fit_spring_damper",
    "gap_of_moments",
    "moments_of",
    "spread",
]

Array = NDArray[np.float64]

MOST_CORRELATED = 0.85
"""Of K and C, up to which a fit determines both [1]: runs at one constant speed alone give 0.87, sqrt(3) / 2."""


@dataclass(frozen=True)
class Fit:
    """A fitted spring-damper."""

    stiffness: float  # K [N/m]
    damping: float  # C [N s/m]
    stiffness_error: float | None  # standard error of K by jackknife over runs [N/m]; None below three runs
    damping_error: float | None  # standard error of C by jackknife over runs [N s/m]; None below three runs
    runs: tuple[str, ...]  # ids of the runs that counted
    correlation: float | None = None
    """Of the two estimates, -1 to 0: at -1 only a sum of both is known, not each (None where it was not fitted)."""

    @property
    def separates(self) -> bool:
        """Whether the runs determine K and C each, and not only a sum of both; False where that is not known."""
        return self.correlation is not None and abs(self.correlation) <= MOST_CORRELATED

    def force(self, depth: Array, velocity: Array) -> Array:
        """The law [N] at `depth` [m] and `velocity` [m/s], one shape."""
        return np.where(depth > 0, self.stiffness * depth + self.damping * np.maximum(velocity, 0.0), 0.0)


def fit_rows(run: Penetration) -> NDArray[np.bool_]:
    """Rows that are fitted, shape [n]: of the first loading; none of a set-down or a drop ended near the floor."""
    if run.kind == "set_down" or run.ended == "max_depth":
        return np.zeros(len(run.time), dtype=bool)
    return run.loading & (run.depth > 0)


@dataclass(frozen=True)
class Moments:
    """All that a fit needs of one run: means over its fitted rows of products of z, v = max(0, dz/dt) and F.

    With them a result.json can be fitted again, to some of its runs, when the series are gone.
    """

    zz: float  # [m2]
    zv: float  # [m2/s]
    vv: float  # [m2/s2]
    zf: float  # [N m]
    vf: float  # [N m/s]
    ff: float  # [N2]

    @property
    def matrix(self) -> Array:
        """Of the normal equations, shape (2, 2)."""
        return np.array([[self.zz, self.zv], [self.zv, self.vv]])

    @property
    def right(self) -> Array:
        """Right side of the normal equations, shape (2,)."""
        return np.array([self.zf, self.vf])


def moments_of(run: Penetration) -> Moments | None:
    """The moments of the rows of `run` that are fitted; None where none is."""
    rows = fit_rows(run)
    if not rows.any():
        return None
    z, v, force = run.depth[rows], np.maximum(run.velocity[rows], 0.0), run.force[rows]
    pairs = ((z, z), (z, v), (v, v), (z, force), (v, force), (force, force))
    return Moments(*(float(a @ b / len(z)) for a, b in pairs))


def fit_spring_damper(runs: Mapping[str, Penetration], weights: Mapping[str, float] | None = None) -> Fit:
    """Fit K and C to `runs` (id -> run), each of weight 1 or as given. Raises ValueError where no run has a loading."""
    found = {name: moments_of(run) for name, run in runs.items()}
    return fit_moments({name: part for name, part in found.items() if part is not None}, weights)


def fit_moments(runs: Mapping[str, Moments], weights: Mapping[str, float] | None = None) -> Fit:
    """As `fit_spring_damper`, from the moments of the runs. Raises ValueError where there is no run."""
    if not runs:
        raise ValueError("no driven run and no drop to fit the spring-damper to")
    weight = {name: 1.0 if weights is None else weights[name] for name in runs}
    parts = {name: (weight[name] * part.matrix, weight[name] * part.right) for name, part in runs.items()}
    matrix = sum((part[0] for part in parts.values()), np.zeros((2, 2)))
    right = sum((part[1] for part in parts.values()), np.zeros(2))
    stiffness, damping = _solve(matrix, right)
    errors: tuple[float | None, float | None] = (None, None)
    if len(parts) >= 3:
        left_out = np.array([_solve(matrix - part[0], right - part[1]) for part in parts.values()])
        count = len(parts)
        variance = (count - 1) / count * ((left_out - left_out.mean(axis=0)) ** 2).sum(axis=0)
        errors = (float(np.sqrt(variance[0])), float(np.sqrt(variance[1])))
    size = float(np.sqrt(matrix[0, 0] * matrix[1, 1]))
    return Fit(stiffness, damping, *errors, tuple(parts), -float(matrix[0, 1]) / size if size > 0 else None)


def drag_gap(runs: Sequence[Penetration], fit: Fit, weights: Sequence[float] | None = None) -> float | None:
    """Rms difference of law and bed over the rms drag of the bed, loading of driven runs [1].

    Every run weighs the same unless `weights` says otherwise. None where there is no driven run.
    """
    square, drag = 0.0, 0.0
    for run, weight in zip(runs, weights or [1.0] * len(runs), strict=True):
        rows = fit_rows(run)
        if run.kind != "driven" or not rows.any():
            continue
        square += weight * float(np.mean((fit.force(run.depth[rows], run.velocity[rows]) - run.force[rows]) ** 2))
        drag += weight * float(np.mean(run.force[rows] ** 2))
    return float(np.sqrt(square / drag)) if drag > 0 else None


def gap_of_moments(runs: Mapping[str, Moments], fit: Fit, weights: Mapping[str, float]) -> float | None:
    """As `drag_gap`, from the moments of driven runs; good to some 1e-8, by cancellation."""
    k, c = fit.stiffness, fit.damping
    square = drag = 0.0
    for name, m in runs.items():
        missed = k * k * m.zz + 2 * k * c * m.zv + c * c * m.vv - 2 * (k * m.zf + c * m.vf) + m.ff
        square, drag = square + weights[name] * max(missed, 0.0), drag + weights[name] * m.ff
    return float(np.sqrt(square / drag)) if drag > 0 else None


def spread(values: Sequence[float | None]) -> float | None:
    """Standard deviation between seeds (n - 1); None with fewer than two, 0 where they differ by round-off only."""
    known = [value for value in values if value is not None]
    if len(known) < 2:
        return None
    return 0.0 if np.allclose(known, known[0], rtol=1e-12, atol=0.0) else float(np.std(known, ddof=1))


def _solve(matrix: Array, right: Array) -> tuple[float, float]:
    """Least squares of the two columns with both coefficients >= 0: the best of the free and the two edge solutions."""
    # Conditioned on columns of unit size: depths are mm where speeds are dm/s.
    size = np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    scaled, aim = matrix / np.outer(size, size), right / size
    edges = [np.array([max(0.0, aim[0]), 0.0]), np.array([0.0, max(0.0, aim[1])])]
    if np.linalg.cond(scaled) < 1e12:
        free = np.linalg.solve(scaled, aim)
        if (free >= 0).all():
            edges.append(free)
    best = min(edges, key=lambda x: float(x @ scaled @ x - 2 * x @ aim))
    return float(best[0] / size[0]), float(best[1] / size[1])
