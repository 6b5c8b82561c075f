"""Trials that go ways of their own, as a diagnosis asks for them: beside the base model, a name, or held out."""

from collections.abc import Callable
from functools import partial

from experiments.diagnose.fit.evidence import SMALL, Hypothesis, held_out_fit, score
from experiments.diagnose.fit.fitting import Fit, fit, settled
from experiments.diagnose.fit.gate import held_out_gate
from experiments.diagnose.fit.problem import Finding
from experiments.diagnose.noise.astray import allowed, astray, astray_finding, astray_held_out

from .deciding import gap_of, values_of_all
from .search import Choice

__all__ = ["all_astray", "held_out_ways", "missed", "own_ways"]

_ASKED = 3  # hypotheses that are asked whether a trial of its own way is all that speaks against them
_NAMES = 2  # names beside which a trial may go its own way: more and a trial set aside would explain nearly anything
_SEEN_ELSEWHERE = 3.0
"""Nats by which a name must be better than none on the other trials, where one trial goes its own way."""


def missed(found: Fit, held_out: tuple[str, ...], seed: int) -> tuple[str, ...]:
    """Trials held out that a model does not explain, although it does all that were fitted."""
    if not held_out:
        return ()
    found = settled(found)
    values = held_out_fit(found.model, held_out, found.values)
    if astray_held_out(found, held_out, values, allowed(len(held_out)), seed=seed) is not None:
        return ()
    after = gap_of(found.model.problem, found.model, values_of_all(found, held_out), found.model.trials, held_out)
    if (after.held_out or 0.0) <= SMALL:
        return ()
    return tuple(t for t in held_out if not held_out_gate(found, (t,), values, seed=seed).passed) or held_out


def held_out_ways(found: Fit, held_out: tuple[str, ...], seed: int) -> list[Finding]:
    """Trials held out that go ways of their own: they stay in the gap, and it is said."""
    if not held_out:
        return []
    found = settled(found)
    values = held_out_fit(found.model, held_out, found.values)
    gone = astray_held_out(found, held_out, values, len(held_out), seed=seed, enough=SMALL) or ()
    return [own for trial in gone if (own := astray_finding(found, trial, values, set_aside=False)) is not None]


def own_ways(
    base: Fit, choice: Choice, verdict: str, *, held_out: tuple[str, ...], seed: int, recoloured: Callable[[Fit], Fit]
) -> tuple[Finding, ...]:
    """Trials that go ways of their own, where the base model explains all others and a name nothing but them, or where
    a name explains all others and nothing has a name as it is."""
    ask = partial(astray, held_out=held_out, seed=seed, recoloured=recoloured)
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


def all_astray(
    base: Fit, best: Fit, *, held_out: tuple[str, ...], seed: int, recoloured: Callable[[Fit], Fit]
) -> tuple[Finding, ...]:
    """Trials whose ways of their own are all that speaks against the base model, or else against the best name."""
    ask = partial(astray, held_out=held_out, seed=seed, recoloured=recoloured)
    return ask(base) or (ask(best) if best.model.forms else ())


def _likeliest(choice: Choice) -> list[Hypothesis]:
    """The best, where that is no more than two names, and the likeliest single ones."""
    found = {choice.best.effects: choice.best} if 0 < len(choice.best.effects) <= _NAMES else {}
    for _, tried in sorted(choice.table, key=lambda row: -row[1].score):
        if len(tried.effects) == 1 and len(found) < _ASKED:
            found.setdefault(tried.effects, tried)
    return list(found.values())
