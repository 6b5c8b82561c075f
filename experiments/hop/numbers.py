"""From the settings of a hop to its numbers, each with its origin."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from experiments.platform.ground_file import SPIKES_PER_ROW, fitted_ground
from experiments.platform.numbers import platform_numbers
from experiments.platform.settled import (
    Number,
    Settled,
    beyond_brake,
    check_spike_length,
    defaults_said,
    of_earth,
    of_other_spikes,
)
from experiments.runs.types import Json
from rigid.ground_file import GroundFile
from rigid.hop import Tumbler
from rigid.model.trial import Ground, Trial
from rigid.platform.actuation import Flywheel
from rigid.platform.files import find_platform
from rigid.platform.platform import Platform

from .settings import DEFAULT_DISTANCE, HopSettings, say

__all__ = ["HopPlan", "plan_hop", "plan_on"]


@dataclass(frozen=True, kw_only=True)
class HopPlan:
    """The platform and the ground of a hop, with warnings."""

    platform: Platform
    wheel: Flywheel
    brake: str  # what slows the wheel, in words
    tumbler: Tumbler
    surface: str
    stiffness: float  # K of a row [N/m]
    damping: float  # C of a row [N s/m]
    brake_time: float | None  # in which the brake stops the wheel [s]; None: its torque is given
    spike_count: int | None  # rows of tips for the planar model; None where they are not at equal angles
    distance: float | None  # how far to hop [m]; None where that is what is asked
    numbers: Mapping[str, Number]
    choices: Mapping[str, str]  # what else stands at its default: name -> value
    warnings: tuple[str, ...] = ()
    fitted: GroundFile | None = None  # the file that the law comes from
    tip_diameter: float = 0.0  # of the platform [m]
    of_earth: bool = False  # whether K is that of grains at 1 g, and the grains are under a much smaller gravity

    @property
    def law(self) -> Ground | None:
        """What computes the force under a row; None: the spring-damper of K and C."""
        if self.fitted is None or self.fitted.law == "spring-damper":
            return None
        return Ground(name=self.fitted.law, parameters=self.fitted.values, spikes_per_row=SPIKES_PER_ROW)

    @property
    def ground(self) -> str:
        """The compliant ground, as text."""
        if self.law is not None:
            return say("of_law", surface=self.surface, law=self.law.name)
        return f"{self.surface} (K = {self.stiffness:g} N/m, C = {self.damping:g} N s/m a row)"

    def sentences(self) -> list[str]:
        """One line for each number and choice that was not given: every default is reported."""
        return defaults_said(self.choices, self.numbers)


def plan_hop(settings: HopSettings, platform_file: Path | None = None) -> HopPlan:
    """The numbers that `settings` stand for; `platform_file` stands in for ``settings.platform``, where copied.

    Raises ValueError, naming the setting, for an unknown platform or surface, and numbers that cannot be.
    """
    platform = find_platform(platform_file or settings.platform)
    of_platform = platform_numbers(settings.platform, file=platform_file, in_plane=False)
    numbers = Settled(settings)
    given = settings.model_fields_set
    numbers["gravity"] = Number(settings.gravity, "m/s2", "given" if "gravity" in given else "default")
    if settings.asks_for == "distance":
        numbers.settle("distance", DEFAULT_DISTANCE, "default")
    for name in ("body_radius", "wheel_speed_0"):
        if getattr(settings, name) is not None:
            numbers.settle(name, math.nan, "given")
    numbers.settle_platform(of_platform)
    check_spike_length(numbers)
    numbers.settle("lean", of_platform.lean, f"platform {of_platform.name}")
    numbers.settle_limits(of_platform)
    own, brake = platform.wheel(), of_platform.brake_words
    brake_time = numbers.settle_brake_time(settings.actuator, of_platform)
    if settings.actuator == "brake" and brake_time is None:
        numbers.settle("torque", own.brake_torque, f"{brake} of platform {of_platform.name}, at its largest")
    elif settings.torque is not None and brake_time is None:
        numbers.settle("torque", settings.torque, "given")
    fitted = fitted_ground(settings.ground)
    surface, warnings = numbers.settle_surface(settings.surface, fitted=fitted, row_of=SPIKES_PER_ROW)
    whose = f"platform {of_platform.name}"
    warnings += of_other_spikes(numbers, surface, diameter=of_platform.spike_diameter, whose=whose)
    if fitted is not None and fitted.law != "spring-damper":
        for name in ("stiffness", "damping"):
            del numbers[name]
    wheel = replace(
        own, inertia=numbers.value("wheel_inertia"), max_speed=numbers.value("max_wheel_speed"),
        motor_torque=numbers.value("max_motor_torque"),
    )  # fmt: skip
    body = ("mass", "inertia", "spike_length", "wheel_inertia", "stiffness", "damping", "mu_s", "mu_d")
    own_numbers: Json = {name: numbers.value(name) for name in body if name in numbers}
    Trial(gravity_sim=settings.gravity, gravity=settings.gravity, **own_numbers)  # refuses what no body can have
    warnings += numbers.check_actuation(settings.actuator, of_platform) + numbers.check_body(of_platform)
    mass, earth = numbers.value("mass"), []
    if fitted is None:
        earth = of_earth(numbers, surface, weight=mass * settings.gravity, mass=mass, counterweight=0.0)
    if brake_time is not None and settings.wheel_speed_0 and wheel.inertia == of_platform.wheel_inertia:
        warnings += beyond_brake(wheel.inertia * settings.wheel_speed_0 / brake_time, of_platform)
    tumbler = Tumbler(
        mass=numbers.value("mass"), inertia=numbers.value("inertia"), spike_length=numbers.value("spike_length"),
        lean=of_platform.lean, gravity=settings.gravity, mu_s=numbers.value("mu_s"), mu_d=numbers.value("mu_d"),
    )  # fmt: skip
    choices = {name: str(getattr(settings, name)) for name in ("platform", "actuator") if name not in given}
    if settings.surface is None:
        choices["surface"] = surface
    if settings.body_radius is None:
        choices["body_radius"] = "none, a flat ground"
    return HopPlan(
        platform=platform, wheel=wheel, brake=brake, tumbler=tumbler, surface=surface,
        stiffness=own_numbers.get("stiffness", 0.0), damping=own_numbers.get("damping", 0.0),
        brake_time=brake_time, spike_count=of_platform.spike_count, fitted=fitted,
        tip_diameter=of_platform.spike_diameter,
        distance=numbers.value("distance") if settings.asks_for == "distance" else None, numbers=numbers,
        choices=choices, warnings=(*warnings, *earth), of_earth=bool(earth),
    )  # fmt: skip


def plan_on(plan: HopPlan, fitted: GroundFile) -> HopPlan:
    """The same hop on the law of another ground file."""
    if fitted.law != "spring-damper":
        return replace(plan, fitted=fitted)
    stiffness, damping = (SPIKES_PER_ROW * fitted.values[name] for name in ("stiffness", "damping"))
    return replace(plan, fitted=fitted, stiffness=stiffness, damping=damping)
