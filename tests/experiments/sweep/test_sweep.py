"""A sweep in one process: its table, sensitivities and page; what is done is not done twice; a run that fails."""

import ast
import json
import math
import pickle
import re
import subprocess
import sys
from importlib.metadata import entry_points
from pathlib import Path

import numpy as np
import pytest

from experiments.cli.main import main
from experiments.pool import tasks
from experiments.runs.folder import RunFolder
from experiments.sweep import Settings, design, experiment, result
from rigid.series import read_series
from vis.report import write_report

pytestmark = pytest.mark.usefixtures("unreported")
TUMBLES = ["--experiment", "tumble", "--fixed", "duration=0.3", "--workers", "1", "--quiet"]


def sweep(out, *tokens):
    return main(["sweep", *TUMBLES, *tokens, "--out", str(out)])


def table(out):
    return read_series(out / "table.csv")


def test_the_table_has_what_the_runs_alone_have_to_the_bit(tmp_path):
    assert sweep("swept", "--over", "torque=[0.15, 0.2]", "mu_s=[0.4, 0.5]") == 0
    assert main(["tumble", "--duration", "0.3", "--torque", "0.2", "--mu-s", "0.4", "--out", "alone", "--quiet"]) == 0
    found, alone = table(tmp_path / "swept"), json.loads((tmp_path / "alone" / "result.json").read_text())
    place = np.flatnonzero((found["torque"] == 0.2) & (found["mu_s"] == 0.4))
    assert len(found["run"]) == 4 and len(place) == 1
    for name, head in (("max_speed", "max_speed_m_s"), ("slip_torque", "slip_torque_N_m")):
        assert found[head][place[0]] == alone["quantities"][name]["value"]
    member = tmp_path / "swept" / "members" / found["run"][place[0]]
    assert (member / "result.json").read_bytes() == (tmp_path / "alone" / "result.json").read_bytes()


def test_few_runs_are_listed_one_by_one_and_many_by_their_spread_with_angles_in_degrees(tmp_path):
    whole = ["--experiment", "tumble", "--fixed", "duration=0.9", "max_motor_torque=1", "--workers", "1", "--quiet"]
    assert main(["sweep", *whole, "--over", "torque=[0.15, 0.6]", "mu_s=[0.4, 0.5]", "--out", "few"]) == 0
    assert sweep("many", "--over", "torque=0.06:0.22:0.02") == 0
    few, many = (json.loads((tmp_path / name / "result.json").read_text())["tables"][0] for name in ("few", "many"))
    rows = {row[0]: row[1:] for row in few["rows"]}
    torque, friction = (row[1:] for row in few["rows"] if row[0].startswith(("torque on", "coefficient")))
    assert torque == ["N m", "0.15", "0.15", "0.6", "0.6"] and friction == ["", "0.4", "0.5", "0.4", "0.5"]
    speeds = table(tmp_path / "few")["max_speed_m_s"]
    assert [float(cell) for cell in rows["max speed"][1:]] == pytest.approx(speeds, rel=1e-3)
    assert rows["sinkage largest"][0] == "mm"
    angles = np.degrees(table(tmp_path / "few")["transition_angle_hop_rad"])
    assert np.nanmax(angles) > 1
    unit, *found = rows["θ at the first hop"]
    assert unit == "degrees" and [cell == "–" for cell in found] == np.isnan(angles).tolist()
    assert [float(cell) for cell in found if cell != "–"] == pytest.approx(angles[~np.isnan(angles)], rel=1e-3)
    assert len(many["head"]) == 5 and len(many["rows"]) < len(few["rows"])


def test_a_sweep_has_no_picture_and_view_names_one_of_its_runs(tmp_path, capsys):
    assert sweep("swept", "--over", "torque=[0.15, 0.2]") == 0
    capsys.readouterr()
    assert main(["view", "swept", "--no-open", "--quiet"]) == 2
    run = capsys.readouterr().err.split("hedgebed view ")[1].strip()
    assert main(["view", run, "--no-open", "--quiet"]) == 0


def test_a_grid_is_a_netcdf_with_an_axis_for_each_setting(tmp_path):
    xarray = pytest.importorskip("xarray")
    pytest.importorskip("netCDF4")
    assert sweep("swept", "--over", "torque=[0.15, 0.2]", "surface=['brick', 'sand', 'steel']") == 0
    with xarray.open_dataset(tmp_path / "swept" / "table.nc") as found:
        assert dict(found.sizes) == {"torque": 2, "surface": 3}
        assert found.torque.units == "N m" and found.max_speed.units == "m/s"
        rows = table(tmp_path / "swept")
        assert found.max_speed.sel(torque=0.2, surface="sand") == rows["max_speed_m_s"][4]


def test_what_is_done_is_not_done_twice_and_what_is_missing_is(tmp_path, monkeypatch):
    done = []
    compute = tasks._compute
    monkeypatch.setattr(tasks, "_compute", lambda task, *rest: done.append(task.name) or compute(task, *rest))
    members = ["--members", str(tmp_path / "members")]
    assert sweep("one", "--over", "torque=[0.15, 0.2]", *members) == 0
    assert sweep("two", "--over", "torque=[0.2, 0.15, 0.18]", *members) == 0
    assert len(done) == 3
    lost = tmp_path / "members" / done[0] / "result.json"
    before = lost.read_bytes()
    lost.write_bytes(before[:100])
    assert sweep("three", "--over", "torque=[0.15, 0.2]", *members) == 0
    assert done[3:] == [done[0]] and lost.read_bytes() == before


def test_a_sweep_that_was_stopped_goes_on_with_the_run_it_was_in(tmp_path, monkeypatch):
    """Interrupted in the third of four runs: two are done, one is taken up, the table is that of a whole one."""
    compute, begun = tasks._compute, []

    def interrupted(task, *rest):
        begun.append(task.name)
        if len(begun) == 3:
            raise KeyboardInterrupt
        return compute(task, *rest)

    over = ["--over", "torque=0.14:0.2:0.02"]
    monkeypatch.setattr(tasks, "_compute", interrupted)
    assert sweep("broken", *over) == 3
    assert main(["resume", "broken", "--quiet"]) == 0
    assert len(begun) == 5 and begun[3] == begun[2]
    assert sweep("whole", *over) == 0
    for name in ("table.csv", "result.json"):
        assert (tmp_path / "broken" / name).read_bytes() == (tmp_path / "whole" / name).read_bytes()


def test_a_run_that_fails_is_told_and_does_not_stop_the_others(tmp_path, monkeypatch, capsys):
    from experiments.tumble import experiment as tumble

    integrate = tumble._integrate

    def breaks(settings, plan, *, duration):
        if settings.torque == 0.15 and duration > 0.1:
            raise RuntimeError("wheel\nlost")
        return integrate(settings, plan, duration=duration)

    monkeypatch.setattr(tumble, "_integrate", breaks)
    assert sweep("swept", "--over", "torque=[0.15, 0.2]") == 1
    said = capsys.readouterr().err
    assert "1 of 2 " in said and "wheel lost" in said and "Traceback" not in said
    found = table(tmp_path / "swept")
    assert math.isnan(found["max_speed_m_s"][0]) and found["max_speed_m_s"][1] > 0
    assert found["fault"].tolist() == ["RuntimeError: wheel lost", ""]
    folder = RunFolder.open(tmp_path / "swept" / "members" / found["run"][0])
    assert folder.status == "failed" and (folder.path / "traceback.txt").is_file()
    monkeypatch.setattr(tumble, "_integrate", integrate)
    assert main(["resume", "swept", "--quiet"]) == 0
    assert "fault" not in table(tmp_path / "swept")


def test_a_folder_is_named_by_what_the_result_hangs_on(tmp_path):
    """Settings, the files that they name and the code; not threads, nor where the sweep is."""
    mine = tmp_path / "mine.toml"
    mine.write_text("name = 'a'\n")

    def name(**given):
        point = design.find_experiment("tumble").settings_class()(**given)
        return tasks.task_of(design.find_experiment("tumble"), point, tmp_path).name

    first = name(platform=str(mine))
    assert name(platform=str(mine)) == first != name(platform=str(mine), torque=0.1)
    mine.write_text("name = 'b'\n")
    assert name(platform=str(mine)) != first
    bed = {"ground": "bed"}
    assert name(**bed, threads=3) == name(**bed) != name(**bed, seed=2)


def test_code_is_all_that_computes_and_not_what_draws(tmp_path, monkeypatch):
    """K, C and mu of the surfaces too, also of an experiment that has a digest of its own."""
    surfaces, drawing = tmp_path / "experiments/platform/surfaces.toml", tmp_path / "vis/report.py"
    for path in (surfaces, drawing):
        path.parent.mkdir(parents=True)
        path.write_bytes((tasks._ROOT / path.relative_to(tmp_path)).read_bytes() if path == surfaces else b"")
    monkeypatch.setattr(tasks, "_ROOT", tmp_path)

    def codes():
        return [tasks.code_of.__wrapped__(design.find_experiment(name)) for name in ("tumble", "penetrate")]

    first = codes()
    drawing.write_text("colour = 1\n")
    assert codes() == first and first[0] != first[1]
    surfaces.write_text(surfaces.read_text().replace("1.5e4", "1.6e4"))
    assert all(new != old for new, old in zip(codes(), first, strict=True))


def test_files_in_lists_and_files_that_files_name_are_part_of_a_runs_name(tmp_path, monkeypatch):
    """A list of effects, the effect of a model, the meshes of a robot, a campaign by its bare name, a shelved bed.

    A folder that is called as a material is, such as the sweep's own, is no part of it.
    """
    monkeypatch.setenv("HEDGEBED_BEDS", str(tmp_path / "shelf"))
    files = (
        "mud.py", "far/mud.py", "model.toml", "meshes/foot.stl", "robot.xml", "mine/campaign.toml", "control.py",
        "shelf/loose.npz", "loose/run.toml", "sand/run.toml",
    )  # fmt: skip
    for name in files:
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text("first\n")
    (tmp_path / "model.toml").write_text("[[effects]]\nfile = 'far/mud.py'\n")
    (tmp_path / "robot.xml").write_text('<compiler meshdir="meshes"/><mesh file="foot.stl"/>')

    def task(experiment, **given):
        experiment = design.find_experiment(experiment)
        return tasks.task_of(experiment, experiment.settings_class()(**given), tmp_path)

    def names():
        diagnosed = task("diagnose", campaign="mine", effect_file=("mud.py",))
        moved = task("mujoco", model="robot.xml", feet=("foot",), controller="control.py:act")
        assert diagnosed.settings.effect_file == (str(tmp_path / "mud.py"),)
        assert moved.settings.controller == f"{tmp_path}/control.py:act"
        refined = task("bed refine", bed="loose")
        assert diagnosed.settings.campaign == str(tmp_path / "mine") and refined.settings.bed == "loose"
        return [one.name for one in (diagnosed, moved, task("tumble", model="model.toml", surface="sand"), refined)]

    first = names()
    hangs_on = (
        ("mud.py", "mine/campaign.toml"), ("meshes/foot.stl", "control.py"), ("far/mud.py",), ("shelf/loose.npz",),
        ("sand/run.toml", "loose/run.toml"),
    )  # fmt: skip
    for place, name in ((place, name) for place, changed in enumerate(hangs_on) for name in changed):
        (tmp_path / name).write_text("second\n")
        assert [new != old for new, old in zip(names(), first, strict=True)] == [place == run for run in range(4)]
        (tmp_path / name).write_text("first\n")
    assert names() == first


OTHER = """
import pickle, sys
from experiments.pool import tasks
todo, done, compute = pickle.load(sys.stdin.buffer), [], tasks._compute
tasks._compute = lambda task, *rest: done.append(task.name) or compute(task, *rest)
print("ready", flush=True)
sys.stdin.buffer.readline()
print([[outcome.name, outcome.fault] for outcome in (tasks.carry_out(task, print) for task in todo)], file=sys.stderr)
print(len(done), file=sys.stderr)
"""


def tumbles(home, torques):
    experiment = design.find_experiment("tumble")
    every = [experiment.settings_class()(duration=0.1, torque=torque) for torque in torques]
    return [tasks.task_of(experiment, settings, home) for settings in every]


def test_two_processes_with_the_same_runs_do_each_once(tmp_path, monkeypatch):
    todo, done, compute = tumbles(tmp_path / "members", np.linspace(0.15, 0.2, 12)), [], tasks._compute
    monkeypatch.setattr(tasks, "_compute", lambda task, *rest: done.append(task.name) or compute(task, *rest))
    command = [sys.executable, "-c", OTHER]
    with subprocess.Popen(command, stdin=-1, stdout=-1, stderr=-1, cwd=tasks._ROOT) as other:
        other.stdin.write(pickle.dumps(todo))
        other.stdin.flush()
        assert other.stdout.readline() == b"ready\n"
        other.stdin.write(b"\n")
        other.stdin.flush()
        here = [tasks.carry_out(task, float) for task in todo]
        said = other.communicate()[1].decode().splitlines()
    assert not [outcome.fault for outcome in here if outcome.fault]
    assert ast.literal_eval(said[-2]) == [[task.name, ""] for task in todo]
    assert len(done) + int(said[-1]) == len(todo)


def test_a_run_killed_while_its_folder_was_made_is_made_again(tmp_path):
    (task,) = tumbles(tmp_path, [0.15])
    task.path.mkdir()
    for name in (".run.toml.4711.tmp", "lock", "traceback.txt"):
        (task.path / name).touch()
    assert not tasks.carry_out(task, float).fault
    assert tasks.done_before(task) is not None


def test_sensitivities_are_those_of_the_closed_form():
    """Ishigami and Homma (1990), a = 7, b = 0.1: first 0.314, 0.442, 0, total 0.558, 0.442, 0.244 (Saltelli 2008)."""
    pytest.importorskip("SALib")
    for sampling, samples, room in (("sobol", 1024, 0.06), ("latin", 2048, 0.04)):
        made = Settings(experiment="tumble", over=[f"{key}=0:1" for key in ("torque", "mu_s", "mu_d")],
                        sampling=sampling, samples=samples)  # fmt: skip
        shares = design._shares(made, design.parse_over(made.over, design.find_experiment("tumble").settings_class()))
        x = np.pi * (2 * shares - 1)
        values = np.sin(x[:, 0]) + 7 * np.sin(x[:, 1]) ** 2 + 0.1 * x[:, 2] ** 4 * np.sin(x[:, 0])
        factors = design.parse_over(made.over, design.find_experiment("tumble").settings_class())
        whole = design.Design(design.find_experiment("tumble"), factors, 1, shares, ())
        column = result._Column("ishigami", "1", 1000 + values, np.zeros(len(values)))
        entries, warnings = result._sensitivities(made, whole, [column])
        assert not warnings
        assert [entry["first"] for entry in entries] == pytest.approx([0.314, 0.442, 0.0], abs=room)
        if sampling == "sobol":
            assert [entry["total"] for entry in entries] == pytest.approx([0.558, 0.442, 0.244], abs=room)


def test_too_few_samples_have_no_sensitivities_and_few_of_saltelli_s_design_are_warned_of(tmp_path):
    pytest.importorskip("SALib")
    assert sweep("few", "--over", "torque=0.15:0.2", "--samples", "4", "--sampling", "sobol") == 0
    few = json.loads((tmp_path / "few" / "result.json").read_text())
    assert few["sensitivities"] and any("samples = 4" in text for text in few["warnings"])
    assert sweep("swept", "--over", "torque=0.15:0.2", "--samples", "4") == 0
    found = json.loads((tmp_path / "swept" / "result.json").read_text())
    assert found["sensitivities"] == [] and any("samples = 4" in text for text in found["warnings"])


@pytest.mark.usefixtures("reported")
def test_the_page_shows_what_is_asked_for_over_every_setting(tmp_path):
    """Figures of two quantities; sensitivities, here made up, have one of their own."""
    swept = tmp_path / "swept"
    asked = ["--quantities", "max_speed", "sinkage_largest"]
    assert sweep("swept", "--over", "torque=[0.15, 0.2]", "surface=['brick', 'sand']", *asked) == 0
    assert (swept / "report.html").read_text().count("<img") == 2
    assert not list(swept.glob("members/*/report.html"))
    found = json.loads((swept / "result.json").read_text())
    entry = {"quantity": "max_speed", "first": 0.4, "first_conf": 0.1, "total": None, "total_conf": None}
    found["sensitivities"] = [entry | {"key": "torque"}, entry | {"key": "mu_s", "total": 0.5, "total_conf": 0.2}]
    RunFolder.open(swept).write_result(found)
    assert write_report(swept).read_text().count("<img") == 3
    assert sorted(path.name for path in (swept / "figures").iterdir()) == [
        "over-max_speed.png", "over-sinkage_largest.png", "sensitivities.png",
    ]  # fmt: skip


def test_what_is_not_installed_is_named_before_any_run(monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "distributed", None)
    assert main(["sweep", "sweep", "--workers", "2"]) == 2
    assert "workers = 2" in (said := capsys.readouterr().err) and "hedgebed[sweep]" in said
    assert main(["sweep", "sweep", "--scheduler", "tcp://nowhere:1"]) == 2
    assert "hedgebed[sweep]" in capsys.readouterr().err


def test_without_dask_the_runs_are_made_one_after_the_other_and_a_message_says_so(tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "distributed", None)
    monkeypatch.setattr(experiment, "cores_there", lambda: 2)
    few = ["--experiment", "tumble", "--fixed", "duration=0.1", "--over", "torque=[0.15, 0.2]", "--out", "swept"]
    assert main(["sweep", *few]) == 0
    assert len(table(tmp_path / "swept")["run"]) == 2
    assert "hedgebed[sweep]" in capsys.readouterr().err


def test_dask_has_the_commands_of_the_kubernetes_file():
    """`dask-worker` and `dask-scheduler` are no commands of today's dask."""
    path = Path(__file__).parents[3] / "examples" / "sweep" / "kubernetes.yaml"
    given = re.findall(r"args: \[(.*)\]", path.read_text(encoding="utf-8"))
    known = {entry.name: entry.load() for entry in entry_points(group="dask_cli")}
    for line in given:
        program, name, *options = [word.strip(' "') for word in line.split(",")]
        assert program == "dask" and known[name].make_context(name, options).params
    assert len(given) == 2
