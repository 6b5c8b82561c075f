"""The nearest other answers of a diagnosis: one for each effect that is named, by evidence and by prediction, and the
same effects in other forms."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from experiments.diagnose.fit.evidence import Hypothesis
from experiments.diagnose.fit.fitting import fit, settled
from experiments.diagnose.fit.problem import Form

from .deciding import smallest, values_of_all
from .outcome import Diagnosis
from .rivals import CLOSE, LEAD, folds_of, predict

__all__ = ["Near", "likelier", "near_models", "nearest_each", "other_forms"]

_MOST_FORMS = 4  # models of the same effects in other forms: the likeliest of these show how far forms differ


@dataclass(frozen=True)
class Near:
    """The likeliest answer that has another effect in the place of a named one."""

    effect: str  # the named one
    hypothesis: Hypothesis
    behind: float  # evidence [nats]
    behind_left_out: float | None  # in predicting conditions left out [nats]; None where that was not compared
    needed: float
    """Nats by which the rule for verdicts wants the named effect ahead: the first in either, a further one in
    evidence."""


def nearest_each(found: Diagnosis) -> tuple[Near, ...]:
    """Of each named effect the nearest other answer; none of other verdicts, and where no such answer was fitted.

    Predictions are compared where evidence leaves less than `LEAD`: refits, in the weights of the last fit.
    """
    choice = found.choice
    if choice is None or found.verdict != "named":
        return ()
    first, *further = found.effects
    nearest = []
    if choice.rivals:
        rival = min(choice.rivals, key=lambda rival: rival.lead)
        nearest.append(Near(first, rival.hypothesis, rival.behind, rival.behind_left_out, LEAD))
    own, mine = set(found.effects), None
    for effect in further:
        rest = own - {effect}
        others = [h for h in choice.table if rest < set(h.effects) and effect not in h.effects]
        if not others:
            continue
        other = max(others, key=lambda h: h.score)
        behind, left_out = choice.best.score - other.score, None
        folds = folds_of(found.best.model.infos) if behind < LEAD else []
        if folds:
            mine = mine or predict(found.best, folds)
            theirs = predict(other.fit, folds)
            left_out = None if mine is None or theirs is None else mine.score - theirs.score
        nearest.append(Near(effect, other, behind, left_out, CLOSE))
    return tuple(nearest)


def near_models(found: Diagnosis, nearest: Sequence[Near]) -> list[Diagnosis]:
    """Other answers in the place of the best, each as the diagnosis with that fit.

    With other effects: of an ambiguous one those that trials cannot distinguish. Of a named one the `nearest` that are
    less than `LEAD` behind, by evidence and by prediction. What has more evidence and is not named (`likelier`). With
    the same effects: other forms (`other_forms`).
    """
    if found.choice is None:
        return []
    close = [near.hypothesis for near in nearest if max(near.behind, near.behind_left_out or 0.0) < LEAD]
    close += smallest(found.choice) if found.verdict == "ambiguous" else ()
    close += likelier(found)
    models = []
    for one in (*close, *other_forms(found)):
        again = settled(fit(one.fit.model, one.fit.values))  # in the weights of the best model's last fit
        effects, values = found.ordered(one), values_of_all(again, found.held_out)
        models.append(replace(found, best=again, best_values=values, effects=effects))
    return models


def likelier(found: Diagnosis) -> list[Hypothesis]:
    """The likeliest candidate with other effects than the named ones, where it has more evidence than these: the rule
    for a further name refuses it, the trials do not."""
    choice = found.choice
    if choice is None or found.verdict != "named":
        return []
    named = set(choice.best.effects)
    others = [one for one in choice.table if set(one.effects) != named and one.score > choice.best.score]
    return sorted(others, key=lambda one: -one.score)[:1]


def other_forms(found: Diagnosis) -> list[Hypothesis]:
    """The likeliest fits of the named effects in other forms, less than `LEAD` behind by evidence, the likeliest first.
    One of each set of forms, and none that is the best model with one more form: that one predicts much the same."""
    choice = found.choice
    if choice is None or found.verdict not in ("named", "ambiguous"):
        return []
    likeliest: dict[frozenset[str], Hypothesis] = {}
    for one in sorted(choice.table, key=lambda one: -one.score):
        near = one.score > choice.best.score - LEAD and set(one.effects) == set(choice.best.effects)
        if near and not (forms := _ids(one.forms)) >= _ids(found.forms):
            likeliest.setdefault(forms, one)
    return list(likeliest.values())[:_MOST_FORMS]


def _ids(forms: Sequence[Form]) -> frozenset[str]:
    """Which forms these are, in any order."""
    return frozenset(form.id for form in forms)
