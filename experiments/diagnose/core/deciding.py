"""What a diagnosis decides on: the gap, when a name stands, when it is certain beside something else."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from experiments.diagnose.fit.bounds import bends_little_away, bounds_met, is_strained
from experiments.diagnose.fit.evidence import SMALL, Hypothesis, excess, held_out_fit, inflation
from experiments.diagnose.fit.fitting import Fit, Model
from experiments.diagnose.fit.gate import Verdict
from experiments.diagnose.fit.problem import Problem
from experiments.diagnose.noise.astray import allowed, astray_held_out

from .prediction import folds_of, predict
from .search import Choice

__all__ = [
    "Gap", "certain", "closes", "explains_nothing", "gap_of", "one_number", "smallest", "unscattered", "values_of_all",
    "verdict_of", "well_known",
]  # fmt: skip

_AS_LIKELY = 1.0  # nats within which a third name is said as well
_AS_LOUD, _RIGHT_FORM = 2.0, 0.02
"""Chi-square per sample up to which a misfit of form is no louder than the sensors; and the share of what the base
model leaves that it may be."""
_NEXT_TO_NOTHING = 0.01
"""The same share, of trials fitted and of trials held out, where it is louder: a form that is off by a tenth of its
effect. In made-up campaigns of penetration two dozen right names left 0.011 at most of the fitted trials; of things
outside the library names left 0.08 and more, but for one shock, which a crust explained on those it was fitted to.
Of trials held out twice that: few as they are, one that is sensitive (a slow drop) leaves more by itself."""
_NO_NAME = 0.5
"""Share of what the base model leaves, of trials fitted or held out, from which on a name explains too little to be
one, where the gate sees that something is left. In five counts of tumbles right names left 0.47 at most of these."""
_LOUD = 3.0  # standard deviations of chi-square beyond which what a name leaves is no matter of chance
_LATE = 0.5  # share of a held-out trial's time up to which a model that explains all fitted ones must follow it
_CERTAIN = 0.1
"""Share of what the base model leaves, fitted, predicted and held out, that may be left by a name that is certain
beside something that has no name."""
_MANY = 3
"""Names that together bend to nearly anything, a trial that was set aside counted as one: each of so many must have one
amplitude wherever it is looked at."""
_ONE_NUMBER = 0.1
"""And by how much of itself its amplitude may be uncertain when conditions are left out: what is there is the same in
all of them, what stands for something else is not."""


@dataclass(frozen=True)
class Gap:
    """Chi-square per valid sample, as docs/diagnose.md has it."""

    fit: float
    held_out: float | None


def gap_of(
    problem: Problem, model: Model, values: Mapping[str, float], fitted: tuple[str, ...], held_out: tuple[str, ...]
) -> Gap:
    """Of one set of numbers, trials that were fitted and trials that were not."""

    def per_sample(trials: tuple[str, ...]) -> float:
        pairs = [problem.chi_square(values, model.forms, trial) for trial in trials]
        return sum(total for total, _ in pairs) / max(1, sum(count for _, count in pairs))

    return Gap(per_sample(fitted), per_sample(held_out) if held_out else None)


def unscattered(found: Fit) -> dict[str, float]:
    """Its values without those of scatter."""
    scatter = {parameter.name for parameter in found.model.scatter}
    return {name: value for name, value in found.values.items() if name not in scatter}


def values_of_all(found: Fit, held_out: tuple[str, ...]) -> dict[str, float]:
    """One set of numbers for all trials: what is shared as it was fitted, the held-out trials' own nuisances refitted.

    The gap is that of one mean bed, how replicates differ is the gate's affair: where that was fitted, the fitted
    trials' own nuisances are refitted without it.
    """
    model, values = replace(found.model, scatter=()), unscattered(found)
    if found.model.scatter:
        values = held_out_fit(model, model.trials, values)
    return held_out_fit(model, held_out, values)


def verdict_of(
    choice: Choice, held: Verdict | None, held_out: tuple[str, ...], seed: int, *, set_aside: bool = False
) -> str:
    """A name stands where its model leaves nothing, on the trials that were fitted and on those that were not, or too
    little to speak of, or what a form that is not nature's leaves; and where it needs no number that the campaign all
    but excludes. Else something is unknown."""
    found = choice.best.fit
    if not choice.best.effects or is_strained(found) or bends_little_away(found, choice.base.fit):
        return "unknown"
    if len(choice.best.effects) + set_aside >= _MANY and (choice.predicted is None or not one_number(choice)):
        return "unknown"
    after = gap_of(found.model.problem, found.model, values_of_all(found, held_out), found.model.trials, held_out)
    fits, predicts = choice.left.passed, held is None or held.passed
    if not fits and _too_little(choice, after.fit, held_out):
        return "unknown"
    little = after.fit <= SMALL and (after.held_out or 0.0) <= SMALL
    little = little and (predicts or _share_left(choice, held_out) < _NO_NAME)
    passed = (fits and predicts) or little or _of_form(choice, held_out)
    if not passed and (fits or after.fit <= SMALL):  # or what is held out follows for a while only
        values = held_out_fit(found.model, held_out, found.values)
        ask = partial(astray_held_out, found, held_out, values, seed=seed, enough=SMALL)
        passed = ask(allowed(len(held_out))) is not None
        # Where nothing at all is left of the trials that were fitted, all held out but one may part, and late.
        passed = passed or (fits and ask(len(held_out) - 1, share=_LATE) is not None)
    return ("ambiguous" if choice.alternatives else "named") if passed else "unknown"


def explains_nothing(choice: Choice, held_out: tuple[str, ...]) -> bool:
    """Whether a name takes nothing away, of the trials that were fitted or of those held out, where the base model
    leaves no more than chance, all by the noise as stated: then it has found another of the many narrow valleys that a
    likelihood of long tumbles has, which the noise's colour makes out to be deep, and no effect."""
    base, best = choice.base.fit, choice.best.fit
    problem, trials = base.model.problem, base.model.trials
    before, after = (gap_of(problem, f.model, values_of_all(f, held_out), trials, held_out) for f in (base, best))
    if before.fit - 1 > _LOUD * math.sqrt(2 / base.count) or (before.held_out or 0.0) > SMALL:
        return False
    return after.fit >= before.fit and (after.held_out or 0.0) >= (before.held_out or 0.0)


def _of_form(choice: Choice, held_out: tuple[str, ...]) -> bool:
    """Whether what is left is so little that it is the form's misfit: nature's form is never quite the library's."""
    found, base = choice.best.fit, choice.base.fit
    left, share = [found.chi_square / found.count], [excess(found) / max(excess(base), 1e-9)]
    if held_out:
        left.append(_left_of(found, held_out))
        share.append(_share_left(choice, held_out))
    next_to_nothing = all(one < most * _NEXT_TO_NOTHING for one, most in zip(share, (1, 2), strict=False))
    return (max(left) <= _AS_LOUD and share[0] < _RIGHT_FORM) or next_to_nothing


def _too_little(choice: Choice, after: float, held_out: tuple[str, ...]) -> bool:
    """Whether a name explains too little of what was fitted to be one. `after`: what it leaves a sample, in the gap's
    units: a colour of the noise found beside a name that is none is what the name has missed."""
    found, base = choice.best.fit, choice.base.fit
    if excess(found) > _NO_NAME * excess(base):
        return True
    problem, trials = base.model.problem, base.model.trials
    before = gap_of(problem, base.model, values_of_all(base, held_out), trials, ()).fit
    return after - 1 > max(_LOUD * math.sqrt(2 / found.count), problem.left_by_forms * (before - 1))


def _share_left(choice: Choice, held_out: tuple[str, ...]) -> float:
    """What the best leaves beyond noise of trials held out, over what the base model leaves."""
    after, before = (_left_of(one, held_out) for one in (choice.best.fit, choice.base.fit))
    return (after - 1) / max(before - 1, 1e-9)


def _left_of(found: Fit, trials: tuple[str, ...]) -> float:
    """Chi-square per sample of trials that took no part, their own nuisances refitted."""
    (modes,) = found.model.on(trials).evaluate([held_out_fit(found.model, trials, found.values)])
    return float(modes @ modes) / len(modes)


def certain(base: Fit, choice: Choice) -> bool:
    """Whether what was found is there for certain although something else is too: it takes most of what the base model
    leaves away, of what was fitted and of conditions left out in turn, without a number that the campaign excludes or
    a scale that ends where the library does: with one, it may be no more than what bends nearest to something else."""
    amplitudes = {form.amplitude for form in choice.best.forms}
    ends = any(not met.strains and met.parameter not in amplitudes for met in bounds_met(choice.best.fit))
    if ends or is_strained(choice.best.fit) or bends_little_away(choice.best.fit, base):
        return False
    if excess(choice.best.fit) >= _CERTAIN * excess(base):
        return False
    if choice.predicted is None or not one_number(choice) or not well_known(choice.best.fit):
        return False
    trials = [trial for trial in base.model.problem.trials if trial.id in base.model.trials]
    predicted = predict(base, folds_of(trials))
    if predicted is None:
        return False
    return choice.predicted.chi_square - choice.predicted.count < _CERTAIN * (predicted.chi_square - predicted.count)


def one_number(choice: Choice) -> bool:
    """Whether each effect's amplitude stays the same whichever condition is left out (jackknife)."""
    assert choice.predicted is not None
    folds = choice.predicted.learned
    for form in choice.best.forms:
        values = np.array([learned[form.amplitude] for learned in folds])
        error = math.sqrt((len(values) - 1) * float(values.var()))
        if error > _ONE_NUMBER * abs(choice.best.fit.values[form.amplitude]):
            return False
    return True


def well_known(found: Fit) -> bool:
    """Whether the fit itself, its misfit counted as noise, knows each effect's amplitude as well as that: a form whose
    other numbers can stand in for its amplitude (a pendulum far off its centre is a steady push) names nothing."""
    names = [p.name for p in found.model.parameters]
    variance = np.diag(found.covariance(inflation=inflation(found)))
    return all(
        math.sqrt(max(float(variance[names.index(form.amplitude)]), 0.0))
        <= _ONE_NUMBER * abs(found.values[form.amplitude])
        for form in found.model.forms
    )


def closes(base: Fit, best: Fit, held_out: tuple[str, ...]) -> bool:
    """Whether next to all that the base model leaves of trials held out is taken away, too, and what is left is no
    louder than the sensors and what replicates differ by; true where there are none."""
    if not held_out:
        return True
    before, after = (_left_of(found, held_out) for found in (base, best))
    return after <= _AS_LOUD and after - 1 < _CERTAIN * max(before - 1, 0.0)


def smallest(choice: Choice) -> tuple[Hypothesis, ...]:
    """The alternatives that are said: the likeliest, and a second one where it is about as likely as the first name."""
    first, *others = choice.alternatives
    return (first, *(h for h in others[:1] if h.score > choice.best.score - _AS_LIKELY))
