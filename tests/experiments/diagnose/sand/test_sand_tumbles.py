"""Whole diagnoses of made-up tumbles on soft ground: each effect of sand is called by its name, a null has none."""

import pytest
from rigid_trials import effect
from tumble_campaigns import SIGMA, campaign

from experiments.diagnose.core.diagnosis import diagnose
from experiments.diagnose.tumble.problem import make_problem

SAND = {"mass": 5.3, "inertia": 0.06, "stiffness": 300.0, "damping": 4.0, "mu_s": 0.5, "mu_d": 0.25}
CONDITIONS = tuple({"torque": torque, "gravity_sim": g} for torque, g in ((0.22, 0.0834), (0.3, 0.147), (0.26, 0.0834),
                                                                         (0.22, 0.147), (0.3, 0.0834)))  # fmt: skip


def on_sand(*effects, seed, **ground):
    return campaign(effects=effects, seed=seed, conditions=CONDITIONS, nominal=SAND | ground, sigma=SIGMA, duration=1.0)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("id", "parameters"),
    [
        ("ploughing", {"strength": 2e4, "speed": 0.01}),
        ("slip-sinkage", {"share": 0.6, "way": 0.012}),
        ("plastic-sinkage", {"share": 0.5, "wall": 0.6}),
    ],
)
def test_an_effect_of_sand_is_named(id, parameters):
    found = diagnose(make_problem(on_sand(effect(id, **parameters), seed=3)))
    assert (found.verdict, found.effects) == ("named", (id,))
    assert found.before.held_out > 2
    assert found.after.held_out < 1.2


@pytest.mark.slow
def test_a_null_on_soft_ground_has_no_effect():
    assert diagnose(make_problem(on_sand(seed=4))).verdict == "none"


@pytest.mark.slow
def test_relaxation_is_named_where_the_sinkage_is_large():
    """What gives way goes with the depth: 5 mm at rest here. At 1.5 mm and half the share it is below the noise."""
    softer = {"stiffness": 82.0, "damping": 2.0}
    found = diagnose(make_problem(on_sand(effect("relaxation", share=0.06, soon=0.05), seed=3, **softer)))
    assert (found.verdict, found.effects) == ("named", ("relaxation",))
    assert found.after.held_out < 1.2
    assert found.parameters("relaxation")["share"]["value"] == pytest.approx(0.06, abs=0.007)
