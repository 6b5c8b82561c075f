"""The candidates of a tumble campaign: the forms that the files of effects declare (`rigid.terms.candidate`)."""

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from experiments.diagnose.fit.forms import OwnEffect, plain_form
from experiments.diagnose.fit.problem import Array, Form, Values
from rigid.terms import CANDIDATES, EFFECTS
from rigid.terms.candidate import Typical

__all__ = ["physical", "physical_at", "tumble_forms"]


def _inverse(value: Array, typical: float) -> Array:
    with np.errstate(divide="ignore"):
        return np.where(value > 0, 1 / np.maximum(value, 1e-12), math.inf)


_HOWS: Mapping[str, Callable[[Array, float], Array]] = {
    "same": lambda value, typical: value,
    "change": lambda value, typical: typical + value,
    "logarithm": lambda value, typical: typical * np.exp(value),
    "inverse": _inverse,
}


def physical(form: Form, values: Mapping[str, Array]) -> dict[str, Array]:
    """Arrays of the form's parameters -> arrays of the term's, under their names "<effect>.<parameter>"."""
    columns: dict[str, Array] = {}
    for number in form.numbers:
        if number.how == "fixed":
            found = np.full(np.shape(values[form.amplitude]), number.typical)
        else:
            value = np.asarray(values[f"{form.effect}.{number.fitted}"], dtype=float)
            found = _HOWS[number.how](value, number.typical)
        columns[f"{form.effect}.{number.name}"] = found
    return columns


def physical_at(form: Form, points: Sequence[Values]) -> dict[str, Array]:
    """The same at points that name the form's parameters, or leave them as they are; one number a point."""
    return physical(
        form, {p.name: np.array([values.get(p.name, p.value) for values in points]) for p in form.parameters}
    )


def tumble_forms(*, rig: bool, own: Sequence[OwnEffect] = (), **typical: float) -> tuple[Form, ...]:
    """The library for one campaign, and effects from files (`own`).

    `rig`: whether the campaign has the gravity-offloading rig; some effects need it. `typical`: what is typical of it
    (`rigid.terms.candidate.Typical`).
    """
    sizes = Typical(**typical)
    found = [(found.tumble.rank, id, found.tumble) for id, found in CANDIDATES.items() if found.tumble is not None]
    library = [(id, tumble) for _, id, tumble in sorted(found, key=lambda row: row[:2])]
    library = [(id, tumble) for id, tumble in library if rig or not EFFECTS[id].needs_rig]
    library += [(effect.id, effect.tumble) for effect in own if rig or not effect.term.needs_rig]
    return tuple(plain_form(id, form, tumble.bends) for id, tumble in library for form in tumble.forms(sizes))
