"""Times that jitter: readings taken a little before or after the moment that the recording states.

An error e of a row's time makes an error dy/dt e in each of its readings: white from row to row, which a misfit is not,
and as large as the signal is steep, which other noise is not. Both are found from second differences of the residuals
(weights b = 1, -2, 1, in which motion leaves little): their variance is
a^2 sum b^2 + sigma^2 sum (b dy/dt)^2, the noise a free in each channel, sigma one number for all sensors on a clock.
Fourth differences, in which motion leaves next to nothing, must show the same sigma.
In the likelihood a row's readings then have the covariance s s' + their noise's, s = sigma dy/dt over the noise. So
readings that share a row have one common error, not several.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.sparse import csr_matrix

from experiments.diagnose.fit.fitting import Fit
from experiments.diagnose.fit.problem import Array, Finding, Form, Problem, Values

__all__ = ["Jitter", "Shaken", "find_jitter", "steepness"]

_FOURTH, _SECOND = np.array([1.0, -4.0, 6.0, -4.0, 1.0]), np.array([1.0, -2.0, 1.0])
_NEAR = 0.5  # of a row's interval: how far from its time the slope is taken
_MOST = 9.0  # squared standard deviations that one difference counts at most: a touch that a model misses is no noise
_FEWEST = 100  # differences from which on a clock is examined
_SURE = 20.0
"""Twice the log likelihood that one more number must gain: chance 8e-6 under white noise. Of a misfit of 78 a sample,
where nothing jitters, it was 11."""
_SLOPES = 3.0  # the same of one trial, were the jitter there: with less, its slopes are too small
_SHARE = 0.75  # of the trials with such slopes that must show it
_ALIKE = 1.4  # factor by which second and fourth differences may disagree: of a misfit these hold far less
_FAR = 3.0  # standard deviations of a time within which a jump of the model makes a reading doubtful


@dataclass(frozen=True)
class Jitter:
    """The jitter of one clock."""

    channels: tuple[str, ...]
    std: float  # [s]

    @property
    def finding(self) -> Finding:
        """In words."""
        names = " and ".join(part for part in (", ".join(self.channels[:-1]), self.channels[-1]) if part)
        what = f"the times of {names} jitter by {1e3 * self.std:.2g} ms (std): taken into account"
        return Finding(trial="", channel=self.channels[0] if len(self.channels) == 1 else None, what=what)


@dataclass(frozen=True)
class _Windows:
    """Differences of one channel of one trial."""

    trial: str
    channel: int  # its place among the clock's
    square: Array  # of the differences, over the stated noise and sum b^2, shape [n]
    slope: Array  # sum of (b dy/dt)^2 over the same [1/s2], shape [n]


@dataclass(frozen=True)
class Shaken:
    """Whitens the residuals of a trial whose rows jitter."""

    rows: csr_matrix = field(repr=False)
    """Which samples share an error, that error's shape in each row, shape [row_count, sample_count]."""
    shrink: Array = field(repr=False)  # shape [row_count, 1]
    directions: Array = field(repr=False)  # orthonormal, of what else samples share, shape [sample_count, k]
    less: Array = field(repr=False)  # share of each that is taken away, shape [k]

    @staticmethod
    def of(along: Array, row: NDArray[np.intp], common: Array) -> Shaken:
        """`row`: number of the row that a sample is in; `common`: what errors of one sigma that whole recordings share
        would change, over the stated noise, shape [sample_count, k]. Residuals are over the stated noise too."""
        count = int(row.max()) + 1 if len(row) else 0
        rows = csr_matrix((along, (row, np.arange(len(row)))), shape=(count, len(row)))
        size = np.maximum(np.bincount(row, along**2, minlength=count), 1e-300)[:, None]
        half = Shaken(rows, (1 - 1 / np.sqrt(1 + size)) / size, np.zeros((len(row), 0)), np.zeros(0))
        left, sizes, _ = np.linalg.svd(half.whitened(common.T).T, full_matrices=False)
        kept = sizes > 1e-6
        return Shaken(rows, half.shrink, left[:, kept], 1 - 1 / np.sqrt(1 + sizes[kept] ** 2))

    def whitened(self, residuals: Array) -> Array:
        """Of unit variance and without correlation, shape [sample_count] or [point_count, sample_count]."""
        rest = residuals - (self.rows.T @ (self.shrink * (self.rows @ np.atleast_2d(residuals).T))).T.reshape(
            residuals.shape
        )
        return rest - ((rest @ self.directions) * self.less) @ self.directions.T


def find_jitter(found: Fit) -> tuple[Jitter, ...]:
    """Clocks whose times jitter beyond doubt, on the trials that were fitted."""
    jitters = []
    for clock in found.model.problem.clocks:
        windows, longest = _windows(found, clock, _SECOND)
        if sum(len(w.square) for w in windows) < _FEWEST:
            continue
        std = _likeliest(windows, _SECOND, longest)
        if std is not None:
            other = _likeliest(_windows(found, clock, _FOURTH)[0], _FOURTH, longest, sure=0.0)
            if other is not None and 1 / _ALIKE < other / std < _ALIKE:
                jitters.append(Jitter(clock, std))
    return tuple(jitters)


def steepness(problem: Problem, jitters: Sequence[Jitter], values: Values, forms: Sequence[Form]) -> dict[str, Array]:
    """What one standard deviation of jitter changes in each sample, over its stated noise: trial -> shape
    [sample_count], the larger of what is before and after; {} without jitter. Jumps as far as 3 of them count."""
    trials = [trial.id for trial in problem.trials] if jitters else []
    found = {trial: np.zeros(len(problem.samples(trial).time)) for trial in trials}
    for jitter in jitters:
        reach = _FAR * jitter.std
        late, now, early = (problem.readings(values, forms, trials, shift) for shift in (reach, 0.0, -reach))
        for trial in trials:
            after, before = late[trial] - now[trial], now[trial] - early[trial]
            larger = np.where(np.abs(after) >= np.abs(before), after, before) / _FAR
            mine = np.isin(problem.samples(trial).channel, jitter.channels) & np.isfinite(larger)
            found[trial][mine] = larger[mine]
    return found


def _windows(found: Fit, clock: tuple[str, ...], weights: Array) -> tuple[list[_Windows], float]:
    """Differences of a clock's channels on the trials fitted, and the longest of the trials' intervals [s]."""
    problem, forms = found.model.problem, found.model.forms
    width, windows = len(weights), []
    usual: dict[tuple[str, str], float] = {}
    for trial, name in itertools.product(found.model.trials, clock):
        samples = problem.samples(trial)
        time = samples.time[samples.channel == name]
        if len(time) > 2 * width:
            usual[trial, name] = float(np.median(np.diff(time)))
    if not usual:
        return [], 0.0
    step = _NEAR * float(np.median(list(usual.values())))
    trials = list(dict.fromkeys(trial for trial, _ in usual))
    late, now, early = (problem.readings(found.values, forms, trials, shift) for shift in (step, 0.0, -step))
    for trial in trials:
        samples, measured = problem.samples(trial), problem.compare(found.values, forms, trial)
        for name in (name for name in clock if (trial, name) in usual):
            rows = np.flatnonzero(samples.channel == name)
            rest = (measured[name]["measured"] - measured[name]["model"]) / samples.std[rows]
            after, before = (late[trial] - now[trial])[rows], (now[trial] - early[trial])[rows]
            # a jump, or a bend that no slope describes
            smooth = np.abs(after - before) < np.maximum(0.5, 0.3 * np.abs(after + before))
            slope = (after + before) / (2 * step)
            steps = np.concatenate([[np.inf], np.diff(samples.time[rows])])
            good = smooth & np.isfinite(rest) & np.isfinite(slope)
            ends = np.lib.stride_tricks.sliding_window_view
            kept = ends(good, width).all(axis=1) & (ends(steps, width)[:, 1:] < 2.5 * usual[trial, name]).all(axis=1)
            square = (ends(rest, width)[kept] @ weights) ** 2
            steep = ends(slope, width)[kept] ** 2 @ weights**2
            total = float(weights @ weights)
            windows.append(_Windows(trial, clock.index(name), square / total, steep / total))
    return windows, max(usual.values())


def _likeliest(windows: Sequence[_Windows], weights: Array, longest: float, *, sure: float = _SURE) -> float | None:
    """The jitter [s] that the differences call for; None where they do not, or not in most trials."""
    count = 1 + max(w.channel for w in windows)
    channel = np.concatenate([np.full(len(w.square), w.channel) for w in windows])
    square, slope = np.concatenate([w.square for w in windows]), np.concatenate([w.slope for w in windows])
    # Neighbouring differences are correlated: so many of them are one.
    repeat = float((np.correlate(weights, weights, "full") ** 2).sum() / (weights @ weights) ** 2)

    def cost(variance: Array) -> Array:
        return (np.log(variance) + np.minimum(square / variance, _MOST)) / repeat

    def variances(numbers: Array) -> Array:
        noise: Array = np.exp(np.clip(numbers[:count], -20, 20))[channel]
        return noise + (slope * np.exp(2 * numbers[count]) if len(numbers) > count else 0.0)

    def total(numbers: Array) -> float:
        return float(cost(variances(numbers)).sum())

    level = [np.log(max(float(np.median(square[channel == k])) / 0.455, 1e-6)) if (channel == k).any() else 0.0
             for k in range(count)]  # fmt: skip
    without = minimize(total, level, method="Nelder-Mead")
    steep = float(np.quantile(slope, 0.9))
    if steep <= 0:
        return None
    begun = [*without.x, 0.5 * np.log(np.exp(np.mean(without.x)) / steep)]
    best = minimize(total, begun, method="Nelder-Mead", options={"maxiter": 1000})
    std = float(np.exp(best.x[count]))
    if without.fun - best.fun < sure or std > longest:
        return None
    if sure:
        plain, shaken = variances(without.x), variances(best.x)
        gain = cost(plain) - cost(shaken)
        expected = (np.log(plain / shaken) + shaken / plain - 1) / repeat
        owner = np.concatenate([np.full(len(w.square), w.trial) for w in windows])
        gains = [float(gain[owner == trial].sum()) for trial in dict.fromkeys(owner.tolist())
                 if float(expected[owner == trial].sum()) > _SLOPES]  # fmt: skip
        if not gains or np.mean(np.array(gains) > 0) < _SHARE:
            return None
    return std
