"""What a simulated tumble looks like: samples, transitions, and the numbers that a person would quote."""

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rigid.model.trial import Trial

__all__ = ["STATES", "LAUNCH_DISTANCE", "Trajectory", "Transition"]

STATES = ("stand", "pivot", "slip", "hop")  # The states (docs/planar.md), in the order of `Trajectory.state`'s numbers
LAUNCH_DISTANCE = 0.01  # How far from its start the centre is when its trajectory angle is taken [m]

Array = NDArray[np.float64]
Transition = tuple[float, str, float]  # (time [s], state entered, theta [rad])


@dataclass(frozen=True, kw_only=True)
class Trajectory:
    """A tumble sampled at `time`; all arrays have shape [sample_count]. World axes, the geometric centre, SI units."""

    trial: Trial
    method: str
    time: Array
    x: Array
    y: Array
    theta: Array
    vx: Array
    vy: Array
    omega: Array
    ax: Array  # Acceleration of the centre [m/s2]
    ay: Array
    alpha: Array  # Angular acceleration [rad/s2]
    wheel_speed: Array
    state: NDArray[np.int8]  # Number into STATES
    kinetic_energy: Array
    potential_energy: Array
    stored_energy: Array  # In the ground's springs [J]
    torque_work: Array  # Work of the torque on the platform since t = 0 [J]
    dissipated: Array  # [J] since t = 0
    transitions: tuple[Transition, ...]
    """Every change of state in order of time; the first is the state at t = 0, with the torque on."""
    trajectory_angle: float | None
    """atan2(dy, dx) of the centre from its start to the first point 10 mm away [rad]; None if never reached."""
    max_speed: float  # Largest speed of the centre [m/s]
    time_of_max_speed: float  # When it is that fast [s], to a step or a sample, whichever is nearer
    max_angular_velocity: float  # Largest |omega| [rad/s]
    energy_residual: float
    """Largest |E(t) - E(0) - work of the torque + dissipated| over max(|work of the torque|, W l) [1]."""
    notes: dict[str, Any] = field(default_factory=dict)  # How the integration went: steps, events

    @property
    def state_names(self) -> list[str]:
        """The state at every sample, in words."""
        return [STATES[k] for k in self.state]

    @property
    def energy(self) -> Array:
        """E(t) [J]."""
        return self.kinetic_energy + self.potential_energy + self.stored_energy

    def transition_angle(self, state: str) -> float | None:
        """theta [rad] at the first entry into `state`, None if it never comes. Raises ValueError for an unknown one."""
        found = self._first_entry(state)
        return found[2] if found else None

    def transition_time(self, state: str) -> float | None:
        """Time [s] of the first entry into `state`, None if it never comes. Raises ValueError for an unknown one."""
        found = self._first_entry(state)
        return found[0] if found else None

    def _first_entry(self, state: str) -> Transition | None:
        if state not in STATES:
            raise ValueError(f"state = {state!r} must be one of {', '.join(STATES)}")
        return next((change for change in self.transitions if change[1] == state), None)


class Tally:
    """Follows an integration step by step for the largest speeds, the launch and the energy's residual."""

    def __init__(self, trial: Trial, x: float, y: float, energy: float) -> None:
        self.start, self.energy = (x, y), energy
        self.scale = trial.weight * trial.spike_length
        self.max_speed = self.max_spin = self.worst = self.most_work = self.time_of_max_speed = 0.0
        self.angle: float | None = None

    def distance(self, x: float, y: float) -> float:
        """From the start [m]."""
        return math.hypot(x - self.start[0], y - self.start[1])

    def launch(self, x: float, y: float) -> None:
        """The centre is LAUNCH_DISTANCE away for the first time."""
        self.angle = math.atan2(y - self.start[1], x - self.start[0])

    def see(self, time: float, vx: float, vy: float, omega: float, energy: float, work: float, lost: float) -> None:
        """One moment."""
        speed = math.hypot(vx, vy)
        if speed > self.max_speed:
            self.max_speed, self.time_of_max_speed = speed, time
        self.max_spin = max(self.max_spin, abs(omega))
        self.most_work = max(self.most_work, abs(work))
        self.worst = max(self.worst, abs(energy - self.energy - work + lost))

    @property
    def residual(self) -> float:
        """See `Trajectory.energy_residual`."""
        return self.worst / max(self.most_work, self.scale)
