"""What K is beside a form that redefines it: the slope at the surface, a secant, or the ground above a layer."""

import inspect

import pytest

from rigid.terms import CANDIDATES
from vis.diagnose.usable import stiffness_words

K, D = 900.0, 0.01
SIZES = {"hardening_reach": 2e-4, "hardening_sharpness": 1.5, "layer_depth": 5e-3, "layer_width": 1e-4}
FORMS = [
    (effect, form)
    for effect in ("depth-hardening", "layering")
    for form in CANDIDATES[effect].push.forms
    if "stiffness" in form.redefines
]


def loading(effect, form, z):
    """The force [N] of the law alone, its amplitude 0.4, or 0.4 N, or half of K."""
    law = CANDIDATES[effect].push.law["loading"]
    slots, amplitude = list(inspect.signature(law).parameters), form.numbers[0].name
    numbers = dict.fromkeys(slots, 0.0) | SIZES | {"grown": K * z, "depth": z, "x": z / D}
    numbers[amplitude] = K / 2 if amplitude == "layer_slope" else 0.4
    return law(**{name: numbers[name] for name in slots})


@pytest.mark.parametrize(("effect", "form"), FORMS, ids=lambda one: getattr(one, "name", one))
def test_k_is_in_each_form_what_is_said_beside_it(effect, form):
    """K z times the form's factor, read where the words state it; elsewhere, at 8 mm, F is no K z."""
    said, deep = form.stiffness, 8e-3
    if said == "F / z at z = D":
        assert loading(effect, form, D) == pytest.approx(K * D)
    elif said == "slope far below hardening_reach":
        slope = (loading(effect, form, deep + 1e-6) - loading(effect, form, deep)) / 1e-6
        assert slope == pytest.approx(K, rel=1e-5)
    elif said.startswith("without the "):
        assert loading(effect, form, 2e-3) == pytest.approx(K * 2e-3, rel=1e-3) and form.name in said
    else:
        assert said.endswith(("at the surface", "above the layer"))
        z = 1e-6 if said.endswith("surface") else 2e-3
        assert loading(effect, form, z) == pytest.approx(K * z, rel=1e-3)
    if form.name != "crust":
        assert abs(loading(effect, form, deep) / (K * deep) - 1) > 0.02


def test_what_k_is_has_the_words_of_each_form():
    power = {"equation": "K * z * (z / D)^hardening_power", "stiffness": "F / z at z = D"}
    layer = {"equation": "K * z * (1 + layer_factor * inside)", "stiffness": "above the layer"}
    sinks = {"equation": "f(z_m) - K * (1 + unload_stiffness) * (z_m - z)"}
    said = stiffness_words({"equations": [power, layer, sinks], "typical_depth_m": 0.0075})
    assert said.startswith("F / z") and "D = 7.5" in said and said.endswith("above the layer")
    assert stiffness_words({"equations": [sinks]}) == ""
