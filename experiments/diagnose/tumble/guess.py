"""Where fits of tumbles should begin: near the best values, on the branch that was measured.

The statistics' own fits are local. Contact makes the likelihood of a tumble jump, so before them stands a search
(`SEARCH` in `experiments.diagnose.fit.fitting`): growing horizons, several starts, a scan of each trial's gravity. All
candidates of one round are looked for together, so that the batched model has its hands full.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from experiments.diagnose.fit.fitting import SEARCH, Fit, Linear, Model, Rule, Whitener, fits
from experiments.diagnose.fit.problem import Form, Problem, Values, evaluate_all

__all__ = ["Guesser"]

_GROWING = (0.3, 0.6, 1.0)
_LONGER = replace(SEARCH, scan=True, shares=_GROWING)
_POOR = 1.1  # chi-square per sample beyond which the base model is looked for from more places
_AWAY = (0.0, 1.0, -1.0)
"""Standard deviations of mu_s from which the base model is fitted once more where it leaves something."""
_NEAR = 2.0  # chi-square per sample up to which the base model's fit is near enough to begin from
_FOLLOWED = 8  # effects that are looked for over the whole of every trial
_ROUNDS, _MORE_ROUNDS = 6, 12
"""Steps over the whole of every trial, of all that are followed and of those that are near the best."""
_ALL_THE_WAY = 4  # so many sets of effects at a time are refined with as many steps as are followed to the end
_SAME, _NEAR_BY = 0.003, 0.05
"""Of their cost, and of the scale of a form's parameters, by which two fits may differ that have come to one place."""
_HOPELESS = 30.0  # times the best one's chi-square, over part of a trial, beyond which a start is given up


def _kinds(model: Model) -> tuple[str, ...]:
    """What is fitted to single trials beside gravity, and within which prior."""
    return tuple(dict.fromkeys(f"{p.kind} {p.std:.4g}" for p in model.scatter if p.trial in model.trials))


def _alike(form: Form, one: Fit, other: Fit) -> bool:
    """Whether two fits of one form have come to the same place, as nearly as fits end."""
    if abs(one.objective - other.objective) > _SAME * max(one.objective, other.objective):
        return False
    return all(abs(one.values[p.name] - other.values[p.name]) <= _NEAR_BY * p.scale for p in form.parameters)


class Guesser:
    """Guesses for one campaign. They are kept: the same question is answered once."""

    def __init__(self, problem: Problem, forms: Sequence[Form]) -> None:
        """`problem`: of the same campaign, thinned and coarse."""
        self.problem, self.forms = problem, tuple(forms)
        self._whitener = Whitener.none(problem)
        self._shared = tuple(p for p in problem.base if p.trial is None)
        self._kept: dict[tuple[object, ...], dict[str, Fit]] = {}
        self._warm: dict[tuple[str, ...], tuple[dict[str, float], float]] = {}

    def _coarse(self, model: Model) -> Model:
        return replace(model, problem=self.problem, whitener=self._whitener)

    def guess(self, model: Model, values: Values) -> dict[str, float]:
        """Values near the best, beginning from `values`: see `Contacts`."""
        forms, search = model.forms, self._coarse(model)
        if model.held is not None:
            return {**values, **fits([(search, values, replace(SEARCH, scan=True))])[0].values}
        new = [form for form in forms if any(p.name not in values for p in form.parameters)]
        if not new:
            return {**values, **self._base(search, values).values}
        old = [form for form in forms if form not in new]
        whose = tuple(form.id for form in new) if len(new) > 1 else ()
        kept = self._kept.setdefault((tuple(form.id for form in old), model.trials, whose, *_kinds(model)), {})
        if new[-1].id not in kept:
            others = [form for form in self.forms if form.effect not in {f.effect for f in forms}]
            candidates = [*others, *(f for f in self.forms if f.effect == new[-1].effect)] if not old else [new[-1]]
            if len(new) > 1:
                candidates = [new[-1]]
            kept |= self._candidates(search.with_forms(old + new[:-1]), candidates, values)
        return {**values, **kept[new[-1].id].values}

    def refine(self, models: Sequence[Model], values: Sequence[Values]) -> list[dict[str, float]]:
        """Values near the best for each model: from there, and from nominal numbers over growing horizons."""
        few = len(models) <= _ALL_THE_WAY
        rounds = _MORE_ROUNDS if few else _ROUNDS
        starts: list[tuple[Model, Values, Rule]] = []
        for model, here in zip(map(self._coarse, models), values, strict=True):
            own = {p.name: here[p.name] for form in model.forms for p in form.parameters}
            starts += [(model, own, replace(_LONGER, rounds=rounds)), (model, here, replace(SEARCH, rounds=rounds))]
        found = fits(starts)
        best = [min(pair, key=lambda fit: fit.objective) for pair in zip(found[::2], found[1::2], strict=True)]
        if not few:  # of many only the most promising go on
            going = sorted(range(len(best)), key=lambda k: best[k].objective)[:_ALL_THE_WAY]
            rule = replace(SEARCH, rounds=_MORE_ROUNDS - _ROUNDS)
            for k, more in zip(going, fits([(best[k].model, best[k].values, rule) for k in going]), strict=True):
                best[k] = min(best[k], more, key=lambda fit: fit.objective)
        return [{**here, **one.values} for one, here in zip(best, values, strict=True)]

    def race(self, models: Sequence[Model], values: Sequence[Values], *, most: int) -> list[tuple[int, Values]]:
        """Which models follow the beginnings best: see `Contacts`. Two growing horizons, each with some steps."""
        running = list(enumerate(zip(map(self._coarse, models), values, strict=True)))
        for share, going in zip(_GROWING[:-1], (2 * most, most), strict=True):
            rule = replace(SEARCH, rounds=_ROUNDS, shares=(share,))
            found = fits([(model, here, rule) for _, (model, here) in running])
            order = sorted(range(len(found)), key=lambda k: found[k].objective)[:going]
            running = [(running[k][0], (found[k].model, found[k].values)) for k in order]
        return [(place, {**values[place], **found}) for place, (_, found) in running]

    def _base(self, model: Model, begun: Values) -> Fit:
        random = np.random.default_rng(0)

        def drawn() -> Values:
            z = {p.name: float(np.clip(random.standard_normal(), -2.5, 2.5)) for p in self._shared}
            return {**begun, **{p.name: p.value + p.std * z[p.name] for p in self._shared}}

        def poor(found: Fit, limit: float) -> bool:
            return found.objective > limit * found.count

        key = (*(form.id for form in model.forms), *_kinds(model))
        longer, at_once = replace(_LONGER, rounds=15), replace(SEARCH, scan=True)
        if key in self._warm:  # found before, on other trials
            before, limit = self._warm[key]
            stated = [p.name for p in self.problem.base if p.name in begun]
            (again,) = fits([(model, {**before, **{name: begun[name] for name in stated}}, at_once)])
            if not poor(again, limit):
                return again
        (best,) = fits([(model, begun, longer)])
        if poor(best, _POOR):
            others = [(begun, replace(at_once, rounds=15)), (drawn(), longer), (drawn(), longer)]
            best = min([best, *fits([(model, *other) for other in others])], key=lambda found: found.objective)
        if poor(best, _POOR):
            others = [(place, longer) for place in self._rubbing(best, begun)]
            best = min([best, *fits([(model, *other) for other in others])], key=lambda found: found.objective)
        size = best.objective / best.count
        self._warm[key] = ({p.name: best.values[p.name] for p in self._shared}, max(_POOR, 1.3 * size))
        return best

    def _rubbing(self, found: Fit, begun: Values) -> list[Values]:
        """Places where this fit ended, but with both coefficients of friction as stated, or nearly so.

        They decide what sticks and what slips: where a trial is on a branch that was not measured they are drawn away
        to keep it there, for all trials, and what else is known by then finds the measured one without them.
        """
        rubs = {p.name: p for p in self._shared if p.name in ("mu_s", "mu_d")}
        known, sticks = {**begun, **found.values, **{name: p.value for name, p in rubs.items()}}, rubs.get("mu_s")
        return [{**known, "mu_s": sticks.value + z * sticks.std} for z in _AWAY] if sticks else [known]

    def _candidates(self, model: Model, forms: Sequence[Form], begun: Values) -> dict[str, Fit]:
        """The best fit found for each form added to those of `model`."""
        starts = [(form, point) for form in forms for point in form.starts]
        best: dict[str, Fit] = {}

        def keep(found: Sequence[Fit]) -> None:
            for one in found:
                id = one.model.forms[-1].id
                if id not in best or one.objective < best[id].objective:
                    best[id] = one

        old = model.forms
        (now,) = model.evaluate([{p.name: begun.get(p.name, p.value) for p in model.parameters}])
        if old or float(now @ now) < _NEAR * len(now):
            rule = replace(SEARCH, rounds=12 if old else 7)
            keep(fits([(one, {**begun, **values}, rule) for one, values in self._screened(model, starts, begun)]))
        if old:  # beside what was found already the way is short
            return best
        self._race(model, starts, keep)
        places = {
            form.id: (model.with_forms([form]), point, replace(SEARCH, rounds=2)) for form, point in reversed(starts)
        }
        left = [form.id for form in forms if form.id not in best]  # given up on the way: reported as they are
        keep(fits([places[id] for id in left]))
        return best

    def _race(self, model: Model, starts: Sequence[tuple[Form, Values]], keep: Callable[[Sequence[Fit]], None]) -> None:
        """Every form from all its starts and nominal numbers, over growing horizons; on the way most drop out.

        A base model that misses something plain stands on branches of its own, from which no effect is found: so all
        begin where every branch is the same.
        """
        rule = replace(SEARCH, rounds=_ROUNDS, shares=_GROWING[:1])
        running: list[tuple[Model, Values]] = [(model.with_forms([form]), point) for form, point in starts]
        for following in (*_GROWING[1:], 1.0):
            found = fits([(*one, rule) for one in running])
            seen = max(1.0, float(np.count_nonzero(found[0].modes)))
            limit = _HOPELESS * max(min(one.objective for one in found), seen)
            found.sort(key=lambda one: one.objective)
            effects = list(dict.fromkeys(one.model.forms[0].effect for one in found))
            last = rule.shares[-1] >= 1
            if last:
                keep(found)
            going: dict[str, list[Fit]] = {}
            running = []
            for one in found:
                (form,) = one.model.forms
                if any(_alike(form, one, other) for other in going.get(form.id, ())):
                    continue  # from there on two would go one way
                going.setdefault(form.id, []).append(one)
                most, alike = (len(effects), 2) if following < 1 else (_FOLLOWED, 1 if last else 2)
                if len(going[form.id]) <= alike and form.effect in effects[:most] and one.objective <= limit:
                    running.append((one.model, one.values))
            rule = replace(rule, scan=not last, shares=(following,))
        keep(fits([(*one, replace(rule, rounds=_MORE_ROUNDS)) for one in running]))

    def _screened(
        self, model: Model, starts: Sequence[tuple[Form, Values]], begun: Values
    ) -> list[tuple[Model, dict[str, float]]]:
        """For each form the start from which a linear step, the base model's included, promises most."""
        known = {p.name: begun.get(p.name, p.value) for p in model.parameters}
        linear = Linear.of(model, known)
        added = [(model.with_forms((*model.forms, form)), {**known, **point}) for form, point in starts]
        changes = np.stack([modes - linear.modes for (modes,) in evaluate_all([(m, [p]) for m, p in added])], axis=1)
        gram, along, _ = linear.projected(changes)
        best: dict[str, tuple[float, Model, dict[str, float]]] = {}
        for (form, point), (longer, _), size, slope in zip(starts, added, np.diag(gram), along, strict=True):
            # What chi-square would lose if the change were free in size, and that size.
            gain = slope**2 / size if size > 0 and slope < 0 else 0.0
            share = float(np.clip(-slope / size if size > 0 else 0.0, 0.1, 4.0))
            scaled = dict(point)
            for p in form.parameters:
                if p.name in point and not np.isfinite(p.std):
                    scaled[p.name] = float(np.clip(share * point[p.name], p.lowest, p.highest))
            if form.id not in best or gain > best[form.id][0]:
                best[form.id] = (gain, longer, scaled)
        return [(longer, values) for _, longer, values in best.values()]
