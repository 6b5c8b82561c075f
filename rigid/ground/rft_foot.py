"""3D-RFT of a foot that goes straight down: the surface integral over its underside as a short series in its depth.

A piece of the underside at the height y over its lowest point is at the depth z - y. It carries xi_n (z - y) alpha_z
(`rigid.ground.rft`). So F(z) / xi_n is the integral of M(y) from 0 to z, where M(y) is alpha_z summed over the pieces
below y. Near the lowest point M is proportional to y^(roundness / 2). A flat foot has all of its area at once (0). A
lying cylinder has a strip whose width grows as the root of y (1), a ball a cap whose area grows as y (2). Hence F = A h
xi_n s^e (sum of c_k s^k) with s = z / h and e = 1 + roundness / 2. The c_k are fitted to the integral, within 0.5 % of
it. The inertia of the grains is lambda rho v^2 times the integral of cos^3 over the submerged pieces, which is
proportional to s^(e - 1). The angle is that between normal and downward.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .rft import flat_plate, tractions

__all__ = ["FLAT", "LYING", "ROUND", "FootProfile", "foot_profile"]

FLAT, LYING, ROUND = 0.0, 1.0, 2.0
"""Roundness of an underside: in how many directions it is curved."""
PIECES = 4000  # Strips of the integral from the lowest point to the widest section
DEGREE, INERTIA_DEGREE = 7, 3  # Of the two series

Array = NDArray[np.float64]


@dataclass(frozen=True)
class FootProfile:
    """The underside of a foot without dimensions: all over A h xi_n, and over A lambda rho v^2."""

    height: float  # h: depth at which the section is full [m]
    exponent: float  # e
    loading: tuple[float, ...]  # c_k, k = 0 to 7
    slope: float  # dF/ds beyond h
    wall: float  # d2F/ds2 beyond h, of upright walls
    inertia: tuple[float, ...]  # d_k, k = 0 to 3


def foot_profile(
    *, area: float, height: float, roundness: float, perimeter: float, surface_friction: float
) -> FootProfile:
    """The profile of a foot of `area` [m2] from above, whose section is full `height` [m] above its lowest point.

    ``roundness``: `FLAT` (``height`` is of no effect), `LYING` (half a circular cylinder of radius ``height``) or
    `ROUND` (half a spheroid; a ball where height = sqrt(area / pi)). ``perimeter``: of upright walls above that [m].
    Raises ValueError for another roundness, and for a round underside without a height.
    """
    if roundness not in (FLAT, LYING, ROUND):
        raise ValueError(f"roundness = {roundness:g} must be 0 (flat), 1 (a lying cylinder) or 2 (a ball)")
    wall = float(tractions([[1.0, 0.0, 0.0]], (0.0, 0.0, -1.0), surface_friction=surface_friction)[0, 2])
    across = float(np.sqrt(area / np.pi))
    if roundness == FLAT:
        side = wall * perimeter * across / area
        plate = flat_plate()
        return FootProfile(across, 1.0, (plate, 0.5 * side, *[0.0] * 6), plate + side, side, (1.0, 0.0, 0.0, 0.0))
    if height <= 0:
        raise ValueError(f"height = {height:g} m of a round foot must be above 0")
    slenderness = height / across if roundness == ROUND else 1.0
    loading, slope, inertia = _series(roundness, slenderness, surface_friction)
    return FootProfile(height, 1 + roundness / 2, loading, slope, wall * perimeter * height / area, inertia)


@lru_cache(maxsize=256)
def _series(roundness: float, slenderness: float, surface_friction: float) -> tuple[Any, float, Any]:
    """c_k, the slope at the full section, and d_k; ``slenderness``: height over the radius of the widest section."""
    edge = 0.5 * np.pi * np.arange(PIECES + 1) / PIECES
    angle = 0.5 * (edge[1:] + edge[:-1])
    across, upright = np.cos(angle), np.sin(angle)
    if roundness == ROUND:  # rings of a spheroid of radius 1, over its section pi
        length = np.hypot(across, slenderness * upright)
        shares = 2 * upright * length * np.diff(edge)
        cosine = across / length
    else:  # strips of a cylinder of radius 1, over its width 2
        shares, cosine = np.diff(edge), across
    normals = np.stack([np.sqrt(np.maximum(1 - cosine**2, 0.0)), np.zeros(PIECES), -cosine], axis=1)
    upward = tractions(normals, (0.0, 0.0, -1.0), surface_friction=surface_friction)[:, 2]
    below = np.concatenate([[0.0], np.cumsum(upward * shares)])
    depth = 1 - np.cos(edge)
    force = np.concatenate([[0.0], np.cumsum(0.5 * (below[1:] + below[:-1]) * np.diff(depth))])
    moved = np.concatenate([[0.0], np.cumsum(cosine**3 * shares)])
    first = PIECES // 100  # nearer to the lowest point the strips are too few
    s, exponent = depth[first:], 1 + roundness / 2
    loading = _fit(s, force[first:] / s**exponent, DEGREE)
    inertia = _fit(s, moved[first:] / s ** (exponent - 1), INERTIA_DEGREE)
    return loading, float(below[-1]), inertia


def _fit(s: Array, values: Array, degree: int) -> tuple[float, ...]:
    """Coefficients of the powers of s from 0 on, by least squares."""
    found = np.linalg.lstsq(s[:, None] ** np.arange(degree + 1), values, rcond=None)[0]
    return tuple(float(number) for number in found)
