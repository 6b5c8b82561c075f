"""Two effects at once: pairs that no single effect leads to, and when the second one matters."""

from types import SimpleNamespace

import pytest
from golden import golden
from penetration_campaigns import DAMPING, STIFFNESS, campaign_of, driven_trial

from experiments.diagnose.core import matters
from experiments.diagnose.core.deciding import Gap
from experiments.diagnose.core.outcome import Diagnosis
from experiments.diagnose.core.search import Search
from experiments.diagnose.fit.evidence import excess
from experiments.diagnose.fit.fitting import Model, Whitener, fit
from experiments.diagnose.push.problem import make_problem
from experiments.diagnose.report.document import COUNTS
from experiments.diagnose.report.sentences import sure_sentences


def layer_and_crater(z, v, top):
    """From 10 mm on the bed is half as stiff again; it unloads along a line a tenth steeper than it loaded last."""

    def spring(depth):
        return STIFFNESS * (depth + 0.5 * max(depth - 0.01, 0.0))

    force = spring(z) if z >= top else max(spring(top) - 1.65 * STIFFNESS * (top - z), 0.0)
    return force + DAMPING * max(v, 0.0)


@pytest.mark.long
def test_a_pair_is_found_although_neither_effect_leads_to_it_alone():
    """Of all pairs it leaves least by far; a crater alone takes nothing away."""
    trials = [(f"{k}", "driven", v, driven_trial(layer_and_crater, speed=v, retreat=True, seed=k))
              for k, v in enumerate((0.01, 0.03, 0.1))]  # fmt: skip
    problem = make_problem(campaign_of(trials))
    base = fit(Model(problem, Whitener.white(problem), tuple(trial.id for trial in problem.trials)))
    problem.rewhiten(base.values, ())
    search = Search(fit(base.model, base.values), tell=lambda what, done: None)
    found = min(search._in_all_forms(), key=lambda one: one.fit.objective)
    assert set(found.effects) == {"layering", "plastic-sinkage"}
    assert found.fit.chi_square < 1.1 * found.fit.count
    assert excess(search.base.fit) > 30 * abs(excess(found.fit))
    again = Search(search.base.fit, tell=lambda what, done: None, known_pairs=search.pairs)
    assert min(one.fit.objective for one in again._in_all_forms()) == pytest.approx(found.fit.objective, abs=0.1)


@pytest.mark.parametrize(("alone", "both", "rival", "calls"), [
    (Gap(1.8, 2.7), Gap(1.1, 1.15), -70.0, True),
    (Gap(1.8, 2.7), Gap(1.1, 1.15), -60.0, False),  # 6 nats behind: another second name does as well
    (Gap(1.1, 1.15), Gap(1.0, 1.0), -70.0, False),  # one alone leaves nothing that matters
    (Gap(1.8, 2.7), Gap(1.1, 1.6), -70.0, False),  # both leave too much
])  # fmt: skip
def test_a_second_name_stands_where_what_it_explains_matters_and_it_leads(monkeypatch, alone, both, rival, calls):
    """More than 1.2 a sample without it, at most 1.2 with it, and 10 nats before all others."""
    gaps = {"alone": alone, "both": both}
    monkeypatch.setattr(matters, "left_by", lambda found, held_out, scatter: gaps[found])
    first = SimpleNamespace(effects=("bearing-drag",), fit="alone", score=-78.0)
    best = SimpleNamespace(effects=("bearing-drag", "tip-radius"), fit="both", score=-54.0)
    other = SimpleNamespace(effects=("bearing-drag", "com-offset"), fit="other", score=rival)
    choice = SimpleNamespace(best=best, table=(first, best, other))
    assert matters._calls_for_both(choice, first, ("004",), {}) is calls


def test_the_nearest_answer_to_a_pair_has_another_name_in_it_and_is_no_longer_set():
    def one(score, *effects):
        return SimpleNamespace(effects=effects, score=score)

    own = ("plastic-sinkage", "depth-hardening")
    near = one(34.0, "layering", "plastic-sinkage")
    table = (one(54.0, *own), one(53.0, *own, "adhesion"), one(50.0, "plastic-sinkage"), near, one(18.0, "adhesion"))
    found = SimpleNamespace(effects=own, verdict="named", choice=SimpleNamespace(table=table, rivals=()))
    assert Diagnosis.nearest_answer.func(found) is near
    assert Diagnosis.ordered(found, near) == ("plastic-sinkage", "layering")
    one_name = SimpleNamespace(effects=own[:1], verdict="named", choice=found.choice)
    assert Diagnosis.nearest_answer.func(one_name) is None


def test_a_pair_is_said_with_the_count_of_pairs_and_the_nearest_whole_answer():
    gap = {"held_out": 1.1}
    said = {
        "verdict": "named", "effects": [{"id": "plastic-sinkage"}, {"id": "depth-hardening"}], "equivalence": [],
        "evidence": [{"effects": ["plastic-sinkage", "depth-hardening"], "score": 54.0}], "sizes": [],
        "gap": {"before": {"held_out": 1200.0}, "after": gap},
        "nearest_each": [
            {"effect": "plastic-sinkage", "instead": ["depth-hardening", "shaft-friction"], "evidence_behind": 49.1,
             "left_out_behind": None, "needed": 10.0},
            {"effect": "depth-hardening", "instead": ["plastic-sinkage", "layering"], "evidence_behind": 4.3,
             "left_out_behind": 5.8, "needed": 4.0},
        ],
        "counted": {"of": "pushes", **COUNTS["pushes"], "pairs": COUNTS["pairs"]["pushes"]},
    }  # fmt: skip
    golden("diagnose/sure_of_a_pair", sure_sentences(said)[2:])
