"""A surface law under each member of a body: `LawGround`. Heights are counted from the undisturbed surface."""

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from hedgebed_renamed import renamed
from rigid.ground.grounds import SpringDamper, SurfaceGround
from rigid.ground.reaction import Contact, Reaction, State, Turned
from rigid.model.trial import Trial
from rigid.spatial.spatial import SpatialTrial

from .ground import part_of, prefixed
from .poses import Pose, Twist, Vector, chord_share, matrices

__all__ = ["LawGround", "LawPoints", "row_tips"]


def row_tips(length: float, count: int) -> Vector:
    """Ends of `count` rows of spikes of `length` [m] in body axes, shape [count, 3], the planar model's numbers."""
    angles = math.pi / count + 2 * math.pi / count * np.arange(count)
    return np.column_stack([-length * np.sin(angles), np.zeros(count), -length * np.cos(angles)])


class LawPoints:
    """What grounds of one law for each point share: the energy in them, and the state that a run goes back to."""

    _depths: Vector  # Of the points [m], -inf far above

    def _laws(self) -> Mapping[str, SpringDamper | SurfaceGround]:
        """The law under each point, in the order of `_depths`: its name in a kept state -> itself."""
        raise NotImplementedError

    def energies(self) -> dict[str, float]:
        """In the springs under the points [J]."""
        laws = self._laws().values()
        held = [law.stored(depth) for law, depth in zip(laws, self._depths, strict=True) if depth > 0]
        return {"springs": float(sum(held))}

    def checkpoint(self) -> State:
        """The state that `rollback` goes back to."""
        return self.state()

    def rollback(self, kept: State) -> None:
        """Go back to what `checkpoint` gave."""
        self.restore(kept)

    def state(self) -> State:
        """Depths of the points, and what the laws remember."""
        kept: State = {"depths": self._depths.copy()}
        for name, law in self._laws().items():
            kept |= prefixed(name, law.state())
        return kept

    def restore(self, state: State) -> None:
        """Go back to what `state` gave."""
        self._depths = np.array(state["depths"], dtype=float)
        for name, law in self._laws().items():
            law.restore(part_of(state, name))


class LawGround(LawPoints):
    """A surface law under each row of spikes, its friction as a Coulomb bound that the body resolves.

    Parameters
    ----------
    tips : ends of the rows in body axes [m], shape [row, 3]; a row touches at this point.
    grounds : one for each row, as laws with a memory remember each their own depth; their surface at 0.

    Raises ValueError where there is not one ground a row.
    """

    lag = 0.0
    gives_friction = False
    hold, take_back = renamed("hold", "checkpoint"), renamed("take_back", "rollback")
    surface, centre, clearance, depth_limit = 0.0, (0.0, 0.0), 0.0, math.inf

    def __init__(self, tips: ArrayLike, grounds: Sequence[SpringDamper | SurfaceGround]) -> None:
        self.tips = np.array(tips, dtype=float)
        if len(grounds) != len(self.tips):
            raise ValueError(f"grounds has {len(grounds)} entries: there are {len(self.tips)} rows of spikes")
        self.grounds = list(grounds)
        self._depths = np.full(len(self.tips), -math.inf)

    def __repr__(self) -> str:
        return f"LawGround({self.name}, {len(self.tips)} members, driven at {self.time_step:g} s)"

    @classmethod
    def of_trial(cls, trial: Trial) -> "LawGround":
        """The spring-damper of a planar trial under each of its rows. Raises ValueError for another law."""
        if trial.ground is not None:
            raise ValueError(f"ground = {trial.ground.name!r}: the master takes the spring-damper of a trial")
        grounds = [
            SpringDamper(stiffness=trial.stiffness, damping=trial.damping, mu_s=trial.mu_s, mu_d=trial.sliding_friction)
            for _ in range(trial.spike_count)
        ]
        return cls(row_tips(trial.spike_length, trial.spike_count), grounds)

    @classmethod
    def of_spatial(cls, trial: SpatialTrial) -> "LawGround":
        """The surface law of a trial in space under each tip of its platform, about the centre of mass."""
        grounds = [
            SurfaceGround(
                law=trial.ground, parameters=trial.ground_parameters, mu_s=trial.mu_s, mu_d=trial.sliding_friction
            )
            for _ in trial.platform.tips
        ]
        return cls(trial.platform.tips - trial.platform.centre_of_mass, grounds)

    @property
    def name(self) -> str:
        """Name of the surface law."""
        return self.grounds[0].name

    @property
    def time_step(self) -> float:
        """As the law's ground has it [s]."""
        return self.grounds[0].time_step

    def place(self, pose: Pose) -> None:
        """A body at rest at `pose` is put on it: how deep each row is from the first, so that its springs count."""
        still = Twist(np.zeros(3), np.zeros(3))
        ends = pose.position + self.tips @ matrices(pose, still, self.time_step)[0].T
        self._depths = -ends[:, 2]
        for row in np.flatnonzero(self._depths > 0):  # a law with a memory keeps it as its deepest
            self.grounds[row].step(ends[row], still.velocity, self.time_step)

    def clear_height(self, pose: Pose) -> float:
        """Height by which a body must be lifted from `pose` to start there [m]: 0, as it may start at any depth."""
        return 0.0

    def step(
        self, position: ArrayLike, velocity: ArrayLike, dt: float, turn: Turned = None, spin: Turned = None
    ) -> Reaction:
        """See `Ground.step`: each tip goes along its chord, and its law is exact over that path."""
        pose, twist = Pose.of(position, turn), Twist.of(velocity, spin)
        first, middle, last = matrices(pose, twist, dt)
        starts = pose.position + self.tips @ first.T
        ends = pose.position + twist.velocity * dt + self.tips @ last.T
        arms = chord_share(twist, dt) * (self.tips @ middle.T)
        at = pose.position + 0.5 * dt * twist.velocity
        force, torque = np.zeros(3), np.zeros(3)
        contacts: list[Contact] = []
        for row in np.flatnonzero((np.minimum(starts[:, 2], ends[:, 2]) < 0) | (self._depths > 0)):
            reaction = self.grounds[row].step(starts[row], (ends[row] - starts[row]) / dt, dt)
            if not reaction.contacts:
                continue
            given = reaction.contacts[0]
            contacts.append(
                Contact(at + arms[row], given.normal_force, mu_s=given.mu_s, mu_d=given.mu_d, member=int(row))
            )
            force += reaction.force
            torque += np.cross(arms[row], reaction.force)
        self._depths = -ends[:, 2]
        sinkage = {int(row): float(self._depths[row]) for row in np.flatnonzero(self._depths > 0)}
        return Reaction(force, torque, tuple(contacts), sinkage)

    def _laws(self) -> dict[str, SpringDamper | SurfaceGround]:
        return {str(row): ground for row, ground in enumerate(self.grounds)}
