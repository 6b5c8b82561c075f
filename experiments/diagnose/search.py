"""Which effects a campaign calls for: candidates added one by one and in pairs, refitted, weighed, taken back."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from .evidence import Hypothesis, best_start, excess, score
from .fitting import Fit, Model, fit
from .gate import Verdict, open_gate
from .problem import Form

__all__ = ["Choice", "Search", "choose"]

_WORTH = 3.0
"""Nats by which an effect must raise the tempered evidence."""
_WORTH_MORE = 8.0
"""The same for a second name: a misfit of form is always there to be explained."""
_SHARE = 0.5
"""Of the excess that is left, how much a further name must take away."""
_SHARE_OF_BASE = 0.04
"""And of what the base model left: a misfit of the first effect's form is often some hundredths of it."""
_CLOSE = 4.0
"""Nats within which two names cannot be told apart."""
_MOST = 3
_BEST = 5

Tell = Callable[[str, float], None]


@dataclass(frozen=True)
class Choice:
    """What was found."""

    base: Hypothesis
    best: Hypothesis
    alternatives: tuple[Hypothesis, ...]
    """In whose place the first effect could stand, the likeliest first."""
    table: tuple[tuple[str, Hypothesis], ...]
    """Every candidate of the first round and what was tried after it: what was added, and the fit."""
    left: Verdict
    """The gate on the best."""


class Search:
    """One search over one set of trials."""

    def __init__(self, base: Fit, *, tell: Tell, seed: int = 0) -> None:
        self.base = Hypothesis(base, score(base))
        self.tell = tell
        self.seed = seed
        self.table: list[tuple[str, Hypothesis]] = []
        self._alone: dict[str, Hypothesis] = {}

    def choose(self) -> Choice:
        """Forward, in pairs, backward."""
        first = self._singles()
        first = [self._enriched(h) for h in first[:3]] + first[3:]
        first.sort(key=lambda h: -h.score)
        best = first[0] if first and first[0].score > self.base.score + _WORTH else self.base
        if best is not self.base and not self._gate(best).passed:
            best = self._further(best, first)
        best = self._backward(best)
        left = self._gate(best)
        return Choice(self.base, best, self._alternatives(best, first), tuple(self.table), left)

    # Steps ------------------------------------------------------------------------------------------------------------

    def _gate(self, hypothesis: Hypothesis) -> Verdict:
        return open_gate(hypothesis.fit, seed=self.seed)[1]

    def _try(self, what: str, start: Hypothesis, forms: Sequence[Form]) -> Hypothesis:
        """`start` with `forms` added, all refitted."""
        model: Model = start.fit.model.with_forms((*start.forms, *forms))
        alone = self._alone.get(forms[0].id)
        if alone is None:
            found = best_start(model, forms[0], start.fit.values)
        else:  # where it stood alone is a good place to begin from beside others, and a small amplitude is another
            amplitude = forms[0].amplitude
            values = {**{p.name: alone.fit.values[p.name] for p in forms[0].parameters}, **start.fit.values}
            small = {**values, amplitude: 0.3 * values[amplitude]}
            first = [fit(model, values, rounds=4), fit(model, small, rounds=4)]
            best = min(first, key=lambda f: f.objective)
            found = fit(model, best.values)
        if not start.forms:
            self._alone[forms[0].id] = Hypothesis(found, 0.0)
        made = Hypothesis(found, score(found))
        self.table.append((what, made))
        return made

    def _singles(self) -> list[Hypothesis]:
        """The best form of each effect, the likeliest effect first."""
        forms = self.base.fit.model.problem.forms
        best: dict[str, Hypothesis] = {}
        for k, form in enumerate(forms):
            self.tell(f"trying {form.effect} ({form.name})", k / max(1, len(forms)))
            made = self._try(form.id, self.base, [form])
            if form.effect not in best or made.score > best[form.effect].score:
                best[form.effect] = made
        return sorted(best.values(), key=lambda h: -h.score)

    def _enriched(self, hypothesis: Hypothesis) -> Hypothesis:
        """With a second form of one of its effects, where that helps: nature's form is between the library's."""
        best = hypothesis
        for _ in range(2):
            start = best
            if excess(start.fit) < 0.5 * np.sqrt(2.0 * start.fit.count):
                break
            taken = {p.name for form in start.forms for p in form.parameters}
            for form in start.fit.model.problem.forms:
                if form.effect not in start.effects or any(p.name in taken for p in form.parameters):
                    continue
                made = self._try(f"{_said(start)} + {form.id}", start, [form])
                if made.score > best.score + 1.0:
                    best = made
            if best is start:
                break
        return best

    def _further(self, best: Hypothesis, first: Sequence[Hypothesis]) -> Hypothesis:
        """A second and third name, while each takes away enough of what is left."""
        while len(best.effects) < _MOST:
            self.tell(f"beside {', '.join(best.effects)}: something is left", 0.5)
            tried = []
            seen: set[str] = set()
            for other in first[:_BEST] if len(best.effects) == 1 else first:
                name = other.effects[0]
                if name in best.effects or name in seen:
                    continue
                seen.add(name)
                for form in self._best_forms(name)[:2]:
                    tried.append(self._try(f"{_said(best)} + {form.id}", best, [form]))
            if len(best.effects) == 1:
                tried += self._pairs(first, best)
            tried.sort(key=lambda h: -h.score)
            if not tried:
                return best
            new = self._enriched(tried[0])
            gained = excess(best.fit) - excess(new.fit)
            least = max(_SHARE * max(excess(best.fit), 0.0), _SHARE_OF_BASE * excess(self.base.fit))
            if new.score < best.score + _WORTH_MORE or gained < least:
                return best
            best = new
            if self._gate(best).passed:
                return best
        return best

    def _pairs(self, first: Sequence[Hypothesis], best: Hypothesis) -> list[Hypothesis]:
        """Pairs of the best five that leave the best one out."""
        made = []
        for one, other in itertools.combinations(first[:_BEST], 2):
            names = {one.effects[0], other.effects[0]}
            if best.effects[0] in names:
                continue
            forms = self._best_forms(other.effects[0])[:1]
            made.append(self._try(f"{_said(one)} + {forms[0].id}", one, forms))
        return made

    def _best_forms(self, effect: str) -> list[Form]:
        """Forms of an effect, in the order of how well they did alone."""
        alone = [h for what, h in self.table if len(h.forms) == 1 and h.effects == (effect,)]
        return [h.forms[0] for h in sorted(alone, key=lambda h: -h.score)]

    def _backward(self, best: Hypothesis) -> Hypothesis:
        """Without what is no longer needed."""
        while len(best.forms) > 1:
            shorter = []
            for form in best.forms:
                rest = tuple(f for f in best.forms if f is not form)
                found = fit(best.fit.model.with_forms(rest), best.fit.values)
                shorter.append(Hypothesis(found, score(found)))
            kept = max(shorter, key=lambda h: h.score)
            needed = _WORTH if len(kept.effects) < len(best.effects) else 0.5
            if kept.score < best.score - needed:
                break
            best = kept
        return _ordered(best)

    def _alternatives(self, best: Hypothesis, first: Sequence[Hypothesis]) -> tuple[Hypothesis, ...]:
        """Other names that explain the campaign about as well in place of the first effect."""
        if not best.effects:
            return ()
        found: dict[str, Hypothesis] = {}
        if len(best.effects) == 1:
            for other in first:
                name = other.effects[0]
                if name not in best.effects and other.score > best.score - _CLOSE:
                    found.setdefault(name, other)
        else:
            rest = tuple(f for f in best.forms if f.effect != best.effects[0])
            start = Hypothesis(best.fit, best.score)
            for other in first[:_BEST]:
                name = other.effects[0]
                if name in best.effects:
                    continue
                model = start.fit.model.with_forms((*other.forms, *rest))
                made = fit(model, {**best.fit.values, **other.fit.values})
                rival = Hypothesis(made, score(made))
                self.table.append((_said(rival), rival))
                if rival.score > best.score - _CLOSE:
                    found.setdefault(name, rival)
        return tuple(sorted(found.values(), key=lambda h: -h.score))


def choose(base: Fit, *, tell: Tell, seed: int = 0) -> Choice:
    """Search from the base model's fit."""
    return Search(base, tell=tell, seed=seed).choose()


def _said(hypothesis: Hypothesis) -> str:
    return " + ".join(form.id for form in hypothesis.forms)


def _ordered(best: Hypothesis) -> Hypothesis:
    """The effect whose loss would cost most stands first."""
    if len(best.effects) < 2:
        return best
    cost = {}
    for effect in best.effects:
        rest = tuple(form for form in best.forms if form.effect != effect)
        cost[effect] = fit(best.fit.model.with_forms(rest), best.fit.values, rounds=8).objective
    forms = tuple(sorted(best.forms, key=lambda form: -cost[form.effect]))
    found = fit(best.fit.model.with_forms(forms), best.fit.values, rounds=3)
    return Hypothesis(found, best.score)
