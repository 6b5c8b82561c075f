"""What follows gravity where it is not given: speeds go with sqrt(g), times with 1 / sqrt(g), and there is no rig.

So the Froude number v / sqrt(g D) and the inertial number of a run are those of the defaults at 1 g
(`experiments.grains.similarity`). A run under any gravity takes as many steps of the grains. Grains that stick are
held together by their cohesion c as well: for them g + c / (rho_b D) takes the place of g, here and on Earth, which
keeps the inertial number. The modulus follows by itself: it is chosen for the pressures and speeds of the run. A rig
makes a platform light on Earth: under another gravity than Earth's there is none, unless it is given.
"""

import math
from collections.abc import Mapping
from typing import Any

from experiments.grains.bearing import cohesion_of
from experiments.grains.softening import PACKING
from experiments.runs.types import Json
from rigid.platform.rig import STANDARD_GRAVITY

__all__ = ["SPEEDS", "TIMES", "following", "pace", "sticking_of"]

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
