"""Katsuragi & Durian's drops: one law of force for all heights, m a = m g - m v^2 / d1 - k z.

In the energy v^2 the law is linear in depth, d(v^2)/dz = 2 g - 2 v^2 / d1 - 2 (k/m) z, so v^2 over z is known in closed
form (Clark & Behringer 2013, EPL 101, 64001) and d1, k/m are fitted to all drops jointly.

The experiment's beads are 85 to the ball's diameter, ours 5 and 7. Grains' centres keep half a bead clear of the ball,
and drag goes with the diameter D + d that they see (Kumar et al. 2017, arXiv 1712.09057): the ball here is so much
smaller that D + d is the experiment's, its mass is kept. What is left of the grains' size shows between the two.
"""

import math
from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import least_squares

from experiments.validate.base.case import Comparison, Curve, Outcome, Plot, Tell, tracked
from experiments.validate.base.drops import BEADS, Drop

from . import say

__all__ = ["BALL", "CASES", "K_OVER_M", "MASS", "energy", "fit_law"]

BALL, BEAD, MASS, GRAVITY = 0.0254, 0.0003, 0.0692, 9.81  # diameters [m], [kg], [m/s2]
D1, K_OVER_M = 0.087, 1040.0  # published [m], [1/s2]
CLEAR = BALL + BEAD
SPEEDS = (0.4, 0.9, 1.8)  # on touching [m/s]
BOX = (3.2, 3.2, 2.15)  # of the bed, over D + d
PLACES = ((0.25, 0.25), (0.75, 0.75))
COARSE = ("5", 6, ((1, PLACES),))
FINE = ("7", 8, ((2, PLACES), (3, PLACES)))
"""Grains across the ball; D + d over d; seeds of the beds, and places in each."""
D1_BAND, K_BAND, TIME_BAND = 0.15, 0.25, 0.15
LONGEST = 0.4  # [s]
POINTS = 50


def fall(across: int, seed: int, at: tuple[float, float], speed: float) -> Drop:
    """One drop; ``across``: D + d over d."""
    grain = CLEAR / across
    radius = 0.5 * (CLEAR - grain)
    density = MASS / (4 / 3 * math.pi * radius**3)
    size = tuple(share * CLEAR for share in BOX)
    return Drop(grain, 2 * radius, density, size, GRAVITY, seed, at, speed, LONGEST)  # type: ignore[arg-type]


def energy(depth: np.ndarray, *, start: float, d1: float, k_over_m: float, gravity: float = GRAVITY) -> np.ndarray:
    """v^2 [m2/s2] at depths [m] by the law, from ``start`` at depth 0."""
    steady = d1 * gravity + 0.5 * k_over_m * d1**2
    return (start - steady) * np.exp(-2 * np.asarray(depth) / d1) + steady - k_over_m * d1 * np.asarray(depth)


def fit_law(falls: Sequence[dict[str, np.ndarray]]) -> tuple[float, float]:
    """d1 [m] and k/m [1/s2] that fit v^2 over depth of all drops, each weighted by its largest v^2."""
    grids = [np.linspace(0.0, 0.98 * fall["depth"][-1], POINTS) for fall in falls]
    pairs = zip(grids, falls, strict=True)
    sampled = [(grid, np.interp(grid, fall["depth"], fall["velocity"] ** 2)) for grid, fall in pairs]

    def off(logs: np.ndarray) -> np.ndarray:
        d1, k_over_m = np.exp(logs)
        parts = [(energy(z, start=u[0], d1=d1, k_over_m=k_over_m) - u) / u.max() for z, u in sampled]
        return np.concatenate(parts)

    d1, k_over_m = np.exp(least_squares(off, np.log([D1, K_OVER_M])).x)
    return float(d1), float(k_over_m)


def published(speed: float) -> tuple[float, float]:
    """Depth [m] and time [s] at which the published law stops the ball."""
    stops = lambda _, y: y[1]  # noqa: E731
    stops.terminal, stops.direction = True, -1  # type: ignore[attr-defined]
    found = solve_ivp(
        lambda _, y: [y[1], GRAVITY - y[1] ** 2 / D1 - K_OVER_M * y[0]], (0, LONGEST), [0.0, speed], events=stops,
        rtol=1e-8,
    )  # fmt: skip
    return float(found.y_events[0][0][0]), float(found.t_events[0][0])


def _scatter(falls: Sequence[dict[str, np.ndarray]]) -> tuple[float, float]:
    """Standard errors of d1 and k/m, by leaving out one drop after the other."""
    count = len(falls)
    left = np.array([fit_law([*falls[:k], *falls[k + 1 :]]) for k in range(count)])
    d1, k_over_m = np.sqrt((count - 1) / count * ((left - left.mean(axis=0)) ** 2).sum(axis=0)).tolist()
    return d1, k_over_m


def _drops(fineness: tuple[str, int, Any], tell: Tell) -> Outcome:
    name, across, beds = fineness
    falls = [fall(across, seed, at, speed) for seed, places in beds for at in places for speed in SPEEDS]
    found = [fall.run() for fall in tracked(falls, tell)]
    d1, k_over_m = fit_law(found)
    errors = _scatter(found)

    def mean(key: str) -> dict[float, float]:
        """Of the last values, by speed."""
        ends = [(fall.speed, run[key][-1]) for fall, run in zip(falls, found, strict=True)]
        return {v: float(np.mean([end for speed, end in ends if speed == v])) for v in SPEEDS}

    stops, deep = mean("time"), mean("depth")
    first, last = SPEEDS[0], SPEEDS[-1]
    longer = published(last)[1] / published(first)[1], stops[last] / stops[first]
    rows = [
        Comparison(f"d1, {name} grains across", "cm", 100 * D1, 100 * d1, D1_BAND),
        Comparison(f"k/m, {name} grains across", "1/s2", K_OVER_M, k_over_m, K_BAND),
        Comparison(f"time to stop, {last:g} over {first:g} m/s", "1", *longer, TIME_BAND),
    ]
    speeds = np.linspace(first, last, 40)
    curves = [
        Curve("published law", speeds, [1e3 * published(v)[0] for v in speeds], False),
        Curve(f"bed, {name} across", SPEEDS, [1e3 * deep[v] for v in SPEEDS]),
    ]
    stood = ", ".join(f"{1e3 * deep[v]:.1f} ({1e3 * published(v)[0]:.1f}) at {v:g} m/s" for v in SPEEDS)
    many = f"{len(found)} drops in {len(beds)} bed{'s' if len(beds) > 1 else ''}"
    words = say(
        "drops", count=int(found[0]["count"]), packing=float(found[0]["packing"]), many=many, d1=100 * d1,
        d1_error=100 * errors[0], k_over_m=k_over_m, k_error=errors[1], stood=stood,
    )  # fmt: skip
    at, box = ", ".join(f"{speed:g}" for speed in SPEEDS), " x ".join(f"{share:g}" for share in BOX)
    remark = say("of_drops", words=words, at=at, beads=BEADS, box=box)
    return Outcome(rows, [Plot("Depth at which the ball stops", "speed [m/s]", "depth [mm]", curves)], [remark])


CASES = {"katsuragi-durian": partial(_drops, COARSE), "katsuragi-durian-fine": partial(_drops, FINE)}
