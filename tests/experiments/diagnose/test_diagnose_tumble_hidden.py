"""Whole diagnoses of made-up tumbles: data of another integrator with other forms than the library's."""

import pytest

from benchmarks.hidden.tumble import make_hidden_tumble
from experiments.diagnose.core.diagnosis import diagnose
from experiments.diagnose.tumble.problem import make_problem

pytestmark = pytest.mark.slow


def test_errors_of_parameters_are_no_effect():
    campaign, _ = make_hidden_tumble(11, kind="null", trials=8)
    found = diagnose(make_problem(campaign))
    assert found.verdict == "none"
    assert found.before.fit < 1.05


def test_a_base_fit_on_another_branch_of_one_trial_is_no_effect():
    """From where the fits of a scale, a ball or an arc end the base model itself finds the way."""
    campaign, _ = make_hidden_tumble(7001, kind="null", trials=6)
    found = diagnose(make_problem(campaign))
    assert found.verdict == "none"
    assert found.before.fit < 1.03


def test_a_better_branch_that_the_search_finds_for_the_base_model_is_asked_whether_anything_is_left():
    """A torque that fades by a thousandth had stood for it, 37 nats over the base model's first fit."""
    campaign, _ = make_hidden_tumble(740001, kind="null")
    found = diagnose(make_problem(campaign))
    assert found.verdict == "none"
    assert found.before.fit < 1.03


def test_a_slope_is_named_with_its_angle_and_closes_the_gap_on_trials_held_out():
    campaign, told = make_hidden_tumble(7, kind="slope", strength=10.0, trials=8)
    found = diagnose(make_problem(campaign))
    assert (found.verdict, found.effects) == ("named", ("slope",))
    assert found.before.held_out > 5
    assert found.after.held_out < 1.2
    angle = found.parameters("slope")["angle"]
    assert abs(angle["value"] - told.parameters["slope.angle"]) < 4 * angle["std"]
    assert {place.channel for place in found.where} & {"ax", "ay", "x", "y"}


def test_a_torque_that_falls_in_another_way_is_still_called_by_its_name():
    campaign, _ = make_hidden_tumble(9, kind="torque-fade", strength=10.0, trials=8)
    found = diagnose(make_problem(campaign))
    assert (found.verdict, found.effects) == ("named", ("torque-fade",))


def test_a_shock_is_in_no_library():
    campaign, _ = make_hidden_tumble(10, kind="shock", strength=10.0, trials=8)
    found = diagnose(make_problem(campaign))
    assert found.verdict == "unknown"
    assert "latent_force_x_N" in found.latent()
