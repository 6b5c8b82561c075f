"""Closed triangle meshes of the bodies that pictures and frames show.

Every mesh is a pair `(points, triangles)`: points [m], shape (n, 3), float64; triangles, shape (m, 3), int64, ordered
so that the normals point out of the body.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["in_place", "mesh_volume", "revolve", "shape_mesh", "spike_mesh", "spike_profile"]

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

    ``tip``: "sphere", "cone" or "flat". ``diameter``: Diameter of the tip [m]. ``length``: From the tip's lowest point
    to the shaft's upper end [m]. ``shaft_diameter``: Diameter of the shaft [m], at most the tip's; None: as the tip.
    ``cone_angle``: Full angle of a conical tip [degrees]. ``segments``: Segments of a full circle. Returns radius and
    height [m], shape (k, 2). Raises ValueError: an unknown tip, a size that is not positive, an angle out of range, a
    length within the tip, fewer than 3 segments. The shaft may not be thicker than the tip, nor thinner than a flat
    one.
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

    ``profile``: Radius and height [m], shape (k, 2), from the lowest point to the highest one; only these two ends lie
    on the axis. ``segments``: Segments of a full circle. Raises ValueError: an outline of another shape, one that does
    not start and end on the axis, or touches it between.
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
        parts += _sides(1 + ring * segments, 1 + (ring + 1) * segments, segments)
    low = 1 + (len(rings) - 1) * segments
    parts.append(np.column_stack([low + here, low + following, np.full(segments, len(points) - 1)]))
    return points, np.vstack(parts).astype(np.int64)


def _sides(low: int, high: int, segments: int) -> list[NDArray[np.int64]]:
    """Triangles between two rings of points, by the numbers of their first points."""
    here = np.arange(segments)
    following = (here + 1) % segments
    return [
        np.column_stack([low + here, low + following, high + following]),
        np.column_stack([low + here, high + following, high + here]),
    ]


def spike_mesh(tip: str = "sphere", *, segments: int = 72, **sizes: Any) -> Mesh:
    """Closed mesh of a spike, its lowest point at the origin, its axis along +z; arguments as `spike_profile`.

    Returns points [m], shape (n, 3), and triangles, shape (m, 3). Raises ValueError: as `spike_profile`.
    """
    return revolve(spike_profile(tip, segments=segments, **sizes), segments=segments)


def mesh_volume(points: ArrayLike, triangles: ArrayLike) -> float:
    """Volume [m3] of a closed mesh by the divergence theorem; positive where the normals point outwards."""
    corners = np.asarray(points, dtype=np.float64)[np.asarray(triangles)]
    return float(np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6.0)


def shape_mesh(shape: Any, *, segments: int = 72) -> Mesh:
    """Surface of a shape that grains touch, or of several, in the body's frame; where several overlap, both are shown.

    ``shape``: What `Bed.add_body` takes, one or a sequence. An object is called Ball, Box, Capsule, Cone, Cylinder,
    Mesh, Placed, Polyhedron or Tube, and has the sizes [m] of `dem`'s shape of that name. ``segments``: Segments of a
    full circle. Raises ValueError: another shape (a Plane has no end), no shape at all.
    """
    if isinstance(shape, (list, tuple)):
        if not shape:
            raise ValueError("shape is empty; at least one shape was expected")
        parts = [shape_mesh(part, segments=segments) for part in shape]
        before = np.cumsum([0, *(len(points) for points, _ in parts)])
        triangles = [faces + first for (_, faces), first in zip(parts, before, strict=False)]
        return np.concatenate([points for points, _ in parts]), np.concatenate(triangles)
    kind = type(shape).__name__
    if kind not in _SURFACES:
        raise ValueError(f"shape is a {kind}; a surface can be shown of {', '.join(_SURFACES)}")
    return _SURFACES[kind](shape, segments)


def in_place(points: ArrayLike, position: ArrayLike, turn: ArrayLike = (1.0, 0.0, 0.0, 0.0)) -> NDArray[np.float64]:
    """Points of a body's frame [m], shape (n, 3), where the body is: turned by a unit quaternion, scalar first, and put
    at `position` [m]."""
    q = np.asarray(turn, dtype=np.float64)
    given = np.asarray(points, dtype=np.float64)
    twist = 2.0 * np.cross(q[1:], given)
    return given + q[0] * twist + np.cross(q[1:], twist) + np.asarray(position, dtype=np.float64)


def _frustum(shape: Any, low: float, high: float, segments: int) -> Mesh:
    outline = [(0.0, shape.bottom), (low, shape.bottom), (high, shape.top), (0.0, shape.top)]
    return revolve([p for k, p in enumerate(outline) if k in (0, 3) or p[0] > 0.0], segments=segments)


def _capsule(shape: Any, segments: int) -> Mesh:
    """A ball with its halves apart, its axis turned from z to that from `start` to `end`."""
    start, along = np.asarray(shape.start, dtype=float), np.subtract(shape.end, shape.start).astype(float)
    points, triangles = _ball(shape.radius, segments, apart=float(np.linalg.norm(along)))
    axis = along / np.linalg.norm(along)
    # Half way between z and the axis; where they are opposed, half a turn about x.
    turn = np.array([1.0 + axis[2], -axis[1], axis[0], 0.0]) if axis[2] > -1.0 + 1e-12 else np.array([0.0, 1.0, 0, 0])
    return in_place(points, start, turn / np.linalg.norm(turn)), triangles


def _ball(radius: float, segments: int, *, centre: ArrayLike = (0.0, 0.0, 0.0), apart: float = 0.0) -> Mesh:
    """A ball; its upper half moved up by `apart`."""
    count = 2 * max(1, math.ceil(segments / 4))
    angles = np.linspace(0.0, np.pi, count + 1)
    outline = radius * np.column_stack([np.sin(angles), -np.cos(angles)])
    outline[[0, -1], 0] = 0.0
    if apart > 0.0:
        outline = np.insert(outline, count // 2, outline[count // 2], axis=0)
        outline[count // 2 + 1 :, 1] += apart
    points, triangles = revolve(outline, segments=segments)
    return points + np.asarray(centre), triangles


def _box(shape: Any, segments: int) -> Mesh:
    corners = np.array([[k & 1, k >> 1 & 1, k >> 2 & 1] for k in range(8)]) - 0.5
    quads = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    triangles = [(a, *pair) for a, b, c, d in quads for pair in ((b, c), (c, d))]
    return corners * np.asarray(shape.size) + np.asarray(shape.center), np.array(triangles, dtype=np.int64)


def _tube(shape: Any, segments: int) -> Mesh:
    """Four rings: outside below and above, inside above and below."""
    rings = [(shape.outer_radius, shape.bottom), (shape.outer_radius, shape.top)]
    rings += [(shape.inner_radius, shape.top), (shape.inner_radius, shape.bottom)]
    angle = 2.0 * np.pi * np.arange(segments) / segments
    points = [np.column_stack([r * np.cos(angle), r * np.sin(angle), np.full(segments, z)]) for r, z in rings]
    triangles = [side for k in range(4) for side in _sides(k * segments, (k + 1) % 4 * segments, segments)]
    return np.concatenate(points), np.concatenate(triangles).astype(np.int64)


def _placed(shape: Any, segments: int) -> Mesh:
    points, triangles = shape_mesh(shape.shape, segments=segments)
    turn = np.asarray(shape.turn, dtype=np.float64)
    return in_place(points, shape.position, turn / np.linalg.norm(turn)), triangles


def _given(shape: Any, segments: int) -> Mesh:
    """Of a mesh or a polyhedron, which has its triangles."""
    return np.array(shape.mesh.vertices, dtype=np.float64), np.array(shape.mesh.triangles, dtype=np.int64)


_SURFACES: dict[str, Callable[[Any, int], Mesh]] = {
    "Ball": lambda shape, segments: _ball(shape.radius, segments, centre=shape.center),
    "Box": _box,
    "Capsule": _capsule,
    "Cone": lambda shape, segments: _frustum(shape, shape.bottom_radius, shape.top_radius, segments),
    "Cylinder": lambda shape, segments: _frustum(shape, shape.radius, shape.radius, segments),
    "Mesh": _given,
    "Placed": _placed,
    "Polyhedron": _given,
    "Tube": _tube,
}
