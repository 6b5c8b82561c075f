"""What a platform gives a tumble: its numbers in the plane, and how far its motor, brake and wheel can go.

The wheel's limit is one rule, here as in `rigid.spatial`: a start above it is refused, and a motor whose wheel comes to
it gives no more torque. It is the limit of the platform's own wheel; of another nothing is known.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from rigid.planar import simulate
from rigid.platform import Platform
from rigid.platform_files import find_platform
from rigid.trajectory import Trajectory
from rigid.trial import Trial

__all__ = [
    "Number",
    "PlatformNumbers",
    "check_actuation",
    "defaults_said",
    "platform_numbers",
    "torque_within_limit",
    "wheel_limit",
]

SPIKE_LENGTHS = {"hedgehog": 0.2}
"""l [m] where the paper gives it: its octagon is 0.4 m across, and the edge of 0.153 m is rounded."""


@dataclass(frozen=True)
class Number:
    """One number of a trial: value, unit, and where it comes from ("given", "default", "surface steel", ...)."""

    value: float
    unit: str
    origin: str


def defaults_said(choices: Mapping[str, str], numbers: Mapping[str, Number]) -> list[str]:
    """One line for each choice at its default and each number that was not given: every default is said."""
    lines = [f"{name} = {value} (default)" for name, value in choices.items()]
    for name, number in numbers.items():
        if number.origin != "given":
            unit = "" if number.unit == "1" else f" {number.unit}"
            lines.append(f"{name} = {number.value:.6g}{unit} ({number.origin})")
    return lines


@dataclass(frozen=True)
class PlatformNumbers:
    """What the planar model takes from a platform, and what its wheel can do."""

    name: str
    mass: float
    inertia: float
    spike_length: float
    spike_count: int
    wheel_inertia: float
    motor_torque: float
    brake_torque: float
    max_wheel_speed: float


def platform_numbers(name: str) -> PlatformNumbers:
    """The numbers of a platform that ships, by name, or of the TOML file `name`.

    Raises ValueError for one there is not, and for one that is no regular polygon seen from the side.
    """
    platform = find_platform(name)
    wheel = platform.wheel()
    return PlatformNumbers(
        name,
        platform.mass,
        platform.moment(),
        SPIKE_LENGTHS.get(name, platform.stance().spike_length),
        _spike_count(name, platform),
        wheel.inertia,
        wheel.motor_torque,
        wheel.brake_torque,
        wheel.max_speed,
    )


def _spike_count(name: str, platform: Platform) -> int:
    """Rows of tips on the circle about the wheel's axis. Raises ValueError where they are not at equal angles."""
    across, lean = platform.tips[:, [0, 2]], platform.stance().lean
    far = np.hypot(across[:, 0], across[:, 1])
    reach = float(far.max())
    rows = np.unique(np.round(np.degrees(np.arctan2(across[:, 0], -across[:, 1]))[far > reach * (1 - 1e-6)] % 360, 6))
    apart = np.diff([*rows, rows[0] + 360])
    if np.abs(apart - 2 * math.degrees(lean)).max() > 1e-4:
        gaps = " and ".join(f"{gap:.3g}" for gap in dict.fromkeys(np.round(apart, 3)))
        raise ValueError(
            f"platform = {name!r} cannot be tumbled in the plane: seen from the side its {len(rows)} rows of tips are "
            f"{gaps} degrees apart, and the planar model has them at equal angles about the wheel's axis; "
            f"rigid.simulate_spatial takes such a platform"
        )
    between = far[far <= reach * (1 - 1e-6)]
    if len(between) and between.max() > reach * math.cos(lean):
        raise ValueError(
            f"platform = {name!r} cannot be tumbled in the plane: tips {between.max():.3g} m from the wheel's axis "
            f"stand out between the rows that it tumbles over, {reach:.3g} m from it; rigid.simulate_spatial takes "
            f"such a platform"
        )
    return len(rows)


def wheel_limit(given: float | None, platform: PlatformNumbers, *, own_wheel: bool, in_model: bool) -> Number:
    """The largest speed of the wheel [rad/s]: as given, else that of the platform's own wheel, else unknown (inf)."""
    if given is not None:
        return Number(given, "rad/s", "given")
    if in_model:
        return Number(math.inf, "rad/s", "a model says nothing of it")
    if not own_wheel:
        return Number(math.inf, "rad/s", f"wheel_inertia is given: not the wheel of {platform.name}")
    return Number(platform.max_wheel_speed, "rad/s", f"platform {platform.name}")


def check_actuation(
    actuator: Literal["motor", "brake"],
    platform: PlatformNumbers,
    numbers: Mapping[str, Number],
    limit: Number,
    *,
    in_model: bool = False,
) -> list[str]:
    """What has to be said of torque and wheel.

    A brake beyond the platform's own is no more than said: it is an impulse in the limit. So is a motor's torque of a
    model, which says nothing of its platform's motor (`in_model`). Raises ValueError, naming the setting, for a torque
    beyond the motor, and for a wheel that starts beyond its limit.
    """
    torque, speed = numbers["torque"].value, numbers["wheel_speed_0"].value
    if speed > limit.value:
        raise ValueError(
            f"wheel_speed_0 = {speed:g} rad/s is beyond max_wheel_speed = {limit.value:g} rad/s ({limit.origin}): at "
            f"most that would do, or a max_wheel_speed above it"
        )
    if actuator == "motor" and torque > platform.motor_torque * (1 + 1e-9):
        beyond = (
            f"torque = {torque:g} N m is beyond the motor of platform = {platform.name!r}: at most "
            f"{platform.motor_torque:g} N m would do, or actuator = brake with a wheel_speed_0, or a platform with a "
            f"stronger one"
        )
        if not in_model:
            raise ValueError(beyond)
        return [beyond]
    if actuator == "brake" and torque > platform.brake_torque * (1 + 1e-9):
        return [f"torque = {torque:g} N m is beyond the brake of {platform.name}, {platform.brake_torque:g} N m"]
    return []


def torque_within_limit(
    trial: Trial, *, max_wheel_speed: float, duration: float, method: Any = "located"
) -> tuple[Trial, float | None]:
    """`trial` with its torque ended where a motor's wheel comes to `max_wheel_speed` [rad/s], and when that is [s].

    None, and the trial as it is, where the wheel does not come to it within `duration` [s]. The wheel only gains speed,
    so that ending the torque at that moment is the same as a motor that has none left from then on.
    """
    gain = trial.torque / trial.wheel_inertia
    if trial.actuator != "motor" or trial.wheel_speed_0 + gain * min(duration, trial.torque_until) <= max_wheel_speed:
        return trial, None
    run = simulate(trial, duration=duration, method=method, sample_interval=min(1e-3, duration))
    if run.wheel_speed[-1] <= max_wheel_speed:
        return trial, None
    time = _when(run, max_wheel_speed)
    return replace(trial, torque_until=time), time


def _when(run: Trajectory, speed: float) -> float:
    """When the wheel comes to `speed` [s]. Between two rows it gains evenly while a spike touches, and nothing else."""
    last = int(np.argmax(run.wheel_speed > speed))
    first = max(last - 1, 0)
    changes = [(float(time), state) for time, state, _ in run.transitions if time < run.time[last]]
    state = next((state for time, state in reversed(changes) if time <= run.time[first]), "stand")
    edges, touching = [float(run.time[first])], [state != "hop"]
    for time, state in changes:
        if time > run.time[first]:
            edges.append(time)
            touching.append(state != "hop")
    spans = np.diff([*edges, float(run.time[last])]) * touching
    gained = run.wheel_speed[last] - run.wheel_speed[first]
    left = (speed - run.wheel_speed[first]) / gained * float(spans.sum())
    for edge, span in zip(edges, spans, strict=True):
        if left <= span and span > 0:
            return edge + float(left)
        left -= span
    return float(run.time[last])
