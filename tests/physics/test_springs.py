"""Grains at rest on their springs, pairs of their own for floor and body, and what the bed's own step does."""

import math

import numpy as np
import pytest
from scipy.linalg import expm

from dem import Bed, Facing, Material, Plane
from dem.contact.law import damping_factor, effective_moduli

RADIUS, YOUNG, POISSON, DENSITY, G = 0.0025, 1e8, 0.25, 2600, 9.81
MASS = DENSITY * 4 / 3 * math.pi * RADIUS**3
I16 = np.arange(16)


def rigid_stiffness(radius=RADIUS):
    """k of F = k delta^1.5 on a rigid plane [N/m^1.5]."""
    return 4 / 3 * effective_moduli(YOUNG, POISSON, math.inf, POISSON)[0] * math.sqrt(radius)


def sixteen(*, height=None, gravity=(0.0, 0.0, -G), friction=0.4, restitution=0.5, rolling=0.0, **options):
    """Sixteen grains 12.5 mm apart that do not meet, at rest on the floor unless a height is given."""
    weight = MASS * -gravity[2]
    if height is None:
        height = RADIUS - (weight / rigid_stiffness()) ** (2 / 3)
    positions = np.column_stack([0.00625 + 0.0125 * (I16 % 4), 0.00625 + 0.0125 * (I16 // 4), np.ones(16) * height])
    return Bed.from_grains(
        Material("grain", DENSITY, YOUNG, POISSON, friction, restitution, rolling),
        positions=positions,
        radii=np.full(16, RADIUS),
        size=(0.05, 0.05, 0.05),
        height=0.08,
        gravity=gravity,
        **options,
    )


def to(bed, time):
    bed.advance(round(time / bed.time_step) - bed.steps)
    return bed.grains()


def test_a_grain_at_rest_on_a_slope_does_not_creep():
    """Springs alone hold it: k_t (x - r theta) = m g sin, k_t r^2 theta = m g r sin: x = 2 m g sin / k_t; for ever."""
    angle = math.radians(8)
    gravity = (G * math.sin(angle), 0.0, -G * math.cos(angle))
    bed = sixteen(gravity=gravity, friction=0.5, rolling=4 * math.tan(angle))
    to(bed, 0.04)
    there = bed.grains()
    overlap = (MASS * G * math.cos(angle) / rigid_stiffness()) ** (2 / 3)
    tangential = 8 * effective_moduli(YOUNG, POISSON, math.inf, POISSON)[1] * math.sqrt(RADIUS * overlap)
    assert there.displacement[:, 0] == pytest.approx(2 * MASS * G * math.sin(angle) / tangential, rel=5e-3)
    after = to(bed, 0.08)
    assert np.abs(after.position - there.position).max() < 1e-14
    assert np.abs(after.velocity).max() < 1e-14 and np.abs(after.spin).max() < 1e-11


def test_a_grain_rocks_on_its_rolling_spring_and_turns_on_its_twisting_spring():
    """Their frequencies: of m x'' = -k_t (x - r q), I q'' = k_t r (x - r q) - k_t r^2 q the slow mode; and, about the
    normal, of I q'' = -k_t a^2 / 2 q; with the frequency that 0.3 of critical damping of each spring leaves."""
    overlap = (MASS * G / rigid_stiffness()) ** (2 / 3)
    tangential = 8 * effective_moduli(YOUNG, POISSON, math.inf, POISSON)[1] * math.sqrt(RADIUS * overlap)
    inertia = 0.4 * MASS * RADIUS**2
    a, arm = math.sqrt(RADIUS * overlap), RADIUS - overlap
    share = 0.3  # of critical damping, for the inertia 2/5 m r^2 and the spring alone
    slip = damping_factor(0.5) * math.sqrt(tangential * MASS)  # the tangential dashpot: c_n sqrt(m S_t)
    stiff = np.array([[tangential, -tangential * arm], [-tangential * arm, tangential * (arm**2 + RADIUS**2)]])
    rolling = 2 * share * math.sqrt(inertia * tangential) * RADIUS
    damp = np.array([[slip, -slip * arm], [-slip * arm, slip * arm**2 + rolling]])
    weights = np.diag([1 / MASS, 1 / inertia])
    system = np.block([[np.zeros((2, 2)), np.eye(2)], [-weights @ stiff, -weights @ damp]])
    start = np.array([0.0, 0.0, 1e-6, 1e-6 / RADIUS])
    spins = np.zeros((16, 3))
    spins[:8, 1] = 1e-6 / RADIUS
    spins[8:, 2] = 1e-4
    velocities = np.zeros((16, 3))
    velocities[:8, 0] = 1e-6
    bed = sixteen(friction=5.0, rolling=5.0, spins=spins, velocities=velocities, time_step=1e-6)
    twisting = math.sqrt(0.5 * tangential * a**2 / inertia)
    for _ in range(4):
        bed.advance(200)
        grains = bed.grains()
        wanted = expm(system * bed.time) @ start
        assert grains.velocity[:8, 0] == pytest.approx(wanted[2], abs=3e-3 * 1e-6)
        assert grains.spin[:8, 1] * RADIUS == pytest.approx(wanted[3] * RADIUS, abs=3e-3 * 1e-6)
    decay, rate = share * twisting, twisting * math.sqrt(1 - share**2)
    for time in (0.01, 0.02, 0.04):
        spin, t = to(bed, time).spin[8:, 2], bed.time
        wanted = math.exp(-decay * t) * (math.cos(rate * t) - decay / rate * math.sin(rate * t))
        assert spin == pytest.approx(1e-4 * wanted, abs=2e-3 * 1e-4)
    assert twisting * bed.time > 2


def test_floor_and_body_have_pairs_of_their_own():
    """Restitution, friction and Young's modulus of a grain on the floor and on a body, other than between grains.

    Rebound e_floor, e_body; Hertz's overlap (5 m v^2 / 4 k)^(2/5) with 1/E* of both sides; v_x = mu (1 + e) v_n from a
    spin that slips throughout.
    """
    speed, facing = 0.3, Facing(friction=0.05, restitution=0.95, rolling_friction=0.0, young=3e7, poisson=0.4)
    star = effective_moduli(YOUNG, POISSON, 3e7, 0.4)[0]
    positions = np.column_stack([0.00625 + 0.0125 * (I16 % 4), 0.00625 + 0.0125 * (I16 // 4), np.full(16, RADIUS)])
    positions[8:, 2] = 0.04 - RADIUS
    bed = Bed.from_grains(
        Material("grain", DENSITY, YOUNG, POISSON, 0.4, 0.3, 0.1),
        positions=positions,
        radii=np.full(16, RADIUS),
        velocities=np.outer(np.where(I16 < 8, -speed, speed), [0, 0, 1.0]),
        spins=np.tile([0.0, 100.0, 0.0], (16, 1)),
        size=(0.05, 0.05, 0.05),
        height=0.08,
        gravity=0.0,
        floor=facing,
        time_step=5e-7,
    )
    bed.add_body(
        [Plane(normal=(0, 0, -1))], position=(0, 0, 0.04), friction=0.02, restitution=0.9, rolling_friction=0.0
    )
    bed.advance(round(1.5e-3 / 5e-7))
    grains = bed.grains()
    rebound = np.where(I16 < 8, 0.95, -0.9)
    assert grains.velocity[:, 2] == pytest.approx(rebound * speed, rel=2e-3)
    gained = np.where(I16 < 8, 0.05 * 1.95, -0.02 * 1.9) * speed
    assert grains.velocity[:, 0] == pytest.approx(gained, rel=5e-3)
    soft = Bed.from_grains(
        Material("grain", DENSITY, YOUNG, POISSON, 0.4, 0.3),
        positions=positions[:8],
        radii=np.full(8, RADIUS),
        velocities=np.tile([0, 0, -speed], (8, 1)),
        size=(0.05, 0.05, 0.05),
        gravity=0.0,
        floor=Facing(restitution=1.0, young=3e7, poisson=0.4),
        time_step=5e-7,
    )
    soft.advance(1500)
    wanted = (5 * MASS * speed**2 / (4 * 4 / 3 * star * math.sqrt(RADIUS))) ** 0.4
    assert soft.max_overlap * 2 * RADIUS == pytest.approx(wanted, rel=1e-4)


def leapfrog_rebound(restitution, step, gap):
    """Rebound of a grain that starts this share of a step's way above the floor, one number for each, in plain Python.

    ``step`` as a share of Hertz's contact time. x'' = -max(0, x^1.5 + c sqrt(3/2) x^0.25 x'), velocities half a step
    behind, as the bed does it: the dashpot sees the velocity at the time of the force, x' - F dt / 2, and in the first
    step the mean of x^0.25 from the touch to half a step later.
    """
    c, dt = damping_factor(restitution) * math.sqrt(1.5), step * 2.943275 * 1.25**0.4
    x, v, force = -gap * dt, 1.0, 0.0
    while True:
        v -= force * dt
        outside = x <= 0
        x += v * dt
        damping = c * max(x, 0.0) ** 0.25
        if outside and x > 0:
            share = x / (v * dt)
            damping = c * (v * dt) ** 0.25 * 0.8 * (share + 0.5) ** 1.25
        force = max(0.0, (x**1.5 + damping * v) / (1 + damping * dt / 2)) if x > 0 else 0.0
        if x <= 0 and v < 0:
            return -v


def test_the_restitution_is_that_asked_for_with_the_beds_own_step_too():
    """At overlaps near the bound a collision lasts ten steps; wherever in one it begins, the rebound is within 0.006.

    The bed's rebounds are those of the plain leapfrog to 1e-6, at sixteen starts a sixteenth of a step apart; error and
    scatter fall with the square of the step.
    """
    e, speed, gaps = 0.5, 0.5, (I16 + 0.5) / 16
    overlap = (5 * MASS * speed**2 / (4 * rigid_stiffness())) ** 0.4
    time = 2.943275 * overlap / speed
    means, widths, furthest = [], [], []
    for count in (10, 40):
        bed = sixteen(
            height=RADIUS + gaps * speed * time / count,
            gravity=(0.0, 0.0, 0.0),
            restitution=e,
            friction=0.0,
            velocities=np.tile([0.0, 0.0, -speed], (16, 1)),
            max_overlap=1.2 * overlap / (2 * RADIUS),
            time_step=time / count,
        )
        bed.advance(5 * count)
        found = bed.grains().velocity[:, 2] / speed
        assert found == pytest.approx([leapfrog_rebound(e, 1 / count, gap) for gap in gaps], abs=1e-6)
        means.append(found.mean() - e)
        furthest.append(np.abs(found - e).max())
        widths.append(np.ptp(found))
    assert furthest[0] < 0.006 and furthest[1] < furthest[0] / 8
    assert abs(means[0]) < 0.002 and abs(means[1]) < 1e-4
    assert widths[0] < 0.01 and widths[1] < widths[0] / 12
