"""The candidates of a campaign of spikes that move straight down: the forms that the files of effects declare.

Amplitudes are in units of the campaign: forces in K D (stiffness times the depth D typical of the trials), so that
one scale serves grains and clay. Where trials have several diameters d, forces on a section are proportional to d^2, on
a shaft to d. Those of the bed's spring are proportional to that diameter's own K. This connects the diameters.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from experiments.diagnose.fit.forms import OwnEffect, plain_form
from experiments.diagnose.fit.problem import Array, Form
from rigid.terms import CANDIDATES
from rigid.terms.candidate import Number, Push

__all__ = ["Scales", "physical", "push_forms", "unit_of"]


@dataclass(frozen=True, kw_only=True)
class Scales:
    """What is typical of a campaign; all above 0."""

    depth: float  # D [m]: three quarters of the deepest depth
    speed: float  # of going in [m/s]
    force: float  # K D [N] at the stiffness of campaign.toml, or fitted where that is free


def push_forms(*, retreats: bool, speeds_differ: bool, drops: bool, own: Sequence[OwnEffect] = ()) -> tuple[Form, ...]:
    """The forms that a campaign can show, with those of effects from files.

    `retreats`: some trial is withdrawn; without one, effects that act in withdrawal cannot be seen.
    `drops`: some trial is a drop. `speeds_differ`: the speed changes by more than 5 % within or between trials.
    """
    shown = {"": True, "retreats": retreats, "speeds": speeds_differ, "drops": drops}
    library = [(found.push.rank, id, found.push) for id, found in CANDIDATES.items() if found.push is not None]

    def of(id: str, push: Push) -> list[Form]:
        return [plain_form(id, form, push.bends) for form in push.forms if shown[form.needs]]

    made = [form for _, id, push in sorted(library, key=lambda row: row[:2]) for form in of(id, push)]
    for mine in own:
        made += [_of_term(mine)] if mine.push is None else of(mine.id, mine.push)
    return tuple(made)


def _of_term(own: OwnEffect) -> Form:
    """The form of an effect whose term's hooks are its law; the law has its numbers under the effect's name."""
    form = plain_form(own.id, own.form, ())
    return replace(form, numbers=tuple(replace(n, name=f"{own.id}.{n.name}") for n in form.numbers))


def physical(
    slot: Number, value: float | Array, scales: Scales, *, stiffness: float | Array, size: float | Array
) -> float | Array:  # fmt: skip
    """What the law's slot gets: `stiffness` [N/m] is this diameter's K, `size` its diameter over the campaign's; of
    arrays that go together an array.

    How it follows from the value (`Number.how`): ``plain``, ``depth`` (D e^value), ``speed`` (V e^value), ``time``
    (e^value s), ``spring`` (K, of this diameter) and ``spring force`` (K D, of this diameter). By the diameter change
    ``area`` (force by d^2), ``drag`` (force over speed^2 by d^2), ``perimeter`` (force by d) and ``viscous`` (force
    over speed by d). Of a term from a file ``same`` and ``change`` are in its own unit.
    """
    if slot.how in ("plain", "same"):
        return value
    if slot.how == "change":
        return value + slot.typical
    if slot.how == "depth":
        return scales.depth * np.exp(value)
    if slot.how == "time":
        return np.exp(value)
    if slot.how == "speed":
        return scales.speed * np.exp(value)
    if slot.how == "spring":
        return value * stiffness
    if slot.how == "spring force":
        return value * stiffness * scales.depth
    factor = size if slot.how in ("perimeter", "viscous") else size**2
    if slot.how == "drag":
        factor = factor / scales.speed**2
    elif slot.how == "viscous":
        factor = factor / scales.speed
    return value * scales.force * factor


_UNITS = {"depth": "m", "speed": "m/s", "time": "s", "spring": "N/m", "spring force": "N", "area": "N", "drag": "kg/m",
          "perimeter": "N", "viscous": "N s/m"}  # fmt: skip


def unit_of(slot: Number) -> str:
    """The unit of what `physical` gives."""
    return _UNITS.get(slot.how, slot.unit)
