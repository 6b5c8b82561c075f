"""From the settings of a hop to its numbers, each with where it comes from."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from rigid.actuation import Flywheel
from rigid.hop import Tumbler
from rigid.platform import Platform
from rigid.platform_files import find_platform

from .hop_settings import HopSettings
from .surfaces import find_surface
from .tumble_platform import Number, defaults_said, platform_numbers

__all__ = ["HopPlan", "brake_words", "plan_hop"]


@dataclass(frozen=True, kw_only=True)
class HopPlan:
    """The platform and the ground of a hop, and what is said of them."""

    platform: Platform
    wheel: Flywheel
    tumbler: Tumbler
    surface: str
    stiffness: float
    """K of a row [N/m]."""
    damping: float
    """C of a row [N s/m]."""
    spike_count: int | None
    """Rows of tips for the planar model; None where they are not at equal angles."""
    numbers: Mapping[str, Number]
    choices: Mapping[str, str]
    """What else stands at its default: name -> value."""
    warnings: tuple[str, ...] = ()

    def sentences(self) -> list[str]:
        """One line for each number and choice that was not given: every default is said."""
        return defaults_said(self.choices, self.numbers)


def plan_hop(settings: HopSettings) -> HopPlan:
    """The numbers that `settings` stand for.

    Raises ValueError, naming the setting, for a platform or a surface there is not, a torque beyond the platform's, and
    numbers that cannot be.
    """
    platform, material = find_platform(settings.platform), find_surface(settings.surface)
    stance, wheel = platform.stance(), platform.wheel()
    numbers: dict[str, Number] = {}
    for name, unit in (("gravity", "m/s2"), ("distance", "m")):
        value = getattr(settings, name)
        numbers[name] = Number(value, unit, "default" if value == HopSettings.model_fields[name].default else "given")

    if settings.body_radius is not None:
        numbers["body_radius"] = Number(settings.body_radius, "m", "given")

    def settle(name: str, unit: str, default: float, origin: str) -> float:
        given = getattr(settings, name, None)
        numbers[name] = Number(default, unit, origin) if given is None else Number(given, unit, "given")
        return numbers[name].value

    said = f"platform {settings.platform}"
    mass = settle("mass", "kg", platform.mass, said)
    inertia = settle("inertia", "kg m2", platform.moment(), said)
    length = settle("spike_length", "m", stance.spike_length, said)
    lean = settle("lean", "rad", stance.lean, said)
    settle("wheel_inertia", "kg m2", wheel.inertia, said)
    settle("max_wheel_speed", "rad/s", wheel.max_speed, said)
    if settings.actuator == "brake":
        settle("torque", "N m", wheel.brake_torque, f"{brake_words(wheel)} of {said}, at its largest")
    of_surface = f"surface {material.name}"
    stiffness = settle("stiffness", "N/m", material.stiffness, of_surface)
    damping = settle("damping", "N s/m", material.damping, of_surface)
    mu_s = settle("mu_s", "1", material.mu_s, of_surface)
    mu_d = (
        settle("mu_d", "1", material.mu_d, of_surface)
        if settings.mu_s is None
        else settle("mu_d", "1", 0.5 * mu_s, "default: half of mu_s")
    )
    if mu_d > mu_s:
        raise ValueError(f"mu_d = {mu_d:g} is above mu_s = {mu_s:g} ({numbers['mu_s'].origin}): at most that would do")
    tumbler = Tumbler(
        mass=mass, inertia=inertia, spike_length=length, lean=lean, gravity=settings.gravity, mu_s=mu_s, mu_d=mu_d
    )
    choices = {
        name: str(getattr(settings, name))
        for name in ("platform", "actuator", "surface")
        if getattr(settings, name) == HopSettings.model_fields[name].default
    }
    if settings.body_radius is None:
        choices["body_radius"] = "none, a flat ground"
    guess = f"stiffness, damping and friction of {material.name} are {material.source}"
    return HopPlan(
        platform=platform, wheel=wheel, tumbler=tumbler, surface=material.name, stiffness=stiffness, damping=damping,
        spike_count=_spike_count(settings.platform), numbers=numbers, choices=choices,
        warnings=(guess,) if material.guess else (),
    )  # fmt: skip


def brake_words(wheel: Flywheel) -> str:
    """What slows the wheel. A platform file without a brake_torque lets the motor do it."""
    return "the brake" if wheel.brake_torque > wheel.motor_torque or math.isinf(wheel.brake_torque) else "the motor"


def _spike_count(name: str) -> int | None:
    try:
        return platform_numbers(name).spike_count
    except ValueError:  # its rows are not at equal angles
        return None
