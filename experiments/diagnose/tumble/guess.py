"""Where fits of tumbles should begin: near the best values, on the branch that was measured.

The statistics' own fits are local. Contact makes the likelihood of a tumble jump, so before them stands a search of its
own (`tumble_fit`): growing horizons, several starts, a scan of each trial's gravity. All candidates of one round are
looked for together, so that the batched model has its hands full.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from experiments.diagnose.fit.problem import Array, Form, Parameter, Values

from .data import TumbleData
from .fit import Fit, Fitter
from .forward import SHARED, Forward
from .steps import Start

__all__ = ["Guesser"]

_STEP = 1e-3  # of the integration while looking [s]; what follows is finer
_THIN = 5
_GROWING = (0.3, 0.6, 1.0)
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


def _thinned(data: TumbleData) -> TumbleData:
    """Every fifth reading of the wheel, which is fast and says little, and all of the rest."""
    trials = []
    for trial in data.trials:
        keep = ~trial.of("wheel")
        keep[np.flatnonzero(~keep)[::_THIN]] = True
        kept = {name: getattr(trial, name)[keep] for name in ("time", "value", "std", "channel")}
        trials.append(replace(trial, **kept))
    return replace(data, trials=tuple(trials))


def _kinds(apart: Sequence[Parameter]) -> tuple[str, ...]:
    """What is fitted to single trials, and within which prior."""
    return tuple(dict.fromkeys(f"{p.kind} {p.std:.4g}" for p in apart))


def _alike(form: Form, one: Fit, other: Fit) -> bool:
    """Whether two fits of one form have come to the same place, as nearly as fits end."""
    if abs(one.cost - other.cost) > _SAME * max(one.cost, other.cost):
        return False
    return all(abs(one.values[p.name] - other.values[p.name]) <= _NEAR_BY * p.scale for p in form.parameters)


class Guesser:
    """Guesses for one campaign. They are kept: the same question is answered once."""

    def __init__(self, forward: Forward, forms: Sequence[Form]) -> None:
        self.forward = Forward(_thinned(forward.data), time_step=_STEP, threads=forward.threads, own=forward.own)
        self.forms = tuple(forms)
        self._ids = [trial.id for trial in forward.data.trials]
        self._stated = [trial.gravity_sim for trial in forward.data.trials]
        self._kept: dict[tuple[object, ...], dict[str, Fit]] = {}
        self._warm: dict[tuple[str, ...], tuple[dict[str, float], float]] = {}

    def guess(
        self, forms: Sequence[Form], trials: Sequence[str], values: Values, *, held: bool = False,
        apart: Sequence[Parameter] = (),
    ) -> dict[str, float]:  # fmt: skip
        """Values near the best for the base model with `forms` on `trials`, beginning from `values`: see `Contacts`."""
        fitter = Fitter(self.forward, trials=[self._ids.index(trial) for trial in trials])
        start = self._start(forms, values, apart)
        if held:
            names = {*SHARED, *(p.name for form in forms for p in form.parameters)}
            fixed = replace(start, frozen=frozenset(names), scan=True)
            return self._told(fitter.fit([fixed])[0], trials, values)
        new = [form for form in forms if any(p.name not in values for p in form.parameters)]
        if not new:
            return self._told(self._base(fitter, start), trials, values)
        old = [form for form in forms if form not in new]
        whose = tuple(form.id for form in new) if len(new) > 1 else ()
        key = (tuple(form.id for form in old), tuple(trials), whose, *_kinds(apart))
        if key not in self._kept:
            self._kept[key] = {}
        kept = self._kept[key]
        if new[-1].id not in kept:
            others = [form for form in self.forms if form.effect not in {f.effect for f in forms}]
            candidates = [*others, *(f for f in self.forms if f.effect == new[-1].effect)] if not old else [new[-1]]
            if len(new) > 1:
                candidates = [new[-1]]
            kept |= self._candidates(fitter, old + new[:-1], candidates, start)
        return self._told(kept[new[-1].id], trials, values)

    def refine(
        self, asked: Sequence[tuple[Sequence[Form], Values]], trials: Sequence[str],
        *, apart: Sequence[Parameter] = (),
    ) -> list[dict[str, float]]:  # fmt: skip
        """Values near the best for each (forms, values): from there, and from nominal numbers over growing horizons."""
        fitter = Fitter(self.forward, trials=[self._ids.index(trial) for trial in trials])
        starts = []
        for forms, values in asked:
            own = {p.name: values[p.name] for form in forms for p in form.parameters}
            starts.append(Start(forms=tuple(forms), values=own, scan=True, horizons=_GROWING, apart=tuple(apart)))
            starts.append(self._start(forms, values, apart))
        few = len(asked) <= _ALL_THE_WAY
        fits = fitter.fit(starts, steps=_MORE_ROUNDS if few else _ROUNDS)
        best = [min(pair, key=lambda fit: fit.cost) for pair in zip(fits[::2], fits[1::2], strict=True)]
        if not few:  # of many only the most promising go on
            going = sorted(range(len(best)), key=lambda k: best[k].cost)[:_ALL_THE_WAY]
            more = [Start(forms=best[k].forms, values=best[k].values, gravity=best[k].gravity, apart=tuple(apart))
                    for k in going]  # fmt: skip
            for k, found in zip(going, fitter.fit(more, steps=_MORE_ROUNDS - _ROUNDS), strict=True):
                best[k] = min(best[k], found, key=lambda fit: fit.cost)
        return [self._told(found, trials, values) for found, (_, values) in zip(best, asked, strict=True)]

    def _start(self, forms: Sequence[Form], values: Values, apart: Sequence[Parameter]) -> Start:
        gravity = np.array(
            [values.get(f"gravity_sim[{i}]", g) / g for i, g in zip(self._ids, self._stated, strict=True)]
        )
        known = {*SHARED, *(p.name for form in forms for p in form.parameters), *(p.name for p in apart)}
        return Start(
            forms=tuple(forms), values={name: v for name, v in values.items() if name in known}, gravity=gravity,
            apart=tuple(apart),
        )  # fmt: skip

    def _told(self, found: Fit, trials: Sequence[str], values: Values) -> dict[str, float]:
        told = {**values, **found.values}
        for trial in trials:
            k = self._ids.index(trial)
            told[f"gravity_sim[{trial}]"] = float(found.gravity[k]) * self._stated[k]
        return told

    def _base(self, fitter: Fitter, start: Start) -> Fit:
        random = np.random.default_rng(0)

        def drawn() -> Mapping[str, float]:
            values = dict(start.values)
            for name in SHARED:
                if fitter.sigma[name] > 0:
                    z = float(np.clip(random.standard_normal(), -2.5, 2.5))
                    values[name] = self.forward.nominal[name] * (1 + fitter.sigma[name] * z)
            return values

        def begin(values: Mapping[str, float], horizons: tuple[float, ...]) -> Start:
            return replace(start, values=values, scan=True, horizons=horizons)

        def poor(found: Fit, limit: float) -> bool:
            return found.cost > limit * sum(len(r) for r in found.residuals)

        key = (*(form.id for form in start.forms), *_kinds(start.apart))
        if key in self._warm:  # found before, on other trials
            before, limit = self._warm[key]
            values = {name: start.values.get(name, value) for name, value in before.items()}
            (again,) = fitter.fit([begin(values, (1.0,))])
            if not poor(again, limit):
                return again
        (best,) = fitter.fit([begin(start.values, _GROWING)], steps=15)
        if poor(best, _POOR):
            others = [begin(start.values, (1.0,)), begin(drawn(), _GROWING), begin(drawn(), _GROWING)]
            best = min([best, *fitter.fit(others, steps=15)], key=lambda found: found.cost)
        if poor(best, _POOR):
            best = min([best, *fitter.fit(self._rubbing(fitter, best, start), steps=15)], key=lambda found: found.cost)
        size = best.cost / sum(len(r) for r in best.residuals)
        self._warm[key] = ({name: best.values[name] for name in SHARED}, max(_POOR, 1.3 * size))
        return best

    def _rubbing(self, fitter: Fitter, found: Fit, start: Start) -> list[Start]:
        """Starts where this fit ended, but with both coefficients of friction as stated, or nearly so.

        They decide what sticks and what slips: where a trial is on a branch that was not measured they are drawn away
        to keep it there, for all trials, and what else is known by then finds the measured one without them.
        """
        rubs = {name: self.forward.nominal[name] for name in ("mu_s", "mu_d")}
        places = [{**rubs, "mu_s": rubs["mu_s"] * (1 + z * fitter.sigma["mu_s"])} for z in _AWAY]
        known = {**start.values, **found.values}
        return [replace(start, values=known | place, gravity=found.gravity, scan=True, horizons=_GROWING)
                for place in (places if fitter.sigma["mu_s"] > 0 else places[:1])]  # fmt: skip

    def _candidates(self, fitter: Fitter, old: Sequence[Form], forms: Sequence[Form], start: Start) -> dict[str, Fit]:
        """The best fit found for each form added to `old`."""
        begun = [(form, point) for form in forms for point in form.starts]
        best: dict[str, Fit] = {}

        def keep(whose: Sequence[Form], fits: Sequence[Fit]) -> None:
            for form, found in zip(whose, fits, strict=True):
                if form.id not in best or found.cost < best[form.id].cost:
                    best[form.id] = found

        (now,) = [fitter.residuals([self._point(start)], tuple(old))]
        size = sum(float(rows[0] @ rows[0]) for rows in now) / max(1, sum(rows.shape[1] for rows in now))
        if old or size < _NEAR:
            chosen = self._screened(fitter, old, begun, start)
            fits = fitter.fit([self._add(start, old, form, values) for form, values in chosen], steps=12 if old else 7)
            keep([form for form, _ in chosen], fits)
        if old:  # beside what was found already the way is short
            return best
        bare = Start(apart=start.apart)
        self._race(fitter, begun, bare, keep)
        left = [form for form in forms if form.id not in best]  # given up on the way: told as they stand
        places = {form.id: point for form, point in reversed(begun)}
        keep(left, fitter.fit([self._add(bare, (), form, places[form.id]) for form in left], steps=2))
        return best

    def _race(
        self, fitter: Fitter, begun: Sequence[tuple[Form, Values]], bare: Start,
        keep: Callable[[Sequence[Form], Sequence[Fit]], None],
    ) -> None:  # fmt: skip
        """Every form from all its starts and nominal numbers, over growing horizons; on the way most drop out.

        A base model that lacks something plain stands on branches of its own, from which no effect is found: so all
        begin where every branch is the same.
        """
        running = [(form, self._add(bare, (), form, point, horizons=_GROWING[:1])) for form, point in begun]
        for following in (*_GROWING[1:], 1.0):
            fits = fitter.fit([start for _, start in running], steps=_ROUNDS)
            seen = max(1, sum(int(np.count_nonzero(rows)) for rows in fits[0].residuals))
            limit = _HOPELESS * max(min(fit.cost for fit in fits), float(seen))
            order = sorted(range(len(fits)), key=lambda k: fits[k].cost)
            effects = list(dict.fromkeys(running[k][0].effect for k in order))
            last = running[0][1].horizons[-1] >= 1
            if last:
                keep([form for form, _ in running], fits)
            each: dict[str, list[Fit]] = {}
            longer = []
            for k in order:
                form, found = running[k][0], fits[k]
                if any(_alike(form, found, other) for other in each.get(form.id, ())):
                    continue  # from there on two would go one way
                each.setdefault(form.id, []).append(found)
                most, alike = (len(effects), 2) if following < 1 else (_FOLLOWED, 1 if last else 2)
                if len(each[form.id]) <= alike and form.effect in effects[:most] and found.cost <= limit:
                    start = Start(forms=(form,), values=found.values, gravity=found.gravity, scan=not last,
                                  horizons=(following,), apart=bare.apart)  # fmt: skip
                    longer.append((form, start))
            running = longer
        keep([form for form, _ in running], fitter.fit([start for _, start in running], steps=_MORE_ROUNDS))

    def _point(self, start: Start) -> tuple[dict[str, float], Array]:
        return dict(start.values), np.ones(len(self._ids)) if start.gravity is None else start.gravity

    def _add(
        self, start: Start, old: Sequence[Form], form: Form, values: Values,
        *, horizons: tuple[float, ...] = (1.0,),
    ) -> Start:  # fmt: skip
        return Start(
            forms=(*old, form), values={**start.values, **values}, gravity=start.gravity,
            scan=len(horizons) > 1, horizons=horizons, apart=start.apart,
        )  # fmt: skip

    def _screened(
        self, fitter: Fitter, old: Sequence[Form], begun: Sequence[tuple[Form, Values]], start: Start
    ) -> list[tuple[Form, dict[str, float]]]:
        """For each form the start from which a linear step, the base model's included, promises most."""
        space = fitter.linearised(replace(start, forms=tuple(old)))
        gravity = np.ones(len(self._ids)) if start.gravity is None else start.gravity
        answers = fitter.signatures([((*old, form), {**start.values, **point}, gravity) for form, point in begun])
        best: dict[str, tuple[float, Form, dict[str, float]]] = {}
        for (form, point), residuals in zip(begun, answers, strict=True):
            gain, share = space.promise(residuals)
            share = float(np.clip(share, 0.1, 4.0))
            scaled = dict(point)
            for p in form.parameters:
                if p.name in point and not np.isfinite(p.std):
                    scaled[p.name] = float(np.clip(share * point[p.name], p.lowest, p.highest))
            if form.id not in best or gain > best[form.id][0]:
                best[form.id] = (gain, form, scaled)
        return [(form, values) for _, form, values in best.values()]
