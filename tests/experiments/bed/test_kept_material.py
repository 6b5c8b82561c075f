"""A run with a material from a file has it with it: the file may go."""

import pytest
from fake_bed import FakeBed

from dem.grains.materials import SAND, material, read_material
from experiments.bed import make as bed_make
from experiments.bed import work as bed_work
from experiments.bed.settings import BedSettings
from experiments.calibrate import experiment as calibrate
from experiments.calibrate.settings import CalibrateSettings
from experiments.grains.kept_material import keep_material
from experiments.penetrate import beds
from experiments.penetrate import experiment as penetrate
from experiments.penetrate.settings import PenetrateSettings

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
        beds, "prepare_bed", lambda settings, seed, young, progress: FakeBed(size=settings.bed_size, seed=seed)
    )
    monkeypatch.setattr("experiments.runs.whole_runs.write_report", lambda *given: None)
    monkeypatch.setattr(beds, "bed_step", lambda settings, young: 2e-5)
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


def test_a_bed_and_a_calibration_go_on_without_the_file_that_their_material_came_from(tmp_path, monkeypatch):
    """The calibration's material.toml is what it finds; what it began with is base.toml."""
    used = []

    def stopped(stuff, *_, **options):
        used.append(material(stuff).density)
        raise RuntimeError("stopped")

    monkeypatch.setattr(bed_work, "prepare_as", lambda **options: stopped(options["material"]))
    monkeypatch.setattr(calibrate, "run_test", stopped)
    given = tmp_path / "mine.toml"
    wanted = {"critical_friction_angle": {"value": 30.0, "tolerance": 2.0, "source": "a guess"}}
    fitted = {"name": "new", "free": {"friction": (0.3, 0.6)}, "targets": wanted}
    ways = (
        (bed_make, BedSettings, {}, "material.toml"),
        (calibrate, CalibrateSettings, fitted, "base.toml"),
    )
    for module, settings, options, copy in ways:
        given.write_text(FILE)
        out = tmp_path / copy.replace(".toml", "")
        with pytest.raises(RuntimeError, match="stopped"):
            module.run(settings(material=str(given), **options), out)
        given.unlink()
        with pytest.raises(RuntimeError, match="stopped"):
            module.resume(out)
        assert (out / copy).read_text() == FILE
    assert used == [2700.0] * 4


def test_a_material_that_ships_needs_no_copy_and_one_that_is_none_is_refused(tmp_path):
    assert keep_material(SAND.name, tmp_path) == SAND.name and not list(tmp_path.iterdir())
    with pytest.raises(ValueError, match=r"nowhere\.toml' cannot be read"):
        keep_material("nowhere.toml", tmp_path)
