"""The surface of a bed as a height map: the top of the grains over each point of a level grid, so that tracks show."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from vis.pictures.frames import HeightMap

__all__ = ["height_map", "lying"]

Array = NDArray[np.float64]

NEAR = 1.1
"""Centres this near, over the sum of the radii, are of one heap [1]: grains that hop by less still lie."""


def lying(position: ArrayLike, radius: ArrayLike) -> NDArray[np.bool_]:
    """Which grains belong to the bed, and not to what flies over it or hangs on a spike.

    The lower three quarters of the grains do. Above them those belong that a chain of neighbours, a tenth of a diameter
    apart at most, joins to these. So a string of grains up a standing spike is joined to the bed too. It remains a
    tower in the height map.

    ``position``: Centres of the grains [m], shape (n, 3). radius: Their radii [m], shape (n,). Returns shape (n,).
    """
    centres, radii = np.asarray(position, dtype=float), np.asarray(radius, dtype=float)
    found = np.ones(len(radii), dtype=bool)
    if not len(radii):
        return found
    height = centres[:, 2]
    cut = np.quantile(height, 0.75)
    upper = np.flatnonzero(height >= cut - 2 * NEAR * radii.max())  # with a layer of those that lie anyway
    near = cKDTree(centres[upper]).query_pairs(2 * NEAR * radii.max(), output_type="ndarray")
    one, other = upper[near[:, 0]], upper[near[:, 1]]
    away = np.linalg.norm(centres[one] - centres[other], axis=1)
    near = near[away <= NEAR * (radii[one] + radii[other])]
    graph = coo_array((np.ones(len(near)), (near[:, 0], near[:, 1])), shape=(len(upper), len(upper)))
    count, group = connected_components(graph, directed=False)
    joined = np.zeros(count, dtype=bool)
    joined[group[height[upper] < cut]] = True
    found[upper] = joined[group] | (height[upper] < cut)
    return found


def height_map(
    position: ArrayLike, radius: ArrayLike, size: tuple[float, float], *, spacing: float, lies: ArrayLike | None = None
) -> HeightMap:
    """Height of the grains' tops over a grid on a bed that is periodic along x and y.

    ``position``: Centres of the grains [m], shape (n, 3). ``radius``: Their radii [m], shape (n,). ``size``: Length of
    the bed along x and y [m]; the grid covers it once. ``spacing``: Wanted between the points [m]; the nearest one
    that divides the bed is used. ``lies``: Which grains count, shape (n,), from `lying`; all when None.

    Returns a map with `height` [m]: z of the highest point of a sphere over each point of the grid, 0 (the floor) where
    there is none.
    Raises ValueError: a spacing that is not above 0.
    """
    if not spacing > 0:
        raise ValueError(f"spacing is {spacing!r}; it must be above 0 (in m)")
    centres, radii = np.asarray(position, dtype=float), np.asarray(radius, dtype=float)
    if lies is not None:
        kept = np.asarray(lies, dtype=bool)
        centres, radii = centres[kept], radii[kept]
    counts = np.maximum(1, np.round(np.array(size) / spacing).astype(int))
    step = np.array(size) / counts
    height = np.zeros(counts[1] * counts[0])
    if len(radii):
        _raise(height, centres, radii, counts, step)
    shaped = height.reshape(counts[1], counts[0])
    return HeightMap((float(0.5 * step[0]), float(0.5 * step[1])), (float(step[0]), float(step[1])), {"height": shaped})


def _raise(height: Array, centres: Array, radii: Array, counts: NDArray[np.int64], step: Array) -> None:
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
