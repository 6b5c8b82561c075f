"""What is said of a tumble on grains before its bed is made: what was set, what follows from it, what it may lack."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from rigid.planar import simulate
from rigid.trajectory import LAUNCH_DISTANCE, Trajectory

from .softening import Softening
from .tumble_platform import torque_within_limit
from .tumble_settings import TumbleSettings
from .tumble_steppers import is_plain

if TYPE_CHECKING:
    from .tumble_trial import TumblePlan

__all__ = ["opening", "short_of_way"]

LONGER = (2.0, 4.0, 8.0)
"""Times the duration for which the spring-damper is followed until it is LAUNCH_DISTANCE away [1]."""
STRONGER = (2.0, 4.0, 8.0)
"""Times the wheel's speed, or the torque, of a brake that does not bring the platform that far [1]."""


def opening(
    settings: TumbleSettings, plan: TumblePlan, *, grains: float, softening: Softening, lowering_speed: float
) -> list[str]:
    """What was set and what follows from it; how many settings are at their defaults, and where those stand.

    `grains`: about how many the bed will have; lowering_speed [m/s].
    """
    fields = TumbleSettings.model_fields
    # A run that is taken up again has all of them set, by its run.toml.
    given = [name for name, field in fields.items() if name in settings.model_fields_set
             and getattr(settings, name) not in (None, (), field.get_default(call_default_factory=True))]  # fmt: skip
    said = ["set: " + ", ".join(f"{name} = {_shown(settings, name)}" for name in given)]
    numbers: dict[str, list[str]] = {}
    told = {*given, "bed_size", "grain", "seed", "young", "duration", "lowering_speed"}
    for name, number in plan.numbers.items():
        if number.origin == "given" or number.origin.startswith("default"):
            continue
        told.add(name)
        numbers.setdefault(number.origin, []).append(f"{name} = {number.value:.6g}{_unit(number.unit)}")
    spikes = plan.spikes
    for name, length in (("spike_diameter", spikes.diameter), ("spike_clear", spikes.clear)):
        if name in spikes.of_platform:
            told.add(name)
            numbers.setdefault(f"platform {settings.platform}", []).append(f"{name} = {length:.6g} m")
    said += [f"{listed[0]} ({origin})" if len(listed) == 1 else f"{origin}: {', '.join(listed)}"
             for origin, listed in numbers.items()]  # fmt: skip
    long, wide, deep = settings.bed_length, *settings.bed_size[1:]
    chosen = "as set" if settings.young is not None else f"from max_overlap = {settings.max_overlap:g}"
    said.append(
        f"the bed: {long:g} x {wide:g} x {deep:g} m, about {round(grains, -2):,.0f} grains of "
        f"{1e3 * settings.grain:g} mm, seed {settings.seed}, young = {softening.young:.3g} Pa ({chosen}; "
        f"{softening.factor:,.0f} times softer than real)"
    )
    said.append(f"duration = {settings.duration:g} s, lowering_speed = {lowering_speed:.4g} m/s")
    said.append("stiffness, damping: of the spring-damper beside; mu_d: also what tells sliding from sticking")
    rest = [name for name in fields if name not in told]
    return [*said, f"{len(rest)} more settings are at their defaults: run.toml in the run's folder has every one"]


def short_of_way(settings: TumbleSettings, plan: TumblePlan, law: Trajectory) -> str | None:
    """That a trajectory angle may not come of this duration, in words; None where `law`, the spring-damper's, has one.

    A landing has none to speak of.
    """
    if settings.drop_speed is not None or law.trajectory_angle is not None:
        return None
    away = float(_away(law).max())
    least = f"a trajectory angle is that of the first {1e3 * LAUNCH_DISTANCE:g} mm"
    said = (
        f"on the spring-damper the centre gets {1e3 * away:.2g} mm away within duration = {settings.duration:g} s, and "
        f"{least}: there may be none"
    )
    if not is_plain(settings):
        return said
    for times in LONGER:
        duration = times * settings.duration
        trial, _ = torque_within_limit(plan.trial, max_wheel_speed=plan.max_wheel_speed, duration=duration)
        found = simulate(trial, duration=duration, sample_interval=min(1e-3, duration))
        if found.trajectory_angle is not None:
            when = float(found.time[int(np.argmax(_away(found) >= LAUNCH_DISTANCE))])
            return (
                f"{said}; duration = {math.ceil(100 * when) / 100:g} s would do there, and on grains it may take longer"
            )
    longest = LONGER[-1] * settings.duration
    stronger = _stronger_brake(plan, longest) if plan.trial.actuator == "brake" else "a larger torque would do"
    return f"{said}, nor in {longest:g} s there; {stronger}"


def _stronger_brake(plan: TumblePlan, duration: float) -> str:
    """What would bring it LAUNCH_DISTANCE away on the spring-damper, in words.

    A brake gives J_w wheel_speed_0 and no more, however long it lasts, and may be too weak to tip it over: the wheel's
    speed, within its limit, is tried alone, then the torque, then both.
    """
    trial = plan.trial
    for times in STRONGER:
        for names in (("wheel_speed_0",), ("torque",), ("wheel_speed_0", "torque")):
            changed: dict[str, Any] = {name: float(f"{times * getattr(trial, name):.3g}") for name in names}
            if changed.get("wheel_speed_0", 0.0) > plan.max_wheel_speed:
                continue
            found = simulate(replace(trial, **changed), duration=duration, sample_interval=min(1e-3, duration))
            if found.trajectory_angle is not None:
                units = {"wheel_speed_0": "rad/s", "torque": "N m"}
                said = (f"{name} = {value:g} {units[name]}" for name, value in changed.items())
                return f"{' with '.join(said)} would do in that time"
    return "a much faster wheel (wheel_speed_0) with a larger torque would do"


def _away(trajectory: Trajectory) -> Any:
    """Distance of the centre from its start [m], shape [n]."""
    return np.hypot(trajectory.x - trajectory.x[0], trajectory.y - trajectory.y[0])


def _shown(settings: TumbleSettings, name: str) -> str:
    """A setting as one types it, and its unit as its description has it."""
    value = getattr(settings, name)
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, tuple):
        return " ".join(f"{part:g}" if isinstance(part, float) else str(part) for part in value)
    unit = re.search(r"\[([A-Za-z][^\]]*)\]", TumbleSettings.model_fields[name].description or "")
    number = f"{value:g}" if isinstance(value, float) else str(value)
    return f"{number} {unit[1]}" if unit and isinstance(value, float) else number


def _unit(unit: str) -> str:
    return "" if unit == "1" else f" {unit}"
