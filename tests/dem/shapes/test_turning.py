"""The book of angular momentum: what grains have changes by what it says, to round-off, across sides and with sleep."""

import numpy as np
import pytest

import dem.engine.engine
from dem import Ball, Bed, Capsule, Material, Sleep

ROUGH = Material(
    name="test", density=2500.0, young=2e6, poisson=0.25, friction=0.5, restitution=0.4, rolling_friction=0.2,
    sources={},
)  # fmt: skip


def gap(bed, before):
    """By how much grains' angular momentum is off [N m s], and the largest that anything changed it by."""
    now = bed.angular_momentum()
    changed = {name: now[name] - before[name] for name in now}
    off = changed["grains"] - changed["outside"] + changed["first_body"] + changed["bodies"]
    return np.abs(off).max(), max(np.abs(value).max() for value in changed.values())


@pytest.mark.long
def test_a_cloud_between_periodic_sides_turns_by_what_crosses_them_alone():
    """No gravity, no floor, no body: grains of 5 mm fly about and through both sides for 2000 steps."""
    rng = np.random.default_rng(3)
    grid = np.stack(np.meshgrid(*3 * [np.arange(4) * 6e-3 + 3e-3], indexing="ij"), axis=-1).reshape(-1, 3)
    grid = grid + rng.uniform(-4e-4, 4e-4, grid.shape) + (0.0, 0.0, 0.08)
    bed = Bed.from_grains(
        ROUGH, positions=grid, radii=np.full(64, 2.5e-3), size=(0.024, 0.024, 0.12), height=0.2, gravity=0.0,
        velocities=rng.normal(0.0, 0.3, grid.shape), floor=None, max_overlap=0.2, threads=1,
    )  # fmt: skip
    bed.track_contact_work()
    before = bed.angular_momentum()
    lists = bed.list_count
    bed.advance(2000)
    off, most = gap(bed, before)
    assert bed.list_count > lists + 5 and most > 1e-6
    assert off < 1e-12 * most
    assert np.abs(bed.angular_momentum()["outside"]).max() > 1e-7


def layers():
    """Three layers of grains on a floor under gravity, not at rest, periodic sideways."""
    d, rows, columns = 5e-3, 16, 8
    x, y = np.meshgrid((np.arange(rows) + 0.5) * d, (np.arange(columns) + 0.5) * d, indexing="ij")
    low = np.column_stack([x.ravel(), y.ravel(), np.full(x.size, 0.5 * d)])
    positions = np.vstack([low, low + [0.5 * d, 0.5 * d, 0.75 * d], low + [0.0, 0.0, 1.5 * d]])
    return Bed.from_grains(
        ROUGH, positions=positions % [rows * d, columns * d, 1.0], radii=np.full(len(positions), 0.5 * d),
        size=(rows * d, columns * d, 0.03), height=0.2, gravity=(0.5, 0.0, -9.81), max_overlap=0.2, threads=1,
    )  # fmt: skip


@pytest.mark.long
@pytest.mark.parametrize("sleeps", [False, pytest.param(True, marks=pytest.mark.cpu_only("sleep"))])
def test_grains_on_a_floor_under_bodies_turn_by_weight_floor_sides_sleepers_and_bodies(sleeps, monkeypatch):
    """A ball that goes through the end of the periodic cell and a capsule that turns, both dug in; with slow grains and
    without. Kept and restored on the way, to the same bits."""
    monkeypatch.setattr(dem.engine.engine, "GRAINS_PER_CHUNK", 60)
    bed = layers()
    bed.add_body(Ball(radius=5e-3), position=(0.075, 0.02, 0.0174))
    bed.add_body(Capsule(start=(0, 0, -0.004), end=(0, 0, 0.004), radius=3e-3), position=(0.03, 0.02, 0.0193))
    bed.advance(300)
    bed.track_contact_work()
    before = bed.angular_momentum()
    if sleeps:
        bed.let_sleep(Sleep(speed=0.2, own=0.6, waking_speed=0.6, calm=0.1, every=8, stretch=2.0))
    bed.move_body(1, velocity=(0.15, 0.02, -0.1), spin=(3.0, 1.0, 0.0))
    bed.move_body(2, velocity=(0.0, 0.0, -0.2), spin=(0.0, 8.0, 2.0))
    bed.advance(150)
    kept = bed.state()
    bed.advance(250)
    off, most = gap(bed, before)
    now = bed.angular_momentum()
    assert np.abs(now["bodies"]).max() > 1e-7 and np.abs(now["first_body"]).max() > 1e-6
    assert off < 1e-12 * most
    if sleeps:  # some were slow, and some are
        assert bed.grain_steps < 0.98 * bed.grain_count * bed.steps and bed.sleeper.fast < bed.grain_count
    bed.restore(kept)
    bed.advance(250)
    assert all((now[name] == value).all() for name, value in bed.angular_momentum().items())


def test_without_a_book_there_is_none():
    with pytest.raises(ValueError, match=r"tracks no contact work.*track_contact_work\(\) starts it"):
        layers().angular_momentum()
