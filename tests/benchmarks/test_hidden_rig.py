"""Made-up campaigns of a rig: the same for a seed, as strong as asked for, readable, and true to the closed forms."""

import math

import numpy as np
import pytest

from benchmarks.diagnose import digest
from benchmarks.hidden import rig as hidden_rig
from benchmarks.hidden.rig import EFFECTS, NUISANCES, OUTSIDE, make_rig
from benchmarks.hidden.rig_bed import LAWS, Bed, Law, draw_law, drive, drop, push
from benchmarks.hidden.suite import STRENGTHS, make_case, suite
from experiments.campaign import read_campaign, write_campaign
from experiments.diagnose.inspection import find_faults


def test_a_seed_gives_the_same_campaign_and_the_answer_is_not_in_it(tmp_path):
    (first, told), (again, _) = (make_rig(3, kind="layering", strength=8.0, trials=6) for _ in range(2))
    for key, recording in first.recordings.items():
        assert all(np.array_equal(recording[n], again.recordings[key][n], equal_nan=True) for n in recording.columns)
    assert told.effects == ("layering",)
    folder = write_campaign(tmp_path / "one", first)
    for file in folder.rglob("*"):
        assert not any(word in file.read_text(encoding="utf-8") for word in (*EFFECTS, *OUTSIDE, "layer"))


@pytest.mark.parametrize("kind", [*EFFECTS, *(name for name in OUTSIDE if name in LAWS), "pair"])
def test_what_is_hidden_comes_out_as_strong_as_it_was_asked_for(kind):
    """Within a quarter, where an amplitude can be had at all (a mass that is wrong by 6 % has none)."""
    _, told = make_rig(40 + len(kind), kind=kind, strength=6.0, trials=6)
    assert told.signature == pytest.approx(6.0, rel=0.25)


@pytest.mark.long
def test_a_null_holds_nothing_and_what_wanders_is_recorded_as_it_was_drawn():
    told = [make_rig(seed, kind="null", trials=8)[1] for seed in range(60)]
    assert all(one.effects == () and one.outside is None and one.signature == 0.0 for one in told)
    for name, share in NUISANCES.items():
        seen = sum(one.extra["nuisances"][name] > 0 for one in told) / len(told)
        assert abs(seen - share) < 4 * math.sqrt(share * (1 - share) / len(told))
    for one in told:
        drawn, wandering = np.array(one.extra["drawn"]), one.extra["nuisances"]
        assert (drawn[:, 0].std() > 0) == (wandering["bed"] > 0)
        assert (np.abs(drawn[:, 2]).max() > 0) == (wandering["force-zero"] > 0)
        assert (np.abs(drawn[:, 3]).max() > 0) == (wandering["depth-zero"] > 0)
        assert (max(one.extra["louder"].values()) > 1) == (wandering["loud"] > 0)


@pytest.mark.long
def test_what_the_truth_leaves_is_the_noise_as_stated_and_what_comes_beside_it():
    """1 a reading where nothing is wrong; 1.3^2 where all sensors are so much louder; a force zero adds its square."""
    seen = set()
    for seed in range(60):
        told = make_rig(seed, kind="null", trials=6)[1]
        extra, wandering = told.extra, told.extra["nuisances"]
        if extra["sensors"]["jitter"] or extra["sensors"]["coarse"] or told.coloured or told.depth_persistence:
            continue
        forces = [
            k for k, (total, count) in enumerate(extra["left"]) if extra["drawn"][k][2] or not wandering["force-zero"]
        ]
        for k in forces[: 6 - extra["design"]["drops"]]:
            zero = extra["drawn"][k][2] / extra["sensors"]["noise"]["force"]
            total, count = extra["left"][k]
            expected = extra["louder"]["force"] ** 2 + zero**2
            assert total / count == pytest.approx(expected, abs=6 * expected * math.sqrt(2 / count))
            seen.add((zero != 0, extra["louder"]["force"] > 1))
    assert len(seen) > 2


@pytest.mark.long
def test_what_no_data_could_tell_is_not_hidden():
    pairs = [set(make_rig(seed, kind="pair", strength=5.0, trials=6)[1].effects) for seed in range(8)]
    assert {"depth-hardening", "layering"} not in pairs and all(len(pair) == 2 for pair in pairs)
    masses = [make_rig(seed, kind="wrong-mass", trials=6)[1] for seed in range(8)]
    assert all(told.extra["nuisances"]["bed"] == 0.0 and told.extra["design"]["drops"] >= 2 for told in masses)


@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.long) for seed in range(1, 6))])
def test_campaigns_are_read_and_checked(tmp_path, seed):
    """Units by suffix, gaps, an accelerometer that was not fitted: nothing is refused, and depths agree in metres."""
    campaign, told = make_rig(seed, trials=6)
    written = read_campaign(write_campaign(tmp_path / "one", campaign))
    assert len(written.tables.trial) == told.trials == 6
    find_faults(written)
    for trial in written.tables.trial:
        depth = written.recording(trial.id, "data")["depth_m"]
        assert 1e-3 < np.nanmax(depth) < 0.2


def test_a_drop_is_the_damped_oscillation_of_the_base_model():
    """m z'' = m g - K z - C z' until it is deepest: z - m g / K decays with C / 2m at the damped frequency."""
    k, c, m, g, v = 900.0, 6.0, 0.4, 9.80665, 0.5
    made = drop(Bed(k, c), mass=m, gravity=g, speed=v, duration=0.05, rate=1000.0)
    decay, rest = 0.5 * c / m, m * g / k
    rate = math.sqrt(k / m - decay**2)
    t = made["time"]
    sine = (v - decay * rest) / rate
    exact = rest + np.exp(-decay * t) * (-rest * np.cos(rate * t) + sine * np.sin(rate * t))
    going = np.gradient(exact, t) > 0
    assert going.sum() > 30
    assert np.abs(made["depth"] - exact)[going].max() < 1e-7
    assert np.abs(made["other"] - (g - (k * exact + c * np.gradient(exact, t)) / m))[going][2:].max() < 0.01


def test_dry_friction_brings_a_drop_to_rest_and_holds_it():
    law = Law("shaft-friction", "corner", {"depth": 0.02, "onset": 1e-3, "reach": 1e-4})
    made = drop(Bed(900.0, 2.0, [law], 0.2, full=18.0), mass=0.4, gravity=9.8, speed=0.4, duration=0.3, rate=500.0)
    last = made["depth"][-20:]
    assert np.ptp(last) == 0.0 and np.all(made["other"][-20:] == 0.0)
    assert abs(0.4 * 9.8 - 900.0 * last[0]) <= 0.2 * 18.0


def test_a_drive_goes_as_far_as_its_speeds_say_and_a_crater_gives_no_force_back():
    path = drive([(0.0, 0.1), (0.02, 1.0), (0.0, 0.2), (-0.01, 2.0), (0.0, 0.1)], -0.005, 0.04, eased=True, step=1e-3)
    assert path.depth[0] == -0.005
    assert path.depth.max() == pytest.approx(0.015, abs=1e-6)
    assert path.depth[-1] == pytest.approx(-0.005, abs=1e-6)
    assert path.stops == pytest.approx(1.1)
    crater = Law("plastic-sinkage", "straight", {"depth": 0.015, "bend": 1.5})
    force = push(Bed(900.0, 4.0, [crater], 4.0), path)
    out = (path.time > 1.4) & (path.depth > 0)
    bottom = 900.0 * path.depth.max()
    expected = np.maximum(bottom - 5.0 * 900.0 * (path.depth.max() - path.depth[out]), 0.0)
    assert np.abs(force[out] - expected).max() < 1e-6 * bottom


@pytest.mark.parametrize("name", [*EFFECTS, *(name for name in OUTSIDE if name in LAWS)])
def test_every_kind_of_every_law_changes_the_force_and_vanishes_with_its_amplitude(name):
    random = np.random.default_rng(1)
    path = drive([(0.0, 0.1), (0.05, 0.4), (0.0, 0.2), (-0.05, 0.4)], -0.002, 0.02, eased=False, step=5e-4)
    base = push(Bed(900.0, 4.0), path)
    for kind in LAWS[name]:
        law = draw_law(random, name, 0.018, kind)
        far, near = (np.abs(push(Bed(900.0, 4.0, [law], a, full=16.0), path) - base).max() for a in (1.0, 1e-6))
        assert far > 0.02 and near < 1e-3 * far


def test_the_suite_of_the_rig_is_drawn_as_the_others_are():
    cases = suite("rig", 100)
    kinds = [case["kind"] for case in cases]
    assert kinds.count("null") >= 20
    assert sum(one in OUTSIDE for one in kinds) >= 15
    assert kinds.count("pair") >= 5
    assert set(EFFECTS) | set(OUTSIDE) <= set(kinds)
    assert max(case["strength"] for case in cases if "strength" in case) <= STRENGTHS[1]
    assert suite("rig", 12) == cases[:12]
    assert make_case("rig", {"seed": 7, "kind": "null", "trials": 6})[1].effects == ()
    assert digest("rig") != digest("tumble") == digest("penetration")


def test_what_cannot_be_hidden_is_refused():
    with pytest.raises(ValueError, match="kind = 'ghost'"):
        make_rig(1, kind="ghost")
    with pytest.raises(ValueError, match="only = 'shock'"):
        suite("rig", 3, only="shock")
    assert "wrong-mass" in hidden_rig.OUTSIDE
