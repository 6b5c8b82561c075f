"""A case file on another ground, a refusal that names the reason, and where beds without a name are."""

import json
from pathlib import Path

import pytest

from experiments.cli.grounds import on_another_ground
from experiments.cli.main import main
from experiments.runs.reading import Layer, read_case, settings_from
from experiments.spatial.settings import SpatialSettings
from experiments.tumble.settings import TumbleSettings

LAMMPS = Path(__file__).resolve().parents[3] / "docs" / "results" / "lammps-tumble" / "100k" / "run.toml"


@pytest.mark.parametrize(
    ("ground", "left_out"),
    [
        ("bed", {"ranks"}),
        ("spring-damper", {"ranks", "bed_size", "frame_count", "grain"}),
        ("hunt-crossley", {"ranks", "bed_size", "frame_count", "grain", "stiffness", "damping"}),
        ("lammps", set()),
    ],
)
def test_a_file_on_another_ground_leaves_out_what_belongs_to_its_own(ground, left_out):
    typed = Layer(None, {"ground": ground})
    with_all = read_case(LAMMPS)
    (layer,), said = on_another_ground(TumbleSettings, [with_all], typed)
    assert set(with_all.values) - set(layer.values) == left_out
    assert len(said) == bool(left_out)
    assert all(f"{name} = " in said[0] for name in left_out)
    settings = settings_from(TumbleSettings, [layer, typed])
    assert settings.ground == ground and settings.torque == 0.22


def test_what_is_typed_is_not_left_out():
    typed = Layer(None, {"ground": "bed", "ranks": 2})
    layers, said = on_another_ground(TumbleSettings, [read_case(LAMMPS)], typed)
    assert not said and layers[0].values["ranks"] == 2
    with pytest.raises(ValueError, match="ranks = 2"):
        settings_from(TumbleSettings, [*layers, typed])
    assert on_another_ground(TumbleSettings, [read_case(LAMMPS)], Layer(None, {}))[1] == []


def test_a_landing_in_a_file_is_not_left_out(tmp_path):
    file = Layer("f", {"ground": "bed", "drop_speed": 0.1})
    typed = Layer(None, {"ground": "spring-damper"})
    (layer,), said = on_another_ground(TumbleSettings, [file], typed)
    assert layer.values["drop_speed"] == 0.1 and not said


def test_the_command_line_says_what_it_left_out(tmp_path, capsys):
    words = ["tumble", str(LAMMPS), "--ground", "spring-damper", "--duration", "0.05", "--out", str(tmp_path / "run")]
    assert main([*words, "--quiet"]) == 0
    told = capsys.readouterr().err
    assert "ranks = 2" in told and "left out" in told


def test_ranks_in_space_belong_to_lammps():
    with pytest.raises(ValueError, match="ground = 'lammps'"):
        SpatialSettings(ranks=2)


def test_a_list_of_beds_says_where_those_without_a_name_are(tmp_path, monkeypatch, capsys):
    shelf, cache = tmp_path / "shelf", tmp_path / "cache"
    monkeypatch.setenv("HEDGEBED_BEDS", str(shelf))
    monkeypatch.setenv("HEDGEBED_CACHE", str(cache))
    assert main(["bed", "list"]) == 0
    assert str(cache) not in capsys.readouterr().err
    (cache / "beds").mkdir(parents=True)
    for name in "ab":
        (cache / "beds" / f"sand-{name}.npz").touch()
    assert main(["bed", "list"]) == 0
    told = capsys.readouterr().err
    assert "none here yet" in told and "2 more" in told and str(cache / "beds") in told
    assert main(["bed", "list", "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == []
