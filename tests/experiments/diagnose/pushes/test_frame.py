"""Pushes whose depth is read behind a compliant frame: K and C with its stiffness stated, and without."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from penetration_campaigns import DAMPING, STIFFNESS, campaign_of, driven_trial, drop_trial, saved

from experiments.diagnose.core.outcome import _between
from experiments.diagnose.experiment import check, make_problem
from experiments.diagnose.fit.fitting import Fit, Model, Whitener, fit
from experiments.diagnose.fit.problem import Parameter
from experiments.diagnose.push.frame import at_the_tip
from experiments.diagnose.report.to_use import use_sentences
from experiments.diagnose.settings import DiagnoseSettings

FRAME = 9000.0


def law(z, v, top=0.0):
    return STIFFNESS * z + DAMPING * max(v, 0.0)


def pushed(speed, seed):
    """A push read at the drive: deeper than the tip by the bed's force over the frame's stiffness."""
    tip = driven_trial(law, speed=speed, retreat=True, seed=seed)
    quiet = driven_trial(law, speed=speed, retreat=True, seed=seed, force_std=0.0)
    return replace(tip, columns={**tip.columns, "depth_m": tip["depth_m"] + quiet["force_N"] / FRAME})


@pytest.fixture(scope="module")
def campaign():
    return campaign_of([(f"{n}", "driven", v, pushed(v, n)) for n, v in enumerate((0.01, 0.03, 0.1, 0.3))])


@pytest.mark.parametrize(("stated", "share"), [(FRAME, 1.0), (None, 1.0 / (1.0 + STIFFNESS / FRAME))])
def test_k_and_c_are_those_of_the_ground_only_if_the_frame_is_stated(campaign, stated, share):
    """Behind a spring k a spring K reads as K / (1 + K / k), a damper C as C / (1 + K / k)^2: the tip is slower too."""
    problem = make_problem(campaign, frame_stiffness=stated)
    found = fit(Model(problem, Whitener.white(problem), tuple(trial.id for trial in problem.trials)))
    error = np.sqrt(np.diag(found.covariance()))
    for place, (name, true) in enumerate((("stiffness", share * STIFFNESS), ("damping", share**2 * DAMPING))):
        assert found.model.parameters[place].name == name
        assert found.values[name] == pytest.approx(true, abs=3 * error[place])
        assert error[place] < 0.02 * true  # a tenth is seen


def test_only_the_depth_of_pushes_is_corrected_and_a_missing_force_is_its_neighbours():
    push, drop = pushed(0.02, 1), drop_trial(law, speed=0.2)
    force = push["force_N"].copy()
    force[100], force[-1] = np.nan, np.nan
    gappy = replace(push, columns={**push.columns, "force_N": force})
    told = campaign_of([("a", "driven", 0.02, gappy), ("b", "drop", 0.2, drop)])
    found = at_the_tip(told, FRAME)
    bends = push["depth_m"] - found.recordings["a", "data"]["depth_m"]
    known = np.isfinite(force)
    assert bends[known] == pytest.approx(force[known] / FRAME, abs=1e-15)
    assert bends[100] == pytest.approx(0.5 * (force[99] + force[101]) / FRAME)
    assert bends[-1] == pytest.approx(force[-2] / FRAME)
    assert found.recordings["b", "data"] is drop
    assert at_the_tip(told, None) is told


def test_a_frame_without_pushes_or_without_stiffness_is_refused_by_name(tmp_path):
    drops = campaign_of([("a", "drop", 0.2, drop_trial(law, speed=0.2))])
    with pytest.raises(ValueError, match="'driven'"):
        check(DiagnoseSettings(campaign=str(saved(tmp_path / "drops", drops)), frame_stiffness=FRAME))
    with pytest.raises(ValueError, match="above 0"):
        at_the_tip(drops, 0.0)
    with pytest.raises(ValueError, match="frame_stiffness"):
        DiagnoseSettings(campaign="mine", frame_stiffness=-1.0)


def test_the_report_states_what_is_in_series_with_the_ground(campaign):
    told = {"kind": "penetration", "verdict": "none", "effects": [],
            "base": {"after": {"stiffness": {"value": 900.0, "std": 1.0, "unit": "N/m"}}}}  # fmt: skip
    for stated, words in ((None, "--frame-stiffness"), (FRAME, "9000 N/m")):
        covered = make_problem(campaign, frame_stiffness=stated).covered
        assert words in use_sentences(told | {"covered": covered})[0]
    assert "frame" not in use_sentences(told)[0]  # drops have none


def test_the_standard_error_by_trial_is_that_of_a_mean_of_trials_that_differ():
    """Three trials of four rows that read 1, 2 and 3 with a noise of 1: mean 2, s / sqrt(3) with s = 1; by the rows
    1 / sqrt(12)."""
    (k,) = [Parameter(name="k", unit="1", value=0.0, std=math.inf, scale=2.0)]
    rows = {trial: slice(4 * n, 4 * n + 4) for n, trial in enumerate("abc")}
    model = SimpleNamespace(parameters=(k,), trials=tuple(rows), rows=lambda: rows)
    found = Fit(model, {"k": 2.0}, np.repeat([1.0, 0.0, -1.0], 4), np.full((12, 1), 2.0), 8.0, 0.0, np.array([True]))
    assert found.covariance()[0, 0] == pytest.approx(1.0 / 12.0)
    assert found.covariance_by_trial()[0, 0] == pytest.approx(1.0 / 3.0)


def test_k_of_pushes_behind_a_frame_and_of_drops_is_as_uncertain_as_they_differ(campaign):
    drops = [(f"d{n}", "drop", v, drop_trial(law, speed=v, seed=n)) for n, v in enumerate((0.2, 0.4))]
    pushes = [(t.id, "driven", t.speed, campaign.recordings[t.id, "data"]) for t in campaign.tables.trial]
    problem = make_problem(campaign_of([*pushes, *drops]))
    found = {
        len(ids): fit(Model(problem, Whitener.white(problem), ids))
        for ids in (tuple(trial.id for trial in problem.trials), tuple("0123"))
    }
    rows = math.sqrt(found[6].covariance()[0, 0])
    between = float(_between(found[6])[0])
    assert 5.0 * rows < between < STIFFNESS - STIFFNESS / (1.0 + STIFFNESS / FRAME)
    assert not _between(found[4]).any()  # all pushes are behind the frame
