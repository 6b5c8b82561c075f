"""Closed triangle meshes of the bodies that pictures and frames show.

Every mesh is a pair `(points, triangles)`: points [m], shape (n, 3), float64; triangles, shape (m, 3), int64, ordered
so that the normals point out of the body.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["mesh_volume", "revolve", "spike_mesh", "spike_profile"]

Mesh = tuple[NDArray[np.float64], NDArray[np.int64]]


def spike_profile(
    tip: str,
    *,
    diameter: float,
    length: float,
    shaft_diameter: float | None = None,
    cone_angle: float = 60.0,
    segments: int = 72,
) -> NDArray[np.float64]:
    """Outline of a spike from its lowest point (0, 0) to the middle of its top.

    Args:
        tip: "sphere", "cone" or "flat".
        diameter: Diameter of the tip [m].
        length: From the tip's lowest point to the shaft's upper end [m].
        shaft_diameter: Diameter of the shaft [m], at most the tip's; None: as the tip.
        cone_angle: Full angle of a conical tip [degrees].
        segments: Segments of a full circle.

    Returns:
        Radius and height [m], shape (k, 2).

    Raises:
        ValueError: an unknown tip, a size that is not positive, a shaft thicker than the tip or thinner than a flat
            one, an angle out of range, a length within the tip, fewer than 3 segments.
    """
    shaft_diameter = diameter if shaft_diameter is None else shaft_diameter
    for name, value in (("diameter", diameter), ("shaft_diameter", shaft_diameter), ("length", length)):
        if not (math.isfinite(value) and value > 0.0):
            raise ValueError(f"{name} is {value!r}; it must be a positive length in metres")
    if shaft_diameter > diameter:
        raise ValueError(f"shaft_diameter is {shaft_diameter!r}; it must be at most the tip's, {diameter!r}")
    if segments < 3:
        raise ValueError(f"segments is {segments!r}; a circle needs at least 3")
    wide, thin = 0.5 * diameter, 0.5 * shaft_diameter
    if tip == "sphere":
        # up to the equator, and beyond it to where a thinner shaft leaves the ball
        last = math.pi - math.asin(thin / wide)
        angles = np.linspace(0.0, last, max(3, math.ceil(segments * last / (2.0 * math.pi)) + 1))
        curve = np.column_stack([wide * np.sin(angles), wide * (1.0 - np.cos(angles))])
    elif tip == "cone":
        if not 0.0 < cone_angle < 180.0:
            raise ValueError(f"cone_angle is {cone_angle!r}; it must lie between 0 and 180 degrees")
        curve = np.array([[0.0, 0.0], [wide, wide / math.tan(math.radians(0.5 * cone_angle))]])
    elif tip == "flat":
        if thin != wide:
            raise ValueError(f"shaft_diameter is {shaft_diameter!r}; a flat tip is as wide as its shaft, {diameter!r}")
        curve = np.array([[0.0, 0.0], [wide, 0.0]])
    else:
        raise ValueError(f"tip is {tip!r}; it must be 'sphere', 'cone' or 'flat'")
    base = float(curve[-1, 1])
    if length <= base:
        raise ValueError(f"length is {length!r}; it must exceed the tip's own height, {base!r}")
    profile = np.vstack([curve, [[thin, base], [thin, length], [0.0, length]]])
    profile[0, 0] = 0.0
    keep = np.ones(len(profile), dtype=bool)
    keep[1:] = np.linalg.norm(np.diff(profile, axis=0), axis=1) > 1e-12 * wide
    return profile[keep]


def revolve(profile: ArrayLike, *, segments: int = 72) -> Mesh:
    """Closed surface of revolution of an outline about +z.

    Args:
        profile: Radius and height [m], shape (k, 2), from the lowest point on the axis to the highest one on the axis;
            only the two ends lie on the axis.
        segments: Segments of a full circle.

    Raises:
        ValueError: an outline of another shape, one that does not start and end on the axis, or touches it between.
    """
    outline = np.asarray(profile, dtype=np.float64)
    if outline.ndim != 2 or outline.shape[1] != 2 or len(outline) < 3:
        raise ValueError(f"profile has shape {outline.shape}; it must be (k, 2) with k >= 3")
    if outline[0, 0] != 0.0 or outline[-1, 0] != 0.0 or np.any(outline[1:-1, 0] <= 0.0):
        raise ValueError("profile must start and end on the axis (radius 0) and keep off it between")
    if segments < 3:
        raise ValueError(f"segments is {segments!r}; a circle needs at least 3")
    angle = 2.0 * np.pi * np.arange(segments) / segments
    rings = outline[1:-1]
    points = np.empty((2 + len(rings) * segments, 3))
    points[0] = (0.0, 0.0, outline[0, 1])
    points[-1] = (0.0, 0.0, outline[-1, 1])
    points[1:-1, 0] = np.outer(rings[:, 0], np.cos(angle)).ravel()
    points[1:-1, 1] = np.outer(rings[:, 0], np.sin(angle)).ravel()
    points[1:-1, 2] = np.repeat(rings[:, 1], segments)
    here = np.arange(segments)
    following = (here + 1) % segments
    parts = [np.column_stack([np.zeros(segments, dtype=np.int64), 1 + following, 1 + here])]
    for ring in range(len(rings) - 1):
        low, high = 1 + ring * segments, 1 + (ring + 1) * segments
        parts.append(np.column_stack([low + here, low + following, high + following]))
        parts.append(np.column_stack([low + here, high + following, high + here]))
    low = 1 + (len(rings) - 1) * segments
    parts.append(np.column_stack([low + here, low + following, np.full(segments, len(points) - 1)]))
    return points, np.vstack(parts).astype(np.int64)


def spike_mesh(
    tip: str = "sphere",
    *,
    diameter: float,
    length: float,
    shaft_diameter: float | None = None,
    cone_angle: float = 60.0,
    segments: int = 72,
) -> Mesh:
    """Closed mesh of a spike, its lowest point at the origin, its axis along +z; arguments as `spike_profile`.

    Returns:
        Points [m], shape (n, 3), and triangles, shape (m, 3).

    Raises:
        ValueError: as `spike_profile`.
    """
    profile = spike_profile(
        tip, diameter=diameter, length=length, shaft_diameter=shaft_diameter, cone_angle=cone_angle, segments=segments
    )
    return revolve(profile, segments=segments)


def mesh_volume(points: ArrayLike, triangles: ArrayLike) -> float:
    """Volume [m3] of a closed mesh by the divergence theorem; positive where the normals point outwards."""
    corners = np.asarray(points, dtype=np.float64)[np.asarray(triangles)]
    return float(np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6.0)
