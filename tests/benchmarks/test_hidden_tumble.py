"""Made-up tumbles: an integrator of their own, answers apart from campaigns."""

import numpy as np
import pytest

from benchmarks.hidden import penetration as hidden_penetration
from benchmarks.hidden import tumble as hidden_tumble
from benchmarks.hidden.suite import STRENGTHS, suite, write_suite
from benchmarks.hidden.tumble import EFFECTS, OUTSIDE, make_hidden_tumble
from benchmarks.hidden.tumble_motion import COLUMNS, move
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


def test_what_is_hidden_comes_out_as_strong_as_it_was_asked_for():
    """Signatures within 30 % where they do not jump; a null has none."""
    nothing, told = make_hidden_tumble(3, kind="null", trials=4)
    assert (told.signature, told.kind) == (0.0, "null")
    assert len(nothing.tables.trial) == 4
    for kind, strength in (("clock-offset", 2.0), (OUTSIDE[1], 15.0)):
        campaign, told = make_hidden_tumble(3, kind=kind, strength=strength, trials=4)
        assert told.kind == kind
        assert 0.7 * strength < told.signature < 1.4 * strength
        assert len(campaign.recordings) == 12
        assert campaign.tables.name == "made up"


def test_a_small_crater_changes_little():
    """The way back straightens out with the crater: nothing is left of it in the limit."""
    plain, cratered = row(plastic=0.0), row(plastic=1e-4)
    _, motions = move(np.array([plain, cratered]), 0.8)
    assert 0 < np.abs(motions[1, :, :3] - motions[0, :, :3]).max() < 2e-4


LARGEST = {"wheel-vibration": ("vibration_share", 0.9), "tip-radius": ("ball", 0.03), "loose-mass": ("loose_mass", 0.8)}
"""What cannot be made plain in the campaign of seed 500, and its largest amplitude; the wind's is half the weight."""


@pytest.mark.slow
@pytest.mark.parametrize("kind", [*EFFECTS, *OUTSIDE])
def test_every_kind_can_be_barely_visible_and_plain_or_as_large_as_it_may_be(kind):
    _, faint = make_hidden_tumble(500, kind=kind, strength=1.0, trials=6)
    assert 0.4 < faint.signature < 2.5
    campaign, told = make_hidden_tumble(500, kind=kind, strength=20.0, trials=6)
    if kind not in (*LARGEST, "wind"):
        assert 0.4 * 20 < told.signature < 2.5 * 20
        return
    tables = campaign.tables
    weight = (tables.platform.mass + tables.rig.counterweight) * tables.trial[0].gravity_sim
    name, largest = LARGEST.get(kind, ("wind", 0.5 * weight))
    assert abs(told.settings[name]) == pytest.approx(largest, rel=1e-12)
    assert faint.signature <= told.signature < 20
    assert abs(faint.settings[name]) <= largest


@pytest.mark.parametrize("kind, module", [("tumble", hidden_tumble), ("penetration", hidden_penetration)])
def test_a_suite_has_nulls_things_outside_the_library_and_every_effect(kind, module):
    cases = suite(kind, 100)
    kinds = [case["kind"] for case in cases]
    assert kinds.count("null") >= 20
    assert sum(one in module.OUTSIDE for one in kinds) >= 15
    assert kinds.count("pair") >= 5
    assert set(module.EFFECTS) | set(module.OUTSIDE) <= set(kinds)
    strengths = [case["strength"] for case in cases if case["kind"] in module.EFFECTS]
    assert min(strengths) < 1.5 * STRENGTHS[0] and max(strengths) > 0.7 * STRENGTHS[1]
    assert suite(kind, 12) == cases[:12]
    assert suite(kind, 12, seed=2) != cases[:12]


def test_what_is_not_there_to_hide_is_refused():
    with pytest.raises(ValueError, match="only = 'ghost'"):
        suite("tumble", 3, only="ghost")
    with pytest.raises(ValueError, match="kind = 'hop'"):
        suite("hop", 3)


def test_answers_within_the_campaigns_folder_are_refused(tmp_path):
    with pytest.raises(ValueError, match="another place was expected"):
        write_suite(tmp_path / "cases", tmp_path / "cases" / "answers", "tumble", [])
