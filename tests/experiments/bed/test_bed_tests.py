"""Angle of repose, cone and cut: fits of made-up data come back exactly; each test made once, on one small bed."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from golden import golden

from dem import SAND, SAND_WEAK, Bed, BedFailure
from dem.measure import cutting
from dem.measure.cutting import cohesion_of, cut_and_load
from dem.measure.penetrometer import ConePush, cone_gradient, cone_length, standard_speed
from dem.measure.repose import fit_flank
from experiments.bed import shear
from experiments.bed.test_settings import BedConeSettings, BedCutSettings, BedReposeSettings
from experiments.bed.tests import of_beds, quantity
from experiments.cli.main import BAD_INPUT, DONE, main
from experiments.runs.folder import read_series
from vis.bed import tests as bed_cut
from vis.bed.errors import in_95
from vis.bed.tests import quoted

GRAIN = 0.004
SIZE = (0.072, 0.038, 0.02)
WIDE = (0.128, 0.024, 0.032)
ONE = ["--seeds", "1", "--threads", "1", "--quiet"]
BED = ["--size", *map(str, SIZE), *ONE]


def test_a_slope_is_fitted_between_foot_and_crest():
    """A line of 31 degrees between a foot that runs out and a level crest: tan 31 comes back, whatever the two do."""
    x = np.linspace(0.5, 39.5, 40)
    line = math.tan(math.radians(31.0)) * (x - 4.0)
    crest = 12.0
    profile = np.where(line < 0.15 * crest, 0.15 * crest * np.exp((x - 7.0) / 2), np.minimum(line, 0.9 * crest))
    flank = fit_flank(x, np.minimum(profile, 0.9 * crest), crest=0.9 * crest)
    assert flank is not None and flank.points > 8
    assert flank.angle == pytest.approx(31.0, abs=1e-9) and flank.error < 1e-9 and flank.foot == pytest.approx(4.0)
    assert fit_flank(x, np.where(x < 10, 0.0, crest), crest=crest) is None  # a vertical face is no slope


def test_the_cone_s_gradient_is_that_of_a_made_up_push():
    """q = 2 kPa + 3 MPa/m of the base's depth, once the cone is all in; before, less."""
    length = cone_length(0.02, 60.0)
    assert length == pytest.approx(0.01 * math.sqrt(3.0))
    depth = np.linspace(0.0, 0.05, 101)
    index = np.where(depth < length, 5e4 * depth, 2e3 + 3e6 * (depth - length))
    push = ConePush(depth, index * math.pi * 1e-4, 0.02, length, 60.0, 0.03, (0.0, 0.0), 0.1, 0.6, 0.0)
    assert cone_gradient(push) == pytest.approx((3e6, 2e3))
    assert standard_speed(0.02027, 9.80665) == pytest.approx(0.030)
    assert standard_speed(4 * 0.02027, 9.80665) == pytest.approx(0.060)


def test_cohesion_of_a_critical_height_is_terzaghi_s():
    """H_c = 4 c / gamma tan(45 + phi / 2): 2 kPa and 30 degrees at 16 kN/m3 stand to 0.866 m."""
    assert cohesion_of(4 * 2e3 / 16e3 * math.sqrt(3.0), 16e3, 30.0) == pytest.approx(2e3)
    assert cohesion_of(1.0, 16e3, 0.0) == pytest.approx(4e3)


def test_the_spread_of_runs_and_the_error_of_one():
    two = [{"a": 1.0, "e": 9.0}, {"a": 3.0, "e": 9.0}]
    assert quantity(two, "a", "m", "x", error="e")["std"] == pytest.approx(2**0.5)
    runs: list = [{"a": None, "e": 0.4}, {"a": 1.0, "e": 0.5}]
    one = quantity(runs, "a", "m", "x", error="e")
    assert (one["value"], one["std"], one["unit"]) == (1.0, 0.5, "m")
    golden("bed/note_of_one_run", one["note"])
    assert quantity(runs[:1], lambda run: run["a"], "m", "x")["value"] is None


@pytest.fixture(scope="module")
def home(tmp_path_factory):
    """A cache that the three tests share, so that the bed is rained in once."""
    return tmp_path_factory.mktemp("tests")


@pytest.fixture
def cache(home, monkeypatch):
    monkeypatch.setenv("HEDGEBED_CACHE", str(home / "cache"))
    return home


def result_of(folder):
    assert (folder / "report.html").exists()
    assert {"profiles.png", "index.png"} & {file.name for file in (folder / "figures").iterdir()}
    return json.loads((folder / "result.json").read_text())


@pytest.mark.parametrize(
    ("test", "measure", "own"), [("repose", "angle_of_repose", []), ("cut", "cut_and_load", ["--width", "0.03"])]
)
def test_the_bound_on_overlaps_is_a_setting_and_else_that_of_the_bed(test, measure, own, tmp_path, monkeypatch):
    """Its message proposes a larger bound: the bed that is tested has it."""
    bounds = []

    def stop(bed, **options):
        bounds.append(bed.overlap_limit)
        raise BedFailure("seen")

    monkeypatch.setattr(f"experiments.bed.{test}.{measure}", stop)
    places = [[x, 0.01, 0.00199] for x in np.arange(0.002, WIDE[0], 0.004)]
    Bed.from_grains(
        SAND, positions=places, radii=[0.002] * len(places), size=WIDE, young=1e7, threads=1, max_overlap=0.04
    ).save(tmp_path / "bed.npz")
    for k, given in enumerate([[], ["--max-overlap", "0.12"]]):
        tokens = ["--bed", str(tmp_path / "bed.npz"), "--threads", "1", "--quiet", "--out", str(tmp_path / f"{k}")]
        assert main(["bed", "test", test, *tokens, *own, *given]) not in (DONE, BAD_INPUT)
    assert bounds == [0.04, 0.12]
    assert main(["bed", "test", test, *tokens, "--max-overlap", "0.3"]) == BAD_INPUT


@pytest.mark.slow
def test_sand_drains_to_its_angle_of_repose(cache):
    """Between the angles of spheres without rolling friction and of the steepest sands; what stays has its volume."""
    assert main(["bed", "test", "repose", "--size", *map(str, WIDE), *ONE, "--out", str(cache / "repose")]) == DONE
    result = result_of(cache / "repose")
    (run,) = result["runs"]
    assert 15 < result["quantities"]["angle_of_repose"]["value"] < 40
    assert result["quantities"]["angle_of_repose"]["std"] == pytest.approx(run["error"])
    profile = read_series(cache / "repose" / run["series"])
    slot = np.abs(profile["x_m"]) < 0.5 * run["slot"] - GRAIN
    assert profile["thickness_m"][slot].max() < 1.5 * GRAIN < profile["thickness_m"].max()
    volume = (1 - run["drained"] / run["grain_count"]) * WIDE[0] * run["surface"]
    spacing = profile["x_m"][1] - profile["x_m"][0]
    assert profile["thickness_m"].sum() * spacing == pytest.approx(volume, rel=0.1)


@pytest.mark.long
def test_a_cone_meets_more_the_deeper_it_goes(cache):
    options = ["--diameter", "0.0125", "--depth", "0.0125", "--angle", "80", "--pushes", "1", "--speed", "0.06"]
    assert main(["bed", "test", "cone", *BED, *options, "--out", str(cache / "cone")]) == DONE
    result = result_of(cache / "cone")
    (run,) = result["runs"]
    assert run["gradient"] > run["packing_fraction"] * 2650 * 9.81  # more than a fluid of that density
    push = read_series(cache / "cone" / run["series"])
    assert push["depth_m"][-1] == pytest.approx(0.0125, rel=1e-3)
    assert push["force_N"][push["depth_m"] < 0].max() < 0.1 * push["force_N"].max()
    assert any("3.1 grains across" in warning for warning in result["warnings"])


@pytest.mark.slow
def test_a_face_of_sand_does_not_stand(cache):
    assert main(["bed", "test", "cut", *BED, "--width", "0.02", "--out", str(cache / "cut")]) == DONE
    result = result_of(cache / "cut")
    (run,) = result["runs"]
    assert run["stood"] == 0 and run["fell"] == pytest.approx(0.1) and run["critical_height"] is None
    assert result["quantities"]["cohesion"]["value"] is None
    assert any("no face stood at 0.1 of the bed's gravity" in warning for warning in result["warnings"])


@pytest.mark.slow
def test_a_face_of_grains_that_stick_stands_to_a_height_of_their_strength(tmp_path, monkeypatch):
    """Rumpf's tensile strength, packing Z F / pi d^2, times tan phi of about 0.5 bounds the cohesion from above."""
    monkeypatch.setenv("HEDGEBED_CACHE", str(tmp_path))
    stuff = replace(SAND_WEAK, name="sticky", cohesion="dmt", surface_energy=0.1)
    bed = Bed.prepare(stuff, size=(18 * GRAIN, 6 * GRAIN, 6 * GRAIN), grain=GRAIN, seed=1, threads=1)
    pull_off = 4 * math.pi * stuff.surface_energy * GRAIN / 4  # 4 pi gamma R*, R* = d / 4
    strength = bed.packing_fraction * bed.coordination_number * pull_off / (math.pi * GRAIN**2)
    cut = cut_and_load(bed, width=4 * GRAIN)
    assert cut.critical_height is not None and cut.stood < cut.fell <= cut.stood * 2**0.5
    assert cut.bounds[0] < cut.critical_height < cut.bounds[1]
    assert 0.1 < cohesion_of(cut.critical_height, cut.unit_weight, 30.0) / strength < 0.6


@pytest.mark.parametrize(
    ("command", "options", "said"),
    [
        ("repose", ["--size", "0.08", "0.03", "0.03"], "size: x = 0.08 m is too narrow for a slot of 0.024 m"),
        ("repose", ["--bed", "none-such"], "bed = 'none-such' is no file"),
        ("repose", ["--bed", "x", "--grain", "0.003"], "grain = 0.003 beside bed = 'x'"),
        ("cone", ["--diameter", "0.01"], "diameter = 0.01 m: give three grains, 0.012 m"),
        ("cone", ["--angle", "20"], "goes from 0.05671 m, where it is all in, to 0.04 m"),
        ("cut", ["--size", "0.05", "0.03", "0.04"], "width = 0.04 m of the cut"),
        ("cut", ["--seeds", "1", "1"], "seeds holds a seed twice"),
    ],
)
def test_what_cannot_be_tested_is_refused(command, options, said, tmp_path, capsys):
    assert main(["bed", "test", command, *options, "--out", str(tmp_path / "run")]) == BAD_INPUT
    assert said in " ".join(capsys.readouterr().err.split())
    assert not (tmp_path / "run").exists()


def test_defaults_can_be_run():
    from experiments.bed import cone as bed_cone
    from experiments.bed import cut as bed_cut
    from experiments.bed import repose as bed_repose

    for module, settings in (
        (bed_repose, BedReposeSettings()),
        (bed_cone, BedConeSettings()),
        (bed_cut, BedCutSettings()),
    ):
        module.check(settings)


def test_the_line_above_which_a_face_has_fallen_is_drawn_where_it_falls():
    assert bed_cut.FALLEN_SHARE == cutting.FALLEN_SHARE
    golden("bed/when_a_face_has_fallen", bed_cut.say("cut_method_1"))


def test_errors_of_bed_tests_are_halves_of_95_percent_intervals():
    """Student's t, from tables: 4.303 for 2 degrees of freedom, 12.71 for 1; 1.96 for what one run knows."""
    mean = {"value": 31.0, "std": 1.5, "unit": "degrees", "note": "drained; std: between 3 runs"}
    one = mean | {"note": "drained; std: error of the one run"}

    def half(test, count, **quantities):
        runs = [{"id": f"seed{k % 3}-{k}"} for k in range(count)]
        found = in_95({"experiment": f"bed test {test}", "runs": runs, "quantities": quantities})
        return pytest.approx(next(iter(found.values()))["std"], rel=1e-3)

    assert half("repose", 3, angle_of_repose=mean) == 4.303 * 1.5 / math.sqrt(3)
    assert half("repose", 1, angle_of_repose=one) == 1.96 * 1.5
    assert half("cut", 1, critical_height=one) == 1.5  # it lies between what stood and what fell
    line, exact = {"value": 34.0, "std": 0.57, "note": ""}, {"value": 2.0, "std": None}
    assert half("shear", 3, critical_friction_angle=line) == 12.71 * 0.57
    assert half("shear", 3, critical_ratio=line) == 4.303 * 0.57 / math.sqrt(3)
    assert half("plates", 42, gradient_1=line) == 4.303 * 0.57  # three beds
    assert in_95({"experiment": "bed test cone", "runs": [{}], "quantities": {"gradient": exact}})["gradient"] == exact
    assert bed_cut.PARTS == shear.PARTS


def test_numbers_of_a_bed_before_its_test_count_each_bed_once():
    """Three copies of one bed do not make its packing known three times."""
    packing = {"seed1": 0.56, "seed2": 0.58}
    runs = [{"id": f"{bed}-{k}", "packing_fraction": packing[bed], "grain_count": 9, "max_overlap": 0.1 * k}
            for bed in packing for k in (1, 2, 3)]  # fmt: skip
    found = of_beds(runs, "grains")["packing_fraction"]
    assert found["value"] == pytest.approx(0.57) and found["std"] == pytest.approx(0.02 / math.sqrt(2))
    assert found["note"].endswith("between 2 runs")


@pytest.mark.parametrize(
    ("value", "std", "words"), [(0.164, 0.0143, "164 ± 14 mm"), (0.0584, 0.00504, "58 ± 5 mm"), (0.05, None, "50 mm")]
)
def test_a_tile_has_the_digits_that_its_error_lets_it_have(value, std, words):
    told = quoted({"value": value, "std": std, "unit": "m"}, 1e3, " mm").replace("\N{NO-BREAK SPACE}", " ")
    assert told.replace("50.0", "50") == words
