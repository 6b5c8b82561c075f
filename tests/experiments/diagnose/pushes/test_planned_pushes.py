"""A planned push that separates two models by less than beds differ is not called best; what separates them is said."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from golden import golden

from experiments.diagnose.core.planned_pushes import (
    by_chance,
    chosen_push,
    in_other_beds,
    no_push_words,
    pushes_needed,
    separates,
)
from experiments.diagnose.fit.problem import Parameter
from experiments.diagnose.fit.trials import Planned
from experiments.diagnose.push.beds import in_one_bed
from experiments.diagnose.push.design import _of_beds
from rigid.intervals import student

APART = {"depth_m": 0.024, "speed_m_s": 0.05, "one_N": 40.0, "other_N": 39.0, "one_std_N": 0.1, "other_std_N": 0.1,
         "noise_N": 0.05}  # fmt: skip


def test_a_difference_below_the_scatter_of_beds_separates_nothing():
    """3 % of 40 N are 1.2 N: 1.96 of them are more than 1 N, which the noise alone would show."""
    assert separates(in_other_beds(APART, {}))
    wide = in_other_beds(APART, {"bed": 0.03})
    assert wide["scatter_N"] == pytest.approx(1.2, abs=2e-3) and wide["one_std_N"] == pytest.approx(1.2042, abs=1e-3)
    assert not separates(wide)
    assert not separates(in_other_beds(APART, {"force zero": 0.6}))


def test_the_mean_of_more_pushes_separates_them_unless_the_models_are_too_uncertain():
    """n with 1.96² (2 x 0.1² + 1.2010² / n) < 1²: 6.004."""
    assert pushes_needed(in_other_beds(APART, {"bed": 0.03})) == 7
    assert pushes_needed(in_other_beds(APART | {"one_std_N": 0.6}, {"bed": 0.03})) is None
    assert pushes_needed(in_other_beds(APART, {"bed": 0.2})) is None


def test_few_beds_need_students_t_to_separate_two_models():
    """t of 2 degrees of freedom is 4.303: 1.2 N of beds leave 5.2 N open in one push, not 2.4 N."""
    far, few = APART | {"other_N": 36.0, "noise_N": 0.0}, {"bed": 0.03, "freedom": 2}
    assert separates(in_other_beds(far, {"bed": 0.03}))
    wide = in_other_beds(far, few)
    std = math.hypot(0.1, 0.1, 1.2)
    assert by_chance(wide) == pytest.approx(student(2 * (std / 1.2) ** 4) * std) and not separates(wide)
    assert separates(in_other_beds(far, {"bed": 0.03, "freedom": 30}))


def test_the_mean_of_pushes_in_few_beds_has_students_t_of_all_of_them():
    """Of n further beds: freedom 2 + n - 1. 1 N against t (2 x 0.1² + 1.2010² / n)^0.5 is passed from n = 8 on."""
    wide = in_other_beds(APART, {"bed": 0.03, "freedom": 2})
    count = pushes_needed(wide)
    assert count == 8 > pushes_needed(in_other_beds(APART, {"bed": 0.03}))
    std, part = math.sqrt(0.02 + (1.2**2 + 0.05**2) / count), 1.2 / math.sqrt(count)
    assert by_chance(wide, count) == pytest.approx(student((1 + count) * (std / part) ** 4) * std)


def test_the_error_of_a_model_that_rests_on_few_beds_has_their_freedom():
    """K of few beds: with 2 degrees of freedom 0.5 N of one model leave 2.2 N open, known 1 N."""
    sure = APART | {"one_std_N": 0.5, "other_std_N": 0.0, "noise_N": 0.0, "one_beds_N": 1e-9, "other_beds_N": 1e-9}
    scatter = {"bed": 0.03, "freedom": 2}
    assert by_chance(in_other_beds(sure, scatter)) == pytest.approx(1.96 * 0.5, rel=1e-4)
    wide = in_other_beds(sure | {"one_rests_N": 0.5}, scatter)
    assert by_chance(wide) == pytest.approx(student(2) * 0.5) and wide["one_freedom"] == pytest.approx(2)


def test_the_sentence_says_that_no_push_would_and_what_would():
    def words(apart):
        plan = Planned({}, "push 24 mm deep at 50 mm/s", 3.0, 48, in_other_beds(apart, {"bed": 0.03}))
        return no_push_words(plan, "depth-hardening", "layering", "Push once in a bed prepared anew.")

    golden("diagnose/no_push", "\n".join([words(APART), words(APART | {"one_std_N": 0.6})]))


def test_of_all_pushes_one_that_separates_beside_the_beds_is_taken_before_a_likelier_one():
    likely, clear = Planned({}, "a", 9.0, 2, APART), Planned({}, "b", 3.0, 2, APART | {"other_N": 30.0})
    plan = Planned({}, "a", 9.0, 2, APART, (likely, clear))
    assert chosen_push(plan, {"bed": 0.03}).what == "b" and chosen_push(plan, {}).what == "a"
    assert chosen_push(plan, {"bed": 0.5}).what == "a"


def test_the_error_of_a_planned_push_has_its_own_scatter_and_its_freedom():
    """Other beds differ there by more than their share of the force: on a stiff way back it is a small difference."""
    found = {"one_beds_N": 0.8, "one_peak_N": 68.0, "one_peak_std_N": 0.6, "one_peak_beds_N": 0.8}
    wide = in_other_beds(APART | found, {"bed": 0.03, "force": 0.6, "freedom": 2})
    assert wide["one_std_N"] == pytest.approx(math.hypot(0.1, 1.0)) and wide["other_std_N"] > 1.17
    assert wide["one_peak_std_N"] == pytest.approx(math.hypot(0.6, 1.0))
    assert wide["one_peak_freedom"] == pytest.approx(2 * (1 + 0.36) ** 2)
    assert "one_freedom" not in in_other_beds(APART | found, {"bed": 0.03})


def test_a_planned_push_is_in_the_mean_bed_or_in_one_that_is_stated():
    values = {"stiffness": 900.0, "bed[n1]": 0.1, "force zero[n2]": 0.3}
    assert in_one_bed(values, "n1") == {"stiffness": 900.0}
    assert in_one_bed(values | {"bed": 0.02}, "n1")["bed[n1]"] == 0.02


def test_the_scatter_of_a_planned_push_is_half_of_what_stiffer_and_softer_beds_differ_by():
    """F = K (1 + b) z, and a damper of its own factor: root of (K z s_b)^2 + (C v s_c)^2."""
    scatter = [Parameter(name=f"{kind}[n1]", kind=kind, unit="1", value=0.0, std=std, scale=0.02)
               for kind, std in (("bed", 0.02), ("bed damping", 0.1), ("force zero", 3.0))]  # fmt: skip
    fit = SimpleNamespace(values={}, model=SimpleNamespace(scatter=scatter, forms=()))
    z, v = np.array([0.01, 0.02]), np.array([0.1, 0.1])

    def predict(points, diameter, time, z, v):
        return np.array([1000.0 * (1 + own.get("bed", 0.0)) * z + 50.0 * (1 + own.get("bed damping", 0.0)) * v
                         for own, _ in points])  # fmt: skip

    assert _of_beds(fit, predict, 0.02, z, z, v) == pytest.approx(np.hypot(1000.0 * z * 0.02, 50.0 * v * 0.1))
