"""A convex polyhedron as pieces that LAMMPS has regions for: planes for its faces, thin prisms for edges and corners.

LAMMPS has no region that is a general polyhedron. Its `intersect` of planes keeps a contact only where the nearest
point of one plane lies within all others. So edges and corners exert no force. Its `union`, as a moving wall, has no
velocity. So each face is a plane (`Facet`), each edge a prism as thin as `THIN` (`Sheet`), which has the edge and both
corners. A face that is a parallelogram is one such prism together with its edges and corners.

Each grain touches one piece: that with the face, edge or corner nearest to its centre. Planes bound these cells. For a
face, they go through its edges along its normal. For an edge, they are the same planes of its two faces, and planes
through its ends across it. For a corner, they are those of its edges. The cells fill the space outside exactly, since
both sides of a plane have the same numbers. So distance, normal and radius of curvature (R* is the grain's
radius) are those of `dem.Polyhedron`. A grain that passes from one piece to another begins a new contact there.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dem.shapes.basic import Cone
from dem.shapes.mesh import Mesh, Polyhedron

from .pieces import HalfSpace, OutOfPlaneError, Piece, Seat, about_y
from .words import digits

__all__ = ["NEARER", "WIDER", "Facet", "Sheet", "convex_corners", "polyhedron_pieces", "pyramid_corners"]

Vector = np.ndarray
THIN = 1e-9
"""Thickness of a sheet over the size of its polyhedron [1]: 0.05 nm for a foot of 50 mm."""
FLAT = 1e-6
"""Distance from a face within which corners belong to it, over the size of the polyhedron [1]. MuJoCo keeps meshes in
single precision, 6e-8."""
PYRAMID_SIDES = 9  # Of what stands for a pointed cone; with a shaft 28 pieces
WIDER = math.sqrt(2 * math.pi / PYRAMID_SIDES / math.sin(2 * math.pi / PYRAMID_SIDES))
"""Radius of its edges over that of the cone [1]: its sections are as large."""
NEARER = WIDER * math.cos(math.pi / PYRAMID_SIDES)
"""Radius to the middle of its sides over that of the cone [1]."""
_STRAIGHT = 1e-7  # Share of a side that counts as none [1]


@dataclass(frozen=True, eq=False)
class Facet:
    """The plane of a face: a point and the outward unit normal; ``loop``: corners of the face [m], shape [n, 3]."""

    normal: Vector
    loop: Vector
    where: Sequence[Sequence[HalfSpace]]

    def seat(self, turn: Vector) -> Seat:
        """As of `Piece`; a plane stands in any turn. The normal is the third column of `axes`."""
        axes = np.zeros((3, 3))
        axes[:, 2] = turn @ self.normal
        return Seat(0.0, axes, turn @ self.loop[0])

    def words(self, seat: Seat) -> str:
        """As of `Piece`; solid is where the normal does not point."""
        return f"plane {digits((*seat.at, *-seat.axes[:, 2]))}"

    def spans(self, seat: Seat) -> bool:
        """As of `Piece`: not known to."""
        return False

    def corners(self) -> Vector:
        """As of `Piece`."""
        return self.loop

    outline = corners

    def cells(self) -> Sequence[Sequence[HalfSpace]]:
        """As of `Piece`."""
        return self.where


@dataclass(frozen=True, eq=False)
class Sheet:
    """An edge, or a parallelogram with its edges: a prism with one or two ``sides`` [m] from ``origin``, and else thin.

    ``outward``: a direction away from the polyhedron, so that the prism lies within it.
    """

    origin: Vector
    sides: Sequence[Vector]
    outward: Vector
    thickness: float
    where: Sequence[Sequence[HalfSpace]]

    def seat(self, turn: Vector) -> Seat:
        """As of `Piece`: columns of `axes` are the prism's edges [m], the first along x, the second in x and y.

        LAMMPS' prism has edges (a, 0, 0), (b_x, b_y, 0) and c, with a, b_y and c_z above 0. A turn about y brings the
        part in the plane of motion of one side, or the side itself, onto x; another side is c. Raises OutOfPlaneError
        for a parallelogram that stands along y, if neither side lies in the plane or along y.
        """
        first, *rest = (turn @ side for side in self.sides)
        for one, other in [(first, rest[0]), (rest[0], first)] if rest else [(None, first)]:
            found = self._standing(turn, one, other)
            if found is not None:
                return found
        raise OutOfPlaneError

    def _standing(self, turn: Vector, one: Vector | None, other: Vector) -> Seat | None:
        """The seat with ``one`` side, if any, as a or b, or None where this is not possible."""
        if one is None:
            along_y = math.hypot(other[0], other[2]) < abs(other[1])
            # An edge: itself as b, its part in the plane along x, or as c, that part along z.
            angle = math.atan2(-other[2], other[0]) if along_y else math.atan2(other[0], other[2])
        else:
            angle = math.atan2(-one[2], one[0])
        back = about_y(-angle)
        at, outward, second = back @ turn @ self.origin, back @ turn @ self.outward, back @ other
        thin = [-math.copysign(self.thickness, outward[k]) * np.eye(3)[k] for k in range(3)]
        if one is None:
            edges = [thin[0], second * (1, 1, 0), thin[2]] if along_y else [thin[0], thin[1], second]
        else:
            level, upright = (abs(value[1]) < _STRAIGHT * np.linalg.norm(value) for value in (back @ one, second))
            flat = abs(second[2]) < _STRAIGHT * np.linalg.norm(second)  # the plane of both has the direction y
            if level:
                edges = [back @ one * (1, 0, 0), second * (1, 1, 0) if flat else thin[1], thin[2] if flat else second]
            elif not flat:
                edges = [thin[0], back @ one * (1, 1, 0), second]
            elif upright:
                edges = [second * (1, 0, 0), back @ one * (1, 1, 0), thin[2]]
            else:
                return None
        axes = np.column_stack(edges)
        turned_round = np.diag(axes) < 0
        return Seat(angle, axes * np.where(turned_round, -1, 1), at + axes @ turned_round)

    def words(self, seat: Seat) -> str:
        """As of `Piece`."""
        (a, b_x, c_x), (_, b_y, c_y), (_, _, c_z) = seat.axes
        x, y, z = seat.at
        return f"prism {digits((x, x + a, y, y + b_y, z, z + c_z, b_x, c_x, c_y))}"

    def spans(self, seat: Seat) -> bool:
        """As of `Piece`: not known to."""
        return False

    def corners(self) -> Vector:
        """As of `Piece`."""
        ends = [self.origin, *(self.origin + side for side in self.sides), self.origin + sum(self.sides)]
        return np.array(ends)

    outline = corners

    def cells(self) -> Sequence[Sequence[HalfSpace]]:
        """As of `Piece`."""
        return self.where


def convex_corners(shape: Polyhedron | Mesh) -> Vector:
    """Points whose hull the shape is [m], shape [n, 3]. Raises ValueError for a mesh that is not convex."""
    from scipy.spatial import ConvexHull

    if isinstance(shape, Polyhedron):
        return np.asarray(shape.vertices, dtype=float)
    hull = ConvexHull(shape.vertices)
    depth = -(shape.vertices @ hull.equations[:, :3].T + hull.equations[:, 3]).max(axis=1)
    inside = hull.volume - shape.volume
    if depth.max() > FLAT * np.ptp(shape.vertices, axis=0).max() or inside > 10 * FLAT * hull.volume:
        raise ValueError(
            f"Mesh of {len(shape.triangles)} triangles is not convex: its hull has {100 * inside / hull.volume:.2g} % "
            f"more volume; in LAMMPS a body is a convex mesh, a Polyhedron, Ball, Capsule, Cylinder, Cone or Box"
        )
    return shape.vertices


def pyramid_corners(cone: Cone, end: float | None = None) -> Vector:
    """Corners of the pyramid that stands for a cone that ends in a point, in its axes [m], shape [n, 3].

    Its sections are as large as those of the cone; ``end``: up to where a shaft as thick goes on from the top [m].
    """
    angle = 2 * math.pi * np.arange(PYRAMID_SIDES) / PYRAMID_SIDES
    ring = WIDER * max(cone.bottom_radius, cone.top_radius) * np.column_stack([np.cos(angle), np.sin(angle)])
    point, wide = (cone.bottom, cone.top) if cone.bottom_radius == 0 else (cone.top, cone.bottom)
    rings = [np.column_stack([ring, np.full(PYRAMID_SIDES, z)]) for z in (wide, end) if z is not None]
    return np.concatenate([[[0.0, 0.0, point]], *rings])


def polyhedron_pieces(points: Vector) -> list[Piece]:
    """The pieces of the hull of points [m], shape [n, 3].

    Raises ValueError where corners lie so near to one another that its faces do not close.
    """
    points = np.unique(points, axis=0)
    size = float(np.ptp(points, axis=0).max())
    return _Surface(points, *_faces(points, FLAT * size), thickness=THIN * size).pieces()


def _faces(points: Vector, tolerance: float) -> tuple[list[list[int]], Vector]:
    """Corners of each face, counter-clockwise seen from outside, and the outward unit normals, shape [face, 3].

    Triangles of the hull within ``tolerance`` [m] of the plane of a larger one belong to its face. Points that are in
    fewer than three faces are no corners.
    """
    from scipy.spatial import ConvexHull

    hull = ConvexHull(points)
    a, b, c = (points[hull.simplices[:, k]] for k in range(3))
    order = np.argsort(-np.linalg.norm(np.cross(b - a, c - a), axis=1), kind="stable")
    near = points @ hull.equations[:, :3].T + hull.equations[:, 3] > -tolerance
    found, done = list[int](), np.zeros(len(order), dtype=bool)
    for k in order:
        if not done[k]:
            found.append(int(k))
            done |= near[hull.simplices, k].all(axis=1)
    members, normals = near[:, found].T, hull.equations[found, :3]
    corner = members.sum(axis=0) >= 3
    loops = []
    for on, normal in zip(members, normals, strict=True):
        which = np.flatnonzero(on & corner)
        away = points[which] - points[which].mean(axis=0)
        across = np.cross(normal, away[0])
        loops.append(which[np.argsort(np.arctan2(away @ across, away @ away[0]))].tolist())
    return loops, normals


class _Surface:
    """Faces, edges and corners of a polyhedron, and their cells."""

    def __init__(self, points: Vector, loops: list[list[int]], normals: Vector, *, thickness: float) -> None:
        self.points, self.loops, self.normals, self.thickness = points, loops, normals, thickness
        self.sides: dict[tuple[int, int], int] = {}  # The face left of the way from a corner to the next
        for face, loop in enumerate(loops):
            self.sides |= dict.fromkeys(_ways(loop), face)
        ways, corners = sum(len(loop) for loop in loops), {corner for loop in loops for corner in loop}
        paired = len(self.sides) == ways and all((q, p) in self.sides for p, q in self.sides)
        if not paired or min(map(len, loops)) < 3 or len(corners) - ways // 2 + len(loops) != 2:
            raise ValueError(
                f"Polyhedron of {len(points)} points: some lie within {FLAT:g} of its size of others or of a face, so "
                f"that its faces do not close; leave them out"
            )

    def pieces(self) -> list[Piece]:
        """Sheets for parallelograms that have edges of their own, facets for other faces, sheets for other edges."""
        edges = {way for way in self.sides if way[0] < way[1]}
        corners, found = {p for p, _ in edges}.union(q for _, q in edges), list[Piece]()
        for face, loop in enumerate(self.loops):
            own = {(min(way), max(way)) for way in _ways(loop)} & edges
            a, b, *_, d = self.points[loop]
            cells = [self._face_cell(face)]
            if own and self._parallelogram(loop):
                cells += self._border(own, corners & set(loop))
                found.append(Sheet(a, (b - a, d - a), self.normals[face], self.thickness, cells))
                edges, corners = edges - own, corners - set(loop)
            else:
                found.append(Facet(self.normals[face], self.points[loop], cells))
        for p, q in sorted(edges):
            outward = self.normals[self.sides[p, q]] + self.normals[self.sides[q, p]]
            cells = self._border({(p, q)}, corners & {p, q})
            found.append(Sheet(self.points[p], (self.points[q] - self.points[p],), outward, self.thickness, cells))
            corners = corners - {p, q}
        return found

    def _parallelogram(self, loop: list[int]) -> bool:
        if len(loop) != 4:
            return False
        a, b, c, d = self.points[loop]
        return bool(np.abs(a - b + c - d).max() < _STRAIGHT * np.abs(c - a).max())

    def _border(self, edges: set[tuple[int, int]], corners: set[int]) -> list[list[HalfSpace]]:
        return [self._edge_cell(*way) for way in sorted(edges)] + [self._corner_cell(k) for k in sorted(corners)]

    def _wall(self, p: int, q: int, *, other: bool) -> HalfSpace:
        """Through the edge from p to q along the normal of the face left of it; the face's side, or the other."""
        p_, q_ = self.points[p], self.points[q]
        return HalfSpace(p_, np.cross(self.normals[self.sides[p, q]], q_ - p_), other)

    def _end(self, p: int, q: int, *, other: bool) -> HalfSpace:
        """Through p across the edge to q; the edge's side, or the other."""
        return HalfSpace(self.points[p], self.points[q] - self.points[p], other)

    def _face_cell(self, face: int) -> list[HalfSpace]:
        loop = self.loops[face]
        front = HalfSpace(self.points[loop[0]], self.normals[face])
        return [front, *(self._wall(*way, other=False) for way in _ways(loop))]

    def _edge_cell(self, p: int, q: int) -> list[HalfSpace]:
        walls = [self._wall(*way, other=True) for way in ((p, q), (q, p))]
        return walls + [self._end(*way, other=False) for way in ((p, q), (q, p))]

    def _corner_cell(self, corner: int) -> list[HalfSpace]:
        return [self._end(*way, other=True) for way in self.sides if way[0] == corner]


def _ways(loop: list[int]) -> list[tuple[int, int]]:
    """From each corner to the next."""
    return list(zip(loop, loop[1:] + loop[:1], strict=True))
