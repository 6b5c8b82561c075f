"""`hedgebed hop`: the wheel speed for a hop over a distance, the launch, the flight, and the margin to escape.

The launch is that of `rigid.hop`, on rigid ground. For a brake the torque is given and the wheel's speed is computed.
For a motor the torque is computed, and the wheel's speed is that at lift-off. The planar model computes the same hop
from compliant ground (`experiments.hop.on_surface`); the result has both.
"""

import math
from collections.abc import Callable
from dataclasses import asdict, replace

from experiments.platform.ground_file import law_warnings, range_warnings, reached, with_kept_ground
from experiments.platform.law_spread import (
    Answer,
    moved,
    spread_entries,
    spread_of_law,
    spread_of_surface,
    uncertain_of,
    with_spread,
)
from experiments.platform.numbers import keep_platform
from experiments.platform.surfaces import find_surface
from experiments.runs.folder import RunFolder, write_series
from experiments.runs.progress import Progress
from experiments.runs.result import Result, quantities_of, quantity
from experiments.runs.types import Json
from experiments.runs.whole_runs import computed_run
from experiments.tumble.result import trajectory_columns
from rigid.hop import Flight, Launch, escape_speed, impulsive_launch, launch, launch_speed_for, least_viable_angle
from rigid.model.trial import Trial
from rigid.planar.simulate import simulate

from .numbers import HopPlan, plan_on
from .on_surface import SurfaceHop, flight_path, hop_on_surface, hop_trial, wheel_speed_on_surface
from .otherwise import otherwise, otherwise_words
from .search import Hop, find_hop, longest_flight
from .settings import HopSettings, say

__all__ = ["NEAR_ESCAPE", "check", "resume", "run"]

OF_THE_LAW = (
    "model_wheel_speed", "model_launch_speed", "model_launch_angle", "model_flight_time", "model_peak_height",
    "model_distance", "speed_factor", "distance_factor", "model_escape_ratio",
)  # fmt: skip
"""Quantities that depend on the law of the ground."""
_ANSWER = (
    "distance", "model_distance", "launch_speed", "model_launch_speed", "launch_angle", "model_launch_angle",
)  # fmt: skip
"""Quantities that a reader wants first, beside those that were asked for."""
_SPREAD_OF = {"model_wheel_speed": "wheel speed", "model_launch_speed": "launch speed", "model_distance": "distance"}
"""Numbers whose spread a sentence states -> what it calls them."""


def check(settings: HopSettings) -> None:
    """Raise ValueError, naming key, value and what is allowed, for an unknown platform or an impossible hop."""
    plan, hop = find_hop(settings)
    trial = _trial(settings, plan, hop)
    if trial is not None:
        simulate(trial, duration=1e-3)  # that it can stand on this ground


def _compute(settings: HopSettings, folder: RunFolder, progress: Progress) -> Result:
    settings = with_kept_ground(settings, folder.path)
    plan, hop = find_hop(settings, keep_platform(settings.platform, folder.path, progress.message))
    for sentence in plan.sentences():
        progress.message(sentence)
    if settings.threads is not None:
        progress.message(say("threads_of_a_hop", s=settings))
    progress.stage("hop", total=1.0)
    given, sought = _on_given_ground(settings, plan, hop)
    progress.update(1.0)
    _write_series(settings, folder, hop, given)
    return _result(settings, plan, hop, given, sought)


def _on_given_ground(settings: HopSettings, plan: HopPlan, hop: Hop) -> tuple[SurfaceHop | None, float | None]:
    """The same hop by the planar model, and the speed of a braked wheel for the distance there [rad/s]."""
    trial = _trial(settings, plan, hop)
    if trial is None:
        return None, None
    longest, radius = longest_flight(plan, hop.launch), settings.body_radius
    given = hop_on_surface(trial, expected_time=hop.launch.time, longest=longest, radius=radius)
    if settings.actuator != "brake" or plan.distance is None:
        return given, None
    return given, wheel_speed_on_surface(
        trial,
        given,
        distance=plan.distance,
        max_speed=plan.wheel.max_speed,
        longest=longest,
        radius=radius,
        brake_time=plan.brake_time,
    )


def _with_the_law_s(
    settings: HopSettings, plan: HopPlan, hop: Hop, best: dict[str, Json], *, beyond: bool
) -> tuple[dict[str, Json], Json, str]:
    """The quantities `best` with the standard deviation that follows from those of the law's parameters.

    Also ``law_spread`` of the result, and a sentence. `beyond` the range of the law no number has any.
    """
    escape = best["escape_speed"]["value"]

    def answer_of(other: HopPlan) -> Answer:
        given, sought = _on_given_ground(settings, other, hop)
        found = _model_quantities(other, hop, given, escape)
        return {name: entry["value"] for name, entry in found.items()} | {"model_wheel_speed": sought}

    def of_surface(name: str, value: float) -> Answer:
        return answer_of(replace(plan, stiffness=value) if name == "stiffness" else replace(plan, damping=value))

    of_the_law = {name: entry["value"] for name, entry in best.items() if name in OF_THE_LAW}
    if beyond and plan.fitted is not None:
        parameters, law, stds = [name for name, _, _ in moved(plan.fitted)], "file", dict.fromkeys(of_the_law)
    elif plan.fitted is not None:
        law, parameters = "file", [name for name, _, _ in moved(plan.fitted)]
        stds = spread_of_law(plan.fitted, lambda file: answer_of(plan_on(plan, file)), of_the_law)
    else:
        uncertain = uncertain_of(plan.numbers, find_surface(plan.surface))
        law, parameters = "", [one.name for one in uncertain]
        stds = dict.fromkeys(of_the_law) if beyond else spread_of_surface(uncertain, of_surface, of_the_law)
    found = with_spread(best, stds) if plan.fitted is not None or parameters else best
    entries = spread_entries(
        found, _SPREAD_OF, surface=plan.surface, law=law, parameters=parameters, beyond=beyond and bool(parameters)
    )
    return found, *entries


def _trial(settings: HopSettings, plan: HopPlan, hop: Hop) -> Trial | None:
    return hop_trial(plan, torque=hop.torque, wheel_speed=hop.effort if settings.actuator == "brake" else None)


def _write_series(settings: HopSettings, folder: RunFolder, hop: Hop, given: SurfaceHop | None) -> None:
    """The flights of theory and model, and the model's motion on the ground."""
    flights: dict[str, tuple[Launch, Flight]] = {}
    if hop.flight is not None:
        flights["flight"] = hop.launch, hop.flight
    if given is not None:
        write_series(folder.path / "trajectory.csv", trajectory_columns(given.trajectory))
        if given.launch is not None and given.flight is not None:
            flights["flight.model"] = given.launch, given.flight
    for name, (left, flown) in flights.items():
        along, height = flight_path(left, flown, gravity=settings.gravity, radius=settings.body_radius)
        folder.write_series(name, {"along_m": along, "height_m": height})


def _result(settings: HopSettings, plan: HopPlan, hop: Hop, given: SurfaceHop | None, sought: float | None) -> Result:
    left, flown, wheel, tumbler, torque = hop.launch, hop.flight, plan.wheel, plan.tumbler, hop.torque
    by_brake = settings.actuator == "brake"
    speed = hop.effort if by_brake else min(torque * left.time / wheel.inertia, wheel.max_speed)
    radius = settings.body_radius
    escape = escape_speed(settings.gravity, radius) if radius is not None else None
    sudden, spin_up = impulsive_launch(tumbler, wheel.inertia), min(tumbler.slip_torque, tumbler.tipping_torque)
    spin_up = min(spin_up, wheel.motor_torque)
    wanted = None
    if flown is not None:
        wanted = launch_speed_for(flown.distance, sudden.angle, gravity=settings.gravity, radius=radius)
    driven = min(left.time, wheel.inertia * speed / torque)
    lands = "" if flown is not None else "it escapes"
    when = "before the brake" if by_brake else "reached when it leaves"
    note = say("not_sought" if not by_brake else "none_goes" if sought is None else "sought", plan=plan)
    if plan.distance is None or given is None:
        note = "no distance was asked for" if plan.distance is None else say("not_sought_here")
    quantities = {
        "wheel_speed": quantity(speed, "rad/s", say("of_wheel", when=when)),
        "model_wheel_speed": quantity(sought, "rad/s", note),
        "wheel_speed_impulsive": quantity(wanted / sudden.speed if wanted else None, "rad/s", lands or say("closed")),
        "torque": quantity(torque, "N m", "on the platform, constant"),
        "spin_up_torque": quantity(spin_up if by_brake else None, "N m", say("of_spin_up_torque")),
        "spin_up_time": quantity(wheel.inertia * speed / spin_up if by_brake else None, "s", say("of_spin_up_time")),
        "torque_time": quantity(driven, "s", say("of_torque_time")),
        "rotation": quantity(left.rotation, "rad", say("of_rotation")),
        "launch_speed": quantity(left.speed, "m/s", say("of_launch_speed")),
        "launch_angle": quantity(left.angle, "rad", say("of_launch_angle")),
        "least_viable_angle": quantity(least_viable_angle(tumbler.mu_s), "rad", say("of_viable")),
        "spin": quantity(left.spin, "rad/s", "turning rate in flight"),
        "flight_time": quantity(flown.time if flown else None, "s", lands or say("of_flight_time")),
        "peak_height": quantity(flown.height if flown else None, "m", lands or say("of_height")),
        "distance": quantity(flown.distance if flown else None, "m", lands or say("of_distance")),
        "escape_speed": quantity(escape, "m/s", "sqrt(2 g R)" if escape else "unknown without body_radius"),
        "escape_ratio": quantity(left.speed / escape if escape else None, "1", say("of_escape")),
    } | _model_quantities(plan, hop, given, escape)
    quantities = {name: quantities[name] for name in sorted(quantities, key=_place_of(settings))}
    said = _sentences(plan, hop, given, speed=speed, by_brake=by_brake, sought=sought)
    others = otherwise(settings, plan, hop)
    early = [_spin_up(plan, speed=speed, most=spin_up)] if by_brake else []
    said[1:1] = [*early, *filter(None, [otherwise_words(settings, others)])]
    law: Json = {"parameters": []}
    if given is not None:
        quantities, law, sentence = _with_the_law_s(
            settings, plan, hop, quantities, beyond=plan.of_earth or bool(_out_of_range(plan, given))
        )
        said.append(sentence)
    asked = {"distance": f"of {plan.distance or 0:g} m", "wheel_speed": f"from {settings.wheel_speed_0 or 0:g} rad/s"}
    asked["torque"] = f"by {settings.torque or 0:g} N m"
    answer = ""
    if by_brake and plan.distance is not None:  # on either ground: the speed of rigid ground alone is no plan for a hop
        answer = f", by a wheel at {speed:.4g} rad/s from rigid ground"
        if given is not None:
            found = "none" if sought is None else f"at {sought:.4g} rad/s"
            answer += f", {found} from {plan.surface}"
    return Result.make(
        "hop",
        title=f"{plan.platform.name}: a hop {asked[settings.asks_for]} at {settings.gravity:.4g} m/s2{answer}",
        quantities=quantities,
        numbers={name: asdict(number) for name, number in plan.numbers.items()},
        actuator=settings.actuator,
        asks_for=settings.asks_for,
        surface=plan.surface,
        departures={"sentences": said},
        law_spread=law,
        otherwise=others,
        platform={
            "name": plan.platform.name,
            "mass": plan.platform.mass,
            "inertia": tumbler.inertia,
            "spike_length": tumbler.spike_length,
            "lean": tumbler.lean,
            "wheel_inertia": wheel.inertia,
            "max_wheel_speed": wheel.max_speed,
            "sources": dict(plan.platform.sources),
        },
        warnings=[*plan.warnings, *_warnings(plan, hop, given, escape)],
    )


def _place_of(settings: HopSettings) -> Callable[[str], int]:
    """The place of a quantity in the result: the answer first; what was given, as a wheel's speed, last."""
    speeds = () if settings.asks_for == "wheel_speed" else ("wheel_speed", "model_wheel_speed")
    last = "wheel_speed" if settings.asks_for == "wheel_speed" else "torque"

    def place(name: str) -> int:
        answer = (*speeds, *_ANSWER)
        return answer.index(name) if name in answer else 100 + (name == last)

    return place


def _model_quantities(plan: HopPlan, hop: Hop, given: SurfaceHop | None, escape: float | None) -> dict[str, Json]:
    """Results of the planar model with the same wheel and torque, and their ratios to the theory."""
    left, flown = hop.launch, hop.flight
    other = given.launch if given is not None else None
    flight_of = given.flight if given is not None else None
    no = "it does not leave the ground" if other is None else "it escapes" if flight_of is None else ""
    no = "not for this platform" if given is None else no
    where = f"planar model, on {plan.surface}" + (f": {no}" if no else "")
    further = flight_of.distance / flown.distance if flight_of and flown else None
    near = other.speed / escape if other and escape else None
    launch = (other.speed, other.angle) if other else (None, None)
    flown_there = (flight_of.time, flight_of.height, flight_of.distance) if flight_of else (None, None, None)
    return quantities_of(
        {
            "model_launch_speed": (launch[0], "m/s", where),
            "model_launch_angle": (launch[1], "rad", where),
            "model_flight_time": (flown_there[0], "s", where),
            "model_peak_height": (flown_there[1], "m", where),
            "model_distance": (flown_there[2], "m", where),
            "speed_factor": (other.speed / left.speed if other else None, "1", say("of_speed_factor")),
            "distance_factor": (further, "1", say("of_distance_factor")),
            "model_escape_ratio": (near, "1", say("of_model_escape")),
        }
    )


NEAR_ESCAPE = 0.5
"""From this share of the escape speed on escape is near: a quarter of the energy, and high enough a hop to see how
gravity falls with height."""
ALIKE = 0.05
"""Two hops that differ by less than this share are called alike."""
SAME_ANGLE = math.radians(1.0)


def _sentences(
    plan: HopPlan, hop: Hop, given: SurfaceHop | None, *, speed: float, by_brake: bool, sought: float | None
) -> list[str]:
    """The findings: theory on rigid ground, the planar model on compliant ground.

    `speed` [rad/s] is the wheel's, `sought` [rad/s] that for the distance on compliant ground.
    """
    tumbler, left, flown, torque = plan.tumbler, hop.launch, hop.flight, hop.torque
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
    said.append(_on_ground(plan, hop, given, by_brake=by_brake))
    of_surface = "stiffness" in plan.numbers and plan.numbers["stiffness"].origin.startswith("surface ")
    if given is not None and of_surface and not find_surface(plan.surface).granular:
        said.append(say("spikes_give", plan=plan, deep=1e3 * reached(given.trajectory)["depth"]))
    if by_brake and plan.distance is not None and sought is None and given is not None:
        most = "" if math.isinf(plan.wheel.max_speed) else f" up to {plan.wheel.max_speed:g} rad/s"
        said.append(say("no_wheel_speed", most=most, plan=plan))
    if sought is not None and plan.distance is not None and abs(sought / speed - 1) > 0.5 * ALIKE:
        said.append(say("wheel_speed_needed", sought=sought, plan=plan))
    return said


def _spin_up(plan: HopPlan, *, speed: float, most: float) -> str:
    """How fast the wheel may be spun up to `speed` [rad/s] by at most `most` [N m] without a motion of the platform."""
    tumbler = plan.tumbler
    time, share = plan.wheel.inertia * speed / most, 100 * most / plan.wheel.motor_torque
    if most >= plan.wheel.motor_torque:
        return say("spin_up_by_motor", time=time, speed=speed, most=most)
    of_motor = f", {share:.2g} % of the motor's" if share > 0 else ""
    return say("spin_up", time=time, speed=speed, most=most, of_motor=of_motor, t=tumbler)


def _warnings(plan: HopPlan, hop: Hop, given: SurfaceHop | None, escape: float | None) -> list[str]:
    """Warnings on the error of rigid ground, and on a launch near the escape speed."""
    found, left, flown = [], hop.launch, hop.flight
    if given is not None:
        found += _out_of_range(plan, given) + law_warnings(plan.fitted)
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


def _out_of_range(plan: HopPlan, given: SurfaceHop) -> list[str]:
    """One warning for each number of the hop that is outside the range of the law."""
    of_grains = {"gravity": plan.tumbler.gravity, "diameter": plan.tip_diameter}
    return range_warnings(plan.fitted, given.trajectory, **of_grains)


def _on_ground(plan: HopPlan, hop: Hop, given: SurfaceHop | None, *, by_brake: bool) -> str:
    """Comparison of theory and model, and the reason of their difference if the numbers show it."""
    if given is None:
        return say("rigid_alone")
    left, flown, other, flight = hop.launch, hop.flight, given.launch, given.flight
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
    if not left.slid and given.slides:
        return compared + say("slides_there", mu_s=plan.tumbler.mu_s) + _if_it_slides(plan, hop, by_brake=by_brake)
    return compared + (say("thrown_up") if not left.slid and steeper > SAME_ANGLE else ".")


def _if_it_slides(plan: HopPlan, hop: Hop, *, by_brake: bool) -> str:
    """The launch from rigid ground whose static friction is as small as the sliding one; "." if there is none."""
    sliding = replace(plan.tumbler, mu_s=plan.tumbler.sliding_friction, mu_d=plan.tumbler.sliding_friction)
    turning = hop.effort if by_brake else plan.wheel.max_speed
    try:
        left = launch(sliding, hop.torque, plan.wheel.inertia * turning / hop.torque)
    except RuntimeError:
        return "."
    return "." if left is None else say("slid_alike", left=left, angle=math.degrees(left.angle))


run, resume = computed_run("hop", HopSettings, _compute, check=check)
