"""One grain under gravity: falling, lying, sliding, rolling, spinning; closed forms."""

import math

import numpy as np
import pytest

from dem import Ball, Bed, Material
from dem.contact import effective_moduli

RADIUS, YOUNG, POISSON, DENSITY, G = 0.0025, 1e8, 0.25, 2600, 9.81
MASS = DENSITY * 4 / 3 * math.pi * RADIUS**3
I16 = np.arange(16)


def rigid_stiffness(radius=RADIUS):
    """k of F = k delta^1.5 on a rigid plane [N/m^1.5]."""
    return 4 / 3 * effective_moduli(YOUNG, POISSON, math.inf, POISSON)[0] * math.sqrt(radius)


def sixteen(*, height=None, gravity=(0.0, 0.0, -G), friction=0.4, restitution=0.5, rolling=0.0, floor=True, **options):
    """Sixteen grains 12.5 mm apart that do not meet, at rest on the floor unless a height is given."""
    weight = MASS * -gravity[2]
    if height is None:
        height = RADIUS - (weight / rigid_stiffness()) ** (2 / 3)
    positions = np.column_stack([0.00625 + 0.0125 * (I16 % 4), 0.00625 + 0.0125 * (I16 // 4), np.full(16, height)])
    return Bed.from_grains(
        Material("grain", DENSITY, YOUNG, POISSON, friction, restitution, rolling),
        positions=positions,
        radii=np.full(16, RADIUS),
        size=(0.05, 0.05, 0.05),
        height=0.08,
        gravity=gravity,
        floor=floor,
        **options,
    )


def to(bed, time):
    bed.advance(round(time / bed.time_step) - bed.steps)
    return bed.grains()


def test_free_fall_is_exact():
    """z = z0 + v0 t - g t^2 / 2, v = v0 - g t: to round-off at any step, as the leapfrog is of second order."""
    v0 = np.outer(np.linspace(-0.2, 0.5, 16), [1.0, 0.5, 0.6])
    bed = sixteen(height=0.05, floor=False, velocities=v0)
    z0 = bed.grains()["position"]
    for _ in range(3):
        bed.advance(900)
        t, grains = bed.time, bed.grains()
        travelled = v0 * t + 0.5 * np.array([0, 0, -G]) * t**2
        assert grains["velocity"] == pytest.approx(v0 + np.array([0, 0, -G]) * t, abs=1e-13)
        assert grains["position"][:, 2] == pytest.approx((z0 + travelled)[:, 2], abs=1e-13)
        assert grains["displacement"] == pytest.approx(travelled, abs=1e-13)
    assert t > 0.01


def test_a_grain_at_rest_stays_at_rest():
    """At the overlap where Hertz's force is the weight; the floor carries it."""
    bed = sixteen()
    before = bed.grains()
    bed.advance(3000)
    after = bed.grains()
    assert np.abs(after["position"] - before["position"]).max() < 1e-12
    assert np.abs(after["velocity"]).max() < 1e-12 and np.abs(after["spin"]).max() == 0.0
    assert bed.floor_force == pytest.approx(16 * MASS * G, rel=1e-9)
    assert (after["coordination"] == 1).all()


def test_sliding_turns_into_rolling():
    """u = u0 - mu g t until t = 2 u0 / (7 mu g), then rolls at u = 5 u0 / 7."""
    mu, u0 = 0.4, np.linspace(0.05, 0.2, 16)
    bed = sixteen(friction=mu, velocities=np.outer(u0, [0.6, 0.8, 0.0]))
    turning = 2 * u0 / (7 * mu * G)
    for part in (0.5, 0.9):
        t = part * turning[0]
        grains = to(bed, t)
        speed = grains["velocity"] @ (0.6, 0.8, 0)
        assert speed == pytest.approx(u0 - mu * G * bed.time, rel=1e-4)
        spin = grains["spin"] @ (-0.8, 0.6, 0)
        assert spin == pytest.approx(2.5 * mu * G * bed.time / RADIUS, rel=1e-3)
    # Each grain slides until its own time, and no longer.
    for k in (3, 8, 13):
        grains = to(bed, 0.99 * turning[k])
        assert grains["velocity"][k] @ (0.6, 0.8, 0) == pytest.approx(u0[k] - mu * G * bed.time, rel=1e-4)
        grains = to(bed, 1.1 * turning[k])
        assert grains["velocity"][k] @ (0.6, 0.8, 0) == pytest.approx(5 * u0[k] / 7, rel=1e-3)
    grains = to(bed, 1.2 * turning[-1])
    speed, spin = grains["velocity"] @ (0.6, 0.8, 0), grains["spin"] @ (-0.8, 0.6, 0)
    assert speed == pytest.approx(5 * u0 / 7, rel=1e-3)
    assert spin * RADIUS == pytest.approx(speed, rel=1e-3)


@pytest.mark.parametrize("rolling", [0.05, 0.2])
def test_rolling_down_an_incline(rolling):
    """u = 5/7 g (sin - mu_r cos) t (rolling without sliding against a torque mu_r r N)."""
    angle = math.radians(20)
    gravity = (G * math.sin(angle), 0.0, -G * math.cos(angle))
    bed = sixteen(gravity=gravity, friction=0.5, rolling=rolling)
    first = to(bed, 0.02)
    start = bed.time
    second = to(bed, 0.05)
    pull = (second["velocity"][:, 0] - first["velocity"][:, 0]) / (bed.time - start)
    assert pull == pytest.approx(5 / 7 * G * (math.sin(angle) - rolling * math.cos(angle)), rel=2e-3)
    assert second["spin"][:, 1] * RADIUS == pytest.approx(second["velocity"][:, 0], rel=5e-3)


def test_a_grain_rests_on_an_incline_where_rolling_friction_holds_it():
    """mu_r >= tan: it comes to rest, and moves no further than its springs give."""
    angle = math.radians(10)
    gravity = (G * math.sin(angle), 0.0, -G * math.cos(angle))
    bed = sixteen(gravity=gravity, friction=0.5, rolling=1.1 * math.tan(angle))
    to(bed, 0.02)
    there = bed.grains()
    after = to(bed, 0.06)
    assert np.abs(after["velocity"]).max() < 1e-8
    assert np.abs(after["displacement"][:, 0]).max() < 1e-3 * RADIUS
    assert np.abs(after["position"] - there["position"]).max() < 1e-9


def test_twisting_resistance_stops_a_spinning_grain():
    """w = w0 - M t / I with M = 3 pi / 16 mu a N (Johnson 1985, 7.4), I = 2/5 m r^2; then at rest."""
    mu, w0 = 0.4, np.linspace(2.0, 8.0, 16)
    bed = sixteen(friction=mu, rolling=0.1, spins=np.outer(w0, [0, 0, 1]))
    a = math.sqrt(RADIUS * (MASS * G / rigid_stiffness()) ** (2 / 3))
    slowing = 3 * math.pi / 16 * mu * a * MASS * G / (0.4 * MASS * RADIUS**2)
    grains = to(bed, 0.5 * w0[0] / slowing)
    assert grains["spin"][:, 2] == pytest.approx(w0 - slowing * bed.time, rel=1e-3)
    grains = to(bed, 4 * w0[-1] / slowing)
    assert np.abs(grains["spin"]).max() < 1e-6
    assert np.abs(grains["velocity"]).max() < 1e-9


def test_forces_computed_anew_do_not_disturb_a_sliding_grain():
    """Setting the gravity that is in force, and adding a body far away, leave the motion as it was."""

    def motion(touch):
        bed = sixteen(velocities=np.tile([0.05, 0.0, 0.0], (16, 1)))
        bed.advance(2000)
        if touch:
            for _ in range(5):
                bed.set_gravity(G)
            bed.add_body([Ball(radius=0.002)], position=(0.0, 0.0, 0.07))
        bed.advance(2000)
        return bed.grains()

    a, b = motion(touch=False), motion(touch=True)
    for name in ("position", "velocity", "spin", "force"):
        assert np.abs(a[name] - b[name]).max() <= 1e-11 * np.abs(a[name]).max()
