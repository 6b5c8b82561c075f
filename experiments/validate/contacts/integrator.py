"""The order of the integrator: collisions against the equations of motion integrated by another method."""

import math
from dataclasses import replace
from functools import partial

import numpy as np
from scipy.integrate import solve_ivp

from dem import Bed, Grains, Material
from dem.contact.law import effective_moduli
from experiments.validate.base.case import Comparison, Curve, Outcome, Plot, Tell, near_zero, tracked
from experiments.validate.base.spheres import RADIUS, SIXTEEN, contact_of, mass_of, row_of_grains

from . import say

__all__ = ["CASES", "errors_of_pair", "oblique_pair"]

COUNTS = (50, 100, 200, 400)  # steps in seven tenths of a contact
PAIR = Material("pair", 2600.0, 1e8, 0.25, 50.0, 1.0, tangential="displacement")
MASS, INERTIA = mass_of(PAIR.density, RADIUS), 0.4 * mass_of(PAIR.density, RADIUS) * RADIUS * RADIUS
STAR, SHEAR = effective_moduli(PAIR.young, PAIR.poisson, PAIR.young, PAIR.poisson)
CONTACT = contact_of(PAIR, RADIUS, 1.0, pair=True)[2]
END = 0.7 * CONTACT
QUANTITIES = ("velocity", "position over contact time", "spin times radius")


def _push(d: np.ndarray, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Force on the first of two like grains, elastic and with no slip, and torque on each: apart by d, the spring u."""
    length = float(np.linalg.norm(d))
    n, overlap = d / length, max(0.0, 2 * RADIUS - length)
    a = math.sqrt(RADIUS / 2 * overlap)
    f = 4 / 3 * STAR * a * overlap * n - 8 * SHEAR * a * u
    return f, (RADIUS - overlap / 2) * np.cross(f, n)


def _reference(y0: np.ndarray, *, rescaled: bool = False) -> np.ndarray:
    """The two grains at ``END``: (x, v, w of both, u), shape [7, 3]; independent of the engine.

    ``rescaled``: the spring turns about the normal as well, and as the overlap d grows a u stays, a ~ sqrt(d).
    """

    def rates(_, y):
        x1, v1, w1, x2, v2, w2, u = y.reshape(7, 3)
        d = x1 - x2
        length = float(np.linalg.norm(d))
        n, arm = d / length, RADIUS - max(0.0, 2 * RADIUS - length) / 2
        v = v1 - v2 - np.cross(arm * (w1 + w2), n)
        v_t = v - (v @ n) * n
        turn = ((v1 - v2) - ((v1 - v2) @ n) * n) / length
        f, t = _push(d, u)
        slip = v_t - (u @ turn) * n
        if rescaled:
            slip += 0.5 * ((w1 + w2) @ n) * np.cross(n, u)
            overlap, closing = 2 * RADIUS - length, -(v1 - v2) @ n
            slip -= 0.5 * closing / overlap * u if overlap > 0 and closing > 0 else 0.0
        return np.concatenate([v1, f / MASS, t / INERTIA, v2, -f / MASS, t / INERTIA, slip])

    found = solve_ivp(rates, (0, END), y0, t_eval=[END], method="DOP853", rtol=1e-11, atol=1e-14)
    return found.y[:, -1].reshape(7, 3)


def staggered_pair(y0: np.ndarray, steps: int, *, middle: bool) -> np.ndarray:
    """A leapfrog for ``_reference``'s two grains, in numpy: (x, v, w of both), shape [6, 3].

    ``y0``: as ``_reference`` has it. ``middle``: whether the slip of a step is that across the normal at its middle,
    where the velocity is; else at its end. The bed takes the middle (to second order in the step).
    """
    dt = END / steps
    x1, v1, w1, x2, v2, w2, u = y0.reshape(7, 3).copy()
    f, t = np.zeros(3), np.zeros(3)
    for _ in range(steps):
        before = x1 - x2
        v1, v2, w1, w2 = v1 + dt * f / MASS, v2 - dt * f / MASS, w1 + dt * t / INERTIA, w2 + dt * t / INERTIA
        x1, x2 = x1 + dt * v1, x2 + dt * v2
        d = x1 - x2
        n = d / float(np.linalg.norm(d))
        at = before + d if middle else 2 * d  # twice the distance where the slip is taken
        length = float(np.linalg.norm(at))
        across, arm = at / length, RADIUS - 0.5 * max(0.0, 2 * RADIUS - 0.5 * length)
        v = v1 - v2 - np.cross(arm * (w1 + w2), across)
        u = u + dt * (v - (v @ across) * across)
        u = u - (u @ n) * n
        f, t = _push(d, u)
    half = 0.5 * dt
    return np.array([
        x1, v1 + half * f / MASS, w1 + half * t / INERTIA, x2, v2 - half * f / MASS, w2 + half * t / INERTIA,
    ])  # fmt: skip


def _orders_of_the_scheme() -> tuple[float, float]:
    """Order of the position's error over the two finest of ``COUNTS``, with the normal of the step's end and middle."""
    y0 = _unknowns(oblique_pair(END / COUNTS[0], steps=0)[0])
    exact = _reference(y0)

    def off(steps: int, middle: bool) -> float:
        return np.abs(staggered_pair(y0, steps, middle=middle)[[0, 3]] - exact[[0, 3]]).max()

    errors = np.array([[off(steps, at) for at in (False, True)] for steps in COUNTS[-2:]])
    end, middle = np.log2(errors[0] / errors[1])
    return float(end), float(middle)


def oblique_pair(step: float, *, steps: int, along: bool = False, rescaled: bool = False) -> tuple[Grains, Grains, int]:
    """Two grains meet obliquely, spinning, among others that are far away; before, after, and how many lists were made.

    ``step``: [s]. ``along``: without spins and slip.
    """
    positions, radii, options = row_of_grains(floor=False)
    positions[:, 2] += 0.02
    n = np.array([0.8, 0.36, 0.48])
    positions[5] = positions[0] + 2 * RADIUS * n
    velocities, spins = np.zeros((SIXTEEN, 3)), np.zeros((SIXTEEN, 3))
    velocities[5] = -1.0 * n
    if not along:
        velocities[5] += 0.4 * np.array([-0.6, 0.48, 0.64])
        spins[0], spins[5] = (40.0, -30.0, 25.0), (-10.0, 60.0, 5.0)
    pair = replace(PAIR, tangential="rescaled") if rescaled else PAIR
    bed = Bed.from_grains(
        pair, positions=positions, radii=radii, velocities=velocities, spins=spins, time_step=step, **options,
    )  # fmt: skip
    start = bed.grains()
    bed.advance(steps)
    return start, bed.grains(), bed.list_count


def _unknowns(grains: Grains) -> np.ndarray:
    """Position, velocity and spin of the two grains, and the spring of their contact, not yet stretched."""
    arrays = (grains.position, grains.velocity, grains.spin)
    return np.concatenate([array[i] for i in (0, 5) for array in arrays] + [np.zeros(3)])


def errors_of_pair(along: bool, *, rescaled: bool = False) -> tuple[np.ndarray, np.ndarray]:
    """Errors of velocity, position over contact time, spin times radius [m/s] at each of ``COUNTS``; their orders."""
    errors = []
    for count in COUNTS:
        start, after, _ = oblique_pair(END / count, steps=count, along=along, rescaled=rescaled)
        if count == COUNTS[0]:
            y = _reference(_unknowns(start), rescaled=rescaled)
        off = after.velocity[[0, 5]] - y[[1, 4]], after.position[[0, 5]] - y[[0, 3]], after.spin[[0, 5]] - y[[2, 5]]
        velocity, position, spin = (np.abs(one).max() for one in off)
        errors.append([velocity, position / CONTACT, spin * RADIUS])
    found = np.array(errors)[:, : 2 if along else 3]
    return found, -np.polyfit(np.log(COUNTS), np.log(found), 1)[0]


def _order(along: bool, tell: Tell, *, rescaled: bool = False) -> Outcome:
    errors, slopes = errors_of_pair(along, rescaled=rescaled)
    band = 0.1 if along else 0.25
    rows = [
        Comparison(f"order of the {name}'s error", "1", 2.0, slope, band, False)
        for name, slope in zip(QUANTITIES, slopes, strict=False)
    ]
    coarsest = 2e-4 if along else 3e-4
    rows.append(near_zero("largest error at 50 steps", errors[0].max(), coarsest, "m/s"))
    rows.append(near_zero("largest error at 400 steps", errors[-1].max(), 6e-6, "m/s"))
    counts = np.array(COUNTS)
    curves = [Curve("order 2", counts, errors[0].max() * (counts[0] / counts) ** 2.0, False)]
    curves += [Curve(name, counts, column) for name, column in zip(QUANTITIES, errors.T, strict=False)]
    remarks = []
    if not (along or rescaled):
        end, middle = _orders_of_the_scheme()
        remarks.append(say("scheme_order", middle=middle, end=end))
    plot = Plot("Error at seven tenths of a contact", "steps", "error [m/s]", curves, log="xy")
    return Outcome(rows, [plot], remarks)


def _bouncing(tell: Tell) -> Outcome:
    """An elastic grain in free flight and contact: the time of its second landing, from closed forms alone."""
    speed, stuff = 1.0, replace(PAIR, friction=0.0)
    time = contact_of(stuff, RADIUS, speed)[2]
    errors, counts = [], np.array([16, 32, 64, 128, 256])
    for count in tracked(counts, tell):
        positions, radii, options = row_of_grains()
        phase = (np.arange(SIXTEEN) + 0.5) / SIXTEEN  # where in a step the contact begins
        step = time / count
        positions[:, 2] += phase * step * speed
        bed = Bed.from_grains(
            stuff, positions=positions, radii=radii, velocities=np.tile([0.0, 0.0, -speed], (SIXTEEN, 1)),
            time_step=step, max_overlap=0.2, **options,
        )  # fmt: skip
        bed.advance(round(1.5 * count))
        grains = bed.grains()
        errors.append(float(np.abs(grains.velocity[:, 2] / speed - 1).max()))
    order = -np.polyfit(np.log(counts), np.log(errors), 1)[0]
    curves = [
        Curve("order 2.5", counts, errors[0] * (counts[0] / counts) ** 2.5, False),
        Curve("worst of sixteen phases", counts, errors),
    ]
    rows = [
        Comparison("order of the rebound speed's error", "1", 2.5, order, 0.2, False),
        near_zero("largest error of the rebound at 16 steps a contact", errors[0], 2e-3),
    ]
    return Outcome(rows, [Plot("Error of an elastic rebound", "steps in a contact", "error [1]", curves, log="xy")])


CASES = {
    "order-head-on": partial(_order, True),
    "order-oblique": partial(_order, False),
    "order-rescaled": partial(_order, False, rescaled=True),
    "order-rebound": _bouncing,
}
