"""Half-widths of 95 % intervals against printed tables and the distributions themselves."""

import math

import numpy as np
import pytest
from scipy.stats import norm, t

from rigid.intervals import NORMAL, half_of, half_width, joint_freedom, student


@pytest.mark.parametrize(("freedom", "printed"), [(1, 12.706), (2, 4.303), (4, 2.776), (10, 2.228), (30, 2.042)])
def test_students_factor_is_that_of_printed_tables(freedom, printed):
    assert student(freedom) == pytest.approx(printed, abs=5e-4)


@pytest.mark.parametrize("confidence", [0.9, 0.95])
@pytest.mark.parametrize("freedom", [1, 2.37, 7, math.inf])
def test_students_factor_is_bitwise_that_of_the_distribution(freedom, confidence):
    assert student(freedom, confidence) == float(t.ppf(0.5 + 0.5 * confidence, freedom))


def test_the_factor_of_a_normal_distribution_is_rounded_to_three_digits():
    assert pytest.approx(norm.ppf(0.975), abs=5e-4) == NORMAL


def test_one_value_shows_no_scatter_and_several_have_t_s_over_root_n():
    values = [1.0, 2.0, 4.0]
    assert half_width(0.3, 1) is None and half_width(None, 5) is None
    assert half_width(float(np.std(values, ddof=1)), 3) == pytest.approx(
        4.3027 * math.sqrt(7 / 3) / math.sqrt(3), rel=1e-4
    )


def test_a_fitted_number_has_a_normal_interval_and_students_where_its_freedom_is_known():
    assert half_of({"std": 2.0}) == pytest.approx(3.92)
    assert half_of({"std": 2.0, "freedom": 2}) == pytest.approx(8.606, abs=1e-3)
    assert half_of({"std": None, "freedom": 2}) is None and half_of({}) is None


def test_of_a_standard_error_the_part_of_few_values_decides_the_freedom():
    """Welch and Satterthwaite with one part known exactly: (a + b)^2 / (b^2 / n) of variances a and b."""
    assert joint_freedom(2.0, 2.0, 3) == 3.0
    assert joint_freedom(math.sqrt(1.0 + 1.0), 1.0, 3) == pytest.approx(12.0)
