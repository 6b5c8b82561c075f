"""Size distributions and first positions."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

__all__ = ["RAIN_COLUMN", "draw_radii", "rain_positions"]

RAIN_COLUMN = 2.5
"""Upper bound of the rain's column over the depth of the levelled bed [1]: what a grain can fall."""


def draw_radii(rng: np.random.Generator, volume: float, grain: float, spread: float) -> np.ndarray:
    """Radii of grains whose volumes add up to a solid volume.

    Diameters are uniform within grain (1 +- spread), whose mean cube is grain^3 (1 + spread^2).

    Args:
        volume: of solid [m3]. grain: mean diameter [m]. spread: [1].

    Returns:
        Radii [m], shape [grain_count]; at least one.
    """
    expected = math.pi / 6 * grain**3 * (1 + spread**2)
    count = max(1, round(volume / expected))
    return 0.5 * grain * (1 + spread * rng.uniform(-1, 1, count))


def rain_positions(rng: np.random.Generator, radii: np.ndarray, period: Sequence[float]) -> np.ndarray:
    """Centres of grains in a loose jittered column above z = 0, none touching, periodic in x and y.

    Layers are one and a half of the largest diameters apart, so that the grains fall as rain rather than as a block.

    Args:
        radii: [m], shape [grain_count].
        period: (x, y) [m].

    Returns:
        Centres [m], shape [grain_count, 3].
    """
    largest = 2 * float(radii.max())
    nx, ny = (max(1, int(length / (1.02 * largest))) for length in period)
    cell = (period[0] / nx, period[1] / ny, 1.5 * largest)
    k, rest = np.divmod(np.arange(len(radii)), nx * ny)
    j, i = np.divmod(rest, nx)
    lattice = np.column_stack([i + 0.5, j + 0.5, k + 0.5]) * cell
    # A grain may go as far from its site as its own radius leaves room.
    play = 0.5 * (np.array(cell) - 2 * radii[:, None]) * 0.98
    return lattice + rng.uniform(-1, 1, lattice.shape) * play
