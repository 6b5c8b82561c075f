"""The baselines beside `hedgebed bench diagnose`: they learn a force, say whether there is one, and it acts again."""

from importlib.util import find_spec

import numpy as np
import pytest
from penetration_campaigns import DAMPING, STIFFNESS, campaign_of, driven_trial, drop_trial

from benchmarks.baseline import methods as baselines
from benchmarks.baseline.residuals import _TERM, NAMES, Rows, _fall, _hooks, held_out_gap, make_rows, touching
from experiments.diagnose.push.problem import make_problem
from rigid import Effect, Trial, simulate
from rigid.terms import load_effect

needs = pytest.mark.skipif(bool(baselines.missing()), reason="pip install .[bench]")
RIG = {"gravity_sim": 0.0834, "counterweight": 5.21, "torque": 0.22, "mu_s": 0.5}


def test_what_lacks_is_said_in_a_sentence(monkeypatch):
    monkeypatch.setattr(baselines, "find_spec", lambda name: None if name == "pysindy" else find_spec("numpy"))
    assert baselines.missing() == "no baselines: pysindy not installed (pip install .[bench])"


def test_gains_that_are_noise_raise_an_alarm_in_one_of_twenty():
    """Signed ranks at 5 %: of 400 draws of 16 gains 20 +- 4.4 (binomial standard deviation) are called better."""
    random = np.random.default_rng(0)
    alarms = sum(baselines._better(random.standard_normal(16)) for _ in range(400))
    assert 7 < alarms < 33
    assert not baselines._better(np.zeros(16))


def test_a_learnt_force_acts_in_the_accurate_integrator_as_the_term_does():
    """The pendulum's force -m_b g x / L, handed over as a function of the state."""
    length = 2.2
    term = load_effect(_TERM)
    hooks = _hooks(term)
    hooks.append(lambda s: (-s.counterweight * s.gravity * s.x / length, 0.0, 0.0))
    try:
        learnt = simulate(Trial(effects=(Effect(id=term.id, file=_TERM),), **RIG), duration=0.8, sample_interval=0.01)
    finally:
        hooks.pop()
    known = simulate(
        Trial(effects=(Effect(id="pendulum", parameters={"length": length}),), **RIG),
        duration=0.8, sample_interval=0.01,
    )  # fmt: skip
    base = simulate(Trial(**RIG), duration=0.8, sample_interval=0.01)
    assert np.abs(known.x - base.x).max() > 1e-4
    assert np.abs(learnt.x - known.x).max() < 1e-7
    assert np.abs(learnt.theta - known.theta).max() < 1e-6


def test_the_lowest_tip_touches_where_it_stands_and_not_a_centimetre_above():
    class Tables:
        class platform:  # noqa: N801
            spike_length = 0.2

    lifted = 0.2 * (1 - np.cos(np.pi / 8))  # on one tip, an eighth of a turn on
    y, theta = np.array([0.0, 0.01, lifted, lifted + 0.01]), np.array([0.0, 0.0, np.pi / 8, np.pi / 8])
    assert touching(y, theta, Tables).tolist() == [1, 0, 1, 0]


def drops_and_pushes(force, *, retreat=True):
    trials = [
        (f"{k + 1:03d}", "driven", 0.01, driven_trial(force, speed=0.01, retreat=retreat, seed=k)) for k in range(5)
    ]
    trials += [("006", "drop", 0.4, drop_trial(lambda z, v: force(z, v, z), speed=0.4, seed=9))]
    return make_problem(campaign_of(trials, stiffness=STIFFNESS, damping=DAMPING))


def law(z, v, top):
    return STIFFNESS * z + DAMPING * max(v, 0.0)


def test_without_a_force_the_gap_is_that_of_the_base_model():
    problem = drops_and_pushes(law)
    for trial in ("001", "006"):
        total, count = problem.chi_square({}, (), trial)
        assert held_out_gap(problem, {}, [trial], None) == pytest.approx(total / count)
    time, depth, _ = _fall(problem, {}, problem.tables.trial[5], 0.1, lambda state: np.zeros((len(state), 1)))
    assert held_out_gap(problem, {}, ["006"], lambda state: np.zeros((len(state), 1))) < 1.3
    assert depth[0] == 0.0 and time[-1] >= 0.1


def rows_of(random, force, *, trials=4, count=40):
    found = []
    for k in range(trials):
        state = random.standard_normal((count, len(NAMES["tumble"]))) * 0.1
        state[:, -1] = random.random(count) < 0.5
        target = np.stack([force(state), np.zeros(count), np.zeros(count)], axis=1)
        found.append(Rows(f"{k}", state, target + random.standard_normal((count, 3)), np.ones(3)))
    return found


class FakeProblem:
    kind = "tumble"


@needs
@pytest.mark.parametrize("method", sorted(baselines.METHODS))
def test_a_force_is_found_and_noise_is_not_called_one(method, monkeypatch):
    monkeypatch.setattr(baselines, "held_out_gap", lambda *a: 1.0)
    random = np.random.default_rng(1)
    make = baselines.METHODS[method]
    before = {"fit": None, "held_out": 1.0}
    found = baselines._try(FakeProblem, make, rows_of(random, lambda s: 3 * np.tanh(s[:, 3] / 0.005)), {}, [], before)
    assert found["alarm"]
    if method == "pysindy":
        assert "rate-friction" in found["points_to"]
    quiet = [
        baselines._try(FakeProblem, make, rows_of(random, lambda s: 0 * s[:, 0]), {}, [], before)["alarm"]
        for _ in range(3)
    ]
    assert sum(quiet) <= 1


@needs
def test_a_hardening_bed_is_learnt_from_pushes_and_predicted_on_others():
    """F = K z (1 + z / 0.02): the base model lacks up to as much again at 20 mm."""
    problem = drops_and_pushes(lambda z, v, top: STIFFNESS * z * (1 + z / 0.02) + DAMPING * max(v, 0.0), retreat=False)
    rows = make_rows(problem, {}, ["001", "002", "003"])
    before = {"fit": None, "held_out": held_out_gap(problem, {}, ["004", "006"], None)}
    told = baselines._try(problem, baselines.SparseLaw, rows, {}, ["004"], before)
    assert told["alarm"]
    assert told["after"]["held_out"] < 0.05 * before["held_out"]
    assert "depth-hardening" in told["points_to"]
