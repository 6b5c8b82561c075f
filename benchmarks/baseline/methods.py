"""What stands beside `hedgebed diagnose` in its benchmark: two ways to learn a discrepancy from the same data.

- ``pysindy``: sparse regression (STLSQ) of the residual acceleration on a library of terms;
- ``gaussian process``: scikit-learn's, with a length scale for every state.

Both get what diagnose got: the fitted base model, the same trials to learn from, the same held-out trials. Trials are
left out in turn. Both say that something is missing where what they learnt predicts their residuals better than zero
does (Wilcoxon's signed ranks over quarters of trials, at 5 %). Then the discrepancy is added to the base model, which
is run again on the held-out trials (`residuals`). Neither knows names; `points_to` holds the effects whose force would
look like the term of the sparse law that moves most.

They need ``pip install .[bench]``; `missing` says so where they are not there.
"""

import math
import time
import warnings
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from importlib.util import find_spec
from typing import Any, Self

import numpy as np
from scipy import stats

from experiments.campaign import Campaign
from experiments.diagnose.experiment import make_problem

from .residuals import NAMES, STANDING, Array, Rows, held_out_gap, make_rows

__all__ = ["METHODS", "missing", "points_to", "try_all"]

_LEVEL = 0.05
_THRESHOLDS = (0.05, 0.1, 0.2, 0.4, 0.8, 1.6, 3.2, 6.4, 12.8)
"""Least size of a term that is kept: root mean square of what it moves, over the noise of a row."""
_FOLDS = 3
_PARTS = 4  # of a trial left out, in time, whose gains are ranked: campaigns have few trials
_MOST_ROWS = 200  # of a Gaussian process: its cost grows with the cube of this
_FULL = 500  # rows of a trial that the sparse regression looks at


class Regressor(ABC):
    """Learns targets of a kind of trial, in units of their noise, from states."""

    def __init__(self, kind: str) -> None:
        self._kind = kind
        self.terms: list[tuple[str, str, float]] = []
        """(target, term, size over the noise of a row), the largest first; none where it has none."""

    @abstractmethod
    def fit(self, rows: Sequence[Rows]) -> Self:
        """Learn, settings of its own and all."""

    @abstractmethod
    def predict(self, state: Array) -> Array:
        """Targets in units of their noise, shape [row_count, target_count]."""


def missing() -> str:
    """What to install, in a sentence; empty where all is there."""
    lacking = " and ".join(name for name in ("pysindy", "sklearn") if find_spec(name) is None)
    return f"no baselines: {lacking} not installed (pip install .[bench])" if lacking else ""


def try_all(
    campaign: Campaign, values: Mapping[str, float], fitted: Sequence[str], held_out: Sequence[str]
) -> dict[str, dict[str, Any]]:
    """What each baseline says of a campaign: alarm, terms, before, after, seconds.

    ``campaign``: as diagnose read it. ``values``: of the fitted base model, the held-out trials' own nuisances with it.
    ``fitted``: trials to learn from. ``held_out``: trials to be predicted.
    """
    problem = make_problem(campaign)
    rows = make_rows(problem, values, fitted)
    before = {"fit": None, "held_out": held_out_gap(problem, values, held_out, None)}
    told = {}
    for name, make in METHODS.items():
        began = time.monotonic()
        told[name] = _try(problem, make, rows, values, held_out, before) | {"seconds": time.monotonic() - began}
    return told


def _try(
    problem: Any, make: Callable[[str], Regressor], rows: Sequence[Rows], values: Mapping[str, float],
    held_out: Sequence[str], before: dict[str, Any],
) -> dict[str, Any]:  # fmt: skip
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of convergence, and of columns that are zero
        learnt = make(problem.kind)
        alarm = False
        if len(rows) >= 3:
            gains = []
            for left, others in _folds(rows):
                law = make(problem.kind).fit(others)  # settings too: they must not have seen what is left out
                for one in left:
                    target = one.target / one.std
                    gain = np.sum(target**2 - (target - law.predict(one.state)) ** 2, axis=1)
                    gains += [float(part.mean()) for part in np.array_split(gain, _PARTS)]
            alarm = _better(np.array(gains))
            if alarm:
                learnt.fit(rows)
    told: dict[str, Any] = {"alarm": alarm, "before": before, "after": before}
    if learnt.terms or isinstance(learnt, SparseLaw):
        told |= {"terms": [list(term) for term in learnt.terms[:8]] if alarm else [],
                 "points_to": sorted(points_to(learnt.terms)) if alarm else []}  # fmt: skip
    if alarm:
        known = np.concatenate([learnt.predict(one.state) for one in rows])
        bounds, std = (known.min(axis=0), known.max(axis=0)), rows[0].std

        def force(state: Array) -> Array:
            """[row_count, target_count], never beyond what was learnt: neither knows what lies outside."""
            return np.clip(learnt.predict(state), *bounds) * std

        told["after"] = {"fit": None, "held_out": held_out_gap(problem, values, held_out, force)}
    return told


def _folds(rows: Sequence[Rows]) -> list[tuple[list[Rows], list[Rows]]]:
    """(Left out, the others), at most `_FOLDS` times; with few trials every one is left out alone."""
    count = min(len(rows), _FOLDS)
    return [(list(rows[k::count]), [one for j, one in enumerate(rows) if j % count != k]) for k in range(count)]


def _better(gains: Array) -> bool:
    """Whether parts of trials gain rather than lose, by the signed ranks: at most one false alarm in twenty."""
    if len(gains) < 3 or not gains.any():
        return False
    return bool(stats.wilcoxon(gains, alternative="greater").pvalue <= _LEVEL)


class SparseLaw(Regressor):
    """STLSQ of pysindy on polynomials of degree 2 and the usual friction and drag terms, a threshold for each target.

    The threshold is that which predicts trials left out in turn best, no term at all among the choices.
    """

    def fit(self, rows: Sequence[Rows]) -> Self:
        states = np.concatenate([_thinned(one.state, _FULL) for one in rows])
        self._scale = np.maximum(np.std(states, axis=0), 1e-12)
        self._weights = self._solve(*self._columns(rows), self._choose(rows))
        library = self._library(states)
        targets = np.concatenate([one.target / one.std for one in rows])
        self._range = (targets.min(axis=0), targets.max(axis=0))  # polynomials run away beyond what was seen
        size = np.sqrt(np.mean((library[:, :, None] * self._weights[None]) ** 2, axis=0))  # [term, target]
        found = [(target, name, float(size[k, j])) for j, target in enumerate(STANDING[self._kind])
                 for k, name in enumerate(self._names) if self._weights[k, j] != 0]  # fmt: skip
        self.terms = sorted(found, key=lambda term: -term[2])
        return self

    def predict(self, state: Array) -> Array:
        return np.clip(self._library(state) @ self._weights, *self._range)

    def _choose(self, rows: Sequence[Rows]) -> list[float]:
        """For each target the threshold with the least error on trials left out; infinite for no term."""
        count = rows[0].target.shape[1]
        every = (*_THRESHOLDS, math.inf)
        errors = np.zeros((len(every), count))
        for left, others in _folds(rows):
            library, target = self._columns(left)
            learnt = self._columns(others)
            for k, threshold in enumerate(every):
                guess = library @ self._solve(*learnt, [threshold] * count)
                guess = np.clip(guess, learnt[1].min(axis=0), learnt[1].max(axis=0))
                errors[k] += np.mean((target - guess) ** 2, axis=0)
        return [every[int(np.argmin(errors[:, j]))] for j in range(count)]

    def _columns(self, rows: Sequence[Rows]) -> tuple[Array, Array]:
        library = self._library(np.concatenate([_thinned(one.state, _FULL) for one in rows]))
        return library, np.concatenate([_thinned(one.target / one.std, _FULL) for one in rows])

    @staticmethod
    def _solve(library: Array, target: Array, thresholds: Sequence[float]) -> Array:
        from pysindy import STLSQ

        moved = np.sqrt(np.mean(library**2, axis=0))
        here = moved > 1e-9
        weights = np.zeros((library.shape[1], target.shape[1]))
        for threshold in {one for one in thresholds if math.isfinite(one)}:
            own = [j for j, one in enumerate(thresholds) if one == threshold]
            law = STLSQ(threshold=threshold, alpha=1e-3 * len(library), max_iter=10)
            law.fit(library[:, here] / moved[here], target[:, own])
            weights[np.ix_(here, own)] = np.atleast_2d(law.coef_).T / moved[here][:, None]
        return weights

    def _library(self, state: Array) -> Array:
        names = NAMES[self._kind]
        powers, terms = _polynomials(self._kind)
        told = list(terms)
        scaled = state / self._scale
        flag = scaled[:, -1:] * self._scale[-1]
        smooth = scaled[:, :-1] if self._kind == "tumble" else scaled[:, :-1] * flag
        columns = [np.prod(smooth[:, None, :] ** powers[None], axis=2)]
        for place, name in enumerate(names[:-1]):
            if name in ("vx", "vy", "omega", "v"):
                speed = smooth[:, place : place + 1]
                columns += [np.tanh(speed / 0.05), speed * np.abs(speed)]
                told += [f"sign({name})", f"|{name}|{name}"]
        if self._kind == "tumble":
            columns += [flag, flag * smooth, flag * np.tanh(smooth[:, 3:4] / 0.05)]
            told += ["touch", *(f"touch*{name}" for name in names[:-1]), "touch*sign(vx)"]
        else:
            columns.append((smooth[:, 2:3] > 0.02).astype(float))
            told.append("on the way back")
        self._names = told
        library = np.concatenate(columns, axis=1)
        return library if self._kind == "tumble" else library * flag  # a bed pushes where the spike is in it


@cache
def _polynomials(kind: str) -> tuple[Array, tuple[str, ...]]:
    """Powers [term, state] and names of pysindy's polynomials: of degree 2 for tumbles, 3 for penetration."""
    from pysindy import PolynomialLibrary

    names = NAMES[kind][:-1]
    library = PolynomialLibrary(degree=2 if kind == "tumble" else 3)
    library.fit(np.zeros((2, len(names))))
    powers = np.asarray(library.powers_, dtype=float)
    return powers, tuple(name.replace(" ", "*") for name in library.get_feature_names(names))


class Process(Regressor):
    """A Gaussian process for each target: squared exponential with a length a state, plus white noise.

    Amplitude, lengths and noise maximise the marginal likelihood of at most `_MOST_ROWS` rows, taken evenly.
    """

    def fit(self, rows: Sequence[Rows]) -> Self:
        from sklearn.gaussian_process import GaussianProcessRegressor
        from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

        each = max(1, _MOST_ROWS // len(rows))
        states = np.concatenate([_thinned(one.state, each) for one in rows])
        targets = np.concatenate([_thinned(one.target / one.std, each) for one in rows])
        self._centre, self._scale = states.mean(axis=0), np.maximum(states.std(axis=0), 1e-9)
        self._rows = (states - self._centre) / self._scale
        self._laws: list[tuple[float, Array, Array]] = []
        for j in range(targets.shape[1]):
            kernel = ConstantKernel(1.0, (1e-4, 1e5)) * RBF(np.full(states.shape[1], 2.0), (0.05, 1e3))
            kernel = kernel + WhiteKernel(1.0, (0.3, 1e4))
            law = GaussianProcessRegressor(kernel, alpha=1e-8, optimizer=_climb)
            law.fit(self._rows, targets[:, j])
            size, lengths = float(law.kernel_.k1.k1.constant_value), np.atleast_1d(law.kernel_.k1.k2.length_scale)
            self._laws.append((size, lengths, np.asarray(law.alpha_).ravel()))
        return self

    def predict(self, state: Array) -> Array:
        here = (state - self._centre) / self._scale
        columns = []
        for size, lengths, weights in self._laws:
            away = (here[:, None, :] - self._rows[None]) / lengths
            columns.append(size * np.exp(-0.5 * np.einsum("ijk,ijk->ij", away, away)) @ weights)
        return np.stack(columns, axis=1)


def _climb(objective: Any, start: Array, bounds: Array) -> tuple[Array, float]:
    """scikit-learn's optimiser with an end: 25 rounds find lengths and sizes to a few percent."""
    from scipy.optimize import minimize

    found = minimize(objective, start, jac=True, method="L-BFGS-B", bounds=bounds, options={"maxiter": 25})
    return found.x, float(found.fun)


METHODS: dict[str, Callable[[str], Regressor]] = {"pysindy": SparseLaw, "gaussian process": Process}


def _thinned(values: Array, most: int) -> Array:
    """At most `most` rows, evenly."""
    return values[np.linspace(0, len(values) - 1, min(most, len(values))).round().astype(int)]


_POINTS: Mapping[str, Sequence[tuple[str, str, str]]] = {
    # effect: (target, what the term must hold, what it must not), any of them
    "pendulum": (("force x", "x", "vx touch"),),
    "slope": (("force x", "1", ""),),
    "rig-friction": (("force y", "sign(vy)", ""), ("force y", "vy", "")),
    "com-offset": (("torque", "1", ""), ("torque", "theta", ""), ("force x", "omega^2", ""),
                   ("force y", "omega^2", "")),
    "umbilical": (("torque", "theta", ""), ("torque", "omega", "sign")),
    "bearing-drag": (("torque", "sign(omega)", ""), ("torque", "touch", "touch*")),
    "torque-fade": (("torque", "wheel", ""),),
    "wheel-vibration": (("force x", "wheel", ""),),
    "rate-friction": (("force x", "vx", ""),),
    "inertial-drag": (("force y", "|vy|vy", ""), ("force y", "vy^2", ""), ("force x", "|vx|vx", ""),
                      ("force", "v^2", ""), ("force", "|v|v", "")),
    "depth-hardening": (("force", "z^2", ""), ("force", "z^3", ""), ("force y", "y", "vy")),
    "plastic-sinkage": (("force", "back", ""),),
    "adhesion": (("force", "back", ""),),
    "shaft-friction": (("force", "sign(v)", ""),),
    "layering": (("force", "1", ""), ("force", "z^2", ""), ("force", "z^3", "")),
}  # fmt: skip
"""Generously: every effect that could make this the loudest term. Effects of contact and sensors leave no term of their
own (tip-radius, pulley-inertia, clock-offset, camera-scale): nothing points to them."""


def points_to(terms: Sequence[tuple[str, str, float]]) -> set[str]:
    """Effects that the loudest term of a sparse law would come from; empty where there is none."""
    if not terms:
        return set()
    target, name, _ = max(terms, key=lambda term: term[2])
    return {
        effect
        for effect, signs in _POINTS.items()
        for where, holds, lacks in signs
        if where == target
        and (name == holds if len(holds) == 1 else holds in name)
        and not any(word in name for word in lacks.split())
    }
