"""Shapes that grains can touch, as distance functions.

A body is a union of primitives in its own frame. A grain touches a body at most once: at the point of the union
nearest to the grain's centre. Lengths in metres.

Each primitive is stored as one row (kind, body, six numbers). ``nearest`` returns, for a point outside, the exact
distance to the union, the outward unit normal there, and the curvature 1/R of a ball's surface. The curvature of the
others is 0: they meet a grain as a plane does. Further shapes are in ``dem.shapes.solids`` and ``dem.shapes.mesh``.
"""

import math
from dataclasses import astuple, dataclass

import numpy as np

from hedgebed_taichi import ti

__all__ = ["Ball", "Cone", "Cylinder", "Plane", "Primitive", "Shape", "distance_to", "rotate"]

Bounds = tuple[np.ndarray, np.ndarray]
PLANE, BALL, FRUSTUM, CAPSULE, BOX, TUBE, MESH = range(7)
PLACED = 16  # Added to the kind of a shape that has a place of its own in the body
ROW_WIDTH, PLACE_WIDTH = 6, 8  # Numbers in ``Shape.row`` and in ``Shape.place``


def refuse_length(kind: str, **values: float) -> None:
    """Raises ValueError for a length that is not positive and finite; ``kind`` says whose."""
    for name, value in values.items():
        if not 0 < value < math.inf:
            raise ValueError(f"{kind}: {name} = {value} must be a positive length [m]")


def refuse_point(kind: str, **points: tuple[float, ...]) -> None:
    """Raises ValueError for what is not three finite numbers; ``kind`` says whose."""
    for name, point in points.items():
        if len(point) != 3 or not all(map(math.isfinite, point)):
            raise ValueError(f"{kind}: {name} = {tuple(point)} must be 3 finite numbers [m]")


class Shape:
    """What every shape has, in the frame of its body; numbers that no shape can have raise ValueError."""

    kind: int

    @property
    def bare(self) -> "Shape":
        """The shape without its place."""
        return self

    def row(self) -> list[float]:
        """The six numbers that the kernels read."""
        raise NotImplementedError

    def place(self) -> list[float]:
        """Position, rotation (quaternion, scalar first) and one number that does not fit into its row; eight in all."""
        return [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0]

    def extent(self) -> float:
        """Largest distance from the body's origin to the surface [m], or a little more; infinite for a plane."""
        raise NotImplementedError

    def bounds(self) -> Bounds:
        """Lowest and highest coordinates in the body's frame [m], each of shape [3]; infinite for a plane."""
        raise NotImplementedError


@dataclass(frozen=True)
class Plane(Shape):
    """A plane through ``point`` with the outward ``normal`` (need not be of unit length); grains stay on its side."""

    point: tuple[float, float, float] = (0.0, 0.0, 0.0)
    normal: tuple[float, float, float] = (0.0, 0.0, 1.0)

    kind = PLANE

    def __post_init__(self):
        refuse_point("Plane", point=self.point)
        if len(self.normal) != 3 or not 0 < math.hypot(*self.normal) < math.inf:
            raise ValueError(f"Plane: normal = {tuple(self.normal)} must be 3 finite numbers, not all zero")

    def row(self) -> list[float]:
        length = math.hypot(*self.normal)
        return [*self.point, *(c / length for c in self.normal)]

    def extent(self) -> float:
        return math.inf

    def bounds(self) -> Bounds:
        return np.full(3, -math.inf), np.full(3, math.inf)


@dataclass(frozen=True)
class Ball(Shape):
    """A sphere of a ``radius`` [m] about its ``center`` [m] in the body's frame."""

    center: tuple[float, float, float] = (0.0, 0.0, 0.0)
    radius: float = 0.0

    kind = BALL

    def __post_init__(self):
        refuse_point("Ball", center=self.center)
        refuse_length("Ball", radius=self.radius)

    def row(self) -> list[float]:
        return [*self.center, self.radius, 0.0, 0.0]

    def extent(self) -> float:
        return math.hypot(*self.center) + self.radius

    def bounds(self) -> Bounds:
        return np.array(self.center) - self.radius, np.array(self.center) + self.radius


@dataclass(frozen=True)
class Round(Shape):
    """A shape that is round about the body's z axis, from ``bottom`` to ``top`` [m], with two radii."""

    bottom: float
    top: float

    kind = FRUSTUM

    def __post_init__(self):
        if not -math.inf < self.bottom < self.top < math.inf:
            raise ValueError(
                f"{type(self).__name__}: top = {self.top} must lie above bottom = {self.bottom}, both finite [m]"
            )

    def row(self) -> list[float]:
        return [*map(float, astuple(self)), 0.0, 0.0]

    def extent(self) -> float:
        return math.hypot(max(abs(self.bottom), abs(self.top)), max(astuple(self)[2:]))

    def bounds(self) -> Bounds:
        widest = max(astuple(self)[2:])
        return np.array([-widest, -widest, self.bottom]), np.array([widest, widest, self.top])


@dataclass(frozen=True)
class Cone(Round):
    """A truncated cone about the body's z axis, from ``bottom`` to ``top`` [m]; a radius of 0 is an apex."""

    bottom_radius: float
    top_radius: float

    def __post_init__(self):
        super().__post_init__()
        radii = (self.bottom_radius, self.top_radius)
        if not all(0 <= radius < math.inf for radius in radii) or not any(radii):
            raise ValueError(
                f"Cone: bottom_radius = {self.bottom_radius}, top_radius = {self.top_radius} must be finite, 0 or more "
                f"and not both 0 [m]"
            )

    def extent(self) -> float:
        return max(math.hypot(self.bottom, self.bottom_radius), math.hypot(self.top, self.top_radius))


@dataclass(frozen=True)
class Cylinder(Round):
    """A cylinder about the body's z axis, from ``bottom`` to ``top`` [m]."""

    radius: float

    def __post_init__(self):
        refuse_length("Cylinder", radius=self.radius)
        super().__post_init__()

    def row(self) -> list[float]:
        return [self.bottom, self.top, self.radius, self.radius, 0.0, 0.0]


Primitive = Plane | Ball | Cone | Cylinder


@ti.func
def _segment(px, pz, ax, az, bx, bz):
    ex, ez = bx - ax, bz - az
    t = ti.min(1.0, ti.max(0.0, ((px - ax) * ex + (pz - az) * ez) / (ex * ex + ez * ez)))
    return ax + t * ex, az + t * ez


@ti.func
def _frustum(row: ti.template(), p):
    """Signed distance and outward normal of a truncated cone about z."""
    rho = ti.sqrt(p.x * p.x + p.y * p.y)
    z0, z1, r0, r1 = row[0], row[1], row[2], row[3]
    # The profile's three edges: bottom face, side, top face.
    qx, qz = _segment(rho, p.z, r0, z0, r1, z1)
    nx, nz = z1 - z0, r0 - r1
    best = (rho - qx) ** 2 + (p.z - qz) ** 2
    bx = ti.min(rho, r0)
    d_bottom = (rho - bx) ** 2 + (p.z - z0) ** 2
    if d_bottom < best:
        best = d_bottom
        qx, qz = bx, z0
        nx, nz = 0.0 * nx, -1.0 + 0.0 * nz
    tx = ti.min(rho, r1)
    d_top = (rho - tx) ** 2 + (p.z - z1) ** 2
    if d_top < best:
        best = d_top
        qx, qz = tx, z1
        nx, nz = 0.0 * nx, 1.0 + 0.0 * nz
    inside = p.z > z0 and p.z < z1 and rho < r0 + (r1 - r0) * (p.z - z0) / (z1 - z0)
    distance = ti.sqrt(best)
    if distance > 1e-12:
        nx, nz = (rho - qx) / distance, (p.z - qz) / distance
        if inside:
            nx, nz = -nx, -nz
    else:
        scale = 1.0 / ti.sqrt(nx * nx + nz * nz)
        nx, nz = nx * scale, nz * scale
    if inside:
        distance = -distance
    ux, uy = 1.0 + 0.0 * nx, 0.0 * nx
    if rho > 1e-12:
        ux, uy = p.x / rho, p.y / rho
    return distance, ti.Vector([nx * ux, nx * uy, nz])


@ti.func
def distance_to(kind, row: ti.template(), p):
    """Signed distance [m], outward unit normal and curvature [1/m] of one primitive at a point of the body's frame."""
    distance = p.x * 0.0
    normal = p * 0.0
    curvature = p.x * 0.0
    if kind == PLANE:
        normal = ti.Vector([row[3], row[4], row[5]])
        distance = normal.dot(p - ti.Vector([row[0], row[1], row[2]]))
    elif kind == BALL:
        offset = p - ti.Vector([row[0], row[1], row[2]])
        length = ti.max(offset.norm(), 1e-30)
        normal = offset / length
        distance = length - row[3]
        curvature = 1.0 / row[3]
    else:
        distance, normal = _frustum(row, p)
    return distance, normal, curvature


@ti.func
def rotate(q, x):
    """x turned by the unit quaternion q (scalar first)."""
    axis = ti.Vector([q[1], q[2], q[3]])
    t = 2.0 * axis.cross(x)
    return x + q[0] * t + axis.cross(t)
