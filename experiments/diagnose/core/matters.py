"""What matters decides, not what can be detected: no model is exact, and a small structural residue changes no verdict.

The rule is that of the format (docs/diagnose.md, "What matters"). A gap is chi-square per sample; 1 is noise alone.
Where replicates differ by more than the sensors, the scatter between them counts as noise.
"""

import math
from collections.abc import Mapping
from copy import copy
from dataclasses import replace

import numpy as np

from experiments.diagnose.fit.bounds import bounds_met, strained_parameters
from experiments.diagnose.fit.evidence import SMALL, Hypothesis
from experiments.diagnose.fit.fitting import Fit, fit

from .deciding import Gap, gap_of, values_of_all
from .rivals import LEAD, compare
from .scatter_gap import gap_with_scatter
from .search import Choice

__all__ = [
    "MOST", "explains", "fewest", "is_as_stated", "is_small", "left_by", "little_left", "takes_below", "undecided",
]  # fmt: skip

MOST = SMALL  # the gap up to which what is left is too small to matter
_CLOSED = 0.99
"""Share of the base model's residual beyond the noise, on fitted and held-out trials. A name must close it where more
than `MOST` remains beside it: 97.6 % of a magnet was closed by a pendulum."""
_ERRORS = 3.0
_COMPARED = 3  # other names that are compared with one that is taken alone
_WITHIN = 3.0  # standard deviations from what was stated within which a number is as stated

Scatter = Mapping[str, float]  # standard deviation between replicates, by kind
_Gaps = tuple[Gap, Gap | None]


def left_by(found: Fit, held_out: tuple[str, ...], scatter: Scatter) -> Gap:
    """The gap of a model, the scatter between replicates counted as noise."""
    plain, weighed = _gaps(found, held_out, scatter)
    return plain if weighed is None else weighed


def _gaps(found: Fit, held_out: tuple[str, ...], scatter: Scatter) -> _Gaps:
    """With the sensors' noise alone, and with the scatter where there is any."""
    values, model = values_of_all(found, held_out), found.model
    stages = [(values, model.forms)]
    weighed = gap_with_scatter(model.problem, scatter, stages, model.trials, held_out)
    return gap_of(found, held_out, values), None if weighed is None else Gap(*weighed.after)


def is_small(left: Gap, fitted: int, held_out: int) -> bool:
    """Whether what is left of held-out trials, and of all trials together, is too small to matter.

    `fitted`, `held_out`: how many trials of each there are."""
    if left.held_out is None:
        return left.fit <= MOST
    return max(left.held_out, (fitted * left.fit + held_out * left.held_out) / (fitted + held_out)) <= MOST


def takes_below(before: Gap, best: Fit, held_out: tuple[str, ...], scatter: Scatter) -> bool:
    """Whether the best model reduces the base model's gap of held-out trials, `before` (of all, where none are held
    out). The reduction must exceed the gap's own uncertainty: `_ERRORS` standard errors of a mean square of noise. A
    form with a number at the end of its range only imitates something small."""
    if any(not bound.strains for bound in bounds_met(best)):
        return False
    after, model = left_by(best, held_out, scatter), best.model
    count = sum(len(model.problem.samples(trial).time) for trial in held_out or model.trials)
    gained = before.fit - after.fit
    if before.held_out is not None and after.held_out is not None:
        gained = before.held_out - after.held_out
    return gained > _ERRORS * math.sqrt(2 / max(count, 1))


def explains(choice: Choice, held_out: tuple[str, ...], scatter: Scatter) -> bool:
    """Whether the best model's first name leads every rival by `LEAD`. Also the residual of held-out trials must be too
    small to matter, or nearly all closed. What is left is then reported as residue."""
    if not choice.best.effects or undecided(choice):
        return False
    after, weighed = _gaps(choice.best.fit, held_out, scatter)
    return little_left(gap_of(choice.base.fit, held_out), after, after if weighed is None else weighed) != ""


def little_left(before: Gap, after: Gap, small: Gap) -> str:
    """The rule of size that lets a name pass: `small_gap`, or `closed` where nearly all of `before` is; else empty.

    `small`: `after` with the scatter between replicates counted as noise."""
    if (small.fit if small.held_out is None else small.held_out) <= MOST:
        return "small_gap"
    pairs = ((before.fit, after.fit), (before.held_out, after.held_out))
    shares = [1 - (b - 1) / (a - 1) for a, b in pairs if a is not None and b is not None and a > 1]
    return "closed" if shares and min(shares) >= _CLOSED else ""


def undecided(choice: Choice) -> tuple[Hypothesis, ...]:
    """Rivals that the best model's first name does not lead by `LEAD`."""
    return tuple(rival.hypothesis for rival in choice.rivals if rival.lead < LEAD)


def _calls_for_both(choice: Choice, alone: Hypothesis, held_out: tuple[str, ...], scatter: Scatter) -> bool:
    """Whether two effects each matter although one `alone` closes nearly all: what the other explains is more than
    `MOST`, nothing that matters is left by both, and it leads all others in its place, and none, by `LEAD`."""
    best = choice.best
    if len(best.effects) != 2:
        return False
    others = [h.score for h in choice.table if set(h.effects) != set(best.effects) and len(h.effects) <= 2]
    if best.score - max([alone.score, *others]) < LEAD:
        return False
    singly, both = (left_by(one.fit, held_out, scatter) for one in (alone, best))
    seen = [(a, b) for a, b in ((singly.fit, both.fit), (singly.held_out, both.held_out)) if a is not None]
    return all(a > MOST and b is not None and b <= MOST for a, b in seen)


def fewest(choice: Choice, held_out: tuple[str, ...], scatter: Scatter) -> Choice:
    """The choice with one of its effects alone where that explains what matters; else the same."""
    best, base = choice.best, choice.base.fit
    for name in best.effects if len(best.effects) > 1 else ():
        singles: dict[str, Hypothesis] = {}
        for tried in sorted(choice.table, key=lambda h: h.score):
            if len(tried.effects) == 1:
                singles[tried.effects[0]] = tried
        if name not in singles:
            continue
        alone = singles.pop(name)
        forms = tuple(form for form in best.forms if form.effect == name)
        begun = ((forms, best.fit.values), (alone.forms, {**best.fit.values, **alone.fit.values}))
        fits = [fit(best.fit.model.with_forms(own), values) for own, values in begun]
        found = Hypothesis(min(fits, key=lambda one: one.objective), alone.score)
        near = sorted(singles.values(), key=lambda h: -h.score)[:_COMPARED]
        rivals = tuple(compare(h.effects[0], found, h, base) for h in near)
        shorter = replace(choice, best=found, rivals=rivals, alternatives=(), predicted=None)
        if explains(shorter, held_out, scatter) and not _calls_for_both(choice, found, held_out, scatter):
            return shorter
    return choice


def is_as_stated(base: Fit, scatter: Scatter) -> bool:
    """Whether the base model leaves no more than matters with its numbers as stated. Numbers that went far may absorb a
    structural difference: then it must leave no more of the fitted trials with these held to `_WITHIN`."""
    far = set(strained_parameters(base))
    if not far:
        return True
    problem = copy(base.model.problem)
    problem.base = tuple(
        replace(p, lowest=max(p.lowest, p.value - _WITHIN * p.std), highest=min(p.highest, p.value + _WITHIN * p.std))
        if p.name in far
        else p
        for p in problem.base
    )
    ends = {p.name: (p.lowest, p.highest) for p in problem.base if p.name in far}
    begun = {**base.values, **{name: float(np.clip(base.values[name], *end)) for name, end in ends.items()}}
    return left_by(fit(replace(base.model, problem=problem), begun), (), scatter).fit <= MOST
