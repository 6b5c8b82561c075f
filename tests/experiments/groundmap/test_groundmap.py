"""`hedgebed ground`: the map gives back the runs it is made of, scales as dry grains do, refuses the rest."""

import dataclasses
import json
import math
import re
from pathlib import Path

import pytest

from experiments import groundmap as ground
from experiments.cli.main import BAD_INPUT, DONE, main
from experiments.groundmap.experiment import ground_file
from experiments.groundmap.make import made_map
from experiments.groundmap.maps import read_map
from experiments.groundmap.settings import GroundSettings
from rigid.ground_file import read_ground
from rigid.intervals import NORMAL

RESULTS = Path(__file__).parents[3] / "docs" / "results"
POINT = {"gravity": 9.80665, "diameter": 0.012, "grain": 0.0002, "packing": None, "load": None}


def kept(name):
    return json.loads((RESULTS / name / "result.json").read_text(encoding="utf-8"))


def test_the_map_that_ships_is_the_one_of_the_kept_results():
    """maps.toml has six digits of what `make` computes from docs/results."""
    made, shipped = made_map(), read_map("sand")
    assert shipped.factors == pytest.approx(made["packing"]["factors"], rel=1e-5)
    assert shipped.packings == pytest.approx(made["packing"]["fractions"], rel=1e-5)
    for name, line in shipped.lines.items():
        assert line.values == pytest.approx(made[name]["values"], rel=1e-4)


def test_at_the_reference_it_answers_as_the_flagship_with_all_its_errors():
    answer = read_map("sand").answer(**POINT)
    flagship = kept("converge-flagship")["convergence"]
    for name in ("stiffness", "damping", "sinkage"):
        number = getattr(answer, name)
        assert number.value == pytest.approx(flagship[name]["value"], rel=1e-4)
        assert number.std == pytest.approx(flagship[name]["total"] / NORMAL, rel=1e-4)


def test_in_grains_that_were_run_it_is_within_its_error_of_their_mean():
    """K at d / D of 1/12, 1/8 and 1/5: the means over beds, on a line that misses them by less than one std."""
    for size in kept("converge-flagship")["convergence"]["stiffness"]["sizes"]:
        answer = read_map("sand").answer(**POINT | {"grain": 0.012 * size["x"]})
        assert abs(answer.stiffness.value - size["mean"]) < answer.stiffness.std
        assert answer.stiffness.std < 0.4 * answer.stiffness.value


def test_numbers_scale_as_those_of_grains_without_cohesion():
    """K as g D^2, C as sqrt(g) D^2.5, sinkage as D under a load as g D^3, all at one d / D; errors alike."""
    table = read_map("sand")
    first = table.answer(**POINT)
    other = table.answer(**POINT | {"gravity": 9.80665e-4, "diameter": 0.03, "grain": 0.0005})
    assert other.stiffness.value / first.stiffness.value == pytest.approx(1e-4 * 2.5**2)
    assert other.damping.value / first.damping.value == pytest.approx(1e-2 * 2.5**2.5)
    assert other.sinkage.value / first.sinkage.value == pytest.approx(2.5)
    assert other.load / first.load == pytest.approx(1e-4 * 2.5**3)
    assert other.stiffness.std / other.stiffness.value == pytest.approx(first.stiffness.std / first.stiffness.value)


def test_runs_at_another_gravity_and_size_follow_the_scaling_of_the_map():
    """One bed each at 1e-3 g and at twice the size: K, C and sinkage within two std of a bed of the scaled mean."""
    base = kept("ground-map/sand-rained")["quantities"]
    for name, g, size in (("sand-rained-1e-3g", 1e-3, 1), ("sand-rained-24mm", 1, 2)):
        found = kept(f"ground-map/{name}")["quantities"]
        scales = {"stiffness": g * size**2, "damping": math.sqrt(g) * size**2.5, "sinkage_dem": size}
        for key, scale in scales.items():
            assert abs(found[key]["value"] / scale - base[key]["value"]) < 2 * base[key]["std"]


def test_the_ground_file_ends_at_the_froude_number_of_the_runs_and_its_load_holds_the_rate_part():
    """The flagship drove at 0.1 and 0.4 m/s into 12 mm at 1 g; load = K D + C v."""
    table = read_map("sand")
    for gravity, diameter, speed in ((9.80665, 0.012, 0.4), (9.80665e-2, 0.048, 0.08)):
        settings = GroundSettings(gravity=gravity, tip_diameter=diameter, grain=diameter / 60)
        answer = table.answer(**POINT | {"gravity": gravity, "diameter": diameter, "grain": diameter / 60})
        limits = ground_file(settings, table, answer).range
        assert limits["speed"][1] == pytest.approx(speed)
        rate = answer.damping.value * speed
        assert limits["load"][1] == pytest.approx(answer.stiffness.value * diameter + rate)


def test_the_error_of_packing_is_student_s_and_grows_with_the_way_from_the_beds_that_measured_it():
    """Seven beds in three packings have four degrees of freedom: t = 2.776. Far from their d / D the factor is open."""
    table = read_map("sand")
    results = [
        kept(f"ground-map/{name}")["quantities"]["stiffness"] for name in ("sand-rained", "sand-0.575", "sand-0.60")
    ]
    squares = [(entry["std"] / entry["value"]) ** 2 for entry in results]
    pooled = math.sqrt((2 * squares[0] + squares[1] + squares[2]) / 4)
    expected = 2.776 / NORMAL * pooled * math.sqrt(1 / 3 + 1 / 2)
    assert table.factor_stds[2] / table.factors[2] == pytest.approx(expected, rel=1e-3)
    dense = POINT | {"packing": table.packings[-1]}
    near, far = (table.answer(**dense | {"grain": grain}).stiffness for grain in (0.0024, 0.0002))
    assert near.std < 0.3 * near.value and far.std > far.value


def test_a_sinkage_that_is_extrapolated_is_less_sure_and_one_below_a_grain_is_told():
    table = read_map("sand")
    own = table.answer(**POINT)
    light = table.answer(**POINT | {"load": 0.1 * own.load})
    assert own.deep and not light.deep
    assert light.sinkage.std / light.sinkage.value > own.sinkage.std / own.sinkage.value
    sure = dict(table.reference) | {"exponent_std": 0.0}
    same = dataclasses.replace(table, reference=sure).answer(**POINT | {"load": 0.1 * own.load})
    assert same.sinkage.value == light.sinkage.value and same.sinkage.std < light.sinkage.std


def test_a_denser_bed_is_stiffer_and_sinks_less_and_a_heavier_spike_sinks_more():
    table = read_map("sand")
    loose, dense = (table.answer(**POINT | {"packing": table.packings[k]}) for k in (0, -1))
    assert dense.stiffness.value > loose.stiffness.value and dense.sinkage.value < loose.sinkage.value
    heavy = table.answer(**POINT | {"load": 2 * loose.load})
    assert heavy.sinkage.value > 1.5 * loose.sinkage.value


@pytest.mark.parametrize(
    ("options", "named"),
    [
        (["--gravity", "1e-9"], "gravity"),
        (["--gravity", "20"], "gravity"),
        (["--spike-diameter", "0.5"], "tip_diameter"),
        (["--packing", "0.7"], "packing"),
        (["--grain", "0.004"], "grain"),
        (["--load", "1e-9"], "grain"),
        (["--material", "mud"], "material"),
        (["--material", "jsc-1a-loose"], "docs/penetrate.md"),
        (["--material", "jsc-1a-dense"], "--material jsc-1a-dense-cut "),
        (["--material", "jsc-1a-dense-cut"], "--material jsc-1a-dense-cut "),
        (["--material", "jsc1a"], "--material jsc-1a-loose-cut "),
        (["--tip", "flat"], "bed foot"),
        (["--tip", "cone"], "penetrate --tip cone"),
    ],
)
def test_what_is_beyond_the_map_is_refused_by_name(options, named, tmp_path, capsys):
    assert main(["ground", *options, "--out", str(tmp_path / "run"), "--quiet"]) == BAD_INPUT
    assert named in capsys.readouterr().err


@pytest.mark.parametrize("material", ["sand", "jsc-1a-loose-cut"])
def test_a_load_that_sinks_the_spike_beyond_the_map_leaves_the_law_and_no_sinkage(material, tmp_path):
    """K and C are those of another load: they do not depend on it."""
    options = ["ground", "--material", material, "--spike-diameter", "0.016", "--quiet"]
    for name, load in (("heavy", ["--load", "500"]), ("own", [])):
        assert main([*options, *load, "--out", str(tmp_path / name)]) == DONE
    heavy, own = (json.loads((tmp_path / name / "result.json").read_text("utf-8")) for name in ("heavy", "own"))
    assert heavy["quantities"]["sinkage"]["value"] is None and heavy["quantities"]["load"]["value"] == 500.0
    assert heavy["quantities"]["stiffness"]["value"] == own["quantities"]["stiffness"]["value"]
    files = [read_ground(tmp_path / name / "ground.toml") for name in ("heavy", "own")]
    assert files[0].parameters == files[1].parameters and files[0].range == files[1].range
    (said,) = [said for said in heavy["warnings"] if "sinkage" in said and "500 N" in said]
    assert "not known" in said
    assert "not known" in (tmp_path / "heavy" / "report.html").read_text("utf-8")


def test_the_command_writes_a_ground_file_that_a_tumble_takes(tmp_path):
    out = tmp_path / "run"
    assert main(["ground", "--out", str(out), "--quiet"]) == DONE
    fitted = read_ground(out / "ground.toml")
    quantities = json.loads((out / "result.json").read_text(encoding="utf-8"))["quantities"]
    assert fitted.values["stiffness"] == pytest.approx(quantities["stiffness"]["value"])
    assert fitted.parameters["damping"].std == pytest.approx(quantities["damping"]["std"])
    assert fitted.range["gravity"] == (9.80665, 9.80665)
    assert (out / "report.html").is_file()
    ground = ["--ground", str(out / "ground.toml"), "--duration", "0.2"]
    assert main(["tumble", *ground, "--out", str(tmp_path / "tumble"), "--quiet"]) == DONE


def test_a_file_of_low_gravity_is_answered_in_a_rig_by_the_gravity_that_it_needs(tmp_path, capsys):
    """In a rig the grains are at 1 g: the refusal names both gravities, and the command that makes the right file."""
    low = tmp_path / "low"
    assert main(["ground", "--gravity", "0.0085g", "--out", str(low), "--quiet"]) == DONE
    tumble = ["tumble", "--ground", str(low / "ground.toml"), "--rig", "0.0085", "--torque", "0.22"]
    assert main([*tumble, "--out", str(tmp_path / "tumble"), "--quiet"]) == BAD_INPUT
    told = capsys.readouterr().err
    assert "0.0085 g" in told and "--gravity 1g" in told
    assert "0.6613 N/m" in told and "0.0289 N" in told
    assert main(["fmu", str(tmp_path / "g.fmu"), "--ground", str(low / "ground.toml")]) == BAD_INPUT
    assert "--gravity 1g" in capsys.readouterr().err


def test_a_load_that_was_not_given_is_set_beside_the_weight_of_a_platform(tmp_path):
    """At 1 g and 12 mm it is that of the Hedgehog in the rig; elsewhere the warning has the weight there, m g / 4."""
    low = ground.run(ground.Settings(gravity=0.0085 * 9.80665), tmp_path / "low")
    assert low["quantities"]["load"]["value"] == pytest.approx(0.219 * 0.0085)
    assert any("grains stick" in text for text in low["warnings"])  # where their weight is small
    assert "0.11 N" in low["warnings"][0] and "12 mm" in low["warnings"][0]
    small = ground.run(ground.Settings(tip_diameter=0.01, grain=0.001), tmp_path / "small")
    assert "0.219 N" in small["warnings"][0] and " ± " in small["warnings"][0]
    for name, settings in (("rig", ground.Settings()), ("given", ground.Settings(gravity=1.0, load=0.01))):
        assert not any("Hedgehog" in text for text in ground.run(settings, tmp_path / name)["warnings"])


def test_c_is_called_not_identified_where_its_interval_contains_zero_and_only_there(tmp_path):
    shipped = ground.run(ground.Settings(), tmp_path / "fine")
    coarse = ground.run(ground.Settings(tip_diameter=0.1, grain=0.02), tmp_path / "coarse")
    for result in (shipped, coarse):
        c = result["quantities"]["damping"]
        told = any("not identified" in text for text in result["warnings"])
        assert told == (c["value"] <= NORMAL * c["std"])
    assert any("not identified" in text for text in shipped["warnings"])
    assert not any("grains stick" in text for text in shipped["warnings"])  # at 1 g


def test_the_terminal_has_two_digits_of_each_number_millimetres_and_says_that_the_tip_is_a_ball(tmp_path, capsys):
    assert main(["ground", "--threads", "1", "--out", str(tmp_path / "run")]) == DONE
    told = capsys.readouterr()
    shown = " ".join(told.out.split())
    assert "ball tip" in shown and "s/m 2.2 N" in shown
    flagship = kept("converge-flagship")["quantities"]  # its sum of all errors, of 95 %, is that of the map
    k, depth = (flagship[name] for name in ("stiffness", "sinkage"))
    assert "± all" in shown and "(95" in shown
    assert re.search(rf"K {k['value']:.0f} N/m {k['total']:.0f} N/m", shown)
    assert re.search(rf"{1e3 * depth['value']:.1f} mm {1e3 * depth['total']:.0f} mm", shown)
    assert "threads = 1" in told.err
    page = (tmp_path / "run" / "report.html").read_text(encoding="utf-8")
    assert "D / D" not in page and "0.16" in page


def test_the_report_of_a_tumble_on_a_file_has_the_95_percent_error_of_its_angle_and_of_every_number(tmp_path, capsys):
    assert main(["ground", "--out", str(tmp_path / "run"), "--quiet"]) == DONE
    ground = tmp_path / "run" / "ground.toml"
    tumble = ["tumble", "--duration", "1", "--rig", "0.0085", "--quiet", "--out", str(tmp_path / "beyond"), "--ground"]
    assert main([*tumble, str(ground)]) == DONE
    assert "beyond range" in capsys.readouterr().out
    text = re.sub(r"^load = .*$", "load = [0.0, 1.0]", ground.read_text(encoding="utf-8"), flags=re.MULTILINE)
    wider = tmp_path / "wider.toml"
    wider.write_text(re.sub(r"^depth = .*$", "depth = [0.0, 0.03]", text, flags=re.MULTILINE), encoding="utf-8")
    tumble[tumble.index(str(tmp_path / "beyond"))] = str(tmp_path / "tumble")
    assert main([*tumble, str(wider)]) == DONE
    angle = json.loads((tmp_path / "tumble" / "result.json").read_text(encoding="utf-8"))["quantities"]
    value, std = (math.degrees(angle["trajectory_angle"][key]) for key in ("value", "std"))
    half = NORMAL * std
    assert re.search(rf"Trajectory angle +{value:.0f}° +none +{half:.0f}°", capsys.readouterr().out)
    page = (tmp_path / "tumble" / "report.html").read_text(encoding="utf-8")
    assert f">{value:.0f}°<" in page and f">{half:.0f}°<" in page
    assert "± law" in page and "no scatter" in page and ">std<" in page
