"""What a run of penetrate shows in the end: a short table, warnings, the findings that matter, the report's path."""

import json
import os
import shutil
from pathlib import Path

import pytest
from golden import golden

from experiments.cli.main import main
from experiments.penetrate.headline import penetrate_headline
from vis.page.answer import MOST_ROWS, answer
from vis.page.numbers import foldable
from vis.penetrate.answer import answer_tiles

KEPT = Path(__file__).resolve().parents[3] / "docs" / "results"
SHIPPED = KEPT / "penetrate" / "result.json"


def test_a_run_ends_with_a_short_table_and_what_matters(tmp_path, capsys, monkeypatch):
    """The shipped case's result, on 80 columns; with --verbose everything."""
    from experiments.penetrate.settings import PenetrateSettings
    from experiments.runs.folder import RunFolder

    folder = RunFolder.create(tmp_path / "run", "penetrate", PenetrateSettings())
    shutil.copy(SHIPPED, folder.path)
    (folder.path / "report.html").write_text("")
    folder.set_status("done")
    monkeypatch.setenv("COLUMNS", "80")
    assert main(["resume", str(folder.path)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) < 25 and lines[-1] == f"report: {folder.path / 'report.html'}"
    assert all(len(line) <= 80 for line in lines[:-2])
    table = [line for line in lines[2:] if "  " in line.strip()][:9]
    for words in ("Sinkage under", "Largest force", "Work recovered", "stiffness K", "damping C"):
        assert any(words in line for line in table), words
    assert main(["resume", str(folder.path), "--verbose"]) == 0
    whole = capsys.readouterr().out
    assert "coordination_number" in whole and len(whole.splitlines()) > 2 * len(lines)


def test_warnings_are_never_left_out_and_a_reference_is_one_sentence():
    result = json.loads(SHIPPED.read_text())
    found = len(result["departures"]["sentences"])
    result["warnings"] = [f"warning {k}" for k in range(6)]
    result["reference"] = {"moved": {name: {"change": 0.1} for name in ("stiffness", "damping", "sinkage_dem")}}
    headline = penetrate_headline(result)
    assert headline.warnings == tuple(result["warnings"])
    assert len(headline.sentences) == 2
    golden("penetrate/headline_reference", headline.sentences[-1])
    assert headline.left >= found - 2
    assert penetrate_headline({"quantities": {"load": {"value": 1.0}}}) is None


@pytest.mark.parametrize(
    "name", ["penetrate-first", "penetrate-sand", "penetrate-foot-jsc-1a-1g", "penetrate-foot-sand-beds"]
)
def test_the_terminal_has_the_rows_of_the_report(name):
    """Label, value and the spring-damper's of each row; an error that no row knows is named below the table."""
    kept = KEPT / name
    result = json.loads((kept / "result.json").read_text(encoding="utf-8"))
    numbers, *_ = answer(answer_tiles(result), result)
    shown = penetrate_headline(result)
    beside = numbers.head.index("spring-damper")
    of_report = [(*row[:2], row[beside]) for row in numbers.rows]
    assert [(*row[:2], row[-1]) for row in shown.rows] == [tuple(map(foldable, row)) for row in of_report]
    assert len(shown.rows) <= MOST_ROWS and len(numbers.head) == 7
    left_out = [name for name in numbers.head[2:5] if name not in shown.head]
    assert left_out and all(foldable(name) in shown.notes[0] for name in left_out)
    for error in left_out:
        assert {row[numbers.head.index(error)] for row in numbers.rows} <= {"–", "not known"}


def test_a_law_without_a_bed_stands_beside_the_spring_damper():
    numbers = {
        "peak_force_amended@0.2": {"value": 1.5, "std": 0.1, "unit": "N", "note": "driven at 0.2 m/s, with a"},
        "peak_force_spring_damper@0.2": {"value": 1.0, "std": None, "unit": "N"},
        "work_returned_amended": {"value": 0.02, "std": None, "unit": "1"},
    }
    result = {"experiment": "penetrate", "ground": "spring-damper", "model": {"effects": ["a"]}, "quantities": numbers}
    shown = penetrate_headline(result)
    assert [row[1:] for row in shown.rows] == [("1.50 N", "0.20 N", "1.0 N"), ("2.0 %", "–", "")]
    assert "95" in shown.head[2] and "95 %" in shown.notes[-1]


def test_a_report_older_than_its_result_is_made_anew(tmp_path, capsys, monkeypatch):
    from experiments.cli import runs
    from experiments.penetrate.settings import PenetrateSettings
    from experiments.runs.folder import RunFolder

    drawn = []
    monkeypatch.setattr(runs, "draw_report", lambda folder, progress: drawn.append(folder.path))
    folder = RunFolder.create(tmp_path / "run", "penetrate", PenetrateSettings())
    shutil.copy(SHIPPED, folder.path)
    (folder.path / "report.html").write_text("")
    folder.set_status("done")
    assert main(["resume", str(folder.path)]) == 0 and drawn == []
    os.utime(folder.path / "report.html", (1e9, 1e9))
    assert main(["resume", str(folder.path), "--quiet"]) == 0 and drawn == [folder.path]
    assert "older than result.json" in capsys.readouterr().err


def test_k_of_beds_that_do_not_separate_it_has_the_error_of_the_fit():
    """docs/penetrate.md quotes 3,100 ± 4,600 N/m: Student's 4.30 times the standard error over three runs."""
    result = json.loads((KEPT / "penetrate-foot-jsc-1a-1g" / "result.json").read_text(encoding="utf-8"))
    assert result["quantities"]["stiffness"]["std"] is None
    half = 4.303 * result["quantities"]["stiffness_error"]["value"]
    (row,) = (row for row in penetrate_headline(result).rows if "stiffness" in row[0])
    assert row[1].split()[0] == "3100" and row[2].split()[0] == f"{float(f'{half:.2g}'):.0f}"


def test_the_mean_of_the_largest_forces_is_called_one():
    """The largest of all, over which a load is so many times, is another number."""
    for name, several in (("penetrate-foot-sand-beds", True), ("penetrate-foot-sand", False)):
        result = json.loads((KEPT / name / "result.json").read_text(encoding="utf-8"))
        (label,) = (tile.label for tile in answer_tiles(result) if tile.label.startswith("Largest"))
        assert ("mean of beds" in label) == several
