"""From the settings of a tumble to the numbers of its trial, each with where it comes from.

Given settings override the model; the model overrides the surface's numbers and the defaults below.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from experiments.campaign import TumbleModel, read_model
from experiments.platform import settled
from experiments.platform.ground_file import SPIKES_PER_ROW, fitted_ground
from experiments.platform.numbers import PlatformNumbers, platform_numbers
from experiments.platform.settled import check_spike_length
from experiments.runs.types import Json
from rigid.ground.laws import find_law
from rigid.ground_file import GroundFile
from rigid.model.trial import Effect, Ground, Trial
from rigid.platform.rig import STANDARD_GRAVITY, Rig
from rigid.terms import EFFECTS

from . import say
from .settings import TumbleSettings

__all__ = ["DEFAULT_RIG", "Spikes", "TumblePlan", "model_trial", "plan_tumble", "spikes_of", "turns_of"]

TORQUE = 0.22  # The paper's middle one [N m]
DEFAULT_RIG = 0.0085  # The paper's lower gravity [9.80665 m/s2]


@dataclass(frozen=True)
class Spikes:
    """Spikes of a platform as grains meet them."""

    diameter: float  # [m]
    clear: float  # how far they stand out of the hull [m]
    of_platform: tuple[str, ...]  # which of the two were not given, and are the platform's: by the settings' names


def spikes_of(settings: TumbleSettings, own: PlatformNumbers) -> Spikes:
    """The spikes of a tumble on grains: as given, else those of the platform, `own`.

    In the plane a spike has its full length, even if it leans sideways. Raises ValueError, naming the setting, for a
    platform without spikes.
    """
    given = {name: getattr(settings, name) for name in ("spike_diameter", "spike_clear")}
    not_given = tuple(name for name, value in given.items() if value is None)
    if not_given:
        if own.spike_diameter == 0:
            raise ValueError(say("no_spikes", platform=settings.platform, names=" and ".join(not_given)))
        given |= {name: getattr(own, name) for name in not_given}
    return Spikes(given["spike_diameter"], given["spike_clear"], not_given)


@dataclass(frozen=True, kw_only=True)
class TumblePlan(settled.Plan):
    """A trial in the plane."""

    trial: Trial
    platform: PlatformNumbers  # What gives the numbers that nothing else gives
    spikes: Spikes  # What grains meet of its spikes
    max_wheel_speed: float = math.inf  # Where a motor's torque ends [rad/s]
    fitted: GroundFile | None = None  # The file that the law comes from


def plan_tumble(
    settings: TumbleSettings,
    *,
    model_file: Path | None = None,
    platform: PlatformNumbers | None = None,
    spikes: Spikes | None = None,
    fitted: GroundFile | None = None,
) -> TumblePlan:
    """The trial that `settings` describe. `model_file` replaces ``settings.model``, where that was copied; `platform`
    replaces ``settings.platform``, where that was read. `spikes` replace those of the platform, `fitted` the ground
    file of ``settings.ground``.

    Raises ValueError, naming the setting, for an unknown surface, law, effect or parameter, and for a model that cannot
    be read. Also for numbers that no platform or rig can have.
    """
    source = model_file if model_file is not None else Path(settings.model) if settings.model is not None else None
    model = _read(source) if source is not None else None
    numbers = settled.Settled(settings)
    platform = platform_numbers(settings.platform) if platform is None else platform
    numbers.settle_platform(platform, model=model)
    check_spike_length(numbers)
    fitted = fitted_ground(settings.ground) if fitted is None else fitted
    surface, warnings = numbers.settle_surface(
        settings.surface, model=model, fitted=fitted, row_of=SPIKES_PER_ROW
    )  # fmt: skip
    _settle_gravity(settings, model, numbers)
    weak = platform.max_motor_torque < TORQUE
    torque, origin = (platform.max_motor_torque, f"motor of {platform.name}") if weak else (TORQUE, "default")
    if settings.drop_speed is not None:
        torque, origin = 0.0, "a landing"
    turning = numbers.settle("wheel_speed_0", 0.0, "default")
    brake_time = numbers.settle_brake_time(settings.actuator, platform)
    if brake_time is not None:
        del numbers["brake_time"]  # no number of a trial
        torque, origin = numbers.value("wheel_inertia") * turning / brake_time, f"wheel stopped in {brake_time:g} s"
    numbers.settle("torque", torque, origin)
    numbers.settle("torque_until", math.inf, "default: as long as the trial")
    values: Json = {name: number.value for name, number in numbers.items()}
    numbers.settle_limits(platform, in_model=model is not None)
    warnings += numbers.check_actuation(settings.actuator, platform)
    warnings += numbers.check_body(platform) if model is None else []
    ground = _ground(settings, fitted, numbers["gravity"].value)
    if ground is None:
        diameter = platform.spike_diameter if spikes is None else spikes.diameter
        whose = f"platform {platform.name}" if spikes is None else "this run"
        warnings += settled.of_other_spikes(numbers, surface, diameter=diameter, whose=whose)
    assert platform.spike_count is not None  # or it would have been refused
    trial = Trial(
        **values,
        spike_count=platform.spike_count if model is None else model.platform.rows,
        actuator=settings.actuator,
        ground=ground,
        effects=(*_model_effects(model, source), *_given_effects(settings.effects)),
    )
    if ground is not None:
        for name in ("stiffness", "damping"):
            del numbers[name]
        for name, value in ground.law.values(ground.parameters).items():
            unit = next(parameter.unit for parameter in ground.law.parameters if parameter.name == name)
            origin = "given" if name in ground.parameters else f"default of {ground.name}, of one spike"
            origin = "ground file, of one spike" if fitted is not None else origin
            numbers["ground_gravity" if name == "gravity" else name] = settled.Number(value, unit, origin)
    rows = f"rows of platform {platform.name}" if model is None else "model"
    numbers["spike_count"] = settled.Number(trial.spike_count, "1", rows)
    warnings += _rig_warnings(trial)
    if ground is None and model is None:
        warnings += settled.of_earth(
            numbers, surface, weight=trial.weight, mass=trial.mass, counterweight=trial.counterweight
        )
    spikes = spikes or Spikes(platform.spike_diameter, platform.spike_clear, ("spike_diameter", "spike_clear"))
    return TumblePlan(
        trial=trial, numbers=numbers, surface=surface, choices=_choices(settings, surface, model), platform=platform,
        spikes=spikes, warnings=tuple(warnings), max_wheel_speed=numbers.value("max_wheel_speed"), fitted=fitted,
    )  # fmt: skip


def _choices(settings: TumbleSettings, surface: str, model: TumbleModel | None) -> dict[str, str]:
    """Settings with their defaults that are not numbers of the trial."""
    found = {"surface": surface} if settings.surface is None and model is None else {}
    units = {
        "platform": "", "ground": "", "actuator": "", "duration": " s", "method": "", "sample_interval": " s"
    }  # fmt: skip
    if settings.gravity is None:
        units["rig_reading"] = ""
        if settings.rig is None:
            found["rig"] = f"{DEFAULT_RIG:g}"
    found |= settled.at_default(settings, units)
    if not settings.effects and model is None:
        found["effects"] = "none"
    return found


def _read(path: Path) -> TumbleModel:
    model = read_model(path)
    if not isinstance(model, TumbleModel):
        raise ValueError(f"model = {str(path)!r} is of kind {model.kind!r}: one of kind 'tumble' is accepted")
    return model


def _settle_gravity(settings: TumbleSettings, model: TumbleModel | None, numbers: settled.Settled) -> None:
    """Settle gravity_sim, local gravity and counterweight, in the rig or free of it."""
    if settings.gravity is not None:
        numbers["gravity_sim"] = settled.Number(settings.gravity, "m/s2", "given")
        numbers["gravity"] = settled.Number(settings.gravity, "m/s2", "free platform: the same")
        numbers["counterweight"] = settled.Number(0.0, "kg", "free platform")
        return
    if model is not None and model.rig is None and settings.rig is None:
        raise ValueError(f"gravity must be given: the model {settings.model!r} has no [rig] (m/s2, or rig)")
    in_model = model.rig if model is not None else None
    local = in_model.gravity if in_model is not None else STANDARD_GRAVITY
    stated = settings.rig if settings.rig is not None else DEFAULT_RIG
    if fault := settled.rig_fault(stated, local):
        raise ValueError(fault)
    counterweight = settings.counterweight
    origin = "given"
    if counterweight is None and in_model is not None and in_model.counterweight is not None:
        counterweight, origin = in_model.counterweight, "model"
    mass, wanted = numbers["mass"].value, stated * STANDARD_GRAVITY
    rig = Rig.offloading(mass, wanted, reading=settings.rig_reading, counterweight=counterweight, gravity=local)
    if counterweight is None:
        origin = "m (g - g_sim) / (g + g_sim)" if settings.rig_reading == "pair" else "m (1 - rig g0 / g)"
    read = f"rig = {stated:g}{'' if settings.rig is not None else ' by default'}, read as {settings.rig_reading}"
    numbers["gravity_sim"] = settled.Number(rig.gravity_sim, "m/s2", read)
    numbers["gravity"] = settled.Number(local, "m/s2", "model" if in_model is not None else "default")
    numbers["counterweight"] = settled.Number(rig.counterweight, "kg", origin)


def _rig_warnings(trial: Trial) -> list[str]:
    """Warnings of a counterweight that does not match the gravity."""
    if trial.counterweight == 0:
        return []
    hung = (trial.mass - trial.counterweight) * trial.gravity
    if abs(hung - trial.weight) <= 0.02 * trial.weight:
        return []
    return [say("weight_off", trial=trial, hung=hung)]


def _ground(settings: TumbleSettings, fitted: GroundFile | None, gravity: float) -> Ground | None:
    """The named law, or that of a file; None for the spring-damper of K and C.

    A law with a gravity of the grains has that of the place [m/s2], in the rig that of the laboratory, unless given.
    """
    if (settings.ground if fitted is None else fitted.law) == "spring-damper":
        return None
    if fitted is not None:
        return Ground(name=fitted.law, parameters=fitted.values, spikes_per_row=SPIKES_PER_ROW)
    parameters = dict(_assignment("ground_parameters", text) for text in settings.ground_parameters)
    try:
        parameters = find_law(settings.ground).in_gravity(gravity, parameters)
        return Ground(name=settings.ground, parameters=parameters, spikes_per_row=SPIKES_PER_ROW)
    except ValueError as error:
        raise ValueError(f"ground = {settings.ground!r}: {error}") from None


def _assignment(key: str, text: str) -> tuple[str, float]:
    name, equals, value = text.partition("=")
    try:
        return name.strip(), float(value)
    except ValueError:
        found = "has no number" if equals else "has no ="
        raise ValueError(f"{key} = {text!r} {found}: name=value is accepted, such as exponent=1.5") from None


def _model_effects(model: TumbleModel | None, path: Path | None) -> tuple[Effect, ...]:
    """The effects of a model; files of effects of one's own are expected beside it."""
    if model is None or path is None:
        return ()
    try:
        files = [path.parent / effect.file if effect.file is not None else None for effect in model.effect]
        return tuple(
            Effect(id=effect.id, parameters=effect.parameters, file=file)
            for effect, file in zip(model.effect, files, strict=True)
        )
    except ValueError as error:
        raise ValueError(f"{path}: [[effect]]: {error}") from None


def _given_effects(texts: tuple[str, ...]) -> tuple[Effect, ...]:
    """Effects from ``id`` and ``id.parameter=value``; parameters of one effect need not be adjacent."""
    found: dict[str, dict[str, float]] = {}
    for text in texts:
        head, equals, _ = text.partition("=")
        name, dot, parameter = head.partition(".")
        values = found.setdefault(name.strip(), {})
        if bool(dot) != bool(equals):
            raise ValueError(f"effects = {text!r}: expected id, or id.parameter=value such as pendulum.length=2.2")
        if dot:
            values[parameter.strip()] = _assignment("effects", text)[1]
    try:
        effects = tuple(Effect(id=name, parameters=values) for name, values in found.items())
    except ValueError as error:
        raise ValueError(f"effects: {error}") from None
    for effect in effects:
        if not found[effect.id]:  # every effect is off by its defaults
            numbers = ", ".join(f"{effect.id}.{p.name}=... [{p.unit}]" for p in EFFECTS[effect.id].parameters)
            raise ValueError(f"effects = {effect.id!r} alone changes nothing: give {numbers}")
    return effects


def turns_of(motors: Sequence[float], brakes: Sequence[float], wheel_speed: float) -> list[Json]:
    """The actuator of a trial for each torque [N m] of the settings: motors, then brakes.

    `wheel_speed` [rad/s] is that of a brake's wheel at the start.
    """
    of_brakes: list[Json] = [{"torque": torque, "actuator": "brake", "wheel_speed_0": wheel_speed} for torque in brakes]
    return [*({"torque": torque, "actuator": "motor"} for torque in motors), *of_brakes]


def model_trial(tables: Any, trial: Any, *, effects: tuple[Effect, ...] = ()) -> Trial:
    """The `Trial` of one ``[[trial]]`` of a campaign, or of a model of tumbles, with these effects."""
    platform, surface = tables.platform, tables.surface
    return Trial(
        mass=platform.mass, inertia=platform.inertia, spike_length=platform.spike_length, spike_count=platform.rows,
        stiffness=surface.stiffness, damping=surface.damping, mu_s=surface.mu_s, mu_d=surface.sliding_friction,
        gravity_sim=trial.gravity_sim, gravity=tables.local_gravity_of(trial),
        counterweight=tables.counterweight_of(trial), torque=trial.torque, torque_until=trial.torque_until,
        actuator=trial.actuator, wheel_inertia=tables.wheel.inertia, wheel_speed_0=trial.wheel_speed_0,
        effects=effects,
    )  # fmt: skip
