"""Two effects at once: pairs that no single effect leads to, and when the second one matters."""

from types import SimpleNamespace

import pytest
from penetration_campaigns import DAMPING, STIFFNESS, campaign_of, driven_trial

from experiments.diagnose.core import matters
from experiments.diagnose.core.deciding import Gap
from experiments.diagnose.core.search import Search
from experiments.diagnose.fit.evidence import excess
from experiments.diagnose.fit.fitting import Model, Whitener, fit
from experiments.diagnose.push.problem import make_problem


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
