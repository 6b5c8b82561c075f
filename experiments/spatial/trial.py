"""The numbers of a platform in space as they are settled, and the `SpatialTrial` of them."""

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from experiments.platform.lengths import check_spike_length
from experiments.platform.settled import Number, defaults_said, of_earth, of_other_spikes, rig_fault
from experiments.platform.surfaces import DEFAULT_SURFACE, find_surface
from rigid.platform.actuation import TorqueHistory
from rigid.platform.files import find_platform
from rigid.platform.platform import Platform
from rigid.platform.rig import STANDARD_GRAVITY, Rig
from rigid.spatial.spatial import SpatialTrial

from . import say
from .settings import ZERO, SpatialSettings

__all__ = ["SpatialPlan", "plan_spatial"]

DEFAULT_RIG, TORQUE = 0.0085, 0.22
SPIKES_PER_ROW = 2.0  # Surfaces have their K and C for a row of two spikes


@dataclass(frozen=True)
class SpatialPlan:
    """A trial in space, its numbers and where they come from."""

    trial: SpatialTrial
    numbers: dict[str, Number]
    surface: str
    choices: dict[str, str]
    warnings: tuple[str, ...]

    def sentences(self) -> list[str]:
        """What was not given, a line each."""
        return defaults_said(self.choices, self.numbers)

    def announcement(self) -> list[str]:
        """What was not given, then the warnings, as they are shown before the run."""
        return [*self.sentences(), *(f"warning: {warning}" for warning in self.warnings)]


def plan_spatial(settings: SpatialSettings, *, platform_file: Path | None = None) -> SpatialPlan:
    """The trial that `settings` describe. `platform_file` stands in for ``settings.platform``, where that was copied.

    Raises ValueError, naming the setting, for a surface or platform there is not, an axis without a wheel, and what
    motor, brake, wheel or rig cannot be.
    """
    platform = find_platform(settings.platform if platform_file is None else platform_file)
    surface = find_surface(settings.surface or DEFAULT_SURFACE)
    length = Number(platform.stance().spike_length, "m", f"platform {settings.platform}")
    moment = Number(platform.moment(), "kg m2", length.origin)
    check_spike_length({"mass": Number(platform.mass, "kg", ""), "inertia": moment, "spike_length": length})
    own, half = f"surface {surface.name}", f"surface {surface.name}, a row's halved"
    numbers: dict[str, Number] = {"mass": Number(platform.mass, "kg", f"platform {settings.platform}")}

    def settle(name: str, unit: str, default: float, origin: str) -> float:
        given = getattr(settings, name)
        numbers[name] = Number(default, unit, origin) if given is None else Number(float(given), unit, "given")
        return numbers[name].value

    stiffness = settle("stiffness", "N/m", surface.stiffness / SPIKES_PER_ROW, half)
    damping = settle("damping", "N s/m", surface.damping / SPIKES_PER_ROW, half)
    mu_s = settle("mu_s", "1", surface.mu_s, own)
    if settings.mu_s is None:
        mu_d = settle("mu_d", "1", surface.mu_d, own)
    else:
        mu_d = settle("mu_d", "1", 0.5 * mu_s, "default: half of mu_s")
    if mu_d > mu_s:
        raise ValueError(say("sliding_above_static", mu_d=mu_d, mu_s=numbers["mu_s"]))
    gravity, counterweight = _settle_gravity(settings, platform, numbers)
    trial = SpatialTrial(
        platform=platform, gravity=gravity, counterweight=counterweight, mu_s=mu_s, mu_d=mu_d,
        ground_parameters={"stiffness": stiffness, "damping": damping}, torques=_torques(settings, platform, numbers),
        torque_in_flight=settings.torque_in_flight,
    )  # fmt: skip
    warnings = [say("guess", surface=surface)] if surface.guess else []
    whose = f"platform {settings.platform}"
    warnings += of_other_spikes(numbers, surface.name, diameter=2 * platform.tip_radius, whose=whose)
    weight = float(np.linalg.norm(trial.weight))
    warnings += of_earth(numbers, surface.name, weight=weight, mass=platform.mass, counterweight=counterweight)
    return SpatialPlan(trial, numbers, surface.name, _choices(settings, surface.name), tuple(warnings))


def _settle_gravity(settings: SpatialSettings, platform: Platform, numbers: dict[str, Number]) -> tuple[float, float]:
    """Gravity of the platform [m/s2] and counterweight [kg]."""
    if settings.gravity is not None:
        numbers["gravity_sim"] = Number(settings.gravity, "m/s2", "given")
        return settings.gravity, 0.0
    stated = settings.rig if settings.rig is not None else DEFAULT_RIG
    if fault := rig_fault(stated):
        raise ValueError(fault)
    rig = Rig.offloading(platform.mass, stated * STANDARD_GRAVITY, reading=settings.rig_reading)
    read = f"rig = {stated:g}{'' if settings.rig is not None else ' by default'}, read as {settings.rig_reading}"
    numbers["gravity_sim"] = Number(rig.gravity_sim, "m/s2", read)
    numbers["counterweight"] = Number(rig.counterweight, "kg", "of that rig")
    return rig.gravity_sim, rig.counterweight


def _torques(settings: SpatialSettings, platform: Platform, numbers: dict[str, Number]) -> tuple[TorqueHistory, ...]:
    """The history of each wheel that is driven or turns."""
    torque = settings.torque
    if torque is None:
        torque = (0.0, min(TORQUE, platform.wheel().motor_torque), 0.0) if settings.placed else ZERO
    until = math.inf if settings.torque_until is None else settings.torque_until
    made = []
    for axis, direction, value, speed in zip("xyz", np.eye(3), torque, settings.wheel_speed_0, strict=True):
        origin = "given" if settings.torque is not None else "default"
        numbers[f"torque_{axis}"] = Number(value, "N m", origin)
        numbers[f"wheel_speed_0_{axis}"] = Number(speed, "rad/s", "given" if speed else "default")
        if not value and not speed:
            continue
        wheel = next((each for each in platform.wheels if np.allclose(each.axis, direction)), None)
        if wheel is None:
            there = ", ".join(str(each.axis) for each in platform.wheels)
            raise ValueError(say("no_wheel", torque=torque, s=settings, axis=axis, there=there))
        try:
            made.append(TorqueHistory.constant(wheel, value, until, actuator=settings.actuator, wheel_speed_0=speed))
        except ValueError as error:
            raise ValueError(f"about {axis}: {error}") from None
    return tuple(made)


def _choices(settings: SpatialSettings, surface: str) -> dict[str, str]:
    """The settings that are no numbers of the trial and stand at their defaults."""
    found = {"surface": surface} if settings.surface is None else {}
    units = {"duration": " s", "turn": " rad", "velocity": " m/s", "angular_velocity": " rad/s"}
    names = ["platform", "ground", "actuator", "duration", "turn", "velocity", "angular_velocity", "torque_in_flight"]
    for name in names:
        if name not in settings.model_fields_set:
            found[name] = f"{getattr(settings, name)}{units.get(name, '')}"
    return found
