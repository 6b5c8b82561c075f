"""A bed laid end to end: as much at rest as its piece, its contacts in every copy and across the seams."""

import engine_pool
import numpy as np
import pytest

import dem.engine.engine
from dem import Ball, Bed, Material, Sleep
from dem.engine.lists import INDEX_MASK

STUFF = Material("grain", 2600, 1e7, 0.25, 0.5, 0.3, 0.1)
D = 4e-3
ROWS, COLUMNS, TIMES = 10, 6, 3


@pytest.fixture(scope="module")
def beds():
    """Two layers of unequal grains that have come to rest, and the same three times; of one size of engine."""
    kept, dem.engine.engine.GRAINS_PER_CHUNK = dem.engine.engine.GRAINS_PER_CHUNK, 60
    rng = np.random.default_rng(3)
    i, j = (a.ravel() for a in np.meshgrid(np.arange(ROWS), np.arange(COLUMNS)))
    low = np.column_stack([(i + 0.5) * D, (j + 0.5) * D, np.full(i.size, 0.5 * D)])
    high = low + [0.5 * D, 0.5 * D, 0.8 * D]
    piece = Bed.from_grains(
        STUFF, positions=np.concatenate([low, high]), radii=0.5 * D * rng.uniform(0.85, 1.0, 2 * i.size),
        size=(ROWS * D, COLUMNS * D, 0.02), height=0.07, max_overlap=0.1, threads=1,
    )  # fmt: skip
    piece.advance(3000, drag_time=5e-3)
    piece.advance(1000)
    piece.make_lists()  # puts grains that have gone over the sides back, as `repeated` does
    piece.compute_forces()
    piece.measure_surface()
    piece.recipe = {"seed": 3}
    long = piece.repeated(TIMES)
    dem.engine.engine.GRAINS_PER_CHUNK = kept
    return piece, piece.state(), long, long.state()


@pytest.fixture
def pair(beds):
    """Both as they were in the beginning."""
    piece, of_piece, long, of_long = beds
    piece.restore(of_piece)
    long.restore(of_long)
    return piece, long


def contacts(bed):
    """Touching pairs once, the smaller id first: ids, and what slid and rolled, as seen from that one [m, rad]."""
    state = bed.state()
    touches = state["pair"] < 0
    first = state["id"][np.repeat(np.arange(len(state["id"])), state["pair_count"])[touches]]
    second = state["id"][~state["pair"][touches].astype(np.int64) & INDEX_MASK]
    history = np.hstack([state["slide"][:, :3], state["roll"]])
    once = first < second  # the others are listed by another chunk too, or from the other side
    found = dict(zip(zip(second[~once], first[~once], strict=True), -history[~once], strict=True))
    return found | dict(zip(zip(first[once], second[once], strict=True), history[once], strict=True))


def same_in_every_copy(piece, long, *, within):
    """Forces, relative to a grain's weight, and speeds, relative to a fall from its height."""
    own, found = piece.grains(), long.grains()
    weight = own.mass.mean() * 9.81
    for name, scale in (("force", weight), ("velocity", np.sqrt(9.81 * D)), ("spin", np.sqrt(9.81 / D))):
        copies = found[name].reshape(TIMES, piece.grain_count, 3)
        assert np.abs(copies - own[name]).max() < within * scale, name
    assert np.array_equal(found.coordination, np.tile(own.coordination, TIMES))
    return own, found


@pytest.mark.long
def test_it_has_the_grains_of_its_piece_in_every_copy_one_length_further(pair):
    piece, long = pair
    own, found = same_in_every_copy(piece, long, within=1e-12)
    assert long.grain_count == TIMES * piece.grain_count and long.weight == pytest.approx(TIMES * piece.weight)
    assert long.size == (TIMES * piece.size[0], *piece.size[1:])
    copies = found.position.reshape(TIMES, -1, 3) - own.position
    assert np.allclose(copies[..., 1:], 0, atol=1e-15)
    along = copies[..., 0] - piece.size[0] * np.arange(TIMES)[:, None]
    assert np.allclose(along - long.size[0] * np.round(along / long.size[0]), 0, atol=1e-15)
    assert np.array_equal(found.radius, np.tile(own.radius, TIMES))
    assert (long.surface, long.packing_fraction) == (piece.surface, piece.packing_fraction)
    long.measure_surface()
    assert (long.surface, long.packing_fraction) == pytest.approx((piece.surface, piece.packing_fraction), rel=1e-12)
    assert long.kinetic_energy == pytest.approx(TIMES * piece.kinetic_energy, rel=1e-12)
    assert (long.time, long.time_step, long.gravity) == (0.0, piece.time_step, piece.gravity)
    assert long.material == piece.material and long.recipe == {"seed": 3, "repeats": TIMES}


@pytest.mark.long
def test_contacts_keep_their_history_within_copies_and_across_the_seams(pair):
    piece, long = pair
    n = piece.grain_count
    own, found = contacts(piece), contacts(long)
    x = piece.grains().position[:, 0]
    wanted, across = {}, 0
    for (i, j), history in own.items():
        ahead = int(np.round((x[i] - x[j]) / piece.size[0]))  # the nearest image of j is so many copies on
        across += ahead != 0
        for k in range(TIMES):
            a, b = i + n * k, j + n * ((k + ahead) % TIMES)
            wanted[min(a, b), max(a, b)] = history if a < b else -history
    assert across >= COLUMNS and max(np.abs(history[:3]).max() for history in own.values()) > 1e-9
    assert found.keys() == wanted.keys()
    # On a GPU both sides of a pair keep a history, and their last bits differ.
    within = 0.0 if engine_pool.ARCH == "cpu" else 1e-9
    assert all(np.allclose(found[key], wanted[key], rtol=within, atol=within * 1e-6) for key in wanted)


@pytest.mark.long
def test_copies_at_rest_stay_at_rest_as_their_piece_does(pair):
    piece, long = pair
    assert piece.kinetic_energy < 1e-4 * piece.weight * D
    for bed in pair:
        bed.advance(1000)
    assert long.kinetic_energy == pytest.approx(TIMES * piece.kinetic_energy, rel=1e-6)
    assert long.floor_force == pytest.approx(TIMES * piece.floor_force, rel=1e-9)
    same_in_every_copy(piece, long, within=1e-8)


@pytest.mark.long
@pytest.mark.cpu_only("sleep")
def test_copies_that_nothing_reaches_sleep(pair):
    """A ball goes into the middle one of three."""
    piece, long = pair
    long.let_sleep(Sleep(every=48, calm=0.3, settling=1, change=0.2, still=2e-3))
    top = long.grains().position[:, 2].max() + 0.5 * D
    ball = long.add_body(Ball(radius=2.5e-3), position=(1.5 * piece.size[0], 0.012, top + 2.5e-3))
    long.advance(1200)
    long.move_body(ball, velocity=(0.0, 0.0, -1e-3 / (1000 * long.time_step)))
    for _ in range(20):
        long.advance(50)
        asleep = long.asleep.reshape(TIMES, -1).mean(axis=1)
        assert min(asleep[0], asleep[2]) > max(0.4, 2 * asleep[1])
    assert long.reaction(ball)[0][2] > 5 * long.weight / long.grain_count


@pytest.mark.long
def test_in_a_higher_box_the_grains_are_as_they_were_and_what_flies_up_comes_back(pair):
    piece, _ = pair
    higher = piece.repeated(1, height=0.2)
    assert (piece.height, higher.height) == (0.07, 0.2) and piece.repeated(1, height=0.01).height == 0.07
    own, found = piece.grains(), higher.grains()
    for name in ("position", "velocity", "spin"):
        assert (own[name] == found[name]).all(), name
    assert len(contacts(higher)) == len(contacts(piece))
    # One of the top layer is kicked to well over the first box.
    state = higher.state()
    top = int(state["position"][:, 2].argmax())
    state["velocity"][top, :3] = [0.0, 0.0, 1.5]
    higher.restore(state)
    fly = round(0.15 / higher.time_step)
    higher.advance(fly)
    peak = higher.grains().position[:, 2].max()
    assert peak > 0.1  # v^2 / 2 g = 115 mm over where it lay
    higher.advance(fly)
    assert higher.grains().position[:, 2].max() < 0.05


@pytest.mark.long
def test_what_cannot_be_repeated_is_refused_by_name(pair):
    piece, _ = pair
    for times in (0, -1, 1.5, True):
        with pytest.raises(ValueError, match=f"times = {times} must be a whole number, 1 or more"):
            piece.repeated(times)
    with pytest.raises(ValueError, match="height = inf must be a length"):
        piece.repeated(1, height=float("inf"))
    piece.add_body(Ball(radius=5e-3), position=(0.02, 0.012, 0.03))
    with pytest.raises(ValueError, match="1 bodies beside the floor: a bed is repeated without them"):
        piece.repeated(2)
