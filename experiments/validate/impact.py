"""Katsuragi & Durian's drops: one law of force for all heights, m a = m g - m v^2 / d1 - k z.

In the energy v^2 the law is linear in depth, d(v^2)/dz = 2 g - 2 v^2 / d1 - 2 (k/m) z, so v^2 over z is known in closed
form (Clark & Behringer 2013, EPL 101, 64001) and d1, k/m are fitted to all drops jointly.

The experiment's beads are 85 to the ball's diameter, ours 5 and 7. Grains' centres keep half a bead clear of the ball,
and drag goes with the diameter D + d that they see (Kumar et al. 2017, arXiv 1712.09057): the ball here is so much
smaller that D + d is the experiment's, its mass is kept. What is left of the grains' size shows between the two.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import least_squares

from .case import Case, Comparison, Curve, Outcome, Plot
from .drops import BEADS, drop, prepared
from .parts import part

__all__ = ["BALL", "CASES", "Fall", "K_OVER_M", "MASS", "energy", "fit_law"]

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
STRUCK = 0.08  # overlap over diameter that is let pass where the ball strikes; the bed itself stays below 0.05
LONGEST = 0.4  # [s]
POINTS = 50
WHY = (
    "over its first 8 mm the ball is slowed by up to 70 m/s2 at 1.8 m/s, twice what the law says, then by some 12 "
    "m/s2, nearly free of speed and depth, and it stops 22 to 29 % above where the law has it. How deep it goes does "
    "follow the law: of the stopping depths alone d1 is 7.2 cm and k/m 1630 1/s2, and they are met within 0.1 %; it "
    "is the early force that makes d1 small, and a force at the surface left free does not mend it (2.5 cm). It is "
    "not the box: in a bed of 5.2 x 5.2 x 3.0 (18,872 grains, 6 across) it stopped no deeper. Nor is it that grains "
    "are soft: of ten times the modulus (overlaps of 2.4 % of a diameter at most, where they are 6.7 %; same seed and "
    "places) d1 is 2.1 +- 0.5 cm, k/m 1190 +- 130 1/s2, and it stops 0 to 5 % higher. Friction is part of it: without "
    "rolling friction d1 is 1.7 cm, k/m 849 1/s2 and it stops 12 to 17 % above the law's depths, with a sliding "
    "friction of 0.25 2.8 cm, 1059 1/s2 and 9 to 16 %, and the time to stop is met (6 drops each, 2026-11-22). Of the "
    "rest the grains' size is some and not all, see katsuragi-durian-fine"
)
WHY_FINE = (
    "from 5 to 7 grains across d1 goes from 1.98 +- 0.24 to 2.50 +- 0.21 cm and the ball stops 2 to 4 % deeper, still "
    "20 to 26 % above the law's depths (of which alone d1 is 7.3 cm and k/m 1560 1/s2). With 10 grains across (19,370 "
    "grains, a bed of 2.6 x 2.6 x 2.0, six drops, 2026-11-22) d1 is 2.89 +- 0.22 cm, k/m 1190 +- 70 1/s2, and it "
    "stops at 17.6, 26.0 and 40.8 mm, 13 to 21 % above the law's depths. Of the three sizes d1 is a straight line in "
    "d / (D + d), which at the beads' 1 / 85 comes to 3.8 cm: less than half of what is wanted, and what lacks then "
    "was not found. Beads are 85 across. Friction and rolling friction are chosen for their tan 24 degrees, 0.445, and "
    "sheared samples of these grains have 0.46 (case rft); less of them helps (katsuragi-durian)"
)


@dataclass(frozen=True)
class Fall:
    """One drop, ``across`` D + d over d; the rest as `drop` has it."""

    across: int
    seed: int
    at: tuple[float, float]
    speed: float

    def run(self) -> dict[str, np.ndarray]:
        """What `drop` gives, kept."""
        grain = CLEAR / self.across
        radius = 0.5 * (CLEAR - grain)
        size = tuple(share * CLEAR for share in BOX)

        def compute() -> dict[str, np.ndarray]:
            bed = prepared(grain=grain, size=size, gravity=GRAVITY, seed=self.seed)
            bed.overlap_limit = STRUCK
            found = drop(
                bed, radius=radius, density=MASS / (4 / 3 * math.pi * radius**3), speed=self.speed,
                at=(self.at[0] * size[0], self.at[1] * size[1]), longest=LONGEST,
            )  # fmt: skip
            return found | {"packing": np.array(bed.packing_fraction), "count": np.array(bed.grain_count)}

        told = {name: getattr(self, name) for name in self.__dataclass_fields__}
        return part("impact", told | {"size": size, "mass": MASS, "longest": LONGEST}, compute)


def energy(depth: np.ndarray, *, start: float, d1: float, k_over_m: float, gravity: float = GRAVITY) -> np.ndarray:
    """v^2 [m2/s2] at depths [m] by the law, from ``start`` at depth 0."""
    steady = d1 * gravity + 0.5 * k_over_m * d1**2
    return (start - steady) * np.exp(-2 * np.asarray(depth) / d1) + steady - k_over_m * d1 * np.asarray(depth)


def fit_law(falls: Sequence[dict[str, np.ndarray]]) -> tuple[float, float]:
    """d1 [m] and k/m [1/s2] that fit v^2 over depth of all drops, each weighted by its largest v^2."""
    sampled = []
    for fall in falls:
        depth, squared = fall["depth"], fall["velocity"] ** 2
        grid = np.linspace(0.0, 0.98 * depth[-1], POINTS)
        sampled.append((grid, np.interp(grid, depth, squared)))

    def off(logs: np.ndarray) -> np.ndarray:
        d1, k_over_m = np.exp(logs)
        parts = [(energy(z, start=u[0], d1=d1, k_over_m=k_over_m) - u) / u.max() for z, u in sampled]
        return np.concatenate(parts)

    found = least_squares(off, np.log([D1, K_OVER_M]))
    return float(np.exp(found.x[0])), float(np.exp(found.x[1]))


def published(speed: float) -> tuple[float, float]:
    """Depth [m] and time [s] at which the published law stops the ball."""
    stops = lambda _, y: y[1]  # noqa: E731
    stops.terminal, stops.direction = True, -1  # type: ignore[attr-defined]
    found = solve_ivp(
        lambda _, y: [y[1], GRAVITY - y[1] ** 2 / D1 - K_OVER_M * y[0]],
        (0, LONGEST),
        [0.0, speed],
        events=stops,
        rtol=1e-8,
    )
    return float(found.y_events[0][0][0]), float(found.t_events[0][0])


def _scatter(falls: Sequence[dict[str, np.ndarray]]) -> tuple[float, float]:
    """Standard errors of d1 and k/m, by leaving out one drop after the other."""
    left = np.array([fit_law([*falls[:k], *falls[k + 1 :]]) for k in range(len(falls))])
    count = len(falls)
    errors = np.sqrt((count - 1) / count * ((left - left.mean(axis=0)) ** 2).sum(axis=0))
    return float(errors[0]), float(errors[1])


def _drops(tell: Callable[[float], None], fineness: tuple[str, int, Any]) -> Outcome:
    name, across, beds = fineness
    falls = [Fall(across, seed, at, speed) for seed, places in beds for at in places for speed in SPEEDS]
    found = []
    for fall in falls:
        found.append(fall.run())
        tell(len(found) / len(falls))
    d1, k_over_m = fit_law(found)
    errors = _scatter(found)

    def mean(key: str) -> dict[float, float]:
        """Of the last values, by speed."""
        pairs = list(zip(falls, found, strict=True))
        return {v: float(np.mean([run[key][-1] for fall, run in pairs if fall.speed == v])) for v in SPEEDS}

    stops, deep = mean("time"), mean("depth")
    first, last = SPEEDS[0], SPEEDS[-1]
    rows = [
        Comparison(f"d1, {name} grains across", "cm", 100 * D1, 100 * d1, D1_BAND),
        Comparison(f"k/m, {name} grains across", "1/s2", K_OVER_M, k_over_m, K_BAND),
        Comparison(f"time to stop, {last:g} over {first:g} m/s", "1", published(last)[1] / published(first)[1],
                   stops[last] / stops[first], TIME_BAND),
    ]  # fmt: skip
    curves = [Curve(f"bed, {name} across", SPEEDS, [1e3 * deep[v] for v in SPEEDS])]
    stood = ", ".join(f"{1e3 * deep[v]:.1f} ({1e3 * published(v)[0]:.1f}) at {v:g} m/s" for v in SPEEDS)
    many = f"{len(found)} drops in {len(beds)} bed{'s' if len(beds) > 1 else ''}"
    words = (
        f"{int(found[0]['count'])} grains a bed, packing {float(found[0]['packing']):.3f}, {many}: d1 {100 * d1:.2f} "
        f"+- {100 * errors[0]:.2f} cm, k/m {k_over_m:.0f} +- {errors[1]:.0f} 1/s2. It stops at depths [mm] (the "
        f"published law's in brackets) of {stood}"
    )
    speeds = np.linspace(SPEEDS[0], SPEEDS[-1], 40)
    curves.insert(0, Curve("published law", speeds, [1e3 * published(v)[0] for v in speeds], False))
    at = ", ".join(f"{speed:g}" for speed in SPEEDS)
    box = " x ".join(f"{share:g}" for share in BOX)
    remark = (
        f"{words}. Errors: one drop left out after the other. Drops at {at} m/s; beads of "
        f"{BEADS.density:g} kg/m3 as rained, in a bed of {box} times D + d, periodic sideways; the published ones lie "
        "at 0.59 in a container of some seven D."
    )
    return Outcome(rows, [Plot("Depth at which the ball stops", "speed [m/s]", "depth [mm]", curves)], [remark])


def _coarse(tell: Callable[[float], None]) -> Outcome:
    return _drops(tell, COARSE)


def _fine(tell: Callable[[float], None]) -> Outcome:
    return _drops(tell, FINE)


CASES = [
    Case(
        name,
        "Bodies in beds",
        f"Drops of a 25.4 mm steel ball, {across} grains across, one law for three speeds",
        "m a = m g - m v^2 / d1 - k z with d1 = 8.7 cm, k/m = 1040 1/s2",
        "Katsuragi & Durian 2007, Nature Physics 3:420, figures from a second source; the bands are ours",
        compute,
        slow=True,
        seconds=seconds,
        reason=reason,
    )
    for name, across, compute, seconds, reason in (
        ("katsuragi-durian", COARSE[0], _coarse, 100, WHY),
        ("katsuragi-durian-fine", FINE[0], _fine, 600, WHY_FINE),
    )
]
