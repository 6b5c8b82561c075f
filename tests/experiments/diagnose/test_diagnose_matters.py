"""What matters decides: replicates by what the base model tells apart, small residues, numbers that went far."""

import numpy as np
import pytest
from penetration_campaigns import campaign_of, driven_trial

from experiments.check.replicas import pace_of
from experiments.diagnose.core import matters
from experiments.diagnose.core.diagnosis import diagnose
from experiments.diagnose.fit.fitting import Model, Whitener, fit
from experiments.diagnose.push.problem import make_problem
from experiments.diagnose.report.gaps import Gaps
from experiments.diagnose.report.summary import _residue

STIFFNESS, DAMPING = 900.0, 4.0


def base(z, v, top):
    return STIFFNESS * z + DAMPING * max(v, 0.0)


def toe(z, v, top):
    """The same, but the first grains are loose: 1.1 noises at most, over half a millimetre."""
    return base(z, v, top) - STIFFNESS * 6e-5 * (1.0 - np.exp(-max(z, 0.0) / 5e-4))


def pushes(force, speeds, **more):
    trials = []
    for k, speed in enumerate(speeds):
        trials.append((f"{k}", "driven", speed, driven_trial(force, speed=speed, seed=k, **more)))
    return campaign_of(trials)


def test_speeds_that_change_the_force_by_less_than_its_noise_make_one_condition():
    """C = 3.6 N s/m and a noise of 0.05 N: 13.9 mm/s are the same. Where speed is a setting, up to a tenth faster."""

    def paces(speeds):
        tables = pushes(base, speeds).tables
        return [pace_of(tables, trial) for trial in tables.trial]

    assert paces([0.0067, 0.0047, 0.0087]) == [0.0047] * 3
    assert paces([0.0047, 0.0051, 0.0067, 0.02, 0.2]) == [0.0047, 0.0047, 0.0067, 0.02, 0.2]
    assert paces([0.1, 0.13, 0.18]) == [0.1, 0.13, 0.18]  # 0.1 N and more apart
    problem = make_problem(pushes(base, [0.0047, 0.0067, 0.0087]))
    assert len({trial.condition for trial in problem.trials}) == 1


def test_a_structural_residue_too_small_to_matter_is_no_verdict_of_unknown():
    found = diagnose(make_problem(pushes(toe, [0.01, 0.01, 0.05, 0.05, 0.01, 0.05])))
    assert not found.gate_before.passed  # the sensors can tell
    assert (found.verdict, found.effects) == ("none", ())
    assert 1.0 < found.before.fit <= matters.MOST


def test_numbers_that_went_far_count_as_stated_only_where_nearer_ones_do_as_well():
    """K stated to 10 %: 2 % off by the data is as stated, 80 % is not, whatever else is missing."""
    for truth, suffices in ((1.02, True), (1.8, False)):

        def force(z, v, top, truth=truth):
            return truth * STIFFNESS * z + DAMPING * max(v, 0.0)

        problem = make_problem(pushes(force, [0.01, 0.05]))
        model = Model(problem, Whitener.white(problem), tuple(trial.id for trial in problem.trials))
        found = fit(model)
        assert matters.left_by(found, (), {}).fit < matters.MOST
        assert matters.is_as_stated(found, {}) == suffices


def test_what_is_left_is_reported_with_its_size_and_numbers_that_absorb_it():
    gaps, time = Gaps(), np.arange(2000) * 1e-3
    noise = 1e-3 * np.random.default_rng(1).standard_normal(2000)
    std, phases = np.full(2000, 1e-3), np.array(["pivot"] * 2000)
    gaps.add("1", "x", time, noise, noise, std, std, phases=phases, settings={}, held_out=False)
    gaps.add("1", "y", time, noise, noise + 7e-4, std, std, phases=phases, settings={}, held_out=False)
    (left,) = gaps.residue
    assert (left["channel"], left["unit"]) == ("y", "mm")
    assert left["rms"] == pytest.approx(0.7, rel=0.1)
    bound = {"parameter": "mu_s", "value": 0.4, "unit": "1", "sigmas": -6.0, "at_bound": True}
    words = " ".join(_residue({"residue": gaps.residue, "at_bounds": {"after": [bound]}}))
    assert "mm in y" in words and "mu_s (-6.0 sigma)" in words
