"""Numbers are quoted to the digits that their uncertainty allows."""

import math

import numpy as np
import pytest

from vis.page.law_rows import cell_of
from vis.page.numbers import (
    beside,
    between,
    column,
    fitted,
    in_one_unit,
    plain,
    quantity,
    quote,
    scale_of,
    typeset,
    within,
)
from vis.sweep.report import on_axis

SPACE = "\N{NO-BREAK SPACE}"


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ((92.31, 4.2, "N/m"), "92 ± 4 N/m"),
        ((92.31, 1.4, "N/m"), "92.3 ± 1.4 N/m"),
        ((0.00215, 0.00012, "m"), "2.15 ± 0.12 mm"),
        ((0.231, 0.02, "%"), "23.1 ± 2.0 %"),
        ((38.43, 2.39, "N"), "38.4 ± 2.4 N"),
        ((38.43, 3.54, "N"), "38.4 ± 3.5 N"),
        ((38.43, 3.56, "N"), "38 ± 4 N"),
        ((38.43, 9.7, "N"), "38 ± 10 N"),
        ((0.3843, 0.097, "N"), "0.38 ± 0.10 N"),
        ((6130.0, 239.0, "N/m"), "6130 ± 240 N/m"),
        ((123456.7, 1200.0, "N/m"), "123 500 ± 1200 N/m"),
        ((20480, 0, "1"), "20 480"),
        ((9.80665, 0.0, "m/s2"), "9.807 m/s²"),
        ((0.0036, 0.0, "m"), "3.6 mm"),
        ((3.2e-4, None, "J"), "320 µJ"),
        ((-1234567.0, None, "Pa"), "−1.23 MPa"),
        ((0.9997, None, "N"), "1.00 N"),
        ((0.219, None, "N"), "0.219 N"),
        ((0.0, 0.0, "m"), "0 mm"),
        ((None, None, "m"), "unknown"),
        ((math.nan, None, "N"), "not a number N"),
    ],
)
def test_quote(given, words):
    assert quote(*given).replace(SPACE, " ") == words


def test_a_number_smaller_than_its_error_is_not_shown_as_zero():
    assert beside(0.3749, 2.387) == "0.4" and beside(-0.3749, 2.387) == "-0.4"
    assert beside(299.3846, 0.3695) == "299.4" and beside(4.068, 0.026) == "4.068"
    assert beside(0.3749, None) == "0.3749" and beside(0.0, 2.4) == "0.0"


def test_a_fitted_number_is_quoted_with_half_of_its_95_percent_interval():
    entry = {"value": 722.3, "std": 10.7, "unit": "N/m", "note": "error of the fit"}
    assert fitted(entry) == quote(722.3, 1.96 * 10.7, "N/m")
    assert fitted(entry | {"freedom": 2}) == quote(722.3, 4.3027 * 10.7, "N/m")
    assert fitted(entry | {"std": None}, significant=4) == quote(722.3, None, "N/m", significant=4)


def test_quantity_takes_what_result_json_holds():
    assert quantity({"value": 4.21, "std": 0.35, "unit": "N s/m"}).replace(SPACE, " ") == "4.21 ± 0.35 N s/m"
    assert quantity({"value": 0.284, "std": None, "unit": "1"}, unit="%").replace(SPACE, " ") == "28 %"
    assert quantity({"value": 0.000546, "std": None, "unit": "m"}).replace(SPACE, " ") == "0.55 mm"
    assert quantity({"value": 549.0, "std": None, "unit": "N/m"}).replace(SPACE, " ") == "550 N/m"
    assert quantity({"value": 4682.0, "std": None, "unit": "1"}) == "4682"
    assert quantity({"value": 0.3, "std": 0.0, "unit": "N"}).replace(SPACE, " ") == "0.3 N"
    assert quantity({"value": None, "std": None, "unit": "m"}) == "unknown"
    assert quantity(None) == "unknown"
    assert quantity("sand") == "sand"


def test_column_has_one_unit():
    assert column([0.229, 0.888, 1.8, None], "N") == ("N", ["0.229", "0.888", "1.80", "–"])
    assert column([0.04, 7e-4], "J") == ("mJ", ["40.0", "0.700"])
    assert column([math.pi, None], "rad") == ("degrees", ["180", "–"])


def test_axes_and_tables_have_one_unit_for_the_same_numbers():
    for unit, values in (("rad", [0.1, 0.2]), ("m", [0.002]), ("m", [2.0]), ("J", [3e-3]), ("N/m", [90.0])):
        scale, shown = scale_of(values, unit)
        entry = {"unit": unit, "words": "it"}
        drawn, label = on_axis(np.array(values), entry, "it")
        assert drawn == pytest.approx(np.array(values) / scale) and label == f"it [{shown}]"
        assert column(values, unit)[0] == shown
    assert on_axis(np.array(["sand"]), {"unit": "1", "words": "it"}, "it")[1] == "it"


def test_plain_keeps_to_its_digits():
    assert [plain(x) for x in (1234.5, 0.00123, 1e-7, 0.0)] == ["1234", "0.00123", "1.00×10⁻⁷", "0"]


@pytest.mark.parametrize(
    ("given", "set_"),
    [
        ("rig at 0.08336 m/s2", "rig at 0.08336 m/s²"),
        ("v^2 [m2/s2]", "v² [m²/s²]"),
        ("F / (rho g D^3) [1]", "F / (ρ g D³) [1]"),
        ("robot s2 on bed m3", "robot s2 on bed m3"),
    ],
)
def test_powers_of_a_title_are_raised_and_names_stay(given, set_):
    assert typeset(given) == set_


def test_an_interval_that_begins_at_0_states_its_upper_end_alone():
    assert within(0.0, 0.0066, "m").replace(SPACE, " ") == "below 6.6 mm"
    assert within(0.001, 0.0066, "m") == between(0.001, 0.0066, "m")


def test_numbers_of_one_sentence_have_one_unit_and_an_end_that_is_hardly_below_0_is_0():
    shown = [
        one.replace("\N{NO-BREAK SPACE}", " ") for one in in_one_unit([-0.01, 0.055, 0.0], "m", widest=(-0.01, 2.28))
    ]
    assert shown == ["\N{MINUS SIGN}0.01 m", "0.06 m", "0.00 m"]
    assert in_one_unit([0.0246], "m", widest=(0.0, 0.0296)) == ["24.6\N{NO-BREAK SPACE}mm"]
    assert between(-7.8e-7, 0.03, "m") == between(0.0, 0.03, "m") != between(-1e-4, 0.03, "m")


def test_an_angle_of_rounding_is_nought_degrees():
    assert [cell_of(math.radians(value), None, "rad") for value in (6.75e-9, 0.012)] == ["0°", "0.012°"]


@pytest.mark.parametrize(("half", "shown"), [(48.0, "66° ± 48°"), (120.0, "66° ± 120°"), (4.8, "66° ± 5°")])
def test_an_angle_is_not_rounded_to_tens_beside_the_same_angle_in_a_sentence(half, shown):
    assert cell_of(math.radians(65.7), math.radians(half), "rad") == shown
