"""Known biases: the page, the file and the failing rows of the verification agree; reports state their own."""

import json
import re
from pathlib import Path

import pytest

import vis
from vis.page.limits import KINDS, all_limits, kind_of, limits_lines, limits_words, put_lines
from vis.page.report import Report

ROOT = Path(vis.__file__).parents[1]
PAGE = ROOT / "docs" / "limits.md"


def test_the_page_shows_the_limits_of_the_file(tmp_path):
    copy = tmp_path / "limits.md"
    copy.write_text(PAGE.read_text())
    put_lines(copy)
    assert copy.read_text() == PAGE.read_text()  # python -m vis.page.limits docs/limits.md writes it anew


def test_failures_come_first_and_every_limit_has_a_size_in_numbers_or_says_that_there_is_none():
    limits = all_limits()
    fails = [limit.fails for limit in limits]
    assert fails == sorted(fails, reverse=True) and any(fails)
    for limit in limits:
        assert re.search(r"\d|not (modelled|measured)", limit.size), limit.what


def test_the_cases_of_the_verification_that_fail_or_are_outside_are_all_among_the_failures():
    cases = json.loads((ROOT / "docs" / "results" / "validate" / "result.json").read_text())["cases"]
    failing = {case["id"] for case in cases if case["status"] in ("fail", "informational")}
    told = [id for limit in all_limits() if limit.fails for id in limit.case]
    assert sorted(told) == sorted(failing)


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_of_run_has_limits(kind):
    assert any(kind in limit.runs for limit in all_limits())


@pytest.mark.parametrize(
    ("result", "kind"),
    [
        ({"experiment": "penetrate"}, "spike on grains"),
        ({"experiment": "penetrate", "ground": "spring-damper"}, None),
        ({"experiment": "tumble", "ground": "bed", "grains": {}}, "platform on grains"),
        ({"experiment": "tumble", "ground": "spring-damper"}, "planar model"),
        ({"experiment": "tumble spatial", "ground": "bed"}, "platform on grains"),
        ({"experiment": "mujoco", "ground": "bed", "grains": {}}, "robot on grains"),
        ({"experiment": "mujoco", "ground": "rft"}, "robot on a law"),
        ({"experiment": "mujoco", "ground": "spring-damper", "surface": "brick"}, None),
        ({"experiment": "paper"}, "planar model"),
        ({"experiment": "bed test cone"}, "bed"),
        ({"experiment": "diagnose"}, "diagnosis"),
        ({"experiment": "validate"}, None),
    ],
)
def test_the_kind_of_a_run_follows_from_its_result(result, kind):
    assert kind_of(result) == kind
    assert limits_words(result) == [limit.said for limit in all_limits() if kind in limit.runs and limit.said]


def test_a_report_states_two_or_more_biases_of_its_kind_and_where_the_others_are(tmp_path):
    result = {"experiment": "tumble", "ground": "bed", "title": "A tumble", "version": "0", "warnings": []}
    (tmp_path / "result.json").write_text(json.dumps(result))
    page = Report(tmp_path).write([], lead=[]).read_text()
    said = limits_words(result)
    assert len(said) >= 2 and all(words in page for words in said) and "docs/limits.md" in page
    (tmp_path / "result.json").write_text(json.dumps(result | {"experiment": "validate"}))
    assert "docs/limits.md" not in Report(tmp_path).write([], lead=[]).read_text()


def test_marks_that_are_not_there_and_kinds_that_are_none_are_refused(tmp_path):
    page = tmp_path / "page.md"
    page.write_text("no table\n")
    with pytest.raises(ValueError, match="limits: begin"):
        put_lines(page)
    assert limits_lines([]) == limits_lines(())
