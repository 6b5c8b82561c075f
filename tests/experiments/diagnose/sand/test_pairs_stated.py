"""Pairs of effects that are begun at the stated numbers, where the base model has bent its own."""

from types import SimpleNamespace

import pytest
from rigid_trials import effect
from tumble_campaigns import SIGMA, campaign

from experiments.diagnose.core import search
from experiments.diagnose.core.pairs import FormsStart
from experiments.diagnose.core.search import Search
from experiments.diagnose.fit.fitting import Model, Whitener
from experiments.diagnose.tumble.problem import make_problem

SAND = {"mass": 5.3, "inertia": 0.06, "stiffness": 300.0, "damping": 4.0, "mu_s": 0.5, "mu_d": 0.25}
STATED, BENT = {"mass": 5.3}, {"mass": 5.36}


class Contacts:
    """Of all pairs the last one follows the beginnings best, and moves the mass."""

    def race(self, models, values, *, most):
        assert [model.forms for model in models] == [("stated", k) for k in range(len(models))]
        assert all(one == STATED for one in values)
        return [(len(models) - 1, {"mass": 5.31})][:most]


@pytest.mark.parametrize("strained", [True, False])
def test_pairs_begin_at_the_stated_numbers_too_only_where_the_base_model_has_bent_its_own(monkeypatch, strained):
    def starts(model, values, forms, *, most, every_form=False):
        place = {5.3: "stated", 5.36: "bent"}[values["mass"]]
        assert every_form is (place == "stated")
        return [FormsStart((place, k), values) for k in range(most)]

    monkeypatch.setattr(search, "is_strained", lambda fit: strained)
    monkeypatch.setattr(search, "pair_starts", starts)
    model = SimpleNamespace(
        problem=SimpleNamespace(contacts=Contacts(), forms=()), parameters=(SimpleNamespace(name="mass", value=5.3),),
        with_forms=lambda forms: SimpleNamespace(forms=forms),
    )  # fmt: skip
    found = object.__new__(Search)
    found.base = SimpleNamespace(fit=SimpleNamespace(model=model, values=BENT))
    found.tell = lambda what, done: None
    found._begun = lambda model, starts: list(starts)
    before = [FormsStart(("bent", k), BENT) for k in range(search._PAIRS)]
    likeliest = FormsStart(("stated", search._PAIRS_STATED - 1), {"mass": 5.31})
    assert found._pairs() == [*before, *[likeliest][: int(strained)]]


@pytest.mark.long
def test_of_several_pairs_the_hidden_one_follows_the_beginnings_best():
    hidden = (effect("ploughing", strength=1e4, speed=0.01), effect("slip-sinkage", share=0.6, way=0.012))
    conditions = ({"torque": 0.3, "gravity_sim": 0.147}, {"torque": 0.26, "gravity_sim": 0.0834})
    problem = make_problem(campaign(effects=hidden, seed=3, conditions=conditions, nominal=SAND, sigma=SIGMA))
    base = Model(problem, Whitener.white(problem), tuple(trial.id for trial in problem.trials))
    first = {form.effect: form for form in reversed(problem.forms)}
    pairs = [("rig-friction", "adhesion"), ("slope", "torque-fade"), ("ploughing", "slip-sinkage"),
             ("plastic-sinkage", "bearing-drag"), ("rig-friction", "com-offset")]  # fmt: skip
    models = [base.with_forms([first[name] for name in pair]) for pair in pairs]
    stated = {p.name: p.value for p in base.parameters}
    starts = [{**stated, **one.forms[0].starts[0], **one.forms[1].starts[0]} for one in models]
    raced = problem.contacts.race(models, starts, most=2)
    assert len(raced) == 2 and pairs[raced[0][0]] == ("ploughing", "slip-sinkage")
    values = raced[0][1]
    assert {p.name for p in models[2].parameters} <= set(values)
    left = [float((modes**2).mean()) for modes in models[2].evaluate([starts[2], values])]
    assert left[1] < 0.5 * left[0]
