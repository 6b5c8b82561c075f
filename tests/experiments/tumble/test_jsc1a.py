"""The surface `jsc1a`: its K and C are those of kept pushes, and a run on it states how far they may be off."""

import csv
import json
import math
from pathlib import Path

import pytest

from experiments.platform.surfaces import find_surface
from experiments.tumble.settings import TumbleSettings
from experiments.tumble.trial import plan_tumble

PUSHES = Path(__file__).parents[3] / "docs/results/penetrate-jsc-1a-push"
OPEN = "times smaller or"


def spike():
    return json.loads((PUSHES / "numbers.json").read_text(encoding="utf-8"))["of a spike, 0 to 5 mm"]


def told(**given):
    return " ".join(plan_tumble(TumbleSettings(**given)).warnings)


def test_jsc1a_is_twice_its_spike_in_the_middle_of_the_range_that_the_pushes_leave():
    """The range goes from the lowest extrapolation that is not negative to K of the finest grains."""
    surface, found = find_surface("jsc1a"), spike()
    assert surface.stiffness == pytest.approx(2 * found["stiffness"], rel=0.01)
    assert surface.damping == pytest.approx(2 * found["damping"], rel=0.03)
    assert surface.stiffness_range == pytest.approx([2 * found["lowest"], 2 * found["highest"]], rel=0.01)
    with (PUSHES / "fits.csv").open(encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if (row["depth_mm"], row["tip_mm"]) == ("5", "12")]
    rows = [row for row in rows if row["gravity_m_s2"] == "9.80665"]
    finest = min(float(row["grain_mm"]) for row in rows)
    values = [float(row["K_N_m"]) for row in rows if float(row["grain_mm"]) == finest]
    assert found["highest"] == pytest.approx(sum(values) / len(values), rel=1e-4)
    assert found["lowest"] == min(found[key] for key in ("as_sand", "squared", "exponential") if found[key] > 0)
    assert math.sqrt(found["lowest"] * found["highest"]) == pytest.approx(found["stiffness"], rel=1e-9)
    assert surface.grains == "jsc-1a-loose-cut" and not surface.guess


def test_a_run_on_jsc1a_states_the_range_of_its_k_unless_k_is_given_or_another_s():
    low, high = find_surface("jsc1a").stiffness_range
    words = told(surface="jsc1a", rig=0.0085)
    assert OPEN in words and f"{low:.3g}" in words and f"{high:.3g}" in words
    assert OPEN not in told(surface="jsc1a", rig=0.0085, stiffness=500.0)
    assert OPEN not in told(surface="sand", rig=0.0085)


def test_in_flight_the_map_of_jsc_1a_is_named_and_no_k_in_proportion_to_gravity():
    words = told(surface="jsc1a", gravity=0.0834)
    assert "material jsc-1a-loose-cut" in words and "--gravity 0.0834" in words and "118 times" not in words
    assert "118 times" in told(surface="sand", gravity=0.0834)
