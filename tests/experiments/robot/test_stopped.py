"""A robot's run that is stopped, or killed, has series and numbers of what it has computed, and goes on to the same."""

import json
import re

import pytest
from spatial_runs import grain_bed
from tumble_runs import stop_at

from experiments.cli.main import main
from experiments.robot import experiment as robot
from experiments.robot import stopped
from experiments.robot.forms import NO_FORMS
from experiments.robot.on_grains import RobotOnBed
from experiments.robot.settings import RobotSettings
from experiments.runs.folder import RunFolder, read_series
from experiments.runs.result import Result
from experiments.runs.whole_runs import keeping_status

pytest.importorskip("mujoco", reason="mujoco is not installed: pip install 'hedgebed[mujoco]'")

ON_LAW = {"model": "hopper", "feet": ("foot",), "duration": 0.12, "frame_count": 0}
ON_BED = ON_LAW | {
    "ground": "bed", "grain": 0.006, "bed_size": (0.096, 0.096, 0.05), "height": 0.003, "duration": 0.03,
}  # fmt: skip
GROUNDS = {"law": ON_LAW, "bed": ON_BED}


@pytest.fixture(params=["law", pytest.param("bed", marks=pytest.mark.long)])
def begun(request, tmp_path, monkeypatch):
    """Settings and folder of a run that is stopped at its 60th exchange."""
    monkeypatch.setattr(RobotOnBed, "prepare", lambda *_: grain_bed())
    monkeypatch.setattr(RobotOnBed, "check", lambda *_: None)
    monkeypatch.setattr("experiments.robot.on_grains.forms_of", lambda *_, **__: NO_FORMS)
    monkeypatch.setattr("experiments.runs.whole_runs.write_report", lambda *_: None)  # of a run that is done
    settings, folder = RobotSettings(**GROUNDS[request.param]), tmp_path / "run"
    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        stop_at(patch, 60)
        with keeping_status(RunFolder.create(folder, "mujoco", settings)):
            robot.run(settings, folder)
    return settings, folder


def test_a_stopped_run_has_its_series_and_numbers_and_goes_on_to_the_same_bits(begun, tmp_path):
    settings, folder = begun
    part, motion = json.loads((folder / "result.json").read_text()), read_series(folder / "series" / "motion.csv")
    assert len(motion["t_s"]) == 61 and part["status"] == "stopped" and "stopped at" in part["warnings"][0]
    assert part["quantities"]["sinkage_largest"]["value"] == max(motion["sinkage_m"]) and "forms" not in part
    assert part["warnings"][0] in (folder / "report.html").read_text()
    robot.resume(folder)
    robot.run(settings, tmp_path / "whole")
    for path in [*(tmp_path / "whole").rglob("*.csv"), tmp_path / "whole" / "result.json"]:
        assert path.read_bytes() == (folder / path.relative_to(tmp_path / "whole")).read_bytes(), path.name


def test_render_draws_what_a_killed_run_has_computed_and_refuses_one_without_a_checkpoint(begun, capfd):
    _, folder = begun
    names = ["result.json", "trajectory.csv", *(path.relative_to(folder) for path in folder.glob("series/*.csv"))]
    kept = {name: (folder / name).read_bytes() for name in names}
    for name in (*names, "report.html"):
        (folder / name).unlink()
    RunFolder.open(folder).set_status("running")  # a process that is killed leaves it so
    assert main(["render", str(folder), "--quiet"]) == 0
    assert "stopped at" in capfd.readouterr().err and (folder / "report.html").is_file()
    assert {name: (folder / name).read_bytes() for name in names} == kept
    for path in [*(folder / "checkpoint").iterdir(), folder / "result.json"]:
        path.unlink()
    assert main(["render", str(folder), "--quiet"]) == 2
    assert "no checkpoint" in capfd.readouterr().err


def test_of_several_beds_those_that_are_done_count_when_there_are_two(tmp_path, monkeypatch):
    settings = RobotSettings(**ON_BED, seeds=(1, 2, 3))
    folder = RunFolder.create(tmp_path, "mujoco", settings)
    monkeypatch.setattr("experiments.robot.beds.over_beds", lambda seeds, results: Result.make(
        "mujoco", title="beds", quantities={}, seeds=list(seeds), warnings=["of one"]
    ))  # fmt: skip
    for seed in (1, 3):
        assert stopped.keep_whole_beds(settings, folder) is None
        home = RunFolder.create(tmp_path / "beds" / f"seed-{seed}", "mujoco", settings.of_bed(seed))
        home.write_result(Result.make("mujoco", title="bed", quantities={}))
        home.set_status("done")
    result = stopped.keep_whole_beds(settings, folder)
    assert result["seeds"] == [1, 3] and result.status == "stopped" == folder.read_result()["status"]
    assert re.findall("[0-9]", result.warnings[0]) == ["2", "3"] and len(result.warnings) == 2
