"""Tables of a result on the terminal: in parts where the screen is narrow, and never cut."""

from io import StringIO

import pytest
from rich.console import Console

from experiments.cli.runs import _show_tables

NUMBERS = {
    "title": "Each run",
    "head": ["quantity", "unit", *map(str, range(1, 8))],
    "rows": [
        ["coefficient of static friction", "", *["0.4"] * 7],
        ["energy residual", "", *(f"2.85{k}×10⁻¹⁰" for k in range(7))],
        ["largest sinkage", "mm", *(f"0.107{k}" for k in range(7))],
    ],
}


def shown(table, width):
    file = StringIO()
    _show_tables([table], Console(file=file, width=width, highlight=False))
    return file.getvalue()


@pytest.mark.parametrize(("width", "parts"), [(200, 1), (80, 3), (60, 4), (40, 7)])
def test_a_table_of_numbers_that_is_too_wide_is_shown_in_parts_with_every_name_whole(width, parts):
    text = shown(NUMBERS, width)
    assert text.count("quantity") == parts and "…" not in text
    assert all(len(line) <= width for line in text.splitlines())
    words = text.split()
    for row in NUMBERS["rows"]:
        assert all(word in words for cell in row for word in cell.split())
    assert words.count("mm") == parts


def test_a_table_of_sentences_stays_in_one_part():
    table = {"title": "", "head": ["what", "which", "why"], "rows": [["this", "that", "a long sentence " * 9]]}
    assert shown(table, 60).count("what") == 1
