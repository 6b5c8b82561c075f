"""How sure a sinkage or K is: the kept trends, and the intervals that follow from them."""

import json
import math
import shutil
from dataclasses import asdict
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from golden import golden
from scipy import stats

from dem.grains.materials import REAL_GRAINS, read_material, real_grain_of
from experiments.penetrate.headline import penetrate_headline
from experiments.penetrate.rest import sinkage_interval
from experiments.penetrate.settings import PenetrateSettings
from experiments.penetrate.sure import (
    in_words,
    interval_of_rest,
    interval_of_sinkage,
    interval_of_stiffness,
    trends,
)
from vis.page.folder import read_folder
from vis.penetrate import summary
from vis.penetrate.summary import summarise

KEPT = Path(__file__).resolve().parents[3] / "docs" / "results"
FLAGSHIP = json.loads((KEPT / "converge-flagship" / "result.json").read_text(encoding="utf-8"))["convergence"]
FOOT = json.loads((KEPT / "penetrate-foot-sand-1g" / "result.json").read_text(encoding="utf-8"))
TIP, REAL = 0.012, 0.0002


def pooled(groups):
    """Standard deviation within groups, and its degrees of freedom."""
    squares = sum(((np.array(group) - np.mean(group)) ** 2).sum() for group in groups)
    freedom = sum(len(group) - 1 for group in groups)
    return math.sqrt(squares / freedom), freedom


def test_the_trends_are_those_of_the_kept_runs():
    sunk, stiff = FLAGSHIP["sinkage"], FLAGSHIP["stiffness"]
    coarse, least = 0.2, REAL / TIP  # d / D of five grains across, and of real grains
    trend = trends()["sinkage"]
    assert trend.slope == pytest.approx(-sunk["slope"] / TIP, rel=1e-3)
    at_coarse = sunk["value"] + sunk["slope"] * (coarse - least)
    farthest = max(sunk["without_coarsest"], sunk["squared"]) + sunk["chance"]
    assert trend.most == pytest.approx((farthest - at_coarse) / (coarse - least) / TIP, rel=1e-3)
    std, freedom = pooled([np.array(size["values"]) / (size["x"] * TIP) for size in sunk["sizes"]])
    assert (trend.std["sphere"], trend.freedom["sphere"]) == (pytest.approx(std, rel=3e-3), freedom)

    trend = trends()["stiffness"]
    assert trend.slope == pytest.approx(stiff["slope"] / stiff["value"], rel=1e-3)
    softest = min(stiff["without_coarsest"], stiff["squared"]) - stiff["chance"]
    assert trend.most == pytest.approx(stiff["value"] / softest, rel=1e-3)
    std, freedom = pooled([np.log(size["values"]) for size in stiff["sizes"]])
    assert (trend.std["sphere"], trend.freedom["sphere"]) == (pytest.approx(std, rel=3e-3), freedom)


def test_the_spread_of_flat_feet_is_that_of_the_kept_feet():
    depths = [run["quantities"]["sinkage"]["value"] for run in FOOT["runs"] if run["kind"] == "set_down"]
    std, freedom = pooled([np.array(depths) / FOOT["bed"]["grain"]])
    trend = trends()["sinkage"]
    assert (trend.std["flat"], trend.freedom["flat"]) == (pytest.approx(std, rel=5e-3), freedom)
    low = json.loads((KEPT / "penetrate-foot-sand-beds" / "result.json").read_text(encoding="utf-8"))
    std, freedom = pooled([np.log([fit["stiffness"] for fit in result["fits"]]) for result in (FOOT, low)])
    trend = trends()["stiffness"]
    assert (trend.std["flat"], trend.freedom["flat"]) == (pytest.approx(std, rel=5e-3), freedom)


@pytest.mark.parametrize("size", range(3))
@pytest.mark.parametrize("beds", [1, 3])
def test_the_interval_of_each_grain_size_contains_what_real_grains_have(size, beds):
    """Flagship: 4.87 mm and 38.9 N/m, extrapolated from the three sizes; each alone gives an interval around it."""
    tip = {"tip": "sphere", "real": REAL, "cohesive": False}
    sunk, stiff = (FLAGSHIP[name]["sizes"][size] for name in ("sinkage", "stiffness"))
    grain = sunk["x"] * TIP
    depth = interval_of_sinkage(sunk["values"][:beds], grain=grain, **tip)
    assert 0 <= depth.low < FLAGSHIP["sinkage"]["value"] < depth.high
    assert depth.one_bed == (beds == 1)
    own = stiff["values"][:beds]
    k = interval_of_stiffness(float(np.mean(own)), own, grain=grain, diameter=TIP, **tip)
    assert 0 < k.low < FLAGSHIP["stiffness"]["value"] < k.high


def test_chance_of_several_beds_is_students_interval():
    values = [0.001, 0.002, 0.004]
    half = stats.t.ppf(0.975, 2) * np.std(values, ddof=1) / math.sqrt(3)
    found = interval_of_sinkage(values, tip="cone", grain=REAL, real=REAL, cohesive=False)
    assert found.chance == pytest.approx((np.mean(values) - half, np.mean(values) + half))
    assert found.grain_size == pytest.approx((found.value, found.value))  # real grains already
    assert (found.low, found.high) == (0.0, pytest.approx(found.chance[1]))


def test_nothing_is_claimed_that_no_run_shows():
    """Grains that stick: no kept trend. A cone in one bed: no kept spread. A set-down that does not rest: no value."""
    sticky = interval_of_sinkage([0.001], tip="flat", grain=0.003, real=0.0, cohesive=True)
    assert (sticky.chance, sticky.grain_size, sticky.low, sticky.high) == (None, None, None, None)
    two = interval_of_sinkage([0.001, 0.002], tip="flat", grain=0.003, real=0.0, cohesive=True)
    assert two.chance is not None and two.grain_size is None and two.high is None
    cone = interval_of_sinkage([0.001], tip="cone", grain=0.003, real=REAL, cohesive=False)
    assert cone.chance is None and cone.grain_size is not None and cone.high is None
    assert interval_of_sinkage([None, None], tip="flat", grain=0.003, real=REAL, cohesive=False) is None
    own = {"tip": "flat", "grain": 0.003, "real": REAL, "diameter": 0.016, "cohesive": False}
    assert interval_of_stiffness(0.0, [0.0], **own) is None


def test_a_bed_whose_force_does_not_grow_with_depth_leaves_the_depth_to_rest_open():
    """K of 0, 0.2 and 0.4 N/m: Student's interval begins below 0, so there is no deepest end."""
    own = {"tip": "flat", "grain": 0.0032, "real": REAL, "diameter": 0.016, "cohesive": False}
    k = interval_of_stiffness(0.2, [0.0, 0.2, 0.4], **own)
    half = stats.t.ppf(0.975, 2) * 0.2 / math.sqrt(3)
    assert k.chance == (0.0, pytest.approx(0.2 + half))
    assert interval_of_rest(0.5, k, 3.0) == (pytest.approx(0.5 / k.high), None)


def test_the_interval_of_k_holds_the_fit_of_all_runs_and_the_mean_of_the_beds():
    """Beds of about 70 N/m, and 81 N/m by all runs, of which one bed has more: both estimates are in the interval."""
    own = {"tip": "sphere", "grain": 0.0024, "real": REAL, "diameter": TIP, "cohesive": False}
    values = [69.0, 68.0, 74.0]
    low, high = interval_of_stiffness(81.0, values, **own).chance
    assert low < min(values) and high > 81.0


def test_the_depth_to_rest_has_the_ends_of_k_and_the_other_estimate():
    own = {"tip": "flat", "grain": 0.0032, "real": REAL, "diameter": 0.016, "cohesive": False}
    k = interval_of_stiffness(0.3, [0.2, 0.3, 0.4], **own)
    low, high = interval_of_rest(0.5, k, 3.0)
    assert (low, high) == pytest.approx((0.5 / k.high, 0.5 / k.low))
    assert interval_of_rest(0.5, k, 1e3)[1] == 1e3
    sticky = interval_of_stiffness(0.3, [0.3], **own | {"cohesive": True})
    assert interval_of_rest(0.5, sticky, 3.0) is None


def test_terminal_and_report_state_the_sinkage_among_real_grains(tmp_path):
    """Three feet: chance 1.1 mm, up to 5.9 mm deeper: 0 to 6.6 mm, and no K of a foot that stands."""
    result = json.loads(json.dumps(FOOT))
    depths = [run["quantities"]["sinkage"]["value"] for run in FOOT["runs"] if run["kind"] == "set_down"]
    own = interval_of_sinkage(depths, tip="flat", grain=0.0032, real=REAL, cohesive=False)
    result["sure"] = {"sinkage_dem": {"unit": "m", "sentence": "so", **asdict(own)}}
    result["quantities"]["stiffness_standing"] = {"value": 6400.0, "std": None, "unit": "N/m"}
    rows = [" ".join(row) for row in penetrate_headline(result).rows[:2]]
    (tmp_path / "result.json").write_text(json.dumps(result), encoding="utf-8")
    shutil.copy(KEPT / "penetrate-foot-sand-1g" / "run.toml", tmp_path)
    tiles = {tile["label"]: tile for tile in summarise(read_folder(tmp_path))["tiles"]}
    golden("penetrate/foot_among_real_grains", [
        *rows,
        tiles["Sinkage among real grains (95 %)"]["note"], tiles["Fitted stiffness K"]["note"],
    ])  # fmt: skip


@pytest.mark.parametrize(
    ("ends", "words"),
    [
        ((0.0, 0.0073), "0|7.3 mm"),
        ((0.64, 26.6), "0.64|27 m"),
        ((-0.002, 0.001), "−2|1.0 mm"),
        ((-0.004, -0.0039999), "−4.0|−4.0 mm"),
    ],
)
def test_two_ends_have_one_unit(ends, words):
    assert in_words(*ends, "m").split(" to ") == words.split("|")


def test_the_size_of_real_grains_is_that_of_the_material(tmp_path, monkeypatch):
    """0.2 mm of the sand that ships; of a file what it states, else 0: an upper bound of the error."""
    read, read_text = [], Path.read_text
    stated, silent, wrong = (tmp_path / f"{name}.toml" for name in ("stated", "silent", "wrong"))
    lines = ['format = "hedgebed-material/1"', 'name = "mine"', "density = 2900.0", "young = 70e9", "poisson = 0.25"]
    lines += ["friction = 0.5", "restitution = 0.5"]
    for path, more in ((stated, "real_grain = 0.3e-3"), (silent, ""), (wrong, "real_grain = 0.0")):
        path.write_text("\n".join([*lines, more]) + "\n")
    assert summary.REAL_GRAINS == REAL_GRAINS  # `vis` imports nothing of `dem`
    assert [real_grain_of(name) for name in ("sand", str(stated), str(silent))] == [2e-4, 3e-4, None]
    assert read_material(stated) == read_material(silent)  # the simulated grains are the same
    with pytest.raises(ValueError, match=r"real_grain = 0\.0 must be"):
        read_material(wrong)
    monkeypatch.setattr(Path, "read_text", lambda path, **options: read.append(path) or read_text(path, **options))
    assert real_grain_of(stated) == 3e-4 and read == [stated]  # once
    bed = {"grain": 0.003, "material": "mine"}
    assert "10 times larger" in summary._caveat({"bed": bed | {"real_grain": 3e-4}}, {})
    assert not summary._caveat({"bed": bed | {"real_grain": None}}, {})
    for path, real in ((stated, 3e-4), (silent, 0.0)):
        settings = PenetrateSettings(material=str(path), grain=0.004, allow_coarse=True)
        findings = SimpleNamespace(settings=settings, beds={}, sinkages=lambda beds: [0.001, 0.0011])
        found = sinkage_interval(findings, read_material(path))
        assert found.grain_size[1] - found.value == pytest.approx(trends()["sinkage"].most * (0.004 - real))
