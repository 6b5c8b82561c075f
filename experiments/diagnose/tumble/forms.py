"""The candidates of a tumble campaign: the forms that the files of effects declare (`rigid.terms.candidate`)."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from experiments.diagnose.fit.own import OwnEffect, parameters_of
from experiments.diagnose.fit.problem import Form
from rigid.terms import CANDIDATES, EFFECTS
from rigid.terms import candidate as declared

__all__ = ["TumbleForm", "shaped", "tumble_forms"]

Array = NDArray[np.float64]
Columns = dict[str, Array]


def _inverse(value: Array, typical: float) -> Array:
    with np.errstate(divide="ignore"):
        return np.where(value > 0, 1 / np.maximum(value, 1e-12), math.inf)


_HOWS: Mapping[str, Callable[[Array, float], Array]] = {
    "same": lambda value, typical: value,
    "change": lambda value, typical: typical + value,
    "logarithm": lambda value, typical: typical * np.exp(value),
    "inverse": _inverse,
}


@dataclass(frozen=True, kw_only=True)
class TumbleForm(Form):
    """A form with what it means to the term."""

    numbers: tuple[declared.Number, ...]
    bends: tuple[declared.Bend, ...] = ()
    """What may bend it, once."""
    form_std: float = 0.0
    """Of the amplitude, relative: how far nature's law lets it be another number than the form's."""

    def physical(self, values: Mapping[str, Array]) -> Columns:
        """Arrays of the form's parameters -> arrays of the term's, under their names "<effect>.<parameter>"."""
        columns: Columns = {}
        for number in self.numbers:
            if number.how == "fixed":
                found = np.full(np.shape(values[self.amplitude]), number.typical)
            else:
                value = np.asarray(values[f"{self.effect}.{number.fitted}"], dtype=float)
                found = _HOWS[number.how](value, number.typical)
            columns[f"{self.effect}.{number.name}"] = found
        return columns


def tumble_forms(*, rig: bool, own: Sequence[OwnEffect] = (), **typical: float) -> tuple[TumbleForm, ...]:
    """The library for one campaign.

    Args:
        rig: whether the campaign has the gravity-offloading rig; some effects need it.
        own: effects from files.
        typical: what is typical of the campaign (`rigid.terms.candidate.Typical`).
    """
    sizes = declared.Typical(**typical)
    found = [(found.tumble.rank, id, found.tumble) for id, found in CANDIDATES.items() if found.tumble is not None]
    library = [(id, tumble) for _, id, tumble in sorted(found, key=lambda row: row[:2])]
    library = [(id, tumble) for id, tumble in library if rig or not EFFECTS[id].needs_rig]
    library += [(effect.id, effect.tumble) for effect in own if rig or not effect.term.needs_rig]
    return tuple(_made(id, form, tumble.bends) for id, tumble in library for form in tumble.forms(sizes))


def _made(effect: str, form: declared.Form, bends: Sequence[declared.Bend]) -> TumbleForm:
    parameters = parameters_of(effect, form.numbers)
    names = [p.name for p in parameters]
    return TumbleForm(
        effect=effect, name=form.name, parameters=parameters, amplitude=names[0], numbers=form.numbers,
        starts=tuple(dict(zip(names, start, strict=True)) for start in form.starts), form_std=form.form_std,
        redefines=form.redefines, bends=tuple(bend for bend in bends if form.name in bend.of),
    )  # fmt: skip


def shaped(forms: Sequence[TumbleForm]) -> dict[str, tuple[TumbleForm, ...]]:
    """The forms that can be bent, with the numbers that bend them: id of the plain form -> the bent ones.

    A bent form is no candidate of its own. It is fitted only after the plain form has been, from there, with its
    numbers beginning at what changes nothing; so it costs little, and a name is found by the plain form.
    """
    return {form.id: tuple(_bent(form, bend) for bend in form.bends) for form in forms if form.bends}


def _bent(form: TumbleForm, bend: declared.Bend) -> TumbleForm:
    more = parameters_of(form.effect, bend.numbers)
    places = [dict(zip((p.name for p in more), place, strict=True)) for place in bend.starts]
    return replace(
        form, name=bend.name.format(form.name), parameters=(*form.parameters, *more),
        numbers=(*form.numbers, *bend.numbers),
        starts=tuple({**start, **place} for place in places for start in form.starts or ({},)),
    )  # fmt: skip
