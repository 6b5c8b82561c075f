"""Search of a hop: the smallest effort for a distance on rigid ground, or the distance of a given effort.

For a brake the torque is given and the wheel's speed is searched, for a motor the torque. A distance that is impossible
on rigid ground is refused; the message states what each ground allows.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rigid.hop import Flight, Launch, Tumbler, brake_launch, flight, impulsive_launch, launch, launch_speed_for

from .numbers import HopPlan, plan_hop
from .on_surface import hop_on_surface, hop_trial
from .settings import HopSettings, say

__all__ = ["Hop", "Means", "find_hop", "hop_by", "longest_flight", "means_of"]

SCAN = 80
"""Points between the least and the most that the actuator can do, to find where the distance lies."""
SURFACE_SCAN = 6
"""Points among which the planar model's longest hop is found, for a refusal."""
LEAST_HOP = 0.1
"""A hop shorter than this share of the spike length is not stated in a refusal [1]."""
HALVINGS = 8
"""How often the stretch between two of them is halved, where the distance lies in it."""
GRAVITIES = 16
"""How often gravity is halved or doubled, until a refusal can name one with which the hop is possible."""
BEYOND = 10.0
"""How many times what a distance takes at once, or from the energy, is looked through where no limit is known."""


@dataclass(frozen=True, kw_only=True)
class Hop:
    """One hop: what the actuator did, how the platform left, how it flew (None: it does not come down)."""

    effort: float  # wheel speed of a brake [rad/s], torque of a motor [N m]
    torque: float  # on the platform [N m]
    launch: Launch
    flight: Flight | None


@dataclass(frozen=True, kw_only=True)
class Means:
    """Range of the actuator's effort."""

    leave: Callable[[float], Launch | None]
    torque: Callable[[float], float]  # of an effort [N m]
    least: float
    most: float
    what: str  # in words, at its most
    unit: str


def find_hop(settings: HopSettings, platform_file: Path | None = None) -> tuple[HopPlan, Hop]:
    """The numbers, and the hop over the distance or by the means given; `platform_file` as in `plan_hop`.

    Raises ValueError for numbers that cannot be, and for a distance or means with which there is no hop.
    """
    plan = plan_hop(settings, platform_file)
    try:
        means = means_of(plan, settings)
    except _TooWeakError as error:
        raise ValueError(f"{error}{_other_gravity(settings, _possible, (0.5,))}") from None
    if settings.asks_for == "distance":
        return plan, _search(settings, plan, means)
    key, effort = ("wheel_speed_0", settings.wheel_speed_0) if settings.wheel_speed_0 else ("torque", settings.torque)
    assert effort is not None
    found = hop_by(settings, means, effort)
    if found is None:
        efforts = [float(each) for each in np.geomspace(means.least, means.most, SCAN)]
        enough = next((each for each in efforts if hop_by(settings, means, each) is not None), None)
        would = "nor does any other" if enough is None else f"from some {enough:.3g} {means.unit} on it does"
        where = say("where", t=plan.tumbler)
        would += _same_on_surface(settings, plan, means, effort) + _other_gravity(settings, _possible, (0.5, 2.0))
        raise ValueError(say("no_hop", key=key, effort=effort, unit=means.unit, where=where, would=would))
    return plan, found


def _same_on_surface(settings: HopSettings, plan: HopPlan, means: Means, speed: float) -> str:
    """Message on the planar model by a wheel at `speed` [rad/s] that is too slow for a hop from rigid ground; or ""."""
    if settings.actuator != "brake" or plan.spike_count is None:
        return ""
    torque = means.torque(speed)
    trial, braked = hop_trial(plan, torque=torque, wheel_speed=speed), plan.wheel.inertia * speed / torque
    assert trial is not None
    there = hop_on_surface(trial, expected_time=braked, longest=2 * braked + 2.0, radius=settings.body_radius)
    if there.flight is None or there.flight.distance < LEAST_HOP * plan.tumbler.spike_length:
        return ""
    return say("hops_on_surface", plan=plan, flight=there.flight)


def longest_flight(plan: HopPlan, left: Launch) -> float:
    """Longest time to step the planar model [s], from the flight on rigid, flat ground."""
    return 2 * left.time + 0.5 + 0.5 * flight(left.speed, left.angle, gravity=plan.tumbler.gravity).time  # type: ignore[union-attr]


class _TooWeakError(ValueError):
    """A torque that does not tip the platform at this gravity."""


def _possible(settings: HopSettings, plan: HopPlan, means: Means) -> bool:
    """Whether the hop that was asked for is possible on rigid ground."""
    if plan.distance is not None:
        found, _ = _seek(settings, means, plan.distance)
        return found is not None and _reaches(found, plan.distance)
    effort = settings.wheel_speed_0 or settings.torque
    return effort is not None and hop_by(settings, means, effort) is not None


def means_of(plan: HopPlan, settings: HopSettings) -> Means:
    """What the actuator can do. Raises ValueError where it cannot tip the platform."""
    return _by_brake(plan, settings) if settings.actuator == "brake" else _by_motor(plan, settings)


def _other_gravity(
    settings: HopSettings, works: Callable[[HopSettings, HopPlan, Means], bool], factors: Sequence[float]
) -> str:
    """For a refusal: the nearest gravity that `works`, each of `factors` taken once and more; "" if none is found."""
    for power in range(1, GRAVITIES + 1):
        for factor in factors:
            gravity = float(f"{settings.gravity * factor**power:.2g}")
            other = settings.model_copy(update={"gravity": gravity})
            try:
                plan = plan_hop(other)
                if works(other, plan, means_of(plan, other)):
                    return say("other_gravity", gravity=gravity)
            except (ValueError, RuntimeError):
                continue
    return ""


def _by_brake(plan: HopPlan, settings: HopSettings) -> Means:
    tumbler, wheel, time = plan.tumbler, plan.wheel, plan.brake_time
    most, limit = wheel.max_speed, "its largest speed"
    if math.isinf(most):
        most, limit = max(BEYOND * _impulsive_speed(plan, settings), settings.wheel_speed_0 or 0.0), "no limit known"

    def torque(speed: float) -> float:
        return plan.numbers["torque"].value if time is None else wheel.inertia * speed / time

    if torque(most) <= tumbler.tipping_torque:
        raise _too_weak("torque", torque(most), tumbler)
    slowest = 0.0 if time is None else time * tumbler.tipping_torque / wheel.inertia * (1 + 1e-6)
    what = "brake_means" if time is None else "timed_brake_means"
    return Means(
        leave=lambda speed: brake_launch(tumbler, wheel.inertia * speed, torque(speed)), torque=torque,
        least=max(1e-4 * most, slowest), most=most, unit="rad/s",
        what=say(what, plan=plan, torque=torque(most), most=most, limit=limit),
    )  # fmt: skip


def _by_motor(plan: HopPlan, settings: HopSettings) -> Means:
    tumbler, wheel = plan.tumbler, plan.wheel
    most, limit = wheel.motor_torque, "its largest"
    if math.isinf(most):
        # The work H omega / 2 of a launch that takes no time, done over the lean, and as much as tips it.
        speed = _impulsive_speed(plan, settings)
        work = 0.5 * wheel.inertia * speed * impulsive_launch(tumbler, wheel.inertia).spin * speed
        most, limit = BEYOND * (work / tumbler.lean + tumbler.tipping_torque), "no limit known"
    if most <= tumbler.tipping_torque:
        raise _too_weak("the motor's torque", most, tumbler)
    if settings.torque is not None and settings.torque <= tumbler.tipping_torque:
        raise _too_weak("torque", settings.torque, tumbler)
    return Means(
        leave=lambda torque: launch(tumbler, torque, wheel.inertia * wheel.max_speed / torque),
        torque=lambda torque: torque, least=tumbler.tipping_torque * (1 + 1e-6), most=most,
        what=say("motor_means", most=most, limit=limit), unit="N m",
    )  # fmt: skip


def _too_weak(key: str, torque: float, tumbler: Tumbler) -> _TooWeakError:
    """The refusal of a torque that does not tip; it tips below the gravity at which W l sin(lean) is as large."""
    most = tumbler.gravity * torque / tumbler.tipping_torque
    return _TooWeakError(say("does_not_tip", key=key, torque=torque, t=tumbler, most=most))


def _impulsive_speed(plan: HopPlan, settings: HopSettings) -> float:
    """The wheel's speed for the distance by a brake that takes no time [rad/s]."""
    sudden = impulsive_launch(plan.tumbler, plan.wheel.inertia)
    gravity, radius = settings.gravity, settings.body_radius
    wanted = plan.distance if plan.distance is not None else 1.0  # any, to bound what is looked through
    return launch_speed_for(wanted, sudden.angle, gravity=gravity, radius=radius) / sudden.speed


def hop_by(settings: HopSettings, means: Means, effort: float) -> Hop | None:
    """The hop by this effort; None if it does not leave rigid ground."""
    try:
        left = means.leave(effort)
    except RuntimeError as error:
        raise ValueError(str(error)) from error
    if left is None or left.angle <= 0:
        return None
    return Hop(
        effort=effort, torque=means.torque(effort), launch=left,
        flight=flight(left.speed, left.angle, gravity=settings.gravity, radius=settings.body_radius),
    )  # fmt: skip


def _search(settings: HopSettings, plan: HopPlan, means: Means) -> Hop:
    """The smallest effort whose hop reaches the distance on rigid ground. Raises ValueError if none does."""
    distance = plan.distance
    assert distance is not None
    found, reach = _seek(settings, means, distance)
    if found is not None and _reaches(found, distance):
        return found
    where = say("where", t=plan.tumbler)
    other = _other_gravity(settings, _possible, (0.5,) if found is None else (2.0,))
    if found is None:
        way = f"hops {reach:.4g} m at most" if reach > 0 else "does not make it leave the ground"
        there = _on_surface(settings, plan, means) + other
        raise ValueError(say("too_far", distance=distance, what=means.what, way=way, where=where, on_surface=there))
    if found.flight is None:
        raise ValueError(say("next_escapes", distance=distance) + other)
    raise ValueError(say("too_short", distance=distance, shortest=found.flight.distance, where=where) + other)


def _reaches(found: Hop, distance: float) -> bool:
    """Whether the hop lands at the distance [m], and not beyond it after a jump of what the effort does."""
    return found.flight is not None and abs(found.flight.distance - distance) <= 1e-6 * distance


def _seek(settings: HopSettings, means: Means, distance: float) -> tuple[Hop | None, float]:
    """The hop by the smallest effort that goes as far as `distance` or beyond, or None; and the longest one [m]."""

    def missed(effort: float) -> float:
        found = hop_by(settings, means, effort)
        if found is None:
            return -distance
        return (found.flight.distance if found.flight else math.inf) - distance

    efforts = np.geomspace(means.least, means.most, SCAN)
    beyond = [missed(float(effort)) for effort in efforts]
    first = next((k for k, over in enumerate(beyond) if over >= 0), None)
    if first is None:
        return None, max(beyond) + distance
    low, high = float(efforts[max(first - 1, 0)]), float(efforts[first])
    while high - low > 1e-13 * high and low < (middle := 0.5 * (low + high)) < high:  # halving gets over jumps too
        low, high = (middle, high) if missed(middle) < 0 else (low, middle)
    return hop_by(settings, means, high), math.inf


def _on_surface(settings: HopSettings, plan: HopPlan, means: Means) -> str:
    """Message on the planar model for a distance that is impossible on rigid ground."""
    by_brake, distance = settings.actuator == "brake", plan.distance
    assert distance is not None
    if plan.spike_count is None:
        return say("not_taken", plan=plan)

    def reach(effort: float) -> float:
        left = means.leave(effort)
        trial = hop_trial(plan, torque=means.torque(effort), wheel_speed=effort if by_brake else None)
        if trial is None or left is None or left.angle <= 0:
            return 0.0
        longest = longest_flight(plan, left)
        there = hop_on_surface(trial, expected_time=left.time, longest=longest, radius=settings.body_radius)
        if there.launch is None:
            return 0.0
        return there.flight.distance if there.flight is not None else math.inf

    efforts = [float(effort) for effort in np.geomspace(0.1 * means.most, means.most, SURFACE_SCAN)]
    far = [reach(effort) for effort in efforts]
    if max(far) <= 0:
        return say("not_on_surface", plan=plan)
    if max(far) < distance:
        return say("most_on_surface", plan=plan, most=max(far))
    first = next(k for k, gone in enumerate(far) if gone >= distance)
    low, high = (efforts[first - 1] if first else 0.0), efforts[first]
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if reach(middle) < distance else (low, middle)
    return say("brake_on_surface" if by_brake else "motor_on_surface", plan=plan, effort=high)
