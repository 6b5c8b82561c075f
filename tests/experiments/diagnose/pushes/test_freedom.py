"""The standard error of K rests on the scatter of few beds: its 95 % interval is Student's."""

from types import SimpleNamespace

import numpy as np
import pytest

from experiments.diagnose.core import freedom as module
from experiments.diagnose.core.freedom import Freedoms
from experiments.diagnose.fit.fitting import Fit
from experiments.diagnose.fit.problem import Parameter
from experiments.diagnose.push.design import _predicted

NOISE, BEDS, COUNT = 0.01, 0.02, 7


def fitted(*, known_std=(), beds=BEDS):
    """K of `COUNT` pushes, each a reading K (1 + b) of its own bed b, linear about K = 1 and b = 0; and a number of one
    reading of its own that no bed changes."""
    ids = [f"n{k}" for k in range(COUNT)]
    shared = (
        Parameter(name="stiffness", unit="N/m", value=1.0, scale=1.0),
        Parameter(name="edge", unit="m", value=0.0, scale=1.0),
    )
    own = Parameter(name="bed", unit="1", value=0.0, std=beds, scale=1.0).in_each(ids)
    ones = np.ones((COUNT, 1))
    slopes = np.block([[ones, 0 * ones, np.eye(COUNT)], [0.0, 1.0, np.zeros(COUNT)]]) / NOISE
    problem = SimpleNamespace(known_std=dict.fromkeys(known_std, 1.0))
    model = SimpleNamespace(parameters=(*shared, *own), scatter=own, problem=problem)
    free = np.ones(len(model.parameters), dtype=bool)
    return Fit(model, {p.name: p.value for p in model.parameters}, np.zeros(COUNT + 1), slopes, 0.0, 0.0, free)


@pytest.fixture(autouse=True)
def no_inflation(monkeypatch):
    monkeypatch.setattr(module, "inflation", lambda found: 1.0)


def freedom_of(found, place, given):
    covariance = found.covariance()
    slope = np.eye(len(covariance))[place]
    return Freedoms(found, covariance, given).of(slope, float(np.sqrt(covariance[place, place])))


def test_the_freedom_of_k_is_that_of_welch_and_satterthwaite():
    """Variance (s_bed² + s_noise²) / n, of which s_bed² / n has 2 degrees of freedom: 2 (1 + s_noise² / s_bed²)²."""
    found = fitted()
    assert found.covariance()[0, 0] == pytest.approx((NOISE**2 + BEDS**2) / COUNT)
    assert freedom_of(found, 0, 2) == pytest.approx(2 * (1 + (NOISE / BEDS) ** 2) ** 2)


def test_what_no_bed_changes_and_what_is_known_has_no_freedom():
    assert freedom_of(fitted(), 1, 2) is None
    assert freedom_of(fitted(), 0, None) is None
    assert freedom_of(fitted(known_std=("bed",)), 0, 2) is None
    assert freedom_of(fitted(beds=1e-4), 0, 2) is None


def test_a_planned_push_states_which_part_of_a_models_error_rests_on_the_beds():
    """K of seven beds: its variance (s_bed² + s_noise²) / 7, of which the beds make s_bed² / 7; F = K z."""
    found, z = fitted(), np.array([0.01, 0.02])

    def predict(points, diameter, time, z, v):
        return np.array([own["stiffness"] * z for own, _ in points])

    found.model.forms = ()
    _, errors, rests = _predicted(found, predict, 1.0, 0.02, z, z, z)
    assert np.linalg.norm(errors, axis=1) == pytest.approx(np.hypot(BEDS, NOISE) / COUNT**0.5 * z, rel=1e-6)
    assert rests == pytest.approx(BEDS / COUNT**0.5 * z, rel=1e-6)
