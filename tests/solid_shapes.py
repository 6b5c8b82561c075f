"""Meshes for tests, made of numpy alone, and the distance to one by trying everything."""

from __future__ import annotations

import itertools

import numpy as np

# The faces of a box as rows of two triangles each, corners numbered by bits x + 2 y + 4 z; normals out.
_BOX = [
    (0, 2, 3), (0, 3, 1), (4, 5, 7), (4, 7, 6), (0, 1, 5), (0, 5, 4),
    (2, 6, 7), (2, 7, 3), (0, 4, 6), (0, 6, 2), (1, 3, 7), (1, 7, 5),
]  # fmt: skip


def box(size, center=(0.0, 0.0, 0.0)):
    """Vertices and triangles of a box."""
    corners = np.array([[k & 1, k >> 1 & 1, k >> 2 & 1] for k in range(8)]) - 0.5
    return corners * np.array(size) + np.array(center), np.array(_BOX)


def finer(vertices, triangles):
    """Each triangle cut into four."""
    vertices, middles, rows = list(map(tuple, vertices)), {}, []

    def middle(i, j):
        key = (min(i, j), max(i, j))
        if key not in middles:
            middles[key] = len(vertices)
            vertices.append(tuple(0.5 * (np.array(vertices[key[0]]) + np.array(vertices[key[1]]))))
        return middles[key]

    for a, b, c in triangles:
        ab, bc, ca = middle(a, b), middle(b, c), middle(c, a)
        rows += [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
    return np.array(vertices), np.array(rows)


def star(radius, seed=5):
    """A ball of 768 triangles with dents and spikes: not convex anywhere for long."""
    vertices, triangles = box((1.0, 1.0, 1.0))
    for _ in range(3):
        vertices, triangles = finer(vertices, triangles)
    vertices /= np.linalg.norm(vertices, axis=1)[:, None]
    rng = np.random.default_rng(seed)
    return vertices * (radius * rng.uniform(0.6, 1.0, len(vertices)))[:, None], triangles


def corner_bracket(arm, width):
    """An L extruded along z: one concave edge."""
    outline = np.array([(0, 0), (arm, 0), (arm, width), (width, width), (width, arm), (0, arm)], dtype=float)
    faces = [(0, 1, 2), (0, 2, 3), (0, 3, 5), (3, 4, 5)]
    vertices = np.concatenate([np.column_stack([outline, np.full(6, z)]) for z in (0.0, arm)])
    triangles = [(a, c, b) for a, b, c in faces] + [(a + 6, b + 6, c + 6) for a, b, c in faces]
    for a, b in itertools.pairwise([*range(6), 0]):
        triangles += [(a, b, b + 6), (a, b + 6, a + 6)]
    return vertices, np.array(triangles)


def nearest_by_trying(vertices, triangles, point):
    """Distance to every triangle's face, where the point stands over it, and to its sides; the least, and where."""
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    n = np.cross(b - a, c - a)
    n /= np.linalg.norm(n, axis=1)[:, None]
    foot = point - np.einsum("ij,ij->i", point - a, n)[:, None] * n
    over, candidates = np.ones(len(n), dtype=bool), []
    for p, q in ((a, b), (b, c), (c, a)):
        over &= np.einsum("ij,ij->i", np.cross(q - p, foot - p), n) >= 0
        share = np.einsum("ij,ij->i", point - p, q - p) / ((q - p) ** 2).sum(axis=1)
        candidates.append(p + np.clip(share, 0, 1)[:, None] * (q - p))
    candidates = np.concatenate([foot[over], *candidates])
    distance = np.linalg.norm(point - candidates, axis=1)
    return distance.min(), candidates[distance.argmin()]


def inside(vertices, triangles, point):
    """Whether the surface surrounds a point: its solid angle (van Oosterom & Strackee 1983) is 4 pi, not 0."""
    a, b, c = (vertices[triangles[:, k]] - point for k in range(3))
    la, lb, lc = (np.linalg.norm(v, axis=1) for v in (a, b, c))
    top = np.einsum("ij,ij->i", a, np.cross(b, c))
    bottom = la * lb * lc + (a * b).sum(1) * lc + (b * c).sum(1) * la + (c * a).sum(1) * lb
    return 2 * np.arctan2(top, bottom).sum() > 2 * np.pi
