"""The check of all lists (``dem.engine.checking``) finds what is wrong with them, and nothing in right ones."""

from dataclasses import replace

import falling_bed
import numpy as np
import pytest

import dem.engine.checking
import dem.engine.engine
from dem import BedFailure
from dem.engine.lists import INDEX_BITS, INDEX_MASK
from experiments.validate.base import cloud

CHUNKS = pytest.mark.cpu_only("chunks")


@pytest.fixture(
    params=[
        pytest.param("one chunk", marks=[CHUNKS, pytest.mark.long]),
        pytest.param("seven chunks", marks=CHUNKS),
        pytest.param("grain chunks", marks=pytest.mark.long),
    ]
)
def layout(request, engines, monkeypatch):
    if request.param == "seven chunks":
        monkeypatch.setattr(dem.engine.engine, "GRAINS_PER_CHUNK", 9)
    elif request.param == "grain chunks":
        engines.overrides = {"gpu": True, "neighbours_per_grain": 30.0, "near_per_grain": 2.0}
    return request.param


@pytest.fixture
def checked(layout, monkeypatch):
    """A cloud with a ball in it, whose lists are checked."""
    monkeypatch.setenv("HEDGEBED_DEBUG", "1")
    return cloud.make(ball=True)


def listed(bed):
    """Grain, row and neighbour's code of every pair listed."""
    counts, rows = bed.engine.listed_pairs()
    return np.repeat(np.arange(bed.grain_count), counts), rows, bed.engine.read("pair")[rows]


def touching_row(bed):
    """Grain and row of a pair in contact."""
    grain, rows, pair = listed(bed)
    k = np.flatnonzero(pair < 0)[0]
    return int(grain[k]), int(rows[k])


def test_right_lists_pass_and_a_check_changes_no_bit(checked):
    before = checked.list_count
    checked.advance(120)
    assert checked.list_count > before + 1
    other = cloud.make(ball=True)
    other.debug = False
    other.advance(120)
    found, wanted = checked.state(), other.state()
    assert all(np.array_equal(found[name], wanted[name]) for name in wanted)


@pytest.mark.long
def test_right_lists_of_grains_that_feel_one_another_before_they_touch_pass(monkeypatch):
    monkeypatch.setattr(dem.engine.engine, "GRAINS_PER_CHUNK", 9)
    monkeypatch.setenv("HEDGEBED_DEBUG", "1")
    bed = cloud.make(ball=True, material=replace(cloud.STUFF, cohesion="jkr", surface_energy=5.0))
    bed.advance(120)
    assert bed.list_count > 2


@pytest.mark.long
@pytest.mark.cpu_only("sleep")
def test_right_lists_of_a_bed_whose_grains_sleep_and_wake_pass(monkeypatch):
    """Contacts that a sleeper keeps count as its history."""
    monkeypatch.setenv("HEDGEBED_DEBUG", "1")
    monkeypatch.setattr(dem.engine.engine, "GRAINS_PER_CHUNK", falling_bed.GRAINS_PER_CHUNK)  # put back at the end
    bed = falling_bed.make(sleep=True)
    awake = set()
    for _ in range(40):
        bed.advance(10)
        awake.add(bed.awake_count)
    assert len(awake) > 10


@pytest.mark.parametrize("word", ["yes", "2"])
def test_a_wrong_word_for_the_check_is_refused(word, monkeypatch):
    monkeypatch.setenv("HEDGEBED_DEBUG", word)
    with pytest.raises(ValueError, match=f"HEDGEBED_DEBUG = '{word}'"):
        cloud.make()


def test_lists_that_are_not_made_anew_in_time_are_found(checked, monkeypatch):
    """Grains go as far as they like: one has soon gone past half the skin."""
    real = checked.engine.launch
    monkeypatch.setattr(
        checked.engine, "launch", lambda most, before, dt, limit, *rest: real(most, before, dt, 1e3 * limit, *rest)
    )
    with pytest.raises(BedFailure, match=r"step \d+: .*(grain|body) \d+ has gone \S+ m.* half the skin"):
        checked.advance(2000)


def test_a_pair_that_no_list_has_is_found_when_it_touches(checked, monkeypatch):
    """The same skipped lists, with nothing looked at but who touches whom."""
    monkeypatch.setattr(dem.engine.checking, "_check_age", lambda bed, state: None)
    real = checked.engine.launch
    monkeypatch.setattr(
        checked.engine, "launch", lambda most, before, dt, limit, *rest: real(most, before, dt, 1e3, *rest)
    )
    with pytest.raises(BedFailure, match=r"grains? \d+ and .*\d+.* touch and are not listed"):
        checked.advance(2000)


def test_a_dropped_pair_is_found(checked):
    e = checked.engine
    i, row = touching_row(checked)
    j = ~e.pair[row] & INDEX_MASK
    e.pair[row] = i | (e.pair[row] & ~INDEX_MASK & 0x7FFFFFFF)  # itself, where its neighbour was
    ids = e.read("id")
    with pytest.raises(BedFailure, match=rf"step 1: .*grains {ids[i]} and {ids[j]}\D.*not listed"):
        checked.advance(1)


def test_a_pair_listed_twice_is_found(checked):
    """A row overwritten by another of the same grain: one pair too few, one twice."""
    e = checked.engine
    grain, rows, pair = listed(checked)
    k = next(k for k in np.flatnonzero(pair < 0) if grain[k] == grain[k + 1])
    e.pair[rows[k + 1]] = e.pair[rows[k]]
    with pytest.raises(BedFailure, match=r"step 1: .*are listed 2 times"):
        checked.advance(1)


def test_a_pair_through_the_wrong_image_is_found(checked):
    e = checked.engine
    _, row = touching_row(checked)
    e.pair[row] = ~(~e.pair[row] & INDEX_MASK)  # image (-1, -1)
    assert ~e.pair[row] >> INDEX_BITS == 0
    with pytest.raises(BedFailure, match=r"step 1: .* and are not listed"):
        checked.advance(1)


def test_a_dropped_grain_at_a_body_is_found(checked):
    """Its row is given to another body."""
    e = checked.engine
    _, rows = e.listed_near()
    height, ids = e.read("position")[:, 2:], e.read("id")
    row = next(int(s) for s in rows if e.near_body[s] == 0 and height[e.near_grain[s], 0] < height[e.near_grain[s], 1])
    e.near_body[row] = 1
    with pytest.raises(BedFailure, match=rf"step 1: .*grain {ids[e.near_grain[row]]} and body 0 touch and are not"):
        checked.advance(1)


@pytest.mark.parametrize("part", ["slide", "near_slide"])
def test_a_history_that_does_not_come_over_is_found(checked, part, monkeypatch):
    checked.advance(5)
    e = checked.engine
    real = e.keep_lists

    def forgetful(*tables):
        real(*tables)
        getattr(e, f"old_{part}").fill(0)

    monkeypatch.setattr(e, "keep_lists", forgetful)
    with pytest.raises(BedFailure, match=r"step 5: the history of grain \d+ and (grain|body) \d+ is another"):
        checked.make_lists()
