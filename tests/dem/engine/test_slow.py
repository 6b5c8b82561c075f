"""Slow grains (``dem.engine.sleep``): one step for several of the bed, of that many times the length."""

import math

import numpy as np
import pytest

import dem.engine.engine
from dem import Ball, Bed, Material, Sleep
from dem.contact.timestep import contact_time, stable_step

pytestmark = pytest.mark.cpu_only("sleep")

R = 2e-3
GRAVITY = 9.81
STUFF = Material("springy", 2600, 1e7, 0.25, 0.5, 0.999, 0.0)
MASS = STUFF.density * math.pi * 4 / 3 * R**3
STIFF = STUFF.young / (1 - STUFF.poisson**2)
OVERLAP = (3 * MASS * GRAVITY / (4 * STIFF * math.sqrt(R))) ** (2 / 3)  # by which its weight presses one into the floor
HOLD = 2 * STIFF * math.sqrt(R * OVERLAP)  # Hertz's stiffness there; Mindlin's is SHEAR of it
SHEAR = 2 * (1 - STUFF.poisson) / (2 - STUFF.poisson)
ALL_SLOW = {"speed": 0.5, "waking_speed": 2.0, "own": 2.0, "unbalanced": 3.0, "still": 1e-9, "calm": 1e-3}


def lying(monkeypatch, *, deeper, **rules):
    """144 grains that lie apart on a floor, ``deeper`` times as deep as their weight presses them, all slow."""
    monkeypatch.setattr(dem.engine.engine, "GRAINS_PER_CHUNK", 60)
    x, y = (a.ravel() for a in np.meshgrid(np.arange(12), np.arange(12)))
    positions = np.column_stack([3 * R * (x + 0.5), 3 * R * (y + 0.5), np.full(x.size, R - deeper * OVERLAP)])
    bed = Bed.from_grains(
        STUFF, positions=positions, radii=np.full(x.size, R), size=(36 * R, 36 * R, 0.02), gravity=GRAVITY, threads=2
    )
    bed.let_sleep(Sleep(**ALL_SLOW, **rules, every=rules["pace"]))
    bed.advance(20 * rules["pace"])
    assert bed.sleeper.fast == 0 and bed.awake_count == bed.grain_count
    return bed


def period(stiffness, inverse_mass, step):
    """Of a spring [N/m] and a mass [kg], by leapfrog with this step [s]: its own sin(w t / 2)."""
    return math.pi * step / math.asin(0.5 * math.sqrt(stiffness * inverse_mass) * step)


def swings(bed, *, wanted, read):
    """The mean period of what is read at every step of the slow [s], over five of those wanted."""
    step, values = bed.time_step * bed.sleeper.pace, []
    for _ in range(round(5 * wanted / step)):
        bed.advance(bed.sleeper.pace)
        values.append(read(bed.grains(contacts=False)).mean())
    swing = np.array(values) - np.mean(values)
    up = np.flatnonzero((swing[:-1] < 0) & (swing[1:] >= 0))
    crossings = up + swing[up] / (swing[up] - swing[up + 1])
    assert len(crossings) >= 4 and bed.sleeper.fast == 0
    return np.diff(crossings).mean() * step


@pytest.mark.long
@pytest.mark.parametrize(("pace", "stretch", "heavy"), [(4, 1.0, 16), (4, 2.0, 4), (4, 4.0, 1), (6, 2.0, 9)])
def test_a_slow_grain_swings_on_the_floor_as_one_of_so_many_times_its_mass(monkeypatch, pace, stretch, heavy):
    """On Hertz's spring S = 2 E* sqrt(R delta), Johnson 1985."""
    bed = lying(monkeypatch, deeper=1.1, pace=pace, stretch=stretch)
    wanted = period(HOLD, 1 / (heavy * MASS), bed.time_step * pace)
    assert swings(bed, wanted=wanted, read=lambda grains: grains.position[:, 2]) == pytest.approx(wanted, rel=0.01)


@pytest.mark.long
@pytest.mark.parametrize(("spin_stretch", "stout"), [(1.0, 16), (2.0, 4), (4.0, 1)])
def test_a_slow_grain_spins_against_friction_as_one_of_so_many_times_its_inertia(monkeypatch, spin_stretch, stout):
    """On Mindlin's spring, its mass as it is: 1 / m + r^2 / I with I = 0.4 m r^2, so many times."""
    bed = lying(monkeypatch, deeper=1.0, pace=4, stretch=4.0, spin_stretch=spin_stretch)
    state = bed.state()
    state["velocity"][:, 0] += 0.03 * OVERLAP * math.sqrt(HOLD / MASS)
    bed.restore(state)
    wanted = period(SHEAR * HOLD, (1 + 2.5 / stout) / MASS, 4 * bed.time_step)
    assert swings(bed, wanted=wanted, read=lambda grains: grains.spin[:, 1]) == pytest.approx(wanted, rel=0.01)


@pytest.mark.long
def test_a_grain_that_is_pressed_is_not_slow_where_its_step_would_be_unstable(monkeypatch):
    """By the step that is stable with six neighbours, at the overlap that a ball makes as it goes down."""
    monkeypatch.setattr(dem.engine.engine, "GRAINS_PER_CHUNK", 60)
    d = 2 * R
    i, j, k = (a.ravel() for a in np.meshgrid(np.arange(16), np.arange(6), np.arange(2)))
    positions = np.column_stack([(i + 0.5) * d, (j + 0.5) * d, 0.5 * d + 0.999 * d * k])
    bed = Bed.from_grains(
        Material("grain", 2600, 1e7, 0.25, 0.5, 0.5, 0.1), positions=positions, radii=np.full(i.size, R),
        size=(16 * d, 6 * d, 0.02), height=0.07, max_overlap=0.1, threads=2,
    )  # fmt: skip
    bed.advance(600, drag_time=2e-3)
    ball = bed.add_body(Ball(radius=5e-3), position=(8.5 * d, 3.5 * d, 2 * d + 5.2e-3))
    bed.let_sleep(Sleep(**{**ALL_SLOW, "own": 5.0, "waking_speed": 5.0, "unbalanced": 1e3}, reach=1e-3, every=8))
    firm = bed.sleeper.firm
    time = contact_time(bed.material, diameter=d, max_overlap=firm)
    assert 4 * bed.time_step == pytest.approx(2.5 * stable_step(0.5, neighbours=6, sticking=True) * time, rel=1e-9)
    bed.advance(200)
    assert bed.sleeper.fast < 0.2 * bed.grain_count
    bed.move_body(ball, velocity=(0.0, 0.0, -0.05))
    bed.advance(8 * round(8e-4 / 0.05 / bed.time_step / 8))
    state, fast = bed.state(), bed.sleeper.fast
    x = state["position"]
    apart = x[:, None, :3] - x[None, :, :3]
    apart[..., :2] -= bed.size[:2] * np.round(apart[..., :2] / bed.size[:2])
    overlap = 1 - np.linalg.norm(apart, axis=2) / (x[:, None, 3] + x[None, :, 3])
    np.fill_diagonal(overlap, 0.0)
    assert overlap.max() > 2 * firm and 0 < fast < 0.7 * bed.grain_count
    assert overlap[fast:].max() < 1.1 * firm  # looked at every eight steps


@pytest.mark.parametrize("name", ["stretch", "spin_stretch"])
def test_a_stretch_below_one_is_refused(name):
    with pytest.raises(ValueError, match=f"Sleep: {name} = 0.5 must be 1 or more"):
        Sleep(**{name: 0.5})
