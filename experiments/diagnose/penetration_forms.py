"""The library of effects on a spike that goes straight down, each in several forms (see `penetration_law`).

Amplitudes are in units of the campaign: forces in K D (stiffness times the depth D typical of the trials), so that
one scale serves grains and clay. Where trials have several diameters d, forces on a section go with d^2, on a shaft
with d, and what belongs to the bed's spring with that diameter's own K; this is what ties the diameters together.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from .problem import Form, Parameter

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
    ``viscous`` (force over speed by d)."""


@dataclass(frozen=True)
class Library:
    """Forms, and where each of their parameters enters the law."""

    forms: tuple[Form, ...]
    slots: dict[str, dict[str, Slot]]
    """Form id -> parameter -> slot."""
    shapes: dict[str, tuple[Form, ...]]
    """Form id -> the same form with more numbers, tried from where the plain one ends; a bent one may be bent again."""


_Add = Callable[..., None]
_REDEFINED = {"depth-hardening": ("stiffness",), "layering": ("stiffness",)}


def make_library(scales: Scales, *, retreats: bool, speeds_differ: bool) -> Library:
    """The forms that a campaign with these scales can show.

    `retreats`: some trial comes back out, without which nothing that acts on the way out can be seen.
    `speeds_differ`: the speed changes by more than 5 % within or between trials.
    """
    forms: list[Form] = []
    slots: dict[str, dict[str, Slot]] = {}

    def add(
        effect: str,
        name: str,
        amplitude: tuple[str, str, float, float, float],
        *more: tuple[str, str, float, float],
        starts: tuple[tuple[float, ...], ...],
    ) -> None:
        """`amplitude`: slot, how, std, lowest, highest; `more`: slot, how, lowest, highest of logarithmic lengths."""
        slot, how, std, lowest, highest = amplitude
        parameters = [
            Parameter(name=f"{effect}.{slot}", unit="1", value=0.0, std=std, scale=max(0.05 * std, 1e-3), lowest=lowest,
                      highest=highest, step=1e-4)
        ]  # fmt: skip
        table = {parameters[0].name: Slot(slot, how)}
        for other, other_how, low, high in more:
            parameter = Parameter(
                name=f"{effect}.{other}", unit="1", value=0.5 * (low + high), std=0.5 * (high - low), scale=0.2,
                lowest=low, highest=high, step=1e-3,
            )  # fmt: skip
            parameters.append(parameter)
            table[parameter.name] = Slot(other, other_how)
        names = [parameter.name for parameter in parameters]
        form = Form(
            effect=effect, name=name, parameters=tuple(parameters), amplitude=names[0],
            starts=tuple(dict(zip(names, start, strict=True)) for start in starts), linear=len(names) == 1,
            redefines=_REDEFINED.get(effect, ()),
        )  # fmt: skip
        forms.append(form)
        slots[form.id] = table

    _add_hardening(add)
    _add_layering(add)
    _add_drag(add, speeds_differ)
    if retreats:
        _add_plastic(add)
        _add_adhesion(add)
    _add_shaft(add, retreats)
    shapes: dict[str, tuple[Form, ...]] = {}

    def bend(form: Form, ways: Sequence[_Shape]) -> None:
        """All `ways` of a form, and of what each makes of it those that come after."""
        for place, shape in enumerate(ways):
            bent = _with_more(form, shape)
            slots[bent.id] = slots[form.id] | {f"{form.effect}.{slot}": Slot(slot, how) for slot, how, *_ in shape.more}
            shapes[form.id] = (*shapes.get(form.id, ()), bent)
            bend(bent, ways[place + 1 :])

    for plain in forms:
        bend(plain, [shape for shape in _SHAPES if plain.name in shape.of and plain.effect == shape.effect])
    return Library(tuple(forms), slots, shapes)


@dataclass(frozen=True)
class _Shape:
    """What bends a form: nature's law is never quite the library's."""

    effect: str
    of: tuple[str, ...]
    """Names of the forms that it bends."""
    name: str
    """The bent form's, with the plain one's for {}."""
    more: tuple[tuple[str, str, float, float, float, float], ...]
    """Of each number: slot, how, value and std of the prior, lowest, highest."""
    starts: tuple[tuple[float, ...], ...]


_SHAPES = (
    _Shape("depth-hardening", ("quadratic",), "with a power", (("hardening_steeper", "plain", 0.0, 0.5, -0.8, 2.0),),
           ((-0.35,), (0.35,))),
    # A tip that is in when it is in, or a stream that goes on widening.
    _Shape("inertial-drag", ("with an onset",), "{}, as sharp as it is",
           (("drag_sharpness", "plain", 2.5, 2.0, 0.7, 8.0),), ((1.0,), (4.0,))),
    # The shaft behind a wider tip, or a plate's edge: from a depth on it rubs as it will.
    _Shape("shaft-friction", ("constant", "by a power of depth", "falling with speed", "mobilised over a way"),
           "{}, setting in", (("shaft_onset", "depth", -3.0, 1.5, -6.0, 0.0),
                              ("shaft_sharpness", "plain", 2.5, 2.0, 0.7, 8.0)), ((-3.0, 3.0), (-1.3, 3.0))),
    # What shears between the shaft and the bed resists the more the faster, up to a bound.
    _Shape("shaft-friction", ("constant", "growing with depth", "by a power of depth"), "{}, rising with speed",
           (("shaft_rise", "speed", -3.0, 1.5, -8.0, 0.0),), ((-2.5,), (-4.0,))),
    # What is held loses its hold as the spike comes out.
    _Shape("adhesion", ("held", "held by depth", "held wherever it has been"), "{}, fading towards the surface",
           (("pull_fade", "depth", -2.0, 1.5, -6.0, 1.0), ("pull_fade_sharpness", "plain", 2.5, 2.0, 0.7, 8.0)),
           ((-2.5, 2.0), (-0.7, 2.0))),
    # What takes a motion away from the bed to act lets go of a spike that goes in again.
    _Shape("adhesion", ("held", "held by depth", "held wherever it has been"), "{}, on the way out",
           (("pull_out", "plain", 0.5, 0.5, 0.0, 1.0),), ((0.9,),)),
    # What is held at once may let go over another way than that over which it was taken up: a meniscus, a tail.
    _Shape("adhesion", ("held", "held by depth", "held wherever it has been"), "{}, letting go",
           (("pull_let", "depth", -1.0, 1.5, -5.0, 3.0),), ((-1.8,), (-0.5,))),
    # Where the crater is empty nothing is touched, and no damper acts.
    _Shape("plastic-sinkage", ("crater", "curved crater", "stiffer unloading"), "{}, empty",
           (("crater_open", "plain", 0.5, 0.5, 0.0, 1.0),), ((0.9,),)),
)  # fmt: skip


def _with_more(plain: Form, shape: _Shape) -> Form:
    """`plain` with the numbers of `shape`."""
    more = tuple(
        Parameter(name=f"{plain.effect}.{slot}", unit="1", value=value, std=std, scale=0.2 * std, lowest=lowest,
                  highest=highest, step=1e-3)
        for slot, _, value, std, lowest, highest in shape.more
    )  # fmt: skip
    bends = tuple(dict(zip((p.name for p in more), start, strict=True)) for start in shape.starts)
    starts = tuple({**start, **bend} for bend in bends for start in plain.starts)
    return replace(plain, name=shape.name.format(plain.name), parameters=(*plain.parameters, *more), starts=starts,
                   linear=False)  # fmt: skip


def _add_hardening(add: _Add) -> None:
    effect = "depth-hardening"
    add(effect, "power", ("hardening_power", "plain", 0.6, -0.9, 3.0), starts=((0.2,), (-0.2,)))
    add(effect, "quadratic", ("hardening_quadratic", "plain", 0.8, -0.6, 20.0), starts=((0.3,), (-0.2,)))
    add(effect, "cubic", ("hardening_cubic", "plain", 0.8, -0.4, 20.0), starts=((0.3,), (-0.15,)))
    add(effect, "exponential", ("hardening_exponential", "plain", 0.8, -8.0, 6.0), starts=((0.5,), (-0.5,)))
    # Towards a depth that it never reaches: a bed that locks.
    add(effect, "locking", ("hardening_locking", "plain", 0.4, 0.0, 0.71), starts=((0.2,), (0.5,)))
    add(effect, "early", ("hardening_early", "spring force", 0.5, 0.0, 20.0), ("hardening_reach", "depth", -4.0, 0.0),
        starts=((0.1, -2.5), (0.2, -1.0)))  # fmt: skip
    # Towards a bound, a hyperbola (Kondner, J. Soil Mech. Found. Div. 89 (1963), 115) where the sharpness is 1.
    add(effect, "levelling off", ("hardening_level", "plain", 0.8, 0.0, 20.0),
        ("hardening_sharpness", "plain", 0.7, 5.0), starts=((0.3, 1.5), (1.0, 1.5)))  # fmt: skip


def _add_layering(add: _Add) -> None:
    # A layer is sharp: its edge is narrower than a quarter of D. What changes all the way down is hardening.
    effect, edge, width = "layering", ("layer_depth", "depth", math.log(0.03), math.log(1.25)), math.log(0.12)
    starts = tuple((a, math.log(x), math.log(0.02)) for x in (0.1, 0.3, 0.55, 0.85) for a in (0.4, -0.25))
    narrow = ("layer_width", "depth", math.log(0.005), width)
    add(effect, "slope", ("layer_slope", "spring", 0.8, -1.5, 20.0), edge, narrow, starts=starts)
    sharp = tuple((a, math.log(x), math.log(0.04)) for x in (0.1, 0.3, 0.55, 0.85) for a in (0.3, -0.2))
    add(effect, "factor", ("layer_factor", "plain", 0.8, -0.95, 20.0), edge, narrow, starts=sharp)
    add(effect, "step", ("layer_step", "spring force", 0.5, -2.0, 10.0), edge, narrow, starts=sharp)
    add(effect, "crust", ("layer_bump", "spring force", 0.4, 0.0, 10.0),
        ("layer_depth", "depth", math.log(0.05), math.log(1.25)),
        ("layer_width", "depth", math.log(0.02), math.log(0.2)),
        starts=tuple((0.15, math.log(x), math.log(0.08)) for x in (0.15, 0.35, 0.6, 0.9)))  # fmt: skip


def _add_drag(add: _Add, speeds_differ: bool) -> None:
    effect = "inertial-drag"
    add(effect, "square", ("drag", "drag", 0.5, 0.0, 20.0), starts=((0.1,),))
    if speeds_differ:
        add(effect, "with an onset", ("drag_onset", "drag", 0.5, 0.0, 20.0), ("drag_reach", "depth", -3.0, 1.0),
            starts=((0.1, -2.0), (0.1, 0.0)))  # fmt: skip
        add(effect, "growing with depth", ("drag_deep", "drag", 0.5, 0.0, 20.0), starts=((0.1,),))
        add(effect, "of the tip", ("drag_tip", "drag", 0.5, 0.0, 20.0), starts=((0.1,),))
        add(effect, "both ways", ("drag_both", "drag", 0.5, 0.0, 20.0), starts=((0.1,),))


def _add_plastic(add: _Add) -> None:
    effect = "plastic-sinkage"
    add(effect, "crater", ("crater_share", "plain", 0.5, 0.0, 0.97), starts=((0.1,), (0.4,), (0.8,)))
    add(
        effect, "curved crater", ("crater_share", "plain", 0.5, 0.0, 0.97), ("crater_bend", "plain", 0.0, 2.5),
        starts=((0.1, 0.5), (0.4, 0.5), (0.7, 1.0), (0.7, 0.0)),
    )  # fmt: skip
    add(effect, "stiffer unloading", ("unload_stiffness", "plain", 5.0, 0.0, 200.0), starts=((0.2,), (1.0,), (6.0,)))


def _add_adhesion(add: _Add) -> None:
    effect, reach = "adhesion", ("pull_reach", "depth", math.log(0.005), math.log(1.0))
    # How sharply it goes from growing to its full size: 1 is a hyperbola, 2.3 next to tanh, 5 next to a corner.
    sharp = ("pull_sharpness", "plain", 0.7, 5.0)
    add(effect, "held", ("pull", "area", 0.3, 0.0, 10.0), reach, sharp, starts=((0.05, -3.0, 2.0), (0.1, -1.0, 2.0)))
    grown = ("pull_growth", "plain", 0.0, 2.0)
    add(effect, "held by depth", ("pull_deep", "area", 0.3, 0.0, 10.0), reach, grown, sharp,
        starts=((0.05, -3.0, 0.7, 2.0), (0.1, -1.0, 0.7, 2.0)))  # fmt: skip
    add(effect, "held wherever it has been", ("pull_ever", "area", 0.3, 0.0, 10.0), reach, grown, sharp,
        starts=((0.05, -3.0, 0.7, 2.0), (0.1, -1.0, 0.7, 2.0)))  # fmt: skip
    add(effect, "held and let go", ("pull_short", "area", 0.3, 0.0, 10.0), reach, starts=((0.1, -3.0), (0.1, -1.0)))
    add(effect, "viscous", ("pull_viscous", "viscous", 0.3, 0.0, 10.0), starts=((0.1,),))


def _add_shaft(add: _Add, retreats: bool) -> None:
    effect = "shaft-friction"
    add(effect, "constant", ("shaft", "perimeter", 0.3, 0.0, 10.0), starts=((0.05,),))
    if retreats:
        add(effect, "growing with depth", ("shaft_deep", "perimeter", 0.3, 0.0, 10.0), starts=((0.05,),))
        grown = ("shaft_growth", "plain", 0.0, 2.0)
        add(effect, "by a power of depth", ("shaft_power", "perimeter", 0.3, 0.0, 10.0), grown,
            starts=((0.05, 0.5), (0.05, 1.5)))  # fmt: skip
        add(effect, "viscous", ("shaft_viscous", "viscous", 0.3, 0.0, 10.0), starts=((0.05,),))
        add(effect, "falling with speed", ("shaft_slow", "perimeter", 0.3, 0.0, 10.0),
            ("shaft_speed", "speed", -5.0, 1.0), starts=((0.05, -1.0), (0.05, -3.0)))  # fmt: skip
        # It takes a way to turn round, and stays while the spike is held. Were its bound as large as the spring, it
        # would be a crater: loading doubled, nothing given back.
        add(effect, "mobilised over a way", ("shaft_held", "perimeter", 0.1, 0.0, 0.4),
            ("shaft_reach", "depth", math.log(0.003), 0.0), ("shaft_growth", "plain", 0.0, 1.5),
            starts=((0.05, -4.0, 0.3), (0.05, -2.0, 0.3)))  # fmt: skip


def physical(slot: Slot, value: float, scales: Scales, *, stiffness: float, size: float) -> float:
    """What the law's slot gets: `stiffness` [N/m] is this diameter's K, `size` its diameter over the campaign's."""
    if slot.how == "plain":
        return value
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


_UNITS = {"plain": "1", "depth": "m", "speed": "m/s", "spring": "N/m", "spring force": "N", "area": "N", "drag": "kg/m",
          "perimeter": "N", "viscous": "N s/m"}  # fmt: skip


def unit_of(slot: Slot) -> str:
    """The unit of what `physical` gives."""
    return _UNITS[slot.how]
