"""A surface law in a file, `ground.toml`: its parameters with standard deviations, and the range in which it holds.

`hedgebed calibrate` writes such a file. Every command with `--ground` takes it, and so does a script:

```
fitted = read_ground("ground.toml")
fitted.ground(mu_s=0.6)                    # a `SurfaceGround` under one spike, for coupling.drop, drive, set_down
fitted.beyond(depth=0.02, speed=0.1)       # one sentence for each number outside the stated range
```
"""

import warnings
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from .checks import read_toml, why_unread
from .digests import check_as_written
from .ground.grounds import SurfaceGround
from .ground.laws import SurfaceLaw, find_law
from .result import toml_value, write_text

__all__ = ["GROUND_FORMAT", "OPTIONAL", "RANGES", "Estimate", "Foot", "GroundFile", "is_ground_file", "read_ground"]

GROUND_FORMAT = "hedgebed-ground/1"
RANGES = {
    "load": ("N", "normal force on one spike"),
    "depth": ("m", "depth of the tip"),
    "speed": ("m/s", "speed at which the tip goes in"),
    "gravity": ("m/s2", "gravity of the grains"),
    "diameter": ("m", "diameter of the tip"),
}
"""What the range of validity is stated over: name -> unit, meaning."""
OPTIONAL = ("loss", "loss_speed")
"""Parameters that a file need not have: the law's defaults, as in files made before these parameters existed."""
SLACK = 1e-6
"""Relative excess over a limit that counts as round-off [1]."""

Finite = Annotated[float, Field(allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]


class _Table(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class Estimate(_Table):
    """One parameter of the law, in SI units."""

    value: Finite
    std: NotNegative  # Standard deviation of the estimate; 0 for a parameter that was not fitted
    interval: tuple[Finite, Finite] | None = None  # 90 % interval of the estimate
    note: str = ""  # What a reader must know of it, as that it was not fitted

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        if self.interval is not None and not self.interval[0] <= self.value <= self.interval[1]:
            raise ValueError(f"interval = {list(self.interval)} must hold value = {self.value:g}")
        return self


class Foot(_Table):
    """The spike that the parameters belong to."""

    tip: Literal["sphere", "cone", "flat"]
    diameter: Positive  # of the tip [m]
    cone_angle: Annotated[float, Field(ge=1, lt=180)] = 60.0  # Full angle of a conical tip [degrees]


class GroundFile(_Table):
    """The contents of a ground.toml. The parameters are those of the law under one spike."""

    format: Literal["hedgebed-ground/1"]
    law: str  # Name of a law of `rigid.ground.laws.GROUNDS`
    material: Annotated[str, Field(min_length=1)]  # of the grains
    source: Annotated[str, Field(min_length=1)]  # What the numbers come from
    runs: tuple[str, ...] = ()  # The run folders that were fitted
    notes: tuple[str, ...] = ()  # What a reader must know, a sentence each
    foot: Foot
    parameters: dict[str, Estimate]
    range: dict[str, tuple[NotNegative, NotNegative]]  # Name of `RANGES` -> smallest and largest value

    @model_validator(mode="after")
    def _fits_the_law(self) -> Self:
        names = [parameter.name for parameter in self.surface_law.parameters]
        if missing := [name for name in names if name not in self.parameters and name not in OPTIONAL]:
            raise ValueError(f"parameters.{missing[0]} is missing: {self.law} has {', '.join(names)}")
        self.surface_law.values(self.values)
        if wrong := [name for name in (*RANGES, *self.range) if name not in RANGES or name not in self.range]:
            state = "is missing" if wrong[0] in RANGES else "is no key"
            raise ValueError(f"range.{wrong[0]} {state}: {', '.join(RANGES)} were expected")
        for name, (low, high) in self.range.items():
            if low > high:
                raise ValueError(f"range.{name} = [{low:g}, {high:g}] must rise ({RANGES[name][0]})")
        return self

    @property
    def surface_law(self) -> SurfaceLaw:
        """The law itself. Raises ValueError for an unknown name."""
        return find_law(self.law)

    @property
    def values(self) -> dict[str, float]:
        """The parameters by name, SI units, of one spike."""
        return {name: estimate.value for name, estimate in self.parameters.items()}

    def ground(self, **options: Any) -> SurfaceGround:
        """The law as a ground under one spike; `options` are the others of `SurfaceGround`, as mu_s."""
        return SurfaceGround(law=self.law, parameters=self.values, **options)

    def beyond(self, **reached: float) -> list[str]:
        """One sentence for each of `reached` (names of `RANGES`, SI units) that is outside the stated range.

        Raises ValueError for an unknown name.
        """
        said = []
        for name, value in reached.items():
            if name not in RANGES:
                raise ValueError(f"{name} = {value!r} is no range of a ground file: there is {', '.join(RANGES)}")
            (low, high), (unit, meaning) = self.range[name], RANGES[name]
            if not low * (1 - SLACK) <= value <= high * (1 + SLACK):
                allowed = f"{low:.4g} {unit}" if low == high else f"{low:.4g} to {high:.4g} {unit}"
                said.append(
                    f"{name} = {value:.4g} {unit} ({meaning}) is outside the range of the law, {allowed}: the force "
                    f"is extrapolated there"
                )
        return said

    def tangent(self, *, load: float, speed: float = 0.0) -> tuple[float, float, float]:
        """K = dF/dz [N/m], C = dF/d(dz/dt) [N s/m] and the depth [m] where the law bears `load` [N] at `speed` [m/s].

        K and C are the spring-damper that is right at this load and speed. Of another law they change with both. A
        load, speed or depth outside the range warns. Raises ValueError for a load that no depth down to a hundred tips
        bears, or that the surface bears at this speed.
        """
        law, p = self.surface_law, self.surface_law.numbers(self.values)
        deepest = 100 * self.foot.diameter
        low, high = 1e-6 * self.foot.diameter, deepest
        if not law.force(low, speed, p) < load <= law.force(high, speed, p):
            raise ValueError(f"load = {load:g} N at speed = {speed:g} m/s: no depth from 0 to {deepest:g} m bears it")
        for _ in range(80):
            middle = 0.5 * (low + high)
            low, high = (low, middle) if law.force(middle, speed, p) >= load else (middle, high)
        depth = 0.5 * (low + high)
        by, fast = 1e-4 * depth, 1e-4 * max(speed, 1e-3)
        stiffness = (law.force(depth + by, speed, p) - law.force(depth - by, speed, p)) / (2 * by)
        slow = max(speed - fast, 0.0)
        damping = (law.force(depth, speed + fast, p) - law.force(depth, slow, p)) / (speed + fast - slow)
        for text in self.beyond(load=load, speed=speed, depth=depth):
            warnings.warn(text, stacklevel=2)
        return stiffness, damping, depth

    def to_toml(self) -> str:
        """The text of the file; it reads back as the same."""
        lines = [
            "# A surface law for one spike, SI units. std: standard deviation of the estimate; interval: 90 %.",
            f"format = {toml_value(self.format)}",
            f"law = {toml_value(self.law)}  # {self.surface_law.summary}",
            *(f"{key} = {toml_value(getattr(self, key))}" for key in ("material", "source", "runs", "notes")),
            "\n[foot]",
            f"tip = {toml_value(self.foot.tip)}",
            f"diameter = {toml_value(self.foot.diameter)}  # m",
            f"cone_angle = {toml_value(self.foot.cone_angle)}  # degrees; of a cone",
        ]
        about = {parameter.name: parameter for parameter in self.surface_law.parameters}
        for name, estimate in self.parameters.items():
            unit, summary = about[name].unit, about[name].summary
            lines += [f"\n[parameters.{name}]  # {unit}; {summary}"]
            given = estimate.model_dump(exclude_defaults=True)
            lines += [f"{key} = {toml_value(value)}" for key, value in given.items()]
        lines.append("\n[range]")
        lines += [f"{name} = {toml_value(pair)}  # {', '.join(RANGES[name])}" for name, pair in self.range.items()]
        return "\n".join(lines) + "\n"

    def write(self, path: str | Path) -> Path:
        """Write the file and return its path."""
        write_text(Path(path), self.to_toml())
        return Path(path)


def is_ground_file(name: str) -> bool:
    """Whether `name`, of a setting that takes laws and files, means a file."""
    return name.endswith(".toml")


def read_ground(path: str | Path) -> GroundFile:
    """The ground file at `path`.

    Raises ValueError naming the file and, a line for each fault, the key, what was found and what was expected. The
    same is raised for the file of a run that is not as the run wrote it.
    """
    path = Path(path)
    if not path.exists():
        why = f"a ground.toml of `hedgebed ground` or `calibrate` was expected: {why_unread(path, FileNotFoundError())}"
        raise ValueError(f"ground = {path}: cannot be read, {why}")
    check_as_written(path)
    table = read_toml(path)
    try:
        return GroundFile(**table)
    except ValidationError as error:
        raise ValueError("\n".join(f"{path}: {fault}" for fault in map(_sentence, error.errors()))) from None


def _sentence(detail: Any) -> str:
    key = ".".join(str(part) for part in detail["loc"])
    message = detail["msg"].removeprefix("Value error, ")
    if detail["type"] == "missing":
        return f"{key} is missing: it must be given"
    if detail["type"] == "extra_forbidden":
        return f"{key} is no key of a ground file ({GROUND_FORMAT})"
    if detail["type"] == "value_error" and len(detail["loc"]) < 2:
        return message
    return f"{key} = {detail['input']!r}: {message[:1].lower()}{message[1:]}"
