"""`hedgebed compare` of two runs of one robot: on two laws, on grains beside a law; what is refused."""

import json
import re
import shutil

import numpy as np
import pytest
from spatial_runs import grain_bed

from experiments.cli.main import main
from experiments.compare.robots import numbers_over_time, read_moved
from experiments.robot import experiment as robot
from experiments.robot.on_grains import RobotOnBed
from experiments.robot.settings import RobotSettings
from experiments.runs.folder import RunFolder, read_series

pytest.importorskip("mujoco", reason="mujoco is not installed: pip install 'hedgebed[mujoco]'")

HOPPER = {"model": "hopper", "feet": ("foot",), "frame_count": 0}


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """The leg on two laws, the second 0.1 s longer; a wheel is another robot."""
    home = tmp_path_factory.mktemp("runs")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("experiments.runs.whole_runs.write_report", lambda *_: None)
        robot.run(RobotSettings(**HOPPER, height=0.005, duration=0.15, ground="spring-damper"), home / "spring")
        robot.run(RobotSettings(**HOPPER, height=0.005, duration=0.25, ground="rft"), home / "rft")
        wheel = {"model": "wheel", "feet": ("wheel",), "frame_count": 0, "duration": 0.01}
        robot.run(RobotSettings(**wheel), home / "wheel")
    return home


def compared(first, second, out):
    assert main(["compare", str(first), str(second), "--no-pictures", "--quiet", "--out", str(out)]) == 0
    return json.loads((out / "result.json").read_text()), read_series(out / "series" / "compared.csv")


@pytest.mark.long
def test_two_laws_under_one_robot_stand_side_by_side_in_numbers_and_curves(runs, tmp_path):
    result, columns = compared(runs / "spring", runs / "rft", tmp_path / "both")
    assert [run["label"] for run in result["runs"]] == ["spring-damper", "rft"] and result["feet"] == ["foot"]
    assert columns["t_s"][-1] == pytest.approx(0.15)
    series = [read_series(runs / name / "series" / "motion.csv") for name in ("spring", "rft")]
    ends = [np.interp(0.15, run["t_s"], run["z_m"]) - run["z_m"][0] for run in series]
    assert result["quantities"]["gap_z_end"]["value"] == pytest.approx(ends[1] - ends[0], abs=1e-9)
    for number, run in enumerate(series, 1):
        # Both are means over 5 ms of the force on the one foot: their time integral is the impulse of the whole run.
        assert np.trapezoid(columns[f"load_foot_N_{number}"], columns["t_s"]) == pytest.approx(
            np.trapezoid(run["fz_N"][run["t_s"] <= 0.15], run["t_s"][run["t_s"] <= 0.15]), rel=0.03
        )
        assert columns[f"load_foot_N_{number}"] == pytest.approx(columns[f"lift_N_{number}"], abs=1e-6)
    rows = {row["name"]: row for row in result["compared"]}
    within = series[1]["t_s"] <= 0.15 + 1e-9
    assert rows["sinkage_largest"]["second"] == pytest.approx(series[1]["sinkage_m"][within].max())
    assert rows["sinkage_largest"]["difference"] < 0  # a flat foot is stiffer than a ball of the same area
    assert "ground" in {row["key"] for row in result["differs"]}
    assert (tmp_path / "both" / "report.html").read_text().count("data:image/png") == 4


@pytest.mark.long
def test_grains_stand_beside_a_law_and_grains_in_lammps_have_their_own_name(runs, tmp_path, monkeypatch):
    monkeypatch.setattr("experiments.runs.whole_runs.write_report", lambda *_: None)
    monkeypatch.setattr(RobotOnBed, "prepare", lambda *_: grain_bed())
    monkeypatch.setattr(RobotOnBed, "check", lambda *_: None)
    given = HOPPER | {"ground": "bed", "height": 0.006, "grain": 0.006, "bed_size": (0.096, 0.096, 0.05)}
    robot.run(RobotSettings(**given, duration=0.05), tmp_path / "bed")
    result, columns = compared(runs / "spring", tmp_path / "bed", tmp_path / "both")
    assert [run["label"] for run in result["runs"]] == ["spring-damper", "bed of sand"]
    assert columns["t_s"][-1] == pytest.approx(0.05, abs=2e-3) and columns["lift_N_2"].max() > 1.0
    assert "bed_size" not in {row["key"] for row in result["differs"]}
    other = tmp_path / "elsewhere"
    shutil.copytree(tmp_path / "bed", other)
    text = (other / "run.toml").read_text()
    (other / "run.toml").write_text(text.replace('ground = "bed"', 'ground = "lammps"'))
    (other / "status.json").unlink()
    result, _ = compared(tmp_path / "bed", other, tmp_path / "grains")
    assert [run["label"] for run in result["runs"]] == ["bed of sand", f"{'bed of sand'} in LAMMPS"]
    assert result["quantities"]["gap_lift"]["value"] == 0.0


@pytest.mark.long
def test_numbers_of_a_part_of_a_run_are_those_of_its_rows(runs):
    """Flights count from the first touch to the end of the part, and end with it."""
    moved = read_moved(runs / "spring", RunFolder.open(runs / "spring").read_result())
    own = RunFolder.open(runs / "spring").read_result()["quantities"]
    largest, final, events, counts = numbers_over_time(moved, float(moved.time[-1]))
    for name, (_, values) in largest.items():
        assert float(values.max()) == pytest.approx(own[name]["value"], rel=1e-6)
    for name, (_, values) in final.items():
        assert float(values[-1]) == pytest.approx(own[name]["value"], rel=1e-6, abs=1e-12)
    assert events["first_touch"] == pytest.approx(own["first_touch"]["value"])
    assert counts["flights"] == own["flights"]["value"]
    assert counts["longest_flight"] == pytest.approx(own["longest_flight"]["value"], abs=1e-3)
    *_, before = numbers_over_time(moved, 0.5 * events["first_touch"])
    assert before == {"flights": 0.0, "longest_flight": 0.0}


@pytest.mark.long
@pytest.mark.parametrize(
    ("other", "said"),
    [
        ("wheel", "has the feet foot, and .* has wheel. Expected: two runs of one robot with the same feet"),
        ("heavy", r"the robot of .* has 1\.72 kg, and that of .* has 9 kg"),
        ("bare", "has no series/feet.csv: run it again, `hedgebed mujoco "),
        ("old", r"series/feet.csv of .* has no foot_fz_N, foot_depth_m \(written by an older hedgebed\)"),
    ],
)
def test_runs_that_are_not_of_one_robot_or_lack_a_series_are_refused_by_name(runs, tmp_path, other, said, capsys):
    run = runs / "wheel"
    if other != "wheel":
        run = tmp_path / other
        shutil.copytree(runs / "rft", run)
        folder = RunFolder.open(run)
        if other == "heavy":
            result = folder.read_result()
            result["trial"]["mass"]["value"] = 9.0
            folder.write_result(result)
        elif other == "bare":
            (run / "series" / "feet.csv").unlink()
        else:
            (run / "series" / "feet.csv").write_text("t_s\n0\n")
        (run / "status.json").unlink()
    assert main(["compare", str(runs / "spring"), str(run), "--out", str(tmp_path / "out")]) == 2
    printed = " ".join(capsys.readouterr().err.split())
    assert re.search(said, printed), printed
    assert not (tmp_path / "out").exists()
