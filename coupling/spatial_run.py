"""A platform in space on any footing: set down or let fall, driven by its wheels, followed with open books.

A stepper as `coupling.CoupledTumble`, whose platform is planar: `advance` makes one macro step, `state` and `restore`
work between any two, every macro step leaves one row.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from rigid.quaternions import angle_between, to_matrix
from rigid.spatial import SpatialTrial
from rigid.trajectory import STATES, Transition

from .bed_footing import BedFooting
from .contact_state import ContactReader, changes_of, feet_of, state_of
from .followed import Followed
from .footing import Footing, FootReaction, LawFooting
from .lowered_gravity import pace_under
from .master import Master
from .poses import Twist, Vector, Wrench
from .spatial_body import SpatialBody

__all__ = ["SpatialRun"]

COLUMNS = (
    "time", "x", "y", "z", "q0", "q1", "q2", "q3", "vx", "vy", "vz", "wx", "wy", "wz", "wheel_x", "wheel_y", "wheel_z",
    "kinetic_energy", "potential_energy", "torque_work", "given", "taken", "fx", "fy", "fz", "touching", "sinkage",
)  # fmt: skip
"""Of a row: centre of mass [m], quaternion, velocity [m/s] and spin [rad/s] in world axes, absolute speeds of the
wheels about the platform's x, y and z [rad/s], energies and works [J] as the planar rows have them, the footing's force
[N], how many members touch, the deepest spike's depth [m]."""
FEET = 6
"""Numbers of a spike (`contact_state.feet_of`); of those that have none a step keeps nothing."""


class SpatialRun(Followed):
    """The platform of `trial` on `footing`, followed for `duration` [s] from where its torques begin.

    Parameters
    ----------
    position : of the centre of mass at the start [m], z from the undisturbed surface; None: level above (0, 0), its
        lowest tips at the surface, on a bed lifted until it is clear of the grains.
    quaternion, velocity, angular_velocity : as `SpatialBody` has them; a platform in a hand starts at rest.
    lowering_speed : of a hand that sets it down before time begins [m/s]; None: no hand.
    substeps, body_steps, extrapolation, iterations : as `Master` has them.
    energy_interval : between measurements of what the footing holds [s].

    Raises ValueError for a start in overlap with grains, and for what `Master` and `SpatialBody` refuse.
    """

    def __init__(
        self,
        trial: SpatialTrial,
        footing: Footing,
        *,
        duration: float,
        position: Sequence[float] | None = None,
        quaternion: Sequence[float] = (1.0, 0.0, 0.0, 0.0),
        velocity: Sequence[float] = (0.0, 0.0, 0.0),
        angular_velocity: Sequence[float] = (0.0, 0.0, 0.0),
        lowering_speed: float | None = None,
        substeps: int = 10,
        body_steps: int = 1,
        extrapolation: int = 0,
        iterations: int = 1,
        energy_interval: float = 0.02,
    ) -> None:
        for key, value in {"duration": duration, "energy_interval": energy_interval}.items():
            if not (math.isfinite(value) and value > 0):
                raise ValueError(f"{key} is {value}: it must be above 0 (in s)")
        if lowering_speed is not None:
            if not (math.isfinite(lowering_speed) and lowering_speed > 0):
                raise ValueError(f"lowering_speed is {lowering_speed}: it must be above 0 (in m/s)")
            if np.any(velocity) or np.any(angular_velocity):
                raise ValueError("lowering_speed is given with a velocity: a platform in a hand starts at rest")
            if not trial.weight[2] < 0:
                raise ValueError(f"gravity = {trial.gravity} does not pull onto the ground: nothing is set down there")
        self.trial, self.footing, self.duration = trial, footing, float(duration)
        tips = trial.platform.tips - trial.platform.centre_of_mass
        lowest = float((tips @ to_matrix(quaternion)[2]).min())
        self.body = SpatialBody(
            trial, position=(0.0, 0.0, -lowest) if position is None else position, quaternion=quaternion,
            velocity=velocity, angular_velocity=angular_velocity,
        )  # fmt: skip
        if isinstance(footing, BedFooting):
            if position is None:
                self.body.place[2] += footing.clear_height(self.body.pose)
            footing.check_start(self.body.pose)
        elif isinstance(footing, LawFooting):
            footing.place(self.body.pose)
        self.master = Master(
            self.body, footing, substeps=substeps, body_steps=body_steps, extrapolation=extrapolation,
            iterations=iterations, first_guess=Wrench.none(),
        )  # fmt: skip
        self._extrapolation = extrapolation
        self._places = np.vstack([tips, -trial.platform.centre_of_mass])  # the hull last
        self.reader = ContactReader(
            len(self._places), weight=self._weight, mu_d=trial.sliding_friction, macro_step=self.master.macro_step,
            places=self._places,
        )  # fmt: skip
        self._every = max(1, round(energy_interval / self.master.macro_step))
        self.lowering_speed = lowering_speed
        self.placed = lowering_speed is None
        """Whether the hand has let go."""
        self._rows: list[list[float]] = []
        self._states: list[int] = []
        self._feet: list[Vector] = []
        self._not_begun()
        self._order()
        if lowering_speed is not None:
            if isinstance(footing, BedFooting):
                self.pace = pace_under(footing.gravity)
            self.body.take_in_hand(lowering_speed, pace=self.pace, step=self.master.macro_step)
        else:
            self.body.start(footing.lag)
            self._begin()

    @property
    def _weight(self) -> float:
        return float(np.linalg.norm(self.trial.weight))

    # Stepping ------------------------------------------------------------------------------------------------------

    def advance(self) -> None:
        """One macro step; nothing once it is done. Raises RuntimeError where it does not come to rest in the hand."""
        if self.done:
            return
        before = self.body.place
        reaction = self.master.step()
        if not self.placed:
            self._lower(reaction)
            return
        self._pull(before, self.body.place, self.trial.weight, self.body.masses)
        self._keep(reaction)
        if (self.master.count - self.placing_steps) % self._every == 0 or self.done:
            self._measure()

    def run(
        self,
        *,
        on_step: Callable[[SpatialRun], None] | None = None,
        on_frame: Callable[[SpatialRun], None] | None = None,
        frame_interval: float | None = None,
    ) -> dict[str, Vector]:
        """Go on to the end; `columns`. `on_frame` is called every `frame_interval` [s], and at the end."""
        self._follow(on_step, on_frame, frame_interval)
        return self.columns

    def _lower(self, reaction: FootReaction) -> None:
        wrench, twist, reach = self.master.wrench, self.body.twist, self.trial.platform.reach
        lacking = np.concatenate([wrench.force + self.trial.weight, wrench.torque / reach])
        self._settle(reaction, lacking, np.concatenate([twist.velocity, twist.spin * reach]))

    def _begin(self) -> None:
        self._open_books(self.body.momentum, self._turning)
        self._keep(self.master.last)
        self._measure()

    def _keep(self, reaction: FootReaction | None) -> None:
        """One row, of the time of the pose."""
        body, lag = self.body, self.footing.lag
        twist: Twist = body.twist_now(lag)
        touching = len(reaction.contacts) if reaction is not None else 0
        deepest = max(reaction.sinkage.values(), default=0.0) if reaction is not None else 0.0
        self._rows.append(
            [
                body.time, *body.place, *body.turn, *twist.velocity, *twist.spin, *(body.axes.T @ body.wheel_speed),
                body.kinetic_energy(lag), body.potential_energy, body.torque_work, *self.master.exchanged(),
                *self.master.wrench.force, touching, deepest,
            ]
        )  # fmt: skip
        centre = body.place - 0.5 * self.master.macro_step * twist.velocity
        feet = feet_of(reaction, centre, twist, len(self._places) - 1, hull=True)
        there = np.flatnonzero(feet.any(axis=0))
        self._feet.append(np.column_stack([np.full(len(there), len(self._rows) - 1.0), there, feet[:, there].T]))
        if self.footing.gives_friction:
            state = self.reader.see(feet[0], feet[1:3], feet[3:5])
        else:
            state = self._law_state()
        self._states.append(STATES.index(state))

    def _law_state(self) -> str:
        """By the tips that stick and slide under their Coulomb bounds."""
        places, body = self._places, self.body
        sliding = np.isin(np.arange(len(places)), list(body.sliding))
        touching = sliding | np.isin(np.arange(len(places)), list(body.sticking))
        return state_of(touching, sliding, places)

    @property
    def _turning(self) -> Vector:
        """Angular momentum of platform and wheels about (0, 0, 0) [N m s]."""
        return np.asarray(np.cross(self.body.place, self.body.momentum) + self.body.angular_momentum)

    def _measure(self) -> None:
        body = self.body
        self._sample(body.time, body.momentum - self.trial.weight * body.time, self._turning)

    # What came of it -----------------------------------------------------------------------------------------------

    @property
    def columns(self) -> dict[str, Vector]:
        """The rows so far, by COLUMNS."""
        return dict(zip(COLUMNS, np.array(self._rows, dtype=float).reshape(-1, len(COLUMNS)).T, strict=True))

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
        """Row, spike and its numbers, of those that have any."""
        return np.concatenate([np.zeros((0, 2 + FEET)), *self._feet])

    @property
    def states(self) -> list[str]:
        """The state at every row: of `coupling.contact_state` on grains, on a law by who sticks and who slides."""
        return [STATES[code] for code in self._states]

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
        """max(|work of the torques|, W reach, the kinetic energy at the start) [J], which residuals are relative to."""
        rows = self.columns
        weight = float(np.linalg.norm(self.trial.weight)) * self.trial.platform.reach
        return max(float(np.abs(rows["torque_work"]).max()), weight, float(rows["kinetic_energy"][0]), 1e-300)

    def state(self) -> dict[str, Any]:
        """All that the rest of the run depends on: a flat dict of numpy arrays."""
        own: dict[str, Any] = {
            "run.counts": np.array([self.placed, self.placing_steps, self._frames], dtype=np.int64),
            "run.settling": np.array(self._settling, dtype=float).reshape(-1, 12),
            "run.rows": np.array(self._rows, dtype=float).reshape(-1, len(COLUMNS)),
            "run.states": np.array(self._states, dtype=np.int8),
            "run.feet": self._feet_table,
        }
        own |= {f"reader.{key}": value for key, value in self.reader.state().items()}
        return own | self._books_state() | self.master.state()

    def restore(self, state: dict[str, Any]) -> None:
        """Go back to what `state` gave."""
        placed, self.placing_steps, self._frames = (int(number) for number in state["run.counts"])
        self.placed = bool(placed)
        self._settling = [row.copy() for row in np.asarray(state["run.settling"], dtype=float)]
        self._rows = np.asarray(state["run.rows"]).tolist()
        self._states = [int(code) for code in state["run.states"]]
        self._feet = [np.array(state["run.feet"], dtype=float)]
        self.reader.restore({key[7:]: value for key, value in state.items() if key.startswith("reader.")})
        self._restore_books(state)
        self.master.restore(state)
        self._order()
