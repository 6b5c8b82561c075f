"""The library's forms once more, each with a number for its shape: nature's law is never quite the library's.

A form of another shape is not a candidate of its own. It is fitted only after the plain form has been, from there, with
the shape's number beginning at what changes nothing; so it costs little, and a name is found by the plain form.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import product

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
_WOUND = _Shape("umbilical.rest", 0.0, 0.5, -3.0, 3.0, "rad")
_SHAPES: Mapping[str, _Shape | tuple[tuple[_Shape, ...], ...]] = {
    "wheel-vibration:saturating": _Shape("wheel-vibration.power", 2.0, 0.8, -1.4, 5.0),
    "torque-fade:speed": _Shape("torque-fade.speed_power", *_POWER),
    "torque-fade:time": _Shape("torque-fade.time_power", *_POWER),
    "umbilical:spring": ((_Shape("umbilical.spring_power", *_POWER),), (_WOUND,)),
    "umbilical:both": (
        (_Shape("umbilical.drag_power", *_POWER),),
        (_WOUND,),
        (_WOUND, _Shape("umbilical.drag_power", *_POWER)),
    ),
    "rate-friction:saturating": _Shape("rate-friction.power", 1.0, 0.5, -0.7, 4.0),
    "clock-offset:constant": _Shape("clock-offset.drift", 0.0, 0.01, -0.2, 0.2),
    "camera-scale:same in x and y": _Shape("camera-scale.bend", 0.0, 0.5, -10.0, 10.0, "1/m2"),
    "adhesion:mobilised": _Shape("adhesion.sharpness", 0.0, 0.7, -1.0, 2.0),
    "adhesion:that friction does not lose": _Shape("adhesion.sharpness", 0.0, 0.7, -1.0, 2.0),
}
"""By the id of the plain form; where there are several ways to bend it, the numbers of each."""


@dataclass(frozen=True)
class _Bent:
    """Arrays of the shaped form's parameters -> arrays of the term's."""

    form: TumbleForm
    shapes: tuple[_Shape, ...]

    def __call__(self, values: Mapping[str, NDArray[np.float64]]) -> dict[str, NDArray[np.float64]]:
        bent = {shape.name: shape.plain + np.asarray(values[f"{shape.name}_change"], dtype=float)
                for shape in self.shapes}  # fmt: skip
        return self.form.physical(values) | bent


def shaped(forms: tuple[TumbleForm, ...]) -> dict[str, tuple[TumbleForm, ...]]:
    """The forms that can be bent, with the numbers that bend them: id of the plain form -> the shaped ones."""
    found: dict[str, tuple[TumbleForm, ...]] = {}
    for form in forms:
        ways = _SHAPES.get(form.id)
        if ways is None:
            continue
        ways = ((ways,),) if isinstance(ways, _Shape) else ways
        found[form.id] = tuple(_bent(form, shapes) for shapes in ways)
    return found


def _bent(form: TumbleForm, shapes: tuple[_Shape, ...]) -> TumbleForm:
    bends = tuple(
        Parameter(name=f"{shape.name}_change", unit=shape.unit, value=0.0, std=shape.std, scale=0.3 * shape.std,
                  lowest=shape.lowest, highest=shape.highest, step=0.02 * shape.std)
        for shape in shapes
    )  # fmt: skip
    places = [
        {bend.name: side * shape.std for bend, shape, side in zip(bends, shapes, sides, strict=True)}
        for sides in product((-0.7, 0.7), repeat=len(shapes))
    ]
    starts = tuple({**start, **place} for place in places for start in form.starts or ({},))
    word = "of any shape" if shapes != (_WOUND,) else "wound up"
    word = "wound up, of any shape" if len(shapes) > 1 else word
    return replace(
        form, name=f"{form.name}, {word}", parameters=(*form.parameters, *bends), physical=_Bent(form, shapes),
        starts=starts,
    )  # fmt: skip
