"""Numbers of a trial as they are settled: what is given wins over a model, a model over surface and platform.

Each keeps where it comes from, so that a run can print every default.
"""

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, Literal

from pydantic import BaseModel

from dem.grains.materials import material
from rigid.ground_file import GroundFile
from rigid.platform.rig import STANDARD_GRAVITY

from . import say
from .numbers import PlatformNumbers
from .surfaces import DEFAULT_SURFACE, Surface, find_surface, surface_of_grains

__all__ = [
    "Number",
    "Plan",
    "Settled",
    "at_default",
    "check_lengths",
    "check_spike_length",
    "of_earth",
    "open_stiffness",
    "refuse_other_grains",
    "rig_fault",
]

OTHER_BODY = 0.2
"""A mass, inertia or spike length that is off the platform's by more than this share is another body's."""

_OF_UNIT = {
    "kg": ("mass", "counterweight"),
    "kg m2": ("inertia", "wheel_inertia"),
    "m": ("spike_length", "distance", "body_radius"),
    "rad": ("lean",),
    "rad/s": ("max_wheel_speed", "wheel_speed_0"),
    "N m": ("max_motor_torque", "torque"),
    "N/m": ("stiffness",),
    "N s/m": ("damping",),
    "1": ("mu_s", "mu_d"),
    "m/s2": ("gravity_sim", "gravity"),
    "s": ("torque_until", "brake_time"),
}
_UNITS = {name: unit for unit, names in _OF_UNIT.items() for name in names}


@dataclass(frozen=True)
class Number:
    """One number of a trial: value, unit, and where it comes from ("given", "default", "surface steel", ...)."""

    value: float
    unit: str
    origin: str


def refuse_other_grains(surface: Surface, fitted: GroundFile | None) -> None:
    """Raise ValueError, naming both, where the law of a file was fitted to other grains than those of `surface`."""
    if fitted is None or surface.grains == fitted.material:
        return
    own = surface_of_grains(fitted.material)
    expected = say("leave_out_surface") if own is None else say("own_surface", own=own)
    made = say("made_of", grains=surface.grains) if surface.granular else say("hard")
    raise ValueError(say("other_grains", surface=surface, fitted=fitted, made=made, expected=expected))


class Settled(dict[str, Number]):
    """The numbers by name, in the order in which they were settled."""

    def __init__(self, settings: Any) -> None:
        super().__init__()
        self._settings = settings

    def settle(self, name: str, default: float, origin: str, *, in_model: float | None = None) -> float:
        """Settle `name`: as the settings give it, else as the model has it, else `default` from `origin`."""
        given = getattr(self._settings, name, None)
        if given is not None:
            self[name] = Number(float(given), _UNITS[name], "given")
        elif in_model is not None:
            self[name] = Number(in_model, _UNITS[name], "model")
        else:
            self[name] = Number(default, _UNITS[name], origin)
        return self[name].value

    def value(self, name: str) -> float:
        """The number called `name`."""
        return self[name].value

    def settle_platform(self, platform: PlatformNumbers, *, model: Any = None) -> None:
        """Settle mass, inertia and spike length of the platform, and its wheel's inertia. `model`: a `TumbleModel`."""
        origin = f"platform {platform.name}"
        for name in ("mass", "inertia", "spike_length"):
            in_model = getattr(model.platform, name) if model is not None else None
            self.settle(name, getattr(platform, name), origin, in_model=in_model)
        in_model = model.wheel.inertia if model is not None else None
        self.settle("wheel_inertia", platform.wheel_inertia, origin, in_model=in_model)

    def check_body(self, platform: PlatformNumbers) -> list[str]:
        """A warning where a body of another size is given, and its other numbers are still the platform's."""
        given = {name for name in ("mass", "inertia", "spike_length") if self[name].origin == "given"}
        far = any(abs(self[name].value / getattr(platform, name) - 1) > OTHER_BODY for name in given)
        if not far or platform.spike_count is None:
            return []
        names = [name for name in ("mass", "inertia", "spike_length") if name not in given]
        kept = [*(f"{name} = {_said(name, self[name])}" for name in names), f"{platform.spike_count} rows of spikes"]
        return [say("other_body", given=", ".join(sorted(given)), kept=", ".join(kept), platform=platform)]

    def settle_limits(self, platform: PlatformNumbers, *, in_model: bool = False) -> None:
        """Settle how fast the wheel may turn and what the motor gives at most: as given, else those of the platform.

        They are limits of the platform's own wheel with its motor; of another one, or a model's, none is known (inf).
        """
        origin, known = f"platform {platform.name}", self.value("wheel_inertia") == platform.wheel_inertia
        if in_model or not known:
            other = f"wheel_inertia is given: not the wheel of {platform.name}"
            origin, known = "a model says nothing of it" if in_model else other, False
        for name in ("max_wheel_speed", "max_motor_torque"):
            self.settle(name, getattr(platform, name) if known else math.inf, origin)

    def settle_surface(
        self,
        surface: str | None,
        *,
        model: Any = None,
        spikes_per_row: float = 1.0,
        fitted: GroundFile | None = None,
        row_of: float = 2.0,
    ) -> tuple[str, list[str]]:
        """Settle K, C and friction; return the material's name and warnings about it. `model`: a `TumbleModel`.

        K and C are of a row, or of one of its `spikes_per_row`, half a row's where that is 2. Those of a spring-damper
        in `fitted`, which is of one spike, are multiplied by `row_of`; friction is that of the surface of its grains.

        Raises ValueError for an unknown surface or one of other grains than `fitted`, and for more sliding than static
        friction.
        """
        material: Any
        warnings: list[str] = []
        if fitted is not None and surface is None and model is None:
            surface = surface_of_grains(fitted.material)
            if surface is None:
                warnings.append(say("friction_of_default", fitted=fitted, surface=DEFAULT_SURFACE))
        if surface is None and model is not None:
            material, name, origin = model.surface, model.surface.kind, "model"
        else:
            material = found = find_surface(surface or DEFAULT_SURFACE)
            name, origin = found.name, f"surface {found.name}"
            if surface is not None:
                refuse_other_grains(found, fitted)
            warnings += [say("guess", surface=found)] if found.guess and fitted is None else []
        shared = origin if spikes_per_row == 1 else f"{origin}, a row's halved"
        for key in ("stiffness", "damping"):
            if fitted is not None and fitted.law == "spring-damper":
                of_row = f"ground file, of one spike, times {row_of:g}"
                self[key] = Number(row_of * fitted.values[key], _UNITS[key], of_row)
            else:
                self.settle(key, getattr(material, key) / spikes_per_row, shared)
            if not math.isfinite(self.value(key) * self.value(key)):
                raise ValueError(
                    f"{key} = {self.value(key):g} {_UNITS[key]}: its square is no finite number; expected below 1e154"
                )
        if origin.startswith("surface ") and self["stiffness"].origin == shared:
            warnings += open_stiffness(material)
        self.settle("mu_s", material.mu_s, origin)
        if self["mu_s"].origin == "given":
            self.settle("mu_d", 0.5 * self.value("mu_s"), "default: half of mu_s")
        else:
            sliding = material.mu_d if material.mu_d is not None else 0.5 * material.mu_s
            self.settle("mu_d", sliding, origin)
        mu_s, mu_d = self["mu_s"], self["mu_d"]
        if mu_d.value > mu_s.value:
            raise ValueError(say("sliding_above_static", mu_d=mu_d.value, mu_s=mu_s))
        return name, warnings

    def check_actuation(self, actuator: Literal["motor", "brake"], platform: PlatformNumbers) -> list[str]:
        """Warnings about torque and wheel, of a tumble and of a hop, as far as they are settled.

        A brake stronger than the platform's own gets a warning only: it is an impulse in the limit; of another wheel's
        brake nothing is known. Raises ValueError, naming the setting, for a torque or first wheel speed beyond limits.
        """
        speed, fastest = self.get("wheel_speed_0"), self["max_wheel_speed"]
        if speed is not None and speed.value > fastest.value:
            raise ValueError(say("beyond_wheel", speed=speed.value, fastest=fastest))
        if "torque" not in self:
            return []
        torque, strongest, wheel = self["torque"].value, self["max_motor_torque"], self["wheel_inertia"]
        if actuator == "motor" and torque > strongest.value * (1 + 1e-9):
            of_platform = f"the motor of platform = {platform.name!r}"
            whose = of_platform if strongest.origin != "given" else "max_motor_torque (given)"
            raise ValueError(say("beyond_motor", torque=torque, whose=whose, most=strongest.value))
        own = wheel.origin != "model" and wheel.value == platform.wheel_inertia
        return beyond_brake(torque, platform) if actuator == "brake" and own else []

    def settle_brake_time(self, actuator: Literal["motor", "brake"], platform: PlatformNumbers) -> float | None:
        """Settle the time in which a brake stops the wheel [s], unless a torque is given or the brake has one."""
        own = platform.brake_time if self._settings.torque is None else None
        if actuator != "brake" or (self._settings.brake_time is None and own is None):
            return None
        return self.settle("brake_time", own or math.nan, f"platform {platform.name}")


def beyond_brake(torque: float, platform: PlatformNumbers) -> list[str]:
    """A warning about a torque [N m] beyond the platform's own brake."""
    if torque <= platform.brake_torque * (1 + 1e-9):
        return []
    return [say("beyond_brake", torque=torque, brake=platform.brake_words, platform=platform)]


@dataclass(frozen=True, kw_only=True)
class Plan:
    """A trial, its numbers and where they come from."""

    trial: Any
    numbers: Mapping[str, Number]
    surface: str  # Name of the material
    choices: Mapping[str, str]  # What else was left at its default: name -> value, as a person would type it
    warnings: tuple[str, ...] = ()

    def sentences(self) -> list[str]:
        """One line for each number and choice that was not given."""
        return defaults_said(self.choices, self.numbers)

    def announcement(self) -> list[str]:
        """What was not given, then the warnings, as they are shown before the run."""
        return [*self.sentences(), *(f"warning: {warning}" for warning in self.warnings)]

    def trial_table(self, weight: float) -> dict[str, Mapping[str, Any]]:
        """The numbers as entries of a result, the `weight` [N] last."""
        numbers = {**self.numbers, "weight": Number(weight, "N", "(m + m_b) g_sim")}
        return {name: asdict(number) for name, number in numbers.items()}


def at_default(settings: BaseModel, units: Mapping[str, str]) -> dict[str, str]:
    """Those settings that were not given, in the order of `units`: name -> value with its unit."""
    return {
        name: f"{getattr(settings, name)}{unit}" for name, unit in units.items()
        if name not in settings.model_fields_set
    }  # fmt: skip


def defaults_said(choices: Mapping[str, str], numbers: Mapping[str, Number]) -> list[str]:
    """One line for each choice at its default and each number that was not given: every default is reported."""
    lines = [f"{name} = {value} (default)" for name, value in choices.items()]
    for name, number in numbers.items():
        if number.origin != "given":
            lines.append(f"{name} = {_said(name, number)} ({number.origin})")
    return lines


def _said(name: str, number: Number) -> str:
    if math.isinf(number.value):
        return "no end" if name == "torque_until" else "no limit known"
    return f"{number.value:.6g}" + ("" if number.unit == "1" else f" {number.unit}")


def open_stiffness(surface: Surface) -> list[str]:
    """A warning with the range of K of a row, where the runs behind it leave one; else none."""
    if surface.stiffness_range is None:
        return []
    low, high = surface.stiffness_range
    return [say("open_stiffness", surface=surface, low=low, high=high, factor=math.sqrt(high / low))]


def of_other_spikes(numbers: Mapping[str, Number], surface: str, *, diameter: float, whose: str) -> list[str]:
    """A warning where K or C is the surface's and was found with other spikes than these [m]; 0: none."""
    taken = [name for name in ("stiffness", "damping") if numbers[name].origin.startswith("surface ")]
    own = find_surface(surface).spike if taken else None
    if own is None or math.isclose(diameter, own, rel_tol=1e-6):
        return []
    found = f"they are {1e3 * diameter:.4g} mm thick" if diameter > 0 else "there are none"
    names = " and ".join(taken)
    return [say("other_spikes", names=names, surface=surface, own=1e3 * own, whose=whose, found=found)]


def of_earth(
    numbers: Mapping[str, Number], surface: str, *, weight: float, mass: float, counterweight: float
) -> list[str]:
    """A warning in flight where K is the surface's, found in grains at 1 g; `weight` in N, masses in kg."""
    own = find_surface(surface)
    gravity = weight / mass
    if counterweight > 0 or own.grains is None or gravity > 0.5 * STANDARD_GRAVITY or gravity == 0:
        return []
    if not numbers["stiffness"].origin.startswith(("surface ", "half of")):
        return []
    key = "of_earth" if material(own.grains).cohesion == "none" else "of_earth_cohesive"
    return [say(key, surface=surface, gravity=gravity, less=STANDARD_GRAVITY / gravity)]


def rig_fault(stated: float, local: float = STANDARD_GRAVITY) -> str | None:
    """That a rig leaves more than the local gravity [m/s2], in words; `stated` is in units of 9.80665 m/s2."""
    here = local / STANDARD_GRAVITY
    if stated < here:
        return None
    meant = stated / STANDARD_GRAVITY
    asked = f" ({stated:g} m/s2 are {meant:.3g} g)" if meant < here else ""
    return say("rig_too_heavy", stated=stated, here=here, asked=asked)


LONGEST_SPIKE = 100.0
"""From the centre to a tip, over the radius of gyration [1]: 1.9 of the Hedgehog, 17 of a ball whose spikes stand ten
of its radii out of it; millimetres for metres make a thousand times as much."""
LARGEST = {"spike_diameter": 1.0, "spike_clear": 2.0, "grain": 1.0, "coarse": 1.0, "bed_size": 100.0}
"""Of spikes, grains and their bed, over the distance from the centre to a tip [1]. What is too large by less than that,
as a grain larger than its spike, is refused elsewhere, with what is allowed."""


def check_spike_length(numbers: Mapping[str, Number]) -> None:
    """Raise ValueError for spikes out of proportion to the body that mass and inertia are of."""
    length = numbers["spike_length"]
    gyration = math.sqrt(numbers["inertia"].value / numbers["mass"].value)
    times, metres = length.value / gyration, _metres(length.value, LONGEST_SPIKE * gyration)
    if length.value > LONGEST_SPIKE * gyration:
        raise ValueError(
            say("long_spike", length=length, times=times, gyration=gyration, most=LONGEST_SPIKE, metres=metres)
        )


def check_lengths(settings: Any, spike_length: float, **own: float) -> None:
    """Raise ValueError for what of LARGEST is out of proportion to `spike_length` [m]; `own` stands for `settings`."""
    for name, share in LARGEST.items():
        value, most = own.get(name, getattr(settings, name, None)), share * spike_length
        for k, size in enumerate(value if isinstance(value, tuple) else (value,)):
            if size is not None and size > most:
                part = f"[{k}]" if isinstance(value, tuple) else ""
                metres = _metres(size, most)
                raise ValueError(
                    say("too_large", name=name, part=part, size=size, length=spike_length, most=most, metres=metres)
                )


def _metres(value: float, most: float) -> str:
    return f"metres are expected: {1e-3 * value:g}?" if 1e-3 * value <= most else "metres are expected"
