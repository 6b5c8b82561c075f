"""No table is wider than the page: sentences wrap, numbers do not, and what is long stands beneath its row."""

import re
from importlib.resources import files

import pytest
from matplotlib import get_data_path
from PIL import ImageFont

from vis.page.answer import write_page
from vis.page.folder import read_folder
from vis.page.page import Page, Section, columns, table
from vis.penetrate.summary import summarise

SHEET = files("vis").joinpath("templates/style.css").read_text().partition("@media print")[0]
REASON = (
    "the first state but for a slip of less than 0.1 s as the torque sets in; on rigid ground a pivot asks for 0.182, "
)
CLAIMS = (
    ("what the text states", "stated", "ours", "difference", "inside", "judged by, and why"),
    [
        ("on grains a brake trial sinks and leaves at a negative angle (sand, 0.0085 g, 6 N m)", "below 0 degrees",
         "friction moves the angle of the first hop by up to 1.5 degrees", "+15.7 degrees", "not comparable",
         3 * REASON),
        ("the angle grows with torque", "rising", "40.4, 61.6, 75.7 degrees", "–", "yes", ""),
    ],
)  # fmt: skip
CASES = (
    (
        "surface",
        "g",
        "torque [N m]",
        "angle [degrees]",
        "speed [mm/s]",
        "dθ/dt [rad/s]",
        "slip [degrees]",
        "hop [degrees]",
    ),
    [
        ("steel", "0.0085", "0.125", "0.0299 (0.0299 to 0.0299; 0.0293)", *4 * ["65.4 (65.4 to 65.4; 65.4)"]),
        ("sand", "0.015", "6", *5 * ["none"]),
    ],
)


def rule(selector, name):
    """Value of the last declaration of `name` for the selector, None where there is none."""
    found = None
    for selectors, body in re.findall(r"^\s*([^{}@]+?)\s*\{([^{}]*)\}", SHEET, re.MULTILINE):
        if selector in [one.strip() for one in selectors.split(",")]:
            for key, value in re.findall(r"([a-z-]+):\s*([^;]+)", body):
                found = value.strip() if key == name else found
    return found


def pixels(value, em):
    number, unit = re.fullmatch(r"([\d.]+)(rem|em)", value).groups()
    return float(number) * {"rem": 16.0, "em": em}[unit]


def narrowest(head, rows):
    """Width [px] below which the table does not go: each column's longest text that is not broken, and its padding."""
    t = columns(head, rows)
    size = pixels(rule("table.many" if t.many else "table", "font-size"), 16.0)
    font = ImageFont.truetype(f"{get_data_path()}/fonts/ttf/DejaVuSans.ttf", 100)
    padding = pixels(rule("table.many td", "padding-right") if t.many else rule("td", "padding").split()[1], size)
    total = 0.0
    for i, kind in enumerate(t.kinds[: len(t.kinds) - t.beneath]):
        own = kind.split()
        wraps = any(rule(f"td.{name}", "white-space") == "normal" for name in own)
        cells = [row[i] for row in t.rows]
        kept = [word for cell in cells for word in cell.split(" ")] if wraps else cells
        if any(rule(f"td.{name}", "overflow-wrap") == "anywhere" for name in own):
            kept = []
        text = max((font.getlength(word) * size / 100.0 for word in kept), default=0.0)
        least = max((pixels(rule(f"td.{name}", "min-width") or "0em", size) for name in own), default=0.0)
        total += max(text + padding, least)
    return total


def box():
    """Width [px] of the page's column of text."""
    return pixels(rule("main", "max-width"), 16.0) - 2 * pixels(rule("main", "padding").split()[1], 16.0)


@pytest.mark.parametrize(("head", "rows"), [CLAIMS, CASES], ids=["claims", "cases"])
def test_the_tables_of_the_paper_fit_the_page(head, rows):
    assert narrowest(head, rows) <= box()


def test_the_tables_of_a_penetration_fit_the_page(tmp_path, make_run):
    said = summarise(read_folder(make_run(tmp_path, frames=0)))
    for name in ("runs", "numbers", "settings"):
        assert narrowest(said[name]["head"], said[name]["rows"]) <= box(), name


def test_sentences_wrap_and_numbers_do_not():
    path = "/".join(["a-folder"] * 5)
    row = ("231 ± 12 N/m", "driven at 0.1 m/s over the whole bed", REASON, "0.3 (0.2 to 0.4; 0.30), 1.2 to 1.3", path)
    assert columns((), [row]).kinds == ("", "words", "prose", "parts", "words anywhere")
    assert rule("td", "white-space") == "nowrap"
    assert {rule(f"td.{name}", "white-space") for name in ("words", "prose", "parts")} == {"normal"}
    assert rule("td.anywhere", "overflow-wrap") == "anywhere"


def test_a_number_of_several_parts_breaks_between_them_only():
    (cell,) = columns((), [("-0.0299 (-0.0299 to 0.0299; 0.0293)",)]).rows[0]
    assert cell.split(" ") == ["-0.0299", "(-0.0299\N{NO-BREAK SPACE}to\N{NO-BREAK SPACE}0.0299;", "0.0293)"]


def test_a_long_reason_stands_beneath_its_row_under_its_own_heading(tmp_path):
    written = write_page(
        tmp_path / "page.html", Page(title="", lead=[], sections=[Section("", [table(*CLAIMS, words=True)])]), {}
    ).read_text()
    assert '<tr><th class="beneath" colspan="5">judged by, and why</th></tr>' in written
    assert written.count('<td class="beneath" colspan="5">') == 1  # the second row gives no reason
    assert written.count('<td class="prose">') == 4
    few = columns(CLAIMS[0][:3], [("the angle grows", "rising", 3 * REASON)])
    assert not few.beneath  # there is room beside two columns


def test_rows_of_different_lengths_are_refused():
    with pytest.raises(ValueError, match="argument 2"):
        columns((), [("1", "2"), ("3",)])
