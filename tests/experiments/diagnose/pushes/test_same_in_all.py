"""A stiffness of unloading, or a layer, that no bed changes although K differs between beds may be of the machine."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from golden import golden
from penetration_campaigns import DAMPING, STIFFNESS, campaign_of, driven_trial

from experiments.diagnose.core.same_in_all import same_in_all_beds, scatter_bounds
from experiments.diagnose.fit.fitting import Model, Whitener, fit
from experiments.diagnose.push.problem import make_problem
from experiments.diagnose.report.machine import machine_sentences
from rigid.intervals import student

WAY_BACK, LAYER, SLOPE = 1800.0, 0.011, 720.0  # N/m, m, N/m
BEDS = np.array([-1.2, 0.2, 1.0, 0.9, -0.1, -0.8])
CHI_SQUARE_5 = {"low": 1.1455, "high": 11.0705}
"""Of 5 degrees of freedom, below and above which are 5 %."""


def pushed(bed, back, layer):
    """Of a bed: K z + C v, steeper from a depth on, times its strength; back along a line of a slope of its own."""

    def force(z, v, top):
        def curve(depth):
            return bed * (STIFFNESS * depth + SLOPE * max(depth - layer, 0.0))

        return curve(z) + bed * DAMPING * v if v > 0 else max(0.0, curve(top) - back * (top - z))

    return force


def diagnosed(*, differ, back, layer):
    """What a diagnosis would know of six pushes. `differ`: scatter of beds. `back`, `layer`: of the stiffness of
    unloading and of the depth of the layer, times the strengths of the beds in an order of their own."""
    trials = []
    for k, speed in enumerate((0.01, 0.01, 0.01, 0.02, 0.02, 0.02)):
        law = pushed(1 + differ * BEDS[k], WAY_BACK * (1 + back * BEDS[k]), LAYER * (1 + layer * BEDS[-1 - k]))
        trials.append((f"{k}", "driven", speed, driven_trial(law, speed=speed, retreat=True, seed=40 + k)))
    problem = make_problem(campaign_of(trials))
    forms = tuple(form for form in problem.forms if form.name in ("stiffer unloading", "slope"))
    (edge,) = [name for form in forms for name, slot in form.slots.items() if slot.name == "layer_depth"]
    ids = tuple(trial.id for trial in problem.trials)
    free = [replace(p, std=0.03) for kind in ("bed", "bed unloading") for p in problem.scatter[kind]]
    start = {form.amplitude: 0.9 for form in forms} | {edge: math.log(LAYER / problem.typical_depth)}
    found = fit(Model(problem, Whitener.white(problem), ids, forms=forms, scatter=tuple(free)), start)
    problem.rewhiten(found.values, forms)
    found = fit(found.model, found.values)
    return SimpleNamespace(problem=problem, best=found, best_values=found.values, forms=forms, fitted=ids, held_out=(),
                           effects=tuple(form.effect for form in forms), known_scatter={"freedom": 4})  # fmt: skip


def test_bounds_of_a_scatter_are_those_of_chi_square():
    """With equal errors s: scatter² = sum of squares / chi-square - s²."""
    values, error = 0.03 * BEDS, 0.01
    squares = float(np.sum((values - values.mean()) ** 2))
    low, high = scatter_bounds(values, np.full(6, error))
    assert low == pytest.approx(math.sqrt(squares / CHI_SQUARE_5["high"] - error**2), rel=1e-4)
    assert high == pytest.approx(math.sqrt(squares / CHI_SQUARE_5["low"] - error**2), rel=1e-4)


def test_errors_that_are_stated_too_large_exclude_no_scatter():
    """Equal values: 5 s² / (s² + scatter²) is 1.1455 at the upper bound."""
    low, high = scatter_bounds(np.zeros(6), np.full(6, 0.01))
    assert low == 0.0 and high == pytest.approx(0.01 * math.sqrt(5 / CHI_SQUARE_5["low"] - 1), rel=1e-4)


def test_a_way_back_and_a_layer_that_no_bed_changes_are_of_the_machine():
    found = diagnosed(differ=0.03, back=0.0, layer=0.0)
    rows = {row.what: row for row in same_in_all_beds(found)}
    assert set(rows) == {"unloading", "layer"}
    back, layer = rows["unloading"], rows["layer"]
    assert back.lowest < WAY_BACK < back.highest and layer.lowest < LAYER < layer.highest
    assert max(back.scatter_at_most, layer.scatter_at_most) < back.k_scatter == pytest.approx(0.03, rel=0.5)
    stiffness = found.best_values["stiffness"]
    bound = back.k_at_most
    assert bound["value"] == pytest.approx(1 / (1 / stiffness - 1 / WAY_BACK), rel=0.05)
    assert 0 < bound["std"] < 0.2 * bound["value"] and layer.k_at_most is None


def test_a_way_back_that_follows_k_and_a_layer_that_moves_are_of_the_ground():
    assert same_in_all_beds(diagnosed(differ=0.03, back=0.03, layer=0.05)) == []


def test_beds_that_are_alike_show_nothing_of_the_machine():
    assert same_in_all_beds(diagnosed(differ=0.0, back=0.0, layer=0.0)) == []


def test_the_doubt_states_the_evidence_the_bound_of_k_and_what_to_do():
    """±: Student's 4.3 of two degrees of freedom."""
    row = {"pushes": 10, "scatter_at_most": 0.0082, "k_scatter": 0.0201}
    bound = {"value": 1206.0, "std": 30.0 / student(2), "unit": "N/m", "freedom": 2.0}
    back = row | {"what": "unloading", "effect": "plastic-sinkage", "lowest": 10920.0, "highest": 11080.0,
                  "unit": "N/m", "k_at_most": bound}  # fmt: skip
    layer = row | {"what": "layer", "effect": "layering", "lowest": 0.01098, "highest": 0.01104, "unit": "m",
                   "k_at_most": None}  # fmt: skip
    golden("diagnose/same_in_all", machine_sentences({"same_in_all_beds": [back, layer]}))
    assert machine_sentences({}) == []
