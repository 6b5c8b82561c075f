"""How long a bed takes to be prepared, and to come to rest in less gravity, on its own clock: for estimates alone."""

import math

__all__ = ["EFOLD", "RAIN", "RESTS", "lowering_time", "preparation_time", "rest_time"]

RAIN = 2.5
"""Height of the loose column that a bed is rained from, over the bed's depth [1]."""
PREPARATION = 1.6
"""What a bed costs in falls from the top of the column that it is rained from, as steps of a bed at rest [1]."""
TAPPED = 10.0
"""How many times that, where it is tapped to a packing fraction: 15 taps from 0.571 to 0.600 [1]."""


def preparation_time(depth: float, gravity: float, *, tapped: bool) -> float:
    """About how long a bed of this depth [m] takes to prepare under a gravity [m/s2], on its clock [s]."""
    return PREPARATION * (TAPPED if tapped else 1.0) * math.sqrt(2 * RAIN * depth / gravity)


EFOLD = 1.0
"""Time in which gravity falls by a factor of e [sqrt(d / g) before], as in `coupling.lowered_gravity`."""
RESTS = 2.0
"""Rest after it has fallen [sqrt(d / g) of the run]: 0.5 to 1.5 in four beds of 500 to 900 grains to 0.1, 0.01 and
0.001 of 1 g, 4 and 6 in two deeper ones to 0.001, by grains that roll on the surface (docs/notes/mujoco.md)."""
AT_ONCE = 45.0
"""Rest where it falls at once [sqrt(d / g) before]: 40 and 50 in two beds of 10 mm, from 1 g to 0.01 g."""


def lowering_time(first: float, last: float, *, grain: float) -> float:
    """About how long gravity takes from `first` to `last` [m/s2], with the rest there, on the bed's clock [s].

    ``grain``: diameter [m].
    """
    return EFOLD * math.log(first / last) * math.sqrt(grain / first) + RESTS * math.sqrt(grain / last)


def rest_time(first: float, *, grain: float) -> float:
    """As `lowering_time`, where gravity falls at once."""
    return AT_ONCE * math.sqrt(grain / first)
