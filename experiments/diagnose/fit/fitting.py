"""Fits: the maximum of likelihood times priors, by a damped Gauss-Newton method over all trials at once.

The residuals of a problem are white or are made so (`Whitener`): each channel of each trial is turned by a discrete
cosine transform and every mode divided by the noise it has. In that domain the sum of squares is that of white noise,
and slow misfit stands in the first modes.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.fft import dct

from .problem import Array, Form, Parameter, Problem, TrialInfo, Values
from .together import each

__all__ = ["SCAN", "Fit", "Model", "Whitener", "by_beginnings", "fit", "linearised", "scanned", "settled",
           "settled_slopes"]  # fmt: skip

_ROUNDS = 30
_DAMPINGS = (0.0, 1e-3, 1e-1, 10.0)
_SETTLING = 3  # rounds in which the steps of a settled Jacobian are found
SCAN = np.linspace(-3.0, 3.0, 25)  # standard deviations of a trial's own number that are looked at for another valley
_PASSES = 3
_BEGINNINGS = (0.3, 0.5, 0.7, 0.85)  # shares of their time that are looked at one after the other (`by_beginnings`)
_MANY = 2**15  # residuals from which threads are worth their while
_ENOUGH = 0.02  # change of chi-square below which a fit has ended: a hundredth of what one sigma is worth


@dataclass(frozen=True)
class Whitener:
    """Turns residuals into modes of unit variance, trial by trial."""

    blocks: Mapping[str, tuple[NDArray[np.intp], ...]]  # rows of each channel in each trial, in the order of time
    weights: Mapping[str, Array]  # one over the noise of each mode, in the order of the blocks, shape [sample_count]
    kept: Mapping[str, Array] = field(default_factory=dict)
    """Of trials that are looked at in part only: factors 0 or 1 on the residuals, shape [sample_count]."""

    @staticmethod
    def white(problem: Problem) -> Whitener:
        """For noise that is white, beside what replicates are known to differ by (`noise.wander`)."""
        bare = Whitener.bare(problem)
        return replace(bare, weights={**bare.weights, **problem.calmed})

    @staticmethod
    def bare(problem: Problem) -> Whitener:
        """For noise that is white as it is."""
        blocks, weights = {}, {}
        for trial in problem.trials:
            samples = problem.samples(trial.id)
            names = list(dict.fromkeys(samples.channel.tolist()))
            blocks[trial.id] = tuple(np.flatnonzero(samples.channel == name) for name in names)
            weights[trial.id] = np.ones(len(samples.time))
        return Whitener(blocks, weights)

    def modes(self, trial: str, residuals: Array) -> Array:
        """Modes of the residuals of a trial, shape [sample_count], or [point_count, sample_count]."""
        if trial in self.kept:
            residuals = residuals * self.kept[trial]
        parts = [dct(np.take(residuals, rows, axis=-1), norm="ortho", axis=-1) for rows in self.blocks[trial]]
        return np.concatenate(parts, axis=-1) * self.weights[trial]

    def block_slices(self, trial: str) -> list[slice]:
        """Where each channel's modes stand."""
        edges = np.cumsum([0, *(len(rows) for rows in self.blocks[trial])]).tolist()
        return [slice(low, high) for low, high in itertools.pairwise(edges)]

    def channel_blocks(self, problem: Problem, trial: str) -> list[tuple[str, slice]]:
        """Each channel of a trial, and where its modes stand."""
        channels = dict.fromkeys(problem.samples(trial).channel.tolist())
        return list(zip(channels, self.block_slices(trial), strict=True))


@dataclass(frozen=True)
class Model:
    """What is fitted: the problem, the effects added, the trials, and which scatter is let free."""

    problem: Problem
    whitener: Whitener
    trials: tuple[str, ...]
    forms: tuple[Form, ...] = ()
    scatter: tuple[Parameter, ...] = ()  # nuisances of trials that describe what differs between replicates
    held: Mapping[str, float] | None = None  # values at which all shared parameters are held; None: they are fitted
    share: float = 1.0  # of their time, up to which trials are looked at (`until`)

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """All that a fit changes."""
        extra = tuple(p for form in self.forms for p in form.parameters)
        every = (*self.problem.base, *self.scatter, *extra)
        shared = self.held is None
        return tuple(p for p in every if (shared if p.trial is None else p.trial in self.trials))

    @property
    def infos(self) -> list[TrialInfo]:
        """What is known of its trials, in the campaign's order."""
        return [trial for trial in self.problem.trials if trial.id in self.trials]

    def with_forms(self, forms: Sequence[Form]) -> Model:
        """The same with other effects."""
        return replace(self, forms=tuple(forms))

    def on(self, trials: Sequence[str]) -> Model:
        """The same on other trials."""
        return replace(self, trials=tuple(trials))

    def holding(self, values: Values) -> Model:
        """The same with all shared parameters held at these values."""
        return replace(self, held=dict(values))

    def until(self, share: float, trials: Sequence[str] | None = None) -> Model:
        """The same, of these trials (None: those that the problem calls `rough`) only the first share of their time
        looked at.

        A motion with bounces depends on its parameters the more roughly the longer it goes on: fits that begin with its
        beginning find their way.
        """
        kept = {}
        for trial in self.problem.rough if trials is None else trials:
            time = self.problem.samples(trial).time
            kept[trial] = (time <= time.min() + share * np.ptp(time)).astype(float)
        return replace(self, whitener=replace(self.whitener, kept=kept), share=share)

    def evaluate(self, points: Sequence[Values]) -> list[Array]:
        """Modes of all trials, one after another, at each point."""
        held = self.held
        whole = points if held is None else [{**held, **point} for point in points]
        # What is not looked at need not be simulated.
        share = self.share if all(trial in self.whitener.kept for trial in self.trials) else 1.0
        found = self.problem.evaluate(whole, self.forms, self.trials, share)

        def modes(trial: str) -> Array:
            return self.whitener.modes(trial, np.stack([one[trial] for one in found]))

        many = len(found) * sum(len(self.whitener.weights[id]) for id in self.trials) >= _MANY
        parts = each(modes, self.trials, threads=None if many else 1)
        return [np.concatenate([part[k] for part in parts]) for k in range(len(found))]

    def rows(self) -> dict[str, slice]:
        """Where each trial's modes stand."""
        edges = np.cumsum([0, *(len(self.whitener.weights[id]) for id in self.trials)]).tolist()
        return {id: slice(edges[k], edges[k + 1]) for k, id in enumerate(self.trials)}

    def channel_rows(self) -> Iterator[tuple[str, str, slice]]:
        """Trial, channel and where its modes stand, of all trials that are fitted."""
        for trial, rows in self.rows().items():
            for channel, block in self.whitener.channel_blocks(self.problem, trial):
                yield trial, channel, slice(rows.start + block.start, rows.start + block.stop)


@dataclass(frozen=True)
class Fit:
    """A model at its best values."""

    model: Model
    values: dict[str, float]
    modes: Array  # residual modes, shape [n]
    jacobian: Array  # d modes / d parameter / scale, shape [n, p]
    chi_square: float  # of the data alone
    penalty: float  # of the priors
    free: NDArray[np.bool_] = field(repr=False)  # parameters not held by a bound, shape [p]

    @property
    def objective(self) -> float:
        """Chi-square with the priors'."""
        return self.chi_square + self.penalty

    @property
    def count(self) -> int:
        """Samples."""
        return len(self.modes)

    def prior_precision(self) -> Array:
        """(scale / std)^2 of each parameter, 0 where it is free, shape [p]."""
        return np.array([0.0 if math.isinf(p.std) else (p.scale / p.std) ** 2 for p in self.model.parameters])

    def hessian(self) -> Array:
        """Of half the objective, in units of the parameters' scales, shape [p, p]."""
        return self.jacobian.T @ self.jacobian + np.diag(self.prior_precision())

    def covariance(self, *, inflation: float = 1.0) -> Array:
        """Of the values, in their units, shape [p, p]; bounds are not seen, singular directions get wide.

        `inflation`: by how much the data are noisier than stated; the priors are not.
        """
        scales = np.array([p.scale for p in self.model.parameters])
        hessian = self.jacobian.T @ self.jacobian / inflation**2 + np.diag(self.prior_precision())
        size = np.sqrt(np.maximum(np.diag(hessian), 1e-300))
        inverse = np.linalg.pinv(hessian / np.outer(size, size), rcond=1e-12, hermitian=True)
        return inverse / np.outer(size, size) * np.outer(scales, scales)


def fit(model: Model, start: Values | None = None, *, rounds: int = _ROUNDS) -> Fit:
    """The best values near `start` (the parameters' own values where it names none)."""
    parameters = model.parameters
    scales = np.array([p.scale for p in parameters])
    low, high = np.array([p.lowest for p in parameters]), np.array([p.highest for p in parameters])
    middle = np.array([p.value for p in parameters])
    precision = np.array([0.0 if math.isinf(p.std) else p.std**-2 for p in parameters])
    start = _begun(model, start)
    x = np.array([start.get(p.name, p.value) for p in parameters], dtype=float)
    x = np.clip(x, low, high)
    names = [p.name for p in parameters]

    def named(values: Array) -> dict[str, float]:
        return {name: float(value) for name, value in zip(names, values, strict=True)}

    def penalty(values: Array) -> float:
        return float((precision * (values - middle) ** 2).sum())

    best: Array | None = None
    jacobian = np.zeros((0, len(x)))
    objective = math.inf
    damping = 1.0
    free = np.ones(len(x), dtype=bool)
    for _ in range(rounds):
        best, jacobian = _linearise(model, parameters, x, best)
        objective = float(best @ best) + penalty(x)
        gradient = jacobian.T @ best + precision * scales * (x - middle)
        at_low, at_high = (x <= low) & (gradient > 0), (x >= high) & (gradient < 0)
        free = ~(at_low | at_high)
        if not free.any():
            break
        hessian = (jacobian.T @ jacobian + np.diag(precision * scales**2))[np.ix_(free, free)]
        diagonal = np.diag(np.maximum(np.diag(hessian), 1e-12))
        trials = []
        for factor in _DAMPINGS:
            step = np.zeros(len(x))
            step[free] = -_solve(hessian + factor * damping * diagonal, gradient[free])
            trials.append(np.clip(x + scales * step, low, high))
        modes = model.evaluate([named(trial) for trial in trials])
        objectives = [float(m @ m) + penalty(t) for m, t in zip(modes, trials, strict=True)]
        place = int(np.argmin(objectives))
        gain = objective - objectives[place]
        damping = max(damping * (0.3 if place <= 1 else 1.0 if place == 2 else 5.0), 1e-4)
        if gain > 0:
            x, best = trials[place], modes[place]
        if gain < _ENOUGH + 1e-7 * objective:
            break
    if best is None:
        best = model.evaluate([named(x)])[0]
    return Fit(model, named(x), best, jacobian, float(best @ best), penalty(x), free)


def scanned(found: Fit, *, passes: int = _PASSES) -> Fit:
    """The best of fits that begin where a trial's own numbers lie elsewhere within their priors.

    Where a trial sticks or slips otherwise, its likelihood has many narrow valleys. Each of its numbers is moved over
    three standard deviations of its prior, its others with it as the fit says that they must; what is shared stays, so
    that all trials are looked at together, and each takes its best.
    """
    for _ in range(passes):
        values = dict(found.values)
        moved = False
        for kind in dict.fromkeys(
            p.kind for p in found.model.parameters if p.trial is not None and math.isfinite(p.std)
        ):
            better = _along(found, values, kind)
            moved, values = moved or bool(better), {**values, **better}
        if not moved:
            break
        again = fit(found.model, values)
        if again.objective > found.objective - 1.0:
            break
        found = again
    return found


def by_beginnings(found: Fit) -> Fit:
    """The better of `found` and a fit that begins with the beginning of all trials and looks at more of them in steps.

    A motion that slips, hops and falls is the rougher in its parameters the longer it goes on; a fit to all of it at
    once may end on a branch that nobody measured.
    """
    model, values = found.model, {p.name: p.value for p in found.model.parameters}
    for share in _BEGINNINGS:
        values = scanned(fit(model.until(share, model.trials), values), passes=1).values
    other = scanned(fit(model, values))
    return other if other.objective < found.objective - 1.0 else found


def _along(found: Fit, values: Values, kind: str) -> dict[str, float]:
    """Numbers of those trials that lie better elsewhere along the valley of one kind."""
    model, parameters, rows = found.model, found.model.parameters, found.model.rows()
    hessian = found.hessian()
    mine = {p.trial: k for k, p in enumerate(parameters) if p.trial is not None and p.kind == kind}
    ways = {}
    for trial, here in mine.items():
        own = [k for k, p in enumerate(parameters) if p.trial == trial]
        covariance = np.linalg.pinv(hessian[np.ix_(own, own)], rcond=1e-12, hermitian=True)
        place = own.index(here)
        ways[trial] = own, covariance[:, place] / max(float(covariance[place, place]), 1e-300)
    points = [dict(values)]
    for z in SCAN:
        point = dict(values)
        for trial, here in mine.items():
            p = parameters[here]
            far = (p.value + z * p.std - values[p.name]) / p.scale
            own, way = ways[trial]
            for k, slope in zip(own, way, strict=True):
                q = parameters[k]
                point[q.name] = float(np.clip(values[q.name] + far * slope * q.scale, q.lowest, q.highest))
        points.append(point)
    modes = model.evaluate(points)
    told: dict[str, float] = {}
    for trial, (own, _) in ways.items():
        names = [parameters[k].name for k in own]
        costs = [
            float(one[rows[trial]] @ one[rows[trial]])
            + sum(((point[parameters[k].name] - parameters[k].value) / parameters[k].std) ** 2 for k in own)
            for one, point in zip(modes, points, strict=True)
        ]
        best = int(np.argmin(costs))
        if costs[best] < costs[0] - 1.0:
            told |= {name: points[best][name] for name in names}
    return told


def linearised(model: Model, values: Values) -> tuple[Array, Array]:
    """Modes at `values`, shape [n], and their changes per scale of each of the model's parameters, shape [n, p]."""
    parameters = model.parameters
    return _linearise(model, parameters, np.array([values.get(p.name, p.value) for p in parameters], dtype=float))


def settled(found: Fit) -> Fit:
    """The same with its Jacobian taken over steps worth a standard deviation of the data (`settled_slopes`)."""
    return replace(found, jacobian=settled_slopes(found.model, found.values)[1])


def settled_slopes(model: Model, values: Values) -> tuple[Array, Array]:
    """As `linearised`, over steps that are worth a standard deviation of the data, both ways.

    A fit's own steps are hundredths of what was stated or of a typical size. Where data tell a thousand times more,
    such a step reaches over the next branch of sticking and slipping, and a jump is taken for a slope: standard errors
    would come out far too small, and what is uncertain far too loud.
    """
    parameters = model.parameters
    names = [p.name for p in parameters]
    steps = np.array([p.step if p.step is not None else 1e-4 * p.scale for p in parameters])
    low, high = np.array([p.lowest for p in parameters]), np.array([p.highest for p in parameters])
    x = np.array([values.get(p.name, p.value) for p in parameters], dtype=float)
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
                # A jump on one side is that side's: the other one tells the slope.
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
    """Where to begin: as told, and what is not told by the problem's own search, where it has one (`guess`)."""
    known, contacts = dict(start or {}), model.problem.contacts
    scatter = {p.name for p in model.scatter}  # a small thing beside the rest: it begins at none
    if contacts is None or all(p.name in known or p.name in scatter for p in model.parameters):
        return known
    held = model.held is not None
    return contacts.guess(model.forms, model.trials, {**(model.held or {}), **known}, held=held, apart=model.scatter)


def _solve(matrix: Array, right: Array) -> Array:
    size = np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    scaled = matrix / np.outer(size, size) + 1e-12 * np.eye(len(size))
    return np.linalg.lstsq(scaled, right / size, rcond=1e-13)[0] / size


def _linearise(
    model: Model, parameters: Sequence[Parameter], x: Array, known: Array | None = None
) -> tuple[Array, Array]:
    """Modes at `x` (`known`, if they are), and their changes per scale of each parameter, one kind at a time."""
    names = [p.name for p in parameters]
    base = {name: float(value) for name, value in zip(names, x, strict=True)}
    groups = _groups(parameters)
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
    modes = model.evaluate(points)
    modes = modes if known is None else [known, *modes]
    jacobian = np.zeros((len(modes[0]), len(parameters)))
    rows = model.rows()
    for place, members in enumerate(groups, 1):
        change = modes[place] - modes[0]
        for k in members:
            p = parameters[k]
            where = slice(None) if p.trial is None else rows[p.trial]
            jacobian[where, k] = change[where] * (p.scale / steps[k])
    return modes[0], jacobian
