"""What a whole body stands on: a ground that answers a pose and a twist with the contacts of each of its spikes.

`coupling.ground.Ground` sees one point that goes straight; a `Footing` sees a body that turns. Two are here and in
`coupling.bed_footing`: any surface law under every tip, and a bed of grains. Heights are counted from the undisturbed
surface, so that one body may be put on either.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from rigid.grounds import SpringDamper, SurfaceGround
from rigid.reaction import Contact
from rigid.spatial import SpatialTrial
from rigid.trial import Trial

from .poses import Pose, Twist, Vector, Wrench, chord_share, matrices

__all__ = ["FootReaction", "Footing", "LawFooting", "row_tips"]


@dataclass(frozen=True, slots=True)
class FootReaction:
    """What a footing did to the body during one step, means over it."""

    wrench: Wrench
    """About the body's origin, without what Coulomb bounds leave open."""
    contacts: Mapping[int, Contact] = field(default_factory=dict)
    """Row of spikes -> its contact, those that touch; -1 is the hull. The point is that of the step's middle."""
    sinkage: Mapping[int, float] = field(default_factory=dict)
    """Row -> depth of its lowest point at the step's end [m], for those near the surface."""


@runtime_checkable
class Footing(Protocol):
    """Whatever a body can stand on."""

    @property
    def name(self) -> str:
        """What a report calls it."""

    @property
    def time_step(self) -> float:
        """The step it wants to be driven at [s]; where it is its own, dt of `step` is a whole multiple."""

    @property
    def gives_friction(self) -> bool:
        """Whether its contacts say what the horizontal force is; otherwise a Coulomb bound, which the body resolves."""

    @property
    def lag(self) -> float:
        """By how much its forces stand for a time later than the mean of the step's [s], twice over.

        0 where the mean is exact. A bed's impulse over a step is that of the forces at the *ends* of its own steps dt,
        so it belongs to a time dt / 2 later: its lag is dt.
        """

    def step(self, pose: Pose, twist: Twist, dt: float) -> FootReaction:
        """Advance by `dt` [s] under a body that starts at `pose` and keeps `twist`."""

    def energies(self) -> dict[str, float]:
        """What it holds now [J]: name -> energy."""

    def hold(self) -> Any:
        """What `take_back` brings back, of a step that may be repeated: the last that was held, and no other."""

    def take_back(self, held: Any) -> None:
        """Go back to what `hold` gave last."""

    def state(self) -> dict[str, Any]:
        """Everything that the next steps depend on: a flat dict of numpy arrays."""

    def restore(self, state: dict[str, Any]) -> None:
        """Go back to what `state` gave."""


def row_tips(length: float, count: int) -> Vector:
    """Ends of `count` rows of spikes of `length` [m] in body axes, shape [count, 3], the planar model's numbers."""
    angles = math.pi / count + 2 * math.pi / count * np.arange(count)
    return np.column_stack([-length * np.sin(angles), np.zeros(count), -length * np.cos(angles)])


class LawFooting:
    """A surface law under each row of spikes, its friction as a Coulomb bound that the body resolves.

    Parameters
    ----------
    tips : ends of the rows in body axes [m], shape [row, 3]; a row touches at this point.
    grounds : one for each row, as laws with a memory remember each their own depth; their surface at 0.

    Raises ValueError where there is not one ground a row.
    """

    lag = 0.0
    gives_friction = False

    def __init__(self, tips: ArrayLike, grounds: Sequence[SpringDamper | SurfaceGround]) -> None:
        self.tips = np.array(tips, dtype=float)
        if len(grounds) != len(self.tips):
            raise ValueError(f"grounds has {len(grounds)} entries: there are {len(self.tips)} rows of spikes")
        self.grounds = list(grounds)
        self._depths = np.full(len(self.tips), -math.inf)

    @classmethod
    def of_trial(cls, trial: Trial) -> LawFooting:
        """The spring-damper of a planar trial under each of its rows. Raises ValueError for another law."""
        if trial.ground is not None:
            raise ValueError(f"ground = {trial.ground.name!r}: the master takes the spring-damper of a trial")
        grounds = [
            SpringDamper(stiffness=trial.stiffness, damping=trial.damping, mu_s=trial.mu_s, mu_d=trial.sliding_friction)
            for _ in range(trial.spike_count)
        ]
        return cls(row_tips(trial.spike_length, trial.spike_count), grounds)

    @classmethod
    def of_spatial(cls, trial: SpatialTrial) -> LawFooting:
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
        """The law's."""
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

    def step(self, pose: Pose, twist: Twist, dt: float) -> FootReaction:
        """See `Footing.step`: each tip goes along its chord, and its law is exact over that path."""
        first, middle, last = matrices(pose, twist, dt)
        starts = pose.position + self.tips @ first.T
        ends = pose.position + twist.velocity * dt + self.tips @ last.T
        arms = chord_share(twist, dt) * (self.tips @ middle.T)
        at = pose.position + 0.5 * dt * twist.velocity
        force, torque = np.zeros(3), np.zeros(3)
        contacts: dict[int, Contact] = {}
        for row in np.flatnonzero((np.minimum(starts[:, 2], ends[:, 2]) < 0) | (self._depths > 0)):
            reaction = self.grounds[row].step(starts[row], (ends[row] - starts[row]) / dt, dt)
            if not reaction.contacts:
                continue
            given = reaction.contacts[0]
            contacts[int(row)] = Contact(at + arms[row], given.normal_force, mu_s=given.mu_s, mu_d=given.mu_d)
            force += reaction.force
            torque += np.cross(arms[row], reaction.force)
        self._depths = -ends[:, 2]
        sinkage = {int(row): float(self._depths[row]) for row in np.flatnonzero(self._depths > 0)}
        return FootReaction(Wrench(force, torque), contacts, sinkage)

    def energies(self) -> dict[str, float]:
        """In the springs under the tips [J]."""
        held = [ground.stored(depth) for ground, depth in zip(self.grounds, self._depths, strict=True) if depth > 0]
        return {"springs": float(sum(held))}

    def hold(self) -> Any:
        """See `Footing.hold`."""
        return self.state()

    def take_back(self, held: Any) -> None:
        """Go back to what `hold` gave."""
        self.restore(held)

    def state(self) -> dict[str, Any]:
        """Depths of the tips, and what the laws remember."""
        kept: dict[str, Any] = {"depths": self._depths.copy()}
        for row, ground in enumerate(self.grounds):
            kept |= {f"{row}.{key}": value for key, value in ground.state().items()}
        return kept

    def restore(self, state: dict[str, Any]) -> None:
        """Go back to what `state` gave."""
        self._depths = np.array(state["depths"], dtype=float)
        for row, ground in enumerate(self.grounds):
            prefix = f"{row}."
            own = {key[len(prefix) :]: value for key, value in state.items() if key.startswith(prefix)}
            ground.restore(own)
