"""`hedgebed validate`: what it runs, keeps, and writes."""

import json
import re
from dataclasses import replace
from pathlib import Path

import matplotlib.image
import numpy as np
import pytest
from golden import golden, page_lines

import vis
from experiments.cli.main import main
from experiments.validate import experiment
from experiments.validate.base.case import Case, Comparison, Curve, Outcome, Plot
from experiments.validate.beds.friction_angle import mohr_angle
from experiments.validate.pages import KEPT, markdown, notebook
from experiments.validate.settings import ValidateSettings
from experiments.validate.suite import SUITE, chosen
from vis.bed.validation import _COLOURS, _colours, _draw, _titled


def good(tell):
    tell(0.5)
    plot = Plot(
        "A line, drawn",
        "x [m]",
        "y [N]",
        [Curve("law, closed", [0.0, 1.0], [0.0, 2.0], False), Curve("bed", [0.5], [1.0])],
    )
    return Outcome(
        [Comparison("a", "N", 2.0, 2.01, 0.01), Comparison("b", "1", 0.0, 1e-9, 1e-6, False)], [plot], ["Well."]
    )


def bad(tell):
    return Outcome([Comparison("c", "m", 1.0, 1.5, 0.1)])


CASES = (
    Case("good", "One", "A good one", "y = 2 x", "a book", good),
    Case("bad", "One", "A bad one", "y = 1", "a paper", bad, reason="it is known to be bad"),
    Case("long", "Two", "A long one", "y = 1", "a paper", good, slow=True),
    Case("lacking", "Two", "One that lacks a code", "y", "a code", lambda tell: Outcome(skipped="there is no code")),
    Case("later", "Two", "One for later", "y", "a paper", waits_for="walls"),
)


def counts(table):
    """How many cases stand where, as the head of the kept table has it."""
    found = re.findall(r"(\d+) (pass|fail|not run|not yet)\b", table.read_text().split("##")[0])
    return {where: int(count) for count, where in found}


@pytest.fixture
def suite(monkeypatch):
    """A suite that computes nothing; returns how often each of its cases was run."""
    runs: dict[str, int] = {}

    def counted(case, tell=None):
        runs[case.id] = runs.get(case.id, 0) + 1
        return real(case, tell)

    real = experiment.run_case
    monkeypatch.setattr(experiment, "run_case", counted)
    monkeypatch.setattr(experiment, "SUITE", CASES)
    monkeypatch.setattr("experiments.validate.suite.SUITE", CASES)
    return runs


def test_a_table_and_a_page_show_every_case(suite, tmp_path, capsys):
    document = tmp_path / "validation.md"
    assert main(["validate", "--out", str(tmp_path / "run"), "--document", str(document), "--quiet"]) == 0
    result = json.loads((tmp_path / "run" / "result.json").read_text())
    assert {row["id"]: row["status"] for row in result["cases"]} == {
        "good": "pass", "bad": "fail", "long": "pass", "lacking": "skipped", "later": "not yet",
    }  # fmt: skip
    assert result["quantities"]["cases_fail"]["value"] == 1
    text = document.read_text()
    assert text == (tmp_path / "run" / "validation.md").read_text()
    details = (tmp_path / "notes" / "validation.md").read_text()
    assert details == (tmp_path / "run" / "notes" / "validation.md").read_text()
    golden("validate/table", {"page": text, "details": details})
    page = (tmp_path / "run" / "report.html").read_text()
    golden("validate/page", page_lines(page))
    assert "A line, drawn" in page and "data:image/png" in page
    assert vis.write_report(tmp_path / "run").read_text() == page  # the page of any folder, made again
    assert "c is 1.5, 1" in " ".join(capsys.readouterr().out.split())


def test_many_curves_are_told_beneath_their_plot(tmp_path):
    """With a colour each, and where none of them runs through their names: the plot is as high, the picture higher."""
    (tmp_path / "figures").mkdir()
    heights = []
    for count in (2, 9):
        rows = [f"{name},{x},{x * k}" for k, name in enumerate("abcdefghi"[:count]) for x in (0.0, 1.0)]
        (tmp_path / "curves.csv").write_text("\n".join(["curve,x,y", *rows]))
        plot = {"series": "curves.csv", "title": "t", "x": "x", "y": "y", "log": "", "lines": ["a"]}
        _draw(tmp_path, {"id": f"of-{count}", "title": "t"}, plot, 1)
        heights.append(matplotlib.image.imread(tmp_path / "figures" / f"of-{count}-1.png").shape[0])
    assert heights[1] > heights[0] + 30
    assert len(set(_COLOURS)) == len(_COLOURS) >= 9


def test_a_line_and_the_dots_that_it_is_for_have_one_colour():
    lines, dots = ["line; 3 mm", "line; 7 mm"], ["bed; 3 mm", "bed; 7 mm", "bed 1; own", "bed 2; own"]
    found = _colours([*lines, *dots], lines)
    assert [found[label] for label in dots[:2]] == [found[label] for label in lines]
    assert len(set(found.values())) == 4
    assert _colours(["law", *dots], ["law"])["law"] not in {found[label] for label in dots}


def test_figures_of_real_cases_name_grains_and_gravity_and_call_nothing_measured():
    titles = {case.id: _titled(case.about()) for case in SUITE if case.measured}
    assert "glass beads" in titles["katsuragi-durian"]
    assert not [title for title in titles.values() if "easured" in title or "m/s\N{SUPERSCRIPT TWO}" not in title]


def test_finished_cases_are_kept_until_their_code_changes(suite, tmp_path, monkeypatch):
    settings = ValidateSettings(document=str(tmp_path / "validation.md"))
    experiment.run(settings, tmp_path / "run")
    experiment.resume(tmp_path / "run")
    assert suite == {"good": 1, "bad": 1, "long": 1, "lacking": 2}  # what was skipped is tried again
    monkeypatch.setattr(experiment, "fingerprint_of", lambda case: "other code")
    experiment.resume(tmp_path / "run")
    assert suite["good"] == 2


def test_part_of_the_suite_leaves_the_committed_table_alone(suite, tmp_path, monkeypatch):
    monkeypatch.setattr(experiment, "_ROOT", tmp_path)
    (tmp_path / "docs").mkdir()
    (tmp_path / "pyproject.toml").touch()
    experiment.run(ValidateSettings(only=("good",)), tmp_path / "one")
    experiment.run(ValidateSettings(quick=True), tmp_path / "quick")
    assert suite == {"good": 2, "bad": 1, "lacking": 1}
    golden("validate/page_of_one", page_lines((tmp_path / "one" / "report.html").read_text()))
    assert not (tmp_path / "docs" / "validation.md").exists()
    experiment.run(ValidateSettings(), tmp_path / "all")
    assert "hedgebed validate`" in (tmp_path / "docs" / "validation.md").read_text()


def test_a_case_run_by_itself_goes_into_the_kept_table_with_its_own_code(suite, tmp_path, monkeypatch):
    monkeypatch.setattr(experiment, "_ROOT", tmp_path)
    (tmp_path / "docs").mkdir()
    (tmp_path / "pyproject.toml").touch()
    experiment.run(ValidateSettings(quick=True), tmp_path / "quick")
    experiment.run(ValidateSettings(only=("long",), keep=True), tmp_path / "one")
    table = tmp_path / "docs" / "validation.md"
    assert counts(table) == {"pass": 1, "fail": 0, "not run": 3, "not yet": 1}
    experiment.run(ValidateSettings(only=("bad",), keep=True), tmp_path / "two")
    text = table.read_text()
    assert counts(table) == {"pass": 1, "fail": 1, "not run": 2, "not yet": 1}
    details = (tmp_path / "docs" / "notes" / "validation.md").read_text()
    assert "validate --only bad`" in details and details.index("### bad") < details.index("### long")
    golden("validate/table_of_two", {"page": text, "details": details})
    experiment.run(ValidateSettings(), tmp_path / "all")
    assert table.read_text() == (tmp_path / "all" / "validation.md").read_text()
    with pytest.raises(ValueError, match="leave document out"):
        experiment.run(ValidateSettings(keep=True, document=str(tmp_path / "x.md")), tmp_path / "four")


def test_cases_run_together_are_kept_with_the_command_of_each(suite, tmp_path, monkeypatch):
    monkeypatch.setattr(experiment, "_ROOT", tmp_path)
    (tmp_path / "docs").mkdir()
    (tmp_path / "pyproject.toml").touch()
    experiment.run(ValidateSettings(only=("good", "bad"), keep=True), tmp_path / "both")
    text = (tmp_path / "docs" / "notes" / "validation.md").read_text()
    assert "--only good`" in text and "--only bad`" in text and "good bad" not in text


def test_the_pages_are_made_again_from_the_kept_result_in_the_words_of_today(suite, tmp_path, monkeypatch):
    monkeypatch.setattr(experiment, "_ROOT", tmp_path)
    (tmp_path / "docs").mkdir()
    (tmp_path / "pyproject.toml").touch()
    experiment.run(ValidateSettings(), tmp_path / "all")
    before, table = json.loads((tmp_path / KEPT).read_text()), tmp_path / "docs" / "validation.md"
    monkeypatch.setattr(experiment, "SUITE", (replace(CASES[0], title="A better name"), *CASES[1:]))
    computed = dict(suite)
    experiment.keep(())
    after = json.loads((tmp_path / KEPT).read_text())
    assert suite == computed and "A better name" in table.read_text()
    numbers = [[row.get("comparisons", []) for row in result["cases"]] for result in (before, after)]
    assert numbers[0] == numbers[1] and any(numbers[0]) and before["date"] == after["date"]


def test_the_pages_of_the_checkout_are_those_of_its_kept_result():
    root = Path(experiment.__file__).resolve().parents[2]
    kept = json.loads((root / KEPT).read_text())
    assert (root / "docs" / "validation.md").read_text() == markdown(kept, command="hedgebed validate")
    assert (root / "docs" / "notes" / "validation.md").read_text() == notebook(kept)


def test_a_case_there_is_not_is_refused_with_the_nearest(tmp_path, capsys):
    assert main(["validate", "--only", "free-fal", "--out", str(tmp_path / "run")]) == 2
    told = capsys.readouterr().err
    assert "only = 'free-fal'" in told and "mean 'free-fall'" in told
    assert not (tmp_path / "run").exists()
    assert main(["validate", "--document", str(tmp_path / "no" / "x.md"), "--out", str(tmp_path / "run")]) == 2


def test_the_real_suite_is_chosen_from_by_name_and_by_speed():
    assert [case.id for case in chosen(["t2", "t1"])] == ["t1", "t2"]
    assert {case.id for case in SUITE if case.slow} == {case.id for case in chosen()} - {
        c.id for c in chosen(quick=True)
    }


def test_a_difference_that_is_not_a_number_is_said():
    row = {"quantity": "a", "unit": "1", "reference": 1.0, "ours": None, "difference": None, "share": None,
           "passes": False, "band": 0.1, "relative": True}  # fmt: skip
    case = {"id": "x", "family": "f", "title": "t", "reference": "r", "source": "s", "status": "fail", "worst": row,
            "comparisons": [row], "remarks": [], "reason": "", "date": "2026-01-01", "seconds": 1.0}  # fmt: skip
    text = markdown(
        {"title": "v: 1 fail", "date": "2026-01-01", "version": "0", "code": "0", "cases": [case]},
        command="hedgebed validate",
    )
    assert "not a number" in text
    golden("validate/no_number", text)


def test_mohrs_circle_asks_for_no_plane():
    """s1 / s3 = (1 + sin) / (1 - sin) however the axes lie; with like normal stresses its sine is tau / p."""
    tensor = np.diag([1.0, 1.3, (1 + 0.5) / (1 - 0.5)])
    c, s = np.cos(0.7), np.sin(0.7)
    turn = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    assert mohr_angle(turn @ tensor @ turn.T) == pytest.approx(30)
    assert mohr_angle(np.array([[1, 0, 0.382], [0, 1, 0], [0.382, 0, 1]])) == pytest.approx(
        np.degrees(np.arcsin(0.382))
    )
    with pytest.raises(ValueError, match="stress = 0 Pa"):
        mohr_angle(np.diag([0.0, 1.0, 1.0]))
