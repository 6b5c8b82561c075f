"""A run that is stopped, or killed, has the report and the numbers of the beds that are whole, and goes on."""

import json

import pytest
from fake_bed import FakeBed, lay_closed_form
from golden import golden

from dem.grains.materials import Material
from experiments.cli.main import main
from experiments.penetrate import beds
from experiments.penetrate import experiment as penetrate
from experiments.penetrate.settings import PenetrateSettings
from experiments.runs.folder import RunFolder
from experiments.runs.whole_runs import keeping_status

SAND = Material("sand", 2650.0, 7e10, 0.25, 0.5, 0.5, 0.1)
SETTINGS = PenetrateSettings(
    seeds=(1, 2, 3), speeds=(0.2, 0.4), other_speeds=(0.4,), drop_speeds=(), other_drop_speeds=(), depth=0.01,
    frame_count=0, load=0.4, lowering_speed=0.1, substeps=20,
)  # fmt: skip
NUMBERS = ("stiffness", "damping", "sinkage_dem")


@pytest.fixture(autouse=True)
def fake(monkeypatch):
    lay_closed_form(monkeypatch, beds, SAND)


@pytest.fixture
def stopped(tmp_path, monkeypatch):
    """Folder of a run of three beds that is stopped in the last one."""
    folder = tmp_path / "run"
    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        prepare = beds.prepare_bed

        def until_the_third(settings, seed, young, progress):
            if seed == 3:
                patch.setattr(FakeBed, "advance", interrupted)
            return prepare(settings, seed, young, progress)

        def interrupted(self, steps, **options):
            raise KeyboardInterrupt

        patch.setattr(beds, "prepare_bed", until_the_third)
        with keeping_status(RunFolder.create(folder, "penetrate", SETTINGS)):
            penetrate.run(SETTINGS, folder)
    return folder


def test_a_stopped_run_has_the_numbers_of_its_whole_beds_and_goes_on_to_the_same_bits(stopped, tmp_path):
    part = json.loads((stopped / "result.json").read_text())
    assert (part["status"], {run["seed"] for run in part["runs"]}) == ("stopped", {1, 2})
    golden("penetrate/whole_beds", part["warnings"][:1])
    two = SETTINGS.model_copy(update={"seeds": (1, 2)})
    alone = penetrate.run(two, tmp_path / "two")
    for name in NUMBERS:
        assert part["quantities"][name] == alone["quantities"][name], name
    page = (stopped / "report.html").read_text()
    assert "2 of 3" in page and "stopped before" in page
    penetrate.resume(stopped)
    penetrate.run(SETTINGS, tmp_path / "whole")
    for path in [*(tmp_path / "whole").rglob("*.csv"), tmp_path / "whole" / "result.json"]:
        assert path.read_bytes() == (stopped / path.relative_to(tmp_path / "whole")).read_bytes(), path.name


def test_render_draws_what_a_killed_run_has_and_refuses_one_without_a_whole_bed(stopped, capfd):
    kept = (stopped / "result.json").read_bytes()
    for name in ("result.json", "report.html"):
        (stopped / name).unlink()
    assert main(["render", str(stopped), "--quiet"]) == 0
    assert "2 of 3" in capfd.readouterr().err
    assert (stopped / "result.json").read_bytes() == kept and (stopped / "report.html").is_file()
    assert RunFolder.open(stopped).status == "stopped"
    for path in [*(stopped / "checkpoint").glob("*set-down.done.json"), stopped / "result.json"]:
        path.unlink()
    assert main(["render", str(stopped), "--quiet"]) == 2
    assert "no bed is" in capfd.readouterr().err
    assert not (stopped / "result.json").exists()
