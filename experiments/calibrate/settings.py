"""Settings of `hedgebed bed calibrate`: target.toml."""

import math
import re
from dataclasses import dataclass, fields
from typing import Self

from pydantic import Field, model_validator

from dem.grains.materials import Material, material
from experiments.grains.recipes import POURED_DRY
from experiments.penetrate.settings import STANDARD_GRAVITY, Spread
from experiments.runs.strict import Positive, SeedNumber, StrictSettings, Threads
from experiments.runs.types import Json
from rigid.checks import nearest
from vis.page.sentences import Sentences

__all__ = ["FIGURES", "FREE", "CalibrateSettings", "Figure", "Target", "material_at"]

say = Sentences(__package__)


@dataclass(frozen=True)
class Figure:
    """A bulk figure that can be a target."""

    unit: str
    state: str
    """In which a sample is sheared for it, "loose" or "dense"; "drained" for that of a bed which drains through a slot;
    "cut" for that of a bed in which vertical faces are cut; "" for one of a laboratory bed, which takes minutes and is
    compared at the end but not fitted."""
    words: str  # what it is


FIGURES = {
    "critical_friction_angle": Figure("degrees", "loose", "friction angle at large strain"),
    "peak_friction_angle": Figure("degrees", "dense", "friction angle at the largest strength"),
    "cohesion": Figure("Pa", "loose", "cohesion at large strain"),
    "peak_cohesion": Figure("Pa", "dense", "cohesion at the largest strength"),
    "sample_density": Figure("kg/m3", "loose", "bulk density of a sample under the lid before it is sheared"),
    "angle_of_repose": Figure("degrees", "drained", "angle of the slopes that stay where a bed drains through a slot"),
    "cut_height": Figure("m", "cut", "height of the highest vertical face that stands"),
    "cut_density": Figure("kg/m3", "cut", "bulk density of the bed in which faces are cut"),
    "packing_loose": Figure("1", "", "packing fraction of a bed rained in and fluffed"),
    "packing_dense": Figure("1", "", "packing fraction of a bed rained in and tapped until taps gain nothing"),
    "bulk_density_loose": Figure("kg/m3", "", "bulk density of a bed rained in and fluffed"),
    "bulk_density_dense": Figure("kg/m3", "", "bulk density of a bed rained in and tapped until taps gain nothing"),
}
FREE = {"friction": "1", "rolling_friction": "1", "surface_energy": "J/m2", "bond_number": "1"}
"""What may be free, with its unit. bond_number: pull-off force of two grains over the weight of one."""
_BOUNDS = {"degrees": (0.0, 90.0), "1": (0.0, 1.0)}
"""Of a figure's value, by its unit; the others are 0 or more."""
_PLANES = ("shear", "triaxial", "mohr")
_SHEARED = ("loose", "dense")
_FIXED = tuple(f.name for f in fields(Material) if f.name not in ("name", "sources", "grain"))


@dataclass(frozen=True)
class Target:
    """One bulk figure that is wanted.

    Attributes:
        value, tolerance: in the figure's unit; the tolerance counts as a standard deviation.
        source: where it comes from.
        figure: which of ``FIGURES`` it is; its name if not given.
        plane: of a friction angle. "shear": stresses on the shear plane as in a shear box or a ring shear tester.
            "triaxial": the angle of triaxial compression. "mohr": Mohr's circle of the largest and least stress. Of a
            cohesion "shear" or "mohr", as a vertical cut has it.
        state: in which the sample is sheared: "loose" or "dense"; "drained" of an angle of repose; "cut" of a cut.
        fit: whether the parameters are fitted to it, or it is only compared at the end.
        through: of a friction angle. "tests": a straight line through the tests of all pressures. "origin": a line
            through the origin, as for laboratories that report an angle and no cohesion.
    """

    name: str
    value: float
    tolerance: float
    source: str
    figure: str
    plane: str = "shear"
    state: str = ""
    fit: bool = True
    through: str = "tests"

    @property
    def unit(self) -> str:
        """Its unit."""
        return FIGURES[self.figure].unit


class CalibrateSettings(StrictSettings):
    """Grain parameters found from bulk figures: a response surface over simulated shear tests, and the fit to it."""

    name: str = Field("calibrated", pattern=r"^[a-z0-9][a-z0-9._+-]*$")
    """Name of the material: lower-case letters, digits, '.', '_', '+', '-'."""
    material: str = "sand"
    """Material that gives all numbers that are neither fixed nor free."""
    fixed: dict[str, float | str] = Field({})
    """Fixed numbers, by the keys of a material file: [fixed] density = 2900.0."""
    sources: dict[str, str] = Field({}, description="Source of each fixed number, by the same keys.")
    free: dict[str, tuple[float, float]] = Field({})
    """Numbers to be fitted, with their ranges: [free] rolling_friction = [0.05, 0.8]. Possible are friction,
    rolling_friction [1], surface_energy [J/m2] and bond_number (pull-off force of two grains over the weight of one)
    [1]."""
    targets: dict[str, Json] = Field({})
    """Measured bulk properties: [targets.critical_friction_angle] value = 31.5, tolerance = 1.5, source = '...'.
    Optional: figure = '...' if the table has another name; plane = 'shear', 'triaxial' or 'mohr'; through = 'tests' or
    'origin'; state = 'loose' or 'dense'; fit = false to compare only."""
    grain: Positive = Field(0.004, description="Mean grain diameter [m], to which surface energies belong.")
    spread: Spread = 0.15
    max_overlap: float = Field(0.05, ge=0.005, le=0.1)
    """Overlap for which the grains of a sheared sample are softened [of a diameter]. The largest of a sample is up to
    three times that. The density of soft samples includes their overlaps."""
    size: tuple[Positive, Positive, Positive] = (10.0, 8.0, 10.0)
    """Size of a sheared sample: both periodic lengths and the height [mean diameters]."""
    dense_friction: float = Field(0.1, ge=0, le=1)
    """Friction of the grains while a dense sample is compressed [1]; 0 gives the densest."""
    loose_friction: float | None = Field(None, ge=0, le=10)
    """Friction of the grains while a loose sample is compressed, without rolling friction [1]; if not given, their own
    friction and rolling friction."""
    pressures: tuple[Positive, ...] = Field((500.0, 1000.0), min_length=1)
    """Normal stresses of the shear tests [Pa]. Without cohesion only the last: strength is then proportional to it."""
    strain: float = Field(
        1.2, ge=0.2, le=20, description="Shear strain of a test [1]; its second half gives the critical state."
    )
    inertial_number: Positive = Field(
        5e-3, le=0.05, description="Inertial number: shear rate x d sqrt(density / pressure) [1]."
    )
    gravity: Positive = Field(STANDARD_GRAVITY, description="Gravity for bond_number and laboratory beds [m/s2].")
    points: int = Field(6, ge=3, le=200)
    """Number of points simulated first: a regular design, or a Latin hypercube [1]."""
    most_points: int = Field(10, ge=3, le=500, description="Largest number of points before the check [1].")
    enough: float = Field(0.5, gt=0, le=10)
    """Stop when the standard error of the response surface is below this share of every tolerance [1]."""
    samples: int = Field(1, ge=1, le=100, description="Samples of each point, with successive seeds [1].")
    seed: SeedNumber = 1
    """Seed of the design and of the first sample; samples of later points add thousands to it."""
    check_seeds: tuple[SeedNumber, ...] = Field((2, 3), min_length=1)
    """Seeds of the samples that check the fitted parameters."""
    checks: int = Field(2, ge=1, le=10)
    """Largest number of checks; a further one follows if a property is off by more than half its tolerance [1]."""
    bed_size: tuple[Positive, Positive, Positive] = (0.04, 0.04, 0.035)
    """Size of laboratory beds for packing fractions: widths and depth [m]."""
    repose_size: tuple[Positive, Positive, Positive] = (92.0, 6.0, 20.0)
    """Size of a bed drained for the angle of repose: widths (periodic; slopes along the first) and depth [mean
    diameters]. A fit needs a depth of at least 20."""
    cut_size: tuple[Positive, Positive, Positive] = (24.0, 8.0, 10.0)
    """Size of a bed for vertical cuts: widths (periodic; the cut, 3 wide, is across the first) and depth [mean
    diameters]. Heights from a tenth to four times the depth can be found; in beds 5 deep they scatter threefold."""
    cut_stages: tuple[str, ...] = POURED_DRY
    """Preparation of a bed for vertical cuts, as in `hedgebed bed make --stages`; the last stage is `level`."""
    threads: Threads = None

    @model_validator(mode="after")
    def _can_be(self) -> Self:
        base = self.base
        if self.name == material(self.material).name:
            raise ValueError(say("own_name", s=self))
        _check_free(self.free, base, self.fixed)
        wanted = self.wanted
        fitted = [name for name, target in wanted.items() if target.fit]
        if len(fitted) < len(self.free):
            names, free = ", ".join(fitted) or "none", ", ".join(self.free)
            raise ValueError(say("few_figures", count=len(fitted), fitted=names, wanted=len(self.free), free=free))
        if base.cohesion != "none" and len(self.pressures) < 2:
            raise ValueError("pressures holds one value: with cohesion at least two are needed, for a line")
        if base.cohesion == "none" and (lost := [n for n in fitted if _sticks(wanted[n].figure)]):
            raise ValueError(say("not_sticking", lost=lost[0]))
        if len(set(self.pressures)) < len(self.pressures) or len(set(self.check_seeds)) < len(self.check_seeds):
            raise ValueError("pressures and check_seeds hold each value once")
        if known := set(range(self.seed, self.seed + self.samples)) & set(self.check_seeds):
            raise ValueError(f"check_seeds holds {min(known)}, a seed of exploring: other seeds would check it")
        if self.points < len(self.free) + 2 or self.most_points < self.points:
            raise ValueError(say("few_points", s=self, least=len(self.free) + 2, wanted=len(self.free)))
        if min(self.size) < 6:
            raise ValueError(f"size = {' '.join(f'{s:g}' for s in self.size)}: at least six diameters each way")
        return self

    @property
    def base(self) -> Material:
        """The material with its fixed numbers; what is free has a number that stands in for it."""
        for key in (*self.fixed, *self.sources):
            if key not in _FIXED:
                raise ValueError(f"fixed.{key} is no number of a material; {nearest(key, _FIXED)}")
        numbers = dict(self.fixed)
        if numbers.get("cohesion", "none") != "none" and "surface_energy" not in numbers:
            numbers["surface_energy"] = 1.0  # stands in for one that is free, which _check_free sees to
        found = material(self.material)
        kept = {f.name: getattr(found, f.name) for f in fields(found)}
        if numbers.get("cohesion") == "none":
            numbers["surface_energy"] = 0.0
        for key, value in numbers.items():
            if isinstance(value, str) != (text := key in ("cohesion", "tangential")):
                raise ValueError(f"fixed.{key} = {value!r} must be a {'text' if text else 'number'}")
        sources = {key: f"as {found.name}: {text}" for key, text in found.sources.items()}
        sources |= {key: self.sources.get(key, "given") for key in self.fixed}
        return Material(**(kept | numbers | {"name": self.name, "grain": None, "sources": sources}))

    @property
    def wanted(self) -> dict[str, Target]:
        """The targets by name. Raises ValueError for a bad one."""
        return {name: _target(name, given) for name, given in self.targets.items()}


def _sticks(figure: str) -> bool:
    """Whether only grains that stick have this figure."""
    return "cohesion" in figure or figure == "cut_height"


def _target(name: str, given: Json) -> Target:
    called = f"targets.{name}"
    kind = str(given.get("figure", name))
    if kind not in FIGURES:
        raise ValueError(f"{called}{'.figure' if 'figure' in given else ''} is no figure: {nearest(kind, FIGURES)}")
    if not re.fullmatch(r"[a-z][a-z0-9_]*", name):
        raise ValueError(f"{called}: small letters, digits and '_' are accepted as its name")
    keys = [f.name for f in fields(Target) if f.name != "name"]
    for key in given:
        if key not in keys:
            raise ValueError(f"{called}.{key} = {given[key]!r} is no key of a target; {nearest(key, keys)}")
    for key in ("value", "tolerance", "source"):
        if key not in given:
            raise ValueError(f"{called}.{key} must be given")
    for key in ("value", "tolerance"):
        number = given[key]
        if isinstance(number, bool) or not isinstance(number, int | float) or not math.isfinite(number):
            raise ValueError(f"{called}.{key} = {number!r} must be a number [{FIGURES[kind].unit}]")
    if not given["tolerance"] > 0:
        raise ValueError(f"{called}.tolerance = {given['tolerance']} must be positive: no figure is known exactly")
    if not (isinstance(given["source"], str) and given["source"].strip()):
        raise ValueError(f"{called}.source = {given['source']!r} must say where the figure comes from")
    figure = FIGURES[kind]
    state = given.get("state", figure.state)
    if state != figure.state and not (state in _SHEARED and figure.state in _SHEARED):
        raise ValueError(f"{called}.state = {state!r} must be 'loose' or 'dense', of a strength")
    planes = _PLANES if "friction_angle" in kind else ("shear", "mohr") if "cohesion" in kind else ()
    if "plane" in given and given["plane"] not in planes:
        raise ValueError(say("plane", called=called, plane=given["plane"]))
    of_angle = "friction_angle" in kind
    if given.get("through", "tests") not in ("tests", "origin") or ("through" in given and not of_angle):
        raise ValueError(f"{called}.through = {given['through']!r} must be 'tests' or 'origin', of a friction angle")
    fit = given.get("fit", bool(figure.state))
    if not isinstance(fit, bool):
        raise ValueError(f"{called}.fit = {fit!r} must be true or false")
    if fit and not figure.state:
        raise ValueError(f"{called}.fit = true: {figure.words} takes minutes and is compared only; false is accepted")
    unit, bounds = figure.unit, _BOUNDS.get(figure.unit, (0.0, math.inf))
    if not bounds[0] <= given["value"] < bounds[1]:
        most = f" and below {bounds[1]:g}" if math.isfinite(bounds[1]) else ""
        raise ValueError(f"{called}.value = {given['value']} [{unit}] must be at least {bounds[0]:g}{most}")
    numbers = {"value": float(given["value"]), "tolerance": float(given["tolerance"])}
    return Target(name, **(given | numbers | {"state": state, "fit": fit, "figure": kind}))


def _check_free(free: dict[str, tuple[float, float]], base: Material, fixed: Json) -> None:
    if not free:
        raise ValueError("free is empty: give at least one parameter with its range, as rolling_friction = [0.05, 0.8]")
    for key, (low, high) in free.items():
        if key not in FREE:
            raise ValueError(f"free.{key} is no parameter that can be found; {nearest(key, FREE)}")
        if not (math.isfinite(low) and math.isfinite(high) and 0 <= low < high):
            raise ValueError(f"free.{key} = [{low:g}, {high:g}] must be two numbers from 0 on, the smaller first")
        if key in fixed:
            raise ValueError(f"{key} is fixed and free: leave one of them out")
    sticks = [key for key in ("surface_energy", "bond_number") if key in free]
    if len(sticks) == 2:
        raise ValueError("free holds surface_energy and bond_number, which are one and the same: leave one out")
    if sticks and base.cohesion == "none":
        raise ValueError(f"free.{sticks[0]} needs a law: fixed.cohesion = 'dmt' or 'jkr' is accepted")
    if sticks and free[sticks[0]][0] <= 0:
        raise ValueError(f"free.{sticks[0]} begins at {free[sticks[0]][0]:g}: above 0 is accepted")
    if fixed.get("cohesion", "none") != "none" and not sticks and "surface_energy" not in fixed:
        what = "fixed.surface_energy or free.surface_energy is accepted"
        raise ValueError(f"fixed.cohesion without a surface energy: {what}")


def material_at(settings: CalibrateSettings, values: dict[str, float]) -> Material:
    """The material with these values of what is free; its surface energy holds for the settings' grain."""
    base = settings.base
    numbers = {f.name: getattr(base, f.name) for f in fields(base)} | {"grain": settings.grain}
    for key, value in values.items():
        if key == "bond_number":
            # Pull-off 4 pi gamma R* (DMT) or 3 pi gamma R* (JKR), R* = d / 4, over rho g pi d^3 / 6.
            factor = {"dmt": 6.0, "jkr": 4.5}[base.cohesion]
            value, key = value * base.density * settings.gravity * settings.grain**2 / factor, "surface_energy"
        numbers[key] = value
    return Material(**numbers)
