"""Readings that are stuck: a sensor that says the same number over and over where it otherwise never does."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["stuck_rows"]

_LONG = 12
"""Equal readings in a row that noise does not make."""
_USUAL = 0.05
"""Share of equal neighbours elsewhere up to which a run of them is odd: coarse or held readings repeat all the time."""


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
