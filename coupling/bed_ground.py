"""A bed of grains as a ground: the members of a platform, or one spike, as DEM bodies that follow the body's pose.

Every spike is a body of its own, so that its force is known. Of a planar platform every force on the body counts
`copies` times (`coupling.members`).
"""

import math
from collections.abc import Sequence
from functools import partial
from typing import Any, Protocol, runtime_checkable
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import ArrayLike

from dem.engine.values import Grains
from hedgebed_renamed import renamed, renamed_keywords
from rigid.checks.unfit import UnfitSettingsError
from rigid.ground.reaction import Contact, Facts, Reaction, State, Turned
from rigid.platform.spike import Spike
from rigid.spatial.quaternions import multiply, to_matrix

from .ground import part_of, prefixed
from .members import HULL, Member, spike_member
from .poses import Pose, Twist, Vector, chord_share, matrices

__all__ = ["BedGround", "GrainBed", "LeftTheBedError"]

AWAY = 100.0  # How far above the bed a body waits before it is placed, or when it is not in use [m]
_placed: WeakKeyDictionary[Any, dict[Spike, int]] = WeakKeyDictionary()  # Bed -> spike -> number of its body


@runtime_checkable
class GrainBed(Protocol):
    """A `dem.Bed`, or what has its interface."""

    def add_body(self, shapes: Sequence[Any], **options: Any) -> int:
        """Put a body of these shapes into the bed; its number."""


class LeftTheBedError(UnfitSettingsError):
    """The body came down where there is no bed, or down to its floor.

    `lacking`: how much bed it would have taken on that side [m]; 0 where the depth is not sufficient.
    """

    def __init__(self, message: str, *, lacking: float = 0.0) -> None:
        super().__init__(message)
        self.lacking = lacking


class BedGround:
    """`bed` under a body made of `members`, or under one `Spike`.

    Parameters
    ----------
    bed : dem.Bed (or whatever has its interface).
    body : its members; or a spike, which is put above the surface, free of contact. A spike that was in this bed before
        is taken up again, and another one that is still in it is put out of reach.
    at : (x, y) of the spike's axis [m]; None: the middle of the bed.
    origin : (x, y) in the bed of the x = y = 0 of a body made of members [m]; its z = 0 is the surface.
    copies : how many of each member there are side by side [1].
    touch : force over `copies`, in whatever direction, from which a member counts as touching [N]: a spike in sand may
        be held sideways, or back, where nothing supports it.
    bounded : whether a member that comes down beyond the bed's ends along x is an error; it is periodic there.
    begin : where the bed counts as beginning along x, one period long [m]; the body may start beyond its cell that way.
    bounded_across : likewise along y, where a body in space may go.
    friction, restitution, rolling_friction, young, poisson : of a grain and a member, as `Bed.add_body` has them; those
        of a spike are its own.

    The members wait far above until the first step. Raises ValueError for more slots than a bed takes, and where the
    bed is too narrow for the spike.
    """

    name = "bed"
    gives_friction = True
    hold, take_back = renamed("hold", "checkpoint"), renamed("take_back", "rollback")
    set_gravity = renamed("set_gravity", "bed.set_gravity")
    keep_book = renamed("keep_book", "bed.track_contact_work")

    @renamed_keywords(members="body", spike="body")
    def __init__(
        self,
        bed: Any,
        body: Spike | Sequence[Member],
        *,
        at: tuple[float, float] | None = None,
        origin: tuple[float, float] = (0.0, 0.0),
        copies: float = 1.0,
        touch: float = 0.0,
        bounded: bool = True,
        begin: float = 0.0,
        bounded_across: bool = False,
        friction: float | None = None,
        restitution: float | None = None,
        rolling_friction: float | None = None,
        young: float | None = None,
        poisson: float = 0.3,
    ) -> None:
        self.bed, self.copies, self.touch, self.bounded = bed, copies, touch, bounded
        self._begin, self._bounded_across = begin, bounded_across
        self.spike = body if isinstance(body, Spike) else None  # The body, where it is a spike
        self.members = [spike_member(body)] if isinstance(body, Spike) else list(body)
        self._height = float(bed.surface)
        self.origin = np.array([*origin, self._height])  # Where the body's (0, 0, 0) is in the bed [m], shape (3,)
        self.surface, self.centre, self.clearance = 0.0, (0.0, 0.0), 0.0
        slots = sorted({member.slot for member in self.members})
        self._slots = [[k for k, member in enumerate(self.members) if member.slot == slot] for slot in slots]
        if isinstance(body, Spike):
            self.bodies = [self._put_in(body, at)]
        else:
            self.bodies = [
                bed.add_body(
                    self.members[indices[0]].shapes(), position=(*origin, self._height + AWAY), friction=friction,
                    restitution=restitution, rolling_friction=rolling_friction, young=young, poisson=poisson,
                )
                for indices in self._slots
            ]  # fmt: skip
        self._used = [indices[0] for indices in self._slots]  # The member that each body stood for in the last step
        self._at = np.array([member.at for member in self.members])
        self._turns = np.array([member.turn for member in self.members])
        self._mass = float(bed.grains().mass.sum())
        self.impulse = np.zeros(3)  # Of gravity and floor on the grains since the start [N s]
        self.drag_time = math.inf  # Of a drag that calms the grains before time begins (`Bed.advance`) [s]
        self.grain_steps = 0  # Grains computed since the start, summed over the bed's steps (fewer where grains sleep)

    def _put_in(self, spike: Spike, at: tuple[float, float] | None) -> int:
        """The body of the bed that is this spike; positions are the bed's own."""
        bed = self.bed
        if min(bed.size[0], bed.size[1]) < 2 * spike.diameter:
            raise ValueError(
                f"size of the bed is {tuple(bed.size)} m: a spike of diameter {spike.diameter} m needs at least "
                f"{2 * spike.diameter:.6g} m both ways"
            )
        surface = self.surface = self._height
        self.origin, self.bounded = np.zeros(3), False
        self.centre = at if at is not None else (0.5 * bed.size[0], 0.5 * bed.size[1])
        self.clearance = _clear_height(bed.grains(), spike, self.centre, bed.size, surface) - surface
        start = (*self.centre, surface + self.clearance)
        placed = _placed.setdefault(bed, {})
        for other, body in placed.items():
            position = start if other == spike else (*self.centre, surface + AWAY)
            bed.move_body(body, position=position, velocity=(0.0, 0.0, 0.0))
        if spike not in placed:
            placed[spike] = bed.add_body(
                self.members[0].shapes(), position=start, friction=spike.friction, restitution=spike.restitution
            )
        return placed[spike]

    def __repr__(self) -> str:
        body = f"{self.spike!r}" if self.spike is not None else f"{len(self.members)} members"
        return f"BedGround({self.bed.grain_count} grains under {body}, step {self.time_step:.3g} s)"

    @property
    def body(self) -> int:
        """Number of the first member's DEM body: the spike's."""
        return int(self.bodies[0])

    @property
    def depth_limit(self) -> float:
        """How deep a spike's tip may go [m]: half its diameter above the floor."""
        return self._height - (0.5 * self.spike.diameter if self.spike is not None else 0.0)

    def describe(self) -> Facts:
        """What it is, in plain numbers, for run.toml."""
        material, recipe = self.bed.material, self.bed.recipe
        found: Facts = {"material": material.name if material is not None else None}
        for name in ("size", "grain_count", "packing_fraction", "gravity", "surface", "seed", "time_step", "precision"):
            value = getattr(self.bed, name, None)
            found[name] = value if isinstance(value, str | None) else np.asarray(value).tolist()
        found |= {name: recipe.get(name) for name in ("grain", "spread", "packing", "young", "max_overlap", "code")}
        return {name: value for name, value in found.items() if value is not None}

    @property
    def time_step(self) -> float:
        """The bed's own [s]."""
        return float(self.bed.time_step)

    lag = time_step  # See `Ground.lag`

    @property
    def gravity(self) -> float:
        """Magnitude of the gravity that acts on the grains [m/s2]."""
        return math.hypot(*self.bed.gravity)

    @property
    def grain(self) -> float:
        """Mean diameter of the grains [m]."""
        return 2 * float(np.mean(self.bed.grains().radius))

    def grain_speed(self) -> float:
        """Root of the mean square of the grains' speeds, by mass [m/s]."""
        grains = self.bed.grains(contacts=False)
        return math.sqrt(float(grains.mass @ (grains.velocity**2).sum(axis=1)) / self._mass)

    def clear_height(self, pose: Pose, *, most: float = 0.05) -> float:
        """How far the body must be lifted from `pose` to touch no grain [m]; a hundredth of a grain is added.

        0 where it touches none there. Raises ValueError where `most` [m] would not do.
        """
        grains = self.bed.grains()
        if self._deepest_overlap(grains, pose)[0] <= 0:
            return 0.0
        low, high = 0.0, most
        if self._deepest_overlap(grains, pose, most)[0] > 0:
            raise ValueError(f"the body starts so deep in the bed that {most:g} m would not lift it clear")
        for _ in range(40):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if self._deepest_overlap(grains, pose, middle)[0] > 0 else (low, middle)
        return high + 0.02 * float(grains.radius.mean())

    def place(self, pose: Pose) -> None:
        """Start a body at `pose`. Raises ValueError, with the height that it needs, where it overlaps grains."""
        overlap, row = self._deepest_overlap(self.bed.grains(), pose)
        if overlap > 0:
            raise ValueError(
                f"the body, its centre at a height of {pose.position[2]:.6g} m, starts in overlap with a grain: "
                f"{_called(row)} by {overlap:.3g} m; start it {self.clear_height(pose):.6g} m higher"
            )

    def _deepest_overlap(self, grains: Grains, pose: Pose, lift: float = 0.0) -> tuple[float, int]:
        """Largest overlap of a member and a grain [m], and the member's row."""
        worst = (-math.inf, HULL)
        raised = grains.position - np.array([0.0, 0.0, lift])
        for index in self._lowest(to_matrix(pose.turn)):
            member = self.members[index]
            at = self.origin + pose.position + to_matrix(pose.turn) @ member.at
            distance = self._surface_of(member, Pose(at, multiply(pose.turn, member.turn)), raised)[0]
            worst = max(worst, (float((grains.radius - distance).max()), member.row))
        return worst

    def step(
        self, position: ArrayLike, velocity: ArrayLike, dt: float, turn: Turned = None, spin: Turned = None
    ) -> Reaction:
        """Advance the bed by `dt` [s] under the moving body and return the mean reaction on it (see `Ground.step`).

        Raises LeftTheBedError, ValueError where dt is no multiple of the bed's step, and what the bed raises.
        """
        pose, twist = Pose.of(position, turn), Twist.of(velocity, spin)
        steps = round(dt / self.time_step)
        if steps < 1 or not math.isclose(steps * self.time_step, dt, rel_tol=1e-9):
            raise ValueError(f"dt is {dt} s: it must be a whole multiple of the bed's step, {self.time_step} s")
        first, middle, last = matrices(pose, twist, dt)
        chord = chord_share(twist, dt)
        used = self._used = self._lowest(first)
        at = self._at[used]
        arms = chord * (at @ middle.T)
        self.bed.move_bodies(
            self.bodies,
            positions=self.origin + pose.position + at @ first.T,
            velocities=twist.velocity + np.cross(twist.spin, arms),
            turns=self._turns[used] @ _left(pose.turn).T,
            spins=np.tile(twist.spin, (len(used), 1)),
        )
        before = self.bed.grain_steps
        self.bed.advance(steps, drag_time=self.drag_time)
        self.grain_steps += self.bed.grain_steps - before
        rows = self.bed.reactions()
        forces, torques = np.hsplit(self.copies * rows[self.bodies], 2)
        force_on, torque_on = forces.sum(axis=0), (torques + np.cross(arms, forces)).sum(axis=0)
        halfway = pose.position + 0.5 * dt * twist.velocity
        ends = pose.position + dt * twist.velocity + at @ last.T
        contacts: list[Contact] = []
        sinkage: dict[int, float] = {}
        for k, index in enumerate(used):
            member, force = self.members[index], forces[k]
            lowest = float(ends[k, 2]) - self.surface - member.radius
            if lowest < 0 and member.row != HULL:
                sinkage[member.row] = -lowest
            if np.linalg.norm(force) > self.touch * self.copies:
                point = halfway + arms[k] - np.array([0.0, 0.0, member.radius])
                along = np.array([force[0], force[1], 0.0])
                contacts.append(Contact(point, float(force[2]), tangential_force=along, member=member.row))
                self._check_inside(member, ends[k], lowest)
        floor = rows[0, :3] if self.bodies[0] > 0 else np.zeros(3)
        self.impulse = self.impulse + dt * (self._mass * np.array(self.bed.gravity, dtype=float) - floor)
        return Reaction(force_on, torque_on, tuple(contacts), sinkage)

    def _check_inside(self, member: Member, end: Vector, lowest: float) -> None:
        what = _called(member.row)
        sides = ((self.bounded, self._begin, "ahead of", "behind"), (self._bounded_across, 0.0, "left of", "right of"))
        for axis, (bounded, begin, beyond, before) in enumerate(sides):
            at, length = self.origin[axis] + float(end[axis]) - begin, float(self.bed.size[axis])
            if bounded and not 0 <= at <= length:
                way, off = (beyond, at - length) if at > length else (before, -at)
                size = f"{length:g} m {'wide' if axis else 'long'}"
                raise LeftTheBedError(
                    f"{what} came down {off:.3g} m {way} the bed, which is {size}, at {'xy'[axis]} = "
                    f"{float(end[axis]):.4g} m from the start",
                    lacking=off + 2 * member.radius,
                )
        if member.row != HULL and lowest + self._height < member.radius:
            raise LeftTheBedError(
                f"{what} sank {-lowest:.3g} m, to within its radius of the floor: the bed is {self._height:.3g} m deep"
            )

    def _lowest(self, matrix: Vector) -> list[int]:
        """The member that each slot stands for, its lowest, with the body turned by this matrix."""
        heights = (self._at @ matrix[2]).tolist()
        return [min(indices, key=heights.__getitem__) for indices in self._slots]

    def energies(self) -> dict[str, float]:
        """Of the grains, `copies` times [J] (`dem.engine.energy.bed_energies`)."""
        from dem.engine.energy import bed_energies

        found = bed_energies(self.bed, bodies=self._surfaces())
        return {name: self.copies * value for name, value in found.items()}

    def work_taken(self) -> dict[str, float]:
        """`Bed.contact_work`, `copies` times [J]."""
        return {name: self.copies * value for name, value in self.bed.contact_work.items()}

    def pushes(self) -> tuple[Vector, Vector]:
        """Where grains touch the members now [m], and the normal springs' forces on them [N], shape [n, 3] both.

        In the body's world (z from the surface); of one of the `copies`, with cohesion, without damping and friction.
        """
        from dem.engine.energy import body_pushes

        points, forces = body_pushes(self.bed, bodies=self._surfaces())
        return points - self.origin, forces

    def _surfaces(self) -> dict[int, Any]:
        poses = {body: Pose(self.bed.body_position(body), self.bed.body_turn(body)) for body in self.bodies}
        return {
            body: partial(self._surface_of, self.members[index], poses[body])
            for body, index in zip(self.bodies, self._used, strict=True)
        }

    def _surface_of(self, member: Member, pose: Pose, points: Vector) -> tuple[Vector, Vector, Vector]:
        """Distance of points to a member placed there, outward normal, curvature: round where a rod has a ball.

        As `dem.shapes.basic` has it for a point outside: a rod's other end is flat. Points within count from its side.
        """
        matrix, period = to_matrix(pose.turn), np.array(self.bed.size, dtype=float)[:2]
        away = points - pose.position
        away[:, :2] -= period * np.round(away[:, :2] / period)
        local = away @ matrix
        size = np.hypot(local[:, 0], local[:, 1])
        across = local[:, :2] / np.maximum(size, 1e-30)[:, None]
        flat = np.maximum(local[:, 2] - member.length, 0.0) + np.minimum(local[:, 2] + member.below, 0.0)
        side = size - member.radius
        beside = np.where(flat != 0, np.maximum(side, 0.0), side)
        distance = np.where(flat != 0, np.hypot(beside, flat), side)
        out = np.where(flat != 0, beside / np.where(flat != 0, distance, 1.0), 1.0)
        normal = np.column_stack([out[:, None] * across, flat / np.where(flat != 0, distance, 1.0)])
        curvature = np.zeros(len(local))
        if not member.below:
            ball = (local[:, 2] < 0) | (member.length == 0)
            length = np.linalg.norm(local[ball], axis=1)
            distance[ball], normal[ball] = length - member.radius, local[ball] / length[:, None]
            curvature[ball] = 1.0 / member.radius
        return distance, normal @ matrix.T, curvature

    def momentum(self) -> Vector:
        """Momentum of the grains less the impulse of gravity and floor on them, `copies` times [N s], shape (3,).

        With the velocities half a step ahead of the positions: what changes it is the body, to round-off.
        """
        return np.asarray(self.copies * (self.bed.momentum() - self.impulse))

    def angular_momentum(self) -> Vector:
        """Of the grains about the body's (0, 0, 0), less what they got from elsewhere, `copies` times [N m s].

        Shape (3,), counted since `Bed.track_contact_work`. What changes it is the body, to round-off: weight, floor,
        what crosses the periodic sides and sleepers are separate (`dem.engine.dissipation`).
        """
        found = self.bed.angular_momentum()
        floor = found["first_body"] if self.bodies[0] > 0 else 0.0  # the floor is the first body
        about_bed = found["grains"] - (found["outside"] - floor)
        return np.asarray(self.copies * about_bed - np.cross(self.origin, self.momentum()))

    def checkpoint(self) -> Any:
        """See `Ground.checkpoint`: the bed's where it lies, on a GPU without its leaving it."""
        return self.bed.checkpoint(), self.impulse.copy(), list(self._used), self.grain_steps

    def rollback(self, kept: Any) -> None:
        """Go back to the last checkpoint. Raises ValueError for another."""
        bed, impulse, used, self.grain_steps = kept
        self.bed.rollback(bed)
        self.impulse, self._used = impulse.copy(), list(used)

    def state(self) -> State:
        """All that the next steps depend on: the bed's state, with the bodies and their contacts, and this ground's."""
        return prefixed("bed", self.bed.state()) | {
            "impulse": self.impulse.copy(),
            "used": np.array(self._used),
            "grain_steps": np.array(self.grain_steps),
        }

    def restore(self, state: State) -> None:
        """Go back to what `state` gave."""
        self.bed.restore({key: np.asarray(value) for key, value in part_of(state, "bed").items()})
        self.impulse = np.array(state["impulse"], dtype=float)
        self._used = [int(index) for index in np.asarray(state["used"])]
        self.grain_steps = int(np.asarray(state["grain_steps"]))


def _clear_height(grains: Grains, spike: Spike, centre: tuple[float, float], size: ArrayLike, surface: float) -> float:
    """Lowest height of the tip [m] at which no grain touches the spike, never below the surface.

    A ball's distance is taken exactly; cones and flat ends as stacks of discs, which errs by a grain's radius at most,
    upwards. A hundredth of a grain is added, so that rounding makes no contact.
    """
    position, radius = grains.position, grains.radius
    away = position[:, :2] - np.asarray(centre)
    width = np.asarray(size, dtype=float)[:2]
    away -= width * np.round(away / width)  # the bed is periodic
    distance = np.hypot(away[:, 0], away[:, 1])
    near = distance < 0.5 * spike.diameter + radius
    if not near.any():
        return surface
    distance, grain_radius, height = distance[near], radius[near], position[near, 2]
    heights = [surface]
    if spike.tip == "sphere":
        ball = 0.5 * spike.diameter
        heights.append(float(np.max(height + np.sqrt((ball + grain_radius) ** 2 - distance**2) - ball)))
    else:
        for level in np.linspace(0.0, max(spike.tip_height, 1e-12), 33):
            under = distance < spike.radius_at(float(level)) + grain_radius
            if under.any():
                heights.append(float(np.max(height[under] + grain_radius[under])) - float(level))
    return max(heights) + 0.01 * float(radius.mean())


def _called(row: int) -> str:
    return "the hull" if row == HULL else f"spike {row}"


def _left(turn: Vector) -> Vector:
    """The product with a quaternion on its right as a matrix, shape (4, 4): multiply(turn, q) = matrix @ q."""
    return np.column_stack([multiply(turn, unit) for unit in np.eye(4)])
