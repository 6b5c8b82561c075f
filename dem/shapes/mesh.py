"""Bodies given by their surface: closed triangle meshes, convex polyhedra, and the files they come from.

A mesh must separate inside from outside, else it is refused. Every edge belongs to two triangles that run along it in
opposite directions, and the normals point outwards. Whether the surface intersects itself is not checked.
"""

import contextlib
import io
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from .basic import MESH, Bounds, Shape

__all__ = ["Feature", "Mesh", "MeshTree", "Polyhedron", "mesh_from_file", "mesh_tree"]

# A triangle whose height is less than this share of its longest side has no normal to speak of.
_LEAST_HEIGHT = 1e-10


class Surface(Shape):
    """A body that its surface of triangles, ``mesh``, encloses."""

    kind = MESH
    mesh: "Mesh"

    def extent(self) -> float:
        return float(np.sqrt((self.mesh.vertices**2).sum(axis=1).max()))

    def bounds(self) -> Bounds:
        return self.mesh.vertices.min(axis=0), self.mesh.vertices.max(axis=0)


@dataclass(frozen=True, eq=False)
class Mesh(Surface):
    """A closed surface of triangles in the body's frame; what it encloses is solid. Cavities are allowed.

    A grain touches it at the point of the surface nearest to its centre, wherever that lies: in a face, on an edge or
    at a corner. R* is the grain's radius, as on every flat part.

    Attributes:
        vertices: Corners [m], shape [vertex_count, 3]; those that coincide exactly are made one (STL repeats them).
        triangles: Rows of three vertices, shape [triangle_count, 3], counter-clockwise seen from outside.

    Raises ValueError: no triangles; numbers that are not finite; a triangle without area or that names a vertex there
    is not. Each edge must have two triangles, neighbours must agree on the outside, and the surface must not be inside
    out.
    """

    vertices: np.ndarray
    triangles: np.ndarray

    def __post_init__(self):
        vertices, triangles = _arrays(self.vertices, self.triangles)
        _refuse_degenerate(vertices, triangles)
        _refuse_open(vertices, triangles)
        _refuse_inverted(vertices, triangles)
        for array in (vertices, triangles):
            array.flags.writeable = False
        object.__setattr__(self, "vertices", vertices)
        object.__setattr__(self, "triangles", triangles)

    @property
    def mesh(self) -> "Mesh":  # type: ignore[override]
        """Itself."""
        return self

    @property
    def volume(self) -> float:
        """What the surface encloses [m3]."""
        return float(_volumes(self.vertices, self.triangles).sum())


@dataclass(frozen=True, eq=False)
class Polyhedron(Surface):
    """A convex polyhedron: the hull of its corners.

    Attributes:
        vertices: Corners in the body's frame [m], shape [vertex_count, 3].
        mesh: The hull as triangles.

    Raises ValueError: fewer than four corners, all in one plane, or a corner inside the hull of the others.
    """

    vertices: np.ndarray | Sequence[Sequence[float]]
    mesh: Mesh = field(init=False, repr=False)

    def __post_init__(self):
        from scipy.spatial import ConvexHull, QhullError

        vertices = np.asarray(self.vertices, dtype=float)
        if vertices.ndim != 2 or vertices.shape[1] != 3 or len(vertices) < 4 or not np.isfinite(vertices).all():
            raise ValueError(
                f"Polyhedron: vertices has shape {vertices.shape}; at least four rows of three finite numbers [m]"
            )
        try:
            hull = ConvexHull(vertices)
        except QhullError:
            raise ValueError(f"Polyhedron: the {len(vertices)} vertices lie in one plane; it needs a volume") from None
        depth = -(vertices @ hull.equations[:, :3].T + hull.equations[:, 3]).max(axis=1)
        if depth.max() > 1e-9 * np.ptp(vertices, axis=0).max():
            k = int(depth.argmax())
            raise ValueError(
                f"Polyhedron: vertex {k} at {tuple(vertices[k].tolist())} m lies inside the hull of the others, so "
                f"that it is not convex; leave it out, or give a Mesh"
            )
        triangles = hull.simplices.astype(np.int64)
        a, b, c = (vertices[triangles[:, k]] for k in range(3))
        inwards = np.einsum("ij,ij->i", np.cross(b - a, c - a), hull.equations[:, :3]) < 0
        triangles[inwards] = triangles[inwards][:, ::-1]
        object.__setattr__(self, "vertices", vertices)
        object.__setattr__(self, "mesh", Mesh(vertices, triangles))


def mesh_from_file(path: str | Path, *, scale: float = 1.0, flip: bool = False) -> Mesh:
    """A mesh from a file of triangles or quadrilaterals that meshio reads: STL, OBJ, PLY, VTU, ...

    Args:
        scale: Metres per unit of the file. STL and OBJ do not say theirs; drawings are often in millimetres (0.001).
        flip: Turn every triangle round: for files whose normals point inwards.

    Raises ValueError: no such file, one that meshio cannot read or that holds no surface; a scale that is not positive;
    and what ``Mesh`` refuses.
    """
    import meshio

    path = Path(path)
    if not (math.isfinite(scale) and scale > 0):
        raise ValueError(f"scale = {scale} must be a positive number of metres per unit of {path.name}")
    if not path.is_file():
        raise ValueError(f"{path}: no such file; an STL, OBJ or other mesh of triangles was expected")
    try:
        quiet = io.StringIO()
        with contextlib.redirect_stdout(quiet), contextlib.redirect_stderr(quiet), np.errstate(over="ignore"):
            found = meshio.read(path)
    except (Exception, SystemExit) as problem:  # meshio leaves the process where no reader of its takes the file
        raise ValueError(f"{path} is no mesh that meshio can read ({problem}); use STL, OBJ, PLY or VTU") from None
    faces = [block.data for block in found.cells if block.type == "triangle"]
    faces += [
        block.data[:, corners] for block in found.cells if block.type == "quad" for corners in ([0, 1, 2], [0, 2, 3])
    ]
    if not faces:
        kinds = ", ".join(sorted({block.type for block in found.cells})) or "nothing"
        raise ValueError(f"{path} holds {kinds}; triangles or quadrilaterals were expected")
    triangles = np.concatenate(faces)
    points = np.asarray(found.points, dtype=float)
    if points.shape[1] != 3:
        raise ValueError(f"{path} is a mesh in {points.shape[1]} dimensions; 3 were expected")
    try:
        return Mesh(scale * points, triangles[:, ::-1] if flip else triangles)
    except ValueError as problem:
        raise ValueError(f"{path}: {problem}") from None


def _arrays(vertices, triangles) -> tuple[np.ndarray, np.ndarray]:
    """Checked for shape and numbers; coinciding vertices made one, in the order in which they come."""
    vertices = np.asarray(vertices, dtype=float)
    triangles = np.asarray(triangles)
    if triangles.size == 0:
        raise ValueError("Mesh: triangles is empty; a surface needs at least four")
    if vertices.ndim != 2 or vertices.shape[1] != 3:
        raise ValueError(f"Mesh: vertices has shape {vertices.shape}, [vertex_count, 3] was expected")
    if triangles.ndim != 2 or triangles.shape[1] != 3 or not np.issubdtype(triangles.dtype, np.integer):
        raise ValueError(
            f"Mesh: triangles has shape {triangles.shape} of {triangles.dtype}; integers, [triangle_count, 3], "
            f"were expected"
        )
    if not np.isfinite(vertices).all():
        row = int(np.argwhere(~np.isfinite(vertices))[0][0])
        raise ValueError(f"Mesh: vertex {row} = {tuple(vertices[row].tolist())} must be finite [m]")
    wrong = ((triangles < 0) | (triangles >= len(vertices))).any(axis=1)
    if wrong.any():
        k = int(wrong.argmax())
        raise ValueError(
            f"Mesh: triangle {k} = {triangles[k].tolist()} names a vertex beyond the {len(vertices)} given"
        )
    triangles = triangles.astype(np.int64)
    _, first, same = np.unique(vertices + 0.0, axis=0, return_index=True, return_inverse=True)
    used = np.zeros(len(first), dtype=bool)
    triangles = same.reshape(-1)[triangles]
    used[triangles] = True
    order = np.argsort(np.where(used, first, len(vertices)), kind="stable")[: used.sum()]
    place = np.empty(len(first), dtype=np.int64)
    place[order] = np.arange(len(order))
    return vertices[first[order]], place[triangles]


def _point(p: np.ndarray) -> str:
    return "({:.6g}, {:.6g}, {:.6g})".format(*p)


def _refuse_degenerate(vertices: np.ndarray, triangles: np.ndarray) -> None:
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    longest = np.sqrt(np.max([((b - a) ** 2).sum(1), ((c - b) ** 2).sum(1), ((a - c) ** 2).sum(1)], axis=0))
    flat = ~(np.linalg.norm(np.cross(b - a, c - a), axis=1) > _LEAST_HEIGHT * longest**2)
    if flat.any():
        k = int(flat.argmax())
        corners = "; ".join(_point(p[k]) for p in (a, b, c))
        raise ValueError(
            f"Mesh: triangle {k} has no area ({int(flat.sum())} in all): its corners are {corners} m; take out such "
            f"triangles by joining the vertices that coincide, and close what opens"
        )


def _refuse_open(vertices: np.ndarray, triangles: np.ndarray) -> None:
    starts = triangles.ravel()
    ends = np.roll(triangles, -1, axis=1).ravel()
    low, high = np.minimum(starts, ends), np.maximum(starts, ends)
    edges, which, counts = np.unique(low * len(vertices) + high, return_inverse=True, return_counts=True)
    which = which.reshape(-1)

    def where(edge: int) -> str:
        k = int(np.flatnonzero(which == edge)[0])
        return f"{_point(vertices[starts[k]])} to {_point(vertices[ends[k]])} m"

    if (single := counts == 1).any():
        raise ValueError(
            f"Mesh: open: {int(single.sum())} of {len(edges)} edges have one triangle only, the first from "
            f"{where(int(single.argmax()))}; close the surface (a sheet needs a thickness; vertices that should "
            f"coincide must do so exactly)"
        )
    if (many := counts > 2).any():
        raise ValueError(
            f"Mesh: {int(many.sum())} edges have more than two triangles, the first from {where(int(many.argmax()))}; "
            f"take out double triangles, or part the solids that share the edge"
        )
    wrong = np.bincount(which, weights=starts < ends) != 1
    if wrong.any():
        raise ValueError(
            f"Mesh: the two triangles at the edge from {where(int(wrong.argmax()))} disagree on which side is out "
            f"({int(wrong.sum())} such edges); order the corners of all triangles counter-clockwise, seen "
            f"from outside"
        )


def _volumes(vertices: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Signed volume [m3] between each triangle and the middle of the mesh."""
    a, b, c = (vertices[triangles[:, k]] - vertices.mean(axis=0) for k in range(3))
    return np.einsum("ij,ij->i", a, np.cross(b, c)) / 6


def _refuse_inverted(vertices: np.ndarray, triangles: np.ndarray) -> None:
    """The whole inside out, or a part of it that is no cavity of another."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    volumes = _volumes(vertices, triangles)
    if not volumes.sum() > 0:
        raise ValueError(
            f"Mesh: inverted: the volume is {volumes.sum():.6g} m3, so that the normals point inwards; turn the "
            f"triangles round (triangles[:, ::-1]; mesh_from_file(..., flip=True))"
        )
    n = len(vertices)
    links = coo_matrix((np.ones(2 * len(triangles)), (np.tile(triangles[:, 0], 2), triangles[:, 1:].T.ravel())), (n, n))
    count, part = connected_components(links, directed=False)
    part_of = part[triangles[:, 0]]
    each = np.bincount(part_of, weights=volumes, minlength=count)
    if not (each < 0).any():
        return
    lowest, highest = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
    np.minimum.at(lowest, part, vertices)
    np.maximum.at(highest, part, vertices)
    solid = each > 0
    for k in np.flatnonzero(each < 0):
        within = (lowest[solid] <= lowest[k]).all(axis=1) & (highest[solid] >= highest[k]).all(axis=1)
        if not within.any():
            raise ValueError(
                f"Mesh: inverted: the part with the vertex {_point(vertices[part == k][0])} m has a volume of "
                f"{each[k]:.6g} m3 and is no cavity of another; turn its triangles round"
            )


class Feature:
    """Where on a triangle a point lies: in the face, on the edges ab, bc, ca, at the corners a, b, c."""

    FACE, EDGE_AB, EDGE_BC, EDGE_CA, CORNER_A, CORNER_B, CORNER_C = range(7)


@dataclass(frozen=True, eq=False)
class MeshTree:
    """What the kernels read of a mesh: its triangles, pseudonormals, and a tree of boxes around them.

    The tree is walked without a stack: nodes lie in depth-first order, and each knows where to go on if its box is too
    far (``skip``). Built by halving along the longest side of the centres' box, one triangle a leaf; the same mesh
    always gives the same tree.

    Pseudonormals separate inside from outside where the nearest point is on an edge or a corner: the sum of the two
    faces' normals, and the faces' normals weighted with their angles (Baerentzen & Aanaes 2005, IEEE Trans. Vis.
    Comput. Graph. 11:243). The sign of (p - nearest) . pseudonormal is then right for every closed surface.

    Attributes:
        low, high: Boxes of the nodes [m], shape [2 triangle_count - 1, 3]; node 0 is the whole.
        skip: The node to go on with where a box is too far, counted from node 0.
        leaf: The triangle of a leaf, else -1.
        corner, side_ab, side_ac: The triangles [m], in the order of the leaves, each of shape [triangle_count, 3].
        normals: Unit pseudonormals, shape [triangle_count, 7, 3], in the order of ``Feature``.
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
