"""A bed of grains as a footing: the platform's spikes and hull as DEM bodies that follow its pose.

A row of spikes is one spike in the bed, `copies` of them side by side in the platform: the bed is periodic across (y),
so it is a slice of the sand as wide as a spike has for itself, and every force on the body counts `copies` times. Each
spike is a body of its own, so that its force is known; rows that face each other share one (`slot`), since only the
lower one can be near the sand.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rigid.platform import Platform
from rigid.quaternions import multiply, to_matrix
from rigid.reaction import Contact

from .footing import FootReaction, row_tips
from .poses import Pose, Twist, Vector, Wrench, chord_share, matrices

__all__ = [
    "FEWEST_SLOTS", "HULL", "BedFooting", "LeftTheBedError", "Member", "ball_member", "platform_members", "slots_of",
    "spatial_members",
]  # fmt: skip

HULL = -1
"""Row number of what is no spike."""
FEWEST_SLOTS = 3
"""Bodies of the bed that rows share in turn, with which those that share one are far enough apart."""
AWAY = 100.0
"""How far above the bed a body waits before it is placed [m]."""


class LeftTheBedError(RuntimeError):
    """The body came down where there is no bed, or down to its floor.

    `lacking`: how much bed it would have taken on that side [m]; 0 where it is depth that lacks.
    """

    def __init__(self, said: str, *, lacking: float = 0.0) -> None:
        super().__init__(said)
        self.lacking = lacking


@dataclass(frozen=True, kw_only=True)
class Member:
    """One piece of the platform that grains can touch: a ball, or a rod with a round end at its lower end."""

    row: int
    """Of the planar model's rows; HULL for the hull."""
    at: Vector
    """Its origin in body axes [m], shape (3,)."""
    turn: Vector
    """Unit quaternion from its axes (z along the rod) to the body's, shape (4,)."""
    radius: float
    """[m]."""
    length: float = 0.0
    """Of the rod above its origin [m]; 0: a ball."""
    below: float = 0.0
    """Of the rod below its origin [m]; only where there is no ball."""
    slot: int = 0
    """The DEM body that stands for it: that of a slot is its lowest member."""

    def shapes(self) -> list[Any]:
        """As `dem.shapes` has it, in its own axes."""
        from dem.shapes import Ball, Cylinder

        parts: list[Any] = [] if self.below else [Ball(radius=self.radius)]
        if self.length:
            parts.append(Cylinder(bottom=-self.below, top=self.length, radius=self.radius))
        return parts


def ball_member(radius: float) -> Member:
    """A ball at the body's origin."""
    return Member(row=0, at=np.zeros(3), turn=np.array([1.0, 0.0, 0.0, 0.0]), radius=radius)


def slots_of(count: int) -> int:
    """How many bodies of the bed the `count` rows of a platform in the plane share in turn; `FEWEST_SLOTS` will do."""
    return next(n for n in (6, 5, 4, 3, 2, 1) if count % n == 0 and (n < count or n == 1))


def platform_members(
    *, spike_length: float, count: int, diameter: float, clear: float, hull_radius: float = 0.0, width: float = 0.0
) -> list[Member]:
    """`count` rows of spikes that end `spike_length` [m] from the centre, and a hull that rolls inside the octagon.

    A spike is a rod of this `diameter` [m] with a ball at its end, `clear` [m] long, and lies in the plane of motion
    (the Hedgehog's own lean sideways by 21 degrees). The hull is a cylinder about the axis of rotation, `hull_radius`
    [m] thick and as wide as the bed, `width` [m]; 0: none. Rods go on into it, however long `clear` is, so that no
    grain gets between shaft and hull. Raises ValueError for a spike thicker than long.
    """
    radius = 0.5 * diameter
    if not 0 < diameter < clear <= spike_length:
        raise ValueError(
            f"spike_diameter = {diameter} m, spike_clear = {clear} m: it must be thinner than it is long, and no "
            f"longer than spike_length = {spike_length} m"
        )
    slots = slots_of(count)
    if slots < FEWEST_SLOTS:
        raise ValueError(f"spike_count = {count}: rows that share a body must be far apart; 6, 8 or 16 would do")
    inner = row_tips(spike_length - radius, count)
    shaft = max(clear, spike_length - hull_radius + radius) if hull_radius > 0 else clear
    members = []
    for row, at in enumerate(inner):
        up = -at / np.linalg.norm(at)  # along the shaft, towards the centre
        angle = math.atan2(up[0], up[2])
        turn = np.array([math.cos(0.5 * angle), 0.0, math.sin(0.5 * angle), 0.0])
        members.append(Member(row=row, at=at, turn=turn, radius=radius, length=shaft - radius, slot=row % slots))
    if hull_radius > 0:
        half = math.sqrt(0.5)
        members.append(
            Member(
                row=HULL, at=np.zeros(3), turn=np.array([half, half, 0.0, 0.0]), radius=hull_radius,
                length=0.5 * width, below=0.5 * width, slot=slots,
            )
        )  # fmt: skip
    return members


def spatial_members(platform: Platform) -> list[Member]:
    """Each spike of `platform` by itself, where it is, and the ball inside its hull, about its centre of mass.

    A spike is a rod with a ball at its end, as thick as the platform says, that goes on into the hull. Of the hull
    grains meet the largest ball about the centre that fits into it, later than a face or a corner. Raises ValueError
    for a platform without spikes.
    """
    radius = platform.tip_radius
    if radius <= 0:
        raise ValueError(
            f"tip_radius of {platform.name} is 0: grains can touch a platform on spikes with round ends; give it some"
        )
    hull = platform.hull()
    corners = hull.vertices[hull.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    inside = float(np.abs((normals * corners[:, 0]).sum(axis=1)).min())
    members = []
    for row, tip in enumerate(platform.tips):
        reach = float(np.linalg.norm(tip))
        up = -tip / reach
        # The shortest turn from z to `up`.
        half = np.array([1.0 + up[2], -up[1], up[0], 0.0])
        turn = half / np.linalg.norm(half) if up[2] > -1 + 1e-9 else np.array([0.0, 1.0, 0.0, 0.0])
        at = tip * (1 - radius / reach) - platform.centre_of_mass
        length = max(reach - inside, radius)
        members.append(Member(row=row, at=at, turn=turn, radius=radius, length=length, slot=row))
    still = np.array([1.0, 0.0, 0.0, 0.0])
    members.append(Member(row=HULL, at=-platform.centre_of_mass, turn=still, radius=inside, slot=len(members)))
    return members


class BedFooting:
    """`bed` under a body made of `members`.

    Parameters
    ----------
    bed : dem.Bed.
    origin : (x, y) in the bed of the body's x = y = 0 [m].
    copies : how many of each member there are side by side [1].
    touch : force over `copies`, in whatever direction, from which a member counts as touching [N]: a spike in sand may
        be held sideways, or back, where nothing bears it.
    bounded : whether a member that comes down beyond the bed's ends along x is an error; it is periodic there.
    begin : where the bed counts as beginning along x, one period long [m]; the body may start beyond its cell that way.
    bounded_across : likewise along y, where a body in space may go.
    friction, restitution, rolling_friction, young, poisson : of a grain and a member, as `Bed.add_body` has them.

    The members wait far above until `place`. Raises ValueError for more slots than a bed takes.
    """

    name = "bed"
    gives_friction = True

    def __init__(
        self,
        bed: Any,
        members: Sequence[Member],
        *,
        origin: tuple[float, float],
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
        self.bed, self.members, self.copies, self.touch, self.bounded = bed, list(members), copies, touch, bounded
        self._begin, self._bounded_across = begin, bounded_across
        self.origin = np.array([origin[0], origin[1], float(bed.surface)])
        """Where the body's (0, 0, 0) is in the bed [m], shape (3,)."""
        self._slots = [
            [index for index, member in enumerate(self.members) if member.slot == slot]
            for slot in sorted({member.slot for member in self.members})
        ]
        self.bodies = [
            bed.add_body(
                self.members[indices[0]].shapes(), position=(*origin, float(bed.surface) + AWAY), friction=friction,
                restitution=restitution, rolling_friction=rolling_friction, young=young, poisson=poisson,
            )
            for indices in self._slots
        ]  # fmt: skip
        self._used = [indices[0] for indices in self._slots]
        """The member that each body stood for in the last step."""
        self._at = np.array([member.at for member in self.members])
        self._turns = np.array([member.turn for member in self.members])
        self._mass = float(bed.grains()["mass"].sum())
        self.impulse = np.zeros(3)
        """Of gravity and floor on the grains since the start [N s]."""
        self.drag_time = math.inf
        """Of a drag that calms the grains before time begins (`Bed.advance`) [s]; it is in no book."""
        self.grain_steps = 0
        """Grains computed since the start, summed over the bed's steps (fewer where grains sleep)."""

    @property
    def time_step(self) -> float:
        """The bed's own [s]."""
        return float(self.bed.time_step)

    @property
    def lag(self) -> float:
        """The bed's step (see `Footing.lag`) [s]."""
        return float(self.bed.time_step)

    @property
    def gravity(self) -> float:
        """Of the grains [m/s2]."""
        return math.hypot(*self.bed.gravity)

    def set_gravity(self, gravity: float) -> None:
        """See `dem.Bed.set_gravity`; those asleep wake for good."""
        self.bed.set_gravity(gravity)

    @property
    def grain(self) -> float:
        """Mean diameter of the grains [m]."""
        return 2 * float(np.mean(self.bed.grains()["radius"]))

    def grain_speed(self) -> float:
        """Root of the mean square of the grains' speeds, by mass [m/s]."""
        grains = self.bed.grains(contacts=False)
        return math.sqrt(float(grains["mass"] @ (grains["velocity"] ** 2).sum(axis=1)) / self._mass)

    # Where it may start --------------------------------------------------------------------------------------------

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
        return high + 0.02 * float(grains["radius"].mean())

    def check_start(self, pose: Pose) -> None:
        """Raise ValueError for a pose in overlap with grains, with the height that would do."""
        overlap, row = self._deepest_overlap(self.bed.grains(), pose)
        if overlap > 0:
            what = "the hull" if row == HULL else f"spike {row}"
            higher = self.clear_height(pose)
            raise ValueError(
                f"the body, its centre at a height of {pose.position[2]:.6g} m, starts in overlap with a grain: {what} "
                f"by {overlap:.3g} m; {higher:.6g} m higher would do"
            )

    def _deepest_overlap(self, grains: Mapping[str, Any], pose: Pose, lift: float = 0.0) -> tuple[float, int]:
        """Largest overlap of a member and a grain [m], and the member's row."""
        worst = (-math.inf, HULL)
        raised = grains["position"] - np.array([0.0, 0.0, lift])
        for index in self._lowest(to_matrix(pose.turn)):
            member = self.members[index]
            distance = self._surface_of(member, Pose(*self._member_pose(member, pose)), raised)[0]
            worst = max(worst, (float((grains["radius"] - distance).max()), member.row))
        return worst

    # The step ------------------------------------------------------------------------------------------------------

    def step(self, pose: Pose, twist: Twist, dt: float) -> FootReaction:
        """See `Footing.step`. Raises LeftTheBedError, and what the bed raises."""
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
        wrench = Wrench(forces.sum(axis=0), (torques + np.cross(arms, forces)).sum(axis=0))
        halfway = pose.position + 0.5 * dt * twist.velocity
        ends = pose.position + dt * twist.velocity + at @ last.T
        contacts: dict[int, Contact] = {}
        sinkage: dict[int, float] = {}
        for k, index in enumerate(used):
            member, force = self.members[index], forces[k]
            lowest = float(ends[k, 2]) - member.radius
            if lowest < 0 and member.row != HULL:
                sinkage[member.row] = -lowest
            if np.linalg.norm(force) > self.touch * self.copies:
                point = halfway + arms[k] - np.array([0.0, 0.0, member.radius])
                along = np.array([force[0], force[1], 0.0])
                contacts[member.row] = Contact(point, float(force[2]), tangential_force=along)
                self._check_inside(member, ends[k], lowest)
        floor = rows[0, :3] if self.bodies[0] > 0 else np.zeros(3)
        self.impulse = self.impulse + dt * (self._mass * np.array(self.bed.gravity, dtype=float) - floor)
        return FootReaction(wrench, contacts, sinkage)

    def _check_inside(self, member: Member, end: Vector, lowest: float) -> None:
        what = "the hull" if member.row == HULL else f"spike {member.row}"
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
        if member.row != HULL and lowest + self.origin[2] < member.radius:
            raise LeftTheBedError(
                f"{what} sank {-lowest:.3g} m, to within its radius of the floor: the bed is {self.origin[2]:.3g} m "
                "deep"
            )

    def _lowest(self, matrix: Vector) -> list[int]:
        """The member that each slot stands for, its lowest, with the body turned by this matrix."""
        heights = (self._at @ matrix[2]).tolist()
        return [min(indices, key=heights.__getitem__) for indices in self._slots]

    def _member_pose(self, member: Member, pose: Pose) -> tuple[Vector, NDArray[np.float64]]:
        position = self.origin + pose.position + to_matrix(pose.turn) @ member.at
        return position, multiply(pose.turn, member.turn)

    # What it holds -------------------------------------------------------------------------------------------------

    def energies(self) -> dict[str, float]:
        """Of the grains, `copies` times [J] (`dem.energy.bed_energies`)."""
        from dem.energy import bed_energies

        found = bed_energies(self.bed, bodies=self._surfaces())
        return {name: self.copies * value for name, value in found.items()}

    def keep_book(self) -> None:
        """See `Bed.keep_book`."""
        self.bed.keep_book()

    def work_taken(self) -> dict[str, float]:
        """`Bed.work_taken`, `copies` times [J]."""
        return {name: self.copies * value for name, value in self.bed.work_taken.items()}

    def pushes(self) -> tuple[Vector, Vector]:
        """Where grains touch the members now [m], and the normal springs' forces on them [N], shape [n, 3] both.

        In the body's world (z from the surface); of one of the `copies`, without damping and friction.
        """
        from dem.energy import body_pushes

        points, forces = body_pushes(self.bed, bodies=self._surfaces())
        return points - self.origin, forces

    def _surfaces(self) -> dict[int, Any]:
        """Each DEM body's surface, as `dem.energy` wants it."""
        return {
            body: partial(self._surface_of, self.members[index], pose)
            for body, index, pose in zip(self.bodies, self._used, self._posed(), strict=True)
        }

    def _posed(self) -> list[Pose]:
        """Where the bed has its bodies now."""
        return [Pose(self.bed.body_position(body), self.bed.body_turn(body)) for body in self.bodies]

    def _surface_of(self, member: Member, pose: Pose, points: Vector) -> tuple[Vector, Vector, Vector]:
        """Distance of points to a member placed there, outward normal, curvature: round where a rod has a ball.

        As `dem.shapes` has it for a point outside: a rod's other end is flat. Points within count from its side.
        """
        matrix = to_matrix(pose.turn)
        local = self._nearest_image(points - pose.position) @ matrix
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

    def _nearest_image(self, away: Vector) -> Vector:
        size = np.array(self.bed.size, dtype=float)[:2]
        away[:, :2] -= size * np.round(away[:, :2] / size)
        return away

    def momentum(self) -> Vector:
        """Momentum of the grains less the impulse of gravity and floor on them, `copies` times [N s], shape (3,).

        With the velocities half a step ahead of the positions, which the impulses so far have made: what changes it is
        the body, to round-off.
        """
        return np.asarray(self.copies * (self.bed.momentum() - self.impulse))

    def angular_momentum(self) -> Vector:
        """Of the grains about the body's (0, 0, 0), less what they got from elsewhere than the body, `copies` times.

        [N m s], shape (3,), as `momentum` has the velocities; since `keep_book`. What changes it is the body, to
        round-off: weight, floor, what goes across the periodic sides and sleepers are told apart (`dem.ledger`).
        """
        found = self.bed.angular_momentum()
        others = found["outside"]
        if self.bodies[0] > 0:  # the floor is the first
            others = others - found["first_body"]
        about_bed = found["grains"] - others
        return np.asarray(self.copies * about_bed - np.cross(self.origin, self.momentum()))

    def hold(self) -> Any:
        """See `Footing.hold`: the bed's where it lies, on a GPU without its leaving it."""
        return self.bed.hold(), self.impulse.copy(), list(self._used), self.grain_steps

    def take_back(self, held: Any) -> None:
        """Go back to what `hold` gave last. Raises ValueError for another."""
        bed, impulse, used, self.grain_steps = held
        self.bed.take_back(bed)
        self.impulse, self._used = impulse.copy(), list(used)

    def state(self) -> dict[str, Any]:
        """The bed's, which contains the bodies and their contacts."""
        return {f"bed.{key}": value for key, value in self.bed.state().items()} | {
            "impulse": self.impulse.copy(),
            "used": np.array(self._used),
            "grain_steps": np.array(self.grain_steps),
        }

    def restore(self, state: Mapping[str, ArrayLike]) -> None:
        """Go back to what `state` gave."""
        self.bed.restore({key[4:]: np.asarray(value) for key, value in state.items() if key.startswith("bed.")})
        self.impulse = np.array(state["impulse"], dtype=float)
        self._used = [int(index) for index in np.asarray(state["used"])]
        self.grain_steps = int(np.asarray(state["grain_steps"]))


def _left(turn: Vector) -> Vector:
    """The product with a quaternion on its right as a matrix, shape (4, 4): multiply(turn, q) = matrix @ q."""
    return np.column_stack([multiply(turn, unit) for unit in np.eye(4)])
