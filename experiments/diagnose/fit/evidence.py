"""How well a set of effects explains a campaign, and how one is weighed against another.

A real effect never has exactly the library's form, so a model may be right in name and still leave what the sensors can
see. Evidence that counts every sample as independent would then choose by details of form. Here what is left beyond the
noise, E = chi-square - samples, is taken for slow modes of unknown size: with M such modes the log likelihood is
-(M / 2) ln(1 + E / M). It is -E / 2 while E is small, and falls only with the logarithm of the misfit when it is large
(a variance of unknown scale integrated out). Laplace's factor for the parameters' volume is added to it.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from .fitting import Fit, Model, fit, fit_each, scanned
from .gate import column_basis, low_modes
from .problem import Array, Form, Values

__all__ = [
    "SMALL", "Hypothesis", "best_starts", "excess", "held_out_fit", "inflation", "score", "signature_matrix",
    "slow_count", "tempered",
]  # fmt: skip

SMALL = 1.2  # chi-square per sample up to which what is left is too small to be called unknown, or to be given a name
_MODES_EACH = 6
"""Slow modes that a misfit of form has in one channel of one trial; it is alike from trial to trial, so that their
number is taken to grow with the square root of the number of channels."""
_MOST_OCCAM = 7.0
"""What one form's parameters can cost at most [nats]: a misfit of form makes Laplace's volumes too small."""


@dataclass(frozen=True)
class Hypothesis:
    """A set of effects, each in one form or two, fitted to the trials that choose."""

    fit: Fit
    score: float  # log evidence, tempered [nats]

    @staticmethod
    def of(found: Fit) -> "Hypothesis":
        """With its score."""
        return Hypothesis(found, score(found))

    @property
    def forms(self) -> tuple[Form, ...]:
        """All forms."""
        return self.fit.model.forms

    @property
    def effects(self) -> tuple[str, ...]:
        """Names in order, each once."""
        return tuple(dict.fromkeys(form.effect for form in self.forms))

    def without(self, effect: str) -> tuple[Form, ...]:
        """The forms of all effects but one."""
        return tuple(form for form in self.forms if form.effect != effect)


def excess(found: Fit) -> float:
    """Chi-square (priors included) beyond the number of samples that are left over by the parameters."""
    return found.objective - (found.count - int(found.free.sum()))


def slow_count(found: Fit) -> float:
    """M: how many slow modes a misfit of form is taken to have."""
    return max(10.0, _MODES_EACH * math.sqrt(len(low_modes(found.model))))


def tempered(left: float, modes: float) -> float:
    """Log likelihood of an excess of chi-square, taken for `modes` modes of unknown size [nats]."""
    return -0.5 * modes * math.log1p(left / modes) if left > 0 else -0.5 * left


def inflation(found: Fit) -> float:
    """Factor on standard errors: a misfit of form, E in M slow modes, makes the power of each 1 + E / M.

    What chance alone brings, two standard deviations of chi-square, does not count.
    """
    modes = slow_count(found)
    left = max(excess(found) - 2 * math.sqrt(2.0 * found.count), 0.0)
    return math.sqrt(1 + left / modes)


def score(found: Fit) -> float:
    """Tempered log evidence, up to what is common to models of one campaign [nats]."""
    likelihood = tempered(excess(found), slow_count(found))
    parameters = found.model.parameters
    shared = np.array([p.trial is None and "." in p.name for p in parameters])
    precision, hessian = found.prior_precision(), np.diag(found.hessian())
    # Per form parameter: half the log of how much the data narrow its prior.
    cost = 0.0
    for form in found.model.forms:
        own = 0.0
        for k, p in enumerate(parameters):
            if shared[k] and found.free[k] and precision[k] > 0 and any(p.name == q.name for q in form.parameters):
                own += 0.5 * math.log(max(hessian[k] / precision[k], 1.0))
        cost += min(own, _MOST_OCCAM)
    return likelihood - cost


_PLACES = 8  # signs of the amplitude, lengths and other numbers from which a form is fitted, at most
_SIZES = (0.1, 0.4, 1.0, 3.0)
_FIRST = 0.2


def best_starts(model: Model, forms: Sequence[Form], values: Values, *, rounds: int = 6) -> list[Fit]:
    """The best fit of `model` with each of `forms` added, over the form's starts, in several sizes of the amplitude.

    The other values are those given, and those of the priors: a base model from which an effect is missing bends its
    parameters, and what replicates differ by first of all.
    `rounds`: steps, where the problem looks for the best start itself.
    """
    models = [model.with_forms((*model.forms, form)) for form in forms]
    if model.problem.contacts is not None:
        return fit_each([(one, values) for one in models], rounds=rounds)
    points = [_start_points(one, form, values) for one, form in zip(models, forms, strict=True)]
    begun = [(k, one, point) for k, one in enumerate(models) for point in _promising(one, *points[k])]
    short = fit_each([(one, point) for _, one, point in begun], rounds=5)
    best: dict[int, Fit] = {}
    for (k, _, _), found in zip(begun, short, strict=True):
        if k not in best or found.objective < best[k].objective:
            best[k] = found
    whole = fit_each([(one, best[k].values) for k, one in enumerate(models)])
    return _from_beginnings(whole, [own for own, _ in points])


def _start_points(model: Model, form: Form, values: Values) -> tuple[list[Values], list[tuple[float, ...]]]:
    """Points from which a form may be fitted, and of which start each is."""
    starts = form.starts or ({form.amplitude: 1.0},)
    amplitude = next(p for p in form.parameters if p.name == form.amplitude)
    known = {p.name: p.value for p in (*model.problem.base, *model.scatter) if math.isfinite(p.std)}
    points: list[Values] = []
    places: list[tuple[float, ...]] = []
    for start in starts:
        place = tuple(math.copysign(1.0, v) if name == form.amplitude else v for name, v in start.items())
        for size in _SIZES:
            value = float(np.clip(size * start[form.amplitude], amplitude.lowest, 0.95 * amplitude.highest))
            for others in (values, {**values, **known}) if known else (values,):
                points.append({**others, **start, form.amplitude: value})
                places.append(place)
    return points, places


def _promising(model: Model, points: Sequence[Values], places: Sequence[tuple[float, ...]]) -> list[Values]:
    """The points that leave least, of several starts."""
    order = np.argsort([float(modes @ modes) for modes in model.evaluate(points)])
    chosen: list[int] = []
    for k in order.tolist():  # of each place one: an amplitude hardly goes through zero
        if len(chosen) < _PLACES and all(places[k] != places[c] for c in chosen):
            chosen.append(k)
    for k in order.tolist():  # and the next best that is not of the same start
        if len(chosen) < 3 and all(abs(k - c) >= 2 for c in chosen):
            chosen.append(k)
    return [points[k] for k in chosen]


def _from_beginnings(found: Sequence[Fit], points: Sequence[Sequence[Values]]) -> list[Fit]:
    """The better of each fit and one that looks at the beginning of rough trials first, where much is left."""
    best = list(found)
    rough = [
        k for k, one in enumerate(best)
        if one.model.problem.rough and excess(one) > 6 * math.sqrt(2.0 * one.count)
    ]  # fmt: skip
    models = [best[k].model for k in rough]
    begun: list[Values] = []
    for k, model in zip(rough, models, strict=True):
        early = [float(modes @ modes) for modes in model.until(_FIRST).evaluate(points[k])]
        begun.append(points[k][int(np.argmin(early))])
    for share in (_FIRST, 0.4, 0.7):
        part = fit_each([(model.until(share), v) for model, v in zip(models, begun, strict=True)], rounds=8)
        begun = [one.values for one in part]
    for k, other in zip(rough, fit_each(list(zip(models, begun, strict=True))), strict=True):
        best[k] = other if other.objective < best[k].objective else best[k]
    return best


def signature_matrix(found: Fit, forms: Sequence[Form]) -> tuple[Array, list[Form]]:
    """Unit signatures of forms at small amplitude, the fit's own parameters projected out: [n, k], and whose they are.

    A form that changes nothing here, or only what the parameters change as well, has none.
    """
    basis = column_basis(np.vstack([found.jacobian, np.diag(np.sqrt(found.prior_precision()))])[:, found.free])
    columns, whose = [], []
    for form in forms:
        if form.effect in {f.effect for f in found.model.forms}:
            continue
        amplitude = next(p for p in form.parameters if p.name == form.amplitude)
        step = amplitude.step if amplitude.step is not None else 1e-4 * amplitude.scale
        for start in (form.starts or ({form.amplitude: 1.0},))[:6]:
            sign = math.copysign(1.0, start[form.amplitude])
            point = {**found.values, **start, form.amplitude: sign * step}
            (modes,) = found.model.with_forms((*found.model.forms, form)).evaluate([point])
            change = np.concatenate([(modes - found.modes) / step, np.zeros(len(found.values))])
            raw = float(np.linalg.norm(change))
            change = change - basis @ (basis.T @ change)
            size = float(np.linalg.norm(change))
            if size > 1e-3 * raw and raw > 0:
                columns.append(change[: found.count] / size)
                whose.append(form)
    return (np.stack(columns, axis=1) if columns else np.zeros((found.count, 0))), whose


def held_out_fit(model: Model, trials: Sequence[str], values: Mapping[str, float]) -> dict[str, float]:
    """Values with the nuisances of `trials` refitted within their priors, everything shared held."""
    own = [p for p in (*model.problem.base, *model.scatter) if p.trial is not None and p.trial in trials]
    if not own or not trials:
        return dict(values)
    found = fit(model.on(trials).holding(values), values)
    return {**values, **(scanned(found) if model.scatter and model.problem.contacts is not None else found).values}
