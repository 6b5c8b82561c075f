"""A bed of grains under the feet of a robot, each a DEM body of its own, so that its force is known: `BedFeet`."""

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from coupling.bed_ground import AWAY, BedGround, LeftTheBedError
from coupling.poses import Pose, Vector
from rigid.ground.reaction import Contact, Reaction, Turned
from rigid.spatial.quaternions import from_turn, multiply, to_matrix

from .distances import distances
from .feet import Foot

__all__ = ["BedFeet"]

Surface = Callable[[Vector], tuple[Vector, Vector, Vector]]
"""Points in the bed [m] -> distance [m], outward normal and curvature [1/m] (`distances`)."""
MOST_LIFT = 0.5  # A start deeper than this in the bed is refused without a sufficient height [m]


class BedFeet(BedGround):
    """`bed` under the `feet` of a robot.

    Parameters
    ----------
    bed : dem.Bed (or whatever has its interface).
    feet : those of the robot.
    origin : (x, y) in the bed of the robot's x = y = 0 [m]; its z = 0 is the surface.
    touch : force from which a foot counts as touching [N].
    bounded : whether a foot that comes down beyond the bed's sides is an error; the bed is periodic there.
    friction, restitution, rolling_friction, young, poisson : of a grain and a foot, as `Bed.add_body` has them.

    Raises ValueError for a foot that grains cannot touch (a site), and for more feet or shapes than a bed takes.
    """

    repeatable = True
    """Whether its steps can be taken back, for an iterated exchange."""

    def __init__(
        self,
        bed: Any,
        feet: Sequence[Foot],
        *,
        origin: tuple[float, float] = (0.0, 0.0),
        touch: float = 0.0,
        bounded: bool = True,
        friction: float | None = None,
        restitution: float | None = None,
        rolling_friction: float | None = None,
        young: float | None = None,
        poisson: float = 0.3,
    ) -> None:
        self.bed, self.feet, self.touch, self.bounded, self.copies = bed, list(feet), touch, bounded, 1.0
        for foot in feet:
            if not foot.shapes:
                raise ValueError(f"feet: {foot.name!r} is a site, a mere point, which grains do not touch: name a geom")
        self.spike = None
        self._height = float(bed.surface)
        self.origin = np.array([*origin, self._height])
        self.surface, self.centre, self.clearance = 0.0, (0.0, 0.0), 0.0
        grains = bed.grains(contacts=False)
        self._mass, self._grain = float(grains.mass.sum()), 2 * float(np.mean(grains.radius))
        self.bodies = [
            bed.add_body(
                foot.shapes, position=(*origin, self._height + AWAY), friction=friction, restitution=restitution,
                rolling_friction=rolling_friction, young=young, poisson=poisson,
            )
            for foot in feet
        ]  # fmt: skip
        self.members = []
        self._used = list(range(len(self.feet)))
        self.impulse = np.zeros(3)
        self.drag_time = math.inf
        self.grain_steps = 0

    def __repr__(self) -> str:
        names = ", ".join(foot.name for foot in self.feet)
        return f"BedFeet({self.bed.grain_count} grains under {names}, step {self.time_step:.3g} s)"

    def _put(self, pose: Pose, velocities: Vector, spins: Vector) -> tuple[Vector, Vector]:
        """Give the bed's bodies these poses and motions; positions and turns of the feet."""
        places, turns = pose.position.reshape(-1, 3), pose.turn.reshape(-1, 4)
        self.bed.move_bodies(
            self.bodies, positions=self.origin + places, velocities=velocities, turns=turns, spins=spins
        )
        return places, turns

    def step(
        self, position: ArrayLike, velocity: ArrayLike, dt: float, turn: Turned = None, spin: Turned = None
    ) -> Reaction:
        """See `BedGround.step`, of all feet.

        Positions, velocities and spins have shape (3 foot,), turns (4 foot,), forces and torques (3 foot,).
        """
        steps = round(dt / self.time_step)
        if steps < 1 or not math.isclose(steps * self.time_step, dt, rel_tol=1e-9):
            raise ValueError(f"dt is {dt} s: it must be a whole multiple of the bed's step, {self.time_step} s")
        velocities, spins = np.reshape(velocity, (-1, 3)), np.reshape(np.asarray(spin), (-1, 3))
        places, turns = self._put(Pose.of(position, turn), velocities, spins)
        before = self.bed.grain_steps
        self.bed.advance(steps, drag_time=self.drag_time)
        self.grain_steps += self.bed.grain_steps - before
        every = self.bed.reactions()
        rows = every[self.bodies]
        contacts: list[Contact] = []
        sinkage: dict[int, float] = {}
        for k, foot in enumerate(self.feet):
            end = places[k] + dt * velocities[k]
            if end[2] > foot.reach and not rows[k].any():
                continue
            low = foot.bottom(to_matrix(multiply(from_turn(dt * spins[k]), turns[k])))
            if end[2] + low < 0:
                sinkage[k] = -float(end[2] + low)
            force = rows[k, :3]
            if np.linalg.norm(force) > self.touch:
                point = places[k] + 0.5 * dt * velocities[k] + np.array([0.0, 0.0, low])
                along = np.array([force[0], force[1], 0.0])
                contacts.append(Contact(point, float(force[2]), tangential_force=along, member=k))
                self._check_foot(foot, end, end[2] + low)
        floor = every[0, :3] if self.bodies[0] > 0 else np.zeros(3)
        self.impulse = self.impulse + dt * (self._mass * np.array(self.bed.gravity, dtype=float) - floor)
        return Reaction(rows[:, :3].ravel(), rows[:, 3:].ravel(), tuple(contacts), sinkage)

    def _check_foot(self, foot: Foot, end: Vector, lowest: float) -> None:
        """Raise LeftTheBedError where the middle of a foot in the sand is beyond the bed, or the foot at its floor."""
        for axis in range(2):
            at, length = self.origin[axis] + float(end[axis]), float(self.bed.size[axis])
            if self.bounded and not 0 <= at <= length:
                off = at - length if at > length else -at
                raise LeftTheBedError(
                    f"foot {foot.name!r} came down {off:.3g} m beyond the bed along {'xy'[axis]}, where it is "
                    f"{length:g} m long",
                    lacking=off + foot.reach,
                )
        if lowest + self._height < self._grain:
            raise LeftTheBedError(
                f"foot {foot.name!r} sank {-lowest:.3g} m, to within a grain of the floor: the bed is "
                f"{self._height:.3g} m deep"
            )

    def place(self, pose: Pose) -> None:
        """The robot is to start with its feet at `pose`. Raises ValueError, naming the foot, for one among grains."""
        overlap, worst = self._overlap(pose, 0.0)
        if overlap > 0:
            low, high = 0.0, MOST_LIFT
            if self._overlap(pose, high)[0] > 0:
                above = f"more than {high:g} m higher"
            else:
                for _ in range(40):
                    middle = 0.5 * (low + high)
                    low, high = (middle, high) if self._overlap(pose, middle)[0] > 0 else (low, middle)
                above = f"{1e3 * (high + 0.005 * self._grain):.4g} mm higher"
            raise ValueError(
                f"feet: {worst.name!r} starts in the sand, {1e3 * overlap:.3g} mm into a grain: raise the robot "
                f"(height) to start {above}"
            )

    def clear_height(self, pose: Pose, *, most: float = MOST_LIFT) -> float:
        """0: a robot is never moved from where it is to start."""
        return 0.0

    def _overlap(self, pose: Pose, lift: float) -> tuple[float, Foot]:
        """Largest overlap of a foot and a grain with the feet `lift` [m] above `pose` [m], and the foot."""
        grains = self.bed.grains(contacts=False)
        still = np.zeros((len(self.feet), 3))
        raised = Pose(pose.position + np.tile([0.0, 0.0, lift], len(self.feet)), pose.turn)
        self._put(raised, still, still)
        found = [(float((grains.radius - surface(grains.position)[0]).max()), body) for body, surface in self._pieces()]
        overlap, body = max(found)
        self._put(pose, still, still)
        return overlap, self.feet[self.bodies.index(body)]

    def _pieces(self) -> list[tuple[int, Surface]]:
        """Bodies and their surfaces where the feet are now, in the order of `feet`."""
        return [(body, partial(distances, self.bed, body)) for body in self.bodies]

    def _surfaces(self) -> dict[int, Surface]:
        return dict(self._pieces())
