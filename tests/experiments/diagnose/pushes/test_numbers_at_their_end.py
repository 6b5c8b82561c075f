"""A number at the end of its range is in its own unit, and a symbol is explained where the law has it."""

import math
from types import SimpleNamespace

import pytest
from golden import golden

from experiments.diagnose.fit.bounds import bounds_met
from experiments.diagnose.fit.problem import Form, Parameter
from experiments.diagnose.report.to_use import law_sentences
from rigid.terms.candidate import Number

DEPTH = 0.015


def test_a_width_that_is_fitted_as_a_logarithm_is_in_millimetres():
    """The corner of a layer: 0.005 to 0.12 of the typical depth."""
    low, high = math.log(0.005), math.log(0.12)
    width = Parameter(
        name="layering.layer_width", unit="1", value=0.5 * (low + high), scale=0.2, lowest=low, highest=high
    )
    form = Form(effect="layering", name="slope", parameters=(width,), amplitude="layering.layer_slope",
                numbers=(Number(name="layer_width", fitted="layer_width"),))  # fmt: skip
    problem = SimpleNamespace(
        base=(), reported=lambda values, form: {"layer_width": (DEPTH * math.exp(values[width.name]), "m")}
    )
    model, words = SimpleNamespace(problem=problem, forms=(form,), parameters=(width,)), []
    for share in (0.005, 0.12):
        (bound,) = bounds_met(SimpleNamespace(model=model, values={width.name: math.log(share)}))
        assert (bound.parameter, bound.unit) == ("layering.layer_width", "m")
        assert bound.value == pytest.approx(DEPTH * share)
        words.append(bound.words)
    golden("diagnose/at_the_end", words)


@pytest.mark.parametrize(
    ("equation", "stated"), [("K * z * (z / D)^p", True), ("+ layer_slope * max(z - d, 0)", False)]
)
def test_the_typical_depth_is_stated_where_the_law_has_it(equation, stated):
    number = {"value": 800.0, "std": 10.0, "unit": "N/m"}
    diagnosis = {
        "verdict": "named", "kind": "penetration", "typical_depth_m": DEPTH, "at_bounds": {"before": [], "after": []},
        "equations": [{"effect": "e", "form": "f", "equation": equation, "units": {"p": "1"}}],
        "effects": [{"id": "e", "parameters": {"p": number}}], "base": {"after": {"stiffness": number}},
    }  # fmt: skip
    (said,) = law_sentences(diagnosis)
    assert ("15 mm" in said) == stated
