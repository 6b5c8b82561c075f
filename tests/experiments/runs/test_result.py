"""The result of a run: one writer, one reader, and the schema that ships."""

import json
import shutil
import subprocess
import sys
from importlib.resources import files
from pathlib import Path

import jsonschema
import numpy as np
import pytest

from experiments.cli.main import main
from experiments.runs.folder import plain
from experiments.runs.result import Result, Series, quantity, schema
from rigid.digests import check_digests, kept_digests

ROOT = Path(__file__).parents[3]
KEPT = sorted((ROOT / "docs" / "results").rglob("result.json"))
RUNS = [path for path in KEPT if (path.parent / "run.toml").is_file()]
SCHEMA = json.loads(files("experiments.runs").joinpath("result.schema.json").read_text(encoding="utf-8"))


def made(**more):
    return Result.make("tumble", title="A tumble", quantities={"speed": quantity(np.float64(0.5), "m/s")}, **more)


def test_the_schema_that_ships_is_that_of_the_model():
    shipped = files("experiments.runs").joinpath("result.schema.json").read_text(encoding="utf-8")
    assert shipped == schema(), "python -m experiments.runs.result > experiments/runs/result.schema.json"


@pytest.mark.parametrize("path", KEPT, ids=lambda path: path.parent.name)
def test_a_kept_result_is_of_the_schema_and_reads_back_as_it_is(path):
    raw = json.loads(path.read_text(encoding="utf-8"))
    jsonschema.validate(raw, SCHEMA)
    result = Result.load(path.parent)
    assert result == raw and json.dumps(plain(result)) == json.dumps(raw)  # the order of the keys as well


@pytest.mark.parametrize("path", RUNS, ids=lambda path: path.parent.name)
def test_a_kept_run_has_digests_of_its_files_and_matches_them(path):
    """Else a changed number is shown in silence; `python docs/results/digests.py` adds the digests of a new folder."""
    check_digests(path.parent)
    assert {"run.toml", "result.json"} <= set(kept_digests(path.parent)), "python docs/results/digests.py"


def test_a_changed_number_of_a_kept_result_is_refused(tmp_path, capsys):
    kept = shutil.copytree(ROOT / "docs" / "results" / "grains1-sand-0.0085-0.125", tmp_path / "kept")
    assert main(["resume", str(kept), "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == json.loads((kept / "result.json").read_text())
    changed = json.loads((kept / "result.json").read_text())
    next(iter(changed["quantities"].values()))["value"] += 1.0
    (kept / "result.json").write_text(json.dumps(changed))
    assert main(["resume", str(kept), "--json"]) != 0
    shown = capsys.readouterr()
    assert not shown.out and f"{kept / 'result.json'}: is not" in shown.err


def test_digests_are_added_to_kept_runs_and_never_replaced(tmp_path):
    def digests():
        script = ROOT / "docs" / "results" / "digests.py"
        done = subprocess.run([sys.executable, script, tmp_path], capture_output=True, text=True, check=False)
        return done.returncode, done.stderr

    run = tmp_path / "a" / "run"
    made().write(run)
    (run / "run.toml").write_text("x = 1\n")
    (run / "cost.json").write_text('{"processor_time": 1.5}')
    assert digests() == (0, "")
    first = json.loads((run / "cost.json").read_text())
    assert first["processor_time"] == 1.5 and set(first["digests"]) == {"run.toml", "result.json"}
    (run / "run.toml").write_text("x = 2\n")
    (run / "series.csv").write_text("t_s\n0\n")
    status, said = digests()
    assert status == 1 and said.startswith(f"{run / 'run.toml'}: differs")
    second = json.loads((run / "cost.json").read_text())["digests"]
    assert set(second) == {"run.toml", "result.json", "series.csv"} and first["digests"].items() <= second.items()
    (run / "cost.json").write_text("{")
    status, said = digests()
    assert status == 1 and said.startswith(f"{run / 'cost.json'}: cannot be")


def test_a_result_is_written_in_the_order_in_which_it_was_made(tmp_path):
    result = made(speed=np.array([1, 2]), nothing=np.nan, where=Path("a"), warnings=("w",))
    assert result.write(tmp_path) == tmp_path / "result.json"
    raw = json.loads((tmp_path / "result.json").read_text())
    assert " ".join(raw) == "format experiment version title status quantities speed nothing where warnings"
    assert (raw["speed"], raw["nothing"], raw["where"], raw["warnings"]) == ([1, 2], None, "a", ["w"])
    jsonschema.validate(raw, SCHEMA)
    assert Result.load(tmp_path) == result == raw


def test_a_result_is_looked_up_by_key_and_by_attribute():
    result = made(chi2=2)
    speed = result["quantities"]["speed"]
    assert speed["value"] == speed.value == 0.5 and speed == {"value": 0.5, "std": 0.0, "unit": "m/s"}
    assert "note" not in speed and speed.get("note", "none") == "none" and "tables" not in result
    assert result["chi2"] == 2 and result.get("tables", []) == [] and list(result)[:2] == ["format", "experiment"]
    with pytest.raises(KeyError, match="tables"):
        result["tables"]


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"quantities": {"speed": {"value": "fast", "std": None, "unit": "m/s"}}}, r"quantities\.speed\.value"),
        ({"quantities": {"speed": {"value": 1.0, "std": None}}}, r"quantities\.speed\.unit"),
        ({"format": "hedgebed-result/2"}, "format"),
        ({"title": None}, "title"),
    ],
)
def test_what_is_no_result_is_refused_with_file_and_key(tmp_path, change, said):
    (tmp_path / "result.json").write_text(json.dumps(plain(made()) | change))
    with pytest.raises(ValueError, match=rf"result\.json: {said}"):
        Result.load(tmp_path)


def test_a_folder_without_a_result_is_named(tmp_path):
    with pytest.raises(ValueError, match=r"result\.json: cannot be"):
        Result.load(tmp_path / "result.json")
    (tmp_path / "result.json").write_text("{")
    with pytest.raises(ValueError, match=r"result\.json: is no JSON"):
        Result.load(tmp_path)


def test_a_series_knows_its_units_and_reads_back(tmp_path):
    columns = {
        "t_s": np.arange(3.0),
        "vx_m_s": np.array([0.1, np.nan, 1e-17]),
        "state": np.array(["stand", "a,b", "hop"]),
    }
    Series(columns).write(tmp_path / "x.csv")
    back = Series.read(tmp_path / "x.csv")
    assert back.units == {"t_s": "s", "vx_m_s": "m/s", "state": ""}
    assert all(np.array_equal(back.columns[name], columns[name], equal_nan=name != "state") for name in columns)


def test_frames_of_pandas(monkeypatch):
    pandas = pytest.importorskip("pandas")
    frame = made().to_dataframe()
    assert frame.loc["speed", "value"] == 0.5 and list(frame) == ["value", "std", "unit", "note", "interval"]
    assert isinstance(Series({"t_s": np.arange(3.0)}).to_dataframe(), pandas.DataFrame)


def test_without_pandas_the_extra_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(ImportError, match=r"hedgebed\[pandas\]"):
        made().to_dataframe()
