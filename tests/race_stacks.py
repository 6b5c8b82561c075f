"""Beds of the race that need no preparation."""

import math

import numpy as np

from benchmarks.race.grains import DIAMETER, Grains, wrapped

__all__ = ["stack"]


def stack(across: int = 8, layers: int = 5) -> Grains:
    """Equal grains in square layers, each in the hollows of the one below, all touching by a little."""
    spacing = DIAMETER * (1 - 2e-4)
    rise = spacing * math.sqrt(0.5)
    i, j, k = (m.ravel() for m in np.meshgrid(np.arange(across), np.arange(across), np.arange(layers), indexing="ij"))
    shift = 0.5 * (k % 2)
    positions = np.column_stack([(i + shift) * spacing, (j + shift) * spacing, 0.4999 * DIAMETER + k * rise])
    period = (across * spacing, across * spacing)
    return Grains(wrapped(positions, period), np.full(len(positions), DIAMETER / 2), period)
