"""A tumble of the planar platform on any ground: placed, released, turned over by its flywheel.

On a bed the platform is first lowered until the sand carries it. On request this is under a larger gravity, which then
falls to the run's (`coupling.lowered_gravity`). Then time is 0, the torque begins and the energy balance starts.
"""

import math
from dataclasses import replace
from typing import Any, Unpack

import numpy as np

from hedgebed_renamed import renamed_keywords
from rigid.checks.unfit import UnfitSettingsError
from rigid.ground.reaction import Reaction, State
from rigid.model.trial import Trial
from rigid.planar.trajectory import Tally, Trajectory

from .bed_ground import BedGround
from .contact_state import changes_of, state_of
from .ground import Ground, prefixed
from .law_ground import LawGround
from .lowered_gravity import LoweredGravity
from .planar_body import PlanarBody
from .platform_run import REST_TIME, PlatformRun
from .poses import Twist, Vector, Wrench
from .stepper import Reporting

__all__ = ["MOST_REVERSAL", "CoupledTumble", "level_of", "sinkage_under"]

MOST_REVERSAL = 1e-3
"""A larger `CoupledTumble.dissipation_reversal` is worth a warning [1]: a lossless collision leaves 3e-4 to 7e-4 of its
energy (tests/coupling), a tumble on grains that dissipate less than 1e-6."""
GRAINS_EVERY = 100  # Macro steps between two measurements of how fast the grains are that wait under a lowered gravity
LONGEST_CALM = 10.0  # A platform that does not come to rest there for longer is an error [of the time watched]
COLUMNS = (
    "time", "x", "y", "theta", "vx", "vy", "omega", "ax", "ay", "alpha", "wheel_speed", "kinetic_energy",
    "potential_energy", "torque_work", "given", "taken",
)  # fmt: skip
"""Of a row: the planar model's names; work on the ground as the body and as the ground sees it [J]."""


class CoupledTumble(PlatformRun):
    """The platform of `trial` on `ground`, followed for `duration` [s] from where the torque begins.

    Parameters
    ----------
    tip_radius : of the balls that its spikes end with [m]; 0 for a surface law.
    height : of the centre at the start [m]; None: on a law where the law carries it, on a bed just clear of the grains.
    max_wheel_speed : where a motor has no torque left [rad/s].
    lower_gravity : whether the placement goes on until gravity has fallen from the bed's to the trial's.
    lowering_speed : of the placement [m/s]; None: none, the platform starts at `height`.
    energy_interval : between measurements of what the ground holds [s].
    options : those of `Master`.

    Raises ValueError for a start in overlap with grains. The same is raised for a gravity to be lowered where there is
    no placement, no bed or a rig. It also raises the errors of `Master`, `PlanarBody` and `LoweredGravity`.
    """

    COLUMNS, _prefix = COLUMNS, "tumble"
    _free, _turns = (0, 2), (1,)
    trial: Trial

    @renamed_keywords(footing="ground")
    def __init__(
        self,
        trial: Trial,
        ground: Ground,
        *,
        duration: float,
        tip_radius: float = 0.0,
        lowering_speed: float | None = None,
        height: float | None = None,
        energy_interval: float = 0.02,
        max_wheel_speed: float = math.inf,
        lower_gravity: bool = False,
        **options: Any,
    ) -> None:
        self.tip_radius = tip_radius
        self.level = level_of(trial, tip_radius)
        start = self.level if height is None else float(height)
        if height is None and isinstance(ground, LawGround):
            start -= sinkage_under(ground, 0.5 * trial.weight)
        rests = lowering_speed is None and height is None
        carried = Wrench(np.array([0.0, 0.0, trial.weight if rests else 0.0]), np.zeros(3))
        super().__init__(
            trial, ground, PlanarBody(trial, z=start), duration=duration, lift=height is None,
            weight=np.array([0.0, 0.0, -trial.weight]), members=trial.spike_count, lowering_speed=lowering_speed,
            energy_interval=energy_interval, first_guess=carried, **options,
        )  # fmt: skip
        self.body.max_wheel_speed = max_wheel_speed
        self.lowered: LoweredGravity | None = None
        if lower_gravity:
            if not isinstance(ground, BedGround) or lowering_speed is None or trial.counterweight > 0:
                raise ValueError("lower_gravity is for a platform that is placed on a bed, without a rig")
            self.lowered = LoweredGravity(ground, last=trial.gravity_sim, duration=self.duration)
        if self.placed:
            self.body.touching = rests
            self._begin()
        else:
            self._weigh()
            self._start_placement()

    @property
    def _weight(self) -> float:
        return float(self.body.trial.weight)

    @property
    def _placement_time(self) -> float:
        lowered = self.lowered
        return super()._placement_time + (lowered.steps * lowered.every + 3 * self.pace * REST_TIME if lowered else 0.0)

    def run(self, **reporting: Unpack[Reporting]) -> Trajectory:
        """Go on to the end, with the reports of `Stepper.follow`; frames are counted from the torque's begin."""
        self.follow(**reporting)
        return self.trajectory()

    def _out_of_balance(self) -> tuple[Vector, Vector]:
        wrench, rates, length = self.master.wrench, self.body.rates, self.trial.spike_length
        missing = np.array([wrench.force[2] - self._weight, wrench.torque[1] / length])
        return missing, np.array([rates[1], rates[2] * length])

    def _lower(self, reaction: Reaction) -> None:
        if self.lowered is None or self.lowered.begun is None:
            super()._lower(reaction)
        elif self.lowered.at_last:
            self._calm(*self._out_of_balance())
        elif self.lowered.fall(self.body.time):
            self._weigh()
            self._settling = []

    def _weigh(self) -> None:
        if self.lowered is not None:
            now = self.lowered.now
            self.body.trial = self.trial if self.lowered.at_last else replace(self.trial, gravity_sim=now)

    def _end_placement(self) -> None:
        """It lies: gravity falls, if it is to fall and has not yet, once the grains are calm; else placement ends."""
        if self.lowered is None or self.lowered.begun is not None:
            super()._end_placement()
        elif self.master.count % GRAINS_EVERY == 0 and self.lowered.calm:
            self.lowered.begin(self.body.time)

    def _calm(self, missing: Vector, moving: Vector) -> None:
        """A step of the placement under the run's own gravity: it ends at rest (see `coupling.lowered_gravity`)."""
        mean, lowered = self._mean_of_late(missing, moving), self.lowered
        assert lowered is not None and lowered.begun is not None and isinstance(self.ground, BedGround)
        if mean is None or self.master.count % GRAINS_EVERY:
            return
        own = PlanarBody(self.trial, z=0.0).inertia
        length = self.trial.spike_length
        lack = mean[0] / own[1], mean[1] * length / own[2] * length
        speeds = *mean[2:], self.ground.grain_speed()
        if lowered.far(speeds, lack) <= 1:
            if not lowered.dragged:
                self._end_placement()
            lowered.drag(False)
            self._settling = []
        elif self.body.time > lowered.begun + lowered.steps * lowered.every + LONGEST_CALM * lowered.sees:
            raise UnfitSettingsError(
                f"platform and grains did not come to rest in {LONGEST_CALM * lowered.sees:.3g} s under "
                f"{lowered.last:.3g} m/s2: grains move at {speeds[2]:.2g} m/s, the platform at {max(speeds[:2]):.2g}, "
                f"{mean[0]:.2g} of {self._weight:.2g} N are missing; choose a smaller settle_gravity"
            )

    def _row(self, reaction: Reaction | None, now: Twist) -> list[float]:
        body, lag = self.body, self.ground.lag
        return [
            body.time, *body.place, *body.rates_now(lag), *body.acceleration, body.wheel_speed,
            body.kinetic_energy(lag), body.potential_energy, body.torque_work, *self.master.exchanged(),
        ]  # fmt: skip

    def _reach(self, theta: float) -> Vector:
        """How far below the centre each row's lowest point is with the platform turned by `theta` [rad]; [m]."""
        count = self.trial.spike_count
        angles = theta + math.pi / count * (1 + 2 * np.arange(count))
        return np.asarray((self.trial.spike_length - self.tip_radius) * np.cos(angles) + self.tip_radius)

    def _keep_feet(self, feet: Vector) -> None:
        self._feet.append(feet[[0, 1, 3, 5]])

    def _state_now(self, feet: Vector) -> str:
        if self.ground.gives_friction:
            return self.reader.see(feet[0], feet[1], feet[3])
        touching = self.body.modes != 9
        return state_of(touching, touching & (self.body.modes != 0)) if len(self._rows) > 1 else "stand"

    @property
    def _turning(self) -> np.ndarray:
        body, trial = self.body, self.trial
        given = trial.wheel_inertia * (body.wheel_speed - trial.wheel_speed_0)
        own = body.inertia[2] * body.rates[2] - (given if trial.actuator == "motor" else -given)
        return np.asarray(np.cross(body.pose.position, body.momentum) + [0.0, own, 0.0])

    @property
    def feet(self) -> np.ndarray:
        """Normal and horizontal force [N], slip speed [m/s] and sinkage [m] of each row, shape [step, 4, row]."""
        return np.array(self._feet).reshape(-1, 4, self.trial.spike_count)

    _feet_table = feet

    @property
    def energy_scale(self) -> float:
        """max(|work of the torque|, W l) [J]."""
        return max(float(np.abs(self.columns["torque_work"]).max()), self.trial.weight * self.trial.spike_length)

    def trajectory(self) -> Trajectory:
        """As the planar model's integrators give it, what the ground holds as stored energy.

        `dissipated` is what the ground took less what it holds more than at the start, at every row. On a bed the
        losses are measured too, at the times of `samples` (`losses`).
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
            transitions=changes_of(rows["time"], self.states, rows["theta"]),
            trajectory_angle=tally.angle,
            max_speed=tally.max_speed,
            time_of_max_speed=tally.time_of_max_speed,
            max_angular_velocity=tally.max_spin,
            energy_residual=self.energy_residual,
            notes={"macro_step": self.master.macro_step},
            **shared,
        )

    def state(self) -> State:
        """All that the rest of the run depends on."""
        own = {"lowered": self.lowered.numbers()} if self.lowered is not None else {}
        return prefixed("tumble", own) | super().state()

    def restore(self, state: State) -> None:
        """Go back to what `state` gave."""
        if self.lowered is not None:
            self.lowered.restore(np.asarray(state["tumble.lowered"], dtype=float))
            self._weigh()
        super().restore(state)


def level_of(trial: Trial, tip_radius: float = 0.0) -> float:
    """Height of the centre with the lowest two rows at the surface [m]; `tip_radius` of the balls at their ends [m]."""
    return (trial.spike_length - tip_radius) * math.cos(math.pi / trial.spike_count) + tip_radius


def sinkage_under(ground: LawGround, load: float) -> float:
    """Depth at which the first row's law carries `load` [N] at rest [m], by bisection.

    Raises ValueError where it does not down to 1 m.
    """
    law, low, high = ground.grounds[0], 0.0, 1e-6
    while float(law.force(high, 0.0)) < load:
        low, high = high, 2 * high
        if high > 1.0:
            raise ValueError(f"the ground does not carry {load:.3g} N a row")
    for _ in range(200):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if float(law.force(middle, 0.0)) < load else (low, middle)
    return high
