"""The command line: options from the settings class, precedence, what is refused and how, exit statuses."""

import json
import os
import re
import signal
import subprocess
import sys
import threading
import tomllib
from pathlib import Path

import pytest
from golden import golden

import hedgebed
import hedgebed_taichi
from experiments.cli.main import GROUPS, build_app, main
from experiments.cli.runs import _number, show_folder
from experiments.runs import registry
from experiments.runs.folder import RunFolder
from rigid.terms import EFFECTS

ROOT = Path(__file__).resolve().parents[3]


def settings_of(folder: Path) -> dict:
    return tomllib.loads((folder / "run.toml").read_text())["settings"]


def only_run() -> Path:
    (folder,) = Path("runs").iterdir()
    return folder


# Settings


def test_help_shows_units_and_defaults_and_every_setting(dig, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "160")
    assert main(["dig", "--help"]) == 0
    text = capsys.readouterr().out
    for expected in (
        "--spike-diameter",
        "Diameter of the spike [m].",
        "[default: 0.02]",
        "[default: 0.1 0.2]",
        "--full",
    ):
        assert expected in text


def test_without_out_a_run_goes_to_a_fresh_folder_each_time(dig):
    assert main(["dig"]) == main(["dig"]) == 0
    assert len(list(Path("runs").glob("dig-*"))) == 2


def test_command_line_wins_over_case_wins_over_preset_wins_over_default(dig):
    Path("case.toml").write_text("steps = 5\nspike_diameter = 0.03\n")
    assert main(["dig", "case.toml", "--full", "--spike-diameter", "0.04", "--drive-speeds", "1", "2", "3"]) == 0
    settings = settings_of(only_run())
    assert settings["deep"] is True  # the preset
    assert settings["steps"] == 5  # the case, over the preset's 7
    assert settings["spike_diameter"] == 0.04  # the command line, over the case
    assert settings["drive_speeds"] == [1.0, 2.0, 3.0]
    assert settings["grain"] == "sand"  # the default


def test_a_case_that_ships_goes_by_its_name(dig):
    assert main(["dig", "deep"]) == 0
    assert settings_of(only_run())["steps"] == 7


def test_the_run_toml_of_a_run_is_a_case(dig):
    assert main(["dig", "--steps", "4", "--out", "a"]) == 0
    assert main(["dig", "a/run.toml", "--out", "b"]) == 0
    assert settings_of(Path("a")) == settings_of(Path("b"))


def test_none_unsets_what_need_not_be_set(dig):
    Path("case.toml").write_text('load = "none"\n')
    assert main(["dig", "case.toml", "--out", "a"]) == 0
    assert main(["dig", "--load", "none", "--out", "b"]) == 0
    assert main(["dig", "a/run.toml", "--out", "c"]) == 0
    assert ["load" in settings_of(Path(name)) for name in "abc"] == [False, False, False]


# What is refused


@pytest.mark.parametrize(
    ("tokens", "said"),
    [
        (["--spike-diametre", "1"], ["--spike-diametre", "--spike-diameter"]),
        (["--spike-diameter", "-1"], ["--spike-diameter = -1.0", "greater than 0", "[m]"]),
        (["--load", "-1"], ["--load = -1.0", "greater than 0"]),
        (["--seeds", "1", "-2"], ["--seeds[1] = -2", "greater than or equal to 0"]),
        (["--spike-diameter", "thin"], ["--spike-diameter", "thin", "float"]),
        (["--spike-diameter", "0.2"], ["spike_diameter = 0.2", "at most 0.1"]),
        (["--grain", "snow"], ["--grain", "snow", "sand"]),
        (["--size", "1"], ["--size = 1: expected 3 values, got 1 (Size of the bed [m])"]),
        (["--seeds", "1.5"], ["--seeds[0] = 1.5", "fractional part"]),
        (["--steps", "10.7"], ["--steps = 10.7", "fractional part"]),
        (["--seeds"], ["--seeds is empty: give at least one (Seeds [1])"]),
        (["--spike-diameter", "16kg"], ["--spike-diameter = '16kg'", "a unit of mass", "give length in m, cm, mm"]),
        (["--load", "3newton"], ["--load = '3newton'", "'newton' is no unit", "give force in N, mN"]),
        (["unit.toml"], ["unit.toml: drive_speeds = [0.1, '2 mm']", "a unit of length", "give speed in m/s"]),
        (["misspelt.toml"], ["misspelt.toml", "deep"]),
        (["key.toml"], ["key.toml: spike_diametre = 0.1", "did you mean 'spike_diameter'"]),
        (["hyphen.toml"], ["hyphen.toml: spike-diameter", "did you mean 'spike_diameter'"]),
        (["value.toml"], ["value.toml: drive_speeds = [0.1, 'fast']", "'fast' is not a valid number"]),
        (["broken.toml"], ["broken.toml", "TOML"]),
        (["--out", "key.toml"], ["key.toml", "file"]),
        (["--out", "cases"], ["cases", "in use", "deep.toml"]),
        (["--ending", "early"], ["time_step = 1 s", "at most 1e-5 s"]),
    ],
)
def test_bad_input_is_refused_in_a_sentence_that_names_it(dig, capsys, tokens, said):
    Path("key.toml").write_text("spike_diametre = 0.1\n")
    Path("hyphen.toml").write_text("spike-diameter = 0.1\n")
    Path("value.toml").write_text('drive_speeds = [0.1, "fast"]\n')
    Path("unit.toml").write_text('drive_speeds = [0.1, "2 mm"]\n')
    Path("broken.toml").write_text("steps = \n")
    assert main(["dig", *tokens]) == 2
    text = capsys.readouterr().err
    assert all(words in text for words in said), text
    assert "Traceback" not in text
    assert not Path("runs").exists() or not list(Path("runs").iterdir())  # nothing is left behind


def test_an_unknown_command_is_refused_with_the_nearest(dig, capsys):
    assert main(["dg"]) == 2
    assert '"dig"' in capsys.readouterr().err


@pytest.mark.parametrize("value", ['"' + "x y " * 900 + '"', "[" + "1, " * 900 + "]"])
@pytest.mark.parametrize("key", ["mass", "qqq"])
def test_a_refusal_of_a_long_value_is_short_and_has_both_its_ends(tmp_path, capsys, key, value):
    """Of a setting that takes no such value, and of a name that is none of 70: the most alike of them are listed."""
    case = tmp_path / "case.toml"
    case.write_text(f"{key} = {value}\n")
    assert main(["calibrate", str(case), "--out", str(tmp_path / "out")]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert len(line) < 900 and f"{key} = " in line
    assert ("number" if key == "mass" else "--help") in line[-300:]


def test_every_command_stands_in_a_group_of_the_help(capsys, monkeypatch):
    """An experiment without a group, or with one that does not exist, would be listed beside --help and --version."""
    monkeypatch.setenv("COLUMNS", "200")
    assert main(["--help"]) == 0
    *grouped, other = re.split("╭─ ", capsys.readouterr().out)
    assert [part.split(" ─")[0] for part in grouped[1:]] == [group.name for group in GROUPS.values()]
    listed = set(re.findall(r"│ ([a-z][\w-]*)", "".join(grouped)))
    assert {name.split(" ")[0] for name in registry.EXPERIMENTS} < listed
    assert re.findall(r"│ ([\w-]+)", other) == ["--help", "--install-completion", "--version"]


def test_completion_knows_commands_and_options():
    script = build_app().generate_completion(shell="bash")
    assert "penetrate" in script and "--tip-diameter" in script and "install-completion" in script


@pytest.mark.parametrize(
    "typed, meant",
    [
        (["penetrat"], "penetrate"),
        (["bed", "mak"], "make"),
        (["tumble", "spatail"], "spatial"),
        (["tumble", "--tumbels", "2"], "--tumbles"),
        (["tumble", "--platform", "hedghog"], "hedgehog"),
        (["tumble", "--surface", "brik"], "brick"),
        (["tumble", "--effects", "pendulm.length=2"], "pendulum"),
        (["penetrate", "--tip", "flatt"], "flat"),
        (["penetrate", "penetrate-ful"], "penetrate-full"),
        (["sweep", "--experiment", "tumbel", "--over", "torque=[0.1]"], "tumble"),
        (["validate", "--only", "janssn"], "janssen"),
    ],
)
def test_a_misspelt_word_is_answered_with_the_nearest(typed, meant, capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    assert main(typed) == 2
    text = capsys.readouterr().err
    assert re.search(rf"\b{meant.lstrip('-')}\b", text) and len(text) < 250, text
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    "typed, meant",
    [
        (["hop", "--ground", "groud.toml"], "ground.toml"),
        (["penetrate", "grund"], "ground.toml"),
        (["sweep", "--experiment", "tumble", "--table", "tabel.csv"], "table.csv"),
        (["bed", "foot", "rtf.json", "cone", "--depth", "10mm"], "rft.json"),
        (["resume", "my-rnu"], "my-run"),
        (["view", "my-rnu"], "my-run"),
        (["diagnose", "my-rnu"], "my-run"),
        (["calibrate", "my-rnu"], "my-run"),
    ],
)
def test_a_misspelt_file_or_folder_is_answered_with_the_one_beside_it(typed, meant, capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    for name in ("ground.toml", "table.csv", "rft.json"):
        (tmp_path / name).write_text("")
    (tmp_path / "my-run").mkdir()
    assert main(typed) == 2
    assert f"did you mean {meant!r}?" in capsys.readouterr().err


def test_an_option_that_a_command_has_not_is_answered_with_its_help_where_none_is_spelt_like_it(capsys):
    assert main(["fmu", "x.fmu", "--out", "x"]) == 2
    text = capsys.readouterr().err
    assert "Did you mean" not in text and "`hedgebed fmu --help`" in text
    assert main(["fmu", "x.fmu", "--platfrom", "cubli"]) == 2
    assert "mean --platform?" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("typed", "meant"),
    [
        (["ground", "--material", "sands"], "did you mean 'sand'?"),
        (["experiments", "run", "grains1-snd"], "did you mean 'grains1-sand'?"),
        (["bed", "foot", "sands", "cylinder", "--load", "0.5N"], "did you mean 'sand'?"),
        (["bed", "make", "--packing", "0.6"], "--stages rain level packing:0.58"),
        (["bed", "make", "--packing=0.6"], "--stages rain level packing:0.58"),
    ],
)
def test_a_misspelt_name_is_answered_with_the_one_that_ships(typed, meant, capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    assert main(typed) == 2
    assert meant in capsys.readouterr().err


def test_no_help_shows_an_empty_default(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "160")
    for command in (["sweep"], ["effects"], ["experiments", "list"]):
        assert main([*command, "--help"]) == 0
        assert not re.search(r"default: (\]|\(\)|None)", capsys.readouterr().out)


def test_a_check_of_the_experiment_refuses_before_a_folder_is_made(dig, capsys):
    def check(settings):
        raise ValueError("memory = 4 GiB is more than there is: at most 2 GiB")

    dig.check = check
    assert main(["dig", "--out", "a"]) == 2
    assert "2 GiB" in capsys.readouterr().err
    assert not Path("a").exists()


@pytest.mark.parametrize(("line", "said"), [("seeds = [1.5]", "fractional part"), ("seeds = []", "give at least one")])
def test_one_fault_is_one_sentence(dig, capsys, line, said):
    Path("case.toml").write_text(f"{line}\n")
    assert main(["dig", "case.toml"]) == 2
    (sentence,) = capsys.readouterr().err.splitlines()
    assert said in sentence


def test_none_empties_a_list_that_may_be_empty(dig):
    Path("case.toml").write_text('drive_speeds = "none"\n')
    assert main(["dig", "--drive-speeds", "none", "--out", "a"]) == 0
    assert main(["dig", "case.toml", "--out", "b"]) == 0
    assert settings_of(Path("a"))["drive_speeds"] == settings_of(Path("b"))["drive_speeds"] == []


def test_a_whole_number_stays_one(dig):
    assert main(["dig", "--steps", "4", "--seeds", "2", "3", "--out", "a"]) == 0
    settings = settings_of(Path("a"))
    assert (settings["steps"], settings["seeds"]) == (4, [2, 3]) and isinstance(settings["steps"], int)


# How it ends


def test_done_shows_the_numbers_and_the_folder(dig, capsys):
    assert main(["dig", "--out", "a"]) == 0
    out = capsys.readouterr().out
    for expected in ("A hole", "depth", "0.02", "0.001", "The hole is [deep].", "warning: it is dark", "folder: a"):
        assert expected in out
    assert json.loads(Path("a/status.json").read_text())["status"] == "done"


@pytest.mark.parametrize(
    ("value", "std", "shown"),
    [
        (37.616584, 2.5318, "37.6"), (0.0040577, 0.00036257, "0.0041"), (0.000546, None, "0.00055"),
        (20214.0, None, "20214"), (0.219033, 0.0, "0.219"), (0.57207, 0.00058, "0.5721"), (None, None, "-"),
        (51.2, 0.6, "51.2"),
    ],
)  # fmt: skip
def test_numbers_are_shown_to_the_digits_that_are_known(value, std, shown):
    assert _number(value, std) == shown


def test_stopped_says_how_to_resume_and_resume_finishes(dig, capsys):
    assert main(["dig", "--ending", "KeyboardInterrupt", "--out", "a"]) == 3
    assert "hedgebed resume a" in capsys.readouterr().err
    assert json.loads(Path("a/status.json").read_text())["status"] == "stopped"
    assert main(["resume", "a"]) == 0
    assert json.loads(Path("a/status.json").read_text())["status"] == "done"
    assert json.loads(Path("a/result.json").read_text())["quantities"]["count"]["std"] is None


def test_failed_says_why_without_a_traceback(dig, capsys):
    assert main(["dig", "--ending", "RuntimeError", "--out", "a"]) == 1
    text = capsys.readouterr().err
    assert "grain was lost" in text
    assert "Traceback" not in text and "resume" not in text
    status = json.loads(Path("a/status.json").read_text())
    assert status["status"] == "failed"
    assert "grain was lost" in status["reason"]


def test_settings_that_only_the_computation_shows_to_be_bad_are_bad_input_and_what_is_computed_is_kept(dig, capsys):
    assert main(["dig", "--ending", "UnfitSettingsError", "--out", "a"]) == 2
    text = capsys.readouterr().err
    assert "grain was lost" in text and "kept in a;" in text
    assert "Traceback" not in text and "resume" not in text
    assert json.loads(Path("a/status.json").read_text())["status"] == "failed"
    assert Path("a/series/dig.csv").exists()


def test_a_value_found_wrong_after_work_began_is_a_sentence(dig, capsys):
    assert main(["dig", "--ending", "ValueError", "--out", "a"]) == 1
    text = capsys.readouterr().err
    assert "failed: " in text and "Traceback" not in text
    assert "Traceback" in Path("a/traceback.txt").read_text()
    assert Path("a/series/dig.csv").exists()


def test_a_mistake_of_ours_shows_where(dig, capsys):
    assert main(["dig", "--ending", "ZeroDivisionError", "--out", "a"]) == 1
    assert "Traceback" in capsys.readouterr().err
    assert Path("a/series/dig.csv").exists()


def test_sigterm_stops_as_ctrl_c_does(dig):
    def work(settings, folder, *, progress):
        threading.Timer(0.05, os.kill, (os.getpid(), signal.SIGTERM)).start()
        threading.Event().wait(5)
        raise AssertionError("was not interrupted")

    dig.run = work
    assert main(["dig", "--out", "a"]) == 3
    assert signal.getsignal(signal.SIGTERM) == signal.SIG_DFL


def test_json_prints_the_result_and_nothing_else(dig, capfd):
    assert main(["dig", "--json", "--out", "a"]) == 0
    out, err = capfd.readouterr()
    assert json.loads(out) == json.loads(Path("a/result.json").read_text())
    assert "library that writes" in err


def test_quiet_shows_no_progress(dig, capsys):
    assert main(["dig", "--quiet", "--out", "a"]) == 0
    assert "[   0:00]" not in capsys.readouterr().err


def test_resume_of_a_finished_run_shows_it_again(dig, capsys):
    assert main(["dig", "--out", "a"]) == 0
    before = Path("a/result.json").stat().st_mtime_ns
    capsys.readouterr()
    assert main(["resume", "a"]) == 0
    out, err = capsys.readouterr()
    assert "depth" in out
    assert "is done" in err
    assert Path("a/result.json").stat().st_mtime_ns == before


def test_a_run_that_another_process_is_writing_is_left_alone(dig, capsys):
    import fcntl

    assert main(["dig", "--ending", "KeyboardInterrupt", "--out", "a"]) == 3
    with Path("a/lock").open("w") as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        assert main(["resume", "a"]) == 2
    assert "is being written" in capsys.readouterr().err
    assert json.loads(Path("a/status.json").read_text())["status"] == "stopped"


@pytest.mark.parametrize("path", ["nowhere", "cases"])
def test_resume_refuses_what_is_no_run(dig, capsys, path):
    assert main(["resume", path]) == 2
    assert path in capsys.readouterr().err


def test_resume_refuses_settings_it_does_not_know(dig, capsys):
    assert main(["dig", "--out", "a"]) == 0
    text = Path("a/run.toml").read_text().replace("\nsteps =", "\nstepps =")
    Path("a/run.toml").write_text(text)
    assert main(["resume", "a"]) == 2  # its digest is in status.json
    assert "run.toml: is not" in capsys.readouterr().err
    for name in ("status.json", "result.json"):  # as where a run was killed before it had them
        Path("a", name).unlink()
    assert main(["resume", "a"]) == 2
    assert "'steps'" in capsys.readouterr().err


# Bench


def test_the_help_of_bench_lists_each_benchmark(capsys):
    assert main(["bench", "--help"]) == 0
    words = re.split(r"\W+", capsys.readouterr().out)
    there = {
        path.stem for path in (ROOT / "benchmarks").glob("*.py") if "\ndef run(" in path.read_text(encoding="utf-8")
    }
    assert {"feet", "view"} < there <= set(words)


def test_bench_names_what_there_is(dig, capsys, monkeypatch):
    import experiments.cli.benching

    Path("pyproject.toml").touch()
    Path("benchmarks").mkdir()
    Path("benchmarks/stones.py").write_text("def run(out, *, progress):\n    return {'what': 'stones'}\n")
    monkeypatch.setattr(experiments.cli.benching, "__file__", str(Path("experiments/cli/benching.py").resolve()))
    assert main(["bench", "stone"]) == 2
    assert "'stones'" in capsys.readouterr().err
    monkeypatch.delitem(sys.modules, "benchmarks", raising=False)
    monkeypatch.syspath_prepend(Path().resolve())
    assert main(["bench", "stones", "--out", "b", "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == json.loads(Path("b/bench.json").read_text()) == {"what": "stones"}
    assert main(["bench", "stones", "--out", "b"]) == 2
    assert "in use" in capsys.readouterr().err
    sys.modules.pop("benchmarks.stones", None)
    sys.modules.pop("benchmarks", None)


def test_bench_without_a_checkout_says_so(dig, capsys, monkeypatch, tmp_path):
    import experiments.cli.benching

    monkeypatch.setattr(experiments.cli.benching, "__file__", str(tmp_path / "experiments" / "benching.py"))
    assert main(["bench"]) == 2
    assert "checkout" in capsys.readouterr().err


def test_effects_are_listed_each_with_what_to_give(capsys):
    assert main(["effects"]) == 0
    shown = capsys.readouterr().out
    for term in EFFECTS.values():
        assert term.id in shown
        for parameter in term.parameters:
            assert f"{term.id}.{parameter.name}" in shown
    assert main(["effects", "pendulum"]) == 0
    shown = " ".join(capsys.readouterr().out.split())
    assert EFFECTS["pendulum"].limits in shown
    golden("cli/effect_of_a_pendulum", shown)
    assert main(["effects", "pendlum"]) == 2
    assert "'pendulum'" in capsys.readouterr().err


@pytest.mark.parametrize("command", [["diagnose"], ["campaign", "check"]])
def test_a_command_about_a_campaign_asks_for_one(command, capsys):
    assert main([*command, "--help"]) == 0
    shown = capsys.readouterr().out
    assert "CAMPAIGN" in shown and "CASE" not in shown


def test_where_nothing_varies_no_spread_is_shown(dig, capsys):
    """A spread of 0 is of what is exact, or was computed once; with several runs it says so beside the others."""
    assert main(["dig", "--out", "a"]) == 0
    assert "spread (std)" in capsys.readouterr().out
    folder = RunFolder.open(Path("a"))
    result = folder.read_result()
    result["quantities"] |= {"length": {"value": 1.0, "std": 0.0, "unit": "m"}}
    folder.write_result(result)
    show_folder(folder, as_json=False)
    assert "exact" in capsys.readouterr().out
    result["quantities"]["depth"]["std"] = None
    folder.write_result(result)
    show_folder(folder, as_json=False)
    shown = capsys.readouterr().out
    assert "spread" not in shown and "exact" not in shown and "length" in shown


# As a program


def test_python_m_hedgebed_is_the_same_command():
    done = subprocess.run([sys.executable, "-m", "hedgebed", "--version"], capture_output=True, text=True, cwd=ROOT)
    assert (done.returncode, done.stdout.strip()) == (0, hedgebed.__version__)


@pytest.mark.parametrize(("name", "also"), [("taichy", "quadrants"), ("quadrants", "pip install quadrants")])
def test_a_taichi_that_is_not_there_is_refused_before_anything_starts(name, also, monkeypatch, capsys):
    monkeypatch.setenv("HEDGEBED_TAICHI", name)
    monkeypatch.setattr(hedgebed_taichi, "find_spec", lambda name: None)
    hedgebed_taichi.chosen.cache_clear()
    try:
        assert main(["penetrate"]) == 2
    finally:
        hedgebed_taichi.chosen.cache_clear()
    said = capsys.readouterr().err
    assert all(word in said for word in ("HEDGEBED_TAICHI", repr(name), also))


def test_help_does_not_wait_for_taichi():
    code = (
        "import sys; from experiments.cli.main import main; main(['penetrate', '--help']); "
        "sys.exit('taichi' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT)
    assert done.returncode == 0, done.stderr


def test_a_robot_without_feet_is_answered_with_the_option_that_is_missing(capsys):
    assert main(["mujoco", "hopper"]) == 2
    assert capsys.readouterr().err.startswith("hedgebed: --feet")
