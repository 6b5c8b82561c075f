"""Run folders: settings that read back, refusals, the lock, and files that are whole or not there."""

import json
import os
import re
import signal
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest
from dig_experiment import DigSettings
from hypothesis import given
from hypothesis import strategies as st
from pydantic import BaseModel, Field

from experiments.runs import folder as runfolder
from experiments.runs.folder import (
    RunFolder,
    fresh_path,
    read_series,
    settings_toml,
    write_json,
    write_series,
    write_text,
)
from experiments.runs.given import keep_given, kept_copy
from experiments.runs.reading import read_case
from rigid.digests import check_as_written, kept_digests

ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture
def folder(tmp_path):
    return RunFolder.create(tmp_path / "a", "dig", DigSettings())


class Odd(BaseModel):
    number: float = Field(0.0, description="A number [1].")
    text: str = Field("", description="Two\nlines.")
    several: tuple[float, ...] = ()
    tables: dict[str, list[int]] = Field(default_factory=dict)


# No subnormal numbers: a test before this one may have loaded Taichi, whose runtime flushes them to zero.
_numbers = st.floats(allow_nan=False, allow_subnormal=False)


@given(
    st.builds(
        Odd,
        number=_numbers,
        text=st.text(st.characters(codec="utf-8")),
        several=st.lists(_numbers).map(tuple),
        tables=st.dictionaries(
            st.text(st.characters(codec="utf-8"), max_size=3), st.lists(st.integers(-9, 9)), max_size=2
        ),
    )
)
def test_settings_read_back_from_run_toml_to_the_bit(settings):
    assert Odd(**tomllib.loads(settings_toml("odd", settings, "1"))["settings"]) == settings


def test_run_toml_says_what_each_setting_means_and_its_unit(folder):
    text = (folder.path / "run.toml").read_text()
    assert "# Diameter of the spike [m].\nspike_diameter = 0.02\n" in text
    assert "load = 1.5" in text
    assert RunFolder.open(folder.path).command == "dig"
    assert DigSettings(**RunFolder.open(folder.path).settings) == DigSettings()


def test_what_is_not_set_stays_so_whatever_the_default(tmp_path):
    class Loaded(BaseModel):
        load: float | None = 1.0

    folder = RunFolder.create(tmp_path / "a", "load", Loaded(load=None))
    assert "# load is not set" in (folder.path / "run.toml").read_text()
    assert Loaded(**RunFolder.open(folder.path).settings).load is None


def test_settings_that_would_not_read_back_are_refused(tmp_path):
    class Lossy(BaseModel):
        number: float = 0.0

    with pytest.raises(ValueError, match="do not read back"):
        RunFolder.create(tmp_path / "a", "lossy", Lossy(number=float("nan")))
    assert not (tmp_path / "a").exists()


def test_a_folder_in_use_is_refused_and_left_alone(folder, tmp_path):
    before = {path.name: path.read_bytes() for path in folder.path.iterdir()}
    with pytest.raises(ValueError, match=r"in use.*hedgebed resume"):
        RunFolder.create(folder.path, "dig", DigSettings())
    assert {path.name: path.read_bytes() for path in folder.path.iterdir()} == before


def test_an_empty_folder_will_do(tmp_path):
    assert RunFolder.create(tmp_path, "dig", DigSettings()).status == "running"


def test_what_a_killed_process_left_before_run_toml_is_no_run(tmp_path):
    for name in (".run.toml.4711.tmp", "lock", "traceback.txt"):
        (tmp_path / name).touch()
    assert RunFolder.create(tmp_path, "dig", DigSettings()).status == "running"
    with pytest.raises(ValueError, match=r"holds run\.toml, status\.json"):
        RunFolder.create(tmp_path, "dig", DigSettings())


def test_a_folder_that_cannot_be_made_is_refused(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(ValueError, match="cannot be written"):
        RunFolder.create(tmp_path / "file" / "a", "dig", DigSettings())


def test_ensure_takes_up_the_same_run_and_refuses_another(folder):
    assert RunFolder.ensure(folder.path, "dig", DigSettings()).path == folder.path
    with pytest.raises(ValueError, match="in use"):
        RunFolder.ensure(folder.path, "dig", DigSettings(steps=9))
    with pytest.raises(ValueError, match="in use"):
        RunFolder.ensure(folder.path, "fill", DigSettings())


def test_open_refuses_another_format(folder):
    write_text(folder.path / "run.toml", 'format = "other"\n')
    with pytest.raises(ValueError, match="not 'hedgebed-run/3'"):
        RunFolder.open(folder.path)
    write_text(folder.path / "run.toml", 'experiment = "driven"\n')
    with pytest.raises(ValueError, match="of a script"):
        RunFolder.open(folder.path)


def test_a_run_of_before_keeps_its_material(tmp_path):
    """`sand` of a run.toml of version 1 is what `sand-weak` is, `jsc1a` of versions 1 and 2 what `jsc1a-heights` is:
    in settings, result, and the case that repeats it."""
    text = 'format = "hedgebed-run/{}"\ncommand = "dig"\nnot_set = ["surface"]\n[settings]\nmaterial = "sand"\n'
    text += 'surfaces = ["brick", "sand", "sand-calibrated", "jsc1a"]\ntitle = "sand"\n'
    names = ["brick", "sand", "sand-calibrated", "jsc1a"]
    was = {"surface": None, "material": "sand", "surfaces": names, "title": "sand"}
    second = was | {"surfaces": [*names[:3], "jsc1a-heights"]}
    first = second | {"material": "sand-weak", "surfaces": ["brick", "sand-weak", "sand", "jsc1a-heights"]}
    for number, settings in ((1, first), (2, second), (3, was)):
        write_text(tmp_path / "run.toml", text.format(number))
        write_json(tmp_path / "result.json", {"surface": "jsc1a", "bed": {"material": "sand"}, "title": "in sand"})
        folder = RunFolder.open(tmp_path)
        assert folder.settings == settings == dict(read_case(tmp_path / "run.toml").values)
        surface, material = settings["surfaces"][3], settings["material"]
        assert folder.read_result() == {"surface": surface, "bed": {"material": material}, "title": "in sand"}


def test_a_case_whose_result_is_kept_has_the_material_of_that_result():
    """But for the cases that are of the default material: their kept results are of `sand-weak`, which it was."""
    of_the_default = {"penetrate", "penetrate-full", "bed-test-cone", "bed-test-repose"}
    cases = {path.stem: path for path in ROOT.glob("experiments/cases/**/*.toml")}
    same = 0
    for path in sorted(ROOT.glob("docs/results/*/run.toml")):
        name = path.parent.name
        today = read_case(cases[name]).values if name in cases else {}
        kept = RunFolder.open(path.parent).settings
        for key in {"material", "surface"} & today.keys():
            assert kept[key] == ("sand-weak" if name in of_the_default else today[key]), (name, key)
            same += 1
    assert same > 50


def test_fresh_path_never_names_what_is_there(tmp_path):
    first = fresh_path("dig", tmp_path)
    first.mkdir()
    assert not fresh_path("dig", tmp_path).exists()


# The lock

HOLD = """
import sys, time
from experiments.runs.folder import RunFolder
with RunFolder.open(sys.argv[1]).lock():
    print("held", flush=True)
    time.sleep(60)
"""


def test_a_live_process_keeps_the_folder_and_a_killed_one_leaves_it_free(folder):
    command = [sys.executable, "-c", HOLD, str(folder.path)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=ROOT) as other:
        assert other.stdout.readline() == "held\n"
        with pytest.raises(ValueError, match=f"process {other.pid}"), folder.lock():
            pass
        other.send_signal(signal.SIGKILL)
        other.wait()
    with folder.lock():
        assert (folder.path / "lock").read_text() == f"{os.getpid()}\n"


def test_one_process_can_take_the_lock_twice(folder):
    with folder.lock():
        with folder.lock():
            pass
        assert (folder.path / "lock").read_text()
    assert not (folder.path / "lock").read_text()


# Files


def test_a_file_is_whole_or_as_it_was(tmp_path, monkeypatch):
    path = tmp_path / "x.json"
    write_json(path, {"a": 1})
    with pytest.raises(TypeError):
        write_json(path, {"a": object()})
    monkeypatch.setattr(runfolder.os, "fsync", lambda number: (_ for _ in ()).throw(OSError("disk full")))
    with pytest.raises(OSError, match="disk full"):
        write_json(path, {"a": 2})
    assert json.loads(path.read_text()) == {"a": 1}
    assert list(tmp_path.iterdir()) == [path]


def test_json_takes_numpy_and_turns_what_is_not_finite_into_null(tmp_path):
    write_json(
        tmp_path / "x.json", {"a": np.float64("nan"), "b": [np.inf, np.int64(2)], "c": np.arange(2), "d": Path("e")}
    )
    assert json.loads((tmp_path / "x.json").read_text()) == {"a": None, "b": [None, 2], "c": [0, 1], "d": "e"}


def test_a_series_reads_back_to_the_bit(folder):
    depth = np.random.default_rng(1).normal(size=50) * 1e-3
    depth[3] = np.nan
    folder.write_series("drive-1", {"depth_m": depth, "phase": np.array(["free", "in"] * 25)})
    back = folder.read_series("drive-1")
    assert np.array_equal(back["depth_m"], depth, equal_nan=True)
    assert list(back["phase"][:2]) == ["free", "in"]
    assert list(read_series(folder.path / "series/drive-1.csv")) == ["depth_m", "phase"]


def test_columns_of_different_lengths_are_refused(tmp_path):
    with pytest.raises(ValueError, match="one length"):
        write_series(tmp_path / "x.csv", {"t_s": [0.0], "depth_m": [0.0, 1.0]})


def test_a_checkpoint_reads_back_to_the_bit(folder):
    assert folder.load_checkpoint("bed") is None
    state = {"position": np.random.default_rng(2).normal(size=(5, 3)), "steps": 7, "name": "bed"}
    folder.save_checkpoint("bed", state)
    back = folder.load_checkpoint("bed")
    assert np.array_equal(back["position"], state["position"])
    assert back["position"].dtype == np.float64
    assert (int(back["steps"]), str(back["name"])) == (7, "bed")
    folder.drop_checkpoint("bed")
    assert folder.load_checkpoint("bed") is None


def test_a_checkpoint_holds_no_objects(folder):
    with pytest.raises(TypeError, match="thing"):
        folder.save_checkpoint("bed", {"thing": {"a": 1}})


def test_marks_of_finished_work(folder):
    assert not folder.has_work
    assert not folder.is_done("seed-1")
    folder.mark_done("seed-1", {"stiffness": 2.5})
    assert folder.is_done("seed-1")
    assert folder.done_data("seed-1") == {"stiffness": 2.5}
    assert not folder.is_done("seed-2")
    assert folder.has_work


@pytest.mark.parametrize("what", ["a digit of the mark", "the end of the mark", "a digit of the series", "the series"])
def test_finished_work_that_is_damaged_is_named_and_not_done(folder, what, capsys):
    folder.write_series("seed-1", {"t_s": [0.0, 1.0], "force_N": [0.5, 0.25]})
    folder.mark_done("seed-1", {"stiffness": 2.5, "depth": None, "steps": 7})
    mark, series = folder.path / "checkpoint" / "seed-1.done.json", folder.path / "series" / "seed-1.csv"
    assert folder.is_done("seed-1") and capsys.readouterr().err == ""
    if what == "a digit of the mark":
        mark.write_text(mark.read_text().replace("2.5", "22.5"))
    elif what == "the end of the mark":
        mark.write_text(mark.read_text()[:40])
    elif what == "a digit of the series":
        series.write_text(series.read_text().replace("0.25", "9.25"))
    else:
        series.unlink()
    damaged = mark if "mark" in what else series
    assert not folder.is_done("seed-1") and str(damaged) in capsys.readouterr().err
    with pytest.raises(ValueError, match=re.escape(str(damaged))):
        folder.done_data("seed-1")
    folder.write_series("seed-1", {"t_s": [0.0, 1.0], "force_N": [0.5, 0.25]})
    folder.mark_done("seed-1", {"stiffness": 2.5})
    assert folder.is_done("seed-1") and folder.done_data("seed-1") == {"stiffness": 2.5}


@pytest.mark.parametrize("key", ["format", "data", "digests"])
def test_a_mark_with_a_wrong_key_is_not_taken_for_one_of_an_earlier_version(folder, key):
    folder.mark_done("seed-1", {"stiffness": 2.5})
    mark = folder.path / "checkpoint" / "seed-1.done.json"
    mark.write_text(mark.read_text().replace(f'"{key}"', f'"{key[:-1]}~"', 1))
    assert not folder.is_done("seed-1")
    with pytest.raises(ValueError, match=re.escape(str(mark))):
        folder.noted("seed-1", [])
    assert folder.noted("seed-2", []) == []


def finished(folder):
    """A run that is done, with files of numbers, a copy that it was given, and others."""
    for name in ("a", "b"):
        folder.write_series(name, {"t_s": [0.0, 1.0], "force_N": [0.5, 0.25]})
    folder.write_result({"quantities": {"n": 1}})
    keep_given(folder.path, "law.toml", b"stiffness = 1.5\n")
    for name in ("laws/one.toml", "table.nc", "note.txt", "frames/a.json", "members/x/result.json", "made/run.toml"):
        write_text(folder.path / name, "1\n")
    folder.set_status("done")
    return folder


def test_every_file_of_numbers_of_a_finished_run_has_a_digest(folder):
    finished(folder)
    wanted = {"run.toml", "result.json", "series/a.csv", "series/b.csv", "laws/one.toml", "table.nc", "law.toml"}
    assert set(kept_digests(folder.path)) == wanted
    folder.read_result()
    for name in wanted - {"run.toml"}:
        whole = (folder.path / name).read_bytes()
        changed = folder.path / name
        changed.write_bytes(whole.replace(b"1", b"3"))
        with pytest.raises(ValueError, match=re.escape(str(changed))):
            folder.read_result()
        with pytest.raises(ValueError, match=re.escape(str(changed))):
            check_as_written(changed)
        changed.write_bytes(whole)


def test_a_file_that_is_written_again_loses_its_digest_and_the_others_keep_theirs(folder):
    before = set(kept_digests(finished(folder).path))
    folder.write_series("a", {"t_s": [0.0], "force_N": [1.5]})
    assert before - set(kept_digests(folder.path)) == {"series/a.csv"}
    folder.read_result()
    other = folder.path / "series" / "b.csv"
    other.write_text(other.read_text().replace("0.25", "9.25"))
    with pytest.raises(ValueError, match=re.escape(str(other))):
        folder.read_result()
    folder.write_series("b", {"t_s": [0.0, 1.0], "force_N": [0.5, 0.25]})
    folder.write_result({"quantities": {"n": 2}})
    assert folder.read_result() == {"quantities": {"n": 2}}


def test_a_copy_of_what_a_run_was_given_has_its_digest_while_the_run_goes_on(folder):
    copy = keep_given(folder.path, "law.toml", b"stiffness = 2.5\n")
    for status in ("running", "stopped", "running"):
        folder.set_status(status)
        assert kept_copy(folder.path, "law.toml") == copy
    copy.write_bytes(b"stiffness = 2.7\n")
    folder.set_status("done")  # never that of a damaged copy
    with pytest.raises(ValueError, match=re.escape(str(copy))):
        kept_copy(folder.path, "law.toml")
    assert kept_copy(folder.path, "other.toml") is None


def test_settings_of_a_run_that_are_changed_are_not_opened(folder):
    settings = folder.path / "run.toml"
    settings.write_text(settings.read_text().replace("version", "versoin", 1))
    with pytest.raises(ValueError, match=re.escape(str(settings))):
        RunFolder.open(folder.path)
    again = RunFolder.mend(folder.path, "dig", DigSettings())
    assert DigSettings(**again.settings) == DigSettings() and again.status == "running"


def test_marks_of_earlier_versions_are_read(folder):
    folder.mark_done("seed-1")
    (folder.path / "checkpoint" / "seed-1.done.json").write_text('{"stiffness": 2.5}')
    assert folder.is_done("seed-1") and folder.done_data("seed-1") == {"stiffness": 2.5}


@pytest.mark.parametrize("name", ["", "../x", "a/b", ".hidden", "a b"])
def test_names_that_are_no_file_names_are_refused(folder, name):
    with pytest.raises(ValueError, match="cannot name a file"):
        folder.write_series(name, {"t_s": [0.0]})


def test_a_status_there_is_not_is_refused(folder):
    with pytest.raises(ValueError, match="running, stopped, failed, done"):
        folder.set_status("finished")
    assert folder.status == "running"


def test_a_status_has_the_processor_time_of_all_its_spells_a_killed_one_until_its_last_checkpoint(folder, monkeypatch):
    spent = [100.0]
    monkeypatch.setattr(runfolder, "_processor_time", lambda: spent[0])
    first = RunFolder.open(folder.path)
    before = first.processor_time
    spent[0] += 5.0
    first.save_checkpoint("work", {"row": 1})
    spent[0] += 3.0  # killed here: nobody writes that down
    second = RunFolder.open(folder.path)
    assert second.status == "running" and second.processor_time == pytest.approx(before + 5.0)
    spent[0] += 2.0
    second.set_status("stopped", "interrupted")
    third = RunFolder.open(folder.path)
    spent[0] += 1.0
    third.write_result({"quantities": {}})
    third.set_status("done")
    assert third.read_result() == {"quantities": {}}  # what settings determine: the same bytes of any two runs
    told = json.loads((folder.path / "status.json").read_text())
    assert told["processor_time"] == pytest.approx(before + 8.0)


def test_processor_time_counts_this_process_and_its_children(folder):
    began = folder.processor_time
    subprocess.run([sys.executable, "-c", "sum(i * i for i in range(1_500_000))"], check=True)
    in_a_child = folder.processor_time - began
    assert in_a_child > 0.02
    sum(i * i for i in range(1_500_000))
    assert folder.processor_time > began + in_a_child + 0.02
