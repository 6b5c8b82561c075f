"""Fits: the maximum of likelihood times priors, by a damped Gauss-Newton method over all trials at once.

Steps are found from the normal equations. Several dampings and lengths are tried at once, and the best is taken. A
`Rule` says which, and when a fit ends. `SEARCH` is the rule for motions with contacts, whose likelihood jumps where a
trial changes its branch (sticks or slips, touches or misses): such a fit may use growing shares of the trials' time. It
scans each trial's own numbers over their priors for the measured branch. A fit is a generator that asks for modes at a
list of points, so that many fits are carried out together (`fits`): what all of them ask for is answered by one call of
the batched model.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Generator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from .problem import Array, Model, Parameter, Values, Whitener, evaluate_all
from .steps import along_corner, damped_step, solve

__all__ = ["SCAN", "SEARCH", "Fit", "Linear", "Model", "Rule", "Whitener", "by_beginnings", "fit", "fit_each", "fits",
           "scanned", "settled", "settled_slopes"]  # fmt: skip

_SETTLING = 3  # rounds in which the steps of a settled Jacobian are found
SCAN = np.linspace(-3.0, 3.0, 25)  # standard deviations of a trial's own number that are looked at for another valley
_CENTRINGS, _WORTH = 4, 0.5  # times that a fit begins again about the mean, and what it must gain each time
_PASSES = 3
_OPEN, _PART = 1e6, 1e-3
"""Scales beyond which a number is not determined; share of a number's change by which it depends on such a one."""
_BEGINNINGS = (0.3, 0.5, 0.7, 0.85)  # shares of their time that are looked at one after the other (`by_beginnings`)

T = TypeVar("T")
_Walk = Generator[tuple[Model, Sequence[Values]], list[Array], T]
"""Asks for the modes of a model at points, gets them, and so on; ends with a result."""


class Try(NamedTuple):
    """One of the steps that are tried at once, and how the fit goes on where it is the best."""

    times: float  # the fit's damping, as its part of the step's
    plus: float  # the rest of the step's damping, on the diagonal of the Hessian
    length: float = 1.0
    keep: float = 0.0  # factor on the fit's damping afterwards
    then: float = 0.0  # what is added to it


@dataclass(frozen=True, kw_only=True)
class Rule:
    """How a fit steps, and when it ends."""

    rounds: int = 30  # steps at most
    tries: tuple[Try, ...] = (
        Try(0.0, 0.0, keep=0.3), Try(1e-3, 0.0, keep=0.3), Try(1e-1, 0.0, keep=1.0), Try(10.0, 0.0, keep=5.0),
    )  # fmt: skip
    damping: float = 1.0  # to begin with
    least: float = 1e-4  # damping
    bounded: int = 1
    """Times that a step is found: from the second on without what runs into a bound at once."""
    enough: float = 0.02  # change of chi-square below which a fit has ended: a hundredth of what one sigma is worth
    relative: float = 1e-7  # the same as a share of chi-square, in addition
    last: float = 0.0  # damping with which a fit goes on that gains nothing, though the normal equations promise it
    poor: float = math.inf  # chi-square per sample from which a fit that would end is scanned once
    scan: bool = False  # whether each trial's own numbers are scanned before the first step
    shares: tuple[float, ...] = (1.0,)
    """Shares of the trials' time that are fitted one after another, the last is 1: what happens early is smooth in the
    parameters and determines most of them, so that later contacts are met on the right branch."""
    early: float = 1e-3 / (1 + 1e-3)  # share of chi-square below which a fit to less than all has ended
    keeps: bool = True  # whether the result holds the Jacobian, which is large where many fits go together


SEARCH = Rule(
    rounds=25, damping=0.0, least=0.0, bounded=2, enough=0.05, relative=0.0, last=1e3, poor=1.1, keeps=False,
    tries=(Try(1.0, 0.0), Try(1.0, 0.0, 0.4), Try(1.0, 1e-2), Try(1.0, 1.0, then=1.0), Try(1.0, 30.0, then=1.0)),
)  # fmt: skip
"""For motions with contacts. The first three tries are as good as undamped."""


@dataclass(frozen=True)
class Fit:
    """A model at its best values."""

    model: Model
    values: dict[str, float]
    rest: Array  # residual modes, shape [n], as `model.unturned` has them
    slopes: Array  # d rest / d parameter / scale, shape [n, p]
    chi_square: float  # of the data alone
    penalty: float  # of the priors
    free: NDArray[np.bool_] = field(repr=False)  # parameters not held by a bound, shape [p]

    @cached_property
    def modes(self) -> Array:
        """Residual modes, shape [n]."""
        return self.rest if self.model.unturned is self.model else self.model.turned(self.rest)

    @cached_property
    def jacobian(self) -> Array:
        """d modes / d parameter / scale, shape [n, p]."""
        return self.slopes if self.model.unturned is self.model else self.model.turned(self.slopes.T).T

    @property
    def objective(self) -> float:
        """Chi-square with the priors'."""
        return self.chi_square + self.penalty

    @property
    def count(self) -> int:
        """Samples."""
        return len(self.rest)

    def prior_precision(self) -> Array:
        """(scale / std)^2 of each parameter, 0 where it is free, shape [p]."""
        return np.array([0.0 if math.isinf(p.std) else (p.scale / p.std) ** 2 for p in self.model.parameters])

    def hessian(self) -> Array:
        """Of half the objective, in units of the parameters' scales, shape [p, p]."""
        return self.slopes.T @ self.slopes + np.diag(self.prior_precision())

    def covariance(self, *, inflation: float = 1.0, known: Collection[str] = ()) -> Array:
        """Of the values, in their units, shape [p, p]; bounds are not seen, singular directions get wide.

        `inflation`: by how much the data are noisier than stated; the priors are not. `known`: names of parameters that
        are taken for known, 0 in the result.
        """
        scales = np.array([p.scale for p in self.model.parameters])
        hessian = self.slopes.T @ self.slopes / inflation**2 + np.diag(self.prior_precision())
        held = np.array([p.name in known for p in self.model.parameters], dtype=bool)
        hessian[held], hessian[:, held] = 0.0, 0.0
        size = np.sqrt(np.maximum(np.diag(hessian), 1e-300))
        inverse = np.linalg.pinv(hessian / np.outer(size, size), rcond=1e-12, hermitian=True)
        return inverse / np.outer(size, size) * np.outer(scales, scales)

    def covariance_by_trial(self) -> Array:
        """Of the values, in their units, shape [p, p], from how trials differ: the sandwich of K.-Y. Liang and
        S. L. Zeger (1986, Biometrika 73, 13-22), each trial one unit, times n / (n - 1) of n trials; 0 of one trial.

        It holds also where trials do not have the same values, which `covariance` assumes. Few trials give a rough
        estimate.
        """
        parameters, count = self.model.parameters, len(self.model.trials)
        scales = np.array([p.scale for p in parameters])
        pull = self.prior_precision() * np.array([self.values[p.name] - p.value for p in parameters]) / scales
        gradients = np.array([
            self.slopes[rows].T @ self.rest[rows] + pull * [p.trial == trial for p in parameters]
            for trial, rows in self.model.rows().items()
        ])  # fmt: skip
        bread = self.covariance() / scales
        return bread @ gradients.T @ gradients @ bread.T * count / max(count - 1, 1) * (count > 1)

    def leaves_open(self, slope: Array) -> bool:
        """Whether data and priors leave a number open.

        `slope`: its derivatives by the parameters, shape [p], in their units. It is open where it depends on a
        direction in which the objective does not rise: along a parameter by less than 1 over `_OPEN` of its scales, or
        along one that `covariance` takes for singular. Such a number has no standard error.
        """
        moved = slope * np.array([p.scale for p in self.model.parameters])
        hessian = self.hessian()
        lost = np.diag(hessian) <= _OPEN**-2
        if np.abs(moved[lost]).sum() > _PART * np.abs(moved).sum():
            return True
        kept = ~lost
        size = np.sqrt(np.diag(hessian)[kept])
        along = moved[kept] / size
        values, axes = np.linalg.eigh(hessian[np.ix_(kept, kept)] / np.outer(size, size))
        flat = axes[:, values <= 1e-12 * values.max(initial=0.0)]
        return bool(np.linalg.norm(flat.T @ along) > _PART * np.linalg.norm(along))


def fit(model: Model, start: Values | None = None, *, rounds: int = Rule.rounds) -> Fit:
    """The best values near `start` (the parameters' own values where it names none)."""
    return fit_each([(model, start)], rounds=rounds)[0]


def fit_each(starts: Sequence[tuple[Model, Values | None]], *, rounds: int = Rule.rounds) -> list[Fit]:
    """`fit` of each model from its start, carried out together."""
    return fits([(model, _begun(model, start), Rule(rounds=rounds)) for model, start in starts])


def fits(starts: Sequence[tuple[Model, Values, Rule]]) -> list[Fit]:
    """Fits from `start`s that are carried out together."""
    return _together([_centred(*start) for start in starts])


def _together(walks: Sequence[_Walk[T]]) -> list[T]:
    """Carry out walks: what all of them ask for at a time is answered at once."""
    done: dict[int, T] = {}
    answers: dict[int, list[Array] | None] = dict.fromkeys(range(len(walks)))
    while answers:
        asked = {}
        for k, answer in answers.items():
            try:
                asked[k] = next(walks[k]) if answer is None else walks[k].send(answer)
            except StopIteration as end:
                done[k] = end.value
        answers = dict(zip(asked, evaluate_all(list(asked.values())), strict=True))
    return [done[k] for k in range(len(walks))]


def _centred(model: Model, start: Values, rule: Rule) -> _Walk[Fit]:
    """One fit, begun again where its own end, stated with trials' numbers about their mean, is likelier.

    K times the factor of each bed is known far better than either. The valley along which they change together bends,
    so that steps along it are short, and a fit that gains little by each ends in it.
    """
    found = yield from _descent(model, start, rule)
    for _ in range(_CENTRINGS if model.scatter else 0):
        other = model.problem.centred(found.values, model.forms)
        if _penalty(model.parameters, other) > found.penalty - _WORTH:
            break
        again = yield from _descent(model, other, rule)
        if again.objective > found.objective - _WORTH:
            break
        found = again
    return found


def _penalty(parameters: Sequence[Parameter], values: Values) -> float:
    return sum(((values[p.name] - p.value) / p.std) ** 2 for p in parameters)


def _descent(model: Model, start: Values, rule: Rule) -> _Walk[Fit]:
    """One descent from `start`."""
    parameters = model.parameters
    scales = np.array([p.scale for p in parameters])
    low, high = np.array([p.lowest for p in parameters]), np.array([p.highest for p in parameters])
    middle, precision = np.array([p.value for p in parameters]), np.array([p.std**-2 for p in parameters])
    x = np.clip(_numbers(parameters, start), low, high)
    names = [p.name for p in parameters]
    corners = [(names.index(p.name), names.index(p.bounded_by)) for p in parameters if p.bounded_by in names]
    unturned = model.unturned  # modes are needed at the end only: steps follow from their products

    def named(values: Array) -> dict[str, float]:
        return dict(zip(names, values.tolist(), strict=True))

    def penalty(values: Array) -> float:
        return float((precision * (values - middle) ** 2).sum())

    best: Array | None = None
    jacobian, free = np.zeros((0, len(x))), np.ones(len(x), dtype=bool)
    for number, share in enumerate(rule.shares):
        part, whole, best = replace(unturned, share=share) if share < 1 else unturned, share >= 1, None
        if number or rule.scan:
            x = _numbers(parameters, (yield from _scan(part, named(x)))[0])
        damping, scannable = rule.damping, True
        for _ in range(rule.rounds if whole else max(4, rule.rounds // 3)):
            best, jacobian = yield from _slopes(part, x, best)
            objective = float(best @ best) + penalty(x)
            gradient = jacobian.T @ best + precision * scales * (x - middle)
            at_low, at_high = x <= low, x >= high
            free = ~((at_low & (gradient > 0)) | (at_high & (gradient < 0)))
            if not free.any():
                break
            hessian = jacobian.T @ jacobian + np.diag(precision * scales**2)
            jacobian = jacobian if rule.keeps else jacobian[:0]
            trials = []
            for tried in rule.tries:
                damped = tried.times * damping + tried.plus
                step = damped_step(hessian, gradient, free, damped, (at_low, at_high), rule.bounded)
                trials.append(np.clip(x + tried.length * (scales * step), low, high))
            trials += [np.clip(moved, low, high) for corner in corners for moved in along_corner(x, *corner)]
            modes = yield part, [named(trial) for trial in trials]
            objectives = [float(m @ m) + penalty(t) for m, t in zip(modes, trials, strict=True)]
            place = int(np.argmin(objectives))
            gain = objective - objectives[place]
            if gain > 0:
                x, best = trials[place], modes[place].copy()  # the others of the batch are not kept
                if place < len(rule.tries):
                    damping = max(damping * rule.tries[place].keep + rule.tries[place].then, rule.least)
            if gain >= (rule.enough + rule.relative * objective if whole else rule.early * objective):
                continue
            if gain <= 0 and damping < rule.last and gradient @ solve(hessian, gradient) >= rule.enough:
                damping = rule.last
                continue
            if whole and scannable and objective - max(gain, 0.0) > rule.poor * np.count_nonzero(best):
                values, gain = yield from _scan(part, named(x))
                x, best, damping, scannable = _numbers(parameters, values), None, rule.damping, False
                if gain > 1.0:
                    continue
            break
    if best is None:
        (best,) = yield unturned, [named(x)]
    return Fit(model, named(x), best, jacobian, float(best @ best), penalty(x), free)


def scanned(found: Fit, *, passes: int = _PASSES) -> Fit:
    """The best of fits that begin where a trial's own numbers lie elsewhere within their priors.

    Where a trial sticks or slips otherwise, its likelihood has many narrow valleys. Each of its numbers is moved over
    three standard deviations of its prior, and its other numbers follow the fit. Shared parameters stay unchanged, so
    all trials are tried together, and each takes its best.
    """
    for _ in range(passes):
        ((values, gain),) = _together([_scan(found.model, found.values, found.hessian(), least=1.0)])
        if not gain:
            break
        again = fit(found.model, values)
        if again.objective > found.objective - 1.0:
            break
        found = again
    return found


def by_beginnings(found: Fit) -> Fit:
    """The better of `found` and a fit that begins with the beginning of all trials and looks at more of them in steps.

    A motion that slips, hops and falls is the rougher in its parameters the longer it lasts. A fit to all of it at once
    may end on a branch that nobody measured.
    """
    model, values = found.model, {p.name: p.value for p in found.model.parameters}
    for share in _BEGINNINGS:
        values = scanned(fit(model.until(share, model.trials), values), passes=1).values
    other = scanned(fit(model, values))
    return other if other.objective < found.objective - 1.0 else found


def _scan(
    model: Model, values: Values, hessian: Array | None = None, *, least: float = 0.0
) -> _Walk[tuple[dict[str, float], float]]:
    """Values with the numbers of trials where they lie better, by more than `least`, along the valley of one kind after
    another, and what the objective loses. `hessian`: moves a trial's others along; None: they stay."""
    values, gain, parameters, rows = dict(values), 0.0, model.parameters, model.rows()
    for kind in dict.fromkeys(p.kind for p in parameters if p.trial is not None and math.isfinite(p.std)):
        mine = {p.trial: k for k, p in enumerate(parameters) if p.trial is not None and p.kind == kind}
        ways = {}
        for trial, here in mine.items():
            own = [k for k, p in enumerate(parameters) if p.trial == trial] if hessian is not None else [here]
            matrix = hessian[np.ix_(own, own)] if hessian is not None else np.eye(1)
            covariance = np.linalg.pinv(matrix, rcond=1e-12, hermitian=True)
            place = own.index(here)
            ways[trial] = own, covariance[:, place] / max(float(covariance[place, place]), 1e-300)
        points = [dict(values)]
        for z in SCAN:
            point = dict(values)
            for trial, here in mine.items():
                p = parameters[here]
                far = (p.value + z * p.std - values[p.name]) / p.scale
                for k, slope in zip(*ways[trial], strict=True):
                    q = parameters[k]
                    point[q.name] = float(np.clip(values[q.name] + far * slope * q.scale, q.lowest, q.highest))
            points.append(point)
        modes = yield model, points
        for trial, (own, _) in ways.items():
            costs = [
                float(one[rows[trial]] @ one[rows[trial]])
                + sum(((point[parameters[k].name] - parameters[k].value) / parameters[k].std) ** 2 for k in own)
                for one, point in zip(modes, points, strict=True)
            ]
            best = int(np.argmin(costs))
            if costs[best] < costs[0] - least:
                gain += costs[0] - costs[best]
                values |= {parameters[k].name: points[best][parameters[k].name] for k in own}
    return values, gain


@dataclass(frozen=True)
class Linear:
    """A model linearised about values, with its normal equations, priors included; p parameters, n samples."""

    parameters: tuple[Parameter, ...]
    x: Array  # the values, shape [p]
    modes: Array  # shape [n]
    jacobian: Array  # d modes / d parameter / scale, shape [n, p]
    inverse: Array  # of the normal matrix, in units of the scales, shape [p, p]
    slope: Array  # half the gradient of the objective, in units of the scales, shape [p]

    @staticmethod
    def of(model: Model, values: Values) -> Linear:
        """About these values, or the parameters' own where none is given."""
        parameters = model.parameters
        x = _numbers(parameters, values)
        ((modes, jacobian),) = _together([_slopes(model, x)])
        middle, scales = np.array([p.value for p in parameters]), np.array([p.scale for p in parameters])
        precision = np.array([(p.scale / p.std) ** 2 for p in parameters])
        normal = jacobian.T @ jacobian + np.diag(precision)
        inverse = np.asarray(np.linalg.pinv(normal, rcond=1e-12, hermitian=True), dtype=float)
        slope = jacobian.T @ modes + precision * (x - middle) / scales
        return Linear(parameters, x, modes, jacobian, inverse, slope)

    def projected(self, changes: Array) -> tuple[Array, Array, Array]:
        """Changes of the modes, shape [n, k], with what a refit of the parameters takes out taken out: their products
        [k, k], their products with what is left [k], and their products with the Jacobian [p, k]."""
        cross = self.jacobian.T @ changes
        gram = changes.T @ changes - cross.T @ self.inverse @ cross
        return gram, changes.T @ self.modes - cross.T @ self.inverse @ self.slope, cross


def settled(found: Fit) -> Fit:
    """The same with its slopes taken over steps worth a standard deviation of the data (`settled_slopes`)."""
    return replace(found, slopes=settled_slopes(found.model.unturned, found.values)[1])


def settled_slopes(model: Model, values: Values) -> tuple[Array, Array]:
    """As `Linear` has them, over steps that are worth a standard deviation of the data, both ways.

    A fit's own steps are hundredths of what was stated or of a typical size. Where data determine a number a thousand
    times better, such a step reaches over the next branch of sticking and slipping. Then a jump is taken for a slope,
    and standard errors are far too small.
    """
    parameters = model.parameters
    names = [p.name for p in parameters]
    steps = np.array([p.step if p.step is not None else 1e-4 * p.scale for p in parameters])
    low, high = np.array([p.lowest for p in parameters]), np.array([p.highest for p in parameters])
    x = _numbers(parameters, values)
    groups, rows = _groups(parameters), model.rows()
    now, slopes = np.zeros(0), np.zeros((0, len(x)))
    for _ in range(_SETTLING):
        points = []
        for members in groups:
            for sign in (1.0, -1.0):
                point = dict(values)
                for k in members:
                    point[names[k]] = float(np.clip(x[k] + sign * steps[k], low[k], high[k]))
                points.append(point)
        there = model.evaluate([values, *points])
        now, made = there[0], there[1:]
        slopes = np.zeros((len(now), len(x)))
        for place, members in enumerate(groups):
            for k in members:
                where = slice(None) if parameters[k].trial is None else rows[parameters[k].trial or ""]
                sides = []
                both = slice(2 * place, 2 * place + 2)
                for point, modes in zip(points[both], made[both], strict=True):
                    moved = point[names[k]] - x[k]
                    if moved:
                        sides.append((modes[where] - now[where]) / moved)
                sizes = [float(np.linalg.norm(side)) for side in sides]
                # A jump on one side is that side's: the other one has the slope.
                slope = np.mean(sides, axis=0) if max(sizes) < 2 * min(sizes) else sides[int(np.argmin(sizes))]
                slopes[where, k] = slope * parameters[k].scale
                steps[k] = min(steps[k], 1.0 / max(min(sizes), 1e-300))
    return now, slopes


def _groups(parameters: Sequence[Parameter]) -> list[list[int]]:
    """Which parameters can be changed together: nuisances of one kind, each of a trial of its own."""
    groups: dict[str, list[int]] = {}
    for k, p in enumerate(parameters):
        groups.setdefault(f"kind {p.kind}" if p.trial is not None and p.kind else f"one {p.name}", []).append(k)
    return list(groups.values())


def _begun(model: Model, start: Values | None) -> Values:
    """Where to begin: `start`, and for what it does not name the problem's own search, where it has one."""
    known, contacts = dict(start or {}), model.problem.contacts
    scatter = {p.name for p in model.scatter}  # a small thing beside the rest: it begins at none
    if contacts is None or all(p.name in known or p.name in scatter for p in model.parameters):
        return known
    return contacts.guess(model, {**(model.held or {}), **known})


def _numbers(parameters: Sequence[Parameter], values: Values) -> Array:
    """Values of the parameters, their own where none is given."""
    return np.array([values.get(p.name, p.value) for p in parameters], dtype=float)


def _slopes(model: Model, x: Array, known: Array | None = None) -> _Walk[tuple[Array, Array]]:
    """Modes at `x` (`known`, if they are), and their changes per scale of each parameter, one kind at a time."""
    parameters, groups = model.parameters, _groups(model.parameters)
    base = {p.name: float(value) for p, value in zip(parameters, x, strict=True)}
    points = [base] if known is None else []
    steps = np.zeros(len(parameters))
    for members in groups:
        point = dict(base)
        for k in members:
            p = parameters[k]
            step = p.step if p.step is not None else 1e-4 * p.scale
            steps[k] = -step if x[k] + step > p.highest else step
            point[p.name] = x[k] + steps[k]
        points.append(point)
    modes = yield model, points
    modes = [modes[0].copy(), *modes[1:]] if known is None else [known, *modes]
    jacobian = np.zeros((len(parameters), len(modes[0]))).T  # whose columns are filled one by one
    rows = model.rows()
    for place, members in enumerate(groups, 1):
        change = modes[place] - modes[0]
        for k in members:
            p = parameters[k]
            where = slice(None) if p.trial is None else rows[p.trial]
            jacobian[where, k] = change[where] * (p.scale / steps[k])
    return modes[0], jacobian
