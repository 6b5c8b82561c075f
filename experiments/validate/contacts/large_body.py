"""A small grain on large bodies: does it roll off the neck between two of them, at any ratio of sizes?

Vyas, Ottino, Lueptow & Umbanhowar 2025 (Comput. Phys. Commun. 310, 109524): with static friction and a ratio above
about 3, velocity Verlet may hold such a grain where it should fall. The history of the contact is summed with the
velocity of half a step before and turned with the normal of the step's end.

A sphere of radius r on two of radius R that touch lies at rho = sqrt((R + r)^2 - R^2) from their line of centres. Let
it roll about that line without slipping at either contact: its spin is v / (r sin b), sin b = rho / (R + r), so
    phi'' = g sin(phi) / (rho (1 + 2/5 / sin^2 b)),  phi from the top.
Both contacts hold as long as what friction must pass on is below mu times what presses them.
"""

import math
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from dem import Ball, Bed, Material
from experiments.validate.base.case import Comparison, Curve, Outcome, Plot, Tell, tracked
from experiments.validate.base.spheres import mass_of, plane_modulus

__all__ = ["CASES", "RATIOS", "roll_off", "rolled"]

SMALL = 0.001  # r [m]
RATIOS = (1, 3, 10, 30)
START, END = math.radians(1.0), math.radians(10.0)
GRAVITY, DENSITY, YOUNG, POISSON, FRICTION = 9.81, 2600.0, 1e7, 0.25, 0.5
SAMPLES = 12


def _geometry(ratio: float) -> tuple[float, float]:
    """rho [m] and 1 + 2/5 / sin^2 b [1]."""
    large = ratio * SMALL
    rho = math.sqrt((large + SMALL) ** 2 - large**2)
    return rho, 1 + 0.4 * ((large + SMALL) / rho) ** 2


def rolled(ratio: float, end: float, **options: Any) -> Any:
    """phi and its rate from rest at ``START`` until ``end`` [s]: what `solve_ivp` gives for these options."""
    rho, factor = _geometry(ratio)

    def rates(_: float, y: np.ndarray) -> list[float]:
        return [y[1], GRAVITY * math.sin(y[0]) / (rho * factor)]

    return solve_ivp(rates, (0, end), [START, 0.0], rtol=1e-10, **options)


def _time_to(ratio: float, angle: float) -> float:
    """When it has come to an angle [s]."""
    reached = lambda _, y: y[0] - angle  # noqa: E731
    reached.terminal = True  # type: ignore[attr-defined]
    return float(rolled(ratio, 10.0, events=reached).t_events[0][0])


def roll_off(ratio: float) -> tuple[np.ndarray, np.ndarray, float]:
    """Times [s], phi [rad] of a small grain between two fixed balls ``ratio`` times larger, spin over v / (r sin b)."""
    large = ratio * SMALL
    rho, _ = _geometry(ratio)
    width = max(0.02, 5 * large)
    middle = np.array([width / 2, width / 2, 2 * large + 2 * SMALL])
    # The overlap at which both contacts carry the weight: 2 F sin b = m g cos(START).
    sine = rho / (large + SMALL)
    k = 4 / 3 * plane_modulus(YOUNG, POISSON) * math.sqrt(SMALL * large / (SMALL + large))
    overlap = (mass_of(DENSITY, SMALL) * GRAVITY * math.cos(START) / (2 * sine) / k) ** (2 / 3)
    reach = math.sqrt((large + SMALL - overlap) ** 2 - large**2)
    at = middle + reach * np.array([0.0, math.sin(START), math.cos(START)])
    bed = Bed.from_grains(
        Material("small", DENSITY, YOUNG, POISSON, FRICTION, 0.5), positions=at[None, :], radii=np.array([SMALL]),
        size=(width, width, 0.01), height=4 * large + 8 * SMALL, gravity=GRAVITY, floor=False,
    )  # fmt: skip
    for side in (-1.0, 1.0):
        bed.add_body([Ball(radius=large)], position=tuple(middle + [side * large, 0.0, 0.0]))
    steps = round(_time_to(ratio, END) / bed.time_step / SAMPLES)
    times, angles = [], []
    for _ in range(SAMPLES):
        bed.advance(steps)
        grains = bed.grains()
        d = grains.position[0] - middle
        times.append(bed.time)
        angles.append(math.atan2(d[1], d[2]))
    speed = math.hypot(*grains.velocity[0, 1:])
    turn = abs(grains.spin[0, 0]) * SMALL * sine / speed if speed > 0 else 0.0
    return np.array(times), np.array(angles), float(turn)


def _neck(tell: Tell) -> Outcome:
    rows, curves = [], []
    for ratio in tracked(RATIOS, tell):
        times, angles, turn = roll_off(ratio)
        closed = rolled(ratio, times[-1], t_eval=times, atol=1e-12).y[0]
        scale = math.degrees(1.0)
        way = scale * (closed[-1] - START), scale * (angles[-1] - START)
        rows.append(Comparison(f"way rolled, ratio {ratio}", "deg", *way, 0.02))
        rows.append(Comparison(f"spin r sin b over speed, ratio {ratio}", "1", 1.0, turn, 0.01))
        part = times / times[-1]
        curves.append(Curve(f"closed form, {ratio}", part, scale * closed, False))
        curves.append(Curve(f"bed, {ratio}", part, scale * angles))
    title = "A small grain rolls off the neck of two balls"
    return Outcome(rows, [Plot(title, "time over the whole [1]", "angle from the top [deg]", curves)])


CASES = {"large-neck": _neck}
