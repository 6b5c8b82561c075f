"""What a fit comes to without noise: the same rows and weights, readings in the place of the measured ones."""

from dataclasses import replace

import numpy as np
import pytest
from penetration_campaigns import DAMPING, STIFFNESS, campaign_of, driven_trial

from experiments.diagnose.core import renoised
from experiments.diagnose.fit.fitting import Model, Whitener
from experiments.diagnose.push.limit import limit_of
from experiments.diagnose.push.problem import make_problem

SPEEDS = {"001": 0.02, "002": 0.1}
FREE = (2.0, 2.0)  # no prior on K and C


def bed(z, v, top):
    return STIFFNESS * z + DAMPING * max(v, 0.0)


def exact(speed, factor=1.0):
    """The columns of `driven_trial` without noise; the spring is `factor` times as stiff."""
    time = np.linspace(0, 0.02 / speed, 400)
    force = factor * STIFFNESS * speed * time + DAMPING * speed
    return {"t_s": time, "depth_m": speed * time, "force_N": np.where(time > 0, force, 0.0)}


@pytest.fixture
def found():
    trials = [(id, "driven", v, driven_trial(bed, speed=v, seed=k)) for k, (id, v) in enumerate(SPEEDS.items())]
    problem = make_problem(campaign_of(trials, doubt=FREE))
    return renoised.whitened_fit(Model(problem, Whitener.white(problem), tuple(SPEEDS)))


def test_a_model_that_is_right_comes_to_the_truth(found):
    at = limit_of(found, {id: exact(speed) for id, speed in SPEEDS.items()})
    true = {"stiffness": STIFFNESS, "damping": DAMPING, "surface_depth": 0.0}
    assert at.values == pytest.approx(true, rel=1e-5, abs=1e-9)
    assert abs(found.values["stiffness"] / STIFFNESS - 1) > 1e-4  # the noisy fit is not there


def test_where_trials_differ_the_limit_is_that_of_the_fits_own_weights(found):
    readings = {"001": exact(SPEEDS["001"]), "002": exact(SPEEDS["002"], 1.01)}
    alike = limit_of(found, readings).values["stiffness"] / STIFFNESS
    directions, shrink, doubtful = found.model.problem._whitening["002"]
    found.model.problem._whitening["002"] = directions, shrink, 30 * doubtful
    assert 1.001 < alike < 1.009
    assert limit_of(found, readings).values["stiffness"] == pytest.approx(STIFFNESS, rel=3e-4)


def test_trials_that_were_not_fitted_have_no_part_in_it(found):
    one = renoised.whitened_fit(replace(found.model, trials=("001",)))
    at = limit_of(one, {"001": exact(SPEEDS["001"]), "002": exact(SPEEDS["002"], 1.5)})
    assert at.values["stiffness"] == pytest.approx(STIFFNESS, rel=1e-4)
    with pytest.raises(ValueError, match="trial '002'"):
        limit_of(found, {"001": exact(SPEEDS["001"])})
