"""A platform in space on any ground: placed or let fall, driven by its wheels, followed with its energy balance.

A stepper as `coupling.CoupledTumble`, whose platform is planar.
"""

from collections.abc import Sequence
from typing import Any, Unpack

import numpy as np

from hedgebed_renamed import renamed_keywords
from rigid.ground.reaction import Reaction, State
from rigid.planar.trajectory import Transition
from rigid.spatial.quaternions import angle_between, to_matrix
from rigid.spatial.spatial import SpatialTrial

from .contact_state import changes_of, state_of
from .ground import Ground
from .platform_run import PlatformRun
from .poses import Twist, Vector, Wrench
from .spatial_body import SpatialBody
from .stepper import Reporting

__all__ = ["SpatialRun"]

COLUMNS = (
    "time", "x", "y", "z", "q0", "q1", "q2", "q3", "vx", "vy", "vz", "wx", "wy", "wz", "wheel_x", "wheel_y", "wheel_z",
    "kinetic_energy", "potential_energy", "torque_work", "given", "taken", "fx", "fy", "fz", "touching", "sinkage",
)  # fmt: skip
"""Of a row: centre of mass [m], quaternion, velocity [m/s] and spin [rad/s] in world axes; absolute speeds of the
wheels about the platform's x, y and z [rad/s]; energies and works [J] as in the planar rows; the ground's force [N];
number of touching members; the deepest spike's depth [m]."""
FEET = 6  # Numbers of a spike (`contact_state.feet_of`); of those that have none a step keeps nothing


class SpatialRun(PlatformRun):
    """The platform of `trial` on `ground`, followed for `duration` [s] from where its torques begin.

    Parameters
    ----------
    position : of the centre of mass at the start [m], z from the undisturbed surface; None: level above (0, 0), its
        lowest tips at the surface, on a bed lifted until it is clear of the grains.
    quaternion, velocity, angular_velocity : as `SpatialBody` has them; a platform that is placed starts at rest.
    lowering_speed : of a placement before time begins [m/s]; None: none.
    energy_interval : between measurements of what the ground holds [s].
    options : those of `Master`.

    Raises ValueError for a start in overlap with grains, and for what `Master` and `SpatialBody` refuse.
    """

    COLUMNS, _prefix, _hull = COLUMNS, "run", 1
    trial: SpatialTrial

    @renamed_keywords(footing="ground")
    def __init__(
        self,
        trial: SpatialTrial,
        ground: Ground,
        *,
        duration: float,
        position: Sequence[float] | None = None,
        quaternion: Sequence[float] = (1.0, 0.0, 0.0, 0.0),
        velocity: Sequence[float] = (0.0, 0.0, 0.0),
        angular_velocity: Sequence[float] = (0.0, 0.0, 0.0),
        lowering_speed: float | None = None,
        energy_interval: float = 0.02,
        **options: Any,
    ) -> None:
        if lowering_speed is not None:
            if np.any(velocity) or np.any(angular_velocity):
                raise ValueError("lowering_speed is given with a velocity: a platform that is placed starts at rest")
            if not trial.weight[2] < 0:
                raise ValueError(f"gravity = {trial.gravity} does not pull onto the ground: nothing is set down there")
        tips = trial.platform.tips - trial.platform.centre_of_mass
        lowest = float((tips @ to_matrix(quaternion)[2]).min())
        body = SpatialBody(
            trial, position=(0.0, 0.0, -lowest) if position is None else position, quaternion=quaternion,
            velocity=velocity, angular_velocity=angular_velocity,
        )  # fmt: skip
        self._places = np.vstack([tips, -trial.platform.centre_of_mass])  # the hull last
        super().__init__(
            trial, ground, body, duration=duration, lift=position is None, weight=np.asarray(trial.weight),
            members=self._places, lowering_speed=lowering_speed, energy_interval=energy_interval,
            first_guess=Wrench.none(), **options,
        )  # fmt: skip
        if self.placed:
            self.body.start(ground.lag)
            self._begin()
        else:
            self._start_placement()

    def run(self, **reporting: Unpack[Reporting]) -> dict[str, Vector]:
        """Go on to the end, with the reports of `Stepper.follow`; `columns`."""
        self.follow(**reporting)
        return self.columns

    def _out_of_balance(self) -> tuple[Vector, Vector]:
        wrench, twist, reach = self.master.wrench, self.body.twist, self.trial.platform.reach
        missing = np.concatenate([wrench.force + self.trial.weight, wrench.torque / reach])
        return missing, np.concatenate([twist.velocity, twist.spin * reach])

    def _row(self, reaction: Reaction | None, now: Twist) -> list[float]:
        body = self.body
        touching = len(reaction.contacts) if reaction is not None else 0
        deepest = max(reaction.sinkage.values(), default=0.0) if reaction is not None else 0.0
        return [
            body.time, *body.place, *body.turn, *now.velocity, *now.spin, *(body.axes.T @ body.wheel_speed),
            body.kinetic_energy(self.ground.lag), body.potential_energy, body.torque_work, *self.master.exchanged(),
            *self.master.wrench.force, touching, deepest,
        ]  # fmt: skip

    def _keep_feet(self, feet: Vector) -> None:
        there = np.flatnonzero(feet.any(axis=0))
        self._feet.append(np.column_stack([np.full(len(there), len(self._rows) - 1.0), there, feet[:, there].T]))

    def _state_now(self, feet: Vector) -> str:
        if self.ground.gives_friction:
            return self.reader.see(feet[0], feet[1:3], feet[3:5])
        places, body = self._places, self.body
        sliding = np.isin(np.arange(len(places)), list(body.sliding))
        touching = sliding | np.isin(np.arange(len(places)), list(body.sticking))
        return state_of(touching, sliding, places)

    @property
    def _turning(self) -> Vector:
        return np.asarray(np.cross(self.body.place, self.body.momentum) + self.body.angular_momentum)

    @property
    def feet(self) -> Vector:
        """What each spike feels at every row (`contact_state.feet_of`), the hull as the last; shape [step, 6, spike].

        Friction is 0 where a surface law says only how large it may be.
        """
        dense = np.zeros((len(self._rows), FEET, len(self._places)))
        kept = self._feet_table
        dense[kept[:, 0].astype(int), :, kept[:, 1].astype(int)] = kept[:, 2:]
        return dense

    @property
    def _feet_table(self) -> Vector:
        return np.concatenate([np.zeros((0, 2 + FEET)), *self._feet])

    @property
    def turned(self) -> Vector:
        """Angle of the one turn from the start, at every row [rad], at most pi."""
        rows = self.columns
        turns = np.column_stack([rows[f"q{k}"] for k in range(4)])
        return angle_between(turns, turns[:1])

    @property
    def transitions(self) -> tuple[Transition, ...]:
        """Every change of state: (time [s], state entered, `turned` [rad]); the first is the state at the start."""
        return changes_of(self.columns["time"], self.states, self.turned)

    @property
    def energy_scale(self) -> float:
        """max(|work of the torques|, W reach, the kinetic energy at the start) [J]."""
        rows = self.columns
        lifted = self._weight * self.trial.platform.reach
        return max(float(np.abs(rows["torque_work"]).max()), lifted, float(rows["kinetic_energy"][0]), 1e-300)

    def restore(self, state: State) -> None:
        """Go back to what `state` gave."""
        super().restore(state)
        self._feet = [np.array(state["run.feet"], dtype=float)]
