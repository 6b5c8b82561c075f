"""One grain under gravity: falling, lying, sliding, rolling, twisting; closed forms."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from dem import Bed, Grains, Material
from dem.contact.law import damping_factor, effective_moduli
from experiments.validate.base.case import Comparison, Curve, Outcome, Plot, Tell, compared, near_zero, tracked, worst
from experiments.validate.base.spheres import RADIUS, SIXTEEN, mass_of, plane_modulus, row_of_grains

__all__ = ["CASES", "GRAVITY", "MASS", "advance_to", "downhill", "sixteen"]

YOUNG, POISSON, DENSITY, GRAVITY = 1e8, 0.25, 2600.0, 9.81
MASS = mass_of(DENSITY, RADIUS)
DOWN = (0.0, 0.0, -GRAVITY)


STIFFNESS = 4 / 3 * plane_modulus(YOUNG, POISSON) * math.sqrt(RADIUS)  # k of F = k delta^1.5 on a rigid plane [N/m^1.5]
CONTACT = math.sqrt(RADIUS * (MASS * GRAVITY / STIFFNESS) ** (2 / 3))
"""Radius of the contact that carries a grain's weight [m]."""


def downhill(degrees: float) -> tuple[float, float, float]:
    """Gravity on an incline, x down it [m/s2]."""
    angle = math.radians(degrees)
    return GRAVITY * math.sin(angle), 0.0, -GRAVITY * math.cos(angle)


def sixteen(
    *, height: float | None = None, gravity: Sequence[float] = DOWN, friction: float = 0.4, rolling: float = 0.0,
    **options: Any,
) -> Bed:  # fmt: skip
    """Sixteen grains 12.5 mm apart that do not meet, at rest on the floor unless a height is given [m]."""
    if height is None:
        height = RADIUS - (MASS * -gravity[2] / STIFFNESS) ** (2 / 3)
    positions, radii, given = row_of_grains(height, gravity=gravity)
    return Bed.from_grains(
        Material("grain", DENSITY, YOUNG, POISSON, friction, 0.5, rolling), positions=positions, radii=radii,
        **given | options,
    )  # fmt: skip


def advance_to(bed: Bed, time: float) -> Grains:
    """Advance to a time since the bed was made [s]; its grains."""
    bed.advance(round(time / bed.time_step) - bed.steps)
    return bed.grains()


def _free_fall(tell: Tell) -> Outcome:
    v0 = np.outer(np.linspace(-0.2, 0.5, SIXTEEN), [1.0, 0.5, 0.6])
    bed = sixteen(height=0.05, floor=False, velocities=v0)
    down, off = np.array(DOWN), [0.0, 0.0]
    for _ in range(3):
        bed.advance(900)
        t, grains = bed.time, bed.grains()
        off[0] = max(off[0], np.abs(grains.velocity - v0 - down * t).max())
        off[1] = max(off[1], np.abs(grains.displacement - v0 * t - 0.5 * down * t**2).max())
    return Outcome([
        near_zero("largest error of the velocity", off[0], 1e-13, "m/s"),
        near_zero("largest error of the path", off[1], 1e-13, "m"),
    ])  # fmt: skip


def _at_rest(tell: Tell) -> Outcome:
    bed = sixteen()
    bed.advance(3000)
    after = bed.grains()
    rows = [
        Comparison("floor force over the weight", "1", 1.0, bed.floor_force / (SIXTEEN * MASS * GRAVITY), 1e-9),
        near_zero("path in 3000 steps", np.abs(after.displacement).max(), 1e-12, "m"),
        near_zero("speed afterwards", np.abs(after.velocity).max(), 1e-12, "m/s"),
    ]
    return Outcome(rows)


def _sliding(tell: Tell) -> Outcome:
    mu, u0 = 0.4, np.linspace(0.05, 0.2, SIXTEEN)
    bed = sixteen(friction=mu, velocities=np.outer(u0, [0.6, 0.8, 0.0]))
    turning = 2 * u0 / (7 * mu * GRAVITY)
    times, speeds, spins = [0.0], [u0], [0 * u0]
    for part in np.arange(1, 49) / 40:
        grains = advance_to(bed, part * turning[-1])
        times.append(bed.time)
        speeds.append(grains.velocity @ (0.6, 0.8, 0))
        spins.append(grains.spin @ (-0.8, 0.6, 0))
        tell(part / 1.2)
    t, speed, spin = np.array(times)[:, None], np.array(speeds), np.array(spins)
    # The tangential spring, stretched to mu F_n / S_t when sliding ends, rings for a while: m* = 2/7 m, so its dashpot
    # takes 4 m / 7 c_t for a fall by e, here 0.2 ms.
    stiffness = 8 * effective_moduli(YOUNG, POISSON, math.inf, POISSON)[1] * CONTACT
    ringing = 4 * MASS / (7 * damping_factor(bed.material.restitution) * math.sqrt(MASS * stiffness))
    slides, rolls = t < 0.99 * turning, t > turning + 8 * ringing
    slid = u0 - mu * GRAVITY * t
    gap = np.abs(speed / slid - 1)[slides].max()
    # Each grain slides until its own time, and no longer: where its speed meets 5/7 of the first.
    stop = u0 * (2 / 7) / (-np.polyfit(t[:20, 0], speed[:20, -1], 1)[0])
    spun = (spin / np.maximum(2.5 * mu * GRAVITY * t / RADIUS, 1e-30))[1:][slides[1:]]
    rows = [
        Comparison("speed while sliding over u0 - mu g t, worst", "1", 1.0, 1 + gap, 1e-4),
        Comparison("spin while sliding over 5/2 mu g t / r, worst", "1", 1.0, worst(spun, 1.0), 1e-3),
        Comparison("time to rolling over 2 u0 / 7 mu g", "1", 1.0, float(stop[-1] / turning[-1]), 1e-3),
        Comparison("speed once rolling over 5/7 u0, worst", "1", 1.0, worst((speed / (5 * u0 / 7))[rolls], 1.0), 1e-3),
        Comparison("spin r over speed once rolling, worst", "1", 1.0, worst((spin * RADIUS / speed)[rolls], 1.0), 1e-3),
    ]
    both = {"closed form": np.maximum(slid, 5 * u0 / 7), "bed": speed}
    curves = [
        Curve(f"{what}, {u0[k]:.2f} m/s", 1e3 * t[:, 0], values[:, k], what == "bed")
        for k in (3, 8, 15) for what, values in both.items()
    ]  # fmt: skip
    return Outcome(rows, [Plot("Sliding turns into rolling", "time [ms]", "speed [m/s]", curves)])


def _incline(tell: Tell) -> Outcome:
    rows: list[Comparison] = []
    angle = math.radians(20)
    for rolling in tracked((0.0, 0.05, 0.2), tell):
        bed = sixteen(gravity=downhill(20), friction=0.5, rolling=rolling)
        first = advance_to(bed, 0.02)
        start = bed.time
        second = advance_to(bed, 0.05)
        pull = float((second.velocity[0, 0] - first.velocity[0, 0]) / (bed.time - start))
        closed = 5 / 7 * GRAVITY * (math.sin(angle) - rolling * math.cos(angle))
        rows.append(Comparison(f"acceleration, mu_r = {rolling:g}", "m/s2", closed, pull, 2e-3))
        slip = float(second.spin[0, 1] * RADIUS / second.velocity[0, 0])
        rows.append(Comparison(f"spin r over speed, mu_r = {rolling:g}", "1", 1.0, slip, 5e-3))
    return Outcome(rows)


def _held(tell: Tell) -> Outcome:
    rows: list[Comparison] = []
    for degrees in (5, 10, 20):
        bed = sixteen(gravity=downhill(degrees), friction=0.5, rolling=1.1 * math.tan(math.radians(degrees)))
        there = advance_to(bed, 0.02)
        after = advance_to(bed, 0.06)
        crept = np.abs(after.position - there.position).max()
        rows.append(near_zero(f"speed after 0.06 s at {degrees} deg", np.abs(after.velocity).max(), 1e-8, "m/s"))
        rows.append(near_zero(f"creep in 0.04 s at {degrees} deg", crept, 1e-9, "m"))
        give = np.abs(after.displacement[:, 0]).max() / RADIUS
        rows.append(near_zero(f"give of the springs over r at {degrees} deg", give, 1e-3))
    return Outcome(rows)


def _twisting(tell: Tell) -> Outcome:
    mu, w0 = 0.4, np.linspace(2.0, 8.0, SIXTEEN)
    bed = sixteen(friction=mu, rolling=0.1, spins=np.outer(w0, [0, 0, 1]))
    slowing = 3 * math.pi / 16 * mu * CONTACT * MASS * GRAVITY / (0.4 * MASS * RADIUS**2)
    grains = advance_to(bed, 0.5 * w0[0] / slowing)
    closed = w0 - slowing * bed.time
    rows = compared("spin", w0, closed, grains.spin[:, 2], unit="rad/s", band=1e-3, form="{:g} rad/s")
    grains = advance_to(bed, 4 * w0[-1] / slowing)
    rows.append(near_zero("spin at the end", np.abs(grains.spin).max(), 1e-6, "rad/s"))
    return Outcome(rows)


CASES = {
    "free-fall": _free_fall,
    "at-rest": _at_rest,
    "sliding": _sliding,
    "incline-rolling": _incline,
    "incline-rest": _held,
    "twisting": _twisting,
}
