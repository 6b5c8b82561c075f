"""The verification suite's quick cases, and that the suite says what it should of those that fail."""

import dataclasses
import json
import math

import numpy as np
import pytest

from experiments.validate.base.case import Case, Comparison, Outcome, compared
from experiments.validate.base.drops import first_touch
from experiments.validate.base.peers import PEERS
from experiments.validate.beds import dosta, silo
from experiments.validate.experiment import run_case
from experiments.validate.suite import SUITE, chosen

FAILING = {"katsuragi-durian", "murdoch", "plates-in-sand", "rft"}
"""Cases that are known to fail; docs/validation.md says why. One that passes is to be taken off."""
LONG = {
    "dmt", "incline-rolling", "jkr", "large-neck", "liggghts-contacts", "order-head-on", "order-rebound",
    "restitution-tensile",
}  # fmt: skip
"""Quick cases that take 6 s and more here, with their kernels to compile."""
HOURS = {"rft"}
"""Cases that take hours on a processor: `hedgebed validate` runs them, no test does."""
QUICK = [case for case in chosen(quick=True) if case.compute is not None]


def cases(*, failing):
    """The cases that are known to fail, or the others, as parameters; slow ones marked."""
    return [
        pytest.param(case, id=case.id, marks=[pytest.mark.slow] * case.slow + [pytest.mark.long] * (case.id in LONG))
        for case in SUITE
        if case.compute is not None and (case.id in FAILING) == failing and case.id not in HOURS
    ]


@pytest.mark.parametrize("case", cases(failing=False))
def test_a_case_of_the_suite_lies_within_its_bands(case):
    outcome, _ = run_case(case)
    if outcome.skipped:
        pytest.skip(outcome.skipped)
    beyond = [f"{one.quantity}: {one.ours} for {one.reference}" for one in outcome.comparisons if not one.passes]
    assert outcome.status == "pass", beyond or outcome.remarks


@pytest.mark.parametrize("case", cases(failing=True))
def test_a_case_known_to_fail_still_does_and_gives_its_reason(case):
    outcome, _ = run_case(case)
    if outcome.skipped:
        pytest.skip(outcome.skipped)
    assert outcome.status == "fail" and outcome.comparisons
    assert case.reason


def test_every_case_has_a_name_of_its_own_and_its_source():
    assert len({case.id for case in SUITE}) == len(SUITE)
    for case in SUITE:
        assert case.reference and case.source and case.title and case.family
    assert {case.id for case in SUITE} >= FAILING | HOURS


def test_a_peer_that_is_not_installed_is_skipped_in_words(monkeypatch):
    monkeypatch.setattr("experiments.validate.base.peers.shutil.which", lambda name: None)
    for case in SUITE:
        if case.id.partition("-")[0] in PEERS:
            outcome, _ = run_case(case)
            assert outcome.status == "skipped" and "apt install" in outcome.skipped


def test_a_comparison_passes_within_its_band_only():
    assert Comparison("x", "m", 2.0, 2.09, 0.05).passes
    assert not Comparison("x", "m", 2.0, 2.11, 0.05).passes
    assert Comparison("x", "m", 0.0, 0.01, 0.01, False).passes
    assert not Comparison("x", "m", 1.0, math.nan, 0.5).passes
    numbers = np.array([1.0, 1.1])
    assert json.loads(json.dumps(Comparison("x", "m", *numbers, 0.2).as_dict()))["passes"] is True
    with pytest.raises(ValueError, match="cannot be met"):
        Comparison("x", "m", 0.0, 0.0, 0.1)
    with pytest.raises(ValueError, match="zip"):
        compared("x", ["a"], [1.0, 2.0], [1.0, 2.0], band=0.1)


def test_a_case_without_numbers_or_that_ends_with_an_error_fails():
    assert Outcome().status == "fail"

    def broken(tell):
        raise RuntimeError("the bed burst")

    case = dataclasses.replace(QUICK[0], compute=broken)
    outcome, _ = run_case(case)
    assert outcome.status == "fail" and "the bed burst" in outcome.remarks[0]


def test_a_case_needs_something_to_do_or_to_wait_for():
    with pytest.raises(ValueError, match="either compute or waits_for"):
        Case("x", "f", "t", "r", "s")


def test_dostas_grains_fill_their_box_and_the_ball_starts_on_the_first():
    positions, radii = dosta.grains()
    assert positions.shape == (25000, 3) and (radii == 1e-3).all()
    for axis in (0, 1):
        low, high = dosta.WALLS[2 * axis : 2 * axis + 2]
        assert low < (positions - radii[:, None])[:, axis].min() + 1e-5
        assert (positions + radii[:, None])[:, axis].max() < high + 1e-5
    height = first_touch(positions, radii, dosta.BALL_RADIUS)
    gap = np.linalg.norm(positions - [0, 0, height], axis=1) - radii - dosta.BALL_RADIUS
    assert abs(gap.min()) < 1e-12


def test_janssens_floor_carries_all_of_a_shallow_filling_and_no_more_than_its_scale():
    """W_s (1 - exp(-W / W_s)): W - W^2 / 2 W_s where shallow."""
    assert silo.carried(np.array(0.01), 1.0) == pytest.approx(0.01 - 0.01**2 / 2, rel=1e-4)
    assert silo.carried(np.array(50.0), 1.0) == pytest.approx(1.0)
