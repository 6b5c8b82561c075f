"""Which parameters give the figures wanted, from few and noisy simulations: a response surface, and what it says.

Each observable's response y(x) over the parameters, x scaled to 0..1, is a Gaussian process about a straight trend
(universal kriging; Rasmussen & Williams 2006, sections 2.2, 2.7 and 5.4):
    y_i = b0 + b x_i + f(x_i) + noise,  cov f = s^2 exp(-|(x - x') / l|^2 / 2),  noise of variance e_i^2 + n^2,
e_i the standard error that a test reports and n the scatter of seeds beyond that. s, l and n are those of the
largest restricted likelihood, with wide priors, as a handful of points says little about them; b has none.

The fit weighs every point of the parameters' box by exp(-chi^2 / 2), chi^2 = sum (y - target)^2 / (tolerance^2 +
variance of y): a tolerance counts as a standard deviation, and what the surface does not know counts with it.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import optimize
from scipy.linalg import cho_factor, cho_solve
from scipy.stats import qmc

__all__ = ["Fit", "Response", "Wanted", "design", "find_best", "next_point"]

_TRIES = 2048
"""Points of the box at which the fit is weighed."""
_NEAR = 0.02
"""No point nearer than this to one that was simulated is simulated; a best one as near to an edge lies on it."""
_VAGUE = 0.8
"""A parameter is not known whose standard deviation is more than this share of an even spread's over its range."""


class Response:
    """The response of one observable to the parameters, learnt from simulations.

    Attributes:
        scatter: n, the standard deviation between seeds beyond the errors that the tests report, in the observable's
            unit. length: l [of the range], shape [parameter_count].
    """

    def __init__(self, x: np.ndarray, y: np.ndarray, error: np.ndarray):
        """``x``: scaled to 0..1, shape [n, parameter_count]; ``y``, ``error``: its standard error, shape [n].

        Raises ValueError for fewer points than a straight trend has numbers, plus one.
        """
        x, y, error = (np.asarray(a, dtype=float) for a in (x, y, error))
        count, width = x.shape
        if count < width + 2:
            raise ValueError(f"{count} points are too few for {width} parameters: at least {width + 2} are needed")
        self._unit = max(float(np.std(y)), float(error.max()), 1e-300)
        self._x, self._y, self._error = x, y / self._unit, error / self._unit
        self._trend = np.column_stack([np.ones(count), x])
        starts = [np.array([math.log(a), *([math.log(b)] * width), math.log(0.1)]) for a, b in ((0.3, 0.4), (1.0, 1.0))]
        bounds = [(math.log(0.01), math.log(10.0)), *([(math.log(0.15), math.log(5.0))] * width), (-7.0, 1.0)]
        found = min(
            (optimize.minimize(self._badness, start, method="L-BFGS-B", bounds=bounds) for start in starts),
            key=lambda one: one.fun,
        )
        self._log = found.x
        self.length = np.exp(found.x[1:-1])
        self.scatter = float(math.exp(found.x[-1]) * self._unit)
        self._factor, self._weights, self._beta = self._solve(found.x)[:3]

    def _kernel(self, a: np.ndarray, b: np.ndarray, log: np.ndarray) -> np.ndarray:
        gap = (a[:, None, :] - b[None, :, :]) / np.exp(log[1:-1])
        return math.exp(2 * log[0]) * np.exp(-0.5 * (gap**2).sum(axis=2))

    def _solve(self, log: np.ndarray):
        noise = self._error**2 + math.exp(2 * log[-1]) + 1e-8
        factor = cho_factor(self._kernel(self._x, self._x, log) + np.diag(noise), lower=True)
        normal = self._trend.T @ cho_solve(factor, self._trend)
        beta = np.linalg.solve(normal, self._trend.T @ cho_solve(factor, self._y))
        rest = self._y - self._trend @ beta
        return factor, cho_solve(factor, rest), beta, normal, rest

    def _badness(self, log: np.ndarray) -> float:
        """-2 log of the restricted likelihood times priors: l about half the range, n about a tenth of y's spread."""
        factor, weights, _, normal, rest = self._solve(log)
        likelihood = 2 * np.log(np.diag(factor[0])).sum() + np.linalg.slogdet(normal)[1] + rest @ weights
        priors = (log[0] / 1.0) ** 2 + (((log[1:-1] - math.log(0.6)) / 0.7) ** 2).sum() + ((log[-1] + 2.3) / 1.0) ** 2
        return float(likelihood + priors)

    def at(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Response and its standard deviation, without the noise of a further test; ``x`` of shape [m, width]."""
        x = np.atleast_2d(np.asarray(x, dtype=float))
        trend = np.column_stack([np.ones(len(x)), x])
        cross = self._kernel(x, self._x, self._log)
        back = cho_solve(self._factor, cross.T)
        mean = trend @ self._beta + cross @ self._weights
        off = trend - back.T @ self._trend
        normal = self._trend.T @ cho_solve(self._factor, self._trend)
        variance = math.exp(2 * self._log[0]) - (cross * back.T).sum(axis=1)
        variance += (off * np.linalg.solve(normal, off.T).T).sum(axis=1)
        return self._unit * mean, self._unit * np.sqrt(np.maximum(variance, 0.0))


@dataclass(frozen=True)
class Wanted:
    """What an observable should be, and how nearly."""

    value: float
    tolerance: float


Surfaces = Mapping[str, Response]
Goals = Mapping[str, Wanted]
Ranges = Mapping[str, Sequence[float]]
"""Of every observable the response, of every figure what it should be, of every parameter both ends."""


@dataclass(frozen=True)
class Fit:
    """The parameters found. Arrays of shape [parameter_count], in the parameters' units."""

    best: np.ndarray  # of the smallest chi^2
    std: np.ndarray  # standard deviations, of tolerances and of what is not known of responses
    low: np.ndarray  # between this and `high` lie two thirds of the weight
    high: np.ndarray
    correlation: np.ndarray  # shape [parameter_count, parameter_count]
    chi2: float  # at the best point
    response: dict[str, float]  # what is expected there of every observable
    response_std: dict[str, float]
    at_edge: dict[str, str]  # parameters whose best value lies at an end of their range, with which end
    vague: tuple[str, ...]  # parameters about which the figures say next to nothing


def design(ranges: Ranges, count: int, *, seed: int) -> np.ndarray:
    """The first points to simulate, in units, shape [count, parameter_count].

    One parameter: evenly from end to end. Several: a Latin hypercube whose points keep off one another (scipy's
    ``qmc.LatinHypercube``, random-CD), stretched so that it reaches the ends.
    """
    low, high = np.array([tuple(pair) for pair in ranges.values()]).T
    if len(low) == 1:
        x = np.linspace(0.0, 1.0, count)[:, None]
    else:
        x = qmc.LatinHypercube(len(low), optimization="random-cd", rng=np.random.default_rng(seed)).random(count)
        x = (x - x.min(axis=0)) / (x.max(axis=0) - x.min(axis=0))
    return low + x * (high - low)


def _weigh(
    responses: Surfaces, wanted: Goals, x: np.ndarray
) -> tuple[np.ndarray, dict[str, tuple[np.ndarray, np.ndarray]]]:
    chi2, found = np.zeros(len(x)), {}
    for name, response in responses.items():
        mean, std = found[name] = response.at(x)
        if name in wanted:
            chi2 += (mean - wanted[name].value) ** 2 / (wanted[name].tolerance ** 2 + std**2)
    return chi2, found


def find_best(responses: Surfaces, wanted: Goals, ranges: Ranges) -> Fit:
    """The parameters whose expected figures come nearest to those wanted, and how well they are known."""
    names = list(ranges)
    low, high = np.array([tuple(pair) for pair in ranges.values()]).T
    x = qmc.Sobol(len(names), scramble=False).random(_TRIES)
    chi2, _ = _weigh(responses, wanted, x)
    found = [
        optimize.minimize(
            lambda at: float(_weigh(responses, wanted, np.clip(at, 0, 1)[None, :])[0][0]),
            x[k],
            method="Nelder-Mead",
            bounds=[(0.0, 1.0)] * len(names),
            options={"xatol": 1e-4, "fatol": 1e-6},
        )
        for k in np.argsort(chi2)[:3]
    ]
    best = min(found, key=lambda one: one.fun)
    at = np.clip(best.x, 0.0, 1.0)
    weight = np.exp(-0.5 * (chi2 - min(best.fun, chi2.min())))
    weight /= weight.sum()
    mean = weight @ x
    off = x - mean
    cov = (off * weight[:, None]).T @ off
    std = np.sqrt(np.diag(cov))
    order = np.argsort(x, axis=0)
    shares = (np.cumsum(weight[order[:, k]]) for k in range(len(names)))
    ends = np.array([np.interp([1 / 6, 5 / 6], share, x[order[:, k], k]) for k, share in enumerate(shares)])
    _, expected = _weigh(responses, wanted, at[None, :])
    return Fit(
        best=low + at * (high - low),
        std=std * (high - low),
        low=low + ends[:, 0] * (high - low),
        high=low + ends[:, 1] * (high - low),
        correlation=cov / np.maximum(np.outer(std, std), 1e-300),
        chi2=float(best.fun),
        response={name: float(pair[0][0]) for name, pair in expected.items()},
        response_std={name: float(pair[1][0]) for name, pair in expected.items()},
        at_edge={
            name: "lower" if a < _NEAR else "upper" for name, a in zip(names, at, strict=True) if min(a, 1 - a) < _NEAR
        },
        vague=tuple(name for name, s in zip(names, std, strict=True) if s > _VAGUE / math.sqrt(12)),
    )


def next_point(
    responses: Surfaces, wanted: Goals, ranges: Ranges, done: np.ndarray, *, enough: float
) -> np.ndarray | None:
    """Where one more simulation informs most, in units, shape [parameter_count]; None where no more is needed.

    It is where the weight times the largest standard deviation, over the tolerance, is greatest. Enough is known once
    that ratio is below ``enough`` at the best point for every figure that is fitted.

    ``done``: what was simulated, in units, shape [n, parameter_count].
    """
    low, high = np.array([tuple(pair) for pair in ranges.values()]).T
    fit = find_best(responses, wanted, ranges)
    if all(fit.response_std[name] < enough * one.tolerance for name, one in wanted.items()):
        return None
    x = np.vstack([qmc.Sobol(len(low), scramble=False).random(_TRIES), (fit.best - low) / (high - low)])
    chi2, found = _weigh(responses, wanted, x)
    worst = np.max([found[name][1] / one.tolerance for name, one in wanted.items()], axis=0)
    gain = np.exp(-0.5 * (chi2 - chi2.min())) * worst
    there = (np.asarray(done) - low) / (high - low)
    gap = np.sqrt(((x[:, None, :] - there[None, :, :]) ** 2).sum(axis=2)).min(axis=1)
    gain[gap < _NEAR] = 0.0
    return low + x[int(np.argmax(gain))] * (high - low)
