"""Which effects a campaign calls for: candidates added one by one and in pairs, refitted, weighed, taken back."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from experiments.diagnose.fit.bounds import is_strained
from experiments.diagnose.fit.evidence import SMALL, Hypothesis, best_start, excess, score
from experiments.diagnose.fit.fitting import Fit, Model, fit
from experiments.diagnose.fit.gate import Verdict, open_gate
from experiments.diagnose.fit.problem import Finding, Form, Values

from .equivalence import CLOSE, Rival, compare
from .pairs import FormsStart, next_starts, pair_starts
from .prediction import Predicted, folds_of, predict

__all__ = ["Choice", "Search", "choose"]

_WORTH = 3.0
"""Nats by which an effect must raise the tempered evidence."""
_WORTH_MORE = 8.0
"""The same for a second name: a misfit of form is always there to be explained."""
_SHARE = 0.5
"""Of the excess that is left, how much a further name must take away."""
_SHARE_OF_BASE = 0.04
"""And of what the base model left: a misfit of the first effect's form is often some hundredths of it."""
_SHARE_PLAIN, _SHARE_OF_FORM = 0.2, 0.01
"""Of what the base model leaves, how much a first name may leave for the second one to be looked for beside it, and
how much both may for no third one to be looked for."""
_WORTH_ALONE = 16.0
"""Nats from which a further name counts where there is but one condition, so that no prediction can be asked for."""
_BEHIND = 30.0
"""Nats behind the best beyond which a candidate is not fitted to the end: its chi-square is seven times as large."""
_FINISHED, _NEAR_BY = 8, 8.0
"""So many candidates are fitted to the end, and all within so many nats of the best."""
_WORTH_BOTH, _SHARE_BOTH = 5.0, 0.75
"""Nats, and share of what is left, from which a smaller second name counts too, if conditions left out say so."""
_LEADS = 2.0
"""Nats of evidence and prediction together by which another close name takes the lead."""
_UNEXPLAINED, _HOPELESS = 1.3, 0.1
"""Chi-square per sample, and share of what the base model leaves beyond noise, from which on both no name can stand."""
_SHOWN = 3
"""Rivals that are weighed."""
_MOST = 3
_BEST = 5
_PAIRS = 8
"""Pairs of effects that are looked at where no single name does, and how many of them are fitted in full."""
_FOLLOWED = 3
_SMALL_PART, _PARTS = 0.3, (0.1, 1.0)
"""Of the amplitude that a form has alone, and of those that its starts have, for fits of it beside others."""

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
    rivals: tuple[Rival, ...] = ()
    """The nearest other names, the likeliest first, and why they are alternatives or not."""
    predicted: Predicted | None = None
    """What the best leaves of conditions left out."""
    astray: tuple[Finding, ...] = ()
    """Trials that go ways of their own, which is all that speaks against the best: then no further name was tried."""


class Search:
    """One search over one set of trials."""

    def __init__(
        self, base: Fit, *, tell: Tell, seed: int = 0, recoloured: Callable[[Fit], Fit] | None = None,
        own_ways: Callable[[Fit, Fit], tuple[Finding, ...]] | None = None,
    ) -> None:  # fmt: skip
        self.base = Hypothesis(base, score(base))
        self._own_ways = own_ways
        self.tell = tell
        self.seed = seed
        self._recoloured = recoloured
        self.table: list[tuple[str, Hypothesis]] = []
        self._alone: dict[str, Hypothesis] = {}
        self._most = self.base.score
        """The best single form's."""

    def choose(self) -> Choice:
        """Forward, in pairs, backward."""
        first = self._singles()
        self._base_again(first)
        self._most = max([self._most, *(h.score for h in first)])
        first = [self._enriched(h) for h in first[:3]] + first[3:]
        first.sort(key=lambda h: -h.score)
        best = first[0] if first and first[0].score > self.base.score + _WORTH else self.base
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

    # Steps ------------------------------------------------------------------------------------------------------------

    def _gate(self, hypothesis: Hypothesis) -> Verdict:
        """With the noise as it shows once the hypothesis has taken the motion out of the way: a colour calls for no
        further name."""
        told = open_gate(hypothesis.fit, seed=self.seed)[1]
        if told.passed or self._recoloured is None or not hypothesis.effects:
            return told
        other = self._recoloured(hypothesis.fit)
        return told if other is hypothesis.fit else open_gate(other, seed=self.seed)[1]

    def _try(self, what: str, start: Hypothesis, forms: Sequence[Form], *, rounds: int = 6) -> Hypothesis:
        """`start` with `forms` added, all refitted."""
        model: Model = start.fit.model.with_forms((*start.forms, *forms))
        alone = self._alone.get(forms[0].id)
        if alone is None:
            found = best_start(model, forms[0], start.fit.values, rounds=rounds)
        else:  # where it stood alone is a good place to begin from beside others, and a small amplitude is another
            amplitude = forms[0].amplitude
            values = {**{p.name: alone.fit.values[p.name] for p in forms[0].parameters}, **start.fit.values}
            places: list[Values] = [values, {**values, amplitude: _SMALL_PART * values[amplitude]}]
            if forms[0].effect in start.effects and not hasattr(model.problem, "guess"):
                # What it was alone, another form of the effect now is: little of it, in all its shapes.
                for own in forms[0].starts:
                    places += [{**start.fit.values, **own, amplitude: part * own[amplitude]} for part in _PARTS]
            first = [fit(model, place, rounds=4) for place in places]
            best = min(first, key=lambda f: f.objective)
            found = fit(model, best.values)
        if not start.forms:
            self._alone[forms[0].id] = Hypothesis(found, 0.0)
        made = Hypothesis(found, score(found))
        self.table.append((what, made))
        return made

    def _singles(self) -> list[Hypothesis]:
        """The best form of each effect, the likeliest effect first."""
        model = self.base.fit.model
        forms = model.problem.forms
        guess = getattr(model.problem, "guess", None)
        if guess is not None and forms:  # which looks for all of them together
            self.tell("looking for where the candidates' fits begin", 0.0)
            guess(forms[:1], model.trials, self.base.fit.values, apart=model.scatter)
        made: list[Hypothesis] = []
        for k, form in enumerate(forms):
            self.tell(f"trying {form.effect} ({form.name})", k / max(1, len(forms)))
            made.append(self._try(form.id, self.base, [form], rounds=6 if guess is None else 1))
        if guess is not None:
            most = max((h.score for h in made), default=0.0)
            ranked = sorted((h.score for h in made), reverse=True)
            least = min(ranked[:_FINISHED][-1], most - _NEAR_BY)
            for k, begun in enumerate(made):
                if begun.score > most - _BEHIND and begun.score >= least:
                    self.tell(f"fitting {forms[k].effect} ({forms[k].name})", k / len(forms))
                    found = fit(begun.fit.model, begun.fit.values)
                    made[k] = Hypothesis(found, score(found))
                    self._alone[forms[k].id] = Hypothesis(found, 0.0)
                    self.table.append((forms[k].id, made[k]))
        best: dict[str, Hypothesis] = {}
        for form, one in zip(forms, made, strict=True):
            if form.effect not in best or one.score > best[form.effect].score:
                best[form.effect] = one
        if guess is None:
            best = {effect: self._from_its_like(one) for effect, one in best.items()}
        return sorted(best.values(), key=lambda h: -h.score)

    def _base_again(self, first: Sequence[Hypothesis]) -> None:
        """The base model once more, from where the best single names have ended.

        A trial that the base fit has on another branch of stick and slip is brought back by whatever moves it a little,
        so that many names seem to explain it; where the base model finds the way too, none of them has.
        """
        for one in first[:_FOLLOWED]:
            if _WORTH < one.score - self.base.score < _BEHIND:
                found = fit(self.base.fit.model, one.fit.values)
                if found.objective < self.base.fit.objective - 1.0:
                    self.base = Hypothesis(found, score(found))

    def _from_its_like(self, one: Hypothesis) -> Hypothesis:
        """The best of the forms that share scales with this single one, begun where it ended: what a pull's reach is to
        one form it is to the next."""
        best, (plain,) = one, one.forms
        if one.score < self.base.score + _WORTH or excess(one.fit) < 0.5 * np.sqrt(2.0 * one.fit.count):
            return one
        scales = {p.name for p in plain.parameters} - {plain.amplitude}
        for form in one.fit.model.problem.forms:
            if form is plain or form.effect != plain.effect or not scales & {p.name for p in form.parameters}:
                continue
            start = form.starts[0] if form.starts else {}
            values = {**start, **one.fit.values, form.amplitude: one.fit.values[plain.amplitude]}
            found = fit(one.fit.model.with_forms([form]), values)
            made = Hypothesis(found, score(found))
            self.table.append((form.id, made))
            if form.id not in self._alone or found.objective < self._alone[form.id].fit.objective:
                self._alone[form.id] = Hypothesis(found, 0.0)
            best = made if made.score > best.score else best
        return best

    def _bent(self, hypothesis: Hypothesis) -> Hypothesis:
        """With forms of another shape (the problem's `shapes`) where that helps, from where the plain ones are; what
        is bent may be bent in a second way."""
        best = hypothesis
        shapes = getattr(best.fit.model.problem, "shapes", {})
        plain = list(hypothesis.forms) if hypothesis.score > self._most - _BEHIND else []
        while plain:
            form, start = plain.pop(0), best
            known = {p.name for p in form.parameters}
            if excess(start.fit) < 0.5 * np.sqrt(2.0 * start.fit.count):
                break
            for finer in shapes.get(form.id, ()):
                found = self._fitted_bend(start.fit, form, finer, known)
                made = Hypothesis(found, score(found))
                self.table.append((_said(made), made))
                if made.score > max(best.score, start.score + 1.0):
                    best = made
                    if len(made.forms) == 1:
                        self._alone[finer.id] = made
            plain += [made for made in best.forms if made not in start.forms]
        return best

    @staticmethod
    def _fitted_bend(start: Fit, plain: Form, finer: Form, known: set[str]) -> Fit:
        """With the `finer` form in place of the plain one, whose parameters are `known`."""
        model = start.model.with_forms([finer if form is plain else form for form in start.model.forms])
        bends = _once([{k: v for k, v in point.items() if k not in known} for point in finer.starts])
        places: list[Values] = [{**start.values, **bend} for bend in bends]
        begun = [fit(model, values, rounds=3) for values in places]
        refine = getattr(model.problem, "refine", None)
        if refine is not None:  # a bend alone may put trials on other branches: from their beginnings, too
            found_anew = refine([(model.forms, values) for values in places], model.trials, apart=model.scatter)
            begun += [fit(model, values, rounds=3) for values in found_anew]
        return fit(model, min(begun, key=lambda one: one.objective).values)

    def _siblings(self, hypothesis: Hypothesis) -> list[Hypothesis]:
        """Other forms of a single name, alone: bent, one that was behind may come nearer than the one that leads."""
        problem = hypothesis.fit.model.problem
        if len(hypothesis.forms) != 1 or hasattr(problem, "guess"):
            return []
        shapes = getattr(problem, "shapes", {}).keys() & {form.id for form in problem.forms}
        found: dict[str, Hypothesis] = {}
        for _, tried in self.table:
            if len(tried.forms) != 1 or tried.effects != hypothesis.effects or tried.forms == hypothesis.forms:
                continue
            known = found.get(tried.forms[0].id)
            near = tried.score > hypothesis.score - _BEHIND and (known is None or tried.score > known.score)
            if near and tried.forms[0].id in shapes:
                found[tried.forms[0].id] = tried
        return list(found.values())

    def _enriched(self, hypothesis: Hypothesis) -> Hypothesis:
        """Of another shape or with a second form of an effect, where that helps: nature's is between the library's."""
        best = max([self._bent(one) for one in (hypothesis, *self._siblings(hypothesis))], key=lambda h: h.score)
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
                    tried.append(self._try(f"{_said(best)} + {form.id}", best, [form]))
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
        """Second names that promise most beside the first, where that explains most of what the base model leaves and
        the problem has a search of its own: alone, on the branches where a plain effect leaves the base model, they
        were seen for nothing."""
        plain = excess(best.fit) < _SHARE_PLAIN * excess(self.base.fit)
        if len(best.effects) != 1 or not plain or not hasattr(best.fit.model.problem, "refine"):
            return []
        model, values = best.fit.model, best.fit.values
        others = [form for form in model.problem.forms if form.effect not in best.effects]
        return self._begun(model, next_starts(model, values, others, most=_BEST))

    def _next_to_all(self, best: Hypothesis) -> bool:
        """Whether next to nothing of what the base model leaves is left, and no more than a misfit of form."""
        left = excess(best.fit)
        return left < _SHARE_OF_FORM * excess(self.base.fit) and best.fit.chi_square < SMALL * best.fit.count

    def _likeliest(self, best: Hypothesis, tried: Sequence[Hypothesis]) -> Hypothesis:
        """The likeliest of `tried`, with the noise as it shows where the least is left: until the motion is out of the
        way a colour is part of every misfit, and the tempered evidence hardly tells one misfit from another."""
        first = max(tried, key=lambda h: h.score)
        least = min(tried, key=lambda h: h.fit.objective)
        pair = self._in_its_noise(first, least) if least is not first else None
        return least if pair is not None and pair[1].score > pair[0].score else first

    def _in_its_noise(self, one: Hypothesis, other: Hypothesis) -> tuple[Hypothesis, Hypothesis] | None:
        """Both weighed with the noise that `other` leaves; None where that is the noise they were weighed with."""
        found = self._recoloured(other.fit) if self._recoloured is not None else other.fit
        if found is other.fit:
            return None
        same = fit(replace(one.fit.model, whitener=found.model.whitener), one.fit.values)
        return Hypothesis(same, score(same)), Hypothesis(found, score(found))

    def _worth(self, best: Hypothesis, new: Hypothesis) -> bool:
        """Whether a further name is worth saying, with the noise as it was taken or as it shows beside the name."""
        if self._worth_in_noise(best, new):
            return True
        pair = self._in_its_noise(best, new)
        return pair is not None and self._worth_in_noise(*pair)

    def _worth_in_noise(self, best: Hypothesis, new: Hypothesis) -> bool:
        """Whether a further name is more than the misfit of the first one's form: it takes most of what is left
        away, or needs no more the number that the campaign excludes."""
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
        return after.score > before.score + _WORTH

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
            found += self._begun(beside.model, next_starts(beside.model, beside.values, others, most=_FOLLOWED))
        return max(found, key=lambda h: h.score)

    def _begun(self, model: Model, starts: Sequence[FormsStart]) -> list[Hypothesis]:
        """Fits of what `starts` add to `model`; the most promising in full."""
        rough = bool(getattr(model.problem, "rough", ()))
        places = [start.values for start in starts]
        refine = getattr(model.problem, "refine", None)
        if refine is not None and starts:  # a search of its own, for models whose contacts make a likelihood jump
            asked = [((*model.forms, *start.forms), start.values) for start in starts]
            places = refine(asked, model.trials, apart=model.scatter)
        begun = []
        models = [model.with_forms((*model.forms, *start.forms)) for start in starts]
        if refine is not None:  # these are near their ends: the better half goes on
            left = [float(np.square(one.evaluate([point])[0]).sum()) for one, point in zip(models, places, strict=True)]
            kept = sorted(range(len(left)), key=lambda k: left[k])[: max(_FOLLOWED, (len(left) + 1) // 2)]
            models, places = [models[k] for k in kept], [places[k] for k in kept]
        for longer, values in zip(models, places, strict=True):
            for share in (0.4, 0.7) if rough else ():
                values = fit(longer.until(share), values, rounds=6).values
            begun.append(fit(longer, values, rounds=5))
        begun.sort(key=lambda found: found.objective)
        made = []
        for one in begun[:_FOLLOWED]:
            found = fit(one.model, one.values)
            made.append(Hypothesis(found, score(found)))
            self.table.append((_said(made[-1]), made[-1]))
        return made

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

    def _best_forms(self, effect: str) -> list[Form]:
        """Forms of an effect, in the order of how well they did alone."""
        alone = [h for what, h in self.table if len(h.forms) == 1 and h.effects == (effect,)]
        return [h.forms[0] for h in sorted(alone, key=lambda h: -h.score)]

    def _backward(self, best: Hypothesis) -> Hypothesis:
        """Without what is no longer needed. A further name stands by what lets one in (`_worth`): beside it a fit may
        have found a branch of sticking and slipping on which the others do as well alone."""
        while len(best.forms) > 1:
            shorter = []
            for form in best.forms:
                rest = tuple(f for f in best.forms if f is not form)
                found = fit(best.fit.model.with_forms(rest), best.fit.values)
                shorter.append(Hypothesis(found, score(found)))
            kept = max(shorter, key=lambda h: h.score)
            fewer = len(kept.effects) < len(best.effects)
            if kept.score < best.score - (_WORTH if fewer else 0.5) and not (fewer and not self._worth(kept, best)):
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
            found[name] = Hypothesis(made, score(made))
            self.table.append((_said(found[name]), found[name]))
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


def _once(places: Sequence[Values]) -> list[Values]:
    """Each of them once."""
    return [dict(numbers) for numbers in dict.fromkeys(tuple(place.items()) for place in places)]


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
