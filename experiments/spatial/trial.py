"""The numbers of a platform in space as they are settled, and the `SpatialTrial` of them."""

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from experiments.platform import settled
from experiments.platform.settled import check_spike_length
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


@dataclass(frozen=True, kw_only=True)
class SpatialPlan(settled.Plan):
    """A trial in space."""

    trial: SpatialTrial


def plan_spatial(settings: SpatialSettings, *, platform_file: Path | None = None) -> SpatialPlan:
    """The trial that `settings` describe. `platform_file` stands in for ``settings.platform``, where that was copied.

    Raises ValueError, naming the setting, for an unknown surface or platform, an axis without a wheel, and impossible
    numbers of motor, brake, wheel or rig.
    """
    platform = find_platform(settings.platform if platform_file is None else platform_file)
    whose = f"platform {settings.platform}"
    numbers = settled.Settled(settings)
    numbers["mass"] = settled.Number(platform.mass, "kg", whose)
    length = settled.Number(platform.stance().spike_length, "m", whose)
    check_spike_length(
        {**numbers, "inertia": settled.Number(platform.moment(), "kg m2", whose), "spike_length": length}
    )
    surface, warnings = numbers.settle_surface(settings.surface, spikes_per_row=SPIKES_PER_ROW)
    gravity, counterweight = _settle_gravity(settings, platform, numbers)
    trial = SpatialTrial(
        platform=platform, gravity=gravity, counterweight=counterweight, mu_s=numbers.value("mu_s"),
        mu_d=numbers.value("mu_d"), ground_parameters={key: numbers.value(key) for key in ("stiffness", "damping")},
        torques=_torques(settings, platform, numbers), torque_in_flight=settings.torque_in_flight,
    )  # fmt: skip
    warnings += settled.of_other_spikes(numbers, surface, diameter=2 * platform.tip_radius, whose=whose)
    weight = float(np.linalg.norm(trial.weight))
    warnings += settled.of_earth(numbers, surface, weight=weight, mass=platform.mass, counterweight=counterweight)
    choices = {"surface": surface} if settings.surface is None else {}
    choices |= settled.at_default(settings, {
        "platform": "", "ground": "", "actuator": "", "duration": " s", "turn": " rad", "velocity": " m/s",
        "angular_velocity": " rad/s", "torque_in_flight": "",
    })  # fmt: skip
    return SpatialPlan(trial=trial, numbers=numbers, surface=surface, choices=choices, warnings=tuple(warnings))


def _settle_gravity(settings: SpatialSettings, platform: Platform, numbers: settled.Settled) -> tuple[float, float]:
    """Gravity of the platform [m/s2] and counterweight [kg]."""
    if settings.gravity is not None:
        numbers["gravity_sim"] = settled.Number(settings.gravity, "m/s2", "given")
        return settings.gravity, 0.0
    stated = settings.rig if settings.rig is not None else DEFAULT_RIG
    if fault := settled.rig_fault(stated):
        raise ValueError(fault)
    rig = Rig.offloading(platform.mass, stated * STANDARD_GRAVITY, reading=settings.rig_reading)
    read = f"rig = {stated:g}{'' if settings.rig is not None else ' by default'}, read as {settings.rig_reading}"
    numbers["gravity_sim"] = settled.Number(rig.gravity_sim, "m/s2", read)
    numbers["counterweight"] = settled.Number(rig.counterweight, "kg", "of that rig")
    return rig.gravity_sim, rig.counterweight


def _torques(settings: SpatialSettings, platform: Platform, numbers: settled.Settled) -> tuple[TorqueHistory, ...]:
    """The history of each wheel that is driven or turns."""
    torque = settings.torque
    if torque is None:
        torque = (0.0, min(TORQUE, platform.wheel().motor_torque), 0.0) if settings.placed else ZERO
    until = math.inf if settings.torque_until is None else settings.torque_until
    made = []
    for axis, direction, value, speed in zip("xyz", np.eye(3), torque, settings.wheel_speed_0, strict=True):
        origin = "given" if settings.torque is not None else "default"
        numbers[f"torque_{axis}"] = settled.Number(value, "N m", origin)
        numbers[f"wheel_speed_0_{axis}"] = settled.Number(speed, "rad/s", "given" if speed else "default")
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
