"""The FMU's side in Python: its variables, and what a step of it does (`pythonfmu3` calls the methods).

All FMUs of one process share one Python, so that everything of an instance is in the instance and in its resources.
"""

import io
import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from pythonfmu3 import (
    Boolean,
    DefaultExperiment,
    Float64,
    Fmi3Causality,
    Fmi3Initial,
    Fmi3Slave,
    Fmi3Status,
    Fmi3StepResult,
    Fmi3Variability,
    String,
    Unit,
)

from experiments.runs.version import __version__
from experiments.tumble.settings import TumbleSettings
from experiments.tumble.trial import DEFAULT_RIG, TumblePlan, plan_tumble
from rigid.ground_file import is_ground_file

from . import say
from .driven import DrivenPlatform
from .settings import OUTPUTS, FmuSettings

__all__ = ["MADE_OF", "PlatformSlave", "plan_platform"]

MADE_OF = "hedgebed.json"  # In the resources: settings that were given, name and version
OF_THE_FMU = (
    "height", "x_start", "theta_start", "vx_start", "vz_start", "omega_start", "wheel_speed_start", "torque_in_flight",
    "longest_step",
)  # fmt: skip
"""Settings of `FmuSettings` that `hedgebed tumble` does not have."""
FILES = ("platform", "ground")  # Settings that may name a file, which the FMU then contains
OF_THE_SPRING = ("stiffness", "damping")  # Parameters that a ground file gives, if it is of a spring-damper
NOT_GIVEN = -1.0  # Value of a parameter that takes its number from the surface, or is not used
UNITS = (
    Unit("m", m=1), Unit("m/s", m=1, s=-1), Unit("m/s2", m=1, s=-2), Unit("rad", rad=1), Unit("rad/s", rad=1, s=-1),
    Unit("N", kg=1, m=1, s=-2), Unit("N.m", kg=1, m=2, s=-2), Unit("N/m", kg=1, s=-2), Unit("N.s/m", kg=1, s=-1),
    Unit("J", kg=1, m=2, s=-2), Unit("s", s=1),
)  # fmt: skip
TEXTS = {
    "surface": "Surface: steel, brick, sand, sand-weak, jsc1a or jsc1a-heights",
    "platform": "Platform: hedgehog, cubli, mascot, minerva, cube, or a TOML file",
}
NUMBERS = {
    "gravity": ("m/s2", "Gravity of a free platform; below 0: the rig is used"),
    "rig": ("", "Gravity that the rig simulates, in 9.80665 m/s2; used where gravity is below 0"),
    "stiffness": ("N/m", "K under a row of spikes; below 0: that of the surface"),
    "damping": ("N.s/m", "C under a row of spikes that moves in; below 0: that of the surface"),
    "mu_s": ("", "Static friction; below 0: that of the surface"),
    "mu_d": ("", "Sliding friction; below 0: that of the surface, or half of mu_s"),
    "height": ("m", "Height of the centre at the start; below 0: at rest on the surface"),
    "x_start": ("m", "Position along the surface at the start"),
    "theta_start": ("rad", "Angle at the start, clockwise; needs height"),
    "vx_start": ("m/s", "Velocity along the surface at the start"),
    "vz_start": ("m/s", "Velocity upwards at the start; needs height"),
    "omega_start": ("rad/s", "Angular velocity at the start, clockwise"),
    "wheel_speed_start": ("rad/s", "Speed of the wheel at the start"),
}
SIGNED = ("x_start", "theta_start", "vx_start", "vz_start", "omega_start", "wheel_speed_start")
"""Parameters below 0 in their own right."""
Values = dict[str, float | str | bool]
Answer = Callable[[DrivenPlatform], float]
ANSWERS: dict[str, Answer] = {
    "x": lambda run: run.body.place[0],
    "z": lambda run: run.body.place[1],
    "theta": lambda run: run.body.place[2],
    "vx": lambda run: run.body.rates[0],
    "vz": lambda run: run.body.rates[1],
    "omega": lambda run: run.body.rates[2],
    "wheel_speed": lambda run: run.body.wheel_speed,
    "force_x": lambda run: run.master.wrench.force[0],
    "force_z": lambda run: run.master.wrench.force[2],
    "moment": lambda run: run.master.wrench.torque[1],
    "depth": lambda run: run.depth,
    "kinetic_energy": lambda run: run.body.kinetic_energy(0.0),
    "potential_energy": lambda run: run.body.potential_energy,
    "torque_work": lambda run: run.body.torque_work,
    "ground_work": lambda run: run.master.exchange.given,
    "ground_energy": lambda run: run.ground.energies()["springs"],
    "energy_residual": lambda run: run.energy_residual,
}
"""What each of `OUTPUTS` is, of a run."""


def plan_platform(settings: FmuSettings) -> TumblePlan:
    """The platform, its ground and their numbers, as `hedgebed tumble` settles them.

    Raises ValueError, naming the setting, for what there is not and what cannot be.
    """
    given = settings.model_dump(exclude_unset=True, exclude=set(OF_THE_FMU))
    return plan_tumble(TumbleSettings(torque=0.0, **given))


class PlatformSlave(Fmi3Slave):
    """An instance of the FMU. Parameters may change until the first step; a step goes on with the inputs of its start.

    Raises ValueError, naming the parameter, for what cannot be; the library then answers with fmi3Fatal and the
    sentence in its log. A step that cannot be made answers with fmi3Error.
    """

    def __init__(self, **named: Any) -> None:
        super().__init__(**named)
        made = json.loads((Path(self.resources) / MADE_OF).read_text(encoding="utf-8"))
        self._given: Values = made["settings"]
        self.modelName, self.version = made["name"], made["version"]
        self.description = say("description")
        self.default_experiment = DefaultExperiment(start_time=0.0, stop_time=3.0, step_size=1e-3)
        if made["version"] != __version__:
            self.log(say("other_version", made=made["version"], here=__version__), Fmi3Status.warning)
        self._rows: int = made["rows"]
        self._run: DrivenPlatform | None = None
        self.time, self._from = 0.0, 0.0
        self.torque, self.brake = 0.0, 0.0
        self.register_units(UNITS)
        self._register()

    def _register(self) -> None:
        settings = FmuSettings(**self._resolved(self._given))
        of_file = plan_platform(settings) if is_ground_file(settings.ground) else None
        fixed = {"causality": Fmi3Causality.parameter, "variability": Fmi3Variability.fixed}
        self._values: Values = {
            "surface": of_file.surface if of_file is not None else settings.surface or "brick",
            "platform": self._given.get("platform", settings.platform),
            "torque_in_flight": settings.torque_in_flight,
        }  # fmt: skip
        for name in NUMBERS:
            value = getattr(settings, name)
            if of_file is not None and of_file.trial.ground is None and name in OF_THE_SPRING:
                value = getattr(of_file.trial, name)
            self._values[name] = NOT_GIVEN if value is None else value
        if settings.gravity is None and settings.rig is None:
            self._values["rig"] = DEFAULT_RIG
        self._start = dict(self._values)
        self.register_variable(
            Float64("time", causality=Fmi3Causality.independent, variability=Fmi3Variability.continuous, unit="s")
        )
        for name, text in TEXTS.items():
            self.register_variable(String(name, description=text, **self._access(name), **fixed))
        for name, (unit, text) in NUMBERS.items():
            self.register_variable(
                Float64(name, description=text, unit=unit or None, **self._access(name), **fixed), nested=False
            )
        text = "Whether motor and brake act where no spike touches"
        self.register_variable(
            Boolean("torque_in_flight", description=text, **self._access("torque_in_flight"), **fixed)
        )
        moving = {"variability": Fmi3Variability.continuous, "unit": "N.m", "causality": Fmi3Causality.input}
        self.register_variable(
            Float64("torque", description="Torque of the motor on the platform, clockwise", **moving)
        )
        self.register_variable(Float64("brake", description="Largest torque of the brake on the wheel", **moving))
        outputs = [(name, *OUTPUTS[name], answer) for name, answer in ANSWERS.items()]
        outputs += [
            (f"normal_force[{row + 1}]", "N", f"Normal force on row {row + 1} of spikes, likewise", _load(row))
            for row in range(self._rows)
        ]
        for name, unit, text, answer in outputs:
            self.register_variable(
                Float64(
                    name, description=text, unit=unit, causality=Fmi3Causality.output, getter=self._answer(answer),
                    variability=Fmi3Variability.continuous, initial=Fmi3Initial.calculated,
                ),
                nested=False,
            )  # fmt: skip

    def _access(self, name: str) -> dict[str, Callable[..., Any]]:
        """How a parameter is read and set."""

        def set_value(value: Any) -> None:
            if value == self._values[name]:
                return
            if self._run is not None and self._run.time > 0:
                raise ValueError(say("started", name=name))
            self._values[name], self._run = value, None

        return {"getter": lambda: self._values[name], "setter": set_value}

    def _answer(self, answer: Answer) -> Callable[[], float]:
        return lambda: answer(self.run)

    @property
    def run(self) -> DrivenPlatform:
        """The platform, made when it is first needed."""
        if self._run is None:
            self._run = self._made()
        return self._run

    def _made(self) -> DrivenPlatform:
        settings = FmuSettings(**self._resolved(self._asked()))
        plan = plan_platform(settings)
        if plan.trial.spike_count != self._rows:
            raise ValueError(
                say("rows", platform=self._values["platform"], found=plan.trial.spike_count, own=self._rows)
            )
        for warning in plan.warnings:
            self.log(warning, Fmi3Status.warning)
        return DrivenPlatform(
            plan.trial, height=settings.height, x=settings.x_start, theta=settings.theta_start,
            rates=(settings.vx_start, settings.vz_start, settings.omega_start), wheel_speed=settings.wheel_speed_start,
            max_wheel_speed=plan.max_wheel_speed, in_flight=settings.torque_in_flight,
            longest_step=settings.longest_step,
        )  # fmt: skip

    def _asked(self) -> Values:
        """The settings as they were given to `hedgebed fmu`, with those that the importing program has changed."""
        asked = dict(self._given)
        changed = {name: value for name, value in self._values.items() if value != self._start[name]}
        for name, value in changed.items():
            asked.pop(name, None)
            if isinstance(value, str | bool) or name in SIGNED or not value < 0:
                asked[name] = value
        other = "gravity" if float(self._values["gravity"]) < 0 else "rig"
        if not math.isnan(float(self._values[other])):  # NaN is left in, to be refused by name
            asked.pop(other, None)
        return asked

    def _resolved(self, settings: Values) -> Values:
        """`settings` with the files that the FMU contains where they are now."""
        found = dict(settings)
        for name in FILES:
            file = Path(self.resources) / str(settings.get(name, ""))
            if name in settings and file.is_file():
                found[name] = str(file)
        return found

    def exit_initialization_mode(self) -> None:
        self.run  # noqa: B018  (made, and checked)

    def do_step(self, current_time: float, step_size: float) -> Fmi3StepResult:
        run = self.run
        if run.time == 0:  # pythonfmu3 0.3.4 does not hand on the start time of the initialisation
            self._from = current_time
        own = self._from + run.time
        try:
            if not abs(current_time - own) <= 1e-9 * max(1.0, abs(own)):
                raise ValueError(say("wrong_time", found=current_time, own=own))
            run.advance(step_size, motor=self.torque, brake=self.brake)
        except (ValueError, RuntimeError) as error:
            self.log(str(error), Fmi3Status.error)
            return Fmi3StepResult(status=Fmi3Status.error)
        self.time = self._from + run.time
        return Fmi3StepResult()

    def _get_fmu_state(self) -> bytes:
        numbers = [self.torque, self.brake, self.time, self._from]
        kept, moving = io.BytesIO(), {} if self._run is None else self._run.state()
        np.savez(kept, values=np.array(json.dumps(self._values)), numbers=np.array(numbers), **moving)
        return kept.getvalue()

    def _set_fmu_state(self, state: bytes) -> None:
        with np.load(io.BytesIO(state), allow_pickle=False) as kept:
            moving = {name: kept[name] for name in kept.files}
        self._values, self._run = json.loads(str(moving.pop("values"))), None
        self.torque, self.brake, self.time, self._from = moving.pop("numbers").tolist()
        if moving:
            self.run.restore(moving)

    _fmu_state_to_bytes = _fmu_state_from_bytes = staticmethod(bytes)  # It is bytes already


def _load(row: int) -> Answer:
    return lambda run: float(run.loads[row])
