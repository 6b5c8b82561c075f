"""The shapes beyond planes, balls and cones as the kernels see them: their places, and the triangles of meshes.

A bed whose bodies are of planes, balls, cylinders and cones alone has ``PLAIN`` for a table, and its kernels are
compiled without all this. The table is a template argument of the kernels, so they are compiled anew for a larger one.
"""

import itertools
from collections import defaultdict
from typing import Any

import numpy as np

from dem.contact.cohesion import JKR
from dem.contact.law import adhesive_range
from dem.shapes.basic import BOX, CAPSULE, FRUSTUM, MESH, PLACE_WIDTH, PLACED, TUBE, Shape, distance_to, rotate
from dem.shapes.mesh import Feature, Mesh, Surface, mesh_tree
from dem.shapes.solids import box_distance, capsule_distance, tube_distance
from hedgebed_taichi import ti

from .rows import put_rows
from .values import EnginePart

__all__ = ["PLAIN", "ShapeTable", "Shapes"]

FAR = 1e30
FEATURE_COUNT = 7
_LEAST_TRIANGLES = 1024
# Sleepers lie in the order of the curve from so many blocks of cells behind the bodies on: what wakes and falls asleep
# there leaves those that come after it in memory where they are. A block is as much of x as the curve does at a time.
_BEHIND = 2
_BLOCK = 32
# Places of the numbers in Rest.near: where bodies are along x, and how far to both sides; below them.
_MIDDLE, _HALF, _BELOW = range(3)


@ti.data_oriented
class PlainTable:
    """Stands where no table is needed."""

    full = False

    @ti.func
    def distance_to(self, k, kind, row: ti.template(), p, reach, deep: ti.template()):
        """As ``ShapeTable`` has it."""
        return distance_to(kind, row, p)


PLAIN = PlainTable()


@ti.data_oriented
class ShapeTable:
    """Places of ``primitives`` shapes, ``triangles`` triangles of meshes, one behind the other; distances to them."""

    full = True

    def __init__(self, *, primitives: int, triangles: int, real):
        F = ti.Vector.field
        self.real = real
        self.triangle_capacity = triangles
        self.place = F(PLACE_WIDTH, real, primitives)
        self.low, self.high = (F(3, real, 2 * triangles) for _ in range(2))
        self.skip, self.leaf = (ti.field(ti.i32, 2 * triangles) for _ in range(2))
        self.corner, self.side_ab, self.side_ac = (F(3, real, triangles) for _ in range(3))
        self.normals = F(3, real, FEATURE_COUNT * triangles)

    def fill(self, meshes: list[Mesh]) -> None:
        """Put these meshes' trees into the fields."""
        columns: dict[str, list[np.ndarray]] = defaultdict(list)
        nodes = triangles = 0
        for mesh in meshes:
            tree = mesh_tree(mesh)
            behind = {"skip": tree.skip + nodes, "leaf": np.where(tree.leaf < 0, -1, tree.leaf + triangles)}
            for name, array in (vars(tree) | behind | {"normals": tree.normals.reshape(-1, 3)}).items():
                columns[name].append(array)
            nodes += len(tree.leaf)
            triangles += len(tree.corner)
        for name, arrays in columns.items():
            rows = np.concatenate(arrays)
            put_rows(getattr(self, name), rows, slice(len(rows)))

    @ti.func
    def distance_to(self, k, kind, row: ti.template(), p, reach, deep: ti.template()):
        """Signed distance, outward unit normal and curvature of shape k at a point of the body's frame.

        Of a mesh that is farther than ``reach`` the distance may be FAR. With ``deep`` it is given for points that lie
        deeper inside a mesh than that as well.
        """
        place = self.place[k]
        turn = ti.Vector([place[3], place[4], place[5], place[6]])
        q = p
        shape = kind % PLACED
        if kind >= PLACED:
            origin = ti.Vector([place[0], place[1], place[2]])
            q = rotate(ti.Vector([turn[0], -turn[1], -turn[2], -turn[3]]), p - origin)
        distance = p.x * 0.0
        normal = p * 0.0
        curvature = p.x * 0.0
        if shape <= FRUSTUM:
            distance, normal, curvature = distance_to(shape, row, q)
        elif shape == CAPSULE:
            distance, normal, curvature = capsule_distance(row, place[7], q)
        elif shape == BOX:
            distance, normal = box_distance(row, q)
        elif shape == TUBE:
            distance, normal = tube_distance(row, q)
        else:
            distance, normal = self.mesh_distance(ti.cast(row[0], ti.i32), ti.cast(row[1], ti.i32), q, reach, deep)
        if kind >= PLACED:
            normal = rotate(turn, normal)
        return distance, normal, curvature

    @ti.func
    def beyond_box(self, node, p):
        """How far a point is from a node's box, squared."""
        return ti.max(self.low[node] - p, p - self.high[node], 0.0).norm_sqr()

    @ti.func
    def mesh_distance(self, first, end, p, reach, deep: ti.template()):
        """Signed distance and outward normal of the mesh whose nodes are first to end - 1; FAR beyond the reach."""
        best = reach * reach
        if ti.static(deep):
            if self.beyond_box(first, p) == 0.0:
                best = best * 0.0 + FAR
        found = -1
        feature = Feature.FACE
        nearest = p
        node = first
        while node < end:
            if self.beyond_box(node, p) < best:
                t = self.leaf[node]
                if t >= 0:
                    square, where, point = self.on_triangle(t, p)
                    if square < best:
                        best = square
                        found = t
                        feature = where
                        nearest = point
                node += 1
            else:
                node = self.skip[node]
        distance = p.x * 0.0 + FAR
        normal = p * 0.0
        if found >= 0:
            normal = self.normals[FEATURE_COUNT * found + feature]
            if feature == Feature.FACE:
                distance = normal.dot(p - self.corner[found])
            else:
                offset = p - nearest
                length = offset.norm()
                side = ti.select(offset.dot(normal) < 0.0, -1.0, 1.0)
                distance = side * length
                if length > 1e-12:
                    normal = offset * (side / length)
        return distance, normal

    @ti.func
    def on_triangle(self, t, p):
        """Square of the distance to a triangle, the feature on which the nearest point lies, and that point.

        Ericson 2005 (Real-Time Collision Detection, section 5.1.5): by the Voronoi regions of corners, edges and face.
        """
        a, ab, ac = self.corner[t], self.side_ab[t], self.side_ac[t]
        ap = p - a
        bp, cp = ap - ab, ap - ac
        d1, d2 = ab.dot(ap), ac.dot(ap)
        d3, d4 = ab.dot(bp), ac.dot(bp)
        d5, d6 = ab.dot(cp), ac.dot(cp)
        va = d3 * d6 - d5 * d4
        vb = d5 * d2 - d1 * d6
        vc = d1 * d4 - d3 * d2
        feature = Feature.FACE
        v = d1 * 0.0
        w = d1 * 0.0
        if d1 <= 0.0 and d2 <= 0.0:
            feature = Feature.CORNER_A
        elif d3 >= 0.0 and d4 <= d3:
            feature = Feature.CORNER_B
            v += 1.0
        elif d6 >= 0.0 and d5 <= d6:
            feature = Feature.CORNER_C
            w += 1.0
        elif vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
            feature = Feature.EDGE_AB
            v = d1 / (d1 - d3)
        elif vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
            feature = Feature.EDGE_CA
            w = d2 / (d2 - d6)
        elif va <= 0.0 and d4 >= d3 and d5 >= d6:
            feature = Feature.EDGE_BC
            w = (d4 - d3) / ((d4 - d3) + (d5 - d6))
            v = 1.0 - w
        nearest = a + v * ab + w * ac
        square = (p - nearest).norm_sqr()
        if feature == Feature.FACE:
            square = self.normals[FEATURE_COUNT * t].dot(ap) ** 2
        return square, feature, nearest


@ti.data_oriented
class Shapes(EnginePart):
    """The part of the engine that puts shapes into its fields, takes them out again, and measures how far they are."""

    shapes: Any
    _kept: ShapeTable | None
    _meshes: list[Mesh]

    def put_shapes(self, first: int, shapes: list[Shape]) -> None:
        """Put the shapes of a new body into the rows from ``first`` on; what was there is forgotten."""
        self.drop_shapes(first)
        for shape in shapes:
            if isinstance(shape.bare, Surface) and not any(shape.bare.mesh is other for other in self._meshes):
                self._meshes.append(shape.bare.mesh)
        if any(shape.kind > FRUSTUM for shape in shapes):
            self._make_table()
        for k, shape in enumerate(shapes, first):
            inner = shape.bare
            self.primitive_kind[k] = shape.kind
            row = [*self._nodes_of(inner.mesh), 0, 0, 0, 0] if isinstance(inner, Surface) else inner.row()
            self.primitive_row[k] = row
            if self.shapes.full:
                self.shapes.place[k] = shape.place()

    def shape_state(self) -> dict[str, np.ndarray]:
        """What of the shapes is in no other field: nothing where the kernels are plain."""
        if not self.shapes.full:
            return {}
        empty = np.zeros((0, 3))
        return {
            "primitive_place": self.shapes.place.to_numpy(),
            "mesh_sizes": np.array([[len(m.vertices), len(m.triangles)] for m in self._meshes]).reshape(-1, 2),
            "mesh_vertices": np.concatenate([empty, *(m.vertices for m in self._meshes)]),
            "mesh_triangles": np.concatenate([empty.astype(np.int64), *(m.triangles for m in self._meshes)]),
        }

    def restore_shapes(self, state: dict[str, np.ndarray]) -> None:
        """Bring the shapes to what ``shape_state`` returned."""
        if "primitive_place" not in state:
            self.clear_shapes()
            return
        known = self.shape_state()
        if not known or not all(np.array_equal(known[name], state[name]) for name in known if name.startswith("mesh")):
            ends = np.cumsum(state["mesh_sizes"], axis=0)
            vertices = np.split(state["mesh_vertices"], ends[:, 0])[:-1]
            triangles = np.split(state["mesh_triangles"], ends[:, 1])[:-1]
            self._meshes = [Mesh(*part) for part in zip(vertices, triangles, strict=True)]
            self._make_table()
        self.shapes.place.from_numpy(state["primitive_place"])

    def clear_shapes(self) -> None:
        """No shape but plain ones."""
        self.shapes = PLAIN
        self._meshes = []

    def _make_table(self) -> None:
        """A table that holds the present meshes, and their trees in it."""
        needed = sum(len(m.triangles) for m in self._meshes)
        before = self.shapes
        if self._kept is None or self._kept.triangle_capacity < needed:
            room = _LEAST_TRIANGLES
            while room < needed:
                room *= 2
            self._kept = ShapeTable(primitives=self.primitive_kind.shape[0], triangles=room, real=self.real)
        self.shapes = self._kept
        if before is not self.shapes:
            self.shapes.place.copy_from(before.place) if before.full else self.shapes.place.fill(0)
        self.shapes.fill(self._meshes)

    def _nodes_of(self, mesh: Mesh) -> tuple[int, int]:
        """First node of a mesh's tree and the one after its last."""
        before = itertools.takewhile(lambda other: other is not mesh, self._meshes)
        first = sum(2 * len(other.triangles) - 1 for other in before)
        return first, first + 2 * len(mesh.triangles) - 1

    def drop_shapes(self, first: int) -> None:
        """Forget what rows from ``first`` on hold, as of a body that was refused."""
        kinds, rows = self.primitive_kind.to_numpy()[:first], self.primitive_row.to_numpy()[:first]
        if not (kinds > FRUSTUM).any():
            self.clear_shapes()
            return
        used = {int(row[0]) for kind, row in zip(kinds, rows, strict=True) if kind % PLACED == MESH}
        self._meshes = [mesh for mesh in self._meshes if self._nodes_of(mesh)[0] in used]

    @ti.func
    def from_body(self, b, x):
        """From a body's origin, or its nearest image's, to a point."""
        d = x - self.body_position[b]
        if self.body_extent[b] < 1e30:
            d.x -= self.box[self.PERIOD_X] * ti.round(d.x / self.box[self.PERIOD_X])
            d.y -= self.box[self.PERIOD_Y] * ti.round(d.y / self.box[self.PERIOD_Y])
        return d

    @ti.func
    def nearest(self, b, x, reach, shapes: ti.template(), deep: ti.template()):
        """Distance, normal and curvature of body b at a point, and the arm from its origin to the nearest point.

        Of bodies farther than ``reach`` the distance may be 1e30. ``deep``: also find how deep a point far inside is.
        """
        d = self.from_body(b, x)
        q = self.body_turn[b]
        local = rotate(ti.Vector([q[0], -q[1], -q[2], -q[3]]), d)
        best = ti.cast(1e30, self.real)
        normal = local * 0.0
        curvature = best * 0.0
        primitives = self.body_primitives[b]
        for k in range(primitives[0], primitives[1]):
            row = self.primitive_row[k]
            distance, n_k, c_k = shapes.distance_to(k, self.primitive_kind[k], row, local, reach, deep)
            if distance < best:
                best = distance
                normal = n_k
                curvature = c_k
        normal = rotate(q, normal)
        return best, normal, curvature, d - best * normal

    @ti.func
    def body_range(self, b, r, curvature):
        """How far from body b a grain of radius r still feels it [m]; 0 but with JKR."""
        result = ti.cast(0.0, self.real)
        if ti.static(self.cohesion == JKR):
            result = adhesive_range(self.body_pair[b], r / (1.0 + r * curvature))
        return result

    @ti.func
    def close_to_body(self, i, reach, shapes: ti.template()):
        """Whether a body other than the floor is within ``reach`` [m] of a grain's surface."""
        x = self.position[i]
        within = x.w + reach
        found = False
        for b in range(1, self.body_count[None]):
            beyond = self.body_extent[b] + within
            if not found and ti.abs(x.z - self.body_position[b].z) < beyond:  # most bodies are far above
                if self.from_body(b, x.xyz).norm_sqr() < beyond**2:
                    distance, n, curvature, arm = self.nearest(b, x.xyz, within, shapes, True)
                    if distance < within:
                        found = True
        return found

    @ti.func
    def find_bodies(self, rest: ti.template()):
        """Where the bodies but the floor are along x, and below which height none is: for ``may_be_close``.

        And where sleepers begin in memory: that changes when the bodies have gone two blocks on.
        """
        first, last, below = ti.cast(0.0, self.real), ti.cast(0.0, self.real), ti.cast(1e30, self.real)
        at, period = self.body_position[1].x, self.box[self.PERIOD_X]
        for b in range(1, self.body_count[None]):
            x, extent = self.body_position[b], self.body_extent[b]
            ahead = x.x - at
            ahead -= period * ti.round(ahead / period)
            first = ti.min(first, ahead - extent)
            last = ti.max(last, ahead + extent)
            below = ti.min(below, x.z - extent)
        middle = at + 0.5 * (first + last)
        middle -= period * ti.floor(middle / period)
        rest.near[_MIDDLE] = middle
        rest.near[_HALF] = 0.5 * (last - first)
        rest.near[_BELOW] = below
        blocks = self.count[self.NX] // _BLOCK
        if self.body_count[None] > 1 and last - first < period and blocks > 2 * _BEHIND:
            block = ti.floor(middle / self.box[self.CELL_X], ti.i32) // _BLOCK - _BEHIND
            block += ti.select(block < 0, blocks, 0)
            if ti.abs(block - rest.block[None]) > 1:
                rest.block[None] = block
                rest.whole[None] = 1
                rest.begins[None] = self.rank[self.cell_index(block * _BLOCK, 0, 0)]

    @ti.func
    def may_be_close(self, i, reach, rest: ti.template()):
        """False where no body can be within ``reach`` [m] of a grain's surface: most lie beside or below them all."""
        x = self.position[i]
        within = 1.01 * (x.w + reach)  # round-off decides nothing
        ahead = ti.abs(x.x - rest.near[_MIDDLE])
        ahead = ti.min(ahead, self.box[self.PERIOD_X] - ahead)
        return x.z > rest.near[_BELOW] - within and ahead < rest.near[_HALF] + within
