"""Slow grains (``dem.engine.sleep``): one step for several of the bed, of that many times the length."""

import math

import numpy as np
import pytest

import dem.engine.engine
from dem import Bed, Material, Sleep

pytestmark = pytest.mark.cpu_only("sleep")

R = 2e-3
GRAVITY = 9.81
STUFF = Material("springy", 2600, 1e7, 0.25, 0.5, 0.999, 0.0)


@pytest.fixture
def lying(monkeypatch):
    """Makes 144 grains that lie apart on a floor, a tenth deeper than their weight presses them into it."""
    monkeypatch.setattr(dem.engine.engine, "GRAINS_PER_CHUNK", 60)
    stiff = STUFF.young / (1 - STUFF.poisson**2)
    overlap = (3 * STUFF.density * math.pi * 4 / 3 * R**3 * GRAVITY / (4 * stiff * math.sqrt(R))) ** (2 / 3)
    x, y = (a.ravel() for a in np.meshgrid(np.arange(12), np.arange(12)))
    positions = np.column_stack([3 * R * (x + 0.5), 3 * R * (y + 0.5), np.full(x.size, R - 1.1 * overlap)])
    frequency = math.sqrt(2 * stiff * math.sqrt(R * overlap) / (STUFF.density * math.pi * 4 / 3 * R**3))
    return lambda: Bed.from_grains(
        STUFF, positions=positions, radii=np.full(x.size, R), size=(36 * R, 36 * R, 0.02), gravity=GRAVITY, threads=2
    ), frequency


@pytest.mark.parametrize(("pace", "stretch", "heavy"), [(4, 1.0, 16), (4, 2.0, 4), (4, 4.0, 1), (6, 2.0, 9)])
def test_a_slow_grain_swings_on_the_floor_as_one_of_so_many_times_its_mass(lying, pace, stretch, heavy):
    """With mass h m on Hertz's spring S = 2 E* sqrt(R delta), Johnson 1985, and the leapfrog's own sin(w t / 2)."""
    make, frequency = lying
    bed = make()
    rules = {"speed": 0.5, "waking_speed": 2.0, "own": 2.0, "unbalanced": 3.0, "still": 1e-9, "calm": 1e-3}
    bed.let_sleep(Sleep(**rules, pace=pace, stretch=stretch, every=pace))
    bed.advance(20 * pace)
    assert bed.sleeper.fast == 0 and bed.awake_count == bed.grain_count
    step = bed.time_step * pace
    half = 0.5 * frequency / math.sqrt(heavy) * step
    period = math.pi / math.asin(half) * step
    height = []
    for _ in range(round(5 * period / step)):
        bed.advance(pace)
        height.append(bed.grains(contacts=False).position[:, 2].mean())
    swing = np.array(height) - np.mean(height)
    up = np.flatnonzero((swing[:-1] < 0) & (swing[1:] >= 0))
    crossings = up + swing[up] / (swing[up] - swing[up + 1])
    assert len(crossings) >= 4
    assert np.diff(crossings).mean() * step == pytest.approx(period, rel=0.01)
    assert bed.sleeper.fast == 0


def test_a_stretch_below_one_is_refused():
    with pytest.raises(ValueError, match=r"stretch = 0.5 must be 1 or more"):
        Sleep(stretch=0.5)
