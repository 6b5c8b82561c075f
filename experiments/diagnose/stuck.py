"""Readings that are stuck, or clip: a sensor that says the same number over and over where it otherwise never does."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["Clipped", "clipped", "stuck_rows"]

_LONG = 12
"""Equal readings in a row that noise does not make."""
_USUAL = 0.05
"""Share of equal neighbours elsewhere up to which a run of them is odd: coarse or held readings repeat all the time."""
_AT_THE_END, _IN_A_ROW = 8, 4
"""Readings at the very end of a channel's range, and those of them in a row, from which on it clips there."""
_NEXT = 2
"""Readings at the value next to that: more, and it is a coarse channel that turns there."""


@dataclass(frozen=True)
class Clipped:
    """Readings at one end of a channel's range, beyond which it cannot read."""

    rows: NDArray[np.int64]
    value: float
    highest: bool
    """Whether it is the highest; else the lowest."""

    @property
    def words(self) -> str:
        """As in: 30 readings of force ..."""
        end, more = ("highest", "more") if self.highest else ("lowest", "less")
        return (
            f"stand at {self.value:.6g}, the {end} that it ever reads: the sensor clips there (its range ends, it is "
            f"saturated) and the true value is {more}; they are set aside"
        )


def clipped(values: NDArray[np.float64]) -> list[Clipped]:
    """The ends of a channel's range at which it clips; `values`: NaN in gaps, shape [n].

    Zeros are let be: they are what a sensor says that is cut off there, or at rest.
    """
    known = np.flatnonzero(np.isfinite(values))
    own = values[known]
    if len(own) < 3 * _AT_THE_END:
        return []
    found = []
    for highest in (True, False):
        end = own.max() if highest else own.min()
        at = own == end
        others = own[~at]
        if end == 0 or at.sum() < _AT_THE_END or not len(others):
            continue
        near = others.max() if highest else others.min()
        edges = np.flatnonzero(np.diff(np.concatenate([[0], at.astype(int), [0]])))
        longest = int((edges[1::2] - edges[::2]).max())
        repeats = float(np.mean(np.diff(own)[~(at[1:] & at[:-1])] == 0)) if not at.all() else 1.0
        if longest >= _IN_A_ROW and int((own == near).sum()) <= _NEXT and repeats <= _USUAL:
            found.append(Clipped(known[at], float(end), highest))
    return found


def stuck_rows(values: NDArray[np.float64]) -> NDArray[np.int64]:
    """Rows after the first of every run of `_LONG` equal readings and more; NaN are passed over, shape [n] -> [m].

    Zeros are let be: they are what a sensor says that is cut off there, or at rest.
    """
    known = np.flatnonzero(np.isfinite(values))
    if len(known) < 3 * _LONG:
        return known[:0]
    same = (np.diff(values[known]) == 0) & (values[known][1:] != 0)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], same.astype(int), [0]])))
    runs = [(low, high) for low, high in zip(edges[::2], edges[1::2], strict=True) if high - low >= _LONG - 1]
    stuck = np.zeros(len(same), dtype=bool)
    for low, high in runs:
        stuck[low:high] = True
    if not stuck.any() or stuck.all() or same[~stuck].mean() > _USUAL:
        return known[:0]
    return known[1:][stuck]
