"""Unbroken stretches of a condition."""

import numpy as np
from numpy.typing import ArrayLike

__all__ = ["spells"]


def spells(holds: ArrayLike) -> list[tuple[int, int]]:
    """First row, and the row after the last, of every unbroken stretch of true ones; `holds` of shape [n]."""
    flags = np.asarray(holds, dtype=bool).astype(int)
    edges = np.flatnonzero(np.diff(np.concatenate(([0], flags, [0]))))
    return [(int(low), int(high)) for low, high in zip(edges[::2], edges[1::2], strict=True)]
