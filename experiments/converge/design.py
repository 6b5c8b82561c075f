"""Which runs a sweep is made of, and in which order they are made.

The base is the case itself. A variant differs from it in one thing. A member is a variant on the bed of one seed: an
ordinary `penetrate` run, whose beds all get the same drives and drops.

All members but those of other overlaps have one modulus, so that grains of every size overlap alike. Grains of the
mean diameter d are driven at `driven_grain` / d times the speeds of the case: the inertial number is then the same,
    I = v d / (D sqrt(phi g D)),
It is the rate v / D of shear under a tip of diameter D, times d sqrt(rho / P) (GDR MiDi 2004). P = phi rho g D is the
pressure of grains one tip deep, with phi = 0.6 (`experiments.grains.similarity`).
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from experiments.grains import similarity
from experiments.penetrate import beds
from experiments.penetrate.settings import PenetrateSettings
from experiments.pool.tasks import name_of, task_of
from experiments.pool.together import Planned
from experiments.runs.registry import find_experiment

from .costs import core_hours
from .settings import FEWEST_ACROSS, LEAST_WIDTH, ConvergeSettings, say

__all__ = ["AXES", "BASE", "Member", "Variant", "affordable", "inertial_number", "members_of", "variants_of"]

BASE = "base"
AXES = {"grain": "ratios", "width": "widths", "depth": "bed_depths", "overlap": "overlaps", "speed": "paces"}
"""What is varied, and the setting that lists its values."""
ROOM = 2.0
"""Overlap at which a member ends, over the one its modulus is chosen for [1]: the choice is an estimate made
beforehand."""
MOST_OVERLAP = 0.1
"""That `penetrate` takes [of a diameter]."""
_NOT_OF_THE_BED = ("arch", "frame_count", "allow_coarse")
"""Settings that say how a member is computed, not which it is. `arch` changes its bits, not what they are drawn from: a
sweep may be made in parts, some of them on a GPU."""


def inertial_number(settings: PenetrateSettings, speed: float) -> float:
    """Of a spike driven at `speed` [m/s] into these grains [1]; see the module."""
    return similarity.inertial_number(
        speed, gravity=settings.gravity, diameter=settings.tip_diameter, grain=settings.grain
    )


SIZES_TELL = 4.0
"""Information from another grain size, over that from another width, depth, overlap or speed [1]. From three to ten
grains across, K of the shipped spike fell by 40 %. With the width it changed less than between beds
(docs/notes/results.md)."""


@dataclass(frozen=True)
class Variant:
    """The base, or what differs from it in one thing. `value` is in the unit of the setting that lists it."""

    what: str  # BASE or one of AXES
    value: float
    settings: PenetrateSettings  # with the seeds of the sweep

    @property
    def id(self) -> str:
        """Its name in the result."""
        return BASE if self.what == BASE else f"{self.what}-{self.value:g}"


@dataclass(frozen=True)
class Member:
    """A variant on the bed of one seed."""

    variant: Variant
    seed: int
    place: int
    """Of its seed among those of the sweep, from 1."""

    @property
    def id(self) -> str:
        """Its name in the result and in the notes of what is done."""
        return f"{self.variant.id}-seed{self.seed}"

    @cached_property
    def settings(self) -> PenetrateSettings:
        """Of the run."""
        return self.variant.settings.model_copy(update={"seeds": (self.seed,)})

    @cached_property
    def folder(self) -> str:
        """The name of its run folder: the same for the same settings and code, whatever the sweep calls it."""
        settings = self.settings
        width, deep = 1e3 * settings.bed_size[0], 1e3 * settings.bed_size[2]
        label = f"{1e3 * settings.grain:.3g}mm-in-{width:.3g}x{deep:.3g}mm-seed{self.seed}"
        return name_of(find_experiment("penetrate"), settings, label=label, beside=_NOT_OF_THE_BED)

    def planned(self, home: Path) -> Planned:
        """The run as one of a list, in a folder below `home`."""
        task = task_of(find_experiment("penetrate"), self.settings, home, name=self.folder)
        return Planned(task, self.id, 3600 * self.core_hours)

    @property
    def tells(self) -> float:
        """Its information, over that of another width or depth [1]."""
        return SIZES_TELL if self.variant.what in (BASE, "grain") else 1.0

    @cached_property
    def core_hours(self) -> float:
        """About what it takes one core [h]. Another speed is driven on the very bed of the base, from the cache."""
        return core_hours(self.settings, bed=self.variant.what != "speed" or not self.settings.cache)


def variants_of(settings: ConvergeSettings) -> list[Variant]:
    """The base, and what differs from it in one thing: finer or coarser grains, other widths, depths, ...

    A value that is the base's own is not made again. Raises ValueError, naming the list and the value, for one that
    `penetrate` refuses, with what is sufficient and what that costs.
    """
    base = _base(settings)
    found = [Variant(BASE, 1.0, base)]
    for what, value in _values(settings):
        made = _varied(settings, base, what, value)
        try:
            PenetrateSettings(**made.model_dump())  # `model_copy` checks nothing
        except ValidationError as error:
            reason = error.errors()[0]["msg"].removeprefix("Value error, ")
            raise ValueError(f"{AXES[what]} has {value:g}: {reason}{_cost(settings, base, what, value)}") from None
        found.append(Variant(what, value, made))
    return found


def members_of(settings: ConvergeSettings, variants: Sequence[Variant]) -> list[Member]:
    """All members, in the order in which they are made: by cost times the place of the seed, over their information.

    The k-th bed of a variant gives about a k-th of the information of the first, and grain size `SIZES_TELL` times that
    of the rest. So the cheapest information comes first.
    """
    places = list(enumerate(settings.seeds, 1))
    found = [Member(variant, seed, place) for variant in variants for place, seed in places]
    return sorted(found, key=lambda member: member.core_hours * member.place / member.tells)


def affordable(members: Sequence[Member], budget: float | None) -> list[Member]:
    """Those that the budget [h of one core] reaches by their estimates, in their order; all without a budget."""
    if budget is None:
        return list(members)
    found, spent = [], 0.0
    for member in members:
        spent += member.core_hours
        if spent > budget:
            break
        found.append(member)
    return found


def _values(settings: ConvergeSettings) -> Iterator[tuple[str, float]]:
    """What is varied to which value; those of the base left out."""
    own = {
        "grain": settings.ratio, "width": settings.width, "depth": settings.bed_depth,
        "overlap": settings.max_overlap, "speed": 1.0,
    }  # fmt: skip
    for what, key in AXES.items():
        for value in getattr(settings, key):
            if not math.isclose(value, own[what], rel_tol=1e-6):
                yield what, value


def _base(settings: ConvergeSettings) -> PenetrateSettings:
    """The base as `penetrate` has it: the same runs on all seeds, its modulus chosen for the fastest of all members."""
    plain = {name: getattr(settings, name) for name in PenetrateSettings.model_fields}
    plain |= {"other_speeds": settings.speeds, "other_drop_speeds": settings.drop_speeds}
    base = PenetrateSettings.model_construct(**plain)
    young = settings.young
    if young is None:
        cases = [_paced(settings, base), *(_changed(settings, base, *pair) for pair in _values(settings))]
        young = max(beds.choose_softness(case.model_copy(update={"max_overlap": settings.max_overlap})).young
                    for case in cases)  # fmt: skip
    room = min(MOST_OVERLAP, ROOM * settings.max_overlap)
    return _paced(settings, base).model_copy(update={"young": young, "max_overlap": room})


def _paced(settings: ConvergeSettings, base: PenetrateSettings, factor: float = 1.0) -> PenetrateSettings:
    """`base` at the speeds that have the sweep's inertial number in its grains, times `factor`."""
    factor *= settings.driven_grain / base.grain
    speeds = tuple(_typed(factor * speed) for speed in settings.speeds)
    return base.model_copy(
        update={"speeds": speeds, "other_speeds": speeds, "lowering_speed": _typed(factor * settings.lowering_speed)}
    )


def _typed(number: float) -> float:
    """As one would type it, so that a setting is the same in two sweeps that come to it by different ways."""
    return float(f"{number:.10g}")


def _changed(settings: ConvergeSettings, base: PenetrateSettings, what: str, value: float) -> PenetrateSettings:
    """`base` with one thing changed, whatever its modulus."""
    tip, size = settings.tip_diameter, settings.bed_size
    if what == "speed":
        return _paced(settings, base, value)
    if what == "overlap":
        return base
    if what != "grain":
        across = _typed(value * tip)
        sides = (across, across, size[2]) if what == "width" else (*size[:2], across)
        return base.model_copy(update={"bed_size": sides})
    finer = {"grain": _typed(tip / value)}
    if settings.coarse is not None:  # a graded bed is as much finer everywhere
        finer["coarse"] = _typed(settings.coarse * settings.ratio / value)
    return _paced(settings, base.model_copy(update=finer))


def _varied(settings: ConvergeSettings, base: PenetrateSettings, what: str, value: float) -> PenetrateSettings:
    """`base` with one thing changed; for another overlap the modulus is."""
    if what != "overlap":
        return _changed(settings, base, what, value)
    softer = settings.max_overlap / value
    if settings.young is None:
        free = base.model_copy(update={"young": None})
        own, other = (
            beds.choose_softness(free.model_copy(update={"max_overlap": overlap})).young
            for overlap in (settings.max_overlap, value)
        )
        ratio = other / own
    else:  # Hertz: F goes with E overlap^1.5
        ratio = softer**1.5
    return base.model_copy(
        update={"young": _typed(ratio * float(base.young or 0.0)), "max_overlap": min(MOST_OVERLAP, ROOM * value)}
    )


def _cost(settings: ConvergeSettings, base: PenetrateSettings, what: str, value: float) -> str:
    """What the least sufficient value costs, over all seeds; empty where `value` is not too small."""
    tip = settings.tip_diameter
    least = {"grain": FEWEST_ACROSS, "width": LEAST_WIDTH, "depth": settings.depth / tip + 1}.get(what, 0.0)
    if value >= least:
        return ""
    mended = _varied(settings, base, what, least)
    hours = len(settings.seeds) * core_hours(mended)
    return say("least", key=AXES[what], least=least, grains=mended.grain_count, hours=hours)


def told_of(variant: Variant) -> Mapping[str, Any]:
    """What the result says of a variant beside its id."""
    settings = variant.settings
    keys = ("grain", "bed_size", "young", "speeds", "lowering_speed")
    return {"what": variant.what, "value": variant.value} | {key: getattr(settings, key) for key in keys}
