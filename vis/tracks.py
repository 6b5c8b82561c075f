"""The surface of a bed as a height map: the top of the grains over each point of a level grid, so that tracks show."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vis.frames import HeightMap

__all__ = ["height_map"]


def height_map(
    position: ArrayLike,
    radius: ArrayLike,
    size: tuple[float, float],
    *,
    spacing: float,
    coordination: ArrayLike | None = None,
) -> HeightMap:
    """Height of the grains' tops over a grid on a bed that is periodic along x and y.

    Args:
        position: Centres of the grains [m], shape (n, 3).
        radius: Their radii [m], shape (n,).
        size: Length of the bed along x and y [m]; the grid covers it once.
        spacing: Wanted between the points [m]; as near to it as divides the bed.
        coordination: Contacts of each grain; grains in flight (none) are left out.

    Returns:
        A map with `height` [m]: z of the highest point of a sphere over each point of the grid, 0 (the floor) where
        there is none.

    Raises:
        ValueError: a spacing that is not above 0.
    """
    if not spacing > 0:
        raise ValueError(f"spacing is {spacing!r}; it must be above 0 (in m)")
    centres, radii = np.asarray(position, dtype=float), np.asarray(radius, dtype=float)
    if coordination is not None:
        lies = np.asarray(coordination) > 0
        centres, radii = centres[lies], radii[lies]
    counts = np.maximum(1, np.round(np.array(size) / spacing).astype(int))
    step = np.array(size) / counts
    height = np.zeros(counts[1] * counts[0])
    if len(radii):
        _raise(height, centres, radii, counts, step)
    shaped = height.reshape(counts[1], counts[0])
    return HeightMap((float(0.5 * step[0]), float(0.5 * step[1])), (float(step[0]), float(step[1])), {"height": shaped})


def _raise(
    height: NDArray[np.float64],
    centres: NDArray[np.float64],
    radii: NDArray[np.float64],
    counts: NDArray[np.int64],
    step: NDArray[np.float64],
) -> None:
    """Lift `height` to the spheres' upper sides, one offset of the grid after another for all grains at once."""
    base = np.floor(centres[:, :2] / step).astype(int)
    reach = np.ceil(radii.max() / step).astype(int)
    for i in range(-int(reach[0]), int(reach[0]) + 1):
        for j in range(-int(reach[1]), int(reach[1]) + 1):
            cell = base + (i, j)
            away = (cell + 0.5) * step - centres[:, :2]
            left = radii**2 - (away**2).sum(axis=1)
            over = left > 0
            wrapped = cell[over] % counts
            top = centres[over, 2] + np.sqrt(left[over])
            np.maximum.at(height, wrapped[:, 1] * counts[0] + wrapped[:, 0], top)
