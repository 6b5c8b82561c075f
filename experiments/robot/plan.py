"""The plan of a robot's run: its model, where its numbers come from, and the surface law under its feet."""

import copy
import importlib.util
import math
import tempfile
import traceback
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from coupling.robot import LawFeet, LostRobotError, MujocoRobot, load_model
from coupling.robot.feet import Part, refuse_missing
from coupling.robot.models import examples
from coupling.robot.soles import FeetLaw, compared_speeds, plan_area, sole_of
from experiments.platform.ground_file import fitted_ground
from experiments.platform.settled import Number, refuse_other_grains
from experiments.platform.surfaces import Surface, find_surface, surface_of_grains
from experiments.runs.given import keep_given, kept_copy
from rigid.checks import alike
from rigid.checks.shipped import find_shipped
from rigid.ground.laws import find_law
from rigid.ground_file import GroundFile
from rigid.platform.rig import STANDARD_GRAVITY
from rigid.spatial.quaternions import to_matrix

from . import say
from .gravity import GravityRule, gravity_rule
from .laws import (
    SPIKE,
    Largest,
    OneLaw,
    fitted_words,
    law_notes,
    law_of,
    settle_other_law,
    settle_spring,
    spring_words,
)  # fmt: skip
from .settings import RobotSettings

__all__ = [
    "CONTROLLER", "LAW_STEP", "MODEL", "RobotPlan", "keep_files", "plan_robot", "try_controller", "width_of",
]  # fmt: skip

LAW_STEP = 4e-5  # Of a surface law [s], ten of which make an exchange by default
DEFAULT_SURFACE = "sand"
OF_LAW = ("stiffness", "damping", "mu_s", "mu_d")
"""Numbers of a surface law that grains do not have: there they are those of the forecast of the bed's size."""
MODEL, CONTROLLER = "model.mjb", "controller.py"  # Copies in the run folder

Controller = Callable[[Any, Any], None]


@dataclass(frozen=True, kw_only=True)
class RobotPlan:
    """What is run."""

    settings: RobotSettings
    model: Any  # mujoco.MjModel
    controller: Controller | None
    surface: Surface
    numbers: Mapping[str, Number]
    scales: Mapping[str, float]  # Area of each part of a foot over that of the tip that the law is of [1]
    diameters: Mapping[str, float]  # Of the circle with the area of each part from above [m]
    fitted: GroundFile | None  # The file that the law comes from
    rule: GravityRule  # How K and C of the surface follow gravity
    warnings: tuple[str, ...]
    floors: tuple[str, ...] = ()  # Names of MuJoCo's own floors, which a run switches off
    notes: tuple[str, ...] = ()  # What a person is to know and no warning is

    def robot(self) -> MujocoRobot:
        """The robot where it starts."""
        s = self.settings
        return MujocoRobot(self.model, s.feet, keyframe=s.keyframe, controller=self.controller, height=s.height)

    def law_feet(self, robot: MujocoRobot, *, as_spring: bool = False) -> LawFeet:
        """The surface law under the robot's feet; `as_spring`: the spring-damper, whatever the settings say."""
        options = self.feet_options(robot, as_spring=as_spring)
        mu_s, mu_d = (self.numbers[name].value for name in ("mu_s", "mu_d"))
        return LawFeet(robot.feet, mu_s=mu_s, mu_d=mu_d, time_step=LAW_STEP, **options)

    def feet_options(self, robot: MujocoRobot, *, as_spring: bool = False) -> FeetLaw | OneLaw:
        """The law of `law_feet`, scaled to each foot: arguments of `LawFeet` and `FootForces`."""
        own = law_of(self.settings, self.surface, self.fitted, self.numbers, rule=self.rule, as_spring=as_spring)
        matrices = [to_matrix(turn) for turn in robot.pose.turn.reshape(-1, 4)]
        found = own.options(robot.feet, matrices)
        if self.surface.granular and self.fitted is None:
            found["speeds"] = compared_speeds(robot.feet, matrices, gravity=robot.gravity)
        return found

    @property
    def law(self) -> str:
        """Name of the surface law; on grains that of the forecast."""
        if self.fitted is not None:
            return self.fitted.law
        return "spring-damper" if self.settings.on_grains else self.settings.ground

    def standing_on(self, parts: Iterable[str]) -> "RobotPlan":
        """The same on grains, with K of the largest of these parts where words name K of a foot."""
        numbers = dict(self.numbers)
        some = max(self.scales[name] for name in parts)
        of_all, of_some = (
            settle_spring(self.settings, self.surface, self.rule, most, numbers)
            for most in (max(self.scales.values()), some)
        )
        told = dict(zip(of_all, of_some, strict=True))
        return replace(self, numbers=numbers, warnings=tuple(told.get(said, said) for said in self.warnings))

    def on_law(self, law: str, *parameters: str) -> "RobotPlan":
        """The same on this surface law with its defaults but for these parameters, in place of grains."""
        return replace(self, settings=self.settings.model_copy(update={"ground": law, "ground_parameters": parameters}))

    def announcement(self) -> list[str]:
        """What was not given, then the warnings."""
        warned = (f"warning: {warning}" for warning in self.warnings_of_run)
        return [*self._chosen, *self.in_words(), *self.notes, *warned]

    @property
    def warnings_of_run(self) -> list[str]:
        """The warnings of a run, which switches the floors of the model off."""
        return [*self._floors("floors_off"), *self.warnings]

    def _floors(self, key: str) -> list[str]:
        """The sentence `key` on the floors of the model; none without any."""
        return [say(key, floors=", ".join(self.floors))] if self.floors else []

    @property
    def _chosen(self) -> list[str]:
        """The law, where it was not given."""
        return [] if "ground" in self.settings.model_fields_set else [say("default_law", law=self.law)]

    def in_words(self, *, given: bool = False) -> list[str]:
        """Each number with its meaning and origin, in a line; those that are `given` too, where they are wanted."""
        means = {parameter.name: parameter.summary for parameter in find_law(self.law).parameters}
        means.pop("gravity", None)  # the robot's too: its origin says enough
        means |= {name: say(f"means_{name}") for name in OF_LAW if name.startswith("mu_")}
        told = []
        for name, number in self.numbers.items():
            if number.origin == "given" and not given:
                continue
            of_law = self.settings.on_grains and name in OF_LAW
            words = "; ".join(part for part in (means.get(name), number.origin) if part)
            unit = "" if number.unit == "1" else f" {number.unit}"
            told.append(f"{name} = {number.value:.6g}{unit} ({words}{say('of_forecast') if of_law else ''})")
        return told

    def notes_of_loop(self) -> list[str]:
        """What a loop of one's own is to know: first the warnings, then law and all numbers.

        A floor of the model is on there, unless the loop switches it off.
        """
        found = [*self._floors("floors_on"), *self.warnings]
        return [*(f"warning: {one}" for one in found), *self._chosen, *self.notes, *self.in_words(given=True)]


def keep_files(settings: RobotSettings, folder: Path) -> None:
    """Copy the compiled model and the controller into the run folder, once, so that it goes on with the same.

    Raises ValueError where a copy is damaged.
    """
    mujoco = refuse_missing()
    if kept_copy(folder, MODEL) is None:
        with tempfile.TemporaryDirectory() as scratch:
            compiled = Path(scratch) / MODEL
            mujoco.mj_saveModel(load_model(settings.model), str(compiled), None)
            keep_given(folder, MODEL, compiled.read_bytes())
    if settings.controller is not None and kept_copy(folder, CONTROLLER) is None:
        keep_given(folder, CONTROLLER, _controller_file(settings.controller)[0].read_bytes())


def plan_robot(settings: RobotSettings, *, folder: Path | None = None, model: Any = None) -> RobotPlan:
    """What `settings` describe; the files are those kept in `folder`, where it is given.

    ``model``: a mujoco.MjModel in place of the file that the settings name; a copy is used. Raises ValueError, naming
    the setting, for what there is not and what cannot be.
    """
    mujoco = refuse_missing()
    if model is not None:
        model = copy.copy(model)
    elif folder is not None:
        model = mujoco.MjModel.from_binary_path(str(folder / MODEL))
    else:
        model = load_model(settings.model)
    numbers: dict[str, Number] = {}
    if settings.gravity is not None:
        model.opt.gravity[:] = (0.0, 0.0, -settings.gravity)
    robot = MujocoRobot(model, settings.feet, keyframe=settings.keyframe, height=settings.height)
    of_model = f"model {robot.name}"
    numbers["mass"] = Number(robot.mass, "kg", of_model)
    origin = "given" if settings.gravity is not None else of_model
    numbers["gravity"] = Number(robot.gravity + 0.0, "m/s2", origin)  # 0, not -0, of a model without gravity
    fitted = fitted_ground(settings.ground)
    surface, of_friction = _surface(settings, fitted)
    warnings = of_friction + [part.note for foot in robot.feet for part in foot.parts if part.note]
    if robot.hangs:
        warnings.append(say("hangs"))
    of_surface = settings.on_grains or settings.ground == "spring-damper"
    scales, soles = {}, {}
    for foot, turn in zip(robot.feet, robot.pose.turn.reshape(-1, 4), strict=True):
        for part in foot.parts:
            tip = surface.spike if surface.granular else None
            tip = fitted.foot.diameter if fitted is not None else tip if of_surface else SPIKE
            scales[part.name] = _scale(part, to_matrix(turn), tip)
            soles[part.name] = sole_of(part, to_matrix(turn), of=tip or SPIKE)
    most = max(scales, key=lambda name: (scales[name], soles[name].area))
    largest = Largest(name=most, times=scales[most], sole=soles[most])
    diameters = {name: sole.diameter for name, sole in soles.items()}
    rule = gravity_rule(settings, surface, robot.gravity, diameters)
    if fitted is not None:
        warnings += fitted_words(fitted, largest)
        warnings += _beyond_gravity(settings, fitted, robot.gravity)
    elif of_surface:
        warnings += settle_spring(settings, surface, rule, largest.times, numbers)
        warnings += [] if settings.on_grains else spring_words(settings, surface, largest, rule)
    else:
        warnings += settle_other_law(settings, surface, robot.gravity, largest, numbers)
    _settle_friction(settings, surface, numbers)
    if surface.guess and of_surface:
        warnings.append(say("guess", surface=surface))
    numbers["weight"] = Number(max(robot.mass * robot.gravity, 1e-9), "N", "mass times gravity")
    return RobotPlan(
        settings=settings, model=model, controller=_controller(settings, folder), surface=surface, numbers=numbers,
        scales=scales, diameters=diameters, fitted=fitted, rule=rule, warnings=tuple(warnings),
        floors=robot.floors, notes=tuple(law_notes(settings, surface)),
    )  # fmt: skip


def _surface(settings: RobotSettings, fitted: GroundFile | None) -> tuple[Surface, list[str]]:
    """The surface that the settings or the grains of a ground file name, and a warning where neither does.

    Raises ValueError for a surface there is not, and for one of other grains than those of the file.
    """
    if settings.surface is not None:
        surface = find_surface(settings.surface)
        refuse_other_grains(surface, fitted)
        return surface, []
    own = surface_of_grains(fitted.material) if fitted is not None else DEFAULT_SURFACE
    surface = find_surface(own or DEFAULT_SURFACE)
    known = own is not None or settings.mu_s is not None
    return surface, [] if known else [say("friction_of_default", file=fitted, surface=surface)]


def _beyond_gravity(settings: RobotSettings, fitted: GroundFile, gravity: float) -> list[str]:
    """A warning where gravity [m/s2] is outside the range of the law of a file, and that is accepted.

    Raises ValueError where it is not accepted.
    """
    low, high = fitted.range["gravity"]
    near = min(max(gravity, low), high)  # MuJoCo's own 9.81 m/s2 are as good as 9.80665
    found = fitted.beyond(gravity=near if abs(near - gravity) < 0.01 * near else gravity)
    if found and not settings.ignore_gravity_range:
        here = gravity / STANDARD_GRAVITY
        raise ValueError(say("other_gravity", s=settings, sentence=found[0], here=here))
    return [say("beyond_range", sentence=sentence, file=fitted) for sentence in found]


def _settle_friction(settings: RobotSettings, surface: Surface, numbers: dict[str, Number]) -> None:
    own = f"surface {surface.name}"
    mu_s = surface.mu_s if settings.mu_s is None else settings.mu_s
    numbers["mu_s"] = Number(mu_s, "1", own if settings.mu_s is None else "given")
    if settings.mu_d is not None:
        numbers["mu_d"] = Number(settings.mu_d, "1", "given")
    elif settings.mu_s is not None:
        numbers["mu_d"] = Number(0.5 * mu_s, "1", "default: half of mu_s")
    else:
        numbers["mu_d"] = Number(surface.mu_d, "1", own)
    if numbers["mu_d"].value > mu_s:
        raise ValueError(say("sliding_above", mu_d=numbers["mu_d"].value, mu_s=mu_s))


def _scale(part: Part, matrix: Any, tip: float | None) -> float:
    """Area of a part from above over that of a tip of this diameter [m]; 1 without a tip, and of a point."""
    if tip is None or part.kind == "site":
        return 1.0
    return max(plan_area(part.vertices @ matrix.T) / (0.25 * math.pi * tip**2), 1e-3)


def width_of(part: Part, matrix: Any) -> float:
    """The smaller of a part's two extents from above [m], turned by `matrix`."""
    return float(np.ptp(part.vertices @ matrix.T, axis=0)[:2].min())


def _controller_file(controller: str) -> tuple[Path, str]:
    """The file, which an example that ships has by its name too, and the function in FILE:FUNCTION."""
    file, _, name = controller.rpartition(":")
    return find_shipped(file, examples(".py")) or Path(file), name


def _controller(settings: RobotSettings, folder: Path | None) -> Controller | None:
    """The function that controls the robot. Raises ValueError for a file or function that there is not."""
    if settings.controller is None:
        return None
    file, name = _controller_file(settings.controller)
    path = file if folder is None else folder / CONTROLLER
    if not path.is_file():
        key = "no_such_controller" if file.suffix == ".py" else "no_controller"
        raise ValueError(say(key, s=settings, file=file, near=alike(file)))
    spec = importlib.util.spec_from_file_location("hedgebed_controller", path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    module.__file__ = str(file.absolute())  # of the original: what lies beside it is not copied
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        raise ValueError(say("broken_controller", s=settings, error=error)) from None
    found = vars(module).get(name)
    if not callable(found):
        known = ", ".join(key for key, value in vars(module).items() if callable(value) and not key.startswith("_"))
        raise ValueError(say("no_function", s=settings, name=name, known=known or "none"))

    def control(model: Any, data: Any) -> None:
        try:
            found(model, data)
        except Exception as error:
            lines = [at.lineno for at in traceback.extract_tb(error.__traceback__) if Path(at.filename) == path]
            said = f"{type(error).__name__}: {error}"
            where = say("controller_fails", file=file, name=name, line=lines[-1] if lines else "?", said=said)
            raise LostRobotError(where, remedy=say("mend")) from error

    return control


def try_controller(robot: MujocoRobot) -> None:
    """Call the robot's controller once on copies of its model and data.

    Raises ValueError where it fails, or leaves a control that is no number.
    """
    if robot.controller is None:
        return
    data = copy.copy(robot.data)
    try:
        robot.controller(copy.copy(robot.model), data)
    except LostRobotError as error:
        raise ValueError(str(error)) from error
    if not np.isfinite(data.ctrl).all():
        raise ValueError(say("no_control", values=data.ctrl.tolist()))
