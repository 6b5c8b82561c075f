"""C by the step of the force where a drive stops, beside the C of a fitted model."""

from dataclasses import replace

import numpy as np
import pytest

from experiments.diagnose.push.remarks import Push
from experiments.diagnose.push.stops import at_stops, doubts_of_damping

STIFFNESS, DIAMETER = 2000.0, 0.02


def pushes(damping, *, spring=1.0, seeds=range(6), hold=0.3):
    """Pushes to 8 to 18 mm at 20 to 70 mm/s and a hold: F = K z + C v; the spring of the model is `spring` times it."""
    made = []
    for seed in seeds:
        random, speed, deepest = np.random.default_rng(seed), 0.02 + 0.01 * seed, 0.008 + 0.002 * seed
        time = np.arange(0.0, deepest / speed + hold, 0.002)
        depth = np.minimum(speed * time, deepest)
        moving = np.where(time < deepest / speed, speed, 0.0)
        force = STIFFNESS * depth + damping * moving + 0.05 * random.standard_normal(len(time))
        made.append(Push(DIAMETER, depth, moving, force, spring * STIFFNESS * depth))
    return made


@pytest.mark.parametrize("spring", [1.0, 0.7])
def test_the_c_of_the_stops_is_that_of_the_ground_whatever_spring_was_fitted(spring):
    found = at_stops(pushes(12.0, spring=spring))
    assert found.count == 6
    assert abs(found.damping - 12.0) < 3 * found.std < 1.5
    assert found.low <= found.damping <= found.high


def test_a_model_with_another_c_is_doubted_and_one_with_that_c_is_not():
    made = pushes(12.0)
    (said,) = doubts_of_damping(made, {DIAMETER: 4.0})
    assert "4 N s" in said and "6 stops" in said
    assert doubts_of_damping(made, {DIAMETER: 11.5}) == []
    assert doubts_of_damping(made, {0.06: 4.0}) == []


def test_pushes_without_a_hold_say_nothing_of_c():
    assert at_stops(pushes(12.0, hold=0.004)) is None
    assert doubts_of_damping(pushes(12.0, hold=0.0), {DIAMETER: 1.0}) == []


def test_a_force_that_rises_at_a_stop_or_a_tip_that_eases_into_its_rest_says_nothing():
    assert doubts_of_damping(pushes(-12.0), {DIAMETER: 4.0}) == []
    eased = [replace(push, depth=np.where(push.speed > 0, push.depth, push.depth + 0.01)) for push in pushes(12.0)]
    assert at_stops(eased) is None


def test_a_single_stop_is_no_evidence():
    assert at_stops(pushes(12.0, seeds=[1])) is None
