"""What a run of penetrate shows in the end: a short table, warnings, the findings that matter, the report's path."""

import json
import os
import shutil
from pathlib import Path

from golden import golden

from experiments.cli.main import main
from experiments.penetrate.headline import penetrate_headline

SHIPPED = Path(__file__).resolve().parents[3] / "docs" / "results" / "penetrate" / "result.json"


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
    for words in ("sinkage at rest", "drag at 0.1 m/s", "drag at 0.4 m/s", "drop at 0.2 m/s", "stiffness K"):
        assert any(line.startswith(words) or words in line for line in table), words
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
    assert penetrate_headline({"quantities": {"stiffness": {"value": 1.0}}}) is None  # without a bed


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
