"""What a campaign can tell apart: signatures, conditions left out, two effects at once, nulls that are kept."""

import math
from dataclasses import replace

import numpy as np
import pytest
from penetration_campaigns import DAMPING, STIFFNESS, campaign_of, driven_trial, on_firm_ground

from experiments.diagnose.core.diagnosis import diagnose
from experiments.diagnose.core.matters import undecided
from experiments.diagnose.core.rivals import CLOSE, compare, folds_of, marked, predict
from experiments.diagnose.core.search import Choice, Search
from experiments.diagnose.fit import gate
from experiments.diagnose.fit.evidence import Hypothesis, excess, score, slow_count, tempered
from experiments.diagnose.fit.fitting import Linear, Model, Whitener, fit
from experiments.diagnose.fit.gate import open_gate
from experiments.diagnose.fit.trials import TrialInfo
from experiments.diagnose.push.problem import make_problem
from experiments.diagnose.report.document import document


def constant(z, v, top=0.0):
    return STIFFNESS * z + DAMPING * max(v, 0.0) + 1.0


def fitted(speeds):
    """The base model, constant friction and drag by the square of the speed, fitted to a constant force of 1 N."""
    trials = [(f"{k}", "driven", v, driven_trial(constant, speed=v, seed=k)) for k, v in enumerate(speeds)]
    problem = on_firm_ground(make_problem(campaign_of(trials, doubt=(0.1, 0.05))))
    base = fit(Model(problem, Whitener.white(problem), tuple(t.id for t in problem.trials)))
    problem.rewhiten(base.values, ())
    base = fit(base.model, base.values)
    found = []
    for name in ("shaft-friction:constant", "inertial-drag:square"):
        form = next(form for form in problem.forms if form.id == name)
        best = fit(base.model.with_forms([form]), {**base.values, **form.starts[0]})
        found.append(Hypothesis(best, score(best)))
    return base, *found


def test_at_one_speed_friction_and_drag_have_one_signature_and_at_two_they_have_not():
    # f sign(v) and b v^2 are the same number at one speed; at speeds a factor of ten apart b v^2 changes a hundredfold.
    base, friction, drag = fitted((0.05, 0.05))
    same = compare("inertial-drag", friction, drag, base)
    assert same.angle < 5 and same.expected < CLOSE and same.alike
    base, friction, drag = fitted((0.01, 0.1))
    apart = compare("inertial-drag", friction, drag, base)
    assert apart.angle > 30 and not apart.alike
    # Two predictions d noises apart: the worse one's chi-square is expected d^2 higher, by chance 2 d more or less.
    lost = drag.fit.objective - friction.fit.objective
    assert abs(lost - apart.distance**2) < 0.2 * apart.distance**2 + 6 * apart.distance


def test_what_holds_at_other_speeds_too_predicts_a_speed_left_out():
    _, friction, drag = fitted((0.01, 0.03, 0.1))
    right, wrong = (predict(h.fit, [("0",), ("1",), ("2",)]) for h in (friction, drag))
    assert right.count == wrong.count == friction.fit.count
    assert abs(right.per_sample - 1) < 6 * math.sqrt(2 / right.count)
    assert wrong.per_sample > 2 and right.score > wrong.score + 10


def test_a_prediction_counts_the_errors_of_what_was_learned_as_noise():
    # r is normal with covariance I + J S J^T, S the covariance of what the other trials determine.
    _, friction, _ = fitted((0.01, 0.03, 0.1))
    model, fold = friction.fit.model, ("2",)
    learned = fit(model.on(("0", "1")), friction.fit.values, rounds=4)
    there = Linear.of(model.on(fold), {**friction.fit.values, **learned.values})
    names = [p.name for p in learned.model.parameters]
    slopes = there.jacobian[:, [[p.name for p in there.parameters].index(name) for name in names]]
    spread = np.eye(len(there.modes)) + slopes @ np.linalg.inv(learned.hessian()) @ slopes.T
    found = predict(friction.fit, [fold])
    assert found.chi_square == pytest.approx(there.modes @ np.linalg.solve(spread, there.modes), rel=2e-3)
    assert found.chi_square < there.modes @ there.modes
    wide = 0.5 * np.linalg.slogdet(spread)[1]
    assert wide > 0.1
    assert found.score == pytest.approx(
        tempered(found.chi_square - found.count, slow_count(friction.fit)) - wide, abs=0.05
    )


@pytest.mark.long
def test_the_further_push_that_separates_two_effects_is_made_at_another_speed():
    # f sign(v) and b v^2 are one number f at v_0 = 0.05 m/s. At v they differ by f ((v / v_0)^2 - 1) = 8 N on the way
    # in. C is stated to 5 %, and C v_0 + f is known: an error c of C changes the predictions by c (v - v_0) and
    # c v (1 - v / v_0). All rows of a push have these errors in common, so they bound what it tells.
    base, friction, drag = fitted((0.05, 0.05))
    plan = base.model.problem.planned(friction.fit, drag.fit)
    assert plan.settings["speed_m_s"] == pytest.approx(0.15, rel=0.02)
    errors = 0.05 * DAMPING * np.hypot(0.15 - 0.05, 0.15 * (1 - 0.15 / 0.05))
    assert plan.nats == pytest.approx(0.5 * (8.0 / errors) ** 2, rel=0.2)
    assert base.model.problem.planned(friction.fit, friction.fit).nats == 0.0


def test_a_name_that_does_not_lead_by_ten_nats_is_one_of_several():
    base, friction, drag = fitted((0.01, 0.1))
    choice = Choice(Hypothesis.of(base), friction, (), (), open_gate(base)[1])
    rival = compare("inertial-drag", friction, drag, base)
    for behind, left_out, sure in ((6.0, None, False), (6.0, 9.0, False), (12.0, None, True), (6.0, 11.0, True)):
        near = replace(choice, rivals=(replace(rival, behind=behind, behind_left_out=left_out),))
        assert (undecided(near) == ()) == sure


@pytest.mark.parametrize(("depth", "width", "same"), [(0.2, 0.1, True), (0.2, 0.08, False), (0.8, 0.1, False)])
def test_a_layer_that_begins_at_the_surface_is_hardening_however_far_it_leads(depth, width, same):
    """A tenth of the change at the surface or more: edges nearer than ln 9 widths, in units of D."""
    problem = make_problem(campaign_of([("0", "driven", 0.03, driven_trial(constant, speed=0.03, seed=1))]))
    base = fit(Model(problem, Whitener.white(problem), ("0",)))
    layer, bent = (next(form for form in problem.forms if form.id == name)
                   for name in ("layering:slope", "depth-hardening:cubic"))  # fmt: skip
    one, other = fit(base.model.with_forms([layer]), base.values), fit(base.model.with_forms([bent]), base.values)
    edge = {"layering.layer_depth": math.log(depth), "layering.layer_width": math.log(width)}
    best = Hypothesis(replace(one, values={**one.values, **edge}), score(one))
    rival = replace(compare("depth-hardening", Hypothesis(one, score(one)), Hypothesis.of(other), base), behind=30.0)
    little, much = replace(other, chi_square=1.1 * other.count), replace(other, chi_square=1.3 * other.count)
    for left, is_one_of_several in ((little, same), (much, False)):
        near = marked([replace(rival, hypothesis=replace(rival.hypothesis, fit=left))], best)
        choice = Choice(Hypothesis.of(base), best, (), (), open_gate(base)[1], near)
        assert bool(undecided(choice)) == is_one_of_several


def test_each_condition_is_left_out_once_and_replicates_together():
    trials = [TrialInfo(id=str(k), condition=(k % 6,)) for k in range(12)]
    folds = folds_of(trials)
    assert len(folds) == 4 and sorted(id for fold in folds for id in fold) == sorted(t.id for t in trials)
    for k in range(6):
        assert sum(str(k) in fold and str(k + 6) in fold for fold in folds) == 1
    assert folds_of(trials[:1]) == []


@pytest.mark.long
def test_two_effects_at_once_are_both_named_and_the_report_says_what_they_were_weighed_against():
    def both(z, v, top):
        left = 0.3 * top
        spring = STIFFNESS * z if z >= top else STIFFNESS * top * (max(z - left, 0.0) / (top - left)) ** 1.4
        return spring + DAMPING * max(v, 0.0) + math.copysign(0.6 + 60.0 * z, v)

    trials = [(f"{k}", "driven", v, driven_trial(both, speed=v, retreat=True, seed=k))
              for k, v in enumerate((0.01, 0.03, 0.1) * 2)]  # fmt: skip
    found = diagnose(make_problem(campaign_of(trials)))
    assert found.verdict in ("named", "ambiguous") and set(found.effects) == {"plastic-sinkage", "shaft-friction"}
    rows = document(found)["equivalence"]
    assert rows[0]["effect"] == found.effects[0] and rows[0]["left_out"] < 2
    assert all(row["told_apart"] and row["what_would_tell"] for row in rows[1:])


def test_a_null_of_full_refits_is_made_once_for_a_design(tmp_path, monkeypatch):
    base, *_ = fitted((0.05, 0.05))
    columns = np.zeros((base.count, 0))
    first, said = open_gate(base, signatures=columns, refit=True, draws=6, folder=tmp_path)
    assert len(list(tmp_path.glob("*.json"))) == 1

    def never(*_):
        raise AssertionError("made anew")

    monkeypatch.setattr(gate, "_refitted", never)
    again, heard = open_gate(base, signatures=columns, refit=True, draws=6, folder=tmp_path)
    assert again.threshold == first.threshold and heard.score == pytest.approx(said.score)
    with pytest.raises(AssertionError, match="anew"):  # another model is another null
        open_gate(base, signatures=columns, refit=True, draws=7, folder=tmp_path)


def test_a_form_begins_where_another_of_its_effect_that_shares_its_scales_has_ended():
    """A pull that grows with the root of the depth: from the plain pull's reach and size the growing one is reached."""

    def held(z, v, top):
        back = (top - z) / 1e-3
        return STIFFNESS * z + DAMPING * max(v, 0.0) - 12.0 * math.sqrt(top / 0.02) * math.tanh(back)

    trials = [
        (f"{k}", "driven", 0.01, driven_trial(held, speed=0.01, depth=depth, retreat=True, seed=k))
        for k, depth in enumerate((0.006, 0.012, 0.02))
    ]
    problem = make_problem(campaign_of(trials))
    first = fit(Model(problem, Whitener.white(problem), ("0", "1", "2")))
    forms = {form.id: form for form in problem.forms}
    plain = forms["adhesion:held"]
    found = fit(first.model.with_forms([plain]), {**first.values, **plain.starts[0]})
    best = Search(first, tell=lambda what, done: None)._from_its_like(Hypothesis(found, score(found)))
    assert best.forms == (forms["adhesion:held by depth"],)
    assert excess(best.fit) < 0.1 * excess(found)
    assert best.fit.values["adhesion.pull_growth"] == pytest.approx(0.5, abs=0.1)


def test_effects_are_compared_where_one_kept_beside_them_has_another_form():
    """The hardening's number is one of its form only, and counts in neither signature."""
    base, friction, drag = fitted((0.01, 0.1))
    forms = {form.id: form for form in base.model.problem.forms}
    power, cubic = forms["depth-hardening:power"], forms["depth-hardening:cubic"]

    def beside(own, kept):
        found = fit(base.model.with_forms([*own, kept]), {**base.values, **kept.starts[0]}, rounds=2)
        return Hypothesis(found, score(found))

    one, other, rest = beside(friction.forms, power), beside(drag.forms, cubic), beside((), power).fit
    rival = compare("inertial-drag", one, other, rest)
    assert math.isfinite(rival.angle) and rival.distance > 0
