"""Which effects a campaign calls for: candidates added one by one and in pairs, refitted, weighed, taken back."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from experiments.diagnose.fit.bounds import is_strained
from experiments.diagnose.fit.evidence import SMALL, Hypothesis, excess
from experiments.diagnose.fit.fitting import Fit, fit
from experiments.diagnose.fit.gate import Verdict
from experiments.diagnose.fit.problem import Finding

from .candidate_fits import FOLLOWED, WORTH, CandidateFits, Tell, said
from .equivalence import CLOSE, Rival, compare
from .pairs import next_starts, pair_starts
from .prediction import Predicted, folds_of, predict

__all__ = ["Choice", "Search", "choose"]

_WORTH_MORE = 8.0  # the same for a second name: a misfit of form is always there to be explained
_SHARE = 0.5  # of the excess that is left, how much a further name must take away
_SHARE_OF_BASE = 0.04
"""And of what the base model left: a misfit of the first effect's form is often some hundredths of it."""
_SHARE_PLAIN, _SHARE_OF_FORM = 0.2, 0.01
"""Of what the base model leaves, how much a first name may leave for the second one to be looked for beside it, and
how much both may for no third one to be looked for."""
_WORTH_ALONE = 16.0
"""Nats from which a further name counts where there is but one condition, so that no prediction can be asked for."""
_WORTH_BOTH, _SHARE_BOTH = 5.0, 0.75
"""Nats, and share of what is left, from which a smaller second name counts too, if conditions left out say so."""
_LEADS = 2.0  # nats of evidence and prediction together by which another close name takes the lead
_UNEXPLAINED, _HOPELESS = 1.3, 0.1
"""Chi-square per sample, and share of what the base model leaves beyond noise, from which on both no name can stand."""
_SHOWN = 3  # rivals that are weighed
_MOST = 3
_BEST = 5
_PAIRS = 8  # pairs of effects that are looked at where no single name does, and how many of them are fitted in full


@dataclass(frozen=True)
class Choice:
    """What was found."""

    base: Hypothesis
    best: Hypothesis
    alternatives: tuple[Hypothesis, ...]  # in whose place the first effect could stand, the likeliest first
    table: tuple[tuple[str, Hypothesis], ...]
    """Every candidate of the first round and what was tried after it: what was added, and the fit."""
    left: Verdict  # the gate on the best
    rivals: tuple[Rival, ...] = ()  # the nearest other names, the likeliest first, and why they are alternatives or not
    predicted: Predicted | None = None  # what the best leaves of conditions left out
    astray: tuple[Finding, ...] = ()
    """Trials that go ways of their own, which is all that speaks against the best: then no further name was tried."""


class Search(CandidateFits):
    """One search over one set of trials."""

    def choose(self) -> Choice:
        """Forward, in pairs, backward."""
        first = self._singles()
        self._base_again(first)
        self._most = max([self._most, *(h.score for h in first)])
        first = [self._enriched(h) for h in first[:3]] + first[3:]
        first.sort(key=lambda h: -h.score)
        best = first[0] if first and first[0].score > self.base.score + WORTH else self.base
        told = self._gate(best)
        if not told.passed:
            if self._own_ways is not None and (gone := self._own_ways(self.base.fit, best.fit)):
                return Choice(self.base, best, (), tuple(self.table), told, astray=gone)
            best = self._further(best, first)
        whole, best = best, self._backward(best)
        if len(best.effects) == len(whole.effects) and len(best.forms) < len(whole.forms):
            best = self._backward(self._enriched(best))  # without the form that was in the way of others
        best, predicted, rivals = self._settle(best, first)
        if len(best.effects) == 2 and not any(rival.same for rival in rivals):
            best, predicted, rivals = self._second(best) or (best, predicted, rivals)
        left = self._gate(best)
        same = tuple(rival.hypothesis for rival in rivals if rival.same)
        return Choice(self.base, best, same, tuple(self.table), left, rivals, predicted)

    def _further(self, best: Hypothesis, first: Sequence[Hypothesis]) -> Hypothesis:
        """A second and third name, while each takes away enough of what is left."""
        while len(best.effects) < _MOST:
            self.tell(f"beside {', '.join(best.effects) or 'the base model'}: something is left", 0.5)
            tried = []
            seen: set[str] = set()
            beside = self._beside(best)
            if beside:  # what stands out beside the first name, whatever it is alone
                found = self._enriched(self._likeliest(best, beside))
                if self._worth(best, found) and (self._next_to_all(found) or self._gate(found).passed):
                    return found
                tried += [found, *beside]
            for other in first[:_BEST] if len(best.effects) == 1 and not beside else ():
                name = other.effects[0]
                if name in best.effects or name in seen:
                    continue
                seen.add(name)
                for form in self._best_forms(name)[:2]:
                    tried.append(self._try(f"{said(best)} + {form.id}", best, [form]))
            if len(best.effects) < 2:
                tried += self._pairs()
            else:  # a third: those that promise most beside the two
                model, values = best.fit.model, best.fit.values
                others = [form for form in model.problem.forms if form.effect not in best.effects]
                tried += self._begun(model, next_starts(model, values, others, most=_BEST))
            if not tried:
                return best
            new = self._enriched(self._likeliest(best, tried))
            if not self._worth(best, new):
                return best
            best = new
            if len(best.effects) == 2 and not self._gate(best).passed:
                best = self._enriched(self._swapped(best))
            if self._gate(best).passed:
                return best
        return best

    def _beside(self, best: Hypothesis) -> list[Hypothesis]:
        """Second names that promise most beside a plain first one, whose branches hid them while they were alone."""
        plain = excess(best.fit) < _SHARE_PLAIN * excess(self.base.fit)
        if len(best.effects) != 1 or not plain or best.fit.model.problem.contacts is None:
            return []
        model, values = best.fit.model, best.fit.values
        others = [form for form in model.problem.forms if form.effect not in best.effects]
        return self._begun(model, next_starts(model, values, others, most=_BEST))

    def _next_to_all(self, best: Hypothesis) -> bool:
        """Whether next to nothing of what the base model leaves is left, and no more than a misfit of form."""
        left = excess(best.fit)
        return left < _SHARE_OF_FORM * excess(self.base.fit) and best.fit.chi_square < SMALL * best.fit.count

    def _worth(self, best: Hypothesis, new: Hypothesis) -> bool:
        """Whether a further name is worth saying, with the noise as it was taken or as it shows beside the name."""
        if self._worth_in_noise(best, new):
            return True
        pair = self._in_its_noise(best, new)
        return pair is not None and self._worth_in_noise(*pair)

    def _worth_in_noise(self, best: Hypothesis, new: Hypothesis) -> bool:
        """Whether a further name takes most of what is left away, or frees the fit of a number that is excluded."""
        left = max(excess(best.fit), 0.0)
        gained, better = excess(best.fit) - excess(new.fit), new.score - best.score
        relieved = is_strained(best.fit) and not is_strained(new.fit)
        if better >= _WORTH_MORE and (gained >= _SHARE * left or relieved):
            if gained >= _SHARE_OF_BASE * excess(self.base.fit):
                return True
            # Little beside what the first name explains, but much for the sensors: then conditions left out decide.
            if left > (SMALL - 1) * best.fit.count or relieved:
                return self._predicts(best, new, alone=better >= _WORTH_ALONE)
        seen = len(best.effects) < 2 and left > 2 * np.sqrt(2.0 * best.fit.count)
        if not seen or better < _WORTH_BOTH or gained < _SHARE_BOTH * left:
            return False
        # Nearly all that was left: a misfit of form does not predict what it has not seen.
        return self._predicts(best, new, alone=False)

    def _predicts(self, best: Hypothesis, new: Hypothesis, *, alone: bool) -> bool:
        """Whether `new` predicts conditions left out better than `best`; `alone`: the answer where there is but one."""
        folds = self._folds(best)
        before, after = predict(best.fit, folds), predict(new.fit, folds)
        if before is None or after is None:
            return alone
        return after.score > before.score + WORTH

    def _folds(self, best: Hypothesis) -> list[tuple[str, ...]]:
        model = best.fit.model
        return folds_of([trial for trial in model.problem.trials if trial.id in model.trials])

    def _pairs(self) -> list[Hypothesis]:
        """Pairs of effects, from where projected changes say that their fits should begin."""
        base = self.base.fit
        self.tell("trying pairs", 0.5)
        return self._begun(base.model, pair_starts(base.model, base.values, base.model.problem.forms, most=_PAIRS))

    def _swapped(self, best: Hypothesis) -> Hypothesis:
        """With one of its names exchanged, where another promises more beside the rest."""
        found = [best]
        for effect in best.effects:
            self.tell(f"others in the place of {effect}", 0.5)
            rest = tuple(form for form in best.forms if form.effect != effect)
            beside = fit(best.fit.model.with_forms(rest), best.fit.values, rounds=5)
            others = [form for form in beside.model.problem.forms if form.effect not in best.effects]
            found += self._begun(beside.model, next_starts(beside.model, beside.values, others, most=FOLLOWED))
        return max(found, key=lambda h: h.score)

    def _second(self, best: Hypothesis) -> tuple[Hypothesis, Predicted | None, tuple[Rival, ...]] | None:
        """The same with the second name first, where it is the second that cannot be told from another; else None."""
        kept, doubtful = best.effects
        close: dict[str, Hypothesis] = {}
        for _, tried in self.table:
            others = [effect for effect in tried.effects if effect != kept]
            if kept not in tried.effects or len(others) != 1 or others[0] == doubtful:
                continue
            if tried.score > max(best.score - CLOSE, close[others[0]].score if others[0] in close else -np.inf):
                close[others[0]] = tried
        if not close:
            return None
        forms = {effect: tuple(f for f in best.forms if f.effect == effect) for effect in best.effects}
        model = best.fit.model
        turned = Hypothesis(
            fit(model.with_forms((*forms[doubtful], *forms[kept])), best.fit.values, rounds=3), best.score
        )
        without = fit(model.with_forms(forms[kept]), best.fit.values)
        chosen = sorted(close.items(), key=lambda item: -item[1].score)[:_SHOWN]
        mine, rivals = self._predicted(turned, [compare(name, turned, h, without) for name, h in chosen])
        return (turned, mine, rivals) if any(rival.same for rival in rivals) else None

    def _hopeless(self, best: Hypothesis) -> bool:
        """Whether too much is left for any name to stand: then it need not be told from others."""
        share = excess(best.fit) / max(excess(self.base.fit), 1e-9)
        return best.fit.chi_square > _UNEXPLAINED * best.fit.count and share > _HOPELESS

    def _backward(self, best: Hypothesis) -> Hypothesis:
        """Without what is no longer needed; a further name stands by what lets one in (`_worth`)."""
        while len(best.forms) > 1:
            shorter = []
            for form in best.forms:
                rest = tuple(f for f in best.forms if f is not form)
                found = fit(best.fit.model.with_forms(rest), best.fit.values)
                shorter.append(Hypothesis.of(found))
            kept = max(shorter, key=lambda h: h.score)
            fewer = len(kept.effects) < len(best.effects)
            if kept.score < best.score - (WORTH if fewer else 0.5) and not (fewer and not self._worth(kept, best)):
                break
            best = kept
        return _ordered(best)

    def _rivals(self, best: Hypothesis, first: Sequence[Hypothesis]) -> tuple[Rival, ...]:
        """The likeliest other names in place of the first effect, weighed against it."""
        effect = best.effects[0]
        rest = tuple(f for f in best.forms if f.effect != effect)
        found: dict[str, Hypothesis] = {}
        for other in first[:_BEST]:
            name = other.effects[0]
            if name in best.effects or name in found:
                continue
            if not rest:
                found[name] = other
                continue
            made = fit(best.fit.model.with_forms((*other.forms, *rest)), {**best.fit.values, **other.fit.values})
            found[name] = Hypothesis.of(made)
            self.table.append((said(found[name]), found[name]))
        chosen = sorted(found.items(), key=lambda item: -item[1].score)[:_SHOWN]
        without = fit(best.fit.model.with_forms(rest), best.fit.values) if rest else self.base.fit
        return tuple(compare(name, best, hypothesis, without) for name, hypothesis in chosen)

    def _predicted(self, best: Hypothesis, rivals: Sequence[Rival]) -> tuple[Predicted | None, tuple[Rival, ...]]:
        """With what they say of conditions left out."""
        if self._hopeless(best):
            return None, tuple(rivals)
        folds = self._folds(best)
        self.tell("predicting conditions left out", 0.5)
        mine = predict(best.fit, folds)
        if mine is None:
            return None, tuple(rivals)
        told = []
        for rival in rivals:
            theirs = predict(rival.hypothesis.fit, folds) if rival.close else None
            behind = None if theirs is None else mine.score - theirs.score
            told.append(replace(rival, predicted=theirs, behind_left_out=behind))
        return mine, tuple(told)

    def _settle(
        self, best: Hypothesis, first: Sequence[Hypothesis]
    ) -> tuple[Hypothesis, Predicted | None, tuple[Rival, ...]]:
        """The best and its rivals; where the evidence does not decide, what predicts conditions left out best leads."""
        if not best.effects:
            return best, None, ()
        mine, rivals = self._predicted(best, self._rivals(best, first))
        close = [rival for rival in rivals if rival.close and rival.total < -_LEADS]
        if close and len(best.effects) == 1:
            winner = min(close, key=lambda rival: rival.total).hypothesis
            best = winner
            mine, rivals = self._predicted(best, self._rivals(best, first))
        return best, mine, rivals


def choose(
    base: Fit, *, tell: Tell, seed: int = 0, recoloured: Callable[[Fit], Fit] | None = None,
    own_ways: Callable[[Fit, Fit], tuple[Finding, ...]] | None = None,
) -> Choice:  # fmt: skip
    """Search from the base model's fit. `recoloured`: a fit with the noise as that fit leaves it. `own_ways`: trials
    whose ways of their own are all that speaks against the base model or the best single name; it is asked before a
    second name is looked for, for no name explains what shows in one trial."""
    return Search(base, tell=tell, seed=seed, recoloured=recoloured, own_ways=own_ways).choose()


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
