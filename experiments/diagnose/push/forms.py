"""The candidates of a campaign of spikes that move straight down: the forms that the files of effects declare.

Amplitudes are in units of the campaign: forces in K D (stiffness times the depth D typical of the trials), so that
one scale serves grains and clay. Where trials have several diameters d, forces on a section go with d^2, on a shaft
with d, and what belongs to the bed's spring with that diameter's own K; this is what ties the diameters together.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from experiments.diagnose.fit.own import OwnEffect, parameters_of
from experiments.diagnose.fit.problem import Form
from rigid.terms import CANDIDATES
from rigid.terms import candidate as declared

__all__ = ["Library", "Scales", "Slot", "make_library", "physical", "unit_of"]


@dataclass(frozen=True, kw_only=True)
class Scales:
    """What is typical of a campaign; all above 0."""

    depth: float
    """D [m]: three quarters of the deepest depth."""
    speed: float
    """Of going in [m/s]."""
    force: float
    """K D [N] at the stiffness of campaign.toml, or fitted where that is free."""


@dataclass(frozen=True)
class Slot:
    """Where a parameter enters the law: slot = unit(value) * scale, scale by `how` it goes with the diameter."""

    name: str
    how: str
    """``plain``, ``depth`` (D e^value), ``speed`` (V e^value), ``spring`` (K, of this diameter), ``spring force`` (K D,
    of this diameter), ``area`` (force by d^2), ``drag`` (force over speed^2 by d^2), ``perimeter`` (force by d),
    ``viscous`` (force over speed by d), ``same`` and ``change`` (of a term from a file: in its own unit)."""
    unit: str = "1"
    """Of a term from a file."""
    off: float = 0.0
    """What a ``change`` is counted from."""


@dataclass(frozen=True)
class Library:
    """Forms, and where each of their parameters enters the law."""

    forms: tuple[Form, ...]
    slots: dict[str, dict[str, Slot]]
    """Form id -> parameter -> slot."""
    shapes: dict[str, tuple[Form, ...]]
    """Form id -> the same form with more numbers, tried from where the plain one ends; a bent one may be bent again."""


def make_library(scales: Scales, *, retreats: bool, speeds_differ: bool, own: Sequence[OwnEffect] = ()) -> Library:
    """The forms that a campaign with these scales can show, with those of effects from files.

    `retreats`: some trial comes back out, without which nothing that acts on the way out can be seen.
    `speeds_differ`: the speed changes by more than 5 % within or between trials.
    """
    library = Library((), {}, {})
    shown = {"": True, "retreats": retreats, "speeds": speeds_differ}
    pushes = [(found.push.rank, id, found.push) for id, found in CANDIDATES.items() if found.push is not None]
    made = [(id, form, push.bends, "") for _, id, push in sorted(pushes, key=lambda row: row[:2])
            for form in push.forms if shown[form.needs]]  # fmt: skip
    for mine in own:
        push = mine.push
        if push is None:
            made.append((mine.id, mine.form, (), f"{mine.id}."))
        else:
            made += [(mine.id, form, push.bends, "") for form in push.forms if shown[form.needs]]
    found = []
    for effect, form, bends, prefix in made:
        parameters = parameters_of(effect, form.numbers)
        names = [p.name for p in parameters]
        plain = Form(
            effect=effect, name=form.name, parameters=parameters, amplitude=names[0],
            starts=tuple(dict(zip(names, start, strict=True)) for start in form.starts),
            linear=len(names) == 1 and not prefix, redefines=form.redefines,
        )  # fmt: skip
        library.slots[plain.id] = _slots(effect, form.numbers, prefix)
        _bend(library, plain, [bend for bend in bends if form.name in bend.of])
        found.append(plain)
    return replace(library, forms=tuple(found))


def _slots(effect: str, numbers: Sequence[declared.Number], prefix: str = "") -> dict[str, Slot]:
    return {f"{effect}.{n.fitted}": Slot(f"{prefix}{n.name}", n.how, n.unit, n.typical) for n in numbers}


def _bend(library: Library, form: Form, bends: Sequence[declared.Bend]) -> None:
    """Enter all that a form may be bent into, and of what each bend makes of it those that come after."""
    for place, bend in enumerate(bends):
        more = parameters_of(form.effect, bend.numbers)
        places = [dict(zip((p.name for p in more), start, strict=True)) for start in bend.starts]
        bent = replace(
            form, name=bend.name.format(form.name), parameters=(*form.parameters, *more), linear=False,
            starts=tuple({**start, **bend} for bend in places for start in form.starts),
        )  # fmt: skip
        library.slots[bent.id] = library.slots[form.id] | _slots(form.effect, bend.numbers)
        library.shapes[form.id] = (*library.shapes.get(form.id, ()), bent)
        _bend(library, bent, bends[place + 1 :])


def physical(slot: Slot, value: float, scales: Scales, *, stiffness: float, size: float) -> float:
    """What the law's slot gets: `stiffness` [N/m] is this diameter's K, `size` its diameter over the campaign's."""
    if slot.how in ("plain", "same"):
        return value
    if slot.how == "change":
        return value + slot.off
    if slot.how == "depth":
        return scales.depth * math.exp(value)
    if slot.how == "speed":
        return scales.speed * math.exp(value)
    if slot.how == "spring":
        return value * stiffness
    if slot.how == "spring force":
        return value * stiffness * scales.depth
    factor = {"area": size**2, "drag": size**2 / scales.speed**2, "perimeter": size, "viscous": size / scales.speed}
    return value * scales.force * factor[slot.how]


_UNITS = {"depth": "m", "speed": "m/s", "spring": "N/m", "spring force": "N", "area": "N", "drag": "kg/m",
          "perimeter": "N", "viscous": "N s/m"}  # fmt: skip


def unit_of(slot: Slot) -> str:
    """The unit of what `physical` gives."""
    return _UNITS.get(slot.how, slot.unit)
