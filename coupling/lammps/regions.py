"""Bodies as regions of LAMMPS: one region for each piece, moved by variables that the master sets.

LAMMPS' unions of moving regions are of no use here: as walls they have no velocity, and in LAMMPS of 2021 no distance.
So every piece has its own region and its own `fix wall/gran/region`. Pieces follow one another along the body's z axis.
A grain belongs to the piece beside its centre, so that it touches only the one that is nearest. A grain that passes
from one piece to the next begins a new contact there, without friction's history.

A region turns about one axis, which LAMMPS takes as a constant. Here it is y, across the plane of motion.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from dem.shapes.basic import Ball, Cone, Cylinder, Shape
from dem.shapes.solids import Box
from rigid.spatial.quaternions import multiply, to_matrix

from .words import digits

__all__ = ["MovingBody", "Piece", "pieces_of"]

Vector = np.ndarray
_IN_PLANE = 1e-6  # How far from the plane of motion, or from its normal, an axis may be [rad]
_JUMP, _ARM = 1e-9, 0.1  # A larger change of place [m], or over this arm [m] of angle, is no motion
_SIDES = 16  # Of the polygon around a circle
_SAME = 1e-9  # Relative difference of lengths that count as equal [1]


@dataclass(frozen=True)
class Piece:
    """A primitive, and from where to where along the body's z axis grains belong to it [m]."""

    shape: Ball | Cylinder | Cone | Box
    begin: float = -math.inf
    end: float = math.inf

    def words(self, across: int = 0) -> str:
        """Style and numbers of the region. ``across``: 1 or -1 where the body's z axis lies along y or -y, else 0."""
        shape = self.shape
        if isinstance(shape, Ball):
            return f"sphere {digits((*shape.center, shape.radius))}"
        if isinstance(shape, Box):
            return f"block {digits(end for ends in zip(*_ends(shape), strict=True) for end in ends)}"
        if isinstance(shape, Cone):
            numbers = (shape.bottom_radius, shape.top_radius, shape.bottom, shape.top)
            return f"cone z 0 0 {digits(numbers)}"
        if across:
            low, high = sorted((across * shape.bottom, across * shape.top))
            return f"cylinder y 0 0 {digits((shape.radius, low, high))}"
        return f"cylinder z 0 0 {digits((shape.radius, shape.bottom, shape.top))}"

    def corners(self) -> Vector:
        """Corners of a box around it in the body's axes [m], shape [8, 3]."""
        low, high = _ends(self.shape)
        return np.array([(x, y, z) for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])])

    def outline(self) -> Vector:
        """Corners of a polyhedron around it, at most 2 % wider, in the body's axes [m], shape [n, 3]; not of a ball."""
        shape = self.shape
        if isinstance(shape, Box | Ball):
            return self.corners()
        angle = 2 * math.pi * np.arange(_SIDES) / _SIDES
        ring = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(_SIDES)]) / math.cos(math.pi / _SIDES)
        if isinstance(shape, Cone):
            below, above = shape.bottom_radius, shape.top_radius
        else:
            below = above = shape.radius
        return np.concatenate([below * ring + (0.0, 0.0, shape.bottom), above * ring + (0.0, 0.0, shape.top)])


def _ends(shape: Ball | Cylinder | Cone | Box) -> tuple[Vector, Vector]:
    """Lower and upper corner of a box around a shape [m]."""
    if isinstance(shape, Ball):
        return np.array(shape.center) - shape.radius, np.array(shape.center) + shape.radius
    if isinstance(shape, Box):
        half = 0.5 * np.array(shape.size)
        return np.array(shape.center) - half, np.array(shape.center) + half
    radius = max(shape.bottom_radius, shape.top_radius) if isinstance(shape, Cone) else shape.radius
    return np.array([-radius, -radius, shape.bottom]), np.array([radius, radius, shape.top])


def pieces_of(shapes: Shape | Sequence[Shape]) -> list[Piece]:
    """A body's pieces, from the lowest to the highest. Raises ValueError, naming it, for what LAMMPS cannot have."""
    parts = [shapes] if isinstance(shapes, Shape) else list(shapes)
    for part in parts:
        if not isinstance(part, Ball | Cylinder | Cone | Box):
            raise ValueError(
                f"{type(part).__name__} has no counterpart among LAMMPS' regions: a body in LAMMPS is made of Ball, "
                f"Cylinder, Cone or Box"
            )
    if len(parts) == 1:
        return [Piece(parts[0])]  # type: ignore[arg-type]
    ordered = sorted(parts, key=_bottom)
    seams = [_seam(below, above) for below, above in pairwise(ordered)]
    ends = [-math.inf, *seams, math.inf]
    return [Piece(part, ends[k], ends[k + 1]) for k, part in enumerate(ordered)]  # type: ignore[arg-type]


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
        f"below it; a shaft as thick as the tip would do"
    )


class MovingBody:
    """A body in LAMMPS: the names and commands of its regions, and its pose and motion in the plane.

    ``number``: of the body, from which its names follow. Commands of `create` are for a bed of this ``law`` on bodies.
    """

    def __init__(self, number: int, pieces: Sequence[Piece], law: str, position: Vector) -> None:
        self.number, self.pieces, self.law = number, list(pieces), law
        self.name = f"b{number}"
        self.names = [f"{self.name}{'abcdefgh'[k]}" for k in range(len(self.pieces))]
        self.position, self.velocity = np.array(position, dtype=float), np.zeros(3)
        self.turn, self.spin = np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(3)
        self.angle = 0.0  # By which the regions are turned about y [rad]
        self.across = 0  # 1 or -1 where the body's z axis lies across the plane, along y or -y
        shapes = [piece.shape for piece in self.pieces]
        self.centred = len(shapes) == 1 and isinstance(shapes[0], Ball) and not any(shapes[0].center)
        self.made = False  # Whether LAMMPS has its regions, as they are to be
        self.jumped = False  # Whether it was put elsewhere than where its motion led
        self.known = False  # Whether LAMMPS has regions of these names

    def place(self, position: Vector, velocity: Vector, turn: Vector, spin: Vector) -> None:
        """Set pose and motion. Raises ValueError for a body that leaves the plane of motion, x and z."""
        axes = to_matrix(turn)
        along, side = axes[:, 2], axes[:, 0]
        across = round(float(along[1])) if math.hypot(along[0], along[2]) < _IN_PLANE else 0
        spins_out = math.hypot(spin[0], spin[2]) > _IN_PLANE * max(1.0, abs(float(spin[1])))
        leans = not across and abs(along[1]) > _IN_PLANE
        if spins_out or (leans and not self.centred):
            raise ValueError(
                "this body turns out of the plane of motion, x and z: LAMMPS' regions turn about one constant axis, "
                "which is y here; the ground `bed` takes such a body"
            )
        if across and not self.centred and not all(isinstance(piece.shape, Cylinder) for piece in self.pieces):
            raise ValueError("a body whose z axis lies across the plane of motion must be one Cylinder in LAMMPS")
        angle = math.atan2(-side[2], side[0]) if across or self.centred else math.atan2(along[0], along[2])
        angle += 2 * math.pi * round((self.angle - angle) / (2 * math.pi))
        jump = float(np.abs(position - self.position).max()) > _JUMP or abs(angle - self.angle) > _JUMP / _ARM
        self.jumped, self.angle = self.jumped or jump, angle
        if across != self.across:  # regions have their axes from the start
            self.across, self.made = across, False
        self.position, self.velocity = np.array(position, dtype=float), np.array(velocity, dtype=float)
        self.turn, self.spin = np.array(turn, dtype=float), np.array(spin, dtype=float)

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
        return [
            f"variable {self.name}{axis} equal {start:.17g}+({rate:.17g})*(step-{step})*dt"
            for axis, start, rate in zip("xyzt", starts, rates, strict=True)
        ]

    def reach(self, duration: float, margin: float) -> tuple[Vector, Vector]:
        """Lower and upper corner of a box around it over the next ``duration`` [s], ``margin`` wider [m]."""
        corners = np.concatenate([piece.corners() for piece in self.pieces]) @ to_matrix(self.turn).T
        travel = self.travel(duration) + margin
        return self.position + corners.min(axis=0) - travel, self.position + corners.max(axis=0) + travel

    def travel(self, duration: float) -> Vector:
        """How far any of its points goes in the next ``duration`` [s] at most, along each axis [m], shape [3]."""
        size = max(float(np.linalg.norm(piece.corners(), axis=1).max()) for piece in self.pieces)
        return np.abs(self.velocity) * duration + abs(float(self.spin[1])) * size * duration

    @property
    def spans(self) -> bool:
        """Whether its section is the same all along y, so that it may be as wide as the bed."""
        return bool(self.across) or all(isinstance(piece.shape, Box) for piece in self.pieces)

    def extent(self, level: float) -> tuple[Vector, Vector]:
        """Where it begins and ends along x and y [m], shape [2] both, of what is below a height [m].

        Infinity and minus infinity where nothing of it is.
        """
        axes, found = to_matrix(self.turn), [np.zeros((0, 2))]
        for piece in self.pieces:
            shape = piece.shape
            if isinstance(shape, Ball):
                centre = self.position + axes @ np.array(shape.center)
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
        for piece, own in zip(self.pieces, self.names, strict=True):
            if self.known:
                lines += [f"uncompute {own}", f"unfix {own}", f"region {own} delete", f"group {own} delete"]
            moved = f"side out units box move v_{name}x v_{name}y v_{name}z rotate v_{name}t 0 0 0 0 1 0"
            lines += [
                f"group {own} empty",
                f"region {own} {piece.words(self.across)} {moved}",
                f"fix {own} {own} wall/gran/region granular {self.law} region {own} contacts",
                # Moment about the body's origin of what the grains get: of the arm (point - origin) and the force.
                f"variable {own}mx atom (f_{own}[6]-v_{name}y)*f_{own}[4]-(f_{own}[7]-v_{name}z)*f_{own}[3]",
                f"variable {own}my atom (f_{own}[7]-v_{name}z)*f_{own}[2]-(f_{own}[5]-v_{name}x)*f_{own}[4]",
                f"variable {own}mz atom (f_{own}[5]-v_{name}x)*f_{own}[3]-(f_{own}[6]-v_{name}y)*f_{own}[2]",
                f"compute {own} {own} reduce sum f_{own}[2] f_{own}[3] f_{own}[4] v_{own}mx v_{own}my v_{own}mz",
            ]
        self.made = self.known = True
        return lines

    def select(self, low: Vector, high: Vector) -> list[str]:
        """Commands that choose the grains each piece may touch: those in this box, beside the piece."""
        sides = " ".join(f"{a:.17g} {b:.17g}" for a, b in zip(low, high, strict=True))
        lines = [f"region near block {sides} units box"]
        up = to_matrix(self.turn)[:, 2]
        for piece, own in zip(self.pieces, self.names, strict=True):
            lines.append(f"group {own} clear")
            parts = ["near"]
            for height, sense, kind in ((piece.begin, 1.0, "above"), (piece.end, -1.0, "below")):
                if math.isfinite(height):
                    at, normal = self.position + height * up, sense * up
                    lines.append(f"region {kind} plane {digits((*at, *normal))} units box")
                    parts.append(kind)
            if len(parts) > 1:
                lines.append(f"region chosen intersect {len(parts)} {' '.join(parts)}")
            lines.append(f"group {own} region {'chosen' if len(parts) > 1 else 'near'}")
            if len(parts) > 1:
                lines.append("region chosen delete")
            lines += [f"region {kind} delete" for kind in parts[1:]]
        return [*lines, "region near delete"]
