"""What replicates do each in its own way: the pure error that a law of the mean bed is weighed against."""

import numpy as np
import pytest
from scipy.fft import idct

from experiments.campaign import Recording
from experiments.diagnose.diagnosis import diagnose
from experiments.diagnose.fitting import Model, Whitener, fit
from experiments.diagnose.penetration_problem import make_problem
from experiments.diagnose.unrest import find_unrest
from tests.penetration_campaigns import DAMPING, STIFFNESS, campaign_of, driven_trial

SPEEDS = (0.01, 0.02, 0.04)


def wandering(size, *, hardening=0.0, seed=0, thinned=None):
    """Three speeds, three replicates each; every push has a slow force of its own, `size` [N] (root mean square)."""
    random = np.random.default_rng(seed)
    trials = []
    for k, speed in enumerate(SPEEDS):
        for n in range(3):
            modes = np.zeros(400)
            modes[:8] = random.standard_normal(8)
            own = size * np.sqrt(400 / 8) * idct(modes, norm="ortho")
            pushed = driven_trial(
                lambda z, v, top: STIFFNESS * z * (1 + hardening * z) + DAMPING * max(v, 0.0),
                speed=speed, depth=0.02 - 1e-9, seed=10 * k + n,
            )  # fmt: skip
            pushed.columns["force_N"] += own * (pushed.columns["depth_m"] > 0)
            if f"{k}{n}" == thinned:
                pushed = Recording({name: column[::2] for name, column in pushed.columns.items()})
            trials.append((f"{k}{n}", "driven", speed, pushed))
    return make_problem(campaign_of(trials, stiffness=STIFFNESS, damping=DAMPING, doubt=(1.0, 1.0)))


@pytest.mark.parametrize("size", [0.0, 0.8])
def test_how_far_replicates_wander_is_told_in_newtons_and_nothing_where_they_do_not(size):
    problem = wandering(size)
    ids = tuple(trial.id for trial in problem.trials)
    found = fit(Model(problem, Whitener.white(problem), ids))
    unrest = find_unrest(found, found.values, ids)
    if size == 0:
        assert not unrest
        return
    assert unrest.model_std == {"force": pytest.approx(size, rel=0.25)}
    weights = unrest.weights(problem)["00"]
    assert weights[0] < 0.3 and weights[-1] == pytest.approx(1.0, abs=0.05)


def test_a_replicate_with_half_as_many_rows_does_not_seem_to_wander():
    """Modes of one misfit grow with the root of the number of rows: a straight spring, fitted to a bent one."""
    problem = wandering(0.0, hardening=60.0, thinned="01")
    ids = tuple(trial.id for trial in problem.trials)
    found = fit(Model(problem, Whitener.white(problem), ids))
    unrest = find_unrest(found, found.values, ids)
    assert unrest.model_std.get("force", 0.0) < 0.1


def test_a_name_is_certain_where_all_that_is_left_is_what_replicates_differ_by():
    """The verdict stays `unknown`: no law has a wander of each push's own."""
    found = diagnose(wandering(0.8, hardening=60.0))
    assert found.verdict == "unknown" and found.effects == ("depth-hardening",)
    assert found.model_std["force"] == pytest.approx(0.8, rel=0.3)
    assert found.after.held_out < 0.2 * found.before.held_out


def test_what_differs_between_replicates_alone_gets_no_name_and_is_not_called_nothing():
    found = diagnose(wandering(0.8))
    assert found.verdict == "unknown" and found.effects == ()
