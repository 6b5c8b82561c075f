"""`--ground lammps`: settings that LAMMPS does not take are refused by name, before any work."""

import os
import re
import subprocess
from types import SimpleNamespace

import pytest

from coupling.lammps import LammpsBed, LammpsEndedError, LammpsMissingError, check_ranks, cohesion_fault, find_lammps
from dem import SAND
from dem.grains.materials import MATERIALS
from experiments.cli.main import main
from experiments.cli.runs import FAILED, carry_out
from experiments.grains import lammps
from experiments.grains.on_bed import PlatformOnBed
from experiments.penetrate.settings import PenetrateSettings
from experiments.runs.folder import RunFolder
from experiments.tumble.settings import TumbleSettings

TUMBLE, PENETRATE = {"ground": "lammps", "surface": "sand"}, {"ground": "lammps"}


@pytest.fixture
def anew():
    """LAMMPS is looked for anew, before and after a test with another one on the path."""
    for found in (check_ranks, cohesion_fault):
        found.cache_clear()
    yield
    for found in (check_ranks, cohesion_fault):
        found.cache_clear()


@pytest.mark.parametrize(
    ("made", "given", "named"),
    [
        (TumbleSettings, TUMBLE | {"iterations": 3}, r"iterations = 3 .* iterations = 1"),
        (TumbleSettings, TUMBLE | {"sleep": True}, "sleep = True"),
        (TumbleSettings, TUMBLE | {"arch": "cuda"}, "arch = 'cuda'"),
        (TumbleSettings, TUMBLE | {"gravity": 1.0, "settle_gravity": 2.0}, r"settle_gravity = 2\.0"),
        (TumbleSettings, {"ground": "bed", "surface": "sand", "ranks": 2}, r"ranks = 2 .*ground = 'bed'"),
        (TumbleSettings, {"surface": "sand", "ranks": 2}, "ranks"),
        (TumbleSettings, {"ground": "lamps", "surface": "sand"}, "lammps"),
        (PenetrateSettings, PENETRATE | {"precision": "float32"}, "precision = 'float32'"),
        (PenetrateSettings, PENETRATE | {"shaft_diameter": 0.008}, r"shaft_diameter = 0\.008 m .* 0\.012 m"),
        (PenetrateSettings, {"ranks": 2}, r"ranks = 2 .*ground = 'bed'"),
    ],
)
def test_what_lammps_does_not_take_is_refused_by_name(made, given, named):
    with pytest.raises(ValueError, match=named):
        made(**given)


def test_a_conical_tip_in_lammps_is_told_to_be_a_pyramid():
    given = {"tip": "cone", "tip_diameter": 0.012}
    said = lammps.cone_note(PenetrateSettings(**PENETRATE, **given))
    assert "pyramid" in said and "0.12 mm nearer" in said and "0.25 mm farther" in said
    assert (
        lammps.cone_note(PenetrateSettings(**given)) is None
        and lammps.cone_note(PenetrateSettings(**PENETRATE)) is None
    )


def test_grains_in_lammps_are_grains():
    assert TumbleSettings(**TUMBLE, ranks=2).on_grains
    assert TumbleSettings(**TUMBLE).duration == TumbleSettings(ground="bed", surface="sand").duration
    assert PenetrateSettings(**PENETRATE, ranks=2).on_grains
    assert not PenetrateSettings(ground="spring-damper", model="model.toml").on_grains


def test_displacements_and_overlaps_of_a_run_are_those_of_the_bed_in_lammps_not_of_the_prepared_one():
    marked = []
    prepared, moved = (SimpleNamespace(mark_origin=lambda name=name: marked.append(name)) for name in ("ours", "moved"))
    ground = SimpleNamespace(bed=moved)
    platform = SimpleNamespace(
        settings=TumbleSettings(**TUMBLE), ground=lambda bed: ground, run_on=lambda ground: ground.bed
    )
    assert PlatformOnBed.stepper(platform, prepared) is moved
    assert marked == ["moved"] and moved.max_overlap == 0.0
    assert not hasattr(prepared, "max_overlap")


@pytest.mark.usefixtures("anew")
def test_without_lammps_a_run_is_refused_with_what_to_install(monkeypatch, tmp_path, capsys):
    monkeypatch.setattr("coupling.lammps.process.shutil.which", lambda name, **options: None)
    settings = PenetrateSettings(**PENETRATE)
    with pytest.raises(ValueError, match=r"ground = 'lammps': .*hedgebed\[lammps\]"):
        lammps.check_lammps(settings, SAND)
    assert main(["penetrate", "--ground", "lammps", "--out", str(tmp_path / "run")]) == 2
    assert "hedgebed[lammps]" in capsys.readouterr().err


@pytest.mark.usefixtures("anew")
def test_cohesion_that_this_lammps_refuses_is_named_before_the_bed_is_prepared(monkeypatch, tmp_path, capsys):
    words = "granular wall/gran/region nve/sphere ave/time"
    answer = "ERROR: Cannot use tsuji model with a cohesive normal model, dmt (src/granular_model.cpp:271)"
    for name in ("lmp", "mpiexec"):
        text = f'#!/bin/sh\n[ "$1" = -help ] && echo {words} && exit\necho "  1 by 1 by 1 MPI processor grid"\n'
        (tmp_path / name).write_text(f'{text}grep -q pair_coeff probe && echo "{answer}"\n:\n', encoding="utf-8")
        (tmp_path / name).chmod(0o755)
    monkeypatch.setattr("sys.executable", str(tmp_path / "python"))
    lammps.check_lammps(PenetrateSettings(**PENETRATE), SAND)
    sticky = ["--ground", "lammps", "--material", "jsc-1a-loose-cut"]
    assert main(["penetrate", *sticky, "--out", str(tmp_path / "run")]) == 2
    said = capsys.readouterr().err.replace("\n", " ")
    assert re.search(r"'jsc-1a-loose-cut'.*'dmt'.*tsuji.*2021.*'bed'", said)
    bed = SimpleNamespace(state=lambda: {"numbers": (0, 1)}, has_floor=True, material=MATERIALS["jsc-1a-loose-cut"])
    with pytest.raises(ValueError, match=r"'jsc-1a-loose-cut'.*'dmt'.*tsuji"):
        LammpsBed(bed, ranks=1)


def test_lammps_of_2021_takes_cohesion_and_that_of_2025_is_refused_by_name():
    try:
        _, program = find_lammps()
    except LammpsMissingError as missing:
        pytest.skip(str(missing))
    told = subprocess.run([program, "-help"], capture_output=True, text=True, check=False).stdout
    if int(re.search(r"Simulator - .*?(20\d\d)", told)[1]) < 2022:
        assert cohesion_fault("jkr") is None and cohesion_fault("dmt") is None
    else:
        assert "cohesion is 'jkr'" in cohesion_fault("jkr")


@pytest.mark.parametrize(
    ("refused", "checkpoint", "said"),
    [
        (True, True, "the same settings would fail the same way again"),
        (False, True, r"hedgebed resume .*continues from the checkpoint of 2001-09-0\d "),
        (False, False, "has no checkpoint yet: `hedgebed resume .*anew"),
    ],
)
def test_after_an_end_of_lammps_it_is_said_from_where_a_resumed_run_goes_on(
    refused, checkpoint, said, tmp_path, capsys
):
    folder = RunFolder.create(tmp_path / "run", "penetrate", PenetrateSettings(**PENETRATE))

    def work(progress):
        if checkpoint:
            folder.save_checkpoint("push", {"x": 1.0})
            os.utime(folder.path / "checkpoint" / "push.npz", (1e9, 1e9))
        raise LammpsEndedError("LAMMPS has ended", refused=refused)

    assert carry_out(folder, work, as_json=False, quiet=True) == FAILED
    assert re.search(said, capsys.readouterr().err.replace("\n", " "))
