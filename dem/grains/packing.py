"""How many grains of which size, their first positions and order in memory; and how densely they lie."""

import math
from collections.abc import Sequence

import numpy as np

from .sizes import Sizes, Uniform, sizes_of

__all__ = ["bulk_packing", "curve_ranks", "draw_radii", "packing_profile", "rain_column", "rain_positions"]

RAIN_COLUMN = 2.5  # Upper bound of the rain's column over the depth of the levelled bed [1]: what a grain can fall


def draw_radii(
    rng: np.random.Generator, volume: float, grain: float | Sizes, spread: float | None = None
) -> np.ndarray:
    """Radii of grains whose volumes add up to a solid volume, but for chance.

    Args:
        volume: of solid [m3].
        grain, spread: as ``dem.grains.sizes.sizes_of`` takes them.

    Returns radii [m], shape [grain_count]; at least one.

    Raises ValueError: a volume that is not positive, or what ``dem.grains.sizes.sizes_of`` refuses.
    """
    if not (math.isfinite(volume) and volume > 0):
        raise ValueError(f"volume = {volume} must be positive [m3]")
    sizes = sizes_of(grain, spread)
    count = max(1, round(volume / (math.pi / 6 * sizes.mean_cube)))
    if isinstance(sizes, Uniform):
        # In this order of products since the first beds, whose bits it keeps.
        return 0.5 * sizes.mean * (1 + sizes.spread * rng.uniform(-1, 1, count))
    return 0.5 * sizes.draw(rng, count)


def rain_column(sizes: Sizes) -> float:
    """Upper bound of the rain's column over the depth of the levelled bed [1].

    ``RAIN_COLUMN`` as long as sizes are alike. The lattice has a site of the largest grain's size for every grain, so a
    wide distribution makes a higher column. The factor is the ratio of the largest to the mean cube, over that of a
    uniform one (spread 0.15).
    """
    if isinstance(sizes, Uniform):
        return RAIN_COLUMN
    like = Uniform(1.0)
    return RAIN_COLUMN * max(1.0, (sizes.bounds[1] ** 3 / sizes.mean_cube) / (like.bounds[1] ** 3 / like.mean_cube))


def rain_positions(
    rng: np.random.Generator, radii: np.ndarray, period: Sequence[float], *, sites: tuple[float, float] = (1.02, 1.5)
) -> np.ndarray:
    """Centres of grains in a loose jittered column above z = 0, none touching, periodic in x and y.

    Layers are one and a half of the largest diameters apart, so that the grains fall as rain rather than as a block.

    Args:
        radii: [m], shape [grain_count]. period: (x, y) [m].
        sites: least distance of the lattice's sites aside, and their distance upwards [largest diameters].

    Returns centres [m], shape [grain_count, 3].
    """
    largest = 2 * float(radii.max())
    nx, ny = (max(1, int(length / (sites[0] * largest))) for length in period)
    cell = (period[0] / nx, period[1] / ny, sites[1] * largest)
    k, rest = np.divmod(np.arange(len(radii)), nx * ny)
    j, i = np.divmod(rest, nx)
    lattice = np.column_stack([i + 0.5, j + 0.5, k + 0.5]) * cell
    # A grain may go as far from its site as its own radius leaves room.
    play = 0.5 * (np.array(cell) - 2 * radii[:, None]) * 0.98
    return lattice + rng.uniform(-1, 1, lattice.shape) * play


def curve_ranks(nx: int, ny: int, nz: int) -> np.ndarray:
    """Rank of each cell on a Morton curve, shape [nx ny nz], x fastest: cells that are near get ranks that are near."""
    bits = max(1, math.ceil(math.log2(max(nx, ny, nz, 2))))

    def spread(a):
        result = np.zeros_like(a)
        for bit in range(bits):
            result |= ((a >> bit) & 1) << (3 * bit)
        return result

    code = spread(np.arange(nz))[:, None, None] << 2 | spread(np.arange(ny))[:, None] << 1 | spread(np.arange(nx))
    code = code.ravel()
    rank = np.empty(code.size, dtype=np.int32)
    rank[np.argsort(code, kind="stable")] = np.arange(code.size, dtype=np.int32)
    return rank


def packing_profile(heights: np.ndarray, radii: np.ndarray, area: float, edges: np.ndarray) -> np.ndarray:
    """Laterally averaged packing fraction between horizontal planes, exact for spheres.

    Args:
        heights, radii: z of the centres and radii of the grains [m], shape [grain_count]. area: of the bed [m2].
        edges: heights of the planes [m], ascending, shape [slab_count + 1].

    Returns the packing fraction of each slab [1], shape [slab_count].
    """
    below = np.array([_volumes_below(z, heights, radii).sum() for z in edges])
    return np.diff(below) / (area * np.diff(edges))


def _volumes_below(z: float, heights: np.ndarray, radii: np.ndarray) -> np.ndarray:
    """Volume of each sphere below a plane [m3]."""
    t = np.clip(z - heights, -radii, radii)
    return math.pi * (radii**2 * (t + radii) - (t**3 + radii**3) / 3)


def bulk_packing(heights: np.ndarray, radii: np.ndarray, area: float) -> float:
    """Packing fraction between two mean diameters above the floor and two below the highest decile of grains [1].

    A layer thinner than that is measured as a whole, from the floor to its highest grain.
    """
    d = 2 * float(radii.mean())
    low, high = 2 * d, float(np.quantile(heights, 0.9)) - 2 * d
    if high < low + d:
        low, high = 0.0, float((heights + radii).max())
    return float(packing_profile(heights, radii, area, np.array([low, high]))[0])


def surface_height(heights: np.ndarray, radii: np.ndarray, area: float, *, bulk: float) -> float:
    """z [m] where the laterally averaged packing fraction falls to half its bulk value.

    The profile is taken in slabs of a twentieth of a diameter, from above; the value between slabs is interpolated.
    """
    d = 2 * float(radii.mean())
    top = float((heights + radii).max())
    count = max(2, math.ceil(top / (0.05 * d)))
    edges = np.linspace(0.0, top, count + 1)
    middle = 0.5 * (edges[1:] + edges[:-1])
    # Slab by slab from the top; going down, only spheres that reach above the plane have another volume below it.
    volumes = _volumes_below(top, heights, radii)
    upper, above = volumes.sum(), math.nan
    for k in range(count - 1, -1, -1):
        cut = np.flatnonzero(edges[k] - heights < radii)
        volumes[cut] = _volumes_below(edges[k], heights[cut], radii[cut])
        lower = volumes.sum()
        here = (upper - lower) / (area * (edges[k + 1] - edges[k]))
        if here >= 0.5 * bulk:
            break
        upper, above = lower, here
    else:
        k = count - 1
    if k + 1 == count:
        return top
    return float(middle[k] + (here - 0.5 * bulk) / (here - above) * (middle[k + 1] - middle[k]))
