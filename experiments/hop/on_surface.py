"""The same hop from compliant ground: the planar model with K and C under the tips, events located in time.

Hop theory has rigid ground. A spring-damper returns part of its energy when the platform leaves. Tips that
stick then leave more steeply; tips that slide keep the angle given by friction and leave faster.
"""

import math
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from rigid.hop import Flight, Launch, flight
from rigid.model.trial import Trial
from rigid.planar.simulate import simulate
from rigid.planar.trajectory import Trajectory

from .numbers import HopPlan

__all__ = ["SurfaceHop", "flight_path", "hop_on_surface", "hop_trial", "wheel_speed_on_surface"]

ROWS = 600
"""Rows of the launch that are kept."""
CLOSE = 1e-4
"""How close, as a share, the sought wheel speed brings the model to the distance."""


@dataclass(frozen=True, kw_only=True)
class SurfaceHop:
    """Result of the planar model with the same torque and wheel."""

    launch: Launch | None  # None: it does not leave the ground for good
    flight: Flight | None  # None: it does not leave the ground, or does not come down
    trajectory: Trajectory  # from the start of the torque until a little after it has left
    slides: bool = False  # whether no tip stuck from the start of the torque until it left


def hop_trial(plan: HopPlan, *, torque: float, wheel_speed: float | None) -> Trial | None:
    """The planar trial: a brake on a wheel at `wheel_speed` [rad/s], or a motor from rest where that is None.

    None for a platform whose rows of tips are not at equal angles. Raises ValueError for numbers that cannot be.
    """
    if plan.spike_count is None:
        return None
    t, wheel = plan.tumbler, plan.wheel
    actuation: dict[str, float | str] = {"actuator": "brake", "wheel_speed_0": wheel_speed or 0.0}
    if wheel_speed is None:
        actuation = {"actuator": "motor", "torque_until": wheel.inertia * wheel.max_speed / torque}
    return Trial(
        mass=t.mass, inertia=t.inertia, spike_length=t.spike_length, spike_count=plan.spike_count,
        stiffness=plan.stiffness, damping=plan.damping, mu_s=t.mu_s, mu_d=t.sliding_friction, gravity_sim=t.gravity,
        gravity=t.gravity, torque=torque, wheel_inertia=wheel.inertia, ground=plan.law,
        **actuation,  # type: ignore[arg-type]
    )  # fmt: skip


def hop_on_surface(trial: Trial, *, expected_time: float, longest: float, radius: float | None) -> SurfaceHop:
    """Integrate `trial` until the platform is clear of the ground, or for `longest` [s], and follow its longest hop.

    `expected_time`: when rigid ground would have been left [s]; `radius`: of the body [m], None for flat ground. Raises
    ValueError for a platform that cannot stand on this ground, RuntimeError where the motion is no longer finite.
    """
    duration = min(2 * expected_time + 0.5, longest)
    while True:
        run = simulate(trial, duration=duration, sample_interval=duration / ROWS)
        clear = run.state_names[-1] == "hop" and run.y[-1] > trial.spike_length and run.vy[-1] > 0
        if clear or duration >= longest:
            break
        duration = min(2 * duration, longest)
    changes = [(float(time), state) for time, state, _ in run.transitions]
    hops = [(a, b) for (a, state), (b, _) in pairwise([*changes, (duration, "end")]) if state == "hop" and b > a]
    if not hops:
        return SurfaceHop(launch=None, flight=None, trajectory=run)
    left, down = max(hops, key=lambda hop: hop[1] - hop[0])
    shown = min(duration, max(1.4 * left, left + 0.02))
    trajectory = simulate(trial, duration=shown, sample_interval=shown / ROWS)
    # Nothing but gravity acts in a hop: back from its middle to where it began.
    middle = simulate(trial, duration=down, times=[0.5 * (left + down)])
    vx = float(middle.vx[0])
    vy = float(middle.vy[0]) + trial.gravity_sim * (0.5 * (left + down) - left)
    before = next((state for time, state in reversed(changes) if time < left), "stand")
    slides = {state for time, state in changes if 0 <= time < left} <= {"stand", "slip", "hop"} and before == "slip"
    angle = math.atan2(vy, vx)
    launch = Launch(
        speed=math.hypot(vx, vy), angle=angle, spin=float(middle.omega[0]), slid=before == "slip",
        rotation=next(float(theta) for time, _, theta in run.transitions if time == left), time=left,
    )  # fmt: skip
    if not 0 <= angle <= math.pi:
        return SurfaceHop(launch=None, flight=None, trajectory=trajectory)
    flown = flight(launch.speed, angle, gravity=trial.gravity_sim, radius=radius)
    return SurfaceHop(launch=launch, flight=flown, trajectory=trajectory, slides=slides)


def wheel_speed_on_surface(
    trial: Trial,
    start: SurfaceHop,
    *,
    distance: float,
    max_speed: float,
    longest: float,
    radius: float | None,
    brake_time: float | None = None,
) -> float | None:
    """The speed [rad/s] of a braked wheel whose hop from this ground goes `distance` [m], to 1e-4 of it.

    The launch speed of a short brake scales with the wheel's, the distance with its square: from the hop `start` that
    `trial` makes, the wheel's speed is scaled by sqrt(distance / found) until it fits. None where that fails within
    `max_speed` [rad/s]: the platform leaves before a faster wheel has stopped, or not at all. With a `brake_time` [s]
    the torque follows the wheel's speed; without one it stays.
    """
    speed, found = trial.wheel_speed_0, start
    for _ in range(20):
        if found.launch is None:
            return None
        reached = found.flight.distance if found.flight is not None else math.inf
        if reached <= 0:
            return None
        if abs(reached / distance - 1) <= CLOSE:
            return speed
        speed *= min(max(math.sqrt(distance / reached), 0.7), 1.5)
        if speed > max_speed:
            return None
        torque = trial.torque if brake_time is None else trial.wheel_inertia * speed / brake_time
        faster = replace(trial, wheel_speed_0=speed, torque=torque)
        found = hop_on_surface(faster, expected_time=found.launch.time, longest=longest, radius=radius)
    return None


def flight_path(
    launch: Launch, flown: Flight, *, gravity: float, radius: float | None, count: int = 200
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The flight from launch to landing: distance along the ground and height [m], each of shape [count].

    A parabola on flat ground; about a round body the ellipse r = p / (1 - e cos(phi - phi_peak)) with p = v_x^2 / g.
    """
    along = np.linspace(0.0, flown.distance, count)
    c = math.cos(launch.angle)
    if radius is None or c == 0:
        share = np.linspace(0.0, 1.0, count)
        return along, 4 * flown.height * share * (1 - share)
    q = launch.speed**2 / (gravity * radius)
    eccentricity = math.sqrt(max(0.0, 1 - q * (2 - q) * c * c))
    around = along / radius
    # r - R with the difference taken first: a hop is small against the body.
    half = 0.5 * around[-1]
    bend = eccentricity * (np.cos(around - half) - math.cos(half))
    height = radius * bend / (q * c * c - bend)
    return along, np.maximum(height, 0.0)
