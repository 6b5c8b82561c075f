"""Sentences on a hop: theory on rigid ground, the planar model on ground that gives, and how near escape is."""

import math

from rigid.hop import Flight, Launch, least_viable_angle

from .numbers import HopPlan
from .on_surface import SurfaceHop
from .settings import say

__all__ = ["NEAR_ESCAPE", "sentences", "warnings"]

NEAR_ESCAPE = 0.5
"""From this share of the escape speed on escape is near: a quarter of the energy, and high enough a hop to see how
gravity falls with height."""
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
    """The findings; `sought` is the wheel speed [rad/s] for the distance on ground that gives."""
    tumbler = plan.tumbler
    turning = f"{speed:.4g} rad/s ({speed * 30 / math.pi:.4g} rpm)"
    by = "" if plan.brake == "the brake" else " by the motor"
    friction_sets_it = left.slid and math.isclose(math.tan(left.angle) * tumbler.sliding_friction, 1, rel_tol=0.02)
    least = math.degrees(least_viable_angle(tumbler.mu_s))
    said = [
        say(
            "launch", how=say("braking" if by_brake else "driving", turning=turning, torque=torque, by=by),
            way=say("slides_off" if left.slid else "leaves"), left=left, angle=math.degrees(left.angle),
            slides=say("sliding_sets_it", mu_d=tumbler.sliding_friction) if friction_sets_it else "",
            lands=say("escapes") if flown is None else say("lands", flown=flown),
        ),
        say("viable", least=least, mu_s=tumbler.mu_s, lean=math.degrees(tumbler.lean)),
    ]  # fmt: skip
    if by_brake and left.time < plan.wheel.inertia * speed / torque * (1 - 1e-9):
        said.append(say("leaves_early"))
    said.append(_on_ground(plan, left, flown, given))
    if by_brake and plan.distance is not None and sought is None and given is not None:
        most = "" if math.isinf(plan.wheel.max_speed) else f" up to {plan.wheel.max_speed:g} rad/s"
        said.append(say("no_wheel_speed", most=most, plan=plan))
    if sought is not None and plan.distance is not None and abs(sought / speed - 1) > 0.5 * ALIKE:
        said.append(say("wheel_speed_needed", sought=sought, plan=plan))
    return said


def warnings(
    plan: HopPlan, left: Launch, flown: Flight | None, given: SurfaceHop | None, escape: float | None
) -> list[str]:
    """How far off rigid ground is, and how near escape the faster of the two launches is."""
    found = []
    other = given.launch if given is not None else None
    if given is None:
        found.append(say("taken_as_rigid", plan=plan))
    elif other is None:
        found.append(say("does_not_leave", plan=plan))
    elif plan.distance is None or flown is None:
        pass  # what each ground makes of the given wheel is the answer, not a warning
    elif given.flight is not None and abs(given.flight.distance / flown.distance - 1) > ALIKE:
        times = given.flight.distance / flown.distance
        found.append(say("other_distance", plan=plan, flight=given.flight, times=times))
    if escape is None:
        return [*found, say("escape_unknown")]
    speed = max(left.speed, other.speed if other is not None else 0.0)
    if speed >= NEAR_ESCAPE * escape:
        whose = "" if speed == left.speed else f" on {plan.ground}"
        what = "it escapes" if speed >= escape else "escape is near"
        share = 100 * speed / escape
        found.append(say("near_escape", what=what, speed=speed, whose=whose, share=share, escape=escape))
    return found


def _on_ground(plan: HopPlan, left: Launch, flown: Flight | None, given: SurfaceHop | None) -> str:
    """Theory and model side by side, and why they differ, as far as the numbers say so."""
    if given is None:
        return say("rigid_alone")
    other, flight = given.launch, given.flight
    if other is None:
        return say("stays", plan=plan)
    goes = "escapes" if flight is None else say("goes", flight=flight)
    if flight is not None and flown is not None:
        goes += say("goes_times", times=flight.distance / flown.distance, flown=flown)
    times, angle = other.speed / left.speed, math.degrees(other.angle)
    compared = say("compared", plan=plan, other=other, times=times, angle=angle, goes=goes)
    faster, steeper = other.speed > (1 + ALIKE) * left.speed, other.angle - left.angle
    if left.slid and other.slid and faster and abs(steeper) <= SAME_ANGLE:
        return compared + say("into_speed")
    return compared + (say("thrown_up") if not left.slid and steeper > SAME_ANGLE else ".")
