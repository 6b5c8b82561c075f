"""The search for effects: candidates are added one by one and in pairs, refitted, compared and removed again."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from experiments.diagnose.fit.bounds import is_strained
from experiments.diagnose.fit.evidence import SMALL, Hypothesis, excess
from experiments.diagnose.fit.fitting import Fit, fit, fit_each
from experiments.diagnose.fit.gate import Verdict
from experiments.diagnose.fit.problem import Contacts, Finding

from .candidate_fits import FOLLOWED, WORTH, CandidateFits
from .pairs import FormsStart, next_starts, pair_starts
from .rivals import CLOSE, LEAD, Predicted, Rival, compare, folds_of, predict

__all__ = ["Choice", "Search", "further_gains"]

_WORTH_MORE = 8.0  # the same for a second effect: a misfit of form is always there to be explained
_SHARE = 0.5  # of the excess that is left, how much a further effect must remove
_SHARE_OF_BASE = 0.04  # and of what the base model leaves: a misfit of the first effect's form is some hundredths of it
_SHARE_PLAIN, _SHARE_OF_FORM = 0.2, 0.01
"""Shares of what the base model leaves: up to the first, left by one effect, a second is searched beside it; up to the
second, left by two effects, no third is searched."""
_WORTH_ALONE = 16.0  # nats from which a further effect counts where one condition only allows no cross-validation
_WORTH_BOTH, _SHARE_BOTH = 5.0, 0.75
"""Nats, and share of what is left, from which a smaller second effect counts if the cross-validation supports it."""
_LEADS = 2.0  # nats of evidence and cross-validation together by which another close effect takes the lead
_BESIDE = 20.0  # nats behind the best within which a rival is compared with it beside a further effect
_UNEXPLAINED, _HOPELESS = 1.3, 0.1
"""Reduced chi-square, and share of the base model's excess, beyond both of which no effect can be named."""
_SHOWN = 3  # rivals that are compared
_MOST = 3  # effects at once
_BEST = 5  # single effects that are tried as a further one
_PAIRS = 8  # pairs of effects that are fitted where no single effect suffices; of pushes and drops all are begun
_PAIRS_STATED = 24  # and that are begun at the stated numbers, where the base model has bent its own


def further_gains() -> dict[str, float]:
    """What one more name must gain: nats, and the share of what is left [%]; less of a second that predicts better."""
    return {"nats": _WORTH_MORE, "share": 100 * _SHARE, "fewer": _WORTH_BOTH, "more": 100 * _SHARE_BOTH}


@dataclass(frozen=True)
class Choice:
    """What a search has found."""

    base: Hypothesis
    best: Hypothesis
    alternatives: tuple[Hypothesis, ...]  # that could replace the first effect, the likeliest first
    table: tuple[Hypothesis, ...]  # every candidate that was fitted
    left: Verdict  # the gate on the best
    rivals: tuple[Rival, ...] = ()  # the nearest other effects, the likeliest first
    predicted: Predicted | None = None  # the best's cross-validation
    diverging: tuple[Finding, ...] = ()
    """Trials that diverge from the model, which is all that contradicts the best: no further effect was tried."""


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
        verdict = self._gate(best)
        if not verdict.passed:
            if self._find_diverging is not None and (gone := self._find_diverging(self.base.fit, best.fit)):
                return Choice(self.base, best, (), tuple(self.table), verdict, diverging=gone)
            best = self._further(best, first)
        whole, best = best, self._backward(best)
        if len(best.effects) == len(whole.effects) and len(best.forms) < len(whole.forms):
            best = self._backward(self._enriched(best))  # without the form that was in the way of others
        best, predicted, rivals = self._settle(best, first)
        if len(best.effects) == 2 and not any(rival.same for rival in rivals):
            best, predicted, rivals = self._second(best) or (best, predicted, rivals)
        if self.pairs and len(best.effects) == 2:  # it competes again in a later search
            self.pairs = (*self.pairs, FormsStart(best.forms, best.fit.values))
        left = self._gate(best)
        same = tuple(rival.hypothesis for rival in rivals if rival.same)
        return Choice(self.base, best, same, tuple(self.table), left, rivals, predicted)

    def _further(self, best: Hypothesis, first: Sequence[Hypothesis]) -> Hypothesis:
        """A second and third effect, while each removes enough of what is left."""
        while len(best.effects) < _MOST:
            self.tell(f"beside {', '.join(best.effects) or 'the base model'}: something is left", 0.5)
            tried = []
            seen: set[str] = set()
            beside = self._beside(best)
            if beside:  # what stands out beside the first effect, however little it explains alone
                found = self._enriched(self._likeliest(best, beside))
                if self._worth(best, found) and (self._next_to_all(found) or self._gate(found).passed):
                    return found
                tried += [found, *beside]
            for other in first[:_BEST] if len(best.effects) == 1 and not beside else ():
                name = other.effects[0]
                if name in best.effects or name in seen:
                    continue
                seen.add(name)
                tried += self._try(best, self._best_forms(name)[:2])
            tried += self._pairs() if len(best.effects) < 2 else self._next(best.fit, best.effects)
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
        """The most promising second effects beside a plain first one, whose branches hid them while alone."""
        plain = excess(best.fit) < _SHARE_PLAIN * excess(self.base.fit)
        if len(best.effects) != 1 or not plain or best.fit.model.problem.contacts is None:
            return []
        return self._next(best.fit, best.effects)

    def _next(self, found: Fit, effects: Sequence[str], *, most: int = _BEST) -> list[Hypothesis]:
        """The most promising single effects beside a fit, other than `effects`."""
        others = [form for form in found.model.problem.forms if form.effect not in effects]
        return self._begun(found.model, next_starts(found.model, found.values, others, most=most))

    def _next_to_all(self, best: Hypothesis) -> bool:
        """Whether no more than a misfit of form is left of what the base model leaves."""
        left = excess(best.fit)
        return left < _SHARE_OF_FORM * excess(self.base.fit) and best.fit.chi_square < SMALL * best.fit.count

    def _worth(self, best: Hypothesis, new: Hypothesis) -> bool:
        """Whether a further effect is worth naming, with the noise as before or as it shows beside the effect."""
        if self._worth_in_noise(best, new):
            return True
        pair = self._in_its_noise(best, new)
        return pair is not None and self._worth_in_noise(*pair)

    def _worth_in_noise(self, best: Hypothesis, new: Hypothesis) -> bool:
        """Whether a further effect removes most of what is left, or frees the fit of a value that is excluded."""
        left = max(excess(best.fit), 0.0)
        gained, better = excess(best.fit) - excess(new.fit), new.score - best.score
        relieved = is_strained(best.fit) and not is_strained(new.fit)
        if better >= _WORTH_MORE and (gained >= _SHARE * left or relieved):
            if gained >= _SHARE_OF_BASE * excess(self.base.fit):
                return True
            # Little beside what the first effect explains, but much for the sensors: the cross-validation decides.
            if left > (SMALL - 1) * best.fit.count or relieved:
                return self._predicts(best, new, alone=better >= _WORTH_ALONE)
        seen = len(best.effects) < 2 and left > 2 * np.sqrt(2.0 * best.fit.count)
        if not seen or better < _WORTH_BOTH or gained < _SHARE_BOTH * left:
            return False
        # Nearly all that was left: a misfit of form does not predict conditions that it has not seen.
        return self._predicts(best, new, alone=False)

    def _predicts(self, best: Hypothesis, new: Hypothesis, *, alone: bool) -> bool:
        """Whether `new` does better in cross-validation than `best`; `alone`: the answer where there is one fold."""
        folds = folds_of(best.fit.model.infos)
        before, after = predict(best.fit, folds), predict(new.fit, folds)
        if before is None or after is None:
            return alone
        return after.score > before.score + WORTH

    def _pairs(self) -> list[Hypothesis]:
        """Pairs of effects, begun where projected changes promise most."""
        base = self.base.fit
        self.tell("trying pairs", 0.5)
        contacts = base.model.problem.contacts
        if contacts is None:  # a fit costs little: every pair
            return self._in_all_forms()
        begun = self._begun(base.model, pair_starts(base.model, base.values, base.model.problem.forms, most=_PAIRS))
        return begun + self._pairs_stated(contacts) if is_strained(base) else begun

    def _pairs_stated(self, contacts: Contacts) -> list[Hypothesis]:
        """Pairs begun at the stated numbers: those that follow the beginnings of the trials best.

        Numbers that the base model has bent already imitate what is missing, so the changes of effects that are added
        there promise little. Of each pair all forms are begun.
        """
        model = self.base.fit.model
        stated = {p.name: p.value for p in model.parameters}
        starts = pair_starts(model, stated, model.problem.forms, most=_PAIRS_STATED, every_form=True)
        models = [model.with_forms(start.forms) for start in starts]
        likeliest = contacts.race(models, [start.values for start in starts], most=_PAIRS)
        return self._begun(model, [replace(starts[place], values=values) for place, values in likeliest])

    def _swapped(self, best: Hypothesis) -> Hypothesis:
        """With one of its effects exchanged, where another promises more beside the rest."""
        found = [best]
        for effect in best.effects:
            self.tell(f"others in the place of {effect}", 0.5)
            beside = fit(best.fit.model.with_forms(best.without(effect)), best.fit.values, rounds=5)
            found += self._next(beside, best.effects, most=FOLLOWED)
        return max(found, key=lambda h: h.score)

    def _second(self, best: Hypothesis) -> tuple[Hypothesis, Predicted | None, tuple[Rival, ...]] | None:
        """The same with the second effect first, where the data cannot separate that from another; else None."""
        kept, doubtful = best.effects
        close: dict[str, Hypothesis] = {}
        for tried in self.table:
            others = [effect for effect in tried.effects if effect != kept]
            if kept not in tried.effects or len(others) != 1 or others[0] == doubtful:
                continue
            if tried.score > max(best.score - CLOSE, close[others[0]].score if others[0] in close else -np.inf):
                close[others[0]] = tried
        if not close:
            return None
        first, rest = best.without(kept), best.without(doubtful)
        model = best.fit.model
        turned = Hypothesis(fit(model.with_forms((*first, *rest)), best.fit.values, rounds=3), best.score)
        without = fit(model.with_forms(rest), best.fit.values)
        chosen = sorted(close.items(), key=lambda item: -item[1].score)[:_SHOWN]
        mine, rivals = self._predicted(turned, [compare(name, turned, h, without) for name, h in chosen])
        return (turned, mine, rivals) if any(rival.same for rival in rivals) else None

    def _hopeless(self, best: Hypothesis) -> bool:
        """Whether too much is left for any effect to be named, so that rivals need no comparison."""
        share = excess(best.fit) / max(excess(self.base.fit), 1e-9)
        return best.fit.chi_square > _UNEXPLAINED * best.fit.count and share > _HOPELESS

    def _backward(self, best: Hypothesis) -> Hypothesis:
        """Without what is no longer needed; a further effect stays by the rule that adds one (`_worth`)."""
        while len(best.forms) > 1:
            shorter = [tuple(f for f in best.forms if f is not form) for form in best.forms]
            fits = fit_each([(best.fit.model.with_forms(rest), best.fit.values) for rest in shorter])
            kept = max(map(Hypothesis.of, fits), key=lambda h: h.score)
            fewer = len(kept.effects) < len(best.effects)
            if kept.score < best.score - (WORTH if fewer else 0.5) and not (fewer and not self._worth(kept, best)):
                break
            best = kept
        return _ordered(best)

    def _rivals(self, best: Hypothesis, first: Sequence[Hypothesis]) -> tuple[Rival, ...]:
        """The likeliest other effects in place of the first one, compared with it; also other pairs in place of two."""
        rest = best.without(best.effects[0])
        found: dict[str, Hypothesis] = {}
        for other in first[:_BEST]:
            name = other.effects[0]
            if name not in best.effects and name not in found:
                model, values = (
                    best.fit.model.with_forms((*other.forms, *rest)),
                    {**best.fit.values, **other.fit.values},
                )
                found[name] = self._kept(fit(model, values)) if rest else other
        chosen = sorted(found.items(), key=lambda item: -item[1].score)[:_SHOWN]
        without = fit(best.fit.model.with_forms(rest), best.fit.values) if rest else self.base.fit
        near = [compare(name, best, hypothesis, without) for name, hypothesis in chosen]
        known = {rival.effect: rival.hypothesis.score for rival in near}
        for name, hypothesis in self._other_pairs(best).items():
            if hypothesis.score > known.get(name, -np.inf):  # from the base model: the two may share no form
                near = [rival for rival in near if rival.effect != name]
                near.append(compare(name, best, hypothesis, self.base.fit))
        return tuple(sorted(near, key=lambda rival: rival.behind)[:_SHOWN])

    def _other_pairs(self, best: Hypothesis) -> dict[str, Hypothesis]:
        """The likeliest pairs that were fitted without the first of two effects, by the effect that is in its place."""
        found: dict[str, Hypothesis] = {}
        for tried in self.table if len(best.effects) == 2 else ():
            others = [effect for effect in tried.effects if effect not in best.effects]
            if len(tried.effects) != 2 or not others or best.effects[0] in tried.effects:
                continue
            if others[0] not in found or tried.score > found[others[0]].score:
                found[others[0]] = tried
        return found

    def _predicted(self, best: Hypothesis, rivals: Sequence[Rival]) -> tuple[Predicted | None, tuple[Rival, ...]]:
        """The best's cross-validation, and the rivals with theirs."""
        if self._hopeless(best):
            return None, tuple(rivals)
        folds = folds_of(best.fit.model.infos)
        self.tell("predicting conditions left out", 0.5)
        mine = predict(best.fit, folds)
        if mine is None:
            return None, tuple(rivals)
        compared = []
        for rival in rivals:
            theirs = predict(rival.hypothesis.fit, folds) if rival.behind < LEAD else None
            behind = None if theirs is None else mine.score - theirs.score
            compared.append(replace(rival, predicted=theirs, behind_left_out=behind))
        return mine, tuple(compared)

    def _settle(
        self, best: Hypothesis, first: Sequence[Hypothesis]
    ) -> tuple[Hypothesis, Predicted | None, tuple[Rival, ...]]:
        """The best and its rivals; where the evidence does not decide, the best in cross-validation leads."""
        if not best.effects:
            return best, None, ()
        mine, rivals = self._predicted(best, self._rivals(best, first))
        close = [rival for rival in rivals if rival.close and rival.total < -_LEADS]
        if close and len(best.effects) == 1:
            best = min(close, key=lambda rival: rival.total).hypothesis
            mine, rivals = self._predicted(best, self._rivals(best, first))
        return self._beside_structure(best, first) or (best, mine, rivals)

    def _lead_beside(self, one: Hypothesis, other: Hypothesis) -> float:
        """Nats by which one single effect leads another where each stands alone or beside the same further effects."""
        both = (*one.effects, *other.effects)
        self.tell(f"{' and '.join(both)}, each beside a small further effect", 0.5)
        found = {h.effects[0]: self._next(h.fit, both, most=FOLLOWED) for h in (one, other)}
        for name, own in found.items():
            own += [h for h in self.table if len(h.effects) == 2 and set(h.effects) & set(both) == {name}]
        best = [max(own, key=lambda h: h.score) for own in found.values() if own]
        seconds = {form.id: form for h in best for form in h.forms if form.effect not in both}
        scores = []
        for h in (one, other):  # with what did best beside either
            tried = (*found[h.effects[0]], *self._try(h, list(seconds.values())))
            scores.append(max([h.score, *(n.score for n in tried)]))
        return scores[0] - scores[1]

    def _beside_structure(
        self, best: Hypothesis, first: Sequence[Hypothesis]
    ) -> tuple[Hypothesis, Predicted | None, tuple[Rival, ...]] | None:
        """A rival in the lead that explains the trials better than `best` where each stands beside one more effect.

        No measurement has exactly the model's structure. Where two single effects both leave too little to matter, what
        chooses between them is how well each imitates that structure too: a form with many numbers does it best. Beside
        any small further effect, which stands for the structure, the right one leaves less. None where no rival leads.
        """
        if len(best.effects) != 1 or not _leaves_little(best):
            return None
        mine: dict[str, float] = {}
        for rival in self._rivals(best, first):
            if 0.0 <= rival.behind < _BESIDE and _leaves_little(rival.hypothesis):
                mine[rival.effect] = self._lead_beside(rival.hypothesis, best)
        ahead = max(mine, key=lambda effect: mine[effect], default="")
        if not ahead or mine[ahead] < _LEADS:
            return None
        lead = next(h for h in first if h.effects == (ahead,))
        rivals = [
            replace(rival, behind=mine[ahead]) if rival.effect == best.effects[0] else rival
            for rival in self._rivals(lead, first)
        ]
        return lead, *self._predicted(lead, rivals)


def _leaves_little(found: Hypothesis) -> bool:
    """Whether what is left is too small to matter."""
    return found.fit.chi_square <= SMALL * found.fit.count


def _ordered(best: Hypothesis) -> Hypothesis:
    """The effect whose loss would cost most stands first."""
    if len(best.effects) < 2:
        return best
    model, values = best.fit.model, best.fit.values
    fewer = fit_each([(model.with_forms(best.without(effect)), values) for effect in best.effects], rounds=8)
    cost = dict(zip(best.effects, (one.objective for one in fewer), strict=True))
    forms = tuple(sorted(best.forms, key=lambda form: -cost[form.effect]))
    return Hypothesis(fit(model.with_forms(forms), values, rounds=3), best.score)
