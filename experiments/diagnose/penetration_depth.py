"""The motion of a driven spike from its noisy depth column: smooth pieces and kinks, with the error that is left.

The curve is a polynomial or a cubic spline with equal intervals, plus kinks (a drive that stops or turns), fitted by
least squares; how many of each the column calls for is chosen by the Bayesian information criterion at the stated noise
(Schwarz, Annals of Statistics 6 (1978), 461). Since the fit is linear, its error is a known linear map of the noise.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline

__all__ = ["SmoothDepth", "smooth_depth"]

Array = NDArray[np.float64]

_INTERVALS = (1, 2, 4, 8, 16, 32, 64, 128)
_MOST_KINKS = 10
_KINKED_INTERVALS = 2  # finer splines need no kinks, and the search is dear
_KINK_GRID = 160


@dataclass(frozen=True)
class SmoothDepth:
    """A smoothed depth column at its own times, n rows."""

    depth: Array
    """[m], shape [n]"""
    speed: Array
    """Its slope [m/s], shape [n]."""
    depth_error: Array
    """Factor of the depth's error: the error is this times standard normal numbers [m], shape [n, p]."""
    speed_error: Array
    """Of the slope's, the same numbers [m/s], shape [n, p]."""

    @property
    def depth_std(self) -> Array:
        """Standard error of the smoothed depth, s in trials.md [m], shape [n]."""
        return np.sqrt((self.depth_error**2).sum(axis=1))

    @property
    def speed_std(self) -> Array:
        """Standard error of the slope [m/s], shape [n]."""
        return np.sqrt((self.speed_error**2).sum(axis=1))


def smooth_depth(time: Array, depth: Array, std: float) -> SmoothDepth:
    """Smooth a depth column [m] at times [s], both of shape [n], with noise of standard deviation `std` [m].

    Raises ValueError for fewer than two rows.
    """
    if len(time) < 2:
        raise ValueError(f"{len(time)} rows of depth: two or more were expected")
    span = time[-1] - time[0]
    u = (time - time[0]) / (span if span > 0 else 1.0)
    noise = max(std, 1e-9 * max(float(np.ptp(depth)), 1e-9))
    best: tuple[float, Array, Array] | None = None
    enough = 0
    for intervals in (0, *_INTERVALS):
        basis, slopes = _basis(u, intervals)
        if basis.shape[1] > max(2, len(u) // 3):
            break
        kinks = _MOST_KINKS if intervals <= _KINKED_INTERVALS else 0
        score, basis, slopes = _with_kinks(u, depth / noise, basis, slopes, kinks)
        if best is None or score < best[0]:
            best = (score, basis, slopes)
        if score - np.log(len(u)) * basis.shape[1] < len(u) + 2 * np.sqrt(2 * len(u)):  # down to the noise
            enough += 1
            if enough == 3:
                break
    assert best is not None
    _, basis, slopes = best
    q, r = np.linalg.qr(basis)
    weights = q.T @ depth
    slope_map = np.linalg.solve(r.T, slopes.T).T / (span if span > 0 else 1.0)
    return SmoothDepth(q @ weights, slope_map @ weights, std * q, std * slope_map)


def _basis(u: Array, intervals: int) -> tuple[Array, Array]:
    """Columns and their slopes: a straight line for 0 intervals, else a cubic spline of that many on 0..1."""
    if intervals == 0:
        return np.column_stack([np.ones_like(u), u]), np.column_stack([np.zeros_like(u), np.ones_like(u)])
    knots = np.concatenate([np.zeros(3), np.linspace(0.0, 1.0, intervals + 1), np.ones(3)])
    count = intervals + 3
    spline = BSpline(knots, np.eye(count), 3)
    return spline(u), spline.derivative()(u)


def _with_kinks(u: Array, measured: Array, basis: Array, slopes: Array, most: int) -> tuple[float, Array, Array]:
    """The criterion, and the columns with as many kinks as it allows, each found where it helps most."""
    n = len(u)

    q = np.linalg.qr(basis)[0]
    rest = measured - q @ (q.T @ measured)
    score = float(rest @ rest) + np.log(n) * basis.shape[1]
    grid = np.linspace(0.0, 1.0, _KINK_GRID + 2)[1:-1]
    for _ in range(min(most, n // 6)):
        if rest @ rest < n + 3 * np.sqrt(2 * n):  # nothing left that a kink could explain
            break
        place = _best_kink(u, q, rest, grid)
        fine = place + np.linspace(-1.2, 1.2, 41) / _KINK_GRID
        place = _best_kink(u, q, rest, fine[(fine > 0) & (fine < 1)])
        trial = np.column_stack([basis, np.maximum(u - place, 0.0)])
        column = trial[:, -1] - q @ (q.T @ trial[:, -1])
        column /= np.linalg.norm(column)
        q_new, rest_new = np.column_stack([q, column]), rest - column * (column @ rest)
        new = float(rest_new @ rest_new) + np.log(n) * (trial.shape[1] + 1)
        if not new < score - 4.0:
            break
        score, q, rest, basis = new, q_new, rest_new, trial
        slopes = np.column_stack([slopes, (u > place).astype(float)])
    return score, basis, slopes


def _best_kink(u: Array, q: Array, rest: Array, places: Array) -> float:
    hinges = np.maximum(u[:, None] - places[None, :], 0.0)
    hinges = hinges - q @ (q.T @ hinges)
    size = np.sqrt((hinges**2).sum(axis=0))
    gain = np.where(size > 1e-9, np.abs(rest @ hinges) / np.maximum(size, 1e-12), 0.0)
    return float(places[int(np.argmax(gain))])
