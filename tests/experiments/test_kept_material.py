"""A run with a material from a file has it with it: the file may go."""

import pytest
from fake_bed import FakeBed

from dem.materials import SAND, read_material
from experiments import penetrate
from experiments.kept_material import keep_material
from experiments.settings import PenetrateSettings

FILE = """format = "hedgebed-material/1"
name = "mine"
density = 2700.0
young = 70e9
poisson = 0.25
friction = 0.5
restitution = 0.5
"""


def test_a_run_goes_on_without_the_file_that_its_material_came_from(tmp_path, monkeypatch):
    monkeypatch.setattr(
        penetrate, "prepare_bed", lambda settings, seed, young, progress: FakeBed(size=settings.bed_size, seed=seed)
    )
    monkeypatch.setattr(penetrate, "write_report", lambda *given: None)
    monkeypatch.setattr(penetrate, "bed_step", lambda settings, young: 2e-5)
    given, out = tmp_path / "mine.toml", tmp_path / "run"
    given.write_text(FILE)
    settings = PenetrateSettings(
        material=str(given), seeds=(1,), speeds=(0.4,), drop_speeds=(), depth=0.01, frame_count=0, load=0.4, substeps=20
    )
    first = penetrate.run(settings, out)
    assert first["bed"]["material"] == "mine" and first["title"].endswith("in mine")
    assert read_material(out / "material.toml").density == 2700.0
    given.unlink()
    assert penetrate.resume(out)["bed"] == first["bed"]


def test_a_material_that_ships_needs_no_copy_and_one_that_is_none_is_refused(tmp_path):
    assert keep_material(SAND.name, tmp_path) == SAND.name and not list(tmp_path.iterdir())
    with pytest.raises(ValueError, match=r"nowhere\.toml' cannot be read"):
        keep_material("nowhere.toml", tmp_path)
