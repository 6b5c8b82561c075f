"""A tumble of the planar platform on any footing: set down, let go, turned over by its flywheel.

A stepper as those of `coupling.penetration`: `advance` makes one macro step, `state` and `restore` work between any
two. On a bed a hand first lowers the platform until the sand carries it (`PlanarBody.take_in_hand`), under a larger
gravity if asked to, which then is lowered (`coupling.lowered_gravity`); then time is 0, the torque begins and the books
are opened. Every macro step leaves one row.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from rigid.trajectory import STATES, Tally, Trajectory, Transition
from rigid.trial import Trial

from .bed_footing import BedFooting
from .contact_state import ContactReader, changes_of, feet_of, state_of
from .followed import REST_TIME, Followed
from .footing import Footing, FootReaction, LawFooting
from .lowered_gravity import LoweredGravity, pace_under
from .master import Master
from .planar_body import PlanarBody
from .poses import Vector, Wrench

__all__ = ["MOST_REVERSAL", "CoupledTumble"]

MOST_REVERSAL = 1e-3
"""A larger `CoupledTumble.dissipation_reversal` is worth a warning [1].

What the grains' integrator and the coupling leave of a lossless collision is 3e-4 to 7e-4 of its energy
(tests/coupling); here it is set against the energy of the whole tumble. One on grains that dissipate has shown less
than 1e-6.
"""
GRAINS_EVERY = 100
"""Macro steps between two looks at how fast the grains are that wait under a lowered gravity."""
LONGEST_CALM = 10.0
"""A platform that does not come to rest there for longer is an error [of the time watched]."""
COLUMNS = (
    "time", "x", "y", "theta", "vx", "vy", "omega", "ax", "ay", "alpha", "wheel_speed", "kinetic_energy",
    "potential_energy", "torque_work", "given", "taken",
)  # fmt: skip
"""Of a row: the planar model's names; work on the footing as the body and as the footing sees it [J]."""


class CoupledTumble(Followed):
    """The platform of `trial` on `footing`, followed for `duration` [s] from where the torque begins.

    Parameters
    ----------
    substeps, body_steps, extrapolation, iterations : as `Master` has them.
    tip_radius : of the balls that its spikes end with [m]; 0 for a surface law.
    lowering_speed : of the hand [m/s]; None: no hand, the platform starts at `height`.
    height : of the centre at the start [m]; None: on a law where the law carries it, on a bed just clear of the grains.
    energy_interval : between measurements of what the footing holds [s].
    max_wheel_speed : where a motor has no torque left [rad/s].
    lower_gravity : whether the hand waits until gravity has fallen from the bed's to the trial's.

    Raises ValueError for a start in overlap with grains, a gravity to be lowered where there is no hand, no bed or a
    rig, and for what `Master`, `PlanarBody` and `LoweredGravity` refuse.
    """

    def __init__(
        self,
        trial: Trial,
        footing: Footing,
        *,
        duration: float,
        substeps: int = 10,
        body_steps: int = 1,
        extrapolation: int = 0,
        iterations: int = 1,
        tip_radius: float = 0.0,
        lowering_speed: float | None = None,
        height: float | None = None,
        energy_interval: float = 0.02,
        max_wheel_speed: float = math.inf,
        lower_gravity: bool = False,
    ) -> None:
        for key, value in {"duration": duration, "energy_interval": energy_interval}.items():
            if not (math.isfinite(value) and value > 0):
                raise ValueError(f"{key} is {value}: it must be above 0 (in s)")
        if lowering_speed is not None and not (math.isfinite(lowering_speed) and lowering_speed > 0):
            raise ValueError(f"lowering_speed is {lowering_speed}: it must be above 0 (in m/s)")
        self.trial, self.footing, self.duration = trial, footing, float(duration)
        half = math.pi / trial.spike_count
        self.level = (trial.spike_length - tip_radius) * math.cos(half) + tip_radius
        """Height of the centre with the lowest tips at the surface [m]."""
        start = self.level if height is None else float(height)
        if height is None and isinstance(footing, LawFooting):
            start -= _sinkage(footing, 0.5 * trial.weight)
        self.body = PlanarBody(trial, z=start)
        if isinstance(footing, BedFooting):
            if height is None:
                self.body.place[1] += footing.clear_height(self.body.pose)
            footing.check_start(self.body.pose)
        elif isinstance(footing, LawFooting):
            footing.place(self.body.pose)
        self.body.max_wheel_speed = max_wheel_speed
        self.lowering_speed = lowering_speed
        self.lowered: LoweredGravity | None = None
        if lower_gravity:
            if not isinstance(footing, BedFooting) or lowering_speed is None or trial.counterweight > 0:
                raise ValueError("lower_gravity is for a platform that a hand sets down on a bed, without a rig")
            self.lowered = LoweredGravity(footing, last=trial.gravity_sim, duration=self.duration)
        rests = lowering_speed is None and height is None
        weight = Wrench(np.array([0.0, 0.0, trial.weight if rests else 0.0]), np.zeros(3))
        self.master = Master(
            self.body, footing, substeps=substeps, body_steps=body_steps, extrapolation=extrapolation,
            iterations=iterations, first_guess=weight,
        )  # fmt: skip
        rows = trial.spike_count
        self._extrapolation = extrapolation
        self.reader = ContactReader(
            rows, weight=trial.weight, mu_d=trial.sliding_friction, macro_step=self.master.macro_step
        )
        self._every = max(1, round(energy_interval / self.master.macro_step))
        self.energy_interval = self._every * self.master.macro_step
        """Between measurements of what the footing holds [s]."""
        self.placed = lowering_speed is None
        """Whether the hand has let go."""
        self._rows: list[list[float]] = []
        self._states: list[int] = []
        self._feet: list[np.ndarray] = []
        self._not_begun()
        self._order()
        if self.placed:
            self.body.touching = rests
            self._begin()
        else:
            assert lowering_speed is not None
            if isinstance(footing, BedFooting):
                self.pace = pace_under(footing.gravity)
            if self.lowered is not None:
                self.body.trial = replace(trial, gravity_sim=self.lowered.now)
            self.body.take_in_hand(lowering_speed, pace=self.pace, step=self.master.macro_step)

    _free, _turns = (0, 2), (1,)

    # How far -------------------------------------------------------------------------------------------------------

    @property
    def _weight(self) -> float:
        return self.body.trial.weight

    @property
    def _hand_time(self) -> float:
        lowered = self.lowered
        return super()._hand_time + (lowered.steps * lowered.every + 3 * self.pace * REST_TIME if lowered else 0.0)

    # Stepping ------------------------------------------------------------------------------------------------------

    def advance(self) -> None:
        """One macro step; nothing once it is done."""
        if self.done:
            return
        if not self.placed:
            self._lower()
            return
        before = self.body.pose.position
        reaction = self.master.step()
        inertia = self.body.inertia
        masses = np.array([inertia[0], inertia[0], inertia[1]])
        self._pull(before, self.body.pose.position, np.array([0.0, 0.0, -self.trial.weight]), masses)
        self._keep(reaction)
        if (self.master.count - self.placing_steps) % self._every == 0 or self.done:
            self._measure()

    def run(
        self,
        *,
        on_step: Callable[[CoupledTumble], None] | None = None,
        on_frame: Callable[[CoupledTumble], None] | None = None,
        frame_interval: float | None = None,
    ) -> Trajectory:
        """Go on to the end. `on_frame` is called every `frame_interval` [s] of the tumble, and at its end."""
        self._follow(on_step, on_frame, frame_interval)
        return self.trajectory()

    def _lower(self) -> None:
        reaction = self.master.step()
        wrench, rates, length = self.master.wrench, self.body.rates, self.trial.spike_length
        lacking = np.array([wrench.force[2] - self._weight, wrench.torque[1] / length])
        moving = np.array([rates[1], rates[2] * length])
        if self.lowered is None or self.lowered.begun is None:
            self._settle(reaction, lacking, moving)
        elif self.lowered.at_last:
            self._calm(lacking, moving)
        elif self.lowered.fall(self.body.time):
            last = self.lowered.at_last
            self.body.trial = self.trial if last else replace(self.trial, gravity_sim=self.lowered.now)
            self._settling = []

    def _lies(self) -> None:
        """It lies: gravity falls, if it is to fall and has not yet, once the grains are calm; else the hand lets go."""
        if self.lowered is None or self.lowered.begun is not None:
            super()._lies()
        elif self.master.count % GRAINS_EVERY == 0 and self.lowered.calm:
            self.lowered.begin(self.body.time)

    def _calm(self, lacking: Vector, moving: Vector) -> None:
        """A step in the hand under the run's own gravity: at rest it lets go (see `coupling.lowered_gravity`)."""
        mean, lowered = self._mean_of_late(lacking, moving), self.lowered
        assert lowered is not None and lowered.begun is not None and isinstance(self.footing, BedFooting)
        if mean is None or self.master.count % GRAINS_EVERY:
            return
        own = PlanarBody(self.trial, z=0.0).inertia
        length = self.trial.spike_length
        lack = mean[0] / own[1], mean[1] * length / own[2] * length
        speeds = *mean[2:], self.footing.grain_speed()
        if lowered.far(speeds, lack) <= 1:
            if not lowered.dragged:
                self._lies()
            lowered.drag(False)
            self._settling = []
        elif self.body.time > lowered.begun + lowered.steps * lowered.every + LONGEST_CALM * lowered.sees:
            raise RuntimeError(
                f"platform and grains did not come to rest in {LONGEST_CALM * lowered.sees:.3g} s under "
                f"{lowered.last:.3g} m/s2: grains move at {speeds[2]:.2g} m/s, the platform at {max(speeds[:2]):.2g}, "
                f"{mean[0]:.2g} of {self._weight:.2g} N are lacking; a smaller settle_gravity would do"
            )

    def _begin(self) -> None:
        self._open_books(self.body.momentum, self._turning)
        self._keep(self.master.last)
        self._measure()

    def _keep(self, reaction: FootReaction | None) -> None:
        """One row, of the time of the pose."""
        body, lag, master = self.body, self.footing.lag, self.master
        rates, (given, taken) = body.rates_now(lag), master.exchanged()
        self._rows.append(
            [
                body.time, *body.place, *rates, *body.acceleration, body.wheel_speed, body.kinetic_energy(lag),
                body.potential_energy, body.torque_work, given, taken,
            ]
        )  # fmt: skip
        now = body.twist_now(lag)
        centre = body.pose.position - 0.5 * master.macro_step * now.velocity
        feet = feet_of(reaction, centre, now, self.trial.spike_count)[[0, 1, 3, 5]]
        self._feet.append(feet)
        if self.footing.gives_friction:
            state = self.reader.see(feet[0], feet[1], feet[2])
        else:
            touching = body.modes != 9
            state = state_of(touching, touching & (body.modes != 0)) if len(self._rows) > 1 else "stand"
        self._states.append(STATES.index(state))

    @property
    def _turning(self) -> np.ndarray:
        """Angular momentum of the platform about (0, 0, 0), less what the wheel gave it [N m s]."""
        body, trial = self.body, self.trial
        given = trial.wheel_inertia * (body.wheel_speed - trial.wheel_speed_0)
        own = body.inertia[2] * body.rates[2] - (given if trial.actuator == "motor" else -given)
        return np.asarray(np.cross(body.pose.position, body.momentum) + [0.0, own, 0.0])

    def _measure(self) -> None:
        body = self.body
        fallen = np.array([0.0, 0.0, -self.trial.weight * body.time])
        self._sample(body.time, body.momentum - fallen, self._turning)

    # What came of it -----------------------------------------------------------------------------------------------

    @property
    def columns(self) -> dict[str, np.ndarray]:
        """The rows so far, by COLUMNS."""
        return dict(zip(COLUMNS, np.array(self._rows, dtype=float).reshape(-1, len(COLUMNS)).T, strict=True))

    @property
    def feet(self) -> np.ndarray:
        """Normal and horizontal force [N], slip speed [m/s] and sinkage [m] of each row, shape [step, 4, row]."""
        return np.array(self._feet).reshape(-1, 4, self.trial.spike_count)

    @property
    def states(self) -> list[str]:
        """The state at every row."""
        return [STATES[code] for code in self._states]

    @property
    def energy_scale(self) -> float:
        """max(|work of the torque|, W l) [J], which residuals are relative to."""
        return max(float(np.abs(self.columns["torque_work"]).max()), self.trial.weight * self.trial.spike_length)

    def trajectory(self) -> Trajectory:
        """As the planar model's integrators give it, what the footing holds as stored energy.

        `dissipated` is what the footing took less what it holds more than at the start, at every row; of a bed that is
        measured as well, at the times of `samples` (`losses`).
        """
        rows = self.columns
        tally = Tally(self.trial, rows["x"][0], rows["y"][0], 0.0)
        for k in range(len(rows["time"])):
            away = tally.distance(rows["x"][k], rows["y"][k])
            if tally.angle is None and away >= 0.01:
                near = tally.distance(rows["x"][k - 1], rows["y"][k - 1])
                share = (0.01 - near) / (away - near)
                tally.launch(*(rows[c][k - 1] + share * (rows[c][k] - rows[c][k - 1]) for c in ("x", "y")))
            tally.see(rows["time"][k], rows["vx"][k], rows["vy"][k], rows["omega"][k], 0.0, rows["torque_work"][k], 0.0)
        shared = {name: rows[name] for name in COLUMNS[:14]}
        return Trajectory(
            trial=self.trial,
            method="coupled",
            state=np.array(self._states, dtype=np.int8),
            stored_energy=self.stored_by_row,
            dissipated=self.dissipated_by_row,
            transitions=self._transitions(),
            trajectory_angle=tally.angle,
            max_speed=tally.max_speed,
            time_of_max_speed=tally.time_of_max_speed,
            max_angular_velocity=tally.max_spin,
            energy_residual=self.energy_residual,
            notes={"macro_step": self.master.macro_step},
            **shared,
        )

    def _transitions(self) -> tuple[Transition, ...]:
        return changes_of((row[0] for row in self._rows), self.states, (row[3] for row in self._rows))

    def state(self) -> dict[str, Any]:
        """All that the rest of the run depends on: a flat dict of numpy arrays."""
        own: dict[str, Any] = {
            "tumble.counts": np.array([self.placed, self.placing_steps, self._frames], dtype=np.int64),
            "tumble.settling": np.array(self._settling, dtype=float).reshape(-1, 4),
            "tumble.rows": np.array(self._rows, dtype=float).reshape(-1, len(COLUMNS)),
            "tumble.states": np.array(self._states, dtype=np.int8),
            "tumble.feet": self.feet,
        }
        own |= {"tumble.lowered": self.lowered.numbers()} if self.lowered is not None else {}
        own |= {f"reader.{key}": value for key, value in self.reader.state().items()}
        return own | self._books_state() | self.master.state()

    def restore(self, state: dict[str, Any]) -> None:
        """Go back to what `state` gave."""
        placed, self.placing_steps, self._frames = (int(number) for number in state["tumble.counts"])
        self.placed = bool(placed)
        if self.lowered is not None:
            self.lowered.restore(np.asarray(state["tumble.lowered"], dtype=float))
            now = self.lowered.now
            self.body.trial = self.trial if self.lowered.at_last else replace(self.trial, gravity_sim=now)
        self._settling = list(np.asarray(state["tumble.settling"], dtype=float))
        self._rows = np.asarray(state["tumble.rows"]).tolist()
        self._states = [int(code) for code in state["tumble.states"]]
        self._feet = list(np.asarray(state["tumble.feet"]))
        self._restore_books(state)
        self.reader.restore({key[7:]: value for key, value in state.items() if key.startswith("reader.")})
        self.master.restore(state)
        self._order()


def _sinkage(footing: LawFooting, load: float) -> float:
    """Depth at which the first row's law carries `load` [N] at rest [m], by bisection."""
    law, low, high = footing.grounds[0], 0.0, 1e-6
    while float(law.force(high, 0.0)) < load:
        low, high = high, 2 * high
        if high > 1.0:
            raise ValueError(f"the ground does not carry {load:.3g} N a row")
    for _ in range(200):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if float(law.force(middle, 0.0)) < load else (low, middle)
    return high
