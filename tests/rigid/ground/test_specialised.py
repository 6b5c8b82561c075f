"""A law with its numbers in its source: the same bits as the law's own functions."""

import itertools

import numpy as np
import pytest

from rigid.ground.laws import FOOT_LAWS, GROUNDS
from rigid.ground.specialised import written


def functions_of(law, numbers):
    """Loading of top, and force of depth and rate, from the written source."""
    own, names = written(law, numbers), {}
    for name, arguments, lines, value in (
        ("loading", "top", own.loading_lines, own.loading),
        ("rate_force", "depth, rate", own.rate_lines, own.rate_force),
    ):
        source = "\n    ".join([f"def {name}({arguments}):", *lines, f"return {value}"])
        exec(source, names)
    return names["loading"], names["rate_force"]


SHAPES = (
    {"roundness": 0.0, "perimeter": 0.1},
    {"roundness": 0.0},
    {"roundness": 1.0, "height": 0.02, "perimeter": 0.05},
    {"roundness": 2.0, "height": 0.01},
)
CASES = [(law, {}) for law in GROUNDS.values()] + list(itertools.product(FOOT_LAWS.values(), SHAPES))


@pytest.mark.parametrize(("law", "given"), CASES, ids=lambda case: getattr(case, "name", None))
def test_a_specialised_law_has_the_bits_of_its_functions_at_all_depths_and_rates(law, given):
    p = law.numbers(given, count=0.125)
    loading, rate_force = functions_of(law, p)
    for depth, rate in itertools.product(np.geomspace(1e-7, 1.0, 60).tolist(), (-3.0, -0.2, 0.0, 0.05, 4.0)):
        assert loading(depth) == law.loading(depth, p) and rate_force(depth, rate) == law.rate_force(depth, rate, p)


def test_two_sets_of_numbers_have_two_forces():
    law = GROUNDS["spring-damper"]
    once, twice = (functions_of(law, law.numbers({"stiffness": k, "damping": 0.0}))[0] for k in (50.0, 100.0))
    assert twice(0.01) == 2 * once(0.01) == 1.0
