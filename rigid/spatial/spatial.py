"""Six degrees of freedom: a platform with up to three flywheels, in flight and on flat ground with Coulomb friction.

`simulate` integrates a `SpatialTrial`. Between events it uses Dormand and Prince's pair of orders 5 and 4. An event is
that a tip touches or lifts, starts or stops to slide, or that a torque changes. Events are located by repeating the
step with other lengths. Momentum and angular momentum are states, so flight keeps them to round-off. Started in the
plane it moves as the planar model does (`rigid.simulate`), a planar row being the tips side by side. How friction
sticks: `rigid.spatial.motion`.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import root

from rigid.checks import Coulomb, check_above_zero, check_friction, sample_times
from rigid.ground.laws import find_law
from rigid.platform.actuation import TorqueHistory
from rigid.platform.platform import Platform

from .motion import FRICTION_WORK, GROUND_WORK, STATE_COUNT, TORQUE_WORK, H, L, Motion, P, Q, R
from .quaternions import from_turn, to_matrix
from .steps import Integration

__all__ = ["SpatialTrajectory", "SpatialTrial", "simulate", "standing"]

Array = NDArray[np.float64]
Numbers = Sequence[float]


@dataclass(frozen=True, kw_only=True, eq=False)
class SpatialTrial(Coulomb):
    """A platform on flat ground, or above it. Raises ValueError, naming the key, for what cannot be."""

    platform: Platform
    gravity: float | tuple[float, float, float]
    """g [m/s2], or the vector of it, which makes a slope: the ground is z = 0. In a rig g_sim, upright."""
    ground: str = "spring-damper"  # Surface law, by name
    ground_parameters: Mapping[str, float] = field(default_factory=dict)
    """Of one tip, SI units: half of what a planar row of two has."""
    mu_s: float = 0.5  # Coefficient of static friction [1]
    mu_d: float | None = None  # Coefficient of sliding friction [1]; None: half of mu_s
    counterweight: float = 0.0  # m_b of a rig [kg]; the weight is then (m + m_b) g_sim
    torques: tuple[TorqueHistory, ...] = ()  # One for each wheel that is driven, found by its axis
    torque_in_flight: bool = False  # Whether the wheels are driven while no tip touches; the planar model does not

    def __post_init__(self) -> None:
        gravity = np.atleast_1d(np.asarray(self.gravity, dtype=float))
        if gravity.shape not in ((1,), (3,)) or not np.isfinite(gravity).all():
            raise ValueError(f"gravity is {self.gravity}: it must be a number or a vector of three (m/s2)")
        if gravity.shape == (1,) and gravity[0] < 0:
            raise ValueError(f"gravity is {self.gravity}: it must be 0 or more (m/s2)")
        find_law(self.ground).numbers(self.ground_parameters)
        check_friction(self.mu_s, self.mu_d)
        if not 0 <= self.counterweight < self.platform.mass:
            raise ValueError(
                f"counterweight is {self.counterweight}: it must be 0 or more and below the platform's mass, "
                f"{self.platform.mass} kg"
            )
        if self.counterweight > 0 and (len(gravity) == 3 or np.any(self.platform.centre_of_mass)):
            raise ValueError(
                f"counterweight is {self.counterweight}: the rig hangs on wires upright, at the centre of mass; there "
                f"is none on a slope or with a centre of mass off the centre"
            )
        wheels = [self._wheel_of(history) for history in self.torques]
        if len(set(wheels)) < len(wheels):
            raise ValueError("torques has two for one wheel")

    def _wheel_of(self, history: TorqueHistory) -> int:
        for k, wheel in enumerate(self.platform.wheels):
            if wheel.axis == history.wheel.axis:
                return k
        raise ValueError(f"torques: {self.platform.name} has no wheel about {history.wheel.axis}")

    @property
    def histories(self) -> tuple[TorqueHistory | None, ...]:
        """The torque of each of three wheels, None where there is none."""
        found: list[TorqueHistory | None] = [None, None, None]
        for history in self.torques:
            found[self._wheel_of(history)] = history
        return tuple(found)

    @property
    def weight(self) -> Array:
        """The force of gravity on the surface [N], shape (3,)."""
        mass = self.platform.mass + self.counterweight
        if isinstance(self.gravity, int | float):
            return np.array([0.0, 0.0, -mass * self.gravity])
        return mass * np.asarray(self.gravity, dtype=float)

    def motion(self) -> Motion:
        """Its equations of motion."""
        law, given = find_law(self.ground), self.ground_parameters
        return Motion(
            self.platform, law=law, numbers=law.numbers(given), rebound=law.rebound(given) or 1.0,
            loss=law.loss(given), mu_s=self.mu_s, mu_d=self.sliding_friction, weight=self.weight,
            counterweight=self.counterweight,
        )  # fmt: skip


@dataclass(frozen=True, kw_only=True, eq=False)
class SpatialTrajectory:
    """A motion sampled at `time`, world axes, z up; SI units."""

    trial: SpatialTrial
    time: Array  # [s], shape [sample_count]
    position: Array  # Of the centre of mass [m], shape [sample_count, 3]
    quaternion: Array  # Unit, scalar first, body to world, shape [sample_count, 4]
    velocity: Array  # [m/s], shape [sample_count, 3]
    angular_velocity: Array  # World axes [rad/s], shape [sample_count, 3]
    momentum: Array  # (m v_x, m v_y, (m + m_b) v_z) [N s], shape [sample_count, 3]
    angular_momentum: Array  # Of platform and wheels about the centre of mass [N m s], shape [sample_count, 3]
    wheel_speed: Array  # Absolute, along the wheels' axes [rad/s], shape [sample_count, 3]; 0 where there is no wheel
    touching: NDArray[np.int64]  # How many tips touch, shape [sample_count]
    sticking: NDArray[np.int64]  # How many of them stick, shape [sample_count]
    kinetic_energy: Array
    potential_energy: Array
    stored_energy: Array
    torque_work: Array  # Work of the torques on the platform since t = 0 [J], as the next two of shape [sample_count]
    dissipated: Array  # In ground and friction since t = 0 [J]
    transitions: tuple[tuple[float, int, int], ...]  # (time [s], tips that touch, tips that stick) at every change
    energy_residual: float
    """Largest |E(t) - E(0) - work of the torques + dissipated| over max(|work of the torques|, W reach, E(0)) [1]."""
    events: int
    forced_steps: int  # Steps taken without looking for events, where too many came at once
    stalls: int  # How often tips that crept along were made to stick or to keep their direction (`rigid.spatial.steps`)

    @property
    def energy(self) -> Array:
        """E(t) [J], shape [sample_count]."""
        return self.kinetic_energy + self.potential_energy + self.stored_energy

    @property
    def turn(self) -> Array:
        """theta of the planar model: how far body x has turned about y, down from world x [rad], [sample_count]."""
        forward = np.array([to_matrix(q)[:, 0] for q in self.quaternion])
        return np.unwrap(np.arctan2(-forward[:, 2], forward[:, 0]))


def standing(trial: SpatialTrial) -> tuple[Array, Array]:
    """Position [m] and quaternion at rest on its lowest tips. Raises ValueError where it cannot stand.

    Balance of the forces along z and of the moments about x and y, friction at the tips holding what gravity has along
    the ground.
    """
    platform, motion = trial.platform, trial.motion()
    stance = platform.stance()
    feet = [*stance.row, *stance.rear]
    weight = trial.weight
    if weight[2] >= 0:
        raise ValueError(f"gravity = {trial.gravity} does not pull onto the ground: nothing stands on it")
    load, low, high = -weight[2] / len(feet), 0.0, 1e-9
    while motion.normal(high, 0.0, high) < load:
        low, high = high, 2 * high
        if high > platform.reach:
            raise ValueError(f"{trial.ground} does not carry {load:.3g} N a tip: the platform sinks in")
    for _ in range(200):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if motion.normal(middle, 0.0, middle) < load else (low, middle)
    height = -float(motion.tips[feet[0], 2]) - high
    length = stance.spike_length

    def imbalance(unknown: Array) -> Array:
        """Force along z and moments about x, y that are left, over weight (and length)."""
        turn = to_matrix(from_turn([unknown[1] * high / length, unknown[2] * high / length, 0.0]))
        arms = motion.tips[feet] @ turn.T
        depths = -(height - unknown[0] * high + arms[:, 2])
        loads = np.array([motion.normal(float(d), 0.0, float(d)) if d > 0 else 0.0 for d in depths])
        total = loads.sum()
        mean = loads @ arms / total if total > 0 else arms.mean(axis=0)
        moment_x = float(loads @ arms[:, 1]) + mean[2] * weight[1]
        moment_y = -float(loads @ arms[:, 0]) - mean[2] * weight[0]
        return np.array([total + weight[2], moment_x / length, moment_y / length]) / -weight[2]

    if np.abs(imbalance(np.zeros(3))).max() > 1e-13:
        solved: Any = root(imbalance, np.zeros(3), method="hybr", tol=1e-14)
        unknown = np.asarray(solved.x)
        if np.abs(imbalance(unknown)).max() > 1e-9:
            raise ValueError(f"the platform does not stand: it tips over under gravity = {trial.gravity}")
    else:
        unknown = np.zeros(3)
    if math.hypot(weight[0], weight[1]) > trial.mu_s * -weight[2]:
        raise ValueError(f"the platform does not stand: it slides, mu_s = {trial.mu_s} under gravity = {trial.gravity}")
    quaternion = from_turn([unknown[1] * high / length, unknown[2] * high / length, 0.0])
    return np.array([0.0, 0.0, height - float(unknown[0]) * high]), quaternion


def simulate(
    trial: SpatialTrial,
    *,
    duration: float,
    sample_interval: float = 1e-3,
    times: ArrayLike | None = None,
    position: Sequence[float] | None = None,
    quaternion: Sequence[float] | None = None,
    velocity: Sequence[float] = (0.0, 0.0, 0.0),
    angular_velocity: Sequence[float] = (0.0, 0.0, 0.0),
    tolerance: float = 1e-8,
    time_step: float | None = None,
) -> SpatialTrajectory:
    """Integrate `trial` from a state, by default from where it stands at rest; the torques start at t = 0.

    Args:
        trial: its numbers.
        duration: end [s].
        sample_interval: between samples [s], the end included.
        times: sample times [s] instead, rising, within 0 to `duration`.
        position: of the centre of mass [m]; None: standing.
        quaternion: unit, scalar first, body to world; None: upright, or as it stands.
        velocity: [m/s].
        angular_velocity: world axes [rad/s].
        tolerance: relative error of a step.
        time_step: a fixed step [s] (events are located all the same) instead of one that follows `tolerance`.

    Raises ValueError: what cannot be, named. RuntimeError: the motion is no longer finite.
    """
    check_above_zero(duration=duration, sample_interval=sample_interval, tolerance=tolerance)
    if time_step is not None:
        check_above_zero("s", time_step=time_step)
    samples = sample_times(duration, sample_interval, times, strict=True)
    motion = trial.motion()
    z = _start(trial, motion, position, quaternion, velocity, angular_velocity)
    run = Integration(motion, trial.histories, trial.torque_in_flight, z, tolerance=tolerance, time_step=time_step)
    rows, counts, energies = np.empty((len(samples), STATE_COUNT)), [], []
    reach = trial.platform.reach
    energy_0 = sum(motion.energy(run.z, run.modes))
    scale, worst, most = float(np.linalg.norm(trial.weight)) * reach, 0.0, 0.0
    done = 0
    while done < len(samples) or run.time < duration:
        target = samples[done] if done < len(samples) else duration
        if run.time >= target:  # the step has just ended there
            rows[done], done = run.z, done + 1
            counts.append((len(run.modes.touching), len(run.modes.sticking)))
            energies.append(motion.energy(run.z, run.modes))
            continue
        run.advance(target)
        total = sum(motion.energy(run.z, run.modes))
        work = float(run.z[[TORQUE_WORK, GROUND_WORK, FRICTION_WORK]].sum())
        stored = motion.energy(run.z, run.modes)[2]
        worst = max(worst, abs((total - stored) - (energy_0 - run.stored_0) - work))
        most = max(most, abs(float(run.z[TORQUE_WORK])))
    kinetic, potential, stored_all = (np.array(column) for column in zip(*energies, strict=True))
    spins = [motion.turning(z)[1] for z in rows]
    inertias = [wheel.inertia for wheel in trial.platform.wheels] + [math.inf] * 3
    lost = -(rows[:, GROUND_WORK] + rows[:, FRICTION_WORK]) - (stored_all - run.stored_0)
    return SpatialTrajectory(
        trial=trial, time=samples, position=rows[:, R], quaternion=rows[:, Q], velocity=rows[:, P] / motion.masses,
        angular_velocity=np.array(spins), momentum=rows[:, P], angular_momentum=rows[:, L],
        wheel_speed=rows[:, H] / np.array(inertias[:3]), touching=np.array([c[0] for c in counts]),
        sticking=np.array([c[1] for c in counts]), kinetic_energy=kinetic, potential_energy=potential,
        stored_energy=stored_all, torque_work=rows[:, TORQUE_WORK], dissipated=lost,
        transitions=tuple(run.transitions), energy_residual=worst / max(most, scale, abs(energy_0), 1e-300),
        events=run.events, forced_steps=run.forced_steps, stalls=run.stalls,
    )  # fmt: skip


def _start(
    trial: SpatialTrial, motion: Motion, position: Numbers | None, quaternion: Numbers | None, velocity: Numbers,
    spin: Numbers,
) -> Array:  # fmt: skip
    z = np.zeros(STATE_COUNT)
    z[Q] = (1.0, 0.0, 0.0, 0.0)
    if position is None:
        if quaternion is not None:
            raise ValueError("quaternion is given without position: a platform that stands has its own")
        z[R], z[Q] = standing(trial)
    else:
        z[R] = position
        if quaternion is not None:
            size = float(np.linalg.norm(quaternion))
            if not abs(size - 1) < 1e-6:
                raise ValueError(f"quaternion has length {size}: it must be 1")
            z[Q] = np.asarray(quaternion, dtype=float) / size
    turn = to_matrix(z[Q])
    z[P] = motion.masses * velocity
    z[L] = turn @ trial.platform.inertia @ turn.T @ np.asarray(spin, dtype=float)
    for k, history in enumerate(trial.histories):
        if history is not None:
            z[H.start + k] = history.spin
            z[L] += history.spin * (turn @ np.asarray(trial.platform.wheels[k].axis))
    if not np.isfinite(z).all():
        raise ValueError("the start must be finite numbers")
    return z
