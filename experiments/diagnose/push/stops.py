"""C where a drive stops: the force falls there by C v, whatever the force over depth is.

The spring does not change while the tip stands still, so this C hardly depends on the law that was fitted. A model with
another C has an error in how the force depends on the speed.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from experiments.diagnose.fit.gaps import numeral
from experiments.diagnose.fit.problem import Array
from rigid.intervals import student

from .remarks import Push

__all__ = ["AtStops", "at_stops", "doubts_of_damping"]

_MOVES, _STANDS = 0.8, 0.1  # share of a push's pace from which on it moves, and up to which it stands
_PACE = 90.0  # percentile of the speed that is the pace of a push
_ROWS, _FEWEST, _LONGEST = 20, 5, 40  # rows on either side of a stop at most and at least; rows that a stop lasts
_FURTHER = 0.5  # way from the last moving row to rest, over the way that a line is fitted to, at most
_SURE, _FAR = 0.997, 0.25  # two-sided probability, and share of the larger C, from which on the two differ


@dataclass(frozen=True)
class AtStops:
    """C by the steps of the force where pushes stop."""

    damping: float  # mean over the stops, each weighed by its error [N s/m]
    std: float  # standard error of the mean [N s/m]
    low: float  # least of the stops [N s/m]
    high: float  # largest of them [N s/m]
    count: int  # stops


def at_stops(pushes: Sequence[Push]) -> AtStops | None:
    """C at the stops of these pushes; None where fewer than two of them stop and stand still."""
    found = [step for push in pushes if (step := _step(push)) is not None]
    if len(found) < 2:
        return None
    c, std = np.array(found).T
    weights = 1 / np.maximum(std, 1e-12 + 1e-3 * np.abs(c)) ** 2
    mean = float(weights @ c / weights.sum())
    scatter = float(weights @ (c - mean) ** 2 / weights.sum()) / (len(c) - 1)
    error = math.sqrt(max(1 / float(weights.sum()), scatter))
    return AtStops(mean, error, float(c.min()), float(c.max()), len(c))


def doubts_of_damping(pushes: Sequence[Push], dampings: Mapping[float, float]) -> list[str]:
    """Where the C of a model is not that of its stops, a sentence each. `dampings`: diameter [m] -> C [N s/m]."""
    return [
        sentence
        for diameter, damping in dampings.items()
        for sentence in _doubt([push for push in pushes if push.diameter == diameter], damping)
    ]


def _doubt(pushes: Sequence[Push], damping: float) -> list[str]:
    found = at_stops(pushes)
    if found is None or found.damping < 0:  # the force rises at a stop: no damper does this
        return []
    apart, larger = abs(found.damping - damping), max(abs(found.damping), abs(damping))
    if apart <= student(found.count - 1, _SURE) * found.std or apart <= _FAR * larger:
        return []
    half = found.std * student(found.count - 1, 0.95)
    quoted = f"{numeral(found.damping, 3)} ± {numeral(half, 2)} N s/m"
    return [
        f"C = {numeral(damping, 2)} N s/m. Where the drive stops, the force falls as by C = {quoted} (95 %; "
        f"{numeral(found.low, 2)} to {numeral(found.high, 2)} at {found.count} stops). So the force depends on speed "
        f"in another way than C v, or falls while the tip stands still. Do not use this C at other speeds or depths"
    ]


def _step(push: Push) -> tuple[float, float] | None:
    """C [N s/m] and its standard error by the first stop of a push that stands still afterwards; None without."""
    forward = push.speed[push.speed > 0]
    if len(forward) < _FEWEST:
        return None
    pace = float(np.percentile(forward, _PACE))
    moves, stands = push.speed > _MOVES * pace, np.abs(push.speed) < _STANDS * pace
    deepest = int(np.argmax(push.depth >= push.depth.max() * (1 - 1e-3)))
    before = np.flatnonzero(moves[: deepest + _LONGEST] & (push.depth[: deepest + _LONGEST] > 0))
    if len(before) < _FEWEST:
        return None
    last = int(before[-1])
    after = np.flatnonzero(stands[last : last + _LONGEST])
    if not len(after):
        return None
    first = last + int(after[0])
    still = stands[first : first + _ROWS]
    end = first + (len(still) if still.all() else int(np.argmin(still)))
    into = max(last - _ROWS + 1, int(before[0]))
    in_motion, at_rest = slice(into, last + 1), slice(first, end)
    if end - first < _FEWEST or last + 1 - into < _FEWEST:
        return None
    rest = push.force - push.spring
    # A line over the depth, to where the tip stands: an error of the fitted spring is not taken for a damper.
    way = push.depth[in_motion] - push.depth[at_rest].mean()
    if abs(way[-1]) > _FURTHER * np.ptp(way):  # eased into its rest: the line would reach too far
        return None
    columns = np.column_stack([np.ones_like(way), way])
    inverse = np.linalg.pinv(columns)
    fall = float(inverse[0] @ rest[in_motion] - rest[at_rest].mean())
    speed = float(push.speed[in_motion].mean() - push.speed[at_rest].mean())
    noise = _noise(rest[in_motion]) * np.linalg.norm(inverse[0]), _noise(rest[at_rest]) / math.sqrt(end - first)
    return fall / speed, math.hypot(*noise) / speed


def _noise(rest: Array) -> float:
    """Standard deviation of single readings, by the differences of neighbours: a slope does not count."""
    return float(np.std(np.diff(rest))) / math.sqrt(2)
