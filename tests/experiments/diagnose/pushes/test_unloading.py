"""Beds that differ in strength, and return along the same line: what an engineer's own ten pushes showed."""

import numpy as np
import pytest
from penetration_campaigns import DAMPING, FORCE_STD, STIFFNESS, campaign_of, driven_trial

from experiments.campaign import Recording
from experiments.diagnose.core.diagnosis import diagnose
from experiments.diagnose.fit.fitting import Model, Whitener, fit
from experiments.diagnose.noise.replicates import find_scatter
from experiments.diagnose.push.problem import make_problem

WAY_BACK = 1800.0  # N/m, of every bed


def pushed(strength):
    """K z + C v, times the strength of the bed, and back along a line of one slope."""

    def force(z, v, top):
        if v > 0:
            return strength * (STIFFNESS * z + DAMPING * v)
        return max(0.0, strength * STIFFNESS * top - WAY_BACK * (top - z))

    return force


@pytest.mark.parametrize("differ", [0.0, 0.03])
def test_beds_that_differ_going_in_and_not_coming_back_are_told_as_both(differ):
    beds = 1 + differ * np.array([-1.2, 0.2, 1.0, 0.9, -0.1, -0.8])
    trials = [
        (f"{k}", "driven", speed, driven_trial(pushed(bed), speed=speed, retreat=True, seed=40 + k))
        for k, (bed, speed) in enumerate(zip(beds, (0.01, 0.01, 0.01, 0.02, 0.02, 0.02), strict=True))
    ]
    problem = make_problem(campaign_of(trials))
    form = next(one for one in problem.forms if one.name == "stiffer unloading")
    ids = tuple(trial.id for trial in problem.trials)
    found = fit(Model(problem, Whitener.white(problem), ids, forms=(form,)), {form.amplitude: 1.0})
    problem.rewhiten(found.values, (form,))
    found = fit(found.model, found.values)
    expected = {"bed": pytest.approx(0.03, rel=0.5), "bed unloading": pytest.approx(0.03, rel=0.5)}
    assert find_scatter(found, apart=True).model_std == (expected if differ else {})


def test_the_mean_of_beds_moved_into_k_and_c_changes_no_force():
    trials = [(f"{k}", "driven", 0.01, driven_trial(pushed(1.0), speed=0.01, retreat=True, seed=k)) for k in range(3)]
    problem = make_problem(campaign_of(trials))
    form = next(one for one in problem.forms if one.name == "stiffer unloading")
    own = {f"{kind}[{k}]": value for kind, values in (("bed", (0.1, 0.2, 0.15)), ("bed damping", (-0.3, 0.1, 0.0)),
           ("bed unloading", (0.2, -0.1, 0.3))) for k, value in enumerate(values)}  # fmt: skip
    values = {"stiffness": 800.0, "damping": 5.0, form.amplitude: 1.5, **own}
    moved = problem.centred(values, (form,))
    assert moved["stiffness"] == pytest.approx(800 * 1.15) and moved["damping"] != 5.0
    assert sum(moved[f"bed[{k}]"] for k in range(3)) == pytest.approx(0.0, abs=1e-12)
    for trial in ("0", "1", "2"):
        before, after = (problem.compare(one, (form,), trial)["force"]["model"] for one in (values, moved))
        assert after == pytest.approx(before, rel=1e-12, abs=1e-12)


def test_pushes_that_do_not_come_back_have_no_way_back_of_their_own():
    one = driven_trial(pushed(1.0), speed=0.01)
    assert "bed unloading" not in make_problem(campaign_of([("0", "driven", 0.01, one)])).scatter


@pytest.mark.long
@pytest.mark.parametrize("seed", [20261128, 20261129])
def test_three_replicates_show_beds_and_the_peak_of_a_deeper_push_is_right(seed):
    """F = s (1400 z (1 + 0.8 z / 20 mm) + 20 v), back along 12,000 N/m; s differs by 3 % between the ten beds."""
    random = np.random.default_rng(seed)
    plan = [(10, 14), (5, 8), (20, 18), (10, 14), (5, 16), (20, 12), (10, 14), (5, 18), (20, 10), (10, 18)]
    trials = []
    for place, (speed, depth) in enumerate(plan):
        v, deepest, bed = 1e-3 * speed, 1e-3 * depth, random.normal(1, 0.03)
        time = np.arange(round(2 * deepest / v * 200) + 1) / 200
        z = np.maximum(deepest - np.abs(deepest - v * time), 0.0)
        curve = 1400 * z * (1 + 0.8 * z / 0.02)
        most = bed * (1400 * deepest * (1 + 0.8 * deepest / 0.02) + 20 * v)
        force = np.where(time <= deepest / v, bed * (curve + 20 * v), np.maximum(0.0, most - 12_000 * (deepest - z)))
        rows = {"t_s": time, "depth_m": z + random.normal(0, 2e-5, len(z))}
        rows["force_N"] = force + random.normal(0, FORCE_STD, len(z))
        trials.append((f"push{place:02d}", "driven", v, Recording(rows)))
    campaign = campaign_of(trials, stiffness=2000.0, doubt=(1.0, 1.0), diameter=0.02, depth_std=2e-5)
    found = diagnose(make_problem(campaign))
    assert set(found.effects) == {"plastic-sinkage", "depth-hardening"}
    assert set(found.model_std) >= {"bed", "bed unloading"}  # of the second draw "bed damping", too, which is not there
    # The force of the mean bed at 18 mm: within 3 times 3 % / sqrt(7).
    mean_bed = {name: value for name, value in found.best_values.items() if "[" not in name}
    law = found.problem.compare(mean_bed, found.forms, "push02")["force"]["model"]
    assert law.max() == pytest.approx(1400 * 0.018 * (1 + 0.8 * 0.9) + 20 * 0.02, rel=0.035)
