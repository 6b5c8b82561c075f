"""`hedgebed bed`: made, stopped and resumed, listed, shown, shared, refined; what cannot be is refused by name."""

import json
from contextlib import contextmanager

import pytest
from golden import golden

import experiments.bed.work
from dem import Bed
from dem.measure.shearing import shear_bed
from dem.prepare.bedfile import read_preparation
from experiments.bed import make as bed_make
from experiments.bed import refine as bed_refine
from experiments.bed.settings import BedRefineSettings, BedSettings
from experiments.cli.main import BAD_INPUT, DONE, STOPPED, main
from experiments.penetrate.settings import PenetrateSettings
from experiments.runs.folder import read_series
from hedgebed_taichi import ti

MAKE = ["bed", "make", "--stages", "rain", "--size", "0.024", "0.024", "0.02", "--threads", "1", "--quiet"]
MAKE += ["--young", "1.2e7"]  # for the spike that is driven in: 9.2e6 would do for the bed's own weight


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A small bed, rained only, stopped once on the way; its folder and its shelf."""
    home = tmp_path_factory.mktemp("bed")
    words = iter([False, False])

    @contextmanager
    def stops_soon():
        yield lambda: next(words, True)

    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("HEDGEBED_BEDS", str(home / "shelf"))
        patch.setenv("HEDGEBED_NO_OPENGL", "1")
        patch.setattr(experiments.bed.work, "held_back", stops_soon)
        assert main([*MAKE, "--name", "rained", "--out", str(home / "run")]) == STOPPED
        assert (home / "run" / "checkpoint" / "bed.npz").exists()
        patch.undo()
        patch.setenv("HEDGEBED_BEDS", str(home / "shelf"))
        patch.setenv("HEDGEBED_NO_OPENGL", "1")
        assert main(["resume", str(home / "run"), "--quiet"]) == DONE
    return home


@pytest.fixture
def shelf(made, monkeypatch):
    monkeypatch.setenv("HEDGEBED_BEDS", str(made / "shelf"))
    return made / "shelf"


def test_a_bed_is_made_and_its_folder_says_what_every_stage_left(made):
    run = made / "run"
    result = json.loads((run / "result.json").read_text())
    assert result["format"] == "hedgebed-result/1" and result["experiment"] == "bed make"
    (stage,) = result["stages"]
    assert stage["stage"] == "rain" and "kinetic energy" in stage["criterion"]
    assert 0.5 < result["quantities"]["packing_fraction"]["value"] < 0.64
    profile = read_series(run / stage["series"])
    assert profile["stress_zz_Pa"][0] > profile["stress_zz_Pa"][-1] > 0
    assert (run / "frames" / "bed.pvd").exists() and (run / "figures" / "profiles.png").exists()
    page = (run / "report.html").read_text()
    assert "Stage by stage" in page
    golden("bed/warnings_of_a_small_bed", result["warnings"])
    assert not list((run / "checkpoint").glob("bed.npz"))
    assert read_preparation(run / "bed.npz").recipe["stages"] == ["rain"]


def test_beds_are_listed_shown_and_shared(made, shelf, tmp_path, capsys):
    assert main(["bed", "list", "--json"]) == DONE
    (entry,) = json.loads(capsys.readouterr().out)
    assert entry["name"] == "rained" and entry["stages"] == ["rain"]
    assert main(["bed", "list"]) == DONE and "rained" in capsys.readouterr().out
    assert main(["bed", "show", "rained", "--json"]) == DONE
    assert json.loads(capsys.readouterr().out)["reports"][0]["stage"] == "rain"
    assert main(["bed", "show", str(made / "run")]) == DONE and "rain" in capsys.readouterr().out
    assert main(["bed", "share", "rained", str(tmp_path / "sent.npz")]) == DONE
    capsys.readouterr()
    assert main(["bed", "list", str(tmp_path)]) == DONE and "sent" in capsys.readouterr().out


def test_a_name_that_is_taken_is_refused(shelf, tmp_path, capsys):
    assert main([*MAKE, "--name", "rained", "--out", str(tmp_path / "run")]) == BAD_INPUT
    assert "'rained'" in capsys.readouterr().err
    assert not (tmp_path / "run").exists()


def test_refining_keeps_the_recipe_and_asks_for_the_packing_that_was_there(shelf):
    """Stages, size, material as before, half the grain; surface energy in proportion, so that strength stays."""
    options, coarse = bed_refine.refined_options(BedRefineSettings(bed="rained"))
    assert options["grain"].mean == 0.002 and options["grain"].spread == 0.15
    assert options["stages"] == ["rain", f"packing:{coarse.reports[-1].packing_fraction:.4f}"]
    assert options["size"] == (0.024, 0.024, 0.02) and options["seed"] == 1
    bed_refine.check(BedRefineSettings(bed="rained"))
    with pytest.raises(ValueError, match=r"grain = 0.004 m is not smaller than the bed's, 0.004 m"):
        bed_refine.check(BedRefineSettings(bed="rained", grain=0.004))
    recipe = coarse.recipe
    recipe["material"] |= {"cohesion": "dmt", "surface_energy": 0.8}
    recipe["stages"] = ["rain", "fluff", "level", "tilt:5"]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(bed_refine, "read_preparation", lambda path: type(coarse)(None, recipe, coarse.reports * 4))
        for keep, energy in (("strength", 0.4), ("bond", 0.2), ("surface-energy", 0.8)):
            options, _ = bed_refine.refined_options(BedRefineSettings(bed="rained", keep=keep))
            assert options["material"].surface_energy == pytest.approx(energy)
    assert options["stages"][:2] == ["rain", "fluff"] and options["stages"][-2:] == ["level", "tilt:5"]


def test_a_bed_that_does_not_say_how_it_was_made_is_not_refined(shelf, tmp_path):
    Bed.load(shelf / "rained.npz", threads=1).save(tmp_path / "plain.npz")
    with pytest.raises(ValueError, match="does not state how it was prepared"):
        bed_refine.check(BedRefineSettings(bed=str(tmp_path / "plain.npz")))


def test_a_gpu_that_is_not_there_is_refused_before_any_work(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(ti.lang.misc, "is_arch_supported", lambda arch: False)
    assert main(["bed", "make", "--arch", "cuda", "--out", str(tmp_path / "run")]) == BAD_INPUT
    said = capsys.readouterr().err
    assert "arch = 'cuda'" in said and "arch = 'cpu'" in said
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--stages", "rain", "fluf"], "'fluf' is no stage; did you mean 'fluff'"),
        (["--stages", "rain", "compact:0.8"], "packing = 0.8 is no packing fraction"),
        (["--size", "0.01", "0.04", "0.03"], "size: x = 0.01 m is less than 6 grains"),
        (["--young", "1e12"], "young = 1e+12 Pa is more than sand itself has"),
        (["--time-step", "0.01"], "time_step = 0.01 s"),
        (["--grain", "1e-6"], "grain = 1e-06 m makes about"),
    ],
)
def test_what_cannot_be_made_is_refused_before_any_work(options, said, tmp_path, capsys):
    assert main(["bed", "make", *options, "--out", str(tmp_path / "run")]) == BAD_INPUT
    assert said in capsys.readouterr().err.replace("\nhedgebed: ", " ")
    assert not (tmp_path / "run").exists()


def test_a_packing_that_turns_out_to_be_out_of_reach_is_bad_input_with_what_was_reached(tmp_path, capsys, monkeypatch):
    def unreachable(**options):
        raise ValueError("packing = 0.63 cannot be reached: 8 taps brought the bed from 0.55 to 0.57")

    monkeypatch.setattr(experiments.bed.work, "prepare_as", unreachable)
    assert main([*MAKE, "--out", str(tmp_path / "run")]) == BAD_INPUT
    assert "packing = 0.63" in capsys.readouterr().err


def test_a_spike_goes_into_a_bed_that_was_made(made, shelf, tmp_path):
    """--bed decides size, grains, gravity, seed and softness; the run starts from that very bed."""
    options = ["penetrate", "--bed", "rained", "--tip-diameter", "0.006", "--depth", "0.0045", "--allow-coarse"]
    options += ["--speeds", "0.15", "--other-speeds", "none", "--drop-speeds", "none", "--threads", "1", "--quiet"]
    options += [
        "--shaft-length",
        "0.03",
        "--frame-count",
        "0",
        "--load",
        "0.05",
        "--rest-time",
        "0.005",
        "--retreat-speed",
        "0.2",
    ]
    assert main([*options, "--out", str(tmp_path / "run")]) == DONE
    result = json.loads((tmp_path / "run" / "result.json").read_text())
    of_bed = json.loads((made / "run" / "result.json").read_text())["quantities"]
    for name in ("packing_fraction", "grain_count", "coordination_number", "young", "time_step"):
        assert result["quantities"][name]["value"] == of_bed[name]["value"], name
    with pytest.raises(ValueError, match=r"grain = 0.003 beside bed = 'rained', whose own is 0.00"):
        PenetrateSettings(bed="rained", grain=0.003, tip_diameter=0.006, allow_coarse=True)
    with pytest.raises(ValueError, match="bed = 'rainde' is no file"):
        PenetrateSettings(bed="rainde")


def test_a_bed_is_sheared_from_the_command_line(shelf, tmp_path):
    """The servo holds the pressure; the strength lies between that of slick grains and that of interlocked ones."""
    words = ["bed", "test", "shear", "rained", "--pressures", "2", "4", "--way", "4", "--inertial-number", "0.02"]
    assert main([*words, "--threads", "1", "--quiet", "--out", str(tmp_path / "run")]) == DONE
    result = json.loads((tmp_path / "run" / "result.json").read_text())
    for run in result["runs"]:
        assert run["normal"] == pytest.approx(run["pressure"], rel=0.1)
        assert 0.2 < run["critical"] / run["normal"] <= run["peak"] / run["normal"] < 1.5
    assert result["quantities"]["critical_friction_angle"]["std"] is None  # two runs: no error can be told
    assert (tmp_path / "run" / "figures" / "mohr-coulomb.png").exists()
    assert "Mohr-Coulomb" in (tmp_path / "run" / "report.html").read_text()


def test_a_lid_that_presses_harder_than_the_grains_bear_is_refused(shelf):
    bed = Bed.load(shelf / "rained.npz", threads=1)
    floor = bed.weight / (bed.size[0] * bed.size[1])
    with pytest.raises(ValueError, match="is more than 4 times what lies on the bed's floor"):
        shear_bed(bed, pressure=5 * floor, way=0.004, inertial_number=0.01, grain=0.004)


@pytest.mark.parametrize(
    ("command", "said"),
    [
        ("cone", "diameter = 0.016 m: give three grains"),
        ("cut", "m wide, and a cut"),
        ("repose", "size: x = 0.024 m is too narrow for a slot of"),
    ],
)
def test_a_bed_too_small_for_its_test_is_refused_before_any_work(command, said, shelf, tmp_path, capsys):
    words = ["bed", "test", command, "--bed", "rained", "--out", str(tmp_path / "run")]
    assert main(words) == BAD_INPUT
    assert said in " ".join(capsys.readouterr().err.split())
    assert not (tmp_path / "run").exists()


def test_the_settings_and_the_stages_are_what_the_bed_is_made_from():
    bed_make.check(BedSettings(stages=("rain", "fluff", "level")))
    assert BedSettings().stages == ("rain", "level")
