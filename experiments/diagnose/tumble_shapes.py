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
    """A number of a term that bends a form: `name` less `plain` is fitted, from 0, with a prior of `std`; `logarithm`:
    that of it over `plain`."""

    name: str
    plain: float
    std: float
    lowest: float
    highest: float
    unit: str = "1"
    logarithm: bool = False
    sides: tuple[float, ...] = (-0.7, 0.7)
    """Where fits begin, in `std`."""

    @property
    def fitted(self) -> str:
        """Name of the parameter that is fitted."""
        effect, _, own = self.name.partition(".")
        return f"{effect}.log_{own}" if self.logarithm else f"{self.name}_change"

    def physical(self, value: NDArray[np.float64]) -> NDArray[np.float64]:
        """What the term gets."""
        return self.plain * np.exp(value) if self.logarithm else self.plain + value


def _rubbing(effect: str, speed: float) -> tuple[tuple[_Shape, ...]]:
    """Dry friction that is more near rest: by which share of its level, and the speed by which that has fallen."""
    return (
        (
            _Shape(f"{effect}.excess", 0.0, 0.5, 0.0, 4.0, sides=(0.7,)),
            _Shape(f"{effect}.speed", speed, 1.0, -4.0, 4.0, logarithm=True),
        ),
    )


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
    "rig-friction:dry": _rubbing("rig-friction", 0.03),
    "bearing-drag:dry": _rubbing("bearing-drag", 0.2),
}
"""By the id of the plain form; where there are several ways to bend it, the numbers of each."""


@dataclass(frozen=True)
class _Bent:
    """Arrays of the shaped form's parameters -> arrays of the term's."""

    form: TumbleForm
    shapes: tuple[_Shape, ...]

    def __call__(self, values: Mapping[str, NDArray[np.float64]]) -> dict[str, NDArray[np.float64]]:
        bent = {shape.name: shape.physical(np.asarray(values[shape.fitted], dtype=float)) for shape in self.shapes}
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
        Parameter(name=shape.fitted, unit="1" if shape.logarithm else shape.unit, value=0.0, std=shape.std,
                  scale=0.3 * shape.std, lowest=shape.lowest, highest=shape.highest, step=0.02 * shape.std)
        for shape in shapes
    )  # fmt: skip
    places = [
        {bend.name: side * shape.std for bend, shape, side in zip(bends, shapes, sides, strict=True)}
        for sides in product(*(shape.sides for shape in shapes))
    ]
    starts = tuple({**start, **place} for place in places for start in form.starts or ({},))
    return replace(
        form, name=f"{form.name}, {_word(shapes)}", parameters=(*form.parameters, *bends), physical=_Bent(form, shapes),
        starts=starts,
    )  # fmt: skip


def _word(shapes: tuple[_Shape, ...]) -> str:
    if shapes[0].name.endswith(".excess"):
        return "more near rest"
    if shapes[0] is not _WOUND:
        return "of any shape"
    return "wound up" if len(shapes) == 1 else "wound up, of any shape"
