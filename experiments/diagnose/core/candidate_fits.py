"""Fits of candidate effects: alone, with another shape, beside other effects, from the most promising starts."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import groupby

import numpy as np

from experiments.diagnose.fit.evidence import Hypothesis, best_starts, excess
from experiments.diagnose.fit.fitting import Fit, Model, Rule, fit, fit_each
from experiments.diagnose.fit.gate import Verdict, open_gate
from experiments.diagnose.fit.problem import Finding, Form, Values

from .pairs import FormsStart, pair_starts

__all__ = ["FOLLOWED", "WORTH", "CandidateFits", "Tell"]

WORTH = 3.0  # nats by which an effect must raise the tempered evidence
BEHIND = 30.0  # nats behind the best beyond which a fit stops early: the chi-square is seven times as large
_FINISHED, _NEAR_BY = 8, 8.0  # number of candidates fitted to the end, and all within so many nats of the best
FOLLOWED = 3
_EVERY = 1000  # pairs of effects: all of them
_BENT_PAIRS = 4  # pairs of effects that are fitted with forms bent
_ROUNDS, _ROUNDS_BENT = 5, 3  # steps of their short fits
_SEEN = 0.5  # standard deviations of chi-square from which on a fit leaves something for another shape
_SMALL_PART, _PARTS = 0.3, (0.1, 1.0)  # of a form's amplitude alone, and of its starts, for fits beside other forms

Tell = Callable[[str, float], None]


class CandidateFits:
    """Fits of candidates on one set of trials: each effect alone, bent, beside others; `table` keeps all of them.

    `recoloured`: a fit with the noise as that fit leaves it. `find_diverging`: trials whose divergence is all that
    contradicts the base model or the best single effect; asked before a second effect is searched. `known`: where each
    form by its id ended in an earlier search of the same trials, by other weights, from which it is fitted then;
    `known_pairs`: the same of pairs of effects (`pairs`), which are not looked for again.
    """

    def __init__(
        self, base: Fit, *, tell: Tell, seed: int = 0, recoloured: Callable[[Fit], Fit] | None = None,
        find_diverging: Callable[[Fit, Fit], tuple[Finding, ...]] | None = None,
        known: Mapping[str, Values] | None = None, known_pairs: Sequence[FormsStart] = (),
    ) -> None:  # fmt: skip
        self.base = Hypothesis.of(base)
        self._known, self._known_pairs = known or {}, known_pairs
        self.pairs: tuple[FormsStart, ...] = tuple(known_pairs)
        self._find_diverging = find_diverging
        self.tell = tell
        self.seed = seed
        self._recoloured = recoloured
        self.table: list[Hypothesis] = []
        self._alone: dict[str, Fit] = {}
        self._made: dict[tuple[object, ...], Fit] = {}
        self._most = self.base.score  # of the best single form

    def _gate(self, hypothesis: Hypothesis) -> Verdict:
        """The gate, with the noise as it shows beside the hypothesis: a colour calls for no further effect."""
        verdict = open_gate(hypothesis.fit, seed=self.seed)[1]
        if verdict.passed or self._recoloured is None or not hypothesis.effects:
            return verdict
        other = self._recoloured(hypothesis.fit)
        return verdict if other is hypothesis.fit else open_gate(other, seed=self.seed)[1]

    def leaves_nothing(self, hypothesis: Hypothesis) -> bool:
        """Whether another shape has nothing to explain: neither in the sum over all samples nor by the gate. Where the
        noise is less than stated, the sum alone hides a slow misfit."""
        return _sums_to_little(hypothesis.fit) and self._gate(hypothesis).passed

    def _kept(self, found: Fit) -> Hypothesis:
        """A fit as a hypothesis of the table."""
        self.table.append(Hypothesis.of(found))
        return self.table[-1]

    def _fit_each(self, starts: Sequence[tuple[Model, Values]], *, rounds: int = Rule.rounds) -> list[Fit]:
        """`fit_each`, without what this search has fitted before from the same start: where an exchange of effects has
        changed nothing, all that is tried beside them was tried. Fits of contacts are made anew."""
        keys = [_start_of(model, values, rounds) for model, values in starts]
        known = {} if self.base.fit.model.problem.contacts is not None else self._made
        fresh = {key: start for key, start in zip(keys, starts, strict=True) if key not in known}
        known = known | dict(zip(fresh, fit_each(list(fresh.values()), rounds=rounds), strict=True))
        self._made |= {key: known[key] for key in fresh}
        return [known[key] for key in keys]

    def _try(self, start: Hypothesis, forms: Sequence[Form], *, most: int | None = None) -> list[Hypothesis]:
        """`start` with each of `forms` added, all refitted; `most`: only so many, those that leave least when begun."""
        fresh = [form for form in forms if form.id not in self._alone]
        found = dict(zip([f.id for f in fresh], best_starts(start.fit.model, fresh, start.fit.values), strict=True))
        begun: list[tuple[Form, Model, Values]] = []
        for form in forms:
            if form not in fresh:
                model: Model = start.fit.model.with_forms((*start.forms, form))
                begun += [(form, model, place) for place in self._places(start, form)]
        short: dict[str, Fit] = {}
        for (form, _, _), one in zip(begun, self._fit_each([(m, v) for _, m, v in begun], rounds=4), strict=True):
            if form.id not in short or one.objective < short[form.id].objective:
                short[form.id] = one
        kept = sorted(short, key=lambda id: short[id].objective)[:most]
        found |= dict(zip(kept, self._fit_each([(short[id].model, short[id].values) for id in kept]), strict=True))
        if not start.forms:
            self._alone |= found
        return [self._kept(found[form.id]) for form in forms if form.id in found]

    def _places(self, start: Hypothesis, form: Form) -> list[Values]:
        """Where a form may begin beside others: where it stood alone, and from a small amplitude."""
        amplitude, alone = form.amplitude, self._alone[form.id]
        values = {**{p.name: alone.values[p.name] for p in form.parameters}, **start.fit.values}
        places: list[Values] = [values, {**values, amplitude: _SMALL_PART * values[amplitude]}]
        if form.effect in start.effects and alone.model.problem.contacts is None:
            # Another form of the effect explains most already: a little of this one, in all its shapes.
            for own in form.starts:
                places += [{**start.fit.values, **own, amplitude: part * own[amplitude]} for part in _PARTS]
        return places

    def _singles(self) -> list[Hypothesis]:
        """The best form of each effect, the likeliest effect first."""
        model = self.base.fit.model
        forms = model.problem.forms
        contacts = model.problem.contacts
        if contacts is not None and forms:  # which looks for all of them together
            self.tell("looking for where the candidates' fits begin", 0.0)
            contacts.guess(model.with_forms(forms[:1]), self.base.fit.values)
        made: list[Hypothesis] = []
        effects = len({form.effect for form in forms})
        for place, (effect, group) in enumerate(groupby(forms, key=lambda form: form.effect), 1):
            own = list(group)
            self.tell(f"trying {effect} ({place} of {effects})", len(made) / max(1, len(forms)))
            self._fit_alone(own)
            made += [self._kept(self._alone[form.id]) for form in own]
        if contacts is not None:
            ranked = sorted((h.score for h in made), reverse=True)
            least = min(ranked[:_FINISHED][-1], ranked[0] - _NEAR_BY)
            for k, begun in enumerate(made):
                if begun.score > ranked[0] - BEHIND and begun.score >= least:
                    self.tell(f"fitting {forms[k].effect} ({forms[k].name})", k / len(forms))
                    made[k] = self._kept(fit(begun.fit.model, begun.fit.values))
                    self._alone[forms[k].id] = made[k].fit
        best: dict[str, Hypothesis] = {}
        for form, one in zip(forms, made, strict=True):
            if form.effect not in best or one.score > best[form.effect].score:
                best[form.effect] = one
        if contacts is None:
            best = {effect: self._from_its_like(one) for effect, one in best.items()}
        return sorted(best.values(), key=lambda h: -h.score)

    def _fit_alone(self, forms: Sequence[Form]) -> None:
        """Fit each of `forms` alone beside the base model."""
        base, found = self.base.fit, self._alone
        again = [form for form in forms if form.id in self._known and base.model.problem.contacts is None]
        fresh = [form for form in forms if form not in again]
        rounds = 6 if base.model.problem.contacts is None else 1
        begun = [(base.model.with_forms([form]), {**base.values, **self._known[form.id]}) for form in again]
        found |= dict(zip([form.id for form in again], fit_each(begun), strict=True))
        starts = best_starts(base.model, fresh, base.values, rounds=rounds)
        found |= dict(zip([form.id for form in fresh], starts, strict=True))

    @property
    def alone(self) -> dict[str, Values]:
        """Where each form ended alone, by its id."""
        return {id: found.values for id, found in self._alone.items()}

    def _base_again(self, first: Sequence[Hypothesis]) -> None:
        """Fit the base model again from where the best effects ended, which may be on another branch of a trial."""
        for one in first[:FOLLOWED]:
            if WORTH < one.score - self.base.score < BEHIND:
                found = fit(self.base.fit.model, one.fit.values)
                if found.objective < self.base.fit.objective - 1.0:
                    self.base = Hypothesis.of(found)

    def _from_its_like(self, one: Hypothesis) -> Hypothesis:
        """The best of the forms that share scales with this single form, begun where it ended."""
        best, (plain,) = one, one.forms
        if one.score < self.base.score + WORTH or _sums_to_little(one.fit):
            return one
        scales = {p.name for p in plain.parameters} - {plain.amplitude}
        for form in one.fit.model.problem.forms:
            if form is plain or form.effect != plain.effect or not scales & {p.name for p in form.parameters}:
                continue
            start = form.starts[0] if form.starts else {}
            values = {**start, **one.fit.values, form.amplitude: one.fit.values[plain.amplitude]}
            made = self._kept(fit(one.fit.model.with_forms([form]), values))
            if form.id not in self._alone or made.fit.objective < self._alone[form.id].objective:
                self._alone[form.id] = made.fit
            best = made if made.score > best.score else best
        return best

    def _bent(self, hypothesis: Hypothesis) -> Hypothesis:
        """With forms of another shape where that helps, begun where the plain forms ended."""
        best, shapes = hypothesis, hypothesis.fit.model.problem.shapes
        plain = list(hypothesis.forms) if hypothesis.score > self._most - BEHIND else []
        while plain:
            form, start = plain.pop(0), best
            if self.leaves_nothing(start):
                break
            for finer in shapes.get(form.id, ()):
                made = self._kept(self._fitted_bend(start.fit, form, finer))
                if made.score > max(best.score, start.score + 1.0):
                    best = made
                    if len(made.forms) == 1:
                        self._alone[finer.id] = made.fit
            plain += [made for made in best.forms if made not in start.forms]
        return best

    def _fitted_bend(self, start: Fit, plain: Form, finer: Form) -> Fit:
        """With the `finer` form in place of the plain one."""
        model = start.model.with_forms([finer if form is plain else form for form in start.model.forms])
        known = {p.name for p in plain.parameters}
        bends = dict.fromkeys(tuple((k, v) for k, v in point.items() if k not in known) for point in finer.starts)
        places: list[Values] = [{**start.values, **dict(bend)} for bend in bends]
        contacts = model.problem.contacts
        if contacts is not None:  # a bend alone may put trials on other branches: from their beginnings, too
            places += contacts.refine([model] * len(places), places)
        begun = self._fit_each([(model, values) for values in places], rounds=3)
        return self._fit_each([(model, min(begun, key=lambda one: one.objective).values)])[0]

    def _siblings(self, hypothesis: Hypothesis) -> list[Hypothesis]:
        """Other forms of a single effect, alone: when bent, one that was behind may overtake the leading form."""
        problem = hypothesis.fit.model.problem
        if len(hypothesis.forms) != 1 or problem.contacts is not None:
            return []
        shapes = problem.shapes.keys() & {form.id for form in problem.forms}
        found: dict[str, Hypothesis] = {}
        for tried in self.table:
            if len(tried.forms) != 1 or tried.effects != hypothesis.effects or tried.forms == hypothesis.forms:
                continue
            known = found.get(tried.forms[0].id)
            near = tried.score > hypothesis.score - BEHIND and (known is None or tried.score > known.score)
            if near and tried.forms[0].id in shapes:
                found[tried.forms[0].id] = tried
        return list(found.values())

    def _enriched(self, hypothesis: Hypothesis) -> Hypothesis:
        """With another shape or a second form of an effect, where that helps: nature's lies between the library's."""
        best = max([self._bent(one) for one in (hypothesis, *self._siblings(hypothesis))], key=lambda h: h.score)
        for _ in range(2):
            start = best
            if self.leaves_nothing(start):
                break
            taken = {p.name for form in start.forms for p in form.parameters}
            others = [
                form for form in start.fit.model.problem.forms
                if form.effect in start.effects and not any(p.name in taken for p in form.parameters)
            ]  # fmt: skip
            for made in self._try(start, others, most=_FINISHED):
                if made.score > best.score + 1.0:
                    best = made
            if best is start:
                break
        return best

    def _likeliest(self, best: Hypothesis, tried: Sequence[Hypothesis]) -> Hypothesis:
        """The likeliest of `tried`, with the noise that shows where the least is left."""
        first = max(tried, key=lambda h: h.score)
        least = min(tried, key=lambda h: h.fit.objective)
        pair = self._in_its_noise(first, least) if least is not first else None
        return least if pair is not None and pair[1].score > pair[0].score else first

    def _in_its_noise(self, one: Hypothesis, other: Hypothesis) -> tuple[Hypothesis, Hypothesis] | None:
        """Both scored with the noise that `other` leaves; None where that is the noise they were scored with."""
        found = self._recoloured(other.fit) if self._recoloured is not None else other.fit
        if found is other.fit:
            return None
        same = fit(replace(one.fit.model, whitener=found.model.whitener), one.fit.values)
        return Hypothesis.of(same), Hypothesis.of(found)

    def _begun(self, model: Model, starts: Sequence[FormsStart]) -> list[Hypothesis]:
        """Fits of what `starts` add to `model`; the most promising in full."""
        places = [start.values for start in starts]
        models = [model.with_forms((*model.forms, *start.forms)) for start in starts]
        contacts = model.problem.contacts
        if contacts is not None and starts:  # a search of its own, after which the better half goes on
            places = list(contacts.refine(models, places))
            left = [float(np.square(one.evaluate([point])[0]).sum()) for one, point in zip(models, places, strict=True)]
            kept = sorted(range(len(left)), key=lambda k: left[k])[: max(FOLLOWED, (len(left) + 1) // 2)]
            models, places = [models[k] for k in kept], [places[k] for k in kept]
        for share in (0.4, 0.7) if model.problem.rough else ():
            part = fit_each([(one.until(share), v) for one, v in zip(models, places, strict=True)], rounds=6)
            places = [one.values for one in part]
        begun = self._fit_each(list(zip(models, places, strict=True)), rounds=5)
        begun.sort(key=lambda found: found.objective)
        return [self._kept(found) for found in self._fit_each([(one.model, one.values) for one in begun[:FOLLOWED]])]

    def _in_all_forms(self) -> list[Hypothesis]:
        """Fits of pairs of effects on smooth trials: those pairs that leave least, in their best forms, bent or not.

        What a form leaves while it is straight, or while the other effect is missing, does not show how well the two
        do together: each form of an effect is kept with its best partner, and bent with it, before any is dropped.
        """
        base = self.base.fit
        if self._known_pairs:
            known = [(base.model.with_forms(one.forms), {**base.values, **one.values}) for one in self._known_pairs]
            return [self._kept(found) for found in fit_each(known)]
        starts = pair_starts(base.model, base.values, base.model.problem.forms, most=_EVERY, every_form=True)
        begun = fit_each([(base.model.with_forms(start.forms), start.values) for start in starts], rounds=_ROUNDS)
        pairs: dict[tuple[str, ...], list[Fit]] = {}
        for found in sorted(begun, key=lambda one: one.objective):
            pairs.setdefault(tuple(form.effect for form in found.model.forms), []).append(found)
        near: list[list[Fit]] = []
        for own in list(pairs.values())[:_BENT_PAIRS]:
            partners: dict[str, Fit] = {}
            for found in own:
                for form in found.model.forms:
                    partners.setdefault(form.id, found)
            kept = list({id(found): found for found in partners.values()}.values())
            bent = fit_each([start for found in kept for start in _bends(found)], rounds=_ROUNDS_BENT)
            near.append(sorted((*kept, *bent), key=lambda one: one.objective)[:2])
        near.sort(key=lambda own: own[0].objective)
        finished = fit_each([(one.model, one.values) for own in near[:FOLLOWED] for one in own])
        self.pairs = tuple(FormsStart(one.model.forms, one.values) for one in finished)
        return [self._kept(found) for found in finished]

    def _best_forms(self, effect: str) -> list[Form]:
        """Forms of an effect, the one that did best alone first."""
        alone = [h for h in self.table if len(h.forms) == 1 and h.effects == (effect,)]
        return [h.forms[0] for h in sorted(alone, key=lambda h: -h.score)]


def _start_of(model: Model, values: Values, rounds: int) -> tuple[object, ...]:
    """What a fit in a search follows from: its forms, noise, numbers and steps."""
    numbers = tuple(values.get(p.name, p.value) for p in model.parameters)
    return (*(form.id for form in model.forms), id(model.whitener), model.trials, model.share, numbers, rounds)


def _bends(found: Fit) -> list[tuple[Model, Values]]:
    """Where each form of a fit begins in another shape, one at a time."""
    begun: list[tuple[Model, Values]] = []
    forms = found.model.forms
    for form in forms:
        known = {p.name for p in form.parameters}
        for finer in found.model.problem.shapes.get(form.id, ()):
            model = found.model.with_forms([finer if one is form else one for one in forms])
            places = dict.fromkeys(tuple((k, v) for k, v in point.items() if k not in known) for point in finer.starts)
            begun += [(model, {**found.values, **dict(place)}) for place in places]
    return begun


def _sums_to_little(found: Fit) -> bool:
    """Whether chi-square over all samples leaves too little for another shape."""
    return bool(excess(found) < _SEEN * np.sqrt(2.0 * found.count))
