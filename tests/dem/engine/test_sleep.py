"""Grains that sleep: what is read of the bed stays what it is awake, bits stay, and what reaches them wakes them."""

import os
import subprocess
import sys
from pathlib import Path

import falling_bed
import numpy as np
import pytest

import dem.engine.engine
import dem.engine.sleep
from dem import Ball, Bed, Material, Sleep
from dem.engine.energy import bed_energies
from dem.engine.lists import Lists
from dem.engine.sleep import Sleeper

pytestmark = pytest.mark.cpu_only("sleep")

STUFF = Material("grain", 2600, 1e7, 0.25, 0.5, 0.3, 0.1)
D = 4e-3
ROWS, COLUMNS = 32, 6
ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture(scope="module")
def layer():
    """Grains in two square layers, at rest, and a ball above one end; of a size for the engine of `falling_bed`."""
    kept, dem.engine.engine.GRAINS_PER_CHUNK = dem.engine.engine.GRAINS_PER_CHUNK, 60
    i, j = (a.ravel() for a in np.meshgrid(np.arange(ROWS), np.arange(COLUMNS)))
    low = np.column_stack([(i + 0.5) * D, (j + 0.5) * D, np.full(i.size, 0.5 * D)])
    high = low + [0.5 * D, 0.5 * D, D * np.sqrt(0.5)]
    bed = Bed.from_grains(
        STUFF, positions=np.concatenate([low, high]), radii=np.full(2 * i.size, 0.5 * D),
        size=(ROWS * D, COLUMNS * D, 0.02), height=0.07, max_overlap=0.1, threads=2,
    )  # fmt: skip
    dem.engine.engine.GRAINS_PER_CHUNK = kept
    bed.advance(600, drag_time=2e-3)
    bed.advance(200)
    ball = bed.add_body(Ball(radius=5e-3), position=(0.02, 0.012, 0.013))
    bed.move_body(ball, velocity=(0.0, 0.0, -0.05))
    return bed, bed.state()


def pressed(layer, rules=None):
    """The ball goes 1.7 mm down. Its force, the floor's over the weight, those awake, every 50 steps; energies."""
    bed, state = layer
    bed.restore(state)
    if rules:
        bed.let_sleep(rules)
    rows, left, momentum, impulse = [], 2000, [], 0.0
    while left > 0:
        bed.advance(50)
        left -= 50
        impulse += 50 * bed.time_step * (-bed.reaction(0)[0][2] - bed.reaction(1)[0][2] - bed.weight)
        momentum.append(bed.momentum()[2] - impulse)
        rows.append([bed.reaction(1)[0][2], bed.floor_force / bed.weight, bed.awake_count])
    return np.array(rows), bed_energies(bed, bodies={}), np.ptp(momentum)


@pytest.mark.long
def test_what_reaches_a_bed_is_the_same_with_grains_asleep(layer):
    """The force on a ball pressed in, energies; the floor's reaction, which has all the weight.

    1e-4 off as measured: what the layer beyond those awake gives way by, and they do not.
    """
    plain, energies, _ = pressed(layer)
    found, asleep_energies, drift = pressed(layer, Sleep(every=48, calm=0.3, settling=1))
    assert plain[:, 2].min() == 2 * ROWS * COLUMNS and found[:, 2].min() < ROWS * COLUMNS
    assert np.abs(found[:, 0] - plain[:, 0]).max() < 1e-3 * plain[:, 0].max()
    assert np.abs(found[:, 1] - plain[:, 1]).max() < 1e-3 * plain[:, 1].max()
    for name in ("potential", "normal", "tangential"):
        assert asleep_energies[name] == pytest.approx(energies[name], rel=5e-3), name
    # The creep of those far off, 0.5 % of it, is not there while they sleep.
    assert asleep_energies["kinetic"] == pytest.approx(energies["kinetic"], rel=1e-2)
    # Gravity, floor and ball alone change the momentum of all grains, those that fall asleep or wake included.
    assert drift < 1e-15


def test_woken_at_once_they_go_on_as_if_they_had_not_slept(layer):
    """At rest under no ball: all asleep, then all awake; nothing moves by more than a millionth of a diameter."""
    bed, state = layer
    bed.restore(state)
    bed.move_body(1, position=(0.02, 0.012, 0.05), velocity=(0.0, 0.0, 0.0))
    bed.let_sleep(Sleep(every=48, calm=0.1, settling=1))
    bed.advance(600)
    assert bed.awake_count == 0 and bed.asleep.all()
    before = bed.grains()
    bed.wake()
    assert bed.awake_count == bed.grain_count
    bed.advance(200)
    after = bed.grains()
    assert np.array_equal(after.coordination, before.coordination)
    assert np.abs(after.position - before.position).max() < 1e-6 * D


@pytest.mark.long
def test_the_bits_depend_on_neither_threads_nor_cuts_nor_where_it_goes_on(tmp_path, monkeypatch):
    """Grains that fall, with rules under which they doze off and wake often; the book of what they lose too."""
    monkeypatch.setattr(dem.engine.engine, "GRAINS_PER_CHUNK", falling_bed.GRAINS_PER_CHUNK)
    path = tmp_path / "other.npz"
    command = [sys.executable, falling_bed.__file__, "fresh", str(path), "600", "1", "100", "none", "spike", "sleep"]
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    other = subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True)  # on one thread
    bed = falling_bed.make(2, sleep=True)
    digests, counts = {}, []
    for step in range(100, 700, 100):
        bed.advance(100)
        digests[step], state = falling_bed.digest(bed), bed.state()
        counts.append(bed.awake_count)
        if step == 300:
            bed.save(tmp_path / "bed.npz")
            middle = state
    assert min(counts) < 270 and len(set(counts)) > 3
    said = other.communicate()[0]
    assert other.returncode == 0
    assert {int(step): digest for step, digest in (line.split() for line in said.splitlines())} == digests
    bed.restore(middle)
    for steps in (1, 37, 62, 100):
        bed.advance(steps)
    assert falling_bed.digest(bed) == digests[500]
    again = Bed.load(tmp_path / "bed.npz", threads=2)
    assert falling_bed.digest(again) == digests[300]
    again.advance(100)
    assert falling_bed.digest(again) == digests[400]


@pytest.mark.long
def test_a_held_state_is_taken_back_with_its_sleepers_to_the_same_bits(layer):
    def bits():
        return {name: values.tobytes() for name, values in bed.state().items()} | {"computed": bed.grain_steps}

    bed, state = layer
    bed.restore(state)
    bed.let_sleep(Sleep(every=48, calm=0.3, settling=1))
    bed.advance(200)
    fast = bed.sleeper.fast
    held, then = bed.checkpoint(), bits()
    bed.advance(500)
    after = bits()
    assert bed.sleeper.fast < fast
    for _ in range(2):
        bed.rollback(held)
        assert bits() == then
        bed.advance(500)
        assert bits() == after


def test_grains_fall_asleep_at_every_fourth_look_only(layer, monkeypatch):
    """So that the contacts of sleepers, which are stored anew for it, are stored a quarter as often."""
    monkeypatch.setattr(dem.engine.sleep, "_WORTH", 0.0)
    bed, state = layer
    bed.restore(state)
    bed.let_sleep(Sleep(every=8, calm=0.08, settling=1, still=3e-3, change=0.05))
    assert bed.sleeper.rest_every == 24
    fewer, before = [], bed.asleep.copy()
    for _ in range(250):
        start = bed.steps
        bed.advance(8)
        if (bed.asleep & ~before).any():
            fewer.append(start)
        before = bed.asleep.copy()
    assert len(fewer) > 1 and bed.asleep.mean() > 0.5
    assert not np.any(np.array(fewer) % 96)


@pytest.mark.long
def test_a_bed_of_one_chunk_puts_to_sleep_what_is_slower_than_a_sleeper_may_be():
    """There slow grains, which may be faster, are not; grains that slide on a smooth floor keep their speed."""
    rules, d = Sleep(every=8, calm=0.05, settling=1), 4e-3
    pace = np.sqrt(9.81 * d)
    speeds = pace * np.array([0.5 * rules.still, 0.5 * rules.speed])
    assert rules.still < 0.5 * rules.speed
    x = np.array([[0.5 * d, 2 * d, 0.5 * d], [6.5 * d, 8 * d, 0.5 * d]])
    bed = Bed.from_grains(
        Material("smooth", 2600, 1e7, 0.25, 0.0, 0.3, 0.0), positions=x, radii=np.full(2, 0.5 * d),
        velocities=np.column_stack([speeds, 0 * speeds, 0 * speeds]), size=(12 * d, 12 * d, 0.02), threads=2,
    )  # fmt: skip
    bed.advance(3000)  # the bounce of setting the grains down is over
    bed.let_sleep(rules)
    bed.advance(400)
    assert bed.sleeper.pace == 1
    assert list(bed.asleep) == [True, False]


def test_what_cannot_be_is_refused(layer):
    with pytest.raises(ValueError, match=r"waking_speed = 0.001 and own = 0.04 must be above speed = 0.01"):
        Sleep(waking_speed=1e-3)
    with pytest.raises(ValueError, match="change = 0 must be above 0"):
        Sleep(change=0)
    with pytest.raises(ValueError, match="every = 50 must be a multiple of pace = 4"):
        Sleep(every=50)
    bed = Bed.from_grains(
        STUFF, positions=np.array([[0.01, 0.01, 0.01]]), radii=np.array([0.002]), size=(0.02, 0.02, 0.02), gravity=0.0,
        threads=2,
    )  # fmt: skip
    with pytest.raises(ValueError, match="floor and gravity"):
        bed.let_sleep()


def test_a_state_of_earlier_rules_of_sleep_is_refused_and_the_bed_stays_as_it_is(layer):
    """Before 2026-11-26 there were seven rules, and no slow grains to count."""
    bed, state = layer
    bed.restore(state)
    bed.let_sleep(Sleep(every=48, calm=0.3, settling=1))
    bed.advance(100)
    before = bed.state()
    earlier = before | {"sleep_rules": before["sleep_rules"][:7], "sleep_numbers": before["sleep_numbers"][:3]}
    with pytest.raises(ValueError, match="7 rules of sleep, of an earlier version, and 13 were expected"):
        bed.restore(earlier)
    after = bed.state()
    assert [name for name in before if not np.array_equal(before[name], after[name])] == []


def test_one_that_is_woken_wakes_its_cell_and_the_26_around_it_across_the_periodic_sides(layer):
    """And nobody else; the corner grain's cell has neighbours at the other ends."""
    bed, state = layer
    bed.restore(state)
    bed.move_body(1, position=(0.06, 0.012, 0.5), velocity=(0.0, 0.0, 0.0))
    bed.let_sleep(Sleep(every=48, calm=0.3, settling=1))
    bed.advance(1500)
    asleep = bed.asleep
    position = bed.grains(contacts=False).position
    corner = int(np.argmin(np.where(asleep, position.sum(axis=1), np.inf)))
    assert asleep.mean() > 0.9
    bed.engine.rest.woken[corner] = 1
    bed.make_lists(anew=False, stirred=True)
    count, box = bed.engine.count.to_numpy()[4:7], bed.engine.box.to_numpy()
    cells = np.floor((position - [0.0, 0.0, box[2]]) / box[4:7]).astype(int)
    apart = np.abs(cells - cells[corner])
    apart[:, :2] = np.minimum(apart[:, :2], count[:2] - apart[:, :2])
    around = (apart <= 1).all(axis=1)
    far = np.abs(position[:, 0] - position[corner, 0]) > 0.5 * bed.size[0]
    assert (around & far & asleep).any()
    assert np.array_equal(bed.asleep, asleep & ~around)
    bed.wake()


def test_grains_without_their_contacts_are_told_the_same_of_all_else(layer):
    bed, state = layer
    bed.restore(state)
    whole, rest = bed.grains().as_dict(), bed.grains(contacts=False).as_dict()
    assert set(whole) - set(rest) == {"coordination"}
    assert all(np.array_equal(rest[name], whole[name]) for name in rest)


def skimmed(steps, *, wide=0.05, cut=None):
    """A ball skims a layer of 840 grains, 0.84 m long, that sleeps but below it; the bed, and where sleepers began.

    Far above goes another, `wide` its radius [m]: where that is as wide as the bed is long no place along it is told
    from another, and sleepers keep to the curve's own order. `cut`: steps after which a state is taken, and put back
    later on.
    """
    i, j = (a.ravel() for a in np.meshgrid(np.arange(210), np.arange(4)))
    bed = Bed.from_grains(
        STUFF, positions=np.column_stack([(i + 0.5) * D, (j + 0.5) * D, np.full(i.size, 0.5 * D)]),
        radii=np.full(i.size, 0.5 * D), size=(210 * D, 4 * D, 0.02), height=0.05, max_overlap=0.1, threads=2,
    )  # fmt: skip
    bed.advance(200, drag_time=2e-3)
    ball = bed.add_body(Ball(radius=5e-3), position=(0.05, 0.006, D + 5e-3 - 2e-5))
    bed.move_body(ball, velocity=(10.0, 0.0, 0.0))
    above = bed.add_body(Ball(radius=wide), position=(0.05, 0.006, 3.0))
    bed.move_body(above, velocity=(10.0, 0.0, 0.0))
    bed.let_sleep(Sleep(every=48, calm=0.05, settling=1))
    begins, done, state = set(), 0, None
    while done < steps:
        bed.advance(100)
        done += 100
        begins.add(int(bed.engine.rest.begins[None]))
        if done == cut:
            state = bed.state()
        if state is not None and done == cut + 300:
            bed.restore(state)
            done, state = cut, None
    return bed, begins


@pytest.mark.long
def test_where_sleepers_begin_in_memory_changes_no_bit_of_what_the_grains_do():
    """It follows the ball; grains wake, are dragged and fall asleep the same, gone on with from a state too."""
    steps = 6000
    bed, begins = skimmed(steps)
    count, found, kept = bed.awake_count, bed.grains(), bed.state()
    assert 0 < count < 400 and len(begins) > 2
    assert np.ptp(found.displacement[:, 0]) > 1e-5 and bed.list_count > 100
    plain, unturned = skimmed(steps, wide=0.5)
    assert unturned == {0} and plain.awake_count == count
    for name, values in plain.grains().as_dict().items():
        assert values.tobytes() == found.as_dict()[name].tobytes(), name
    again, _ = skimmed(steps, cut=3000)
    assert {name: values.tobytes() for name, values in again.state().items()} == {
        name: values.tobytes() for name, values in kept.items()
    }


@pytest.mark.long
def test_sleepers_that_lists_pass_over_are_where_sorting_all_would_put_them(monkeypatch):
    """With all grains sorted every time the state has the same bits, and else those far behind are left out."""
    sorted_ones = []

    def counted(self):
        recount(self)
        sorted_ones.append(int(self.bed.engine.count[Lists.SORTED]))

    def all_of_them(self):
        self.bed.engine.rest.whole[None] = 1
        counted(self)

    steps, recount = 3000, Sleeper.recount
    monkeypatch.setattr(Sleeper, "recount", counted)
    found, _ = skimmed(steps, cut=1500)
    left_out = np.array(sorted_ones) < found.grain_count
    assert 0.3 < left_out.mean() < 1 and min(sorted_ones) < 0.5 * found.grain_count
    state, sorted_ones = found.state(), []
    monkeypatch.setattr(Sleeper, "recount", all_of_them)
    plain, _ = skimmed(steps, cut=1500)
    assert set(sorted_ones) == {plain.grain_count}
    assert {name: values.tobytes() for name, values in plain.state().items()} == {
        name: values.tobytes() for name, values in state.items()
    }


def test_lists_that_were_interrupted_leave_nobody_behind_who_was_woken(layer, monkeypatch):
    """Ctrl-C between the waking and the sorting: the next lists sort those who were woken before it too."""
    bed, state = layer
    bed.restore(state)
    bed.let_sleep(Sleep(every=48, calm=0.1, settling=1))
    bed.advance(1200)
    assert 0 < bed.awake_count < 0.5 * bed.grain_count and bed.engine.rest.whole[None] == 0

    def interrupted(*_):
        raise KeyboardInterrupt

    bed.engine.rest.woken[int(np.flatnonzero(bed.asleep)[-1])] = 1
    with monkeypatch.context() as patch:
        patch.setattr(bed.engine, "sort", interrupted)
        with pytest.raises(KeyboardInterrupt):
            bed.make_lists(anew=False, stirred=True)
    bed.make_lists(anew=False, stirred=True)
    assert bed.awake_count == int((~bed.asleep).sum())
