"""Bad input is refused in a sentence; what fails on the way is found, said, and can still be saved."""

import gc
import math
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from dem import Ball, Bed, BedFailure, Cylinder, Material, Plane
from dem.engine import runtime
from hedgebed_taichi import ti

STUFF = Material("grain", 2600, 1e7, 0.25, 0.5, 0.6)
RADIUS = 0.002
POSITIONS = np.array([[0.01, 0.01, RADIUS], [0.03, 0.03, RADIUS], [0.02, 0.01, 0.03]])
GIVEN = {"positions": POSITIONS, "radii": np.full(3, RADIUS), "size": (0.04, 0.04, 0.04), "height": 0.06}


UPWARDS = np.array([[0, 0, 0], [0.3, 0, 30.0], [0, 0, 0]])


def make(material=STUFF, **options):
    return Bed.from_grains(material, **GIVEN | options)


def with_nan(row):
    return np.where(np.arange(3)[:, None] == row, math.nan, POSITIONS)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"positions": with_nan(1)}, "positions holds a number that is not finite, in row 1"),
        ({"positions": POSITIONS[:2]}, r"positions has shape \(2, 3\), \(3, 3\) was expected"),
        ({"velocities": with_nan(2)}, "velocities holds a number that is not finite, in row 2"),
        ({"spins": np.zeros(3)}, r"spins has shape \(3,\)"),
        ({"radii": np.array([1e-3, -1e-3, 1e-3])}, "radii must be positive"),
        ({"radii": np.array([1e-3, math.inf, 1e-3])}, "radii holds a number that is not finite, in row 1"),
        ({"radii": np.zeros(0), "positions": np.zeros((0, 3))}, "at least one grain"),
        ({"size": (0.04, -0.04, 0.04)}, r"size = \(0.04, -0.04, 0.04\) must be three positive lengths"),
        ({"size": (0.04, 0.04)}, r"size = .* must be three positive lengths"),
        ({"size": (0.04, 0.013, 0.04)}, "the bed is 0.013 m across, less than three grains"),
        ({"height": 0.031}, "height = 0.031 m is no length, or below the highest grain's top at 0.032 m"),
        ({"height": math.nan}, "height = nan"),
        ({"max_overlap": 0.0}, "max_overlap = 0.0"),
        ({"gravity": -9.81}, "gravity = -9.81 must be 0 or more"),
        ({"gravity": (0.0, 0.0)}, r"gravity = \(0.0, 0.0\)"),
        ({"gravity": math.nan}, "gravity = nan"),
        ({"young": -1e7}, "young = -10000000.0 must be positive"),
        ({"time_step": 1e-2}, "time_step = 0.01 s is outside"),
        (
            {"positions": POSITIONS + [[0, 0, 0], [-0.0171, -0.02, 0], [0, 0, 0]]},
            r"positions: grain 1 begins in overlap with grain 0 by 27.5 % of a diameter, max_overlap = 0.05 allows "
            r"5 %; move it away, or take a larger max_overlap \(0.2 at most\)",
        ),
        ({"positions": POSITIONS[[1, 1, 2]]}, "grain 1 begins in overlap with grain 0 by 100 %"),
        ({"positions": POSITIONS + [0, 0, -0.003]}, "grain 0 begins in overlap with the floor by 75 %"),
        ({"positions": POSITIONS + [0, 0, -0.03]}, r"grain 0 begins at z = -0\.028 m, below the box.* put it higher"),
        ({"precision": "double"}, "precision = 'double' is unknown; use one of float64, float32"),
        ({"material": "sandy"}, r"material = 'sandy' is not known.*did you mean 'sand'"),
    ],
)
def test_a_bed_that_cannot_be_is_refused(options, words):
    with pytest.raises(ValueError, match=words):
        make(**options)


def test_grains_may_begin_in_overlap_up_to_the_bound():
    """10 % of a diameter, where the bound is 5 % and 20 %; across the sides as anywhere."""
    close = POSITIONS.copy()
    close[0], close[1] = (0.0002, 0.01, RADIUS), (0.0366 + 0.04, 0.01, RADIUS)
    with pytest.raises(ValueError, match="grain 1 begins in overlap with grain 0 by 10 % of a diameter"):
        make(positions=close)
    bed = make(positions=close, max_overlap=0.2, gravity=0.0)
    assert bed.max_overlap == pytest.approx(0.1)
    bed.advance(10)


@pytest.mark.parametrize(
    ("shape", "options", "words"),
    [
        ([], {}, "shape is empty"),
        ([Ball(radius=0.005)], {"position": (0.01, math.nan, 0.05)}, "position = .* must be 3 finite numbers"),
        ([Ball(radius=0.005)], {"position": (0.01, 0.05)}, "position = .* must be 3 finite numbers"),
        ([Ball(radius=0.005)], {"friction": -1.0}, "friction = -1.0"),
        ([Ball(radius=0.005)], {"restitution": 1.5}, "restitution = 1.5 must lie between"),
        ([Ball(radius=0.005)], {"rolling_friction": 0.3}, "leaves out, .* no rolling friction; give the grains 1e-09"),
        ([Ball(radius=0.005)] * 65, {}, "at most 32 bodies of 64 primitives"),
    ],
)
def test_a_body_that_cannot_be_is_refused(shape, options, words):
    bed = make()
    with pytest.raises(ValueError, match=words):
        bed.add_body(shape, **{"position": (0.01, 0.03, 0.05)} | options)
    assert bed.add_body([Ball(radius=0.002)], position=(0.01, 0.03, 0.05)) == 1


def test_a_body_in_overlap_is_refused_and_leaves_no_trace():
    """The bed goes on as if it had not been asked."""

    def motion(ask):
        bed = make()
        bed.advance(2000)
        assert bed.contact_counts().sum() > 0
        kept = bed.max_overlap
        if ask:
            with pytest.raises(
                ValueError, match=r"starts in overlap with a grain by .* % of its diameter .*start it higher"
            ):
                bed.add_body([Cylinder(-0.001, 0.02, 0.005)], position=(0.01, 0.01, 0.004))
            assert bed.max_overlap == kept
            with pytest.raises(ValueError, match="body = 1: there is no such body"):
                bed.reaction(1)
        bed.advance(1000)
        return bed.grains().as_dict()

    a, b = motion(ask=False), motion(ask=True)
    for name in ("position", "velocity", "spin"):
        assert np.abs(a[name] - b[name]).max() <= 1e-12 * max(1e-3, np.abs(a[name]).max())


def test_moving_a_body_that_is_not_there_or_to_nowhere_is_refused():
    bed = make()
    with pytest.raises(ValueError, match="body = 3: there is no such body"):
        bed.move_body(3, velocity=(0, 0, 0))
    with pytest.raises(ValueError, match=r"velocity = .* must be 3 finite numbers"):
        bed.move_body(0, velocity=(0, 0, math.nan))
    with pytest.raises(ValueError, match=r"turn = .* must be 4 finite numbers"):
        bed.move_body(0, turn=(1, 0, 0))
    for turn in ((0, 0, 0, 0), (2, 0, 0, 0)):
        with pytest.raises(ValueError, match=r"turn = .* must be of length 1 \(a unit quaternion"):
            bed.move_body(0, turn=turn)
    still = np.zeros((1, 3))
    with pytest.raises(ValueError, match=r"turns = \(0.0, 0.0, 0.0, 0.0\) must be of length 1"):
        bed.move_bodies([0], positions=still, velocities=still, turns=np.zeros((1, 4)), spins=still)
    with pytest.raises(ValueError, match="drag_time"):
        bed.advance(10, drag_time=0.0)


@pytest.mark.parametrize("steps", [1e-3, math.nan, -1, True, "10"])
def test_steps_that_are_no_whole_number_are_refused(steps):
    """A time in seconds among them, for which nothing was done, and nothing said, until 2026-11-23."""
    bed = make()
    with pytest.raises(ValueError, match=r"steps = .* must be a whole number of time steps of .* s, 0 or more; round"):
        bed.advance(steps)
    bed.advance(np.int64(2))
    assert bed.steps == 2


def test_many_bodies_are_told_apart():
    """32 bodies, the floor among them; one more is refused. Moved at once they go where each is told."""
    bed = make(gravity=0.0)
    bodies = [bed.add_body([Ball(radius=0.002)], position=(0.001 * k, 0.02, 0.05)) for k in range(31)]
    assert bodies == list(range(1, 32))
    for k in bodies:
        assert bed.body_position(k) == pytest.approx((0.001 * (k - 1), 0.02, 0.05))
    with pytest.raises(ValueError, match="at most 32 bodies"):
        bed.add_body([Plane()], position=(0, 0, -1))
    places = np.random.default_rng(1).uniform(0.06, 0.07, (2, 3))
    how = {"velocities": np.ones((2, 3)), "turns": np.tile([0.6, 0.0, 0.8, 0.0], (2, 1)), "spins": np.zeros((2, 3))}
    bed.move_bodies([31, 4], positions=places, **how)
    assert np.array_equal([bed.body_position(31), bed.body_position(4)], places)
    assert np.array_equal(bed.body_turn(4), how["turns"][0]) and bed.body_turn(5)[0] == 1
    with pytest.raises(ValueError, match="turns has shape"):
        bed.move_bodies([3], positions=places[:1], velocities=places[:1], turns=places[:1], spins=places[:1])


# ---------------------------------------------------------------------------- on the way


def test_a_lost_grain_is_named_and_the_state_can_be_saved(tmp_path):
    bed = make(velocities=UPWARDS, gravity=0.0)
    sound = bed.state()
    bed.advance(50)
    after = bed.state()
    with pytest.raises(BedFailure) as caught:
        bed.advance(1000)
    said = r"grain 1 left the box \(1 in all\) at t = .* s: it is at \(.*\) m"
    assert re.match(said, caught.value.reason) and caught.value.reason == str(caught.value)
    found = bed.grains().position
    assert found[1, 2] > 0.06
    kept, steps = bed.save(tmp_path / "lost.npz"), bed.steps
    # The bed itself can go back to a sound state and on from there, to the same bits.
    bed.restore(sound)
    bed.advance(50)
    for name, values in bed.state().items():
        assert values.tobytes() == after[name].tobytes(), name
    del bed, caught
    gc.collect()
    again = Bed.load(kept)
    assert again.steps == steps > 50
    assert (again.grains().position == found).all()


def test_a_grain_that_falls_through_is_lost_below():
    bed = make(floor=False, velocities=np.tile([0.0, 0.0, -5.0], (3, 1)))
    with pytest.raises(BedFailure, match=r"left the box \(\d in all\).*, -0\.\d+\) m, the box reaches from -0\.008 "):
        bed.advance(10_000)


@pytest.mark.parametrize("what", ["velocity", "spin", "position"])
def test_a_number_that_is_none_is_found(what, tmp_path):
    """In a velocity, a position, or a spin that a contact hands on; the file of the state is whole."""
    bed = make()
    bed.advance(100)  # the lower two lie on the floor
    assert (bed.contact_counts() > 0).sum() >= 2
    state = bed.state()
    row = int(np.flatnonzero(state["id"] == 1)[0])
    state[what][row, 0] = math.nan
    bed.restore(state)
    with pytest.raises(BedFailure, match="the position of grain 1 is not a number at t ="):
        bed.advance(2000)
    with np.load(bed.save(tmp_path / "bed.npz")) as file:
        assert np.isnan(file["state.position"]).any()


def test_an_overlap_past_its_bound_stops_the_bed(tmp_path):
    bed = make(max_overlap=0.01, velocities=np.tile([0.0, 0.0, -3.0], (3, 1)), time_step=1e-6)
    with pytest.raises(BedFailure, match=r"an overlap of .* % of a diameter went past its bound of 1 % at t = "):
        bed.advance(5000)
    assert bed.max_overlap > 0.01
    again = Bed.load(bed.save(tmp_path / "bed.npz"))
    assert again.max_overlap == bed.max_overlap and again.overlap_limit == 0.01


def prepare(**options):
    return Bed.prepare("sand", size=(0.02, 0.02, 0.02), grain=2e-3, **options)


@pytest.mark.cpu_only("a machine without a GPU")
@pytest.mark.parametrize("start", [make, prepare])
def test_a_gpu_that_is_not_there_is_refused_and_beds_on_the_cpu_go_on(start, monkeypatch):
    bed = make()
    monkeypatch.setattr(ti.lang.misc, "is_arch_supported", lambda arch: False)
    with pytest.raises(RuntimeError, match=r"arch = 'cuda'.*no NVIDIA GPU.*arch = 'cpu'"):
        start(arch="cuda")
    bed.advance(2)
    assert bed.steps == 2


def test_a_bed_of_an_earlier_taichi_refuses_to_go_on(monkeypatch, tmp_path):
    bed = make()
    monkeypatch.setattr(runtime, "_generation", runtime.generation() + 1)
    for call in (lambda: bed.advance(1), bed.grains, bed.state, lambda: bed.save(tmp_path / "bed.npz")):
        with pytest.raises(RuntimeError, match="no longer valid"):
            call()


COLLISION = """
import numpy as np
from dem import Bed, Material
def collide(precision):
    bed = Bed.from_grains(
        Material("grain", 2600, 1e7, 0.25, 0.3, 0.7, 0.1), precision=precision, gravity=0.0, floor=False,
        positions=np.array([[0.010, 0.010, 0.01], [0.0141, 0.0105, 0.01]]), radii=np.full(2, 0.002),
        velocities=np.array([[0.5, 0, 0], [-0.5, 0, 0]]), spins=np.array([[0, 0, 50.0], [20.0, 0, 0]]),
        size=(0.03, 0.03, 0.02), height=0.045, time_step=5e-6)
    bed.advance(400)
    assert bed.max_overlap > 0.005
    assert bed.state()["position"].dtype == precision
    grains = bed.grains()
    return np.concatenate([grains.velocity, grains.spin * 0.002, [grains.mass @ grains.velocity]])
"""


@pytest.mark.long
def test_float32_agrees_with_float64_on_a_collision():
    """To 1e-4 of its speed; in a process of its own, as another precision starts Taichi anew."""
    root = Path(__file__).resolve().parents[3]
    script = COLLISION + "print(*collide('float32').ravel())"
    done = subprocess.run([sys.executable, "-c", script], cwd=root, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    single = np.array(done.stdout.split(), dtype=float).reshape(5, 3)  # and Taichi greets nobody
    here: dict = {}
    exec(COLLISION, here)
    double = here["collide"]("float64")
    assert abs(double[0, 0] - 0.5) > 0.3
    assert 0 < np.abs(single - double)[:4].max() < 1e-4
    mass = 2600 * 4 / 3 * math.pi * RADIUS**3
    assert np.abs(single[4]).max() < 1e-6 * mass and np.abs(double[4]).max() < 1e-15 * mass
