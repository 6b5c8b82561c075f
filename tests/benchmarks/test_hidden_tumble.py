"""Made-up tumbles: an integrator of their own, answers apart from campaigns."""

import numpy as np
import pytest

from benchmarks.hidden_tumble import EFFECTS, OUTSIDE, make_hidden_tumble, suite, write_suite
from benchmarks.hidden_tumble_motion import COLUMNS, move
from rigid import Trial, simulate

BASE = {
    "mass": 5.3, "inertia": 0.06, "length": 0.2, "counterweight": 5.21, "gravity_sim": 0.0834,
    "gravity_at_mass": 9.80665, "torque": 0.22, "torque_until": 10.0, "wheel_inertia": 1.2e-3, "wheel_sign": 1.0,
    "mu_s": 0.5, "mu_d": 0.25, "stiffness": 1.5e4, "damping": 60.0,
}  # fmt: skip


def row(**changes: float) -> np.ndarray:
    given = BASE | changes
    return np.array([given.get(name, 0.0) for name in COLUMNS])


def test_without_anything_hidden_the_motion_is_that_of_the_accurate_integrator():
    """Two integrators written apart: stick, slip, touch and lift at the same places, to micrometres."""
    cases = [{"torque": 0.125}, {"torque": 0.22, "mu_s": 0.25, "mu_d": 0.125}, {"torque": 6.0, "wheel_speed_0": 300.0}]
    signs = [1.0, 1.0, -1.0]
    time, motions = move(np.array([row(**c, wheel_sign=s) for c, s in zip(cases, signs, strict=True)]), 1.2)
    for case, sign, motion in zip(cases, signs, motions, strict=True):
        trial = Trial(
            mass=5.3, inertia=0.06, counterweight=5.21, gravity_sim=0.0834,
            actuator="motor" if sign > 0 else "brake", **{"mu_s": 0.5, "mu_d": 0.25, **case},
        )  # fmt: skip
        exact = simulate(trial, duration=1.2, times=time[time <= 1.2][::50])
        mine = motion[::50][: len(exact.time)]
        assert np.abs(mine[:, 0] - exact.x).max() < 5e-6
        assert np.abs(mine[:, 1] - exact.y).max() < 5e-6
        assert np.abs(mine[:, 2] - exact.theta).max() < 1e-4
        assert np.mean(mine[:, 7] != exact.state) < 0.02


def test_every_kind_changes_what_the_sensors_read():
    nothing, _ = make_hidden_tumble(3, kind="null", trials=6)
    assert len(nothing.tables.trial) == 6
    for kind in ("rate-friction", "clock-offset", OUTSIDE[0]):
        campaign, told = make_hidden_tumble(3, kind=kind, strength=10.0, trials=6)
        assert told.kind == kind
        assert 1.0 < told.signature < 60.0
        assert len(campaign.recordings) == 18


def test_a_suite_has_nulls_things_outside_the_library_and_every_effect():
    kinds = [case["kind"] for case in suite(100)]
    assert kinds.count("null") >= 20
    assert sum(kind in OUTSIDE for kind in kinds) >= 15
    assert set(EFFECTS) <= set(kinds)
    assert suite(100) == suite(100)


def test_answers_within_the_campaigns_folder_are_refused(tmp_path):
    with pytest.raises(ValueError, match="another place was expected"):
        write_suite(tmp_path / "cases", tmp_path / "cases" / "answers", [])
