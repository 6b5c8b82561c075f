"""Advice before a run: the error from a bed too narrow, too shallow or too coarse, what is sufficient, and its cost.

K of a 12 mm spike in `sand` is 103, 80 and 62 N/m with 5, 8 and 12 grains across the tip, on a straight line in the
size of the grains (docs/results/converge-flagship): 68 with ten, and 120 and 150 on that line with 4 and 3. `COARSE`
has the ratios of these to K with ten. The time of a run is proportional to the number of grains and, because the time
step is proportional to their size, to d^-4: 16 times for half the grain diameter d.
"""

import math
from collections.abc import Iterator, Sequence

import numpy as np

from . import say

__all__ = ["ENOUGH_ACROSS", "ENOUGH_TIPS", "LEAST_BELOW", "costs", "resolution_advice", "times_as_long"]

ENOUGH_TIPS = 6.0
"""Width of a bed from which on there is no advice [tip diameters]: that of the shipped case."""
ENOUGH_ACROSS = 10.0
"""Grains across a tip from which on there is no advice [1]."""
LEAST_BELOW = 2.0
"""Distance of the deepest point from the floor from which on there is no advice [tip diameters]."""
COARSE = ((3.0, 2.2), (4.0, 1.77), (5.0, 1.51), (8.0, 1.17), (10.0, 1.0))
"""Grains across a tip -> K over that of ten across [1] (see the module)."""


def times_as_long(size: Sequence[float], grain: float, *, wanted: Sequence[float], wanted_grain: float) -> float:
    """Factor on the time of runs in a bed of another size [m] and of other grains [m]."""
    return math.prod(wanted) / math.prod(size) * (grain / wanted_grain) ** 4


def costs(times: float, seconds: float | None = None) -> str:
    """The cost of a change that takes `times` as long, in words; `seconds`: time of the run without it, if known."""
    many = f"{float(f'{times:.2g}'):,g} times the time"
    return many if seconds is None else f"{many}, about {_clock(times * seconds)} in place of {_clock(seconds)}"


def resolution_advice(
    *,
    tip: float,
    grain: float,
    size: Sequence[float],
    depth: float,
    seconds: float | None = None,
    cohesive: bool = False,
    flat: bool = False,
) -> Iterator[str]:
    """One sentence for each reason why a bed is too small or too coarse; none for a good bed. Lengths in m.

    `tip`: its diameter; `size`: both widths and the depth of the bed; `depth`: how deep the tip is driven; `seconds`:
    expected time of the runs; `cohesive`: whether the grains stick, for which `COARSE` does not hold; `flat`: whether
    the tip is a plate, for which it was not seen (docs/notes/validation.md, plates-in-sand).
    """
    width, height = min(size[:2]), size[2]
    if width < ENOUGH_TIPS * tip * (1 - 1e-9):
        wide = ENOUGH_TIPS * tip
        wanted = (max(size[0], wide), max(size[1], wide), height)
        cost = costs(times_as_long(size, grain, wanted=wanted, wanted_grain=grain), seconds)
        yield say("narrow_bed", tips=width / tip, wide=wide, enough=ENOUGH_TIPS, cost=cost)
    if height - depth < LEAST_BELOW * tip * (1 - 1e-9):
        high = depth + LEAST_BELOW * tip
        cost = costs(times_as_long(size, grain, wanted=(*size[:2], high), wanted_grain=grain), seconds)
        yield say("shallow_bed", below=(height - depth) / tip, high=high, cost=cost)
    if tip / grain < ENOUGH_ACROSS * (1 - 1e-3):
        found, finer = tip / grain, tip / ENOUGH_ACROSS
        cost = costs(times_as_long(size, grain, wanted=size, wanted_grain=finer), seconds)
        counts, ratios = zip(*COARSE, strict=True)
        told = {"across": found, "finer": finer, "enough": ENOUGH_ACROSS, "cost": cost}
        of_ball = say("of_ball_not_plate" if flat else "of_ball")
        percent = 100 * (float(np.interp(found, counts, ratios)) - 1)
        told |= {} if cohesive else {"percent": percent, "of_ball": of_ball}
        yield say("coarse_sticky_bed" if cohesive else "coarse_bed", **told)


def _clock(seconds: float) -> str:
    """A time with two digits in a suitable unit."""
    for unit, size in (("days", 86400.0), ("h", 3600.0), ("min", 60.0)):
        if seconds >= 1.5 * size:
            return f"{float(f'{seconds / size:.2g}'):g} {unit}"
    return f"{float(f'{seconds:.2g}'):g} s"
