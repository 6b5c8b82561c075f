"""What the kernels read of a mesh: its triangles, pseudonormals, and a tree of boxes around them.

The tree is walked without a stack: nodes lie in depth-first order, and each knows where to go on if its box is too far
(``skip``). Built by halving along the longest side of the centres' box, one triangle a leaf; the same mesh always gives
the same tree.

Pseudonormals tell inside from outside where the nearest point is on an edge or a corner: the sum of the two faces'
normals, and the faces' normals weighted with their angles (Baerentzen & Aanaes 2005, IEEE Trans. Vis. Comput. Graph.
11:243). The sign of (p - nearest) . pseudonormal is then right for every closed surface.
"""

from dataclasses import dataclass

import numpy as np

from .mesh import Mesh

__all__ = ["FEATURES", "MeshTree", "mesh_tree"]

# Where on a triangle a point lies: in the face, on the edges ab, bc, ca, at the corners a, b, c.
FEATURES = FACE, EDGE_AB, EDGE_BC, EDGE_CA, CORNER_A, CORNER_B, CORNER_C = range(7)


@dataclass(frozen=True, eq=False)
class MeshTree:
    """A mesh ready for the kernels.

    Attributes:
        low, high: Boxes of the nodes [m], shape [2 triangle_count - 1, 3]; node 0 is the whole.
        skip: The node to go on with where a box is too far, counted from node 0.
        leaf: The triangle of a leaf, else -1.
        corner, side_ab, side_ac: The triangles [m], in the order of the leaves, each of shape [triangle_count, 3].
        normals: Unit pseudonormals, shape [triangle_count, 7, 3], in the order of ``FEATURES``.
    """

    low: np.ndarray
    high: np.ndarray
    skip: np.ndarray
    leaf: np.ndarray
    corner: np.ndarray
    side_ab: np.ndarray
    side_ac: np.ndarray
    normals: np.ndarray


def mesh_tree(mesh: Mesh) -> MeshTree:
    """The tree and the pseudonormals of a mesh."""
    corners = mesh.vertices[mesh.triangles]
    low, high, skip, leaf, order = _boxes(corners)
    normals = _pseudonormals(mesh)
    corners = corners[order]
    a = corners[:, 0]
    return MeshTree(low, high, skip, leaf, a, corners[:, 1] - a, corners[:, 2] - a, normals[order])


def _boxes(corners: np.ndarray) -> tuple[np.ndarray, ...]:
    lows, highs = corners.min(axis=1), corners.max(axis=1)
    middles = 0.5 * (lows + highs)
    count = len(corners)
    order = np.arange(count)
    low, high = np.empty((2 * count - 1, 3)), np.empty((2 * count - 1, 3))
    skip, leaf = np.empty(2 * count - 1, dtype=np.int32), np.full(2 * count - 1, -1, dtype=np.int32)
    todo = [(0, 0, count)]
    while todo:
        node, start, end = todo.pop()
        part = order[start:end]
        low[node], high[node] = lows[part].min(axis=0), highs[part].max(axis=0)
        skip[node] = node + 2 * (end - start) - 1
        if end - start == 1:
            leaf[node] = start
            continue
        centres = middles[part]
        axis = int(np.ptp(centres, axis=0).argmax())
        order[start:end] = part[np.argsort(centres[:, axis], kind="stable")]
        half = (start + end) // 2
        todo += [(node + 2 * (half - start), half, end), (node + 1, start, half)]
    return low, high, skip, leaf, order


def _pseudonormals(mesh: Mesh) -> np.ndarray:
    triangles = mesh.triangles
    corners = mesh.vertices[triangles]
    sides = np.roll(corners, -1, axis=1) - corners  # ab, bc, ca
    face = _unit(np.cross(sides[:, 0], -sides[:, 2]))
    along = _unit(sides)
    angle = np.arccos(np.clip(-np.einsum("ijk,ijk->ij", along, np.roll(along, 1, axis=1)), -1.0, 1.0))
    at_vertex = np.zeros_like(mesh.vertices)
    np.add.at(at_vertex, triangles, angle[:, :, None] * face[:, None])
    starts, ends = triangles, np.roll(triangles, -1, axis=1)
    _, edge = np.unique(np.minimum(starts, ends) * len(mesh.vertices) + np.maximum(starts, ends), return_inverse=True)
    edge = edge.reshape(starts.shape)
    at_edge = np.zeros((edge.max() + 1, 3))
    np.add.at(at_edge, edge, np.broadcast_to(face[:, None], (*edge.shape, 3)))
    return np.concatenate([face[:, None], _unit(at_edge)[edge], _unit(at_vertex)[triangles]], axis=1)


def _unit(vectors: np.ndarray) -> np.ndarray:
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return vectors / np.maximum(length, 1e-300)
