"""Cases that hold the bed against measured experiments: what is chosen, what counts, how curves are compared."""

import json
import math
from pathlib import Path

import numpy as np
import pytest

from experiments.validate import experiment
from experiments.validate.base.case import Case, Comparison, Outcome
from experiments.validate.measured import plates
from experiments.validate.pages import markdown
from experiments.validate.settings import ValidateSettings
from experiments.validate.suite import SUITE, chosen

ROOT = Path(__file__).parents[3]
PREDICTION = ROOT / "docs" / "results" / "plates-in-sand" / "prediction.json"


def test_measured_takes_the_cases_that_are_held_against_experiments_and_none_else():
    found = {case.id for case in chosen(held=True)}
    assert found == {case.id for case in SUITE if case.measured} >= {"plates-in-sand", "katsuragi-durian"}
    with pytest.raises(ValueError, match="quick and measured"):
        experiment.check(ValidateSettings(measured=True, quick=True))
    assert [case.id for case in chosen(["plates-in-sand"], held=True)] == ["plates-in-sand"]
    with pytest.raises(ValueError, match="only and measured"):
        chosen(["free-fall"], held=True)


def test_a_case_that_is_informational_does_not_count_as_failing(monkeypatch, tmp_path):
    outside = Outcome([Comparison("c", "m", 1.0, 1.5, 0.1)])
    cases = tuple(
        Case(id, "Held", "t", "r", "s", lambda tell: outside, measured=True, informational=told, reason="other sand")
        for id, told in (("shown", True), ("counted", False))
    )
    monkeypatch.setattr(experiment, "SUITE", cases)
    monkeypatch.setattr("experiments.validate.suite.SUITE", cases)
    result = experiment.run(ValidateSettings(measured=True), tmp_path / "run")
    assert [row["status"] for row in result["cases"]] == ["informational", "fail"]
    assert result["quantities"]["cases_fail"]["value"] == 1
    text = markdown(result, command="hedgebed validate")
    counted, told = text.index("#counted)** (1 of 1"), text.index("#shown)** (1 of 1")
    assert text.index("What fails") < counted < text.index("not counted") < told


def test_a_plate_goes_at_the_inertial_number_it_is_asked_for():
    """I = (v / D) d sqrt(rho / p), p = rho_bulk g D / 2."""
    for push in plates.pushes():
        pressure = plates.BULK_DENSITY * plates.GRAVITY * push.diameter / 2
        number = push.speed / push.diameter * push.grain * math.sqrt(plates.SAND.density / pressure)
        assert number == pytest.approx(plates.INERTIAL) and number < 0.01
        assert push.box[0] >= 3 * push.diameter - 1e-12


def test_curves_keep_a_straight_spring_and_the_power_of_the_diameter():
    grid = plates.grid_of(0.02)
    depth = np.sort(np.random.default_rng(1).uniform(0, 0.021, 4000))
    force = plates.on_grid({"depth": depth, "force": 5000 * depth}, grid)
    assert force == pytest.approx(5000 * grid, abs=0.5)
    assert plates.stiffness(grid, force) == pytest.approx(5000, rel=1e-3)
    assert plates.exponent(plates.PLATES, [3 * d**2.7 for d in plates.PLATES]) == pytest.approx(2.7)


def test_measured_pushes_are_read_at_their_fresh_forces_only():
    """Some twelve a second are fresh (README of the data): 10 to 15 s of a push at 100 Hz are about 100 to 200 rows."""
    found = list(plates.measured_pushes())
    assert sorted({diameter for diameter, *_ in found}) == pytest.approx(plates.PLATES)
    assert len(found) == 9
    for _, _, depth, force in found:
        assert len(depth) == len(force) < 400 and (np.diff(force) != 0).all()
        assert 0.016 < depth.max() < 0.04


def test_the_kept_prediction_is_of_these_settings_and_gives_the_numbers_of_the_table():
    prediction = json.loads(PREDICTION.read_text(encoding="utf-8"))
    assert prediction["settings"] == json.loads(json.dumps(plates.settings()))
    assert len(prediction["pushes"]) == len(plates.pushes())
    table = json.loads((ROOT / "docs" / "results" / "validate" / "result.json").read_text(encoding="utf-8"))
    row = next(one for one in table["cases"] if one["id"] == "plates-in-sand")
    found = {one.quantity: one for one in plates.compared_with(prediction).comparisons}
    assert found.keys() == {one["quantity"] for one in row["comparisons"]} and len(found) == 7
    for one in row["comparisons"]:
        assert found[one["quantity"]].ours == pytest.approx(one["ours"], rel=1e-3)
        assert found[one["quantity"]].reference == pytest.approx(one["reference"], rel=1e-6)
