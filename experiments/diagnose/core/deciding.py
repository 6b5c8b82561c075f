"""What a diagnosis decides on: the gap, when an effect is named, when it is certain beside something unknown."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from experiments.diagnose.fit.bounds import bends_little_away, bounds_met, is_strained
from experiments.diagnose.fit.evidence import SMALL, Hypothesis, excess, held_out_fit, inflation, score
from experiments.diagnose.fit.fitting import Fit, fit, settled
from experiments.diagnose.fit.gate import Verdict, held_out_gate
from experiments.diagnose.fit.problem import Finding, Values
from experiments.diagnose.noise.diverging import divergence_finding, diverging_held_out, most_diverging

from .rivals import folds_of, predict
from .search import Choice

__all__ = [
    "Gap", "bends_to_anything", "certain", "closes", "diverging_beside", "explains_nothing", "gap_of",
    "held_out_divergences", "is_misfit_of_form", "missed", "one_number", "shares_left", "smallest", "unscattered",
    "values_of_all", "verdict_of", "well_known",
]  # fmt: skip

_AS_LIKELY = 1.0  # nats within which a third effect is named as well
_AS_NOISY, _RIGHT_FORM = 2.0, 0.02
"""Chi-square per sample up to which a misfit of form is as small as the sensors' noise; and the share of what the base
model leaves that it may be."""
_NEXT_TO_NOTHING = 0.01
"""The same share, of trials fitted and of trials held out, where the misfit is larger: a form that is off by a tenth of
its effect. In synthetic campaigns of penetration two dozen right effects left 0.011 at most of the fitted trials; of
things outside the library effects left 0.08 and more, but for one shock, which a crust explained on those it was fitted
to. Of trials held out twice that: few as they are, one that is sensitive (a slow drop) leaves more by itself."""
_NO_EFFECT = 0.5
"""Share of the base model's residual, of trials fitted or held out. An effect that leaves more explains too little to
be named where the gate fails. In five counts of tumbles right effects left 0.47 at most of these."""
_SURE = 3.0  # standard deviations of chi-square beyond which what an effect leaves is not chance
_LATE = 0.5  # share of a held-out trial's time up to which a model that explains all fitted ones must follow it
_CERTAIN = 0.1
"""Share of what the base model leaves, fitted, predicted and held out, that an effect may leave that is certain beside
something unknown."""
_MANY = 3
"""Effects that together bend to nearly anything, a trial set aside counted as one: each of so many must have one
amplitude in the cross-validation."""
_ONE_NUMBER = 0.1  # relative uncertainty of that amplitude: a real effect is the same in all conditions
_ASKED = 3  # hypotheses beside which trials may diverge
_MOST_EFFECTS = 2  # of such a hypothesis: with more, and a trial set aside, nearly anything could be explained
_SEEN_ELSEWHERE = 3.0  # nats by which an effect must improve the other trials, where one trial diverges


@dataclass(frozen=True)
class Gap:
    """Chi-square per valid sample, as docs/diagnose.md has it."""

    fit: float
    held_out: float | None


def gap_of(found: Fit, held_out: tuple[str, ...], values: Values | None = None) -> Gap:
    """The gap of a model, on its trials and those held out. `values`: None for `values_of_all`."""
    everywhere = values_of_all(found, held_out) if values is None else values

    def per_sample(trials: tuple[str, ...]) -> float:
        pairs = [found.model.problem.chi_square(everywhere, found.model.forms, trial) for trial in trials]
        return sum(total for total, _ in pairs) / max(1, sum(count for _, count in pairs))

    return Gap(per_sample(found.model.trials), per_sample(held_out) if held_out else None)


def unscattered(found: Fit) -> dict[str, float]:
    """Its values without those of scatter."""
    scatter = {parameter.name for parameter in found.model.scatter}
    return {name: value for name, value in found.values.items() if name not in scatter}


def values_of_all(found: Fit, held_out: tuple[str, ...]) -> dict[str, float]:
    """One set of numbers for all trials: the shared ones as fitted, the held-out trials' own nuisances refitted. It
    is the gap of one mean bed: where scatter was fitted, the fitted trials' own nuisances are refitted without it."""
    model, values = replace(found.model, scatter=()), unscattered(found)
    if found.model.scatter:
        values = held_out_fit(model, model.trials, values)
    return held_out_fit(model, held_out, values)


def verdict_of(
    choice: Choice, held: Verdict | None, held_out: tuple[str, ...], seed: int, *, set_aside: bool = False
) -> str:
    """``named``, ``ambiguous`` or else ``unknown``. The first two need a best model that leaves nothing on the trials
    fitted and held out, or too little, or a misfit of form. It must also need no number that the campaign all but
    excludes."""
    found = choice.best.fit
    if not choice.best.effects or is_strained(found) or bends_little_away(found, choice.base.fit):
        return "unknown"
    if bends_to_anything(choice, set_aside=set_aside):
        return "unknown"
    after = gap_of(found, held_out)
    fits, predicts = choice.left.passed, held is None or held.passed
    if not fits and _too_little(choice, after.fit):
        return "unknown"
    little = after.fit <= SMALL and (after.held_out or 0.0) <= SMALL
    little = little and (predicts or _share_left(choice, held_out) < _NO_EFFECT)
    passed = (fits and predicts) or little or is_misfit_of_form(choice, held_out)
    if not passed and (fits or after.fit <= SMALL):  # or what is held out follows for a while only
        values = held_out_fit(found.model, held_out, found.values)
        ask = partial(diverging_held_out, found, held_out, values, seed=seed, enough=SMALL)
        passed = ask(most_diverging(len(held_out))) is not None
        # Where nothing at all is left of the trials that were fitted, all held out but one may diverge, and late.
        passed = passed or (fits and ask(len(held_out) - 1, share=_LATE) is not None)
    return ("ambiguous" if choice.alternatives else "named") if passed else "unknown"


def bends_to_anything(choice: Choice, *, set_aside: bool) -> bool:
    """Whether there are so many effects that each must have one amplitude, and one has not."""
    many = len(choice.best.effects) + set_aside >= _MANY
    return many and (choice.predicted is None or not one_number(choice))


def explains_nothing(choice: Choice, held_out: tuple[str, ...]) -> bool:
    """Whether an effect improves neither the fitted nor the held-out trials, where the base model leaves no more than
    chance, all by the stated noise. Then it is no effect, but one of the many narrow valleys that the likelihood of
    long tumbles has. Coloured noise makes them deep."""
    before, after = gap_of(choice.base.fit, held_out), gap_of(choice.best.fit, held_out)
    if before.fit - 1 > _SURE * math.sqrt(2 / choice.base.fit.count) or (before.held_out or 0.0) > SMALL:
        return False
    return after.fit >= before.fit and (after.held_out or 0.0) >= (before.held_out or 0.0)


def is_misfit_of_form(choice: Choice, held_out: tuple[str, ...]) -> bool:
    """Whether so little is left that it is the form's misfit: nature's form is never quite the library's."""
    found = choice.best.fit
    left, share = [found.chi_square / found.count], shares_left(choice, held_out)
    if held_out:
        left.append(_left_of(found, held_out))
    next_to_nothing = all(one < most * _NEXT_TO_NOTHING for one, most in zip(share, (1, 2), strict=False))
    return (max(left) <= _AS_NOISY and share[0] < _RIGHT_FORM) or next_to_nothing


def shares_left(choice: Choice, held_out: tuple[str, ...]) -> list[float]:
    """What the best leaves beyond noise over what the base model leaves [1]: of fitted trials, and of held-out ones."""
    fitted = excess(choice.best.fit) / max(excess(choice.base.fit), 1e-9)
    return [fitted, _share_left(choice, held_out)] if held_out else [fitted]


def _too_little(choice: Choice, after: float) -> bool:
    """Whether an effect explains too little of what was fitted. `after`: what it leaves a sample, in the gap's units:
    a colour of the noise found beside an effect that is none is what that effect has missed."""
    found, base = choice.best.fit, choice.base.fit
    if excess(found) > _NO_EFFECT * excess(base):
        return True
    before = gap_of(base, ()).fit
    return after - 1 > max(_SURE * math.sqrt(2 / found.count), base.model.problem.left_by_forms * (before - 1))


def _share_left(choice: Choice, held_out: tuple[str, ...]) -> float:
    """What the best leaves beyond noise of trials held out, over what the base model leaves."""
    after, before = (_left_of(one, held_out) for one in (choice.best.fit, choice.base.fit))
    return (after - 1) / max(before - 1, 1e-9)


def _left_of(found: Fit, trials: tuple[str, ...]) -> float:
    """Chi-square per sample of trials that took no part, their own nuisances refitted."""
    (modes,) = found.model.on(trials).evaluate([held_out_fit(found.model, trials, found.values)])
    return float(modes @ modes) / len(modes)


def certain(base: Fit, choice: Choice) -> bool:
    """Whether the effects found are certain although something else is there too. They must remove most of the base
    model's residual, in the fit and in cross-validation. No number may be one that the campaign excludes, no scale at
    the end of the library's range: such an effect may only imitate something else."""
    best, amplitudes = choice.best.fit, {form.amplitude for form in choice.best.forms}
    ends = any(not met.strains and met.parameter not in amplitudes for met in bounds_met(best))
    if ends or is_strained(best) or bends_little_away(best, base) or excess(best) >= _CERTAIN * excess(base):
        return False
    if choice.predicted is None or not one_number(choice) or not well_known(best):
        return False
    predicted = predict(base, folds_of(base.model.infos))
    if predicted is None:
        return False
    return choice.predicted.chi_square - choice.predicted.count < _CERTAIN * (predicted.chi_square - predicted.count)


def one_number(choice: Choice) -> bool:
    """Whether each effect's amplitude stays the same whichever condition is left out (jackknife)."""
    assert choice.predicted is not None
    for form in choice.best.forms:
        values = np.array([learned[form.amplitude] for learned in choice.predicted.learned])
        error = math.sqrt((len(values) - 1) * float(values.var()))
        if error > _ONE_NUMBER * abs(choice.best.fit.values[form.amplitude]):
            return False
    return True


def well_known(found: Fit) -> bool:
    """Whether the fit itself, its misfit counted as noise, knows each effect's amplitude as well as that: a form whose
    other numbers can replace its amplitude (a pendulum far off its centre is a steady push) names nothing."""
    names = [p.name for p in found.model.parameters]
    variance = np.diag(found.covariance(inflation=inflation(found)))
    return all(
        math.sqrt(max(float(variance[names.index(form.amplitude)]), 0.0))
        <= _ONE_NUMBER * abs(found.values[form.amplitude])
        for form in found.model.forms
    )


def closes(base: Fit, best: Fit, held_out: tuple[str, ...]) -> bool:
    """Whether nearly all of the base model's residual of held-out trials is removed. The rest must not exceed the noise
    of the sensors and the scatter of replicates; true where none are held out."""
    if not held_out:
        return True
    before, after = (_left_of(found, held_out) for found in (base, best))
    return after <= _AS_NOISY and after - 1 < _CERTAIN * max(before - 1, 0.0)


def smallest(choice: Choice) -> tuple[Hypothesis, ...]:
    """The alternatives that are reported: the likeliest, and a second one about as likely as the first effect."""
    first, *others = choice.alternatives
    return (first, *(h for h in others[:1] if h.score > choice.best.score - _AS_LIKELY))


def missed(found: Fit, held_out: tuple[str, ...], seed: int) -> tuple[str, ...]:
    """Trials held out that a model does not explain, although it explains all that were fitted."""
    if not held_out:
        return ()
    found = settled(found)
    values = held_out_fit(found.model, held_out, found.values)
    if diverging_held_out(found, held_out, values, most_diverging(len(held_out)), seed=seed) is not None:
        return ()
    if (gap_of(found, held_out).held_out or 0.0) <= SMALL:
        return ()
    return tuple(t for t in held_out if not held_out_gate(found, (t,), values, seed=seed).passed) or held_out


def held_out_divergences(found: Fit, held_out: tuple[str, ...], seed: int) -> list[Finding]:
    """Findings of trials held out that diverge from the model; they stay in the gap."""
    if not held_out:
        return []
    found = settled(found)
    values = held_out_fit(found.model, held_out, found.values)
    gone = diverging_held_out(found, held_out, values, len(held_out), seed=seed, enough=SMALL) or ()
    return [own for trial in gone if (own := divergence_finding(found, trial, values, set_aside=False)) is not None]


def diverging_beside(
    base: Fit, choice: Choice, verdict: str, ask: Callable[[Fit], tuple[Finding, ...]]
) -> tuple[Finding, ...]:
    """Trials that diverge, where the base model explains all others and an effect only these. Also those that diverge
    where an effect explains all others and nothing is named so far. `ask`: the diverging trials of a fit."""
    gone = ask(base)
    if verdict == "unknown":
        for other in () if gone else _likeliest(choice):
            gone = gone or ask(other.fit)
    elif gone:
        rest = tuple(t for t in base.model.trials if t not in {finding.trial for finding in gone})
        plain = score(fit(base.model.on(rest)))
        if score(fit(choice.best.fit.model.on(rest), choice.best.fit.values)) > plain + _SEEN_ELSEWHERE:
            return ()
    return gone


def _likeliest(choice: Choice) -> list[Hypothesis]:
    """The best, where that has two effects at most, and the likeliest single ones."""
    found = {choice.best.effects: choice.best} if 0 < len(choice.best.effects) <= _MOST_EFFECTS else {}
    for tried in sorted(choice.table, key=lambda one: -one.score):
        if len(tried.effects) == 1 and len(found) < _ASKED:
            found.setdefault(tried.effects, tried)
    return list(found.values())
