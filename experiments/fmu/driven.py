"""A platform on a surface law in the plane that another program drives: torque and brake are set before each step.

Signs are those of docs/planar.md: x along the surface, z up, theta clockwise. The wheel's speed is counted so that a
positive torque of the motor increases it and turns the platform clockwise.
"""

import math

import numpy as np

from coupling import LawGround, Master, PlanarBody
from coupling.ground import part_of, prefixed
from coupling.law_ground import row_tips
from coupling.poses import Wrench
from coupling.tumbling import level_of, sinkage_under
from rigid.checks import check_above_zero
from rigid.ground.grounds import SurfaceGround
from rigid.ground.reaction import State
from rigid.model.trial import Trial

from . import say

__all__ = ["DrivenBody", "DrivenPlatform", "ground_of"]

SPEED = 0.5  # At which the damping of a law is taken [m/s]


class DrivenBody(PlanarBody):
    """A `PlanarBody` whose torques come from outside."""

    motor = 0.0  # Torque of the motor on the platform, clockwise [N m]
    brake = 0.0  # Largest torque of the brake, against the wheel's speed [N m]
    in_flight = False  # Whether both act where nothing touches

    def _mean_torque(self, dt: float) -> float:
        """Mean torque of the next step on the platform [N m]; the wheel gets the opposite.

        The motor accelerates the wheel up to `max_wheel_speed`. The brake then takes what speed it can, and no more.
        """
        self._until_limit = math.inf
        if not (self.touching or self.in_flight):
            return 0.0
        inertia, before, most = self.trial.wheel_inertia, self.wheel_speed, self.max_wheel_speed
        torque, sign = self.motor, math.copysign(1.0, self.motor)
        room = max(0.0, most - sign * before) * inertia / dt  # Largest torque that keeps to the wheel's largest speed
        if abs(torque) > room:
            torque = sign * room
        if self.brake == 0:
            return torque
        stopping = inertia * before / dt + torque  # What would stop the wheel within the step
        return torque - math.copysign(min(self.brake, abs(stopping)), stopping)


def ground_of(trial: Trial) -> LawGround:
    """The surface law of `trial` under each of its rows of spikes."""
    law = trial.surface
    grounds = [
        SurfaceGround(
            law=law.name, parameters=law.parameters, count=law.spikes_per_row, mu_s=trial.mu_s,
            mu_d=trial.sliding_friction,
        )
        for _ in range(trial.spike_count)
    ]  # fmt: skip
    return LawGround(row_tips(trial.spike_length, trial.spike_count), grounds)


class DrivenPlatform:
    """The platform of `trial` on its surface law, stepped by any time; the torque and actuator of `trial` are ignored.

    Parameters
    ----------
    height : of the centre at the start [m]; None: it rests on two rows of spikes.
    x, theta : place along the surface [m] and angle [rad] at the start.
    rates : of x [m/s], z [m/s] and theta [rad/s] at the start.
    wheel_speed : of the flywheel at the start [rad/s], either sign.
    max_wheel_speed : beyond which the motor does not accelerate it [rad/s].
    in_flight : whether the torques act where nothing touches.
    longest_step : of the exchange between platform and ground [s].

    Raises ValueError for an exchange that is unstable at `longest_step` (docs/coupling.md), and for a start that can
    not be.
    """

    def __init__(
        self,
        trial: Trial,
        *,
        height: float | None = None,
        x: float = 0.0,
        theta: float = 0.0,
        rates: tuple[float, float, float] = (0.0, 0.0, 0.0),
        wheel_speed: float = 0.0,
        max_wheel_speed: float = math.inf,
        in_flight: bool = False,
        longest_step: float = 4e-4,
    ) -> None:
        check_above_zero("in s", longest_step=longest_step)
        self.trial, self.ground, self.longest_step = trial, ground_of(trial), longest_step
        sinkage = sinkage_under(self.ground, 0.5 * trial.weight)
        self._check_step(sinkage)
        rests = height is None
        body = DrivenBody(trial, x=x, z=level_of(trial) - sinkage if height is None else height, theta=theta)
        body.start(np.array(rates, dtype=float), 0.0)
        body.wheel_speed, body.max_wheel_speed, body.in_flight = wheel_speed, max_wheel_speed, in_flight
        body.touching = rests
        self.body = body
        self.ground.place(body.pose)
        carried = Wrench(np.array([0.0, 0.0, trial.weight if rests else 0.0]), np.zeros(3))
        self.master = Master(body, self.ground, substeps=1, first_guess=carried)
        self.master.wrench = carried
        self._at_start = self._held_energy()
        self.loads = np.zeros(trial.spike_count)
        """Normal force on each row of spikes, its mean over the last inner step [N], shape [row]."""
        if rests:
            self.loads[[0, -1]] = 0.5 * trial.weight

    def __repr__(self) -> str:
        return f"DrivenPlatform({self.body!r} on {self.ground!r}, {self.time:.4g} s)"

    @property
    def time(self) -> float:
        """Since the start [s]."""
        return self.body.time

    @property
    def depth(self) -> float:
        """Of the lowest tip below the surface [m]; 0 above it."""
        _, z, theta = self.body.place
        heights = z + self.ground.tips[:, [0, 2]] @ np.array([-math.sin(theta), math.cos(theta)])
        return max(0.0, -float(heights.min()))

    @property
    def energy_residual(self) -> float:
        """What the energy balance does not account for [J]."""
        return self.body.torque_work - self.master.exchange.given - (self._held_energy() - self._at_start)

    def advance(self, time: float, *, motor: float = 0.0, brake: float = 0.0) -> None:
        """Go on by `time` [s] with the torque of the motor and the largest torque of the brake [N m].

        Raises ValueError for a time that is not above 0, a torque that is no finite number and a negative brake. Raises
        RuntimeError where the state is lost (no finite number).
        """
        if not (math.isfinite(time) and time > 0):
            raise ValueError(say("bad_step", time=time))
        for name, value in (("torque", motor), ("brake", brake)):
            if not math.isfinite(value):
                raise ValueError(say("not_finite", name=name, value=value))
        if brake < 0:
            raise ValueError(say("negative_brake", value=brake))
        self.body.motor, self.body.brake = motor, brake
        count = max(1, math.ceil(time / self.longest_step - 1e-9))
        self.master.macro_step = time / count
        for _ in range(count):
            answer = self.master.step()
        self.loads = np.zeros(self.trial.spike_count)
        for row, contact in answer.by_member.items():
            self.loads[row] = contact.normal_force
        if not np.isfinite(self.body.place).all():
            raise RuntimeError(say("lost", time=self.time))

    def state(self) -> State:
        """All that the next steps depend on: a flat dict of numpy arrays."""
        return (
            prefixed("platform", {"start": np.array(self._at_start), "loads": self.loads.copy()}) | self.master.state()
        )

    def restore(self, state: State) -> None:
        """Go back to what `state` gave; the steps that follow repeat to the bit."""
        own = part_of(state, "platform")
        self._at_start, self.loads = float(own["start"]), np.array(own["loads"], dtype=float)
        self.master.restore(state)

    def _held_energy(self) -> float:
        return self.body.kinetic_energy(0.0) + self.body.potential_energy

    def _check_step(self, sinkage: float) -> None:
        """Refuse a step that makes the explicit exchange unstable: K H^2 / 4 m + C H / m must be below 1."""
        trial, law, step = self.trial, self.ground.grounds[0], self.longest_step
        near = 1e-4 * sinkage
        stiffness = float(law.force(sinkage + near, 0.0) - law.force(sinkage, 0.0)) / near
        damping = float(law.force(sinkage, SPEED) - law.force(sinkage, 0.0)) / SPEED
        inertia = PlanarBody(trial, z=0.0).inertia
        mass = 1.0 / (1.0 / inertia[1] + trial.spike_length**2 / inertia[2])  # of one row at arm's length
        load = (0.25 * stiffness * step**2 + damping * step) / mass
        if load > 1:
            raise ValueError(say("unstable", step=step, stiffness=stiffness, damping=damping, mass=mass, load=load))
