"""Hop theory as a tool: the wheel speed that a hop over a distance takes, the launch, the flight, how near escape is.

The launch is that of `rigid.hop`, on rigid ground. Under a brake the torque is known and the wheel's speed is sought,
under a motor the torque; a motor's wheel then turns as fast as it has become when the platform leaves. The planar model
then does the same hop from ground that gives (`experiments.hop_on_surface`): both stand in the result.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from hedgebed import __version__
from rigid.hop import (
    Flight,
    Launch,
    brake_launch,
    escape_speed,
    flight,
    impulsive_launch,
    launch,
    launch_speed_for,
    least_viable_angle,
)
from rigid.planar import simulate
from rigid.trial import Trial

from .hop_numbers import HopPlan, brake_words, plan_hop
from .hop_on_surface import SurfaceHop, flight_path, hop_on_surface, hop_trial, wheel_speed_on_surface
from .hop_settings import HopSettings
from .hop_words import sentences, warnings
from .progress import Progress
from .runfolder import RunFolder, write_series
from .tumble import trajectory_columns
from .whole_runs import whole_run

__all__ = ["check", "resume", "run"]

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
    plan, hop, torque = _find(settings)
    trial = _trial(settings, plan, hop, torque)
    if trial is not None:
        simulate(trial, duration=1e-3)  # that it can stand on this ground


def write_report(folder: Path, progress: Progress) -> None:
    """Plots and report.html of a run folder."""
    from vis.hop import write_hop_report as write

    write(folder, progress=progress.update)


def _carry_out(settings: HopSettings, folder: RunFolder, progress: Progress) -> dict[str, Any]:
    with folder.lock():
        plan, hop, torque = _find(settings)
        for sentence in plan.sentences():
            progress.message(sentence)
        progress.stage("hop", total=1.0)
        given, wanted = _on_surface(settings, plan, hop, torque)
        progress.update(1.0)
        _write_series(settings, folder, hop, given)
        result = _result(settings, plan, hop, torque, given, wanted)
        folder.write_result(result)
        progress.stage("report", total=1.0)
        write_report(folder.path, progress)
    return result


# Finding the hop ------------------------------------------------------------------------------------------------------


def _find(settings: HopSettings) -> tuple[HopPlan, Hop, float]:
    """The numbers, the hop over the distance, and the torque [N m]."""
    plan = plan_hop(settings)
    tumbler, wheel = plan.tumbler, plan.wheel
    if settings.actuator == "brake":
        torque = plan.numbers["torque"].value
        by = brake_words(wheel)
        if torque > wheel.brake_torque * (1 + 1e-12):
            raise ValueError(
                f"torque = {torque:g} N m: {by} of {plan.platform.name} gives at most {wheel.brake_torque:g} N m"
            )
        if torque <= tumbler.tipping_torque:
            raise ValueError(_does_not_tip("torque", torque, plan))

        def leave(speed: float) -> Launch | None:
            return brake_launch(tumbler, wheel.inertia * speed, torque)

        least, most = 1e-4 * wheel.max_speed, wheel.max_speed
        what = f"{by}'s {torque:g} N m, slowing a wheel at {most:g} rad/s, its largest speed,"
        return plan, _search(settings, plan, leave, least, most, what), torque
    most = wheel.motor_torque
    if most <= tumbler.tipping_torque:
        raise ValueError(_does_not_tip("the motor's torque", most, plan))

    def drive(torque: float) -> Launch | None:
        return launch(tumbler, torque, wheel.inertia * wheel.max_speed / torque)

    least, what = tumbler.tipping_torque * (1 + 1e-6), f"the motor's {most:g} N m, its largest,"
    hop = _search(settings, plan, drive, least, most, what)
    return plan, hop, hop.effort


def _does_not_tip(key: str, torque: float, plan: HopPlan) -> str:
    return (
        f"{key} = {torque:g} N m does not tip the platform at gravity = {plan.tumbler.gravity:g} m/s2: more than "
        f"W l sin(lean) = {plan.tumbler.tipping_torque:.4g} N m would"
    )


def _search(
    settings: HopSettings, plan: HopPlan, leave: Callable[[float], Launch | None], least: float, most: float, what: str
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
            f"mu_s = {plan.tumbler.mu_s:g}"
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
            f"at least, at gravity = {settings.gravity:g} m/s2 and mu_s = {plan.tumbler.mu_s:g}"
        )
    return found


# On ground that gives -------------------------------------------------------------------------------------------------


def _trial(settings: HopSettings, plan: HopPlan, hop: Hop, torque: float) -> Trial | None:
    return hop_trial(plan, torque=torque, wheel_speed=hop.effort if settings.actuator == "brake" else None)


def _on_surface(
    settings: HopSettings, plan: HopPlan, hop: Hop, torque: float
) -> tuple[SurfaceHop | None, float | None]:
    """The same hop by the planar model, and the braked wheel's speed that would go the distance there.

    None for a platform that the model does not take; None for a motor, and where no wheel speed does.
    """
    trial = _trial(settings, plan, hop, torque)
    if trial is None:
        return None, None
    assert hop.flight is not None
    longest, radius = 2 * hop.launch.time + 0.5 + 0.5 * hop.flight.time, settings.body_radius
    given = hop_on_surface(trial, expected_time=hop.launch.time, longest=longest, radius=radius)
    if settings.actuator == "motor":
        return given, None
    most = plan.wheel.max_speed
    return given, wheel_speed_on_surface(
        trial, given, distance=settings.distance, max_speed=most, longest=longest, radius=radius
    )


def _write_series(settings: HopSettings, folder: RunFolder, hop: Hop, given: SurfaceHop | None) -> None:
    """The flights of theory and model, and the model's way on the ground."""
    flights: dict[str, tuple[Launch, Flight]] = {}
    assert hop.flight is not None
    flights["flight"] = hop.launch, hop.flight
    if given is not None:
        write_series(folder.path / "trajectory.csv", trajectory_columns(given.trajectory))
        if given.launch is not None and given.flight is not None:
            flights["flight.model"] = given.launch, given.flight
    for name, (left, flown) in flights.items():
        along, height = flight_path(left, flown, gravity=settings.gravity, radius=settings.body_radius)
        folder.write_series(name, {"along_m": along, "height_m": height})


# The result -----------------------------------------------------------------------------------------------------------


def _result(
    settings: HopSettings, plan: HopPlan, hop: Hop, torque: float, given: SurfaceHop | None, sought: float | None
) -> dict[str, Any]:
    left, flown, wheel, tumbler = hop.launch, hop.flight, plan.wheel, plan.tumbler
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
            least_viable_angle(tumbler.mu_s), "rad", "pi/2 - atan(mu_s): flattest sudden launch without sliding"
        ),
        "spin": _quantity(left.spin, "rad/s", "turning rate in flight"),
        "flight_time": _quantity(flown.time, "s", "back to the height of launch"),
        "peak_height": _quantity(flown.height, "m", "above the height of launch"),
        "distance": _quantity(flown.distance, "m", "along the ground"),
        "escape_speed": _quantity(escape, "m/s", "sqrt(2 g R)" if escape else "unknown without body_radius"),
        "escape_ratio": _quantity(left.speed / escape if escape else None, "1", "launch speed over escape speed"),
    } | _model_quantities(left, flown, given, escape, sought)
    said = sentences(plan, left, flown, given, torque=torque, speed=speed, by_brake=by_brake, sought=sought)
    return {
        "format": "hedgebed-result/1",
        "experiment": "hop",
        "version": __version__,
        "title": f"{plan.platform.name}: a hop of {settings.distance:g} m at {settings.gravity:g} m/s2",
        "status": "done",
        "quantities": quantities,
        "numbers": {
            name: {"value": number.value, "unit": number.unit, "origin": number.origin}
            for name, number in plan.numbers.items()
        },
        "actuator": settings.actuator,
        "surface": plan.surface,
        "departures": {"sentences": said},
        "platform": {
            "name": plan.platform.name, "mass": plan.platform.mass, "inertia": tumbler.inertia,
            "spike_length": tumbler.spike_length, "lean": tumbler.lean, "wheel_inertia": wheel.inertia,
            "max_wheel_speed": wheel.max_speed, "sources": dict(plan.platform.sources),
        },
        "warnings": [*plan.warnings, *warnings(plan, left, flown, given, escape)],
    }  # fmt: skip


def _model_quantities(
    left: Launch, flown: Flight, given: SurfaceHop | None, escape: float | None, sought: float | None
) -> dict[str, dict[str, Any]]:
    """What the planar model makes of the same wheel and torque, and how many times theory's that is."""
    other = given.launch if given is not None else None
    flight_of = given.flight if given is not None else None
    where = "planar model, on ground that gives"
    if given is None:
        where += ": not for this platform"
    elif other is None:
        where += ": it does not leave the ground"
    elif flight_of is None:
        where += ": it escapes"
    return {
        "model_launch_speed": _quantity(other.speed if other else None, "m/s", where),
        "model_launch_angle": _quantity(other.angle if other else None, "rad", where),
        "model_flight_time": _quantity(flight_of.time if flight_of else None, "s", where),
        "model_peak_height": _quantity(flight_of.height if flight_of else None, "m", where),
        "model_distance": _quantity(flight_of.distance if flight_of else None, "m", where),
        "speed_factor": _quantity(other.speed / left.speed if other else None, "1", "model_launch_speed over theory's"),
        "distance_factor": _quantity(
            flight_of.distance / flown.distance if flight_of else None, "1", "model_distance over theory's"
        ),
        "model_escape_ratio": _quantity(
            other.speed / escape if other and escape else None, "1", "model_launch_speed over escape speed"
        ),
        "model_wheel_speed": _quantity(sought, "rad/s", "of a brake: goes the distance by the planar model"),
    }


def _quantity(value: float | None, unit: str, note: str) -> dict[str, Any]:
    return {"value": value, "std": None if value is None else 0.0, "unit": unit, "note": note}


run, resume = whole_run("hop", HopSettings, _carry_out, check=check)
