"""What one measures on a bed: packing profile, bulk packing fraction, the height of the surface."""

import math

import numpy as np

__all__ = ["bulk_packing", "packing_profile", "surface_height"]


def packing_profile(heights: np.ndarray, radii: np.ndarray, area: float, edges: np.ndarray) -> np.ndarray:
    """Laterally averaged packing fraction between horizontal planes, exact for spheres.

    Args:
        heights, radii: z of the centres and radii of the grains [m], shape [grain_count]. area: of the bed [m2].
        edges: heights of the planes [m], ascending, shape [slab_count + 1].

    Returns the packing fraction of each slab [1], shape [slab_count].
    """
    below = np.empty(len(edges))
    for k, z in enumerate(edges):
        t = np.clip(z - heights, -radii, radii)
        # Volume of a sphere below a plane at height t from its centre.
        below[k] = (math.pi * (radii**2 * (t + radii) - (t**3 + radii**3) / 3)).sum()
    return np.diff(below) / (area * np.diff(edges))


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
    profile = packing_profile(heights, radii, area, edges)
    middle = 0.5 * (edges[1:] + edges[:-1])
    reached = np.flatnonzero(profile >= 0.5 * bulk)
    k = int(reached[-1]) if len(reached) else len(profile) - 1
    if k + 1 == len(profile):
        return top
    above, below = profile[k + 1], profile[k]
    return float(middle[k] + (below - 0.5 * bulk) / (below - above) * (middle[k + 1] - middle[k]))
