"""What follows gravity where it is not given: speeds go with sqrt(g), times with 1 / sqrt(g), and there is no rig.

So the Froude number v / sqrt(g D) and the inertial number of a run are those of the defaults at 1 g
(`experiments.grains.similarity`), and a run under any gravity takes as many steps of the grains. Grains that stick are
held together by their cohesion c as well: for them g + c / (rho_b D) takes the place of g, here and on Earth, which
keeps the inertial number. The modulus follows by itself: it is chosen for the pressures and speeds of the run. A rig
makes a platform light on Earth: under another gravity than Earth's there is none, unless it is given.
"""

import math
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

from experiments.grains.bearing import cohesion_of
from experiments.grains.similarity import FAR, froude, inertia_share, inertial_number, quasi_static_speed
from experiments.grains.softening import PACKING
from experiments.runs.types import Json
from rigid.platform.rig import STANDARD_GRAVITY
from vis.page.sentences import Sentences

if TYPE_CHECKING:
    from .settings import PenetrateSettings

__all__ = ["SPEEDS", "TIMES", "fast_for_gravity", "following", "pace", "pace_of", "similarity_of", "sticking_of"]

say = Sentences(__package__)

SPEEDS = ("speeds", "other_speeds", "drop_speeds", "other_drop_speeds", "lowering_speed", "retreat_speed")
"""Settings that go with sqrt(g)."""
TIMES = ("hold", "after_stop", "drop_time", "rest_time")
"""Settings that go with 1 / sqrt(g)."""
_EARTH = 0.005
"""Difference from standard gravity within which it is that of a place on Earth, 9.764 to 9.834 m/s2 [1]."""
_DIGITS = 3  # Of what follows


def pace(gravity: float, *, sticking: float = 0.0) -> float:
    """How many times slower than on Earth a similar motion is, and 1 anywhere on Earth [1].

    `sticking`: c / (rho_b D) of grains that stick [m/s2], see `sticking_of`.
    """
    if abs(gravity / STANDARD_GRAVITY - 1) <= _EARTH:
        return 1.0
    return math.sqrt((STANDARD_GRAVITY + sticking) / (gravity + sticking))


def sticking_of(material: str, *, grain: float, diameter: float) -> float:
    """Cohesion of the grains over density and a tip's diameter [m/s2]; 0 where they do not stick.

    Raises ValueError for no material.
    """
    from dem.grains.materials import material as find_material

    stuff = find_material(material, grain=grain)
    return cohesion_of(stuff, grain) / (PACKING * stuff.density * diameter)


def pace_of(settings: "PenetrateSettings") -> float:
    """`pace` of these runs."""
    return pace(settings.gravity, sticking=_sticking(settings))


def _sticking(settings: "PenetrateSettings") -> float:
    return sticking_of(settings.material, grain=settings.grain, diameter=settings.tip_diameter)


def following(slower: float, defaults: Mapping[str, Any]) -> Json:
    """Settings that follow gravity by a `pace`, from their `defaults` at 1 g, to three digits; nothing on Earth."""
    if slower == 1.0:
        return {}
    found: Json = {"rig": 0.0}
    for names, by in ((SPEEDS, 1 / slower), (TIMES, slower)):
        found |= {name: _scaled(defaults[name], by) for name in names}
    return found


def _scaled(value: Any, factor: float) -> Any:
    if isinstance(value, tuple):
        return tuple(_scaled(item, factor) for item in value)
    return float(f"{value * factor:.{_DIGITS}g}")


def similarity_of(settings: "PenetrateSettings") -> Json:
    """The entry "similarity" of result.json: Froude and inertial numbers, which settings follow gravity, a sentence."""
    own = {name: type(settings).model_fields[name].default for name in (*SPEEDS, *TIMES)}
    slower, sticking = pace_of(settings), _sticking(settings)
    wanted = own | following(slower, own)
    used = [name for name in (*SPEEDS, *TIMES) if settings.used(name) not in ((), None)]
    given = [name for name in used if getattr(settings, name) != wanted[name]]
    speeds, of = sorted(settings.driven_speeds), {"diameter": settings.tip_diameter}
    numbers = [froude(speed, gravity=settings.gravity, **of) for speed in speeds]
    held = of | {"gravity": settings.gravity + sticking, "grain": settings.grain}
    inertial = [inertial_number(speed, **held) for speed in speeds]
    told = {
        "s": settings,
        "g": settings.gravity / STANDARD_GRAVITY,
        "held": ", their cohesion counted in" * bool(sticking),
    }
    told |= {"froude": _range(numbers), "inertial": _range(inertial)}
    sentence = say("on_earth" if slower == 1.0 else "follows", **told)
    return {
        "froude_numbers": numbers, "inertial_numbers": inertial, "pace": slower,
        "follow_gravity": [name for name in used if name not in given], "given": given,
        "sentence": f"{sentence}; given ones are kept as they are: {', '.join(given)}" if given else sentence,
    }  # fmt: skip


def _range(numbers: list[float]) -> str:
    low, high = (f"{number:.2g}" for number in (numbers[0], numbers[-1]))
    return low if low == high else f"{low} to {high}"


def fast_for_gravity(settings: "PenetrateSettings", friction: float) -> Iterator[str]:
    """A warning for every speed, of grains with this friction, at which inertia is no small part of the force."""
    of = {"gravity": settings.gravity + _sticking(settings), "diameter": settings.tip_diameter}
    for name in SPEEDS:
        value = settings.used(name) if name != "retreat_speed" else None  # what is fitted is the way in
        if not value:
            continue
        fastest = max(value) if isinstance(value, tuple) else value
        share = inertia_share(fastest, friction=friction, **of)
        if share > FAR:
            most = quasi_static_speed(friction=friction, **of)
            numbers = {"name": name, "fastest": fastest, "most": most}
            numbers["froude"] = froude(fastest, gravity=settings.gravity, diameter=settings.tip_diameter)
            yield say("fast_for_gravity", percent=100 * share, s=settings, **numbers)
