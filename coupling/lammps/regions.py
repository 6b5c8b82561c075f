"""Bodies as regions of LAMMPS: one region for each piece, moved by variables that the master sets.

LAMMPS' unions of moving regions are of no use here: as walls they have no velocity, and in LAMMPS of 2021 no distance.
So every piece has its own region and its own `fix wall/gran/region`. A grain between two pieces touches both, as in the
corner of two bodies. Two pieces of one body may join smoothly, as a ball and the cylinder on it in a capsule. Then each
has the grains beside it, so that a grain touches only the nearest piece. A grain that passes from one of these to the
next begins a new contact there, without friction's history.

The pieces of a convex polyhedron are described in `polyhedra`.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from scipy.spatial.transform import Rotation

from dem.shapes.basic import Ball, Cone, Cylinder, Shape
from dem.shapes.mesh import Mesh, Polyhedron
from dem.shapes.solids import Box, Capsule, Placed
from rigid.spatial.quaternions import multiply, to_matrix

from .pieces import IN_PLANE, JUMP, OutOfPlaneError, Piece, Primitive, Seat
from .polyhedra import convex_corners, polyhedron_pieces, pyramid_corners
from .words import digits

__all__ = ["MOST_PIECES", "MovingBody", "check_count", "check_plane", "check_thickness", "pieces_of"]

Vector = np.ndarray
MOST_PIECES = 30  # Of all bodies: each takes one of LAMMPS' 32 groups
_ARM = 0.1  # Over which a larger change of angle than JUMP is no motion [m]
_SAME = 1e-9  # Relative difference of lengths that count as equal [1]
_NO_POINT = (
    "LAMMPS gives no right force on a cone where it is thinner than a grain: use a Ball as tip, a wider end, one that "
    "is a point, or the ground `bed`"
)


def pieces_of(shapes: Shape | Sequence[Shape]) -> list[Piece]:
    """A body's pieces: a ball or a cone and the shaft on it from the lowest to the highest, others as they are given.

    A cone that ends in a point is a pyramid (`pyramid_corners`), with the shaft on it.

    Raises ValueError, naming it, for what LAMMPS cannot have.
    """
    parts = [shapes] if isinstance(shapes, Shape) else list(shapes)
    straight = all(isinstance(part, Ball | Cylinder | Cone) for part in parts)
    if len(parts) == 1 or not straight or all(isinstance(part, Ball) for part in parts):
        return [piece for part in parts for piece in _alone(part)]
    ordered = sorted((_known(part) for part in parts), key=_bottom)
    seams = [_seam(below, above) for below, above in pairwise(ordered)]
    tip, shaft = ordered[0], ordered[-1]
    if isinstance(tip, Cone) and tip.bottom_radius == 0 and isinstance(shaft, Cylinder):
        return polyhedron_pieces(pyramid_corners(tip, shaft.top))
    ends = [-math.inf, *seams, math.inf]
    return [Primitive(part, ends[k], ends[k + 1]) for k, part in enumerate(ordered)]


def check_thickness(pieces: Sequence[Piece], grain_radius: float) -> None:
    """Raise ValueError for a cone with an end thinner than the largest grain, of radius ``grain_radius`` [m].

    LAMMPS' `region cone` gives its side the curvature radius -2 r, as seen from inside. A grain of radius R outside so
    gets R* = 2 r R / (2 r - R), which is infinite at 2 r = R and negative below: the force is then not a number. From
    r = R on R* is at most twice R, and our bed's is R.
    """
    for piece in pieces:
        shape = piece.shape if isinstance(piece, Primitive) else None
        if isinstance(shape, Cone) and (thin := min(shape.bottom_radius, shape.top_radius)) < grain_radius:
            raise ValueError(
                f"{shape} is {thin:g} m in radius at one end, the largest grain {grain_radius:g} m: {_NO_POINT}"
            )


def check_count(pieces: Sequence[Piece]) -> None:
    """Raise ValueError for more pieces, of all bodies together, than a bed in LAMMPS takes."""
    if len(pieces) <= MOST_PIECES:
        return
    flat = sum(not isinstance(piece, Primitive) for piece in pieces)
    of_faces = f", {flat} of them faces and edges of polyhedra: use fewer corners, or parallelograms as faces"
    raise ValueError(
        f"the bodies have {len(pieces)} pieces{of_faces if flat else ''}; a bed in LAMMPS takes at most {MOST_PIECES}"
    )


def check_plane(shapes: Sequence[Shape], turn: Vector) -> list[Piece]:
    """The pieces of a body of these shapes. Raises ValueError for one that LAMMPS cannot have, OutOfPlaneError for one
    that it cannot have in this turn, a unit quaternion."""
    pieces = pieces_of(shapes)
    check_count(pieces)
    for piece in pieces:
        piece.seat(to_matrix(turn))
    return pieces


def _alone(part: Shape) -> list[Piece]:
    """The pieces of a shape that stands by itself."""
    at, axes = np.zeros(3), np.eye(3)
    if isinstance(part, Placed):
        at, axes = np.array(part.position), to_matrix(np.array(part.turn) / math.hypot(*part.turn))
        part = part.bare
    if isinstance(part, Polyhedron | Mesh):
        return polyhedron_pieces(at + convex_corners(part) @ axes.T)
    if isinstance(part, Cone) and min(part.bottom_radius, part.top_radius) == 0:
        return polyhedron_pieces(at + pyramid_corners(part) @ axes.T)
    return [replace(piece, at=at + axes @ piece.at, axes=axes @ piece.axes) for piece in _primitives(part)]


def _primitives(part: Shape) -> list[Primitive]:
    """Those of a shape in its own axes."""
    if isinstance(part, Capsule):
        start, along = np.array(part.start), np.array(part.end) - np.array(part.start)
        length, placed = float(np.linalg.norm(along)), {"at": start, "axes": _upright(along)}
        return [
            Primitive(Ball(radius=part.radius), -math.inf, 0.0, **placed),
            Primitive(Cylinder(0.0, length, part.radius), 0.0, length, **placed),
            Primitive(Ball((0.0, 0.0, length), part.radius), length, math.inf, **placed),
        ]
    return [Primitive(_known(part))]


def _upright(axis: Vector) -> Vector:
    """A rotation of z into this direction, as a matrix."""
    return np.asarray(Rotation.align_vectors([axis], [[0.0, 0.0, 1.0]])[0].as_matrix())


def _known(part: Shape) -> Ball | Cylinder | Cone | Box:
    """The shape. Raises ValueError for one that LAMMPS has no region for."""
    if isinstance(part, Ball | Cylinder | Cone | Box):
        return part
    raise ValueError(
        f"{type(part).__name__} has no counterpart among LAMMPS' regions: a body in LAMMPS is made of Ball, Capsule, "
        f"Cylinder, Cone, Box or convex Polyhedron"
    )


def _bottom(shape: Shape) -> float:
    if isinstance(shape, Ball):
        return float(shape.center[2]) - shape.radius
    return float(shape.bottom) if isinstance(shape, Cylinder | Cone) else -math.inf


def _seam(below: Shape, above: Shape) -> float:
    """Height at which two pieces meet so smoothly, or so convexly, that a grain touches one of them [m]."""
    if isinstance(above, Cylinder):
        if isinstance(below, Ball) and below.center[:2] == (0.0, 0.0):
            height, radius = below.center[2], below.radius
        elif isinstance(below, Cone) and below.bottom_radius <= below.top_radius:
            height, radius = below.top, below.top_radius
        else:
            height = radius = math.nan
        if math.isclose(above.bottom, height, rel_tol=_SAME, abs_tol=1e-12) and math.isclose(
            above.radius, radius, rel_tol=_SAME
        ):
            return float(height)
    raise ValueError(
        f"{below} below {above}: in LAMMPS a body of several pieces is a cylinder as thick as the ball or the cone "
        f"below it: use a shaft as thick as the tip"
    )


class MovingBody:
    """A body in LAMMPS: the names and commands of its regions, and its pose and motion in the plane.

    ``number``: of the body, from which its names follow. Commands of `create` are for a bed of this ``law`` on bodies.
    """

    def __init__(self, number: int, pieces: Sequence[Piece], law: str, position: Vector) -> None:
        self.number, self.pieces, self.law = number, list(pieces), law
        self.name = f"b{number}"
        self.names = [f"{self.name}p{k}" for k in range(len(self.pieces))]
        self.position, self.velocity = np.array(position, dtype=float), np.zeros(3)
        self.turn, self.spin = np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(3)
        self.base, self.seats = np.eye(3), list[Seat]()  # The turn from which `angle` counts, the regions' seats there
        self.angle = 0.0  # By which the regions are turned about y [rad]
        self.made = False  # Whether LAMMPS has its regions, as they are to be
        self.jumped = False  # Whether it was put elsewhere than where its motion led
        self.known = False  # Whether LAMMPS has regions of these names

    def place(self, position: Vector, velocity: Vector, turn: Vector, spin: Vector) -> None:
        """Set pose and motion. Raises OutOfPlaneError for a body that leaves the plane of motion, x and z."""
        if math.hypot(spin[0], spin[2]) > IN_PLANE * max(1.0, abs(float(spin[1]))):
            raise OutOfPlaneError
        turned = to_matrix(turn)
        since = turned @ self.base.T
        if not self.seats or math.hypot(since[0, 1], since[2, 1]) > IN_PLANE or since[1, 1] < 0:
            self._sit(turned)
            since = np.eye(3)
        angle = math.atan2(since[0, 2], since[2, 2])
        angle += 2 * math.pi * round((self.angle - angle) / (2 * math.pi))
        jump = float(np.abs(position - self.position).max()) > JUMP or abs(angle - self.angle) > JUMP / _ARM
        self.jumped, self.angle = self.jumped or jump, angle
        self.position, self.velocity = np.array(position, dtype=float), np.array(velocity, dtype=float)
        self.turn, self.spin = np.array(turn, dtype=float), np.array(spin, dtype=float)

    def _sit(self, turned: Vector) -> None:
        """Let `angle` count from this turn on; the regions are to be made anew where they are others."""
        before, self.seats = self.seats, [piece.seat(turned) for piece in self.pieces]
        same = len(before) and all(new.like(old) for new, old in zip(self.seats, before, strict=True))
        self.base, self.made, self.jumped = turned, self.made and bool(same), True

    def take_up(self, row: Vector, step: int) -> list[str]:
        """Go on from kept numbers, in a LAMMPS that has no regions yet, at this time step; the commands of its motion.

        ``row``: position, velocity, turn, spin, angle and base, shape [23].
        """
        self.position, self.velocity, self.turn, self.spin = row[:3], row[3:6], row[6:10], row[10:13]
        self.angle, self.base = float(row[13]), row[14:23].reshape(3, 3)
        self.seats = [piece.seat(self.base) for piece in self.pieces]
        self.made = self.known = False
        return self.motion(step)

    def go_on(self, duration: float) -> None:
        """Let it go on for ``duration`` [s] with its velocity and spin, as its regions do."""
        half = 0.5 * duration * float(self.spin[1])
        self.position = self.position + duration * self.velocity
        self.angle += 2 * half
        self.turn = multiply(np.array([math.cos(half), 0.0, math.sin(half), 0.0]), self.turn)

    def motion(self, step: int, *, late: int = 0) -> list[str]:
        """Commands that let it go on from here at time step ``step``, or so many steps late, with its velocity and
        spin."""
        starts, step = (*self.position, self.angle), step + late
        rates = (*self.velocity, float(self.spin[1]))
        lines = [
            f"variable {self.name}{axis} equal {start:.17g}+({rate:.17g})*(step-{step})*dt"
            for axis, start, rate in zip("xyzt", starts, rates, strict=True)
        ]
        turns = zip(self.names, self.seats, strict=True)
        return lines + [f"variable {own}t equal v_{self.name}t+({seat.angle:.17g})" for own, seat in turns]

    def travel(self, duration: float) -> Vector:
        """How far any of its points goes in the next ``duration`` [s] at most, along each axis [m], shape [3]."""
        size = max(float(np.linalg.norm(piece.corners(), axis=1).max()) for piece in self.pieces)
        return np.abs(self.velocity) * duration + abs(float(self.spin[1])) * size * duration

    @property
    def spans(self) -> bool:
        """Whether its section is the same all along y, so that it may be as wide as the bed."""
        return all(piece.spans(seat) for piece, seat in zip(self.pieces, self.seats, strict=True))

    def extent(self, level: float) -> tuple[Vector, Vector]:
        """Where it begins and ends along x and y [m], shape [2] both, of what is below a height [m].

        Infinity and minus infinity where nothing of it is.
        """
        axes, found = to_matrix(self.turn), [np.zeros((0, 2))]
        for piece in self.pieces:
            if isinstance(piece, Primitive) and isinstance(shape := piece.shape, Ball):
                centre = self.position + axes @ (piece.at + piece.axes @ np.array(shape.center))
                above = max(0.0, float(centre[2]) - level)
                if above < shape.radius:
                    half = math.sqrt(shape.radius**2 - above**2)
                    found += [centre[None, :2] - half, centre[None, :2] + half]
                continue
            points = self.position + piece.outline() @ axes.T
            under = points[:, 2] <= level
            low, high = points[under], points[~under]
            # Where the edges cross the height, among all lines from a corner below to one above.
            share = (level - low[:, None, 2]) / (high[None, :, 2] - low[:, None, 2])
            crossed = low[:, None, :2] + share[..., None] * (high[None, :, :2] - low[:, None, :2])
            found += [low[:, :2], crossed.reshape(-1, 2)]
        all_of_them = np.concatenate(found)
        return all_of_them.min(axis=0, initial=math.inf), all_of_them.max(axis=0, initial=-math.inf)

    def create(self) -> list[str]:
        """Commands that make its groups, regions, walls, and the sums of force and moment on it."""
        name, lines = self.name, list[str]()
        for piece, seat, own in zip(self.pieces, self.seats, self.names, strict=True):
            if self.known:
                lines += [f"uncompute {own}", f"unfix {own}", f"region {own} delete", f"group {own} delete"]
            moved = f"side out units box move v_{name}x v_{name}y v_{name}z rotate v_{own}t 0 0 0 0 1 0"
            lines += [
                f"group {own} empty",
                f"region {own} {piece.words(seat)} {moved}",
                f"fix {own} {own} wall/gran/region granular {self.law} region {own} contacts",
                # Moment about the body's origin of what the grains get: of the arm (point - origin) and the force.
                f"variable {own}mx atom (f_{own}[6]-v_{name}y)*f_{own}[4]-(f_{own}[7]-v_{name}z)*f_{own}[3]",
                f"variable {own}my atom (f_{own}[7]-v_{name}z)*f_{own}[2]-(f_{own}[5]-v_{name}x)*f_{own}[4]",
                f"variable {own}mz atom (f_{own}[5]-v_{name}x)*f_{own}[3]-(f_{own}[6]-v_{name}y)*f_{own}[2]",
                f"compute {own} {own} reduce sum f_{own}[2] f_{own}[3] f_{own}[4] v_{own}mx v_{own}my v_{own}mz",
            ]
        self.made = self.known = True
        return lines

    def select(self, duration: float, margin: float) -> list[str]:
        """Commands that choose the grains each piece may touch in the next ``duration`` [s]: those near it, beside it.

        ``margin``: how far the middle of a grain is beyond the piece at most [m].
        """
        lines, turned, travel = list[str](), to_matrix(self.turn), self.travel(duration) + margin
        for piece, own in zip(self.pieces, self.names, strict=True):
            corners = self.position + piece.corners() @ turned.T
            sides = np.column_stack([corners.min(axis=0) - travel, corners.max(axis=0) + travel])
            lines += [f"group {own} clear", f"region near block {digits(sides.ravel())} units box"]
            for cell in piece.cells():
                parts = [f"side{k}" for k in range(len(cell))]
                halves = zip(parts, cell, strict=True)
                lines += [f"region {kind} {half.words(self.position, turned)} units box" for kind, half in halves]
                if parts:
                    lines.append(f"region chosen intersect {len(parts) + 1} near {' '.join(parts)}")
                lines.append(f"group {own} region {'chosen' if parts else 'near'}")
                lines += [f"region {kind} delete" for kind in (["chosen", *parts] if parts else [])]
            lines.append("region near delete")
        return lines
