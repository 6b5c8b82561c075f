"""What a fit of pushes and drops comes to with ever more readings: the same model, rows and weights, without noise.

A model of another structure than the bed's has no other limit (H. White 1982, Econometrica 50, 1-25), and which one it
is depends on which rows count for how much. So standard errors, which count random errors only, are judged by it.
"""

import copy
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from experiments.diagnose.fit.fitting import Fit, fit
from experiments.diagnose.fit.problem import Array

from .data import Prepared
from .problem import PenetrationProblem

__all__ = ["Readings", "limit_of"]

Readings = Mapping[str, Mapping[str, Array]]
"""Trial id -> columns `t_s`, `depth_m`, and `force_N` or `accel_m_s2`, SI units."""
_FITS = 10  # one after another, at most
_STILL = 0.02  # standard errors by which the last one may move a number


def limit_of(found: Fit, readings: Readings) -> Fit:
    """The fit of the same model with the same rows and weights, to `readings` of its trials without noise.

    The path of a push is the one that was read, not smoothed: what smoothing changes of it is an error of the fit.

    Raises ValueError where a trial has no reading, RuntimeError where the fit does not converge.
    """
    problem = found.model.problem
    if not isinstance(problem, PenetrationProblem):
        raise ValueError(f"kind = {problem.kind!r}: 'penetration' was expected here")
    missing = sorted(set(found.model.trials) - set(readings))
    if missing:
        raise ValueError(f"trial {missing[0]!r}: readings without noise were expected")
    exact = copy.copy(problem)
    exact.prepared = {
        id: _read(trial, readings[id]) if id in readings else trial for id, trial in problem.prepared.items()
    }
    at = fit(replace(found.model, problem=exact), found.values)
    for _ in range(_FITS):
        last, at = at, fit(at.model, at.values)
        errors = np.sqrt(np.maximum(np.diag(at.covariance()), 0.0))
        moved = [abs(at.values[p.name] - last.values[p.name]) for p in at.model.parameters]
        if all(way <= _STILL * error for way, error in zip(moved, errors, strict=True)):
            return at
    names = [p.name for p in at.model.parameters]
    most = int(np.argmax([way / max(error, 1e-300) for way, error in zip(moved, errors, strict=True)]))
    raise RuntimeError(f"the fit to readings without noise still moves {names[most]} after {_FITS} fits")


def _read(trial: Prepared, columns: Mapping[str, Array]) -> Prepared:
    """The trial with these readings at its own rows."""
    time = columns["t_s"]

    def at_rows(values: Array) -> Array:
        return np.interp(trial.time, time, values)

    depth = at_rows(columns["depth_m"])
    if trial.smooth is None:
        return replace(trial, depth=depth, other=at_rows(columns["accel_m_s2"]))
    path = replace(trial.smooth, depth=depth, speed=at_rows(np.gradient(columns["depth_m"], time)))
    return replace(trial, depth=depth, other=at_rows(columns["force_N"]), smooth=path)
