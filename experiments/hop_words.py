"""What is said of a hop: theory on rigid ground, the planar model on ground that gives, and how near escape is."""

from __future__ import annotations

import math

from rigid.hop import Flight, Launch, least_viable_angle

from .hop_numbers import HopPlan
from .hop_on_surface import SurfaceHop

__all__ = ["NEAR_ESCAPE", "sentences", "warnings"]

NEAR_ESCAPE = 0.5
"""From this share of the escape speed on it is said to be near: a quarter of the energy, and high enough a hop to see
how gravity falls with height."""
ALIKE = 0.05
"""Two hops that differ by less than this share are called alike."""
SAME_ANGLE = math.radians(1.0)


def sentences(
    plan: HopPlan,
    left: Launch,
    flown: Flight | None,
    given: SurfaceHop | None,
    *,
    torque: float,
    speed: float,
    by_brake: bool,
    sought: float | None = None,
) -> list[str]:
    """What a person wants to be told; `sought` is the wheel speed [rad/s] for the distance on ground that gives."""
    mu_s = plan.tumbler.mu_s
    way = "slides off rigid ground" if left.slid else "leaves rigid ground without sliding"
    turning = f"{speed:.4g} rad/s ({speed * 30 / math.pi:.4g} rpm)"
    how = (
        f"Braking a wheel at {turning} with {torque:g} N m{_by(plan)},"
        if by_brake
        else f"A motor at {torque:.4g} N m, whose wheel comes to {turning},"
    )
    slides = (
        f", which sliding friction sets: tan(angle) = 1 / mu_d, mu_d = {plan.tumbler.sliding_friction:g}"
        if left.slid and math.isclose(math.tan(left.angle) * plan.tumbler.sliding_friction, 1, rel_tol=0.02)
        else ""
    )
    said = [
        f"{how} the platform {way} at {left.speed:.4g} m/s, {math.degrees(left.angle):.3g} degrees above the ground"
        f"{slides}{_lands(flown)}.",
        f"Launches without sliding are viable from {math.degrees(least_viable_angle(mu_s)):.3g} degrees up at "
        f"mu_s = {mu_s:g}; without turning on the ground this platform would leave at "
        f"{math.degrees(plan.tumbler.lean):.3g}.",
    ]
    if by_brake and left.time < plan.wheel.inertia * speed / torque * (1 - 1e-9):
        said.append("It leaves before the wheel has come to rest: a faster wheel would not take it farther.")
    said.append(_on_ground(plan, left, flown, given))
    if by_brake and plan.distance is not None and sought is None and given is not None:
        most = "" if math.isinf(plan.wheel.max_speed) else f" up to {plan.wheel.max_speed:g} rad/s"
        said.append(f"No wheel speed{most} was found that goes {plan.distance:.4g} m from {plan.surface}.")
    if sought is not None and plan.distance is not None and abs(sought / speed - 1) > 0.5 * ALIKE:
        said.append(f"By the planar model {sought:.4g} rad/s would go {plan.distance:.4g} m on {plan.surface}.")
    return said


def warnings(
    plan: HopPlan, left: Launch, flown: Flight | None, given: SurfaceHop | None, escape: float | None
) -> list[str]:
    """What must not be overlooked: how far off rigid ground is, and escape, of the faster of the two launches."""
    found = []
    other = given.launch if given is not None else None
    if given is None:
        found.append(
            f"the ground is taken as rigid: what ground that gives does to this hop is not computed, as the planar "
            f"model has rows of tips at equal angles, and {plan.platform.name} has not"
        )
    elif other is None:
        found.append(f"on {plan.ground} the planar model does not leave the ground")
    elif plan.distance is None or flown is None:
        pass  # what each ground makes of the given wheel is the answer, not a warning
    elif given.flight is not None and abs(given.flight.distance / flown.distance - 1) > ALIKE:
        off = given.flight.distance / flown.distance
        found.append(
            f"the wheel speed is that of rigid ground: on {plan.ground} the same one goes "
            f"{given.flight.distance:.4g} m, {off:.3g} times the distance"
        )
    if escape is None:
        found.append("how near escape is cannot be told without body_radius: escape speed is sqrt(2 g R)")
        return found
    fastest = max(left.speed, other.speed if other is not None else 0.0)
    if fastest >= NEAR_ESCAPE * escape:
        whose = "" if fastest == left.speed else f" on {plan.ground}"
        what = "it escapes" if fastest >= escape else "escape is near"
        found.append(
            f"{what}: {fastest:.4g} m/s{whose} is {100 * fastest / escape:.3g} % of the escape speed, "
            f"sqrt(2 g R) = {escape:.4g} m/s"
        )
    return found


def _by(plan: HopPlan) -> str:
    return "" if plan.brake == "the brake" else " by the motor"


def _lands(flown: Flight | None) -> str:
    if flown is None:
        return "; it escapes"
    return f"; it lands {flown.distance:.4g} m away after {flown.time:.4g} s"


def _on_ground(plan: HopPlan, left: Launch, flown: Flight | None, given: SurfaceHop | None) -> str:
    """Theory and model side by side, and why they differ, as far as the numbers say so."""
    if given is None:
        return (
            "All this is on rigid ground: the planar model, which has ground that gives, does not take this platform."
        )
    other, flight = given.launch, given.flight
    if other is None:
        return f"All this is on rigid ground. On {plan.ground} the same torque does not make it leave the ground."
    if flight is None:
        goes = "escapes"
    else:
        goes = f"goes {flight.distance:.4g} m"
        if flown is not None:
            times = flight.distance / flown.distance
            goes += f", {times:.3g} times as far as the {flown.distance:.4g} m of rigid ground"
    compared = (
        f"All this is on rigid ground. On {plan.ground} the planar model leaves with the same wheel at "
        f"{other.speed:.4g} m/s, {other.speed / left.speed:.3g} times as fast, at {math.degrees(other.angle):.3g} "
        f"degrees, and {goes}"
    )
    faster, steeper = other.speed > (1 + ALIKE) * left.speed, other.angle - left.angle
    if left.slid and other.slid and faster and abs(steeper) <= SAME_ANGLE:
        return f"{compared}: what the springs give back goes into speed, while sliding tips keep the angle."
    if not left.slid and steeper > SAME_ANGLE:
        return f"{compared}: tips that hold are thrown up by what the springs give back, and leave more steeply."
    return f"{compared}."
