"""The numbers of a lane: of the law of a push with every effect of the library, and of effects from files."""

import inspect
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from experiments.diagnose.fit.forms import OwnEffect
from rigid.terms import CANDIDATES
from rigid.terms.candidate import Push

__all__ = ["HERE", "LIBRARY", "PLACES", "SLOTS", "VALUES", "slot_places", "slot_table", "slots_of"]

HERE = ("z", "v", "x", "way", "share", "most", "ever", "reference", "radius_depth")
VALUES: Mapping[str, tuple[str, ...]] = {
    "loading": ("grown", "depth", "x"), "unload": ("at", "stiff", "bent", "z", "ever", "stiffness"),
    "damper": ("factor", "spring"), "settle": ("gone", "z", "span"), "mass": ("z", "x", "reference"),
    "force": ("total", *HERE), "pull": ("total", *HERE),
}  # fmt: skip
"""What each hook of `Push.law` may ask for beside its effect's slots."""


def slots_of(law: Push) -> tuple[str, ...]:
    """Numbers of one trial that an effect's hooks ask for, in their order."""
    asked = [name for hook, function in law.law.items() for name in inspect.signature(function).parameters
             if name not in VALUES[hook]]  # fmt: skip
    return tuple(dict.fromkeys((*asked, *(law.turning or ()))))


LIBRARY = tuple(
    push for _, _, push in sorted((c.push.rank, id, c.push) for id, c in CANDIDATES.items() if c.push is not None)
)
SLOTS = (
    "mass", "gravity", "stiffness", "damping", "reference", "speed_scale", "radius_depth",
    *(slot for effect in LIBRARY for slot in slots_of(effect)), "shift_depth", "shift_row", "shift_speed",
    "given_way", "unload_change",
)  # fmt: skip
"""Numbers of a lane, in order. `radius_depth`: depth at which the tip is wholly in; `speed_scale`: below it the
direction of a driven spike is not certain; shifts: added to a driven spike's path, for derivatives (`shift_row`: to the
depth of each row alone, with its history unchanged); `given_way`: permanent sinkage of the bed before the push [m];
`unload_change`: of K where the way back has a stiffness of its own, relative."""
PLACES = {name: place for place, name in enumerate(SLOTS)}
_NEVER_ZERO = {"reference": 0.01, "speed_scale": 1e-4, "radius_depth": 1e-4}


def slot_places(own: Sequence[OwnEffect] = ()) -> dict[str, int]:
    """Slot -> its place in a lane; those of effects from files stand behind `SLOTS`, in order."""
    names = [name for effect in own for name, _ in _own_slots(effect)]
    return PLACES | {name: len(SLOTS) + place for place, name in enumerate(names)}


def _own_slots(effect: OwnEffect) -> list[tuple[str, float]]:
    """Numbers of an effect from a file: slot, and its value where the effect is off."""
    if effect.push is not None:
        return [(slot, effect.push.lengths.get(slot, 0.0)) for slot in slots_of(effect.push)]
    return [(f"{effect.id}.{p.name}", effect.neutral(p.name)) for p in effect.term.parameters]


def slot_table(count: int, own: Sequence[OwnEffect] = ()) -> NDArray[np.float64]:
    """Numbers of `count` lanes, shape [count, slot_count] (`slot_places`): nothing acts, and no length is zero."""
    off = [value for effect in own for _, value in _own_slots(effect)]
    table = np.zeros((count, len(SLOTS) + len(off)))
    table[:, len(SLOTS) :] = off
    lengths = [effect.lengths for effect in LIBRARY]
    for name, value in [pair for given in (_NEVER_ZERO, *lengths) for pair in given.items()]:
        table[:, PLACES[name]] = value
    return table
