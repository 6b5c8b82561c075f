"""A report begins with its answer: six numbers at most, their errors, a picture, three findings; the rest is folded."""

import re
import shutil
from pathlib import Path

import pytest

from vis.page.answer import MOST_ROWS, answer, write_page
from vis.page.page import Page, Section, Tile, listing, text
from vis.report import write_report

ON_GRAINS = {"experiment": "penetrate", "ground": "bed"}


def test_a_spread_is_the_error_of_chance_and_the_others_are_empty():
    numbers, note = answer([Tile("K", "66 ± 13 N/m", "fitted"), Tile("force", "1.4 N")], ON_GRAINS)
    assert (numbers.head[1], numbers.head[3]) == ("value", "± grain size") and "softness" in numbers.head[4]
    assert numbers.head[2].startswith("± chance") and "95" in numbers.head[2]
    assert numbers.rows[0] == ("K", "66 N/m", "13 N/m", "–", "–", "fitted")
    assert numbers.rows[1] == ("force", "1.4 N", "–", "–", "–", "")
    assert note.kind == "text"


def test_three_known_errors_stand_in_their_columns():
    (numbers,) = answer([Tile("K", "38.9 N/m", "95 %", ("5.2 N/m", "17 N/m", "18 N/m"))], ON_GRAINS)
    assert numbers.rows == (("K", "38.9 N/m", "5.2 N/m", "17 N/m", "18 N/m", "95 %"),)


def test_a_law_alone_has_no_columns_of_errors_that_it_cannot_have():
    (numbers,) = answer([Tile("launch", "0.1 m/s")], {"experiment": "hop"})
    assert numbers.head == ("", "value", "")


def test_more_than_six_numbers_are_no_answer():
    tiles = [Tile(str(number), "1") for number in range(MOST_ROWS + 1)]
    with pytest.raises(ValueError, match=f"{MOST_ROWS + 1} numbers"):
        answer(tiles, ON_GRAINS)


def test_three_findings_are_open_and_the_rest_is_folded(tmp_path):
    findings = [f"finding {number}" for number in range(5)]
    page = Page("t", [], [Section("", [listing(findings)]), Section("Numbers", [text("all of them")])])
    html = write_page(tmp_path / "report.html", page, {}).read_text()
    opened, folded = html.split("<details", 1)
    assert re.findall(r"finding \d", opened) == findings[:3]
    assert re.findall(r"finding \d", folded) == findings[3:] and "all of them" in folded


def test_the_error_of_a_law_in_other_beds_is_a_share_in_per_cent(tmp_path):
    """calibrate-sand-1mm: 0.1075 of the rms force, with a scatter of 0.0027 between the beds."""
    kept = Path(__file__).parents[2] / "docs" / "results" / "calibrate-sand-1mm"
    folder = tmp_path / "run"
    shutil.copytree(kept, folder)
    page = write_report(folder).read_text(encoding="utf-8")
    assert "<td>10.7 %</td>" in page.replace("\N{NO-BREAK SPACE}", " ")
