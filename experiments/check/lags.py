"""How late one clock is against another: the camera's angle against the integral of the gyro's rate.

theta(t) = c + b t + G(t - lag), G being the integral of the rate: c is the unknown start, b the gyro's zero. Nothing is
known of a lag where the rate stays the same; where it changes, at a touch or while the torque acts, the lag stands out.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from .words import Array

__all__ = ["Lag", "find_lag", "pieces"]

_REACH = 0.6  # seconds to either side that are looked at
_STEP = 0.005  # between lags that are tried first [s]
_FEW = 16  # rows of either sensor below which nothing is said
_SURE = 50.0  # chi-square by which a lag must be better than the one that was expected
_ZERO = 3.0  # the gyro's zero in standard deviations of its noise, one sigma


@dataclass(frozen=True)
class Lag:
    """Of the angle behind the integral of the rate."""

    value: float  # [s]; positive where the angle comes late
    left: float  # mean squared misfit at this lag, over the noise's
    without: float  # the same at the lag that was expected; infinite where the two do not overlap there
    count: int  # rows of the angle that were compared

    @property
    def is_right(self) -> bool:
        """Whether the two are one motion at this lag."""
        return self.left < 4.0

    @property
    def is_another(self) -> bool:
        """Whether the lag that was expected is wrong: the misfit says so, by chi-square and plainly."""
        return self.is_right and self.without > 2 * self.left and (self.without - self.left) * self.count > _SURE


def find_lag(
    seen: Array, angle: Array, felt: Array, rate: Array, *, std: tuple[float, float], near: float = 0.0
) -> Lag | None:
    """The lag of `angle` [rad] at the times `seen` [s] behind the integral of `rate` [rad/s] at the times `felt` [s].

    `std`: noise of angle and rate. `near`: the lag that is expected [s]. None where the rate does not
    change enough to tell, and where the best lag is at the end of what is tried.
    """
    if min(len(seen), len(felt)) < _FEW or np.ptp(felt) <= 0:
        return None
    steps = np.diff(felt)
    turned = np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]) * steps)])
    noise = float(np.hypot(std[0], std[1] * np.sqrt(np.median(steps) * np.ptp(felt))))

    def misfit(lag: float) -> tuple[float, int]:
        inside = (seen - lag >= felt[0]) & (seen - lag <= felt[-1])
        count = int(inside.sum())
        if count < max(_FEW, 0.25 * len(seen)):
            return np.inf, count
        rest = (angle[inside] - np.interp(seen[inside] - lag, felt, turned)) / noise
        time = (seen[inside] - seen[inside].mean()) / noise
        one = np.concatenate([np.full(count, 1 / noise), [0.0]])
        two = np.concatenate([time, [1 / max(_ZERO * std[1], 1e-9)]])
        values = np.concatenate([rest, [0.0]])
        columns = np.column_stack([one, two])
        left = values - columns @ np.linalg.lstsq(columns, values, rcond=None)[0]
        return float(left @ left) / count, count

    tried = near + np.arange(-_REACH, _REACH + _STEP / 2, _STEP)
    costs = np.array([misfit(lag)[0] for lag in tried])
    best = int(np.argmin(costs))
    if not np.isfinite(costs[best]) or best in (0, len(tried) - 1) or not np.isfinite(costs[best - 1 : best + 2]).all():
        return None
    fine = tried[best] + np.linspace(-_STEP, _STEP, 21)
    small = [misfit(lag) for lag in fine]
    least = min(range(len(fine)), key=lambda k: small[k][0])
    lowest, count = small[least]
    if costs[best - 1] - 2 * costs[best] + costs[best + 1] <= 0:
        return None
    return Lag(float(fine[least]), lowest, misfit(near)[0], count)


def pieces(time: Array) -> list[tuple[int, int]]:
    """Stretches [low, high) of rows between steps of the time that are four times the usual one and more."""
    if len(time) < 2:
        return [(0, len(time))]
    steps = np.diff(time)
    breaks = np.flatnonzero(steps > max(4 * float(np.median(steps)), 2e-3)) + 1
    return list(pairwise([0, *breaks.tolist(), len(time)]))
