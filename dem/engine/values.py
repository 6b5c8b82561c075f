"""Plain values that the modules of the engine share: settings, the state, what the grains do, and the one failure."""

import warnings
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

import numpy as np

from dem.grains.materials import Material

__all__ = ["BedFailure", "BedSettings", "EnginePart", "Grains", "State"]

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
