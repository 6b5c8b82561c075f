"""Up to which moment a model follows a measured tumble."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .data import TrialData

__all__ = ["followed_until"]

Array = NDArray[np.float64]

_PIECE = 24
"""Samples that are judged together."""
_FAR = 6.0
"""Standard deviations of a piece's sum of squares from which it is off; coloured noise makes 2 of 1.4."""
_BEFORE = 1.2
"""Mean square of all before, at most."""
_LEAST = 0.3
"""Share of a trial's time after the torque sets in, at least."""
_AFTER_EVENT = 0.3
"""How long after a change of the model's state two ways may take to part visibly [s]."""


def followed_until(trial: TrialData, residual: Array, state: NDArray[np.int8]) -> float | None:
    """The moment [s] from which these residuals (in standard deviations) are off; None where that is too early.

    Gyro and accelerometers are looked at: the camera's unknown zero spreads a late error over a whole recording. None
    too where nothing is off, where little is right before, or where no state of the model (`state`, at the same
    samples) ended shortly before: ways part where something touches, catches or lets go.
    """
    seen = np.flatnonzero(trial.of("gyro") | trial.of("ax") | trial.of("ay"))
    order = seen[np.argsort(trial.time[seen], kind="stable")]
    if len(order) < 4 * _PIECE:
        return None
    time, square, at = trial.time[order], residual[order] ** 2, state[order]
    pieces = np.array_split(np.arange(len(order)), len(order) // _PIECE)
    for piece in pieces:
        count = len(piece)
        if square[piece].sum() - count <= _FAR * np.sqrt(2.0 * count):
            continue
        first = int(piece[0])
        moment = float(time[first])
        right = first > 0 and float(square[:first].mean()) <= _BEFORE
        changes = time[1:][(at[1:] != at[:-1]) & (time[1:] > 0)]
        parted = bool(((changes > moment - _AFTER_EVENT) & (changes <= float(time[piece[-1]]))).any())
        return moment if right and parted and moment >= _LEAST * trial.end else None
    return None
