"""Further shapes that grains can touch: capsules, boxes, tubes; and any shape put elsewhere in a body, or turned.

As ``dem.shapes.basic``: one row of six numbers each, and for points outside the exact distance. Edges and corners
count as flat (R* the grain's radius), and so do the wall of a tube and the side of a capsule.
"""

import itertools
import math
from dataclasses import dataclass

import numpy as np

from hedgebed_taichi import ti

from .basic import BOX, CAPSULE, PLACED, TUBE, Bounds, Round, Shape, refuse_length, refuse_point

__all__ = ["Box", "Capsule", "Placed", "Tube"]


@dataclass(frozen=True)
class Capsule(Shape):
    """All points within ``radius`` of the segment from ``start`` to ``end`` [m]: a cylinder with a ball at each end."""

    start: tuple[float, float, float]
    end: tuple[float, float, float]
    radius: float

    kind = CAPSULE

    def __post_init__(self):
        refuse_length("Capsule", radius=self.radius)
        refuse_point("Capsule", start=self.start, end=self.end)
        if not math.dist(self.start, self.end) > 0:
            raise ValueError(f"Capsule: end = {self.end} must be another point than start; use a Ball")

    def row(self) -> list[float]:
        return [*map(float, self.start), *(float(b) - float(a) for a, b in zip(self.start, self.end, strict=True))]

    def place(self) -> list[float]:
        return [*super().place()[:7], float(self.radius)]

    def extent(self) -> float:
        return max(math.hypot(*self.start), math.hypot(*self.end)) + self.radius

    def bounds(self) -> Bounds:
        return np.minimum(self.start, self.end) - self.radius, np.maximum(self.start, self.end) + self.radius


@dataclass(frozen=True)
class Box(Shape):
    """A block of the given ``size`` [m] about ``center`` [m], its sides along the body's axes; ``Placed`` turns it."""

    size: tuple[float, float, float]
    center: tuple[float, float, float] = (0.0, 0.0, 0.0)

    kind = BOX

    def __post_init__(self):
        if len(self.size) != 3 or not all(math.isfinite(s) and s > 0 for s in self.size):
            raise ValueError(f"Box: size = {tuple(self.size)} must be three positive lengths [m]")
        refuse_point("Box", center=self.center)

    def row(self) -> list[float]:
        return [*map(float, self.center), *(0.5 * s for s in self.size)]

    def extent(self) -> float:
        return math.hypot(*(abs(c) + 0.5 * s for c, s in zip(self.center, self.size, strict=True)))

    def bounds(self) -> Bounds:
        return np.array(self.center) - 0.5 * np.array(self.size), np.array(self.center) + 0.5 * np.array(self.size)


@dataclass(frozen=True)
class Tube(Round):
    """A hollow cylinder about the body's z axis, open at both ends: the wall of a container.

    Grains may be inside it (and then keep to it: it needs a floor of its own) as well as outside.
    """

    inner_radius: float
    outer_radius: float

    kind = TUBE

    def __post_init__(self):
        refuse_length("Tube", inner_radius=self.inner_radius, outer_radius=self.outer_radius)
        if not self.outer_radius > self.inner_radius:
            raise ValueError(
                f"Tube: outer_radius = {self.outer_radius} must be larger than inner_radius = {self.inner_radius} [m]"
            )
        super().__post_init__()


@dataclass(frozen=True)
class Placed(Shape):
    """A shape put elsewhere in a body: its origin at ``position`` [m], ``turn`` a quaternion (scalar first)."""

    shape: Shape
    position: tuple[float, float, float] = (0.0, 0.0, 0.0)
    turn: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0)

    def __post_init__(self):
        if isinstance(self.shape, Placed):
            raise ValueError("Placed: shape is itself a Placed; give the one position and turn that the two make")
        refuse_point("Placed", position=self.position)
        if len(self.turn) != 4 or not all(map(math.isfinite, self.turn)) or not math.hypot(*self.turn) > 0:
            raise ValueError(f"Placed: turn = {tuple(self.turn)} must be a quaternion of four numbers, scalar first")

    @property
    def kind(self) -> int:  # type: ignore[override]
        """Of the shape, and that it has a place."""
        return self.shape.kind + PLACED

    @property
    def bare(self) -> Shape:
        return self.shape

    def place(self) -> list[float]:
        turn = np.array(self.turn, dtype=float) / math.hypot(*self.turn)
        return [*map(float, self.position), *turn.tolist(), self.shape.place()[7]]

    def extent(self) -> float:
        return math.hypot(*self.position) + self.shape.extent()

    def bounds(self) -> Bounds:
        """As of `Shape`, or a little more: of the corners of the shape's own bounds."""
        low, high = self.shape.bounds()
        if not np.isfinite(low).all():
            return low, high
        corners = np.array(list(itertools.product(*zip(low, high, strict=True))))
        w, *axis = np.array(self.turn, dtype=float) / math.hypot(*self.turn)
        turned = corners + 2 * np.cross(axis, np.cross(axis, corners) + w * corners)
        return turned.min(axis=0) + self.position, turned.max(axis=0) + self.position


# Each returns the signed distance [m], the outward unit normal and the curvature [1/m] at a point of the shape's frame.


@ti.func
def capsule_distance(row: ti.template(), radius, p):
    along = ti.Vector([row[3], row[4], row[5]])
    offset = p - ti.Vector([row[0], row[1], row[2]])
    t = offset.dot(along) / along.norm_sqr()
    curvature = p.x * 0.0
    if t <= 0.0 or t >= 1.0:
        curvature = 1.0 / radius
    offset -= ti.min(1.0, ti.max(0.0, t)) * along
    length = ti.max(offset.norm(), 1e-30)
    return length - radius, offset / length, curvature


@ti.func
def box_distance(row: ti.template(), p):
    local = p - ti.Vector([row[0], row[1], row[2]])
    beyond = ti.abs(local) - ti.Vector([row[3], row[4], row[5]])
    out = ti.max(beyond, 0.0)
    distance = out.norm()
    normal = out
    if distance > 0.0:
        normal = out / distance
    else:
        # Inside, or on the surface: the nearest face.
        distance = beyond.max()
        taken = False
        for k in ti.static(range(3)):
            normal[k] = 0.0
            if beyond[k] == distance and not taken:
                normal[k] = 1.0
                taken = True
    for k in ti.static(range(3)):
        if local[k] < 0.0:
            normal[k] = -normal[k]
    return distance, normal


@ti.func
def tube_distance(row: ti.template(), p):
    """The wall is a rectangle over (distance from the axis, z)."""
    rho = ti.sqrt(p.x * p.x + p.y * p.y)
    side = rho - 0.5 * (row[2] + row[3])
    up = p.z - 0.5 * (row[0] + row[1])
    beyond_r = ti.abs(side) - 0.5 * (row[3] - row[2])
    beyond_z = ti.abs(up) - 0.5 * (row[1] - row[0])
    out_r, out_z = ti.max(beyond_r, 0.0), ti.max(beyond_z, 0.0)
    distance = ti.sqrt(out_r * out_r + out_z * out_z)
    if distance > 0.0:
        out_r /= distance
        out_z /= distance
    else:
        distance = ti.max(beyond_r, beyond_z)
        if beyond_r >= beyond_z:
            out_r += 1.0
        else:
            out_z += 1.0
    if side < 0.0:
        out_r = -out_r
    if up < 0.0:
        out_z = -out_z
    ux, uy = 1.0 + 0.0 * rho, 0.0 * rho
    if rho > 1e-12:
        ux, uy = p.x / rho, p.y / rho
    return distance, ti.Vector([out_r * ux, out_r * uy, out_z])
