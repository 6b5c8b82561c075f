"""Lists, chunks, periodic images and history against a plain double loop; layouts and skins agree."""

from dataclasses import replace

import engine_pool
import falling_bed
import numpy as np
import pytest
from naive_bed import NaiveBed

import dem.engine.engine
from dem import Bed, BedFailure
from dem.contact.law import damping_factor
from experiments.validate.base import cloud

STEPS = 30
LAYOUTS = [
    pytest.param("one chunk", marks=pytest.mark.cpu_only("chunks")),
    pytest.param("seven chunks", marks=pytest.mark.cpu_only("chunks")),
    "grain chunks",
]


@pytest.fixture(params=LAYOUTS)
def layout(request, engines, monkeypatch):
    if request.param == "seven chunks":
        monkeypatch.setattr(dem.engine.engine, "GRAINS_PER_CHUNK", 9)
    elif request.param == "grain chunks":
        engines.overrides = {"gpu": True, "neighbours_per_grain": 30}
    return request.param


STUFF = replace(cloud.STUFF, tangential="displacement")  # the springs of ``NaiveBed``
COHESIVE = {
    "none": STUFF,
    "dmt": replace(STUFF, cohesion="dmt", surface_energy=5.0),
    "jkr": replace(STUFF, cohesion="jkr", surface_energy=5.0),
}
"""Laws of cohesion; at this surface energy JKR's range is 0.6 % of a diameter."""


def computed(material):
    """The cloud and its ball after thirty steps of the plain loop."""
    positions, radii, velocities, spins = cloud.initial()
    ball = {name: np.array(value, dtype=float) for name, value in cloud.BALL.items()}
    naive = NaiveBed(
        material,
        positions,
        radii,
        velocities,
        spins,
        cloud.PERIOD,
        np.array([0.0, 0.0, -9.81]),
        cloud.STEP,
        damping_factor(cloud.STUFF.restitution),
        ball,
    )
    naive.first = naive.f.copy()
    naive.advance(STEPS)
    return naive


@pytest.fixture(scope="module")
def reference():
    return computed(STUFF)


def test_forces_and_motion_are_those_of_a_plain_double_loop(layout, reference):
    """Forces of the first instant, and everything after thirty steps, to round-off; the reaction on the ball too."""
    bed = cloud.make(ball=True, material=STUFF)
    assert bed.engine.chunk_count == {"one chunk": 1, "seven chunks": 7, "grain chunks": 64}[layout]
    assert bed.engine.nx == 3
    assert bed.coordination_number > 3
    agrees(bed, reference)


@pytest.mark.long
@pytest.mark.parametrize("cohesion", ["dmt", "jkr"])
def test_forces_of_cohesive_grains_are_those_of_a_plain_double_loop(cohesion, monkeypatch):
    """In seven chunks; JKR's equation for the contact radius is solved by bisection there."""
    monkeypatch.setattr(dem.engine.engine, "GRAINS_PER_CHUNK", 9)
    bed = cloud.make(ball=True, material=COHESIVE[cohesion])
    assert bed.coordination_number > 3
    agrees(bed, computed(COHESIVE[cohesion]))


def agrees(bed, reference):
    first = bed.grains()
    assert np.abs(first.force - reference.first).max() <= 1e-11 * np.abs(reference.first).max()
    bed.advance(STEPS - 1)
    bed.advance(1)
    grains = bed.grains()
    half = 0.5 * cloud.STEP
    wanted = {
        "displacement": reference.x - cloud.initial()[0],
        "force": reference.f,
        "velocity": reference.v + half * reference.f / reference.m[:, None],
        "spin": reference.w + half * reference.t / reference.inertia[:, None],
    }
    for name, value in wanted.items():
        assert np.abs(getattr(grains, name) - value).max() <= 1e-10 * np.abs(value).max(), name
    force, torque = bed.reaction(1)
    assert np.linalg.norm(force) > 1e-3
    assert force == pytest.approx(reference.on_ball, rel=1e-9, abs=1e-12)
    assert torque == pytest.approx(reference.torque_on_ball, rel=1e-9, abs=1e-14)
    assert bed.reaction(0)[0] == pytest.approx(reference.on_floor, rel=1e-9)
    assert bed.floor_force == pytest.approx(-reference.on_floor[2], rel=1e-9)
    counts = np.zeros(64, dtype=int)
    for pair in reference.history:
        for end in pair:
            if not isinstance(end, str):
                counts[end] += 1
    assert (bed.contact_counts() == counts).all()


@pytest.mark.long
def test_other_skins_give_the_same_motion(monkeypatch):
    """New lists at every few steps, or hardly ever: the same to round-off."""
    results, made = [], []
    monkeypatch.setattr(Bed, "adapt_skin", lambda self: None)
    for skin in (0.0005, 0.02, 0.15):
        monkeypatch.setattr("dem.engine.base._SKIN", skin)
        bed = cloud.make()
        bed.advance(400)
        results.append(bed.grains().as_dict())
        made.append(bed.list_count)
        del bed  # its engine serves the next
    assert made[0] > 100 and made[0] > 5 * made[1] > 5 * made[2]
    for other in results[1:]:
        for name in ("displacement", "velocity", "spin", "force"):
            assert np.abs(other[name] - results[0][name]).max() <= 1e-8 * np.abs(results[0][name]).max(), name


def test_a_shift_of_the_origin_changes_nothing():
    """Periodic: grains and ball moved by a part of a period, so that they lie across other boundaries."""

    def motion(shift):
        bed = cloud.make(ball=True, shift=shift)
        bed.advance(100)
        return bed.grains().as_dict(), bed.reaction(1)

    (a, on_ball), (b, on_moved_ball) = motion((0.0, 0.0, 0.0)), motion((0.0091, -0.0043, 0.0))
    for name in ("displacement", "velocity", "spin", "force"):
        assert np.abs(a[name] - b[name]).max() <= 1e-9 * np.abs(a[name]).max(), name
    for before, after in zip(on_ball, on_moved_ball, strict=True):
        assert after == pytest.approx(before, rel=1e-9, abs=1e-12)
    assert (b["position"][:, :2] >= 0).all() and (b["position"][:, :2] <= cloud.PERIOD[0]).all()


PACKED = {"neighbours_per_grain": -3.9, "near_per_grain": -3.99}  # a GPU's lists begin with 4,096 rows beside these
IN_CHUNKS = {"neighbours_per_grain": -0.45, "near_per_grain": -0.48}  # of what all chunks have
ON_CPU = engine_pool.ARCH == "cpu"


@pytest.fixture
def little_room(engines, monkeypatch):
    """Beds begin with room for a few rows a chunk, and no bed has grown before."""
    monkeypatch.setattr(dem.engine.engine, "_grown", {})
    engines.overrides = dict(IN_CHUNKS if ON_CPU else PACKED)


@pytest.mark.long
@pytest.mark.parametrize("layout", [{}, {"gpu": True, **PACKED}])
def test_lists_that_are_too_small_grow_to_the_same_bits(little_room, engines, layout):
    """In chunks and packed, as on a GPU; and the next bed begins with the room that this one needed."""
    engines.overrides |= layout
    small = cloud.make(ball=True)
    room = small.engine.chunk_room
    small.advance(120)
    found = small.state()
    del small
    assert cloud.make().engine.chunk_room == room
    engines.overrides = {"gpu": True} if layout else {}
    large = cloud.make(ball=True)
    assert room < large.engine.chunk_room
    large.advance(120)
    wanted = large.state()
    assert all(np.array_equal(found[name], wanted[name]) for name in wanted)


def test_a_machine_without_memory_for_larger_lists_says_how_much_they_need(little_room, monkeypatch):
    monkeypatch.setattr(dem.engine.engine, "_free", {})
    answers = iter([None])  # what is free is unknown for the first engine; then it is a kilobyte
    monkeypatch.setattr("dem.engine.runtime.free_memory", lambda: next(answers, 1024))
    with pytest.raises(BedFailure, match=r"hold \d+ pairs.* \d+ and \d+ are needed.* GiB of memory"):
        cloud.make()


def test_more_grains_than_there_is_memory_for_are_refused(engines, monkeypatch):
    engines.overrides = {"neighbours_per_grain": 77.0}  # an engine that nobody has
    monkeypatch.setattr("dem.engine.runtime.free_memory", lambda: 1024)
    with pytest.raises(ValueError, match=r"bed of 64 grains needs \S+ GiB of memory, \S+ GiB are free"):
        cloud.make()


@pytest.mark.long
@pytest.mark.parametrize(
    "options", [{}, pytest.param({"sleep": True}, marks=pytest.mark.cpu_only("sleep")), {"body": "solids"}]
)
def test_lists_that_grow_in_mid_run_carry_histories_checkpoints_and_files(options, engines, monkeypatch, tmp_path):
    """Eight chunks; with sleepers, and a mesh. Back to before they grew, on from a file into a bed with little room."""
    monkeypatch.setattr(dem.engine.engine, "_grown", {})
    monkeypatch.setattr(dem.engine.engine, "GRAINS_PER_CHUNK", falling_bed.GRAINS_PER_CHUNK)
    large = falling_bed.make(**options)
    for steps in (20, 280):  # a step's sums are those since the last call
        large.advance(steps)
    wanted = large.state()
    shares = (-0.25, -0.46) if ON_CPU else (-3.0, -3.97)  # enough for the first 20 steps
    engines.overrides = dict(zip(IN_CHUNKS, shares, strict=True))
    small = falling_bed.make(**options)
    engine = small.engine
    small.debug = True
    small.advance(20)
    kept = small.checkpoint()
    for _ in range(2):
        small.advance(280)
        assert small.engine is not engine
        found = small.state()
        # The mass asleep is summed by launches, and the debug mode has one a step.
        summed = [state.pop("sleep_reals", np.zeros(2)) for state in (found, dict(wanted))]
        assert summed[0] == pytest.approx(summed[1], rel=1e-12)
        assert [name for name in found if not np.array_equal(found[name], wanted[name])] == []
        small.rollback(kept)
    small.advance(280)
    path = small.save(tmp_path / "bed.npz")
    dem.engine.engine._grown.clear()
    again = Bed.load(path)
    small.advance(40)
    again.advance(40)
    found, wanted = again.state(), small.state()
    summed = [state.pop("sleep_reals", np.zeros(2)) for state in (found, wanted)]
    assert summed[0] == pytest.approx(summed[1], rel=1e-12)
    assert [name for name in wanted if not np.array_equal(found[name], wanted[name])] == []
