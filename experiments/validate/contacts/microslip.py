"""The oblique impact of an elastic sphere with microslip: Mindlin's tractions on rings of the contact.

Maw, Barber & Fawcett 1976 (Wear 38:101). The tangential traction is a sum of q_i sqrt(a_i^2 - r^2) over circles of
radius a_i, each of which moves the surface, averaged over the angle, by

    u = c pi / 2 (2 a_i^2 - r^2) inside, c ((2 a_i^2 - r^2) asin(a_i / r) + a_i sqrt(r^2 - a_i^2)) outside,

c = (2 - nu) / 8 G (Johnson 1985, Contact Mechanics, section 3.9). Each ring either sticks, and moves as the sphere
does, or slips at mu times Hertz's pressure. One spring for the whole contact, as beds have it, knows no such rings.
"""

import math

import numpy as np

from dem.contact.law import damping_factor
from experiments.validate.base.spheres import HERTZ_TIME

__all__ = ["tangential_restitution"]


def tangential_restitution(
    angle: float, *, friction: float, restitution: float, poisson: float, rings: int = 40, steps: int = 600
) -> float:
    """e_t of a sphere that meets a rigid plane without spin, ``angle`` from the normal [deg].

    Mass, speed along the normal, radius and Hertz's 4/3 E* sqrt(R*) are 1; the arm of the spin is r.
    ``steps``: for the time of an elastic contact.

    Raises RuntimeError where the rings do not come to agree on which of them slip.
    """
    largest = 1.25**0.4
    edge = 1.02 * math.sqrt(largest) / rings * np.arange(1, rings + 1)
    middle = edge - 0.5 * edge[0]
    moved, traction = _influence(edge, middle, (2 - poisson) / (3 * (1 - poisson)))  # E* = 3/4 = 2 G / (1 - nu)
    borne = 2 * math.pi / 3 * edge**3
    damping, dt = damping_factor(restitution), HERTZ_TIME * largest / steps
    shift, slips = np.zeros(rings), np.zeros(rings, dtype=int)
    overlap, rate, along, turning = 0.0, 1.0, math.tan(math.radians(angle)), 0.0
    while (overlap := overlap + rate * dt) > 0:
        active = max(1, int(np.searchsorted(edge, math.sqrt(overlap))))
        bound = friction * 1.5 / math.pi * np.sqrt(np.maximum(overlap - middle[:active] ** 2, 0.0))
        way = (along - turning) * dt
        found, slips[:active] = _settled(
            moved[:active, :active], traction[:active, :active], shift[:active], way, bound, slips[:active]
        )
        slips[active:] = 0
        shift = moved[:, :active] @ found
        pull = float(borne[:active] @ found)
        rate -= max(0.0, overlap**1.5 + damping * math.sqrt(1.5 * math.sqrt(overlap)) * rate) * dt
        along -= pull * dt
        turning += 2.5 * pull * dt
    return along / math.tan(math.radians(angle))


def _influence(edge: np.ndarray, middle: np.ndarray, c: float) -> tuple[np.ndarray, np.ndarray]:
    """What a coefficient of 1 on each circle makes of displacement and traction on each ring, shape [rings, rings]."""
    r, a = middle[:, None], edge[None, :]
    inside = r < a
    short = np.minimum(a / r, 1.0)
    out = (2 * a**2 - r**2) * np.arcsin(short) + a * np.sqrt(np.maximum(r**2 - a**2, 0.0))
    moved = c * np.where(inside, 0.5 * math.pi * (2 * a**2 - r**2), out)
    return moved, np.sqrt(np.maximum(a**2 - r**2, 0.0))


def _settled(
    moved: np.ndarray, traction: np.ndarray, shift: np.ndarray, way: float, bound: np.ndarray, slips: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Coefficients of the circles after ``way``, and which rings slip, and whither (-1, 0 or 1)."""
    for _ in range(60):
        rows = np.where((slips == 0)[:, None], moved, traction)
        found = np.linalg.solve(rows, np.where(slips == 0, shift + way, slips * bound))
        held = traction @ found
        gone = way - (moved @ found - shift)
        new = np.where((slips == 0) & (np.abs(held) > bound * (1 + 1e-9)), np.sign(held).astype(int), slips)
        new = np.where((slips != 0) & (gone * slips < -1e-12 * abs(way)), 0, new)
        if (new == slips).all():
            return found, slips
        slips = new
    raise RuntimeError("rings of the contact do not agree on which of them slip; more steps would do")
