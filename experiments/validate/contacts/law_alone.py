"""Collisions by a contact law alone, written again in numpy with fine steps.

Mass, speed along the normal, radius and Hertz's 4/3 E* sqrt(R*) are 1, so that S_n = 3/2 sqrt(x), x the overlap.

Microslip (`tangential_restitution`): Maw, Barber & Fawcett 1976 (Wear 38:101). The tangential traction is a sum of
q_i sqrt(a_i^2 - r^2) over circles of radius a_i, each of which moves the surface, averaged over the angle, by

    u = c pi / 2 (2 a_i^2 - r^2) inside, c ((2 a_i^2 - r^2) asin(a_i / r) + a_i sqrt(r^2 - a_i^2)) outside,

c = (2 - nu) / 8 G (Johnson 1985, Contact Mechanics, section 3.9). Each ring either sticks, and moves as the sphere
does, or slips at mu times Hertz's pressure. One spring for the whole contact, as beds have it, knows no such rings.
"""

import math
from typing import Any

import numpy as np

from dem.contact.law import damping_factor
from experiments.validate.base.spheres import HERTZ_TIME

__all__ = ["one_spring", "sliding_share", "staggered_rebound", "tangential_restitution"]

LARGEST = 1.25**0.4  # overlap in an elastic collision
_LONGEST = 2_000_000


def one_spring(
    slip: Any, *, friction: float, restitution: float, poisson: float, steps: int, law: str = "bed", unit: Any = 0.0,
    lasts: float = 1.6, held: bool = False,
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """A sphere that meets a rigid plane, with one tangential spring and dashpot: speed along it after, and share.

    The share is friction's impulse over mu times the normal one; all of shape [n].

    ``slip``: speed along the plane before. ``law``: where the contact slides. "bed": the bound holds the spring, which
    then has no dashpot (LIGGGHTS as well); "undamped": never a dashpot; "together": spring and dashpot together, and
    the stretch is set back to what their sum allows, as LAMMPS has it. ``unit``: of overlaps over the radius; the arm
    of the spin is shorter by the overlap, as in the bed. ``lasts``: elastic contact times. ``held``: slip is.
    """
    first = np.atleast_1d(np.asarray(slip, dtype=float))
    ratio, c = 2 * (1 - poisson) / (2 - poisson), damping_factor(restitution)  # the ratio is S_t / S_n
    dt = lasts * HERTZ_TIME * LARGEST / steps
    x, rate, along, turning, stretch = 0.0 * first, 1.0 + 0 * first, first.copy(), 0 * first, 0 * first
    rubbed, pushed = 0 * first, 0 * first
    for _ in range(steps):
        x = x + rate * dt
        s_n = 1.5 * np.sqrt(np.maximum(x, 0.0))
        f_n = np.where(x > 0, np.maximum(0.0, s_n * x / 1.5 + c * np.sqrt(s_n) * rate), 0.0)
        arm = 1 - unit * x
        speed = first if held else along - arm * turning
        stretch = stretch + speed * dt
        spring, bound = ratio * s_n * stretch, friction * f_n
        dashpot = 0.0 if law == "undamped" else c * math.sqrt(ratio) * np.sqrt(s_n) * speed
        if law == "together":
            f_t = np.clip(spring + dashpot, -bound, bound)
            left = f_t - dashpot
        else:
            left = np.clip(spring, -bound, bound)
            f_t = np.clip(np.where(np.abs(spring) > bound, left, spring + dashpot), -bound, bound)
        stretch = np.where(s_n > 0, left / np.where(s_n > 0, ratio * s_n, 1.0), stretch)
        rate = rate - f_n * dt
        along = along - f_t * dt
        turning = turning + 2.5 * arm * f_t * dt
        rubbed, pushed = rubbed + f_t * dt, pushed + f_n * dt
    return along, rubbed / (friction * pushed)


def sliding_share(restitution: float, ratio: float, *, spring_alone: bool, steps: int = 15_000) -> float:
    """Friction's impulse over mu times the normal one in a collision that slides throughout, at ``ratio`` v_n.

    Of `one_spring` with nu = 0.33 and mu = 0.4. ``spring_alone``: the bound holds the spring alone, as in the bed.
    """
    law = "bed" if spring_alone else "together"
    numbers = {"friction": 0.4, "restitution": restitution, "poisson": 0.33}
    return float(one_spring(ratio, steps=steps, law=law, lasts=2.0, held=True, **numbers)[1][0])


def staggered_rebound(
    restitution: float, steps: float, phase: np.ndarray, *, synchronised: bool = True, first_touch: bool = True
) -> np.ndarray:
    """A scheme for one collision along the normal, in numpy: what the step alone does to the restitution.

    x' = v, v' = max(0, x^1.5 + c sqrt(1.5 sqrt(x)) x') by leapfrog; the bed's scheme but for round-off where both
    options are on.

    ``steps``: in the elastic contact time. ``phase``: where in a step the contact begins, 0 to 1, shape [n].
    ``synchronised``: the dashpot sees the velocity at the time of the force, else that of half a step before.
    ``first_touch``: in the step in which the contact begins the dashpot is its mean from there to half a step later.
    Returns rebound over approach speed, shape [n].
    """
    dt = HERTZ_TIME * LARGEST / steps
    factor = damping_factor(restitution)
    x, v = -phase * dt, np.ones_like(phase)  # x the overlap, v its rate, half a step behind
    left, inside = np.zeros((2, *phase.shape), dtype=bool)
    for _ in range(_LONGEST):
        touching = x > 0
        fresh = touching & ~inside
        inside |= touching
        left |= inside & ~touching
        if left.all():
            return -v
        depth = np.maximum(x, 0.0)
        c = factor * np.sqrt(1.5 * np.sqrt(depth))
        if first_touch:
            share = np.where(fresh, depth / (dt * np.where(fresh, v, 1.0)), 1.0)
            c = c * np.where(fresh, 0.8 * (share + 0.5) ** 1.25 / share**0.25, 1.0)
        force = depth**1.5 + c * v
        if synchronised:  # F = f(v + a dt / 2), a = -F: linear in F
            force = force / (1 + 0.5 * dt * c)
        v = v - dt * np.where(touching, np.maximum(force, 0.0), 0.0)
        x = x + dt * v
    raise RuntimeError("a collision did not end")


def tangential_restitution(
    angle: float, *, friction: float, restitution: float, poisson: float, rings: int = 40, steps: int = 600
) -> float:
    """e_t of a sphere that meets a rigid plane without spin, ``angle`` from the normal [deg].

    The arm of the spin is r. ``steps``: for the time of an elastic contact.

    Raises RuntimeError where the rings do not come to agree on which of them slip.
    """
    edge = 1.02 * math.sqrt(LARGEST) / rings * np.arange(1, rings + 1)
    middle = edge - 0.5 * edge[0]
    moved, traction = _influence(edge, middle, (2 - poisson) / (3 * (1 - poisson)))  # E* = 3/4 = 2 G / (1 - nu)
    borne = 2 * math.pi / 3 * edge**3
    damping, dt = damping_factor(restitution), HERTZ_TIME * LARGEST / steps
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
