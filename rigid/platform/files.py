"""Platforms from TOML files, those that ship and a user's own."""

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, Literal, get_args

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from rigid.checks import nearest, read_toml
from rigid.checks.shipped import find_shipped

from .actuation import Flywheel
from .inertia import Part, combine
from .platform import Platform
from .solids import box_vertices, prism_vertices, rhombicuboctahedron_vertices

__all__ = ["PLATFORM_FOLDER", "find_platform", "platform_file", "platform_names", "read_platform"]

PLATFORM_FOLDER = Path(__file__).parents[1] / "platforms"  # Where those are that ship

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False, strict=True)]
Vector = tuple[float, float, float]


class _Table(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class _PartTable(_Table):
    mass: Positive
    shape: Literal["point", "ball", "box", "cylinder", "ring", "shell"] = "point"
    size: tuple[Positive, ...] = ()
    axis: Literal["x", "y", "z"] = "z"
    position: Vector = (0.0, 0.0, 0.0)


class _Body(_Table):
    mass: Positive
    inertia: tuple[Positive, Positive, Positive] | tuple[Vector, Vector, Vector] | None = None
    part: tuple[_PartTable, ...] = ()

    @model_validator(mode="after")
    def _one_of_two(self) -> "_Body":
        if (self.inertia is None) == (not self.part):
            raise ValueError(
                "either inertia (three principal moments about x, y, z or a tensor) or [[body.part]] tables"
            )
        return self


_HULLS: dict[str, tuple[Callable[..., np.ndarray], tuple[str, ...]]] = {
    "rhombicuboctahedron": (rhombicuboctahedron_vertices, ("edge",)),
    "box": (box_vertices, ("size",)),
    "prism": (prism_vertices, ("sides", "diameter", "height")),
}
"""Shapes of a hull: what makes its corners, and from which keys."""


class _Hull(_Table):
    shape: Literal["rhombicuboctahedron", "box", "prism"]
    edge: Positive | None = None
    size: tuple[Positive, Positive, Positive] | None = None
    sides: Annotated[int, Field(ge=3, le=360, strict=True)] | None = None
    diameter: Positive | None = None
    height: Positive | None = None

    @model_validator(mode="after")
    def _fits_shape(self) -> "_Hull":
        wanted, given = set(_HULLS[self.shape][1]), self.model_fields_set - {"shape"}
        if given != wanted:
            raise ValueError(
                f"a {self.shape} has {', '.join(sorted(wanted))}, not {', '.join(sorted(given)) or 'nothing'}"
            )
        return self

    def vertices(self) -> np.ndarray:
        make, keys = _HULLS[self.shape]
        return make(*(getattr(self, key) for key in keys))


class _Spikes(_Table):
    clear: Positive
    diameter: Positive


class _Wheels(_Table):
    inertia: Positive
    max_speed: Positive
    motor_torque: Positive
    brake_torque: Positive | None = None
    brake_time: Positive | None = None
    axes: Annotated[tuple[Vector, ...], Field(min_length=1, max_length=3)]

    @model_validator(mode="after")
    def _one_brake(self) -> "_Wheels":
        if self.brake_torque is not None and self.brake_time is not None:
            raise ValueError("brake_torque and brake_time are both given: leave one out")
        return self

    @property
    def most_braking(self) -> float:
        """The largest torque of the brake, or of the motor where there is none [N m]."""
        if self.brake_time is not None:
            return self.inertia * self.max_speed / self.brake_time
        return self.motor_torque if self.brake_torque is None else self.brake_torque


class _File(_Table):
    format: Literal["hedgebed-platform/1"]
    name: Annotated[str, Field(min_length=1)]
    body: _Body
    hull: _Hull
    spikes: _Spikes | None = None
    wheels: _Wheels
    sources: dict[str, str] = Field(default_factory=dict)


def platform_names() -> list[str]:
    """The names of those that ship."""
    return sorted(path.stem for path in PLATFORM_FOLDER.glob("*.toml"))


def platform_file(name: str | Path) -> Path:
    """The TOML file `name`, or that of the platform of this name that ships. Raises ValueError for neither."""
    path, shipped = Path(name), {one: PLATFORM_FOLDER / f"{one}.toml" for one in platform_names()}
    if found := path if path.suffix == ".toml" else find_shipped(name, shipped):
        return found  # a file of that ending that is not there: its reading says so
    raise ValueError(
        f"platform = {str(name)!r} is neither a platform that ships nor the path of a .toml file; "
        f"{nearest(str(name), shipped)}"
    )


def find_platform(name: str | Path) -> Platform:
    """The platform in the TOML file `name`, or the one of that name that ships. Raises as `read_platform`.

    >>> find_platform("hedgehog").mass
    5.3
    """
    return read_platform(platform_file(name))


def read_platform(path: Path) -> Platform:
    """The platform in the TOML file `path`.

    Raises ValueError naming the file and, a line for each fault, the key, what was found and what was expected.
    """
    table = read_toml(path)
    try:
        parsed = _File(**table)
    except ValidationError as error:
        faults = dict.fromkeys(_sentence(path, detail) for detail in error.errors())
        raise ValueError("\n".join(faults)) from None
    try:
        return _build(parsed)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def _sentence(path: Path, detail: Any) -> str:
    key = ".".join(str(part) for part in detail["loc"] if not str(part).startswith(("tuple[", "function")))
    if detail["type"] == "missing":
        return f"{path}: {key} is missing: it must be given"
    if detail["type"] == "extra_forbidden":
        names = _keys_beside(detail["loc"])
        return f"{path}: {key} = {detail['input']!r} is no key of a platform; {nearest(str(detail['loc'][-1]), names)}"
    message = detail["msg"].removeprefix("Value error, ")
    found = detail["input"] if not isinstance(detail["input"], dict) else sorted(detail["input"])
    return f"{path}: {key} = {found!r} is not accepted: {message[:1].lower()}{message[1:]}"


def _keys_beside(place: tuple[Any, ...]) -> list[str]:
    """The keys of the table in which the key at `place` stands."""
    model: type[BaseModel] = _File
    for part in place[:-1]:
        field = model.model_fields.get(str(part))
        if field is not None:
            models = [kind for kind in _kinds(field.annotation) if issubclass(kind, BaseModel)]
            model = models[0] if models else model
    return list(model.model_fields)


def _kinds(annotation: Any) -> list[type]:
    if isinstance(annotation, type):
        return [annotation]
    return [kind for inner in get_args(annotation) for kind in _kinds(inner)]


def _build(given: _File) -> Platform:
    outline = given.hull.vertices()
    hull, tip_radius, clear = outline, 0.0, 0.0
    if given.spikes is not None:
        tip_radius, clear = 0.5 * given.spikes.diameter, given.spikes.clear
        far = float(np.linalg.norm(outline, axis=1).max())
        if clear >= far:
            raise ValueError(f"spikes.clear = {clear} m: the tips are only {far:.4g} m from the centre")
        hull = outline * (1 - clear / far)
    centre = np.zeros(3)
    if given.body.inertia is None:
        mass, centre, inertia = combine([Part(**part.model_dump()) for part in given.body.part])
        if abs(mass - given.body.mass) > 1e-6 * given.body.mass:
            raise ValueError(f"body.mass = {given.body.mass} kg: the masses of body.part add up to {mass:.6g} kg")
    else:
        rows = np.array(given.body.inertia, dtype=float)
        inertia = np.diag(rows) if rows.ndim == 1 else rows
    w = given.wheels
    axes = np.array(w.axes, dtype=float)
    lengths = np.linalg.norm(axes, axis=1)
    if not (lengths > 0).all():
        raise ValueError(f"wheels.axes = {w.axes}: an axis must have a length")
    axes = axes / lengths[:, None]
    if np.abs(axes @ axes.T - np.eye(len(axes))).max() > 1e-9:
        raise ValueError(f"wheels.axes = {w.axes}: they must be orthogonal")
    wheels = tuple(
        Flywheel(
            inertia=w.inertia, max_speed=w.max_speed, motor_torque=w.motor_torque,
            brake_torque=w.most_braking, brake_time=w.brake_time,
            axis=(float(a[0]), float(a[1]), float(a[2])),
        )
        for a in axes
    )  # fmt: skip
    return Platform(
        name=given.name, mass=given.body.mass, inertia=inertia, tips=outline, hull_vertices=hull, wheels=wheels,
        tip_radius=tip_radius, spike_clear=clear, centre_of_mass=centre, sources=given.sources,
    )  # fmt: skip
