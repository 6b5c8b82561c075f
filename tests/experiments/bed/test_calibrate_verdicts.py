"""`hedgebed bed calibrate`: what is met, errors of 95 %, and a peak that is none."""

import math
import tomllib
from types import SimpleNamespace

import numpy as np
import pytest

from dem.measure.element import ElementShear
from experiments.calibrate import experiment as calibrate
from experiments.calibrate.result import _entry, _unmet
from experiments.calibrate.settings import CalibrateSettings, Target
from experiments.calibrate.tests import summary_of
from rigid.intervals import NORMAL, student
from vis.bed.calibrate import answer_tiles
from vis.page.numbers import quote

WANTED = {"value": 36.0, "tolerance": 1.0, "source": "made up"}


@pytest.mark.parametrize(
    ("measured", "verdict"),
    [((36.9, 0.42), "met"), ((37.4, 0.42), "not met; the tests' noise does not exclude it"), (None, "no value"),
     ((39.9, 0.42), "not met"), ((37.4, 0.05), "not met")],
)  # fmt: skip
def test_what_lies_outside_its_tolerance_is_not_met(measured, verdict):
    """The error counts by Student's t of the check's seeds: of three of them half is 4.3 standard errors."""
    target = Target(name="angle", figure="critical_friction_angle", state="loose", **WANTED)
    entry = _entry(target, measured, SimpleNamespace(response={}, response_std={}), None, 2)
    assert entry["verdict"] == verdict
    if measured == (37.4, 0.42):
        assert "37.4 ± 1.8" in _unmet(target, entry)


def sheared(stuff, seed, *, hump):
    """A sample whose stress ratio rises with rolling friction and fluctuates by 3 %; with a hump at a strain of 0.2."""
    strain = np.linspace(0, 1.2, 240)
    ratio = 0.5 + 0.3 * stuff.rolling_friction + hump * np.exp(-(((strain - 0.2) / 0.1) ** 2))
    ratio = ratio * (1 + 0.1 * np.random.default_rng(seed).standard_normal(len(strain)))
    zero, stress = 0 * strain[:20], 1000.0 * np.eye(3)[None].repeat(20, axis=0)
    normal = np.full(len(strain), 1000.0)
    return ElementShear(
        strain, 0 * strain, ratio * normal, normal, strain[::12], zero, stress, 1000.0, 5e-3, 0.57, 1e6, 100, 0.03
    )


@pytest.mark.parametrize("hump", [0.0, 0.2])
def test_a_peak_that_is_a_maximum_of_fluctuations_is_said_to_be_none(hump, tmp_path, monkeypatch):
    calls = []

    def run_test(stuff, test, settings, *, tell):
        calls.append(test)
        run = sheared(stuff, len(calls), hump=hump)
        return summary_of(run, stuff.density), {"strain": run.strain, "shear_Pa": run.shear, "normal_Pa": run.normal}

    monkeypatch.setattr(calibrate, "run_test", run_test)
    monkeypatch.setattr("experiments.runs.whole_runs.write_report", lambda *given: None)
    settings = CalibrateSettings(
        name="mine", free={"rolling_friction": (0.0, 0.8)}, points=5, most_points=5, check_seeds=(11, 12, 13), checks=1,
        targets={"peak_friction_angle": WANTED | {"state": "loose"}},
    )  # fmt: skip
    result = calibrate.run(settings, tmp_path / "run")
    (entry,) = result["figures"]
    warned = [text for text in result["warnings"] if "maximum of fluctuations" in text]
    kept = tomllib.loads((tmp_path / "run" / "material.toml").read_text())["calibration"]["peak_friction_angle"]
    assert len(warned) == (hump == 0.0) and ("peak" in kept) == ("no_peak" in entry) == (hump == 0.0)
    if hump == 0.0:  # what the noise adds: the largest less the mean at large strain
        late = math.degrees(math.atan(0.5 + 0.3 * result["quantities"]["rolling_friction"]["value"]))
        assert entry["no_peak"]["critical"] == pytest.approx(late, abs=0.5)
        assert entry["no_peak"]["excess"] == pytest.approx(entry["simulated"] - late, abs=0.5)
    shown = {tile.label: tile.value for tile in answer_tiles(result)}
    half = student(2) * entry["error"]
    assert shown["Peak friction angle"] == quote(entry["simulated"], half) + "°"
    rolling = result["quantities"]["rolling_friction"]
    assert shown["Rolling friction"] == quote(rolling["value"], NORMAL * rolling["std"])
