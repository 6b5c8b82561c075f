"""Pieces of bodies, each of which is one region of LAMMPS: primitives here, those of polyhedra in `polyhedra`.

A region turns about one axis, which LAMMPS takes as a constant, and has the velocity of that turning. Here the axis is
y, across the plane of motion. A turning about two axes would need regions that move inside of regions; `free_bed` has
such bodies without regions.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from dem.shapes.basic import Ball, Cone, Cylinder
from dem.shapes.solids import Box

from .words import digits

__all__ = ["IN_PLANE", "JUMP", "HalfSpace", "OutOfPlaneError", "Piece", "Primitive", "Seat", "about_y"]

Vector = np.ndarray
IN_PLANE = 1e-6  # How far from the plane of motion, or from its normal, an axis may be [rad]
JUMP = 1e-9  # A larger change of place is no motion [m]
_SIDES = 16  # Of the polygon around a circle


class OutOfPlaneError(ValueError):
    """A body turns out of the plane of motion, x and z."""

    def __init__(self) -> None:
        super().__init__(
            "this body turns out of the plane of motion, x and z: LAMMPS' regions turn about one constant axis, which "
            "is y here; a `FreeLammpsBed`, or the ground `bed`, takes such a body"
        )


@dataclass(frozen=True, eq=False)
class Seat:
    """A region's turn about y [rad], and before that turn the piece's axes, 0 where it is round, and its middle or
    origin [m]."""

    angle: float
    axes: Vector
    at: Vector

    def like(self, other: "Seat") -> bool:
        """Whether one region, turned, is both."""
        return bool(np.abs(self.axes - other.axes).max() < IN_PLANE and np.abs(self.at - other.at).max() < JUMP)


@dataclass(frozen=True, eq=False)
class HalfSpace:
    """Where (x - point) . normal is 0 or more, or where it is below 0 with ``other``; in the body's axes [m]."""

    point: Vector
    normal: Vector
    other: bool = False

    def words(self, position: Vector, turn: Vector) -> str:
        """Style and numbers of the region, the body there and turned by this matrix."""
        numbers = digits((*(position + turn @ self.point), *(turn @ self.normal)))
        return f"plane {numbers}{' side out' if self.other else ''}"


class Piece(Protocol):
    """What is one region of LAMMPS. A grain touches it where it is in one of its ``cells``."""

    def seat(self, turn: Vector) -> Seat:
        """How its region stands, the body turned by this matrix. Raises OutOfPlaneError where no region can."""

    def words(self, seat: Seat) -> str:
        """Style and numbers of the region, before it is turned by `seat.angle` about y."""

    def spans(self, seat: Seat) -> bool:
        """Whether its section is the same all along y."""

    def corners(self) -> Vector:
        """Points in whose box it is, in the body's axes [m], shape [n, 3]."""

    def outline(self) -> Vector:
        """Corners of a polyhedron around it, at most 2 % wider, in the body's axes [m], shape [n, 3]; not of a ball."""

    def cells(self) -> Sequence[Sequence[HalfSpace]]:
        """The cells whose grains touch it, each where all its half-spaces are; one without any is everywhere."""


@dataclass(frozen=True, eq=False)
class Primitive:
    """A primitive, where it is in the body, and from where to where along its own z axis grains belong to it [m]."""

    shape: Ball | Cylinder | Cone | Box
    begin: float = -math.inf
    end: float = math.inf
    at: Vector = field(default_factory=lambda: np.zeros(3))  # Of its origin in the body's axes [m]
    axes: Vector = field(default_factory=lambda: np.eye(3))  # From its axes to the body's

    def seat(self, turn: Vector) -> Seat:
        """As of `Piece`."""
        axes, shape = turn @ self.axes, self.shape
        middle = turn @ self.at + axes @ np.array(shape.center if isinstance(shape, Ball | Box) else np.zeros(3))
        if isinstance(shape, Ball):
            return Seat(0.0, np.zeros((3, 3)), middle)
        across = np.flatnonzero(np.abs(axes[1]) > 1 - IN_PLANE**2)  # its axes that lie along y
        if isinstance(shape, Box):
            if not len(across):
                raise OutOfPlaneError
            side = axes[:, (across[0] + 1) % 3]
        elif len(across) and across[0] == 2:
            side = np.array([0.0, 0.0, 1.0])
        elif abs(axes[1, 2]) < IN_PLANE:
            side = axes[:, 2]
        else:
            raise OutOfPlaneError
        angle = math.atan2(side[0], side[2])
        back = about_y(-angle)
        kept = np.array([1.0, 1.0, 1.0] if isinstance(shape, Box) else [0.0, 0.0, 1.0])  # a turn about its axis
        return Seat(angle, back @ axes * kept, back @ middle)

    def words(self, seat: Seat) -> str:
        """As of `Piece`."""
        shape, (x, y, z) = self.shape, seat.at
        if isinstance(shape, Ball):
            return f"sphere {digits((x, y, z, shape.radius))}"
        if isinstance(shape, Box):
            half = np.abs(np.round(seat.axes)) @ (0.5 * np.array(shape.size))
            return f"block {digits(np.column_stack([seat.at - half, seat.at + half]).ravel())}"
        sense = round(float(seat.axes[1, 2]))
        radii = (shape.bottom_radius, shape.top_radius) if isinstance(shape, Cone) else (shape.radius,)
        kind = "cone" if isinstance(shape, Cone) else "cylinder"
        if sense:
            low, high = sorted((sense * shape.bottom, sense * shape.top))
            return f"{kind} y {digits((x, z, *radii[::sense], y + low, y + high))}"
        return f"{kind} z {digits((x, y, *radii, z + shape.bottom, z + shape.top))}"

    def spans(self, seat: Seat) -> bool:
        """As of `Piece`."""
        across = isinstance(self.shape, Cylinder) and round(float(seat.axes[1, 2]))
        return isinstance(self.shape, Box) or bool(across)

    def corners(self) -> Vector:
        """As of `Piece`: those of a box around it, shape [8, 3]."""
        low, high = _ends(self.shape)
        found = [(x, y, z) for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])]
        return np.asarray(self.at + np.array(found) @ self.axes.T)

    def outline(self) -> Vector:
        """As of `Piece`."""
        shape = self.shape
        if isinstance(shape, Box | Ball):
            return self.corners()
        angle = 2 * math.pi * np.arange(_SIDES) / _SIDES
        ring = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(_SIDES)]) / math.cos(math.pi / _SIDES)
        if isinstance(shape, Cone):
            below, above = shape.bottom_radius, shape.top_radius
        else:
            below = above = shape.radius
        found = np.concatenate([below * ring + (0.0, 0.0, shape.bottom), above * ring + (0.0, 0.0, shape.top)])
        return np.asarray(self.at + found @ self.axes.T)

    def cells(self) -> list[list[HalfSpace]]:
        """As of `Piece`."""
        up, ends = self.axes[:, 2], ((self.begin, 1.0), (self.end, -1.0))
        return [[HalfSpace(self.at + height * up, sense * up) for height, sense in ends if math.isfinite(height)]]


def about_y(angle: float) -> Vector:
    """The matrix of a turn by this angle [rad]."""
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])


def _ends(shape: Ball | Cylinder | Cone | Box) -> tuple[Vector, Vector]:
    """Lower and upper corner of a box around a shape [m]."""
    if isinstance(shape, Ball):
        return np.array(shape.center) - shape.radius, np.array(shape.center) + shape.radius
    if isinstance(shape, Box):
        half = 0.5 * np.array(shape.size)
        return np.array(shape.center) - half, np.array(shape.center) + half
    radius = max(shape.bottom_radius, shape.top_radius) if isinstance(shape, Cone) else shape.radius
    return np.array([-radius, -radius, shape.bottom]), np.array([radius, radius, shape.top])
