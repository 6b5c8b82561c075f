"""Solids in plain numbers: vertices, triangles, volumes, inertias. For platforms, and for whoever draws them."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = [
    "Mesh", "box_vertices", "capped_rod", "convex_mesh", "merge", "prism_vertices", "rhombicuboctahedron_vertices",
]  # fmt: skip

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Mesh:
    """A closed surface of triangles, counter-clockwise seen from outside; one body or several."""

    vertices: Array  # Positions [m], shape [vertex_count, 3]
    faces: NDArray[np.int64]  # Indices of the corners, shape [face_count, 3]

    @property
    def volume(self) -> float:
        """Enclosed volume [m3], by the divergence theorem; bodies that overlap count twice."""
        a, b, c = (self.vertices[self.faces[:, k]] for k in range(3))
        return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6)

    @property
    def area(self) -> float:
        """Surface [m2]."""
        a, b, c = (self.vertices[self.faces[:, k]] for k in range(3))
        return float(0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum())

    @property
    def is_watertight(self) -> bool:
        """Whether every edge lies between two triangles that run along it in opposite directions."""
        edges = np.concatenate([self.faces[:, [0, 1]], self.faces[:, [1, 2]], self.faces[:, [2, 0]]])
        there = {(int(i), int(j)) for i, j in edges}
        return len(there) == len(edges) and all((j, i) in there for i, j in there)


def rhombicuboctahedron_vertices(edge: float) -> Array:
    """All permutations of (+-1, +-1, +-(1 + sqrt 2)) edge / 2 [m], shape [24, 3]: its octagons lie about the axes."""
    long = 1.0 + math.sqrt(2.0)
    signs = [(a, b, c) for a in (-1, 1) for b in (-1, 1) for c in (-1, 1)]
    corners = [np.array(sign) * np.roll((long, 1.0, 1.0), k) for k in range(3) for sign in signs]
    return 0.5 * edge * np.array(corners)


def box_vertices(size: Sequence[float]) -> Array:
    """The corners of a box about its centre, `size` along x, y, z [m], shape [8, 3]."""
    half = 0.5 * np.asarray(size, dtype=float)
    return np.array([half * (a, b, c) for a in (-1, 1) for b in (-1, 1) for c in (-1, 1)])


def prism_vertices(sides: int, diameter: float, height: float) -> Array:
    """The corners of a regular prism about its centre, axis y, standing on an edge of its side faces.

    `diameter` [m] is that of the circle through the corners. Shape [2 sides, 3].
    """
    angle = math.pi / sides + 2 * math.pi * np.arange(sides) / sides
    ring = 0.5 * diameter * np.stack([np.sin(angle), np.zeros(sides), -np.cos(angle)], axis=1)
    return np.concatenate([ring + (0.0, -0.5 * height, 0.0), ring + (0.0, 0.5 * height, 0.0)])


def convex_mesh(vertices: ArrayLike) -> Mesh:
    """The closed surface of the convex hull of `vertices` [m], shape [n, 3], each of them a corner of it."""
    from scipy.spatial import ConvexHull  # a second to load, which only those wait for who want a mesh

    points = np.asarray(vertices, dtype=float)
    hull = ConvexHull(points)
    faces = hull.simplices.astype(np.int64)
    a, b, c = (points[faces[:, k]] for k in range(3))
    inward = np.einsum("ij,ij->i", np.cross(b - a, c - a), hull.equations[:, :3]) < 0
    faces[inward] = faces[inward][:, ::-1]
    return Mesh(points, faces)


def capped_rod(start: ArrayLike, tip: ArrayLike, radius: float, *, around: int = 24, rings: int = 8) -> Mesh:
    """A rod from `start` to `tip` [m], shape (3,): flat at its start, a half ball at its end, `tip` its last point."""
    begin, end = np.asarray(start, dtype=float), np.asarray(tip, dtype=float)
    length = float(np.linalg.norm(end - begin))
    axis = (end - begin) / length
    side = np.cross(axis, (1.0, 0.0, 0.0) if abs(axis[0]) < 0.9 else (0.0, 1.0, 0.0))
    side /= np.linalg.norm(side)
    other = np.cross(axis, side)
    polar = 0.5 * math.pi * np.arange(rings) / rings
    heights = np.concatenate([[0.0], length - radius + radius * np.sin(polar)])
    radii = np.concatenate([[radius], radius * np.cos(polar)])
    angle = 2 * math.pi * np.arange(around) / around
    circle = np.cos(angle)[:, None] * side + np.sin(angle)[:, None] * other
    layers = [begin + h * axis + r * circle for h, r in zip(heights, radii, strict=True)]
    points = np.concatenate([*layers, [begin, end]])
    first, last, faces = len(points) - 2, len(points) - 1, []
    for k in range(around):
        after = (k + 1) % around
        faces.append((first, after, k))
        for ring in range(len(layers) - 1):
            low, high = ring * around, (ring + 1) * around
            faces += [(low + k, low + after, high + after), (low + k, high + after, high + k)]
        top = (len(layers) - 1) * around
        faces.append((top + k, top + after, last))
    return Mesh(points, np.array(faces, dtype=np.int64))


def merge(meshes: Sequence[Mesh]) -> Mesh:
    """Several bodies as one mesh; each stays closed by itself."""
    offsets = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes[:-1])])
    faces = [mesh.faces + offset for mesh, offset in zip(meshes, offsets, strict=True)]
    return Mesh(np.concatenate([mesh.vertices for mesh in meshes]), np.concatenate(faces))
