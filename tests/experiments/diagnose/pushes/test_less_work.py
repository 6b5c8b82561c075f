"""What a diagnosis of pushes computes once, or together, is what it would compute each time, or alone."""

from dataclasses import replace

import numpy as np
import pytest
from penetration_campaigns import DAMPING, STIFFNESS, campaign_of, driven_trial

from experiments.diagnose.core import candidate_fits
from experiments.diagnose.core.candidate_fits import CandidateFits
from experiments.diagnose.fit.fitting import Model, Whitener, fit, fit_each
from experiments.diagnose.fit.problem import evaluate_all
from experiments.diagnose.noise.colour import Colour, whitener_for
from experiments.diagnose.push import data
from experiments.diagnose.push.problem import make_problem

CLOSE = 1e-9
"""Sums in another order differ by 1e-16 times the square root of their 1,200 terms and what the whitening adds."""


def spring(z, v, top):
    return STIFFNESS * z + DAMPING * max(v, 0.0)


@pytest.fixture(scope="module")
def measured():
    """Three pushes at three speeds with two tips."""
    return campaign_of(
        [(f"{k}", "driven", v, driven_trial(spring, speed=v, retreat=True, seed=k), {"diameter": 0.01 * (1 + k % 2)})
         for k, v in enumerate((0.01, 0.03, 0.1))]
    )  # fmt: skip


@pytest.fixture(scope="module")
def model(measured):
    problem = make_problem(measured)
    found = Model(problem, Whitener.white(problem), ("0", "1", "2"))
    problem.rewhiten({p.name: p.value for p in problem.base}, ())
    return found


def test_forms_that_are_evaluated_together_leave_what_each_leaves_alone(model):
    """Every form at its starts, with beds and zeros of their own at some of the points."""
    asked = []
    for k, form in enumerate(model.problem.forms):
        own = ({}, {"bed[0]": 0.1, "depth zero[2]": 1e-4}, {"bed damping[1]": 0.2, "force zero[1]": 0.5})[k % 3]
        asked.append((model.with_forms([form]), [{**start, **own} for start in form.starts[:2]]))
    for (one, points), together in zip(asked, evaluate_all(asked), strict=True):
        for point, modes in zip(points, together, strict=True):
            (alone,) = one.evaluate([point])
            assert np.abs(modes - alone).max() < CLOSE * np.abs(alone).max()


def test_residuals_that_are_not_turned_have_the_products_of_modes_where_noise_is_white(model):
    points = [{}, {"stiffness@0.01": 1.1 * STIFFNESS}]
    for noise in ({}, {"force": Colour("force", 2.0, 0.0)}):
        own = replace(model, whitener=whitener_for(fit(model), noise))
        rests, modes = np.array(own.unturned.evaluate(points)), np.array(own.evaluate(points))
        assert own.unturned is not own
        for rows in own.rows().values():
            assert rests[:, rows] @ rests[:, rows].T == pytest.approx(modes[:, rows] @ modes[:, rows].T, rel=CLOSE)
        assert np.abs(own.turned(rests) - modes).max() < CLOSE * np.abs(modes).max()
    coloured = replace(model, whitener=whitener_for(fit(model), {"force": Colour("force", 1.0, 0.5)}))
    assert coloured.unturned is coloured


def test_a_fit_has_the_modes_and_slopes_of_its_model(model):
    found = fit(model)
    (modes,) = model.evaluate([found.values])
    assert np.abs(found.modes - modes).max() < CLOSE * np.abs(modes).max()
    for k, p in enumerate(model.parameters):
        (moved,) = model.evaluate([{**found.values, p.name: found.values[p.name] + 1e-4 * p.scale}])
        slope = (moved - modes) / 1e-4
        assert np.abs(found.jacobian[:, k] - slope).max() < 1e-2 * np.abs(slope).max()


def test_a_search_does_not_repeat_a_fit_from_the_same_start(model, monkeypatch):
    asked = []
    monkeypatch.setattr(
        candidate_fits, "fit_each", lambda starts, **options: asked.append(len(starts)) or fit_each(starts, **options)
    )
    search = CandidateFits(fit(model), tell=lambda what, done: None)
    form = next(form for form in model.problem.forms if form.id == "depth-hardening:power")
    with_form = model.with_forms([form])
    starts = [(with_form, {**search.base.fit.values, **start}) for start in form.starts]
    first, again = search._fit_each(starts), search._fit_each(starts)
    assert all(one is other for one, other in zip(first, again, strict=True))
    search._fit_each(starts, rounds=2)  # shorter: another fit
    search._fit_each([(with_form.on(("0", "1")), starts[0][1])])
    assert asked == [len(starts), 0, len(starts), 1]


def test_a_campaign_is_smoothed_once_and_another_one_anew(measured, monkeypatch):
    made = []
    smooth = data.smooth_depth
    monkeypatch.setattr(data, "smooth_depth", lambda *columns, **options: made.append(1) or smooth(*columns, **options))
    data.prepare(measured)
    made.clear()
    data.prepare(measured)
    assert not made
    recordings = {key: replace(one, columns=dict(one.columns)) for key, one in measured.recordings.items()}
    key = next(iter(recordings))
    recordings[key].columns["force_N"] = 1.01 * recordings[key]["force_N"]
    data.prepare(replace(measured, recordings=recordings))
    assert made
