"""The library's forms once more, each with a number for its shape: nature's law is never quite the library's.

A form of another shape is not a candidate of its own. It is fitted only after the plain form has been, from there, with
the shape's number beginning at what changes nothing; so it costs little, and a name is found by the plain form.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from .problem import Parameter
from .tumble_forms import TumbleForm

__all__ = ["shaped"]


@dataclass(frozen=True)
class _Shape:
    """A number of a term that bends a form: `name` less `plain` is fitted, from 0, with a prior of `std`."""

    name: str
    plain: float
    std: float
    lowest: float
    highest: float
    unit: str = "1"


_POWER = (1.0, 0.4, -0.65, 2.0)
_SHAPES: Mapping[str, _Shape] = {
    "wheel-vibration:saturating": _Shape("wheel-vibration.power", 2.0, 0.8, -1.4, 5.0),
    "torque-fade:speed": _Shape("torque-fade.speed_power", *_POWER),
    "torque-fade:time": _Shape("torque-fade.time_power", *_POWER),
    "umbilical:spring": _Shape("umbilical.spring_power", *_POWER),
    "umbilical:both": _Shape("umbilical.drag_power", *_POWER),
    "rate-friction:saturating": _Shape("rate-friction.power", 1.0, 0.5, -0.7, 4.0),
    "clock-offset:constant": _Shape("clock-offset.drift", 0.0, 0.01, -0.2, 0.2),
    "camera-scale:same in x and y": _Shape("camera-scale.bend", 0.0, 0.5, -10.0, 10.0, "1/m2"),
    "adhesion:mobilised": _Shape("adhesion.sharpness", 0.0, 0.7, -1.0, 2.0),
    "adhesion:that friction does not lose": _Shape("adhesion.sharpness", 0.0, 0.7, -1.0, 2.0),
}
"""By the id of the plain form."""


@dataclass(frozen=True)
class _Bent:
    """Arrays of the shaped form's parameters -> arrays of the term's."""

    form: TumbleForm
    shape: _Shape

    def __call__(self, values: Mapping[str, NDArray[np.float64]]) -> dict[str, NDArray[np.float64]]:
        bent = self.shape.plain + np.asarray(values[f"{self.shape.name}_change"], dtype=float)
        return self.form.physical(values) | {self.shape.name: bent}


def shaped(forms: tuple[TumbleForm, ...]) -> dict[str, tuple[TumbleForm, ...]]:
    """The forms that can be bent, with the number that bends them: id of the plain form -> the shaped one."""
    found: dict[str, tuple[TumbleForm, ...]] = {}
    for form in forms:
        shape = _SHAPES.get(form.id)
        if shape is None:
            continue
        bend = Parameter(
            name=f"{shape.name}_change", unit=shape.unit, value=0.0, std=shape.std, scale=0.3 * shape.std,
            lowest=shape.lowest, highest=shape.highest, step=0.02 * shape.std,
        )  # fmt: skip
        bends = tuple({bend.name: side * shape.std} for side in (-0.7, 0.7))
        starts = tuple({**start, **by} for by in bends for start in form.starts or ({},))
        found[form.id] = (replace(form, name=f"{form.name}, of any shape", parameters=(*form.parameters, bend),
                                  physical=_Bent(form, shape), starts=starts),)  # fmt: skip
    return found
