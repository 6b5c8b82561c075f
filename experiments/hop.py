"""Hop theory as a tool: the wheel speed that a hop over a distance takes, the launch, the flight, how near escape is.

The launch is that of `rigid.hop`, on rigid ground. Under a brake the torque is known and the wheel's speed is sought,
under a motor the torque; a motor's wheel then turns as fast as it has become when the platform leaves.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from hedgebed import __version__
from rigid.hop import (
    Flight,
    Launch,
    Tumbler,
    brake_launch,
    escape_speed,
    flight,
    impulsive_launch,
    launch,
    launch_speed_for,
    least_viable_angle,
)
from rigid.platform import Platform
from rigid.platform_files import find_platform

from .hop_settings import HopSettings
from .progress import Progress
from .runfolder import RunFolder
from .whole_runs import whole_run

__all__ = ["check", "resume", "run"]

NEAR_ESCAPE = 0.5
"""From this share of the escape speed on it is said to be near: a quarter of the energy, and high enough a hop to see
how gravity falls with height."""
SCAN = 80
"""Points between the least and the most that the actuator can do, to find where the distance lies."""


@dataclass(frozen=True, kw_only=True)
class Hop:
    """One hop: what the actuator did, how the platform left, how it flew (None: it does not come down)."""

    effort: float
    """Wheel speed of a brake [rad/s], torque of a motor [N m]."""
    launch: Launch
    flight: Flight | None


def check(settings: HopSettings) -> None:
    """Raise ValueError, naming key, value and what would do, for a platform there is not or a hop that cannot be."""
    _find(settings)


def _carry_out(settings: HopSettings, folder: RunFolder, progress: Progress) -> dict[str, Any]:
    with folder.lock():
        progress.stage("hop", total=1.0)
        result = _result(settings, *_find(settings))
        folder.write_result(result)
        progress.update(1.0)
    return result


# Finding the hop ------------------------------------------------------------------------------------------------------


def _find(settings: HopSettings) -> tuple[Platform, Tumbler, Hop, float]:
    """The platform, its numbers, the hop over the distance, and the torque [N m]."""
    platform = find_platform(settings.platform)
    stance, wheel = platform.stance(), platform.wheel()
    tumbler = Tumbler(
        mass=platform.mass, inertia=platform.moment(), spike_length=stance.spike_length, lean=stance.lean,
        gravity=settings.gravity, mu_s=settings.mu_s, mu_d=settings.mu_d,
    )  # fmt: skip
    if settings.actuator == "brake":
        torque = settings.torque or wheel.brake_torque
        if torque > wheel.brake_torque * (1 + 1e-12):
            raise ValueError(
                f"torque = {torque:g} N m: the brake of {platform.name} gives at most {wheel.brake_torque:g} N m"
            )
        if torque <= tumbler.tipping_torque:
            raise ValueError(_does_not_tip("torque", torque, tumbler))

        def leave(speed: float) -> Launch | None:
            return brake_launch(tumbler, wheel.inertia * speed, torque)

        least, most = 1e-4 * wheel.max_speed, wheel.max_speed
        what = f"the brake's {torque:g} N m on a wheel at {most:g} rad/s, its largest speed,"
        hop = _search(settings, leave, least, most, what)
        return platform, tumbler, hop, torque
    most = wheel.motor_torque
    if most <= tumbler.tipping_torque:
        raise ValueError(_does_not_tip("the motor's torque", most, tumbler))

    def drive(torque: float) -> Launch | None:
        return launch(tumbler, torque, wheel.inertia * wheel.max_speed / torque)

    hop = _search(settings, drive, tumbler.tipping_torque * (1 + 1e-6), most, f"the motor's {most:g} N m, its largest,")
    return platform, tumbler, hop, hop.effort


def _does_not_tip(key: str, torque: float, tumbler: Tumbler) -> str:
    return (
        f"{key} = {torque:g} N m does not tip the platform at gravity = {tumbler.gravity:g} m/s2: more than "
        f"W l sin(lean) = {tumbler.tipping_torque:.4g} N m would"
    )


def _search(
    settings: HopSettings, leave: Callable[[float], Launch | None], least: float, most: float, what: str
) -> Hop:
    """The smallest effort from `least` to `most` whose hop goes the distance. Raises ValueError where none does."""

    def hop(effort: float) -> Hop | None:
        try:
            left = leave(effort)
        except RuntimeError as error:
            raise ValueError(str(error)) from error
        if left is None or left.angle <= 0:
            return None
        return Hop(
            effort=effort, launch=left,
            flight=flight(left.speed, left.angle, gravity=settings.gravity, radius=settings.body_radius),
        )  # fmt: skip

    def missed(effort: float) -> float:
        found = hop(effort)
        if found is None:
            return -settings.distance
        return (found.flight.distance if found.flight else math.inf) - settings.distance

    efforts = np.geomspace(least, most, SCAN)
    beyond = [missed(float(effort)) for effort in efforts]
    first = next((k for k, over in enumerate(beyond) if over >= 0), None)
    if first is None:
        reach = max(beyond) + settings.distance
        way = f"hops {reach:.4g} m at most" if reach > 0 else "does not make it leave the ground"
        raise ValueError(
            f"distance = {settings.distance:g} m is too far: {what} {way} at gravity = {settings.gravity:g} m/s2 and "
            f"mu_s = {settings.mu_s:g}"
        )
    low, high = float(efforts[max(first - 1, 0)]), float(efforts[first])
    while high - low > 1e-13 * high and low < (middle := 0.5 * (low + high)) < high:  # halving gets over jumps too
        low, high = (middle, high) if missed(middle) < 0 else (low, middle)
    found = hop(high)
    assert found is not None
    if abs(missed(high)) > 1e-6 * settings.distance:
        shortest = found.flight.distance if found.flight else math.inf
        if shortest == math.inf:
            raise ValueError(f"distance = {settings.distance:g} m cannot be hopped: the next stronger hop escapes")
        raise ValueError(
            f"distance = {settings.distance:g} m is too short: whatever leaves the ground at all goes {shortest:.4g} m "
            f"at least, at gravity = {settings.gravity:g} m/s2 and mu_s = {settings.mu_s:g}"
        )
    return found


# What is said of it ---------------------------------------------------------------------------------------------------


def _result(settings: HopSettings, platform: Platform, tumbler: Tumbler, hop: Hop, torque: float) -> dict[str, Any]:
    left, flown, wheel = hop.launch, hop.flight, platform.wheel()
    assert flown is not None  # it goes the distance
    by_brake = settings.actuator == "brake"
    speed = hop.effort if by_brake else min(torque * left.time / wheel.inertia, wheel.max_speed)
    radius = settings.body_radius
    escape = escape_speed(settings.gravity, radius) if radius is not None else None
    sudden = impulsive_launch(tumbler, wheel.inertia)
    wanted = launch_speed_for(settings.distance, sudden.angle, gravity=settings.gravity, radius=radius)
    driven = min(left.time, wheel.inertia * speed / torque)
    quantities = {
        "wheel_speed": _quantity(speed, "rad/s", "before the brake" if by_brake else "reached when it leaves"),
        "wheel_speed_impulsive": _quantity(wanted / sudden.speed, "rad/s", "closed form of a brake that takes no time"),
        "torque": _quantity(torque, "N m", "on the platform, constant"),
        "torque_time": _quantity(driven, "s", "how long the torque acts before it leaves"),
        "rotation": _quantity(left.rotation, "rad", "how far it turns on the ground"),
        "launch_speed": _quantity(left.speed, "m/s", "of the centre"),
        "launch_angle": _quantity(left.angle, "rad", "from the horizontal"),
        "least_viable_angle": _quantity(
            least_viable_angle(settings.mu_s), "rad", "pi/2 - atan(mu_s): flattest sudden launch without sliding"
        ),
        "spin": _quantity(left.spin, "rad/s", "turning rate in flight"),
        "flight_time": _quantity(flown.time, "s", "back to the height of launch"),
        "peak_height": _quantity(flown.height, "m", "above the height of launch"),
        "distance": _quantity(flown.distance, "m", "along the ground"),
        "escape_speed": _quantity(escape, "m/s", "sqrt(2 g R)" if escape else "unknown without body_radius"),
        "escape_ratio": _quantity(left.speed / escape if escape else None, "1", "launch speed over escape speed"),
    }
    return {
        "format": "hedgebed-result/1",
        "experiment": "hop",
        "version": __version__,
        "title": f"{platform.name}: a hop of {settings.distance:g} m at {settings.gravity:g} m/s2",
        "status": "done",
        "quantities": quantities,
        "departures": {"sentences": _sentences(settings, tumbler, hop, torque, speed, wheel.inertia)},
        "platform": {
            "name": platform.name, "mass": platform.mass, "inertia": tumbler.inertia,
            "spike_length": tumbler.spike_length, "lean": tumbler.lean, "wheel_inertia": wheel.inertia,
            "max_wheel_speed": wheel.max_speed, "sources": dict(platform.sources),
        },
        "warnings": _warnings(left, escape),
    }  # fmt: skip


def _quantity(value: float | None, unit: str, note: str) -> dict[str, Any]:
    return {"value": value, "std": None if value is None else 0.0, "unit": unit, "note": note}


def _sentences(
    settings: HopSettings, tumbler: Tumbler, hop: Hop, torque: float, speed: float, wheel_inertia: float
) -> list[str]:
    left = hop.launch
    way = "slides off" if left.slid else "leaves without sliding"
    how = (
        f"Braking a wheel at {speed:.4g} rad/s ({speed * 30 / math.pi:.4g} rpm) with {torque:g} N m,"
        if settings.actuator == "brake"
        else f"A motor at {torque:.4g} N m, whose wheel comes to {speed:.4g} rad/s ({speed * 30 / math.pi:.4g} rpm),"
    )
    said = [
        f"{how} the platform {way} at {left.speed:.4g} m/s, {math.degrees(left.angle):.3g} degrees above the ground.",
        f"Launches without sliding are viable from {math.degrees(least_viable_angle(settings.mu_s)):.3g} degrees up at "
        f"mu_s = {settings.mu_s:g}; without turning on the ground this platform would leave at "
        f"{math.degrees(tumbler.lean):.3g}.",
    ]
    if settings.actuator == "brake" and left.time < wheel_inertia * speed / torque * (1 - 1e-9):
        said.append("It leaves before the wheel has come to rest: a faster wheel would not take it farther.")
    return said


def _warnings(left: Launch, escape: float | None) -> list[str]:
    warnings = ["the ground is taken as rigid: one that gives and springs back launches more steeply"]
    if escape is None:
        warnings.append("how near escape is cannot be told without body_radius: escape speed is sqrt(2 g R)")
    elif left.speed >= NEAR_ESCAPE * escape:
        warnings.append(
            f"escape is near: {left.speed:.4g} m/s is {100 * left.speed / escape:.3g} % of the escape speed, "
            f"sqrt(2 g R) = {escape:.4g} m/s"
        )
    return warnings


run, resume = whole_run("hop", HopSettings, _carry_out, check=check)
