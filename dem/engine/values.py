"""Plain values that the modules of the engine share: settings, the rules of sleep, the state, what the
grains do, and the one failure."""

import math
import warnings
from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields
from typing import TYPE_CHECKING, Any

import numpy as np

from dem.grains.materials import Material

__all__ = ["BedFailure", "BedSettings", "EnginePart", "Grains", "Sleep", "State", "refuse_sleep"]

State = dict[str, np.ndarray]  # Arrays by name: everything that the next step of a bed depends on, to the bit


class EnginePart:
    """A part of ``dem.engine.engine.Engine``, whose fields and functions it uses."""

    if TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any: ...


class BedFailure(RuntimeError):  # noqa: N818 - the name in the architecture
    """The bed cannot go on: a number is not a number, a grain was lost, or an overlap went past its bound.

    ``reason`` says which; the bed keeps the state in which it failed, so that the state can be saved and inspected.
    """

    def __init__(self, reason: str):
        super().__init__(reason)
        self.reason = reason


@dataclass(frozen=True)
class BedSettings:
    """What a bed is made with: the arguments of ``BedCore.from_grains``, chosen where they were left open; SI units."""

    material: Material
    size: tuple[float, float, float]
    gravity: tuple[float, float, float]
    time_step: float
    max_overlap: float
    height: float
    tensile: bool
    seed: int | None


@dataclass(frozen=True, eq=False)
class Grains:
    """The grains of a bed at one moment, as arrays in the order of ids.

    Attributes:
        id: 0 to grain_count - 1, shape [grain_count].
        position: centres [m], shape [grain_count, 3].
        radius: [m], shape [grain_count]. mass: [kg], shape [grain_count].
        velocity: [m/s], shape [grain_count, 3]. spin: angular velocity [rad/s], shape [grain_count, 3].
        force: with gravity [N], shape [grain_count, 3].
        displacement: since the bed was made or ``mark_origin`` [m], shape [grain_count, 3].
        coordination: contacts with grains and bodies [1], shape [grain_count]; empty where they were not counted.
    """

    id: np.ndarray
    position: np.ndarray
    radius: np.ndarray
    mass: np.ndarray
    velocity: np.ndarray
    spin: np.ndarray
    force: np.ndarray
    displacement: np.ndarray
    coordination: np.ndarray

    def as_dict(self) -> State:
        """The arrays by name, without those that were not counted."""
        arrays = {field.name: getattr(self, field.name) for field in fields(self)}
        return {name: array for name, array in arrays.items() if len(array)}

    def __getitem__(self, name: str) -> np.ndarray:
        """Deprecated: the array of this name."""
        warnings.warn(f'grains["{name}"] is deprecated: use grains.{name}', DeprecationWarning, stacklevel=2)
        return self.as_dict()[name]


@dataclass(frozen=True)
class Sleep:
    """When grains are slow, sleep and wake; the module has what the numbers are shares of.

    Raises ValueError: a number that is not above 0, or not whole; ``every`` that is no multiple of ``pace``.
    """

    speed: float = 1e-2  # A fast grain below this may become slow [sqrt(g d)]
    calm: float = 0.25  # For how long it must be, and a slow one to fall asleep [sqrt(d / g)];
    settling: float = 4.0  # so many times as long before the first are slow: a bed that still settles swings as a whole
    reach: float = 3.0  # No grain this near to a body is slow or sleeps [d]
    pace: int = 4
    """Steps of the bed for one of a slow grain; 1: none is slow."""
    stretch: float = 4.0
    """How much nearer to the limit of stability such a step is: a slow grain's mass counts (pace / stretch)^2 times,"""
    spin_stretch: float = 1.6
    """and its moment of inertia (pace / spin_stretch)^2 times; none counts less than once."""
    own: float = 4e-2  # A slow grain above this is fast again [sqrt(g d)]
    unbalanced: float = 0.5  # So is one on which this force is out of balance [its contacts' mean force, or m g]
    still: float = 1e-3  # A slow grain below this may fall asleep [sqrt(g d)]
    change: float = 0.1  # A sleeper wakes when the force on it has changed by this [its contacts' mean force, or m g],
    waking_speed: float = 5e-2  # or a neighbour has this speed [sqrt(g d)]
    every: int = 96
    """Steps between two checks: what changes makes new lists, and those cost as much as four steps of all grains."""

    def __post_init__(self):
        for name, value in asdict(self).items():
            if not 0 < value < math.inf:
                raise ValueError(f"Sleep: {name} = {value} must be above 0")
        for name in ("every", "pace"):
            if int(getattr(self, name)) != getattr(self, name):
                raise ValueError(f"Sleep: {name} = {getattr(self, name)} must be a whole number of steps")
        if self.every % self.pace:
            raise ValueError(f"Sleep: every = {self.every} must be a multiple of pace = {self.pace}")
        for name in ("stretch", "spin_stretch"):
            if getattr(self, name) < 1:
                raise ValueError(f"Sleep: {name} = {getattr(self, name)} must be 1 or more: at 1 no step is nearer")
        if min(self.waking_speed, self.own) <= self.speed:
            raise ValueError(
                f"Sleep: waking_speed = {self.waking_speed} and own = {self.own} must be above speed = {self.speed}, "
                f"or what becomes slow or falls asleep would be fast at once"
            )

    def heaviness(self, pace: int) -> tuple[float, float]:
        """How many times their mass, and their moment of inertia, slow grains of this pace move with."""
        return max(1.0, pace / self.stretch) ** 2, max(1.0, pace / self.spin_stretch) ** 2

    @classmethod
    def of_numbers(cls, numbers: Sequence[float]) -> "Sleep":
        """The rules of a state. Raises ValueError for those of a version that had others."""
        if len(numbers) != len(fields(cls)):
            raise ValueError(
                f"this state has {len(numbers)} rules of sleep, of an earlier version, and {len(fields(cls))} were "
                f"expected: go on with the version that made it, or begin anew"
            )
        given = {field.name: number for field, number in zip(fields(cls), numbers, strict=True)}
        own = {name: float(number) for name, number in given.items() if name not in ("pace", "every")}
        return cls(**own, pace=int(given["pace"]), every=int(given["every"]))


def refuse_sleep(*, arch: str, cohesion: str, floor: bool = True, gravity: float = math.inf) -> None:
    """Raise ValueError, naming what it is, for a bed whose grains cannot sleep."""
    if arch != "cpu":
        raise ValueError(f"sleep with arch = {arch!r}: grains sleep on a CPU only so far; give arch = 'cpu'")
    if not floor or not gravity:
        raise ValueError("grains sleep in a bed with a floor and gravity only: they must lie on something")
    if cohesion == "jkr":
        raise ValueError("sleep with cohesion = 'jkr': what wakes such grains is not measured; give dmt or none")
