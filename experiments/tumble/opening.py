"""Messages before the bed of a tumble on grains is made: settings, derived numbers, possible shortcomings."""

import math
import re
from dataclasses import replace
from typing import Any

import numpy as np

from experiments.grains.softening import Softening
from experiments.platform.numbers import torque_within_limit
from experiments.runs.types import Json
from rigid.planar.simulate import simulate
from rigid.planar.trajectory import LAUNCH_DISTANCE, Trajectory

from . import say
from .settings import TumbleSettings
from .steppers import is_plain
from .trial import TumblePlan

__all__ = ["opening", "short_of_way"]

LONGER = (2.0, 4.0, 8.0)  # Durations that are tried, over the one that is set [1]
STRONGER = (2.0, 4.0, 8.0)  # Likewise the wheel's speed, or the torque, of a brake [1]


def opening(
    settings: TumbleSettings, plan: TumblePlan, *, grains: float, softening: Softening, lowering_speed: float
) -> list[str]:
    """Settings and derived numbers; how many settings have their defaults. `grains`: expected number."""
    fields = TumbleSettings.model_fields
    # A run that is taken up again has all of them set, by its run.toml.
    given = [name for name, field in fields.items() if name in settings.model_fields_set
             and getattr(settings, name) not in (None, (), field.get_default(call_default_factory=True))]  # fmt: skip
    said = ["set: " + ", ".join(f"{name} = {_shown(settings, name)}" for name in given)]
    numbers: dict[str, list[str]] = {}
    shown = {*given, "bed_size", "grain", "seed", "young", "duration", "lowering_speed"}
    for name, number in plan.numbers.items():
        if number.origin == "given" or number.origin.startswith("default"):
            continue
        shown.add(name)
        unit = "" if number.unit == "1" else f" {number.unit}"
        numbers.setdefault(number.origin, []).append(f"{name} = {number.value:.6g}{unit}")
    spikes = plan.spikes
    for name, length in (("spike_diameter", spikes.diameter), ("spike_clear", spikes.clear)):
        if name in spikes.of_platform:
            shown.add(name)
            numbers.setdefault(f"platform {settings.platform}", []).append(f"{name} = {length:.6g} m")
    said += [f"{listed[0]} ({origin})" if len(listed) == 1 else f"{origin}: {', '.join(listed)}"
             for origin, listed in numbers.items()]  # fmt: skip
    chosen = "as set" if settings.young is not None else f"from max_overlap = {settings.max_overlap:g}"
    count, grain = round(grains, -2), 1e3 * settings.grain
    return [
        *said, say("the_bed", s=settings, grains=count, grain=grain, young=softening, chosen=chosen),
        say("duration_and_lowering", s=settings, speed=lowering_speed), say("stiffness_beside"),
        say("rest_at_default", count=sum(name not in shown for name in fields)),
    ]  # fmt: skip


def short_of_way(settings: TumbleSettings, plan: TumblePlan, law: Trajectory) -> str | None:
    """Warning that this duration may be too short for a trajectory angle; None if `law`, the spring-damper's, has one.

    A landing needs none.
    """
    if settings.drop_speed is not None or law.trajectory_angle is not None:
        return None
    away = float(_away(law).max())
    said = say("short_way", s=settings, away=1e3 * away, least=1e3 * LAUNCH_DISTANCE)
    if not is_plain(settings):
        return said
    for times in LONGER:
        duration = times * settings.duration
        trial, _ = torque_within_limit(plan.trial, max_wheel_speed=plan.max_wheel_speed, duration=duration)
        found = simulate(trial, duration=duration, sample_interval=min(1e-3, duration))
        if found.trajectory_angle is not None:
            when = float(found.time[int(np.argmax(_away(found) >= LAUNCH_DISTANCE))])
            return said + say("longer_duration", when=math.ceil(100 * when) / 100)
    longest = LONGER[-1] * settings.duration
    stronger = _stronger_brake(plan, longest) if plan.trial.actuator == "brake" else say("larger_torque")
    return said + say("nor_longer", longest=longest, stronger=stronger)


def _stronger_brake(plan: TumblePlan, duration: float) -> str:
    """The brake that moves it by LAUNCH_DISTANCE on the spring-damper, as a sentence.

    The angular impulse of a brake is at most J_w wheel_speed_0, and its torque may be too small to tip the platform.
    The wheel's speed, within its limit, is tried alone, then the torque, then both.
    """
    trial = plan.trial
    for times in STRONGER:
        for names in (("wheel_speed_0",), ("torque",), ("wheel_speed_0", "torque")):
            changed: Json = {name: float(f"{times * getattr(trial, name):.3g}") for name in names}
            if changed.get("wheel_speed_0", 0.0) > plan.max_wheel_speed:
                continue
            found = simulate(replace(trial, **changed), duration=duration, sample_interval=min(1e-3, duration))
            if found.trajectory_angle is not None:
                units = {"wheel_speed_0": "rad/s", "torque": "N m"}
                said = (f"{name} = {value:g} {units[name]}" for name, value in changed.items())
                return say("in_that_time", changed=" with ".join(said))
    return say("much_faster")


def _away(trajectory: Trajectory) -> Any:
    """Distance of the centre from its start [m], shape [n]."""
    return np.hypot(trajectory.x - trajectory.x[0], trajectory.y - trajectory.y[0])


def _shown(settings: TumbleSettings, name: str) -> str:
    """A setting as typed, and the unit of its description."""
    value = getattr(settings, name)
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, tuple):
        return " ".join(f"{part:g}" if isinstance(part, float) else str(part) for part in value)
    unit = re.search(r"\[([A-Za-z][^\]]*)\]", TumbleSettings.model_fields[name].description or "")
    number = f"{value:g}" if isinstance(value, float) else str(value)
    return f"{number} {unit[1]}" if unit and isinstance(value, float) else number
