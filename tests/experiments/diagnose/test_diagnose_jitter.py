"""Times that jitter: found where they do, by how much, and taken into account; not found where noise is only loud."""

from dataclasses import replace

import numpy as np
import pytest
from penetration_campaigns import DAMPING, STIFFNESS, campaign_of, driven_trial, drop_trial

from experiments.campaign import Recording
from experiments.diagnose.core.diagnosis import diagnose
from experiments.diagnose.fit.fitting import Model, Whitener, fit
from experiments.diagnose.noise.jitter import Shaken, find_jitter
from experiments.diagnose.push.problem import make_problem
from experiments.diagnose.report.document import document

JITTER = 0.0003


def base(z, v, top=0.0):
    return STIFFNESS * z + DAMPING * max(v, 0.0)


@pytest.fixture(scope="module")
def still():
    drops = [(f"d{k}", "drop", v, drop_trial(base, speed=v, seed=k)) for k, v in enumerate((0.4, 0.6, 0.8, 1.0, 1.2))]
    pushes = [(f"p{k}", "driven", v, driven_trial(base, speed=v, seed=10 + k)) for k, v in enumerate((0.01, 0.03, 0.1))]
    return campaign_of([*drops, *pushes])


def shaken(made, *, drops=True):
    """The same with times of the drops, or of the pushes, that are off by `JITTER` (std) each."""
    random, found = np.random.default_rng(3), {}
    for key, recording in made.recordings.items():
        columns = dict(recording.columns)
        if key[0].startswith("d" if drops else "p"):
            late = np.clip(JITTER * random.standard_normal(len(recording)), -1.5 * JITTER, 1.5 * JITTER)
            columns["t_s"] = np.maximum(columns["t_s"] + late, 0.0)
        found[key] = Recording(columns)
    return replace(made, recordings=found)


def loud(made):
    """The same with twice the noise in depth and acceleration of drops."""
    random, found = np.random.default_rng(4), {}
    for key, recording in made.recordings.items():
        columns = dict(recording.columns)
        if "accel_m_s2" in columns:
            for name, std in (("depth_m", 1e-4), ("accel_m_s2", 0.1)):
                columns[name] = columns[name] + np.sqrt(3.0) * std * random.standard_normal(len(recording))
        found[key] = Recording(columns)
    return replace(made, recordings=found)


def jitters_of(made):
    problem = make_problem(made)
    return find_jitter(fit(Model(problem, Whitener.white(problem), tuple(trial.id for trial in problem.trials))))


def test_times_that_jitter_are_found_by_how_much_and_loud_noise_is_not_taken_for_it(still):
    (jitter,) = jitters_of(shaken(still))
    assert jitter.channels == ("depth", "accel") and jitter.std == pytest.approx(JITTER, rel=0.25)
    assert jitters_of(still) == () and jitters_of(loud(still)) == ()


def test_a_campaign_whose_times_jitter_lacks_nothing_and_its_gap_stays_with_the_stated_noise(still):
    found = diagnose(make_problem(shaken(still)))
    said = document(found)
    assert found.verdict == "none"
    assert found.before.fit > 1.2 and found.base.chi_square < 1.1 * found.base.count
    assert said["noise"]["accel"]["time_jitter_s"] == pytest.approx(JITTER, rel=0.25)
    assert any("jitter by 0." in finding["what"] for finding in said["findings"])


def test_residuals_of_rows_that_share_a_late_reading_are_made_white():
    # C = 1 + s s' in each row + z z' over all; whitened twice, by W with W C W' = 1.
    random = np.random.default_rng(0)
    row, along, common = np.repeat(np.arange(5), 2), 2 * random.standard_normal(10), random.standard_normal((10, 1))
    covariance = np.eye(10) + np.where(row[:, None] == row, np.outer(along, along), 0.0) + common @ common.T
    white = Shaken.of(along, row, common).whitened(np.eye(10))
    assert np.allclose(white.T @ covariance @ white, np.eye(10), atol=1e-12)
