"""Is anything left? Statistics of a fit's residuals, and what they are where the model is right.

The null is made by bootstrap: white noise in the modes (and in the priors: the true parameters differ from the stated
ones) with what a refit would take out of it taken out. Near the best fit a refit is a projection on the fit's Jacobian,
so that a thousand refits cost one. Instead `thorough` makes new data and refits in full, for models whose contacts make
a likelihood rough. No table of a distribution is used, but for the tails, where a gamma law of the bootstrap's own mean
and variance stands in.

How far the parameters have gone from what was stated is a statistic too: a model that fits only with numbers that the
priors all but exclude does not explain the data. Trials that were held out have a gate of their own (`held_out_gate`),
whose null holds the noise and what the fitted parameters leave uncertain.
"""

import hashlib
import json
import os
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from rigid.digests import digest_of_data

from .fitting import Fit, Model, fit, settled_slopes
from .problem import Array, Values

__all__ = ["Gate", "Verdict", "column_basis", "held_out_gate", "low_modes", "open_gate"]

LOW_MODES = 16  # modes of a channel that count as slow: half a period up to eight periods over its record
_DRAWS = 600
_FORMAT = 2  # of the files in which nulls are kept; a change of the statistics is a change of this
_OFFSET = 20.0  # added to "one trial": it may be below zero, the gamma law not
_LEVEL = 0.005  # chance that a right model is refused, of each of the two rounds of tests


@dataclass(frozen=True)
class Verdict:
    """The gate's result for one fit."""

    passed: bool
    score: float  # the most surprising statistic, as standard deviations of a normal law
    threshold: float  # what a right model exceeds in `_LEVEL` of all cases


@dataclass(frozen=True)
class Gate:
    """The null of one model on one set of trials: draws of each statistic, shape [draws, statistic_count]."""

    names: tuple[str, ...]
    mean: Array
    variance: Array
    threshold: float

    def judge(self, statistics: Mapping[str, float]) -> Verdict:
        """Compare the statistics of real residuals with the null."""
        values = np.array([statistics[name] for name in self.names])
        worst = float(_scores(values[None, :], self.mean, self.variance)[0].max())
        return Verdict(worst <= self.threshold, worst, self.threshold)


def low_modes(model: Model) -> dict[tuple[str, str], np.ndarray]:
    """Rows of the slow modes of each trial's channels, among the rows of the model."""
    found = {}
    for trial, name, rows in model.channel_rows():
        found[(trial, name)] = rows.start + np.arange(min(LOW_MODES, rows.stop - rows.start))
    return found


def _statistics(modes: Array, slow: Mapping[tuple[str, str], np.ndarray], signatures: Array) -> dict[str, Array]:
    """Statistics of draws of modes, shape [draws, n]; each of shape [draws]."""
    squares = modes**2
    energy = {key: squares[:, rows].sum(axis=1) for key, rows in slow.items()}
    found = {"all": squares.sum(axis=1), "slow": np.sum(list(energy.values()), axis=0)}
    excess = np.stack([(e - len(slow[key])) / np.sqrt(2 * len(slow[key])) for key, e in energy.items()])
    found["one trial"] = excess.max(axis=0) + _OFFSET
    channels = dict.fromkeys(name for _, name in slow)
    for name in channels:
        rows = [rows for (_, channel), rows in slow.items() if channel == name]
        count = min(len(r) for r in rows)
        together = np.sum([modes[:, r[:count]] for r in rows], axis=0) / np.sqrt(len(rows))
        found[f"together {name}"] = (together**2).sum(axis=1)
        found[f"slow {name}"] = np.sum([squares[:, r].sum(axis=1) for r in rows], axis=0)
    if signatures.shape[1]:
        found["effects"] = ((modes @ signatures) ** 2).max(axis=1)
    return found


def _scores(values: Array, mean: Array, variance: Array) -> Array:
    """Standard deviations of a normal law with the same chance, by a gamma law of this mean and variance."""
    shape = mean**2 / variance
    log_chance = stats.gamma.logsf(values, shape, scale=variance / mean)
    normal = -stats.norm.ppf(np.clip(np.exp(log_chance), 1e-300, 1 - 1e-12))
    # Beyond what the normal law's table holds, and beyond what floating point does.
    far = np.where(np.isfinite(log_chance), np.sqrt(np.maximum(-2 * log_chance, 0.0)), values / np.sqrt(variance))
    return np.where(log_chance < -600, far, normal)


def open_gate(
    found: Fit,
    *,
    signatures: Array | None = None,
    seed: int = 0,
    draws: int = _DRAWS,
    refit: bool = False,
    tell: Callable[[float], None] | None = None,
    folder: Path | None = None,
) -> tuple[Gate, Verdict]:
    """The null for this fit, and the verdict.

    `signatures`: unit vectors of what candidate effects would change, the fit's own parameters projected out, shape
    [n, k]. `refit`: make data and fit them in full, `draws` times, instead of projecting. `folder`: where nulls made by
    refits are kept: a campaign of the same design, noise and model finds it there.
    """
    slow = low_modes(found.model)
    columns = signatures if signatures is not None else np.zeros((found.count, 0))
    kept = folder / f"{_key(found, columns.shape[1], seed, draws)}.json" if folder is not None and refit else None
    gate = _read(kept)
    if gate is None:
        gate = _calibrated(found, slow, columns, seed=seed, draws=draws, refit=refit, tell=tell)
        if kept is not None:
            _write(kept, gate)
    here = {name: float(value[0]) for name, value in _statistics(found.modes[None, :], slow, columns).items()}
    here["parameters"] = _moved(found)
    return gate, gate.judge(here)


def held_out_gate(found: Fit, trials: Sequence[str], values: Values, *, seed: int = 0, draws: int = _DRAWS) -> Verdict:
    """Whether `found` predicts `trials`, which it was not fitted to, at `values` (their own nuisances refitted).

    The null: white noise, and shared parameters drawn as uncertain as the fit leaves them, with what the trials' own
    nuisances take up taken out.
    """
    model = found.model.on(trials)
    modes, jacobian = settled_slopes(model, values)
    slow = low_modes(model)
    shared = np.array([p.trial is None for p in model.parameters], dtype=bool)
    scales = np.array([p.scale for p in model.parameters])
    rows = [k for k, p in enumerate(found.model.parameters) if p.trial is None]
    covariance = found.covariance()[np.ix_(rows, rows)] / np.outer(scales[shared], scales[shared])
    free = found.free[rows]  # what a bound holds is not uncertain
    covariance = covariance * np.outer(free, free)
    sizes, turns = np.linalg.eigh(covariance)
    spread = jacobian[:, shared] @ (turns * np.sqrt(np.maximum(sizes, 0.0)))
    priors = np.array([0.0 if np.isinf(p.std) else p.scale / p.std for p in model.parameters])[~shared]
    basis, prior = np.split(column_basis(np.vstack([jacobian[:, ~shared], np.diag(priors)])), [len(modes)])
    random = np.random.default_rng(seed)
    parts, nothing = [], np.zeros((len(modes), 0))
    for _ in range(0, draws, 100):
        noise = random.standard_normal((100, len(modes))) + random.standard_normal((100, len(rows))) @ spread.T
        more = random.standard_normal((100, prior.shape[0]))
        parts.append(_statistics(noise - (noise @ basis + more @ prior) @ basis.T, slow, nothing))
    gate = _gate_of(parts)
    here = {name: float(value[0]) for name, value in _statistics(modes[None, :], slow, nothing).items()}
    return gate.judge(here)


def _calibrated(
    found: Fit, slow: Mapping[tuple[str, str], np.ndarray], columns: Array, *, seed: int, draws: int, refit: bool,
    tell: Callable[[float], None] | None,
) -> Gate:  # fmt: skip
    random = np.random.default_rng(seed)
    # What a refit takes out of data and priors: rows of the data [n, p], of the priors.
    joint = np.vstack([found.jacobian, np.diag(np.sqrt(found.prior_precision()))])
    basis, prior = np.split(column_basis(joint[:, found.free]), [found.count])
    stated = _stated(found)
    if refit:
        made = np.stack([_refitted(found, random, tell, k / draws) for k in range(draws)])
        parts = [_statistics(made, slow, columns)]
    else:
        parts = []
    moved = []
    for _ in range(0, draws, 100):
        noise = random.standard_normal((100, found.count))
        more = random.standard_normal((100, prior.shape[0]))
        weights = noise @ basis + more @ prior
        moved.append((((more - weights @ prior.T)[:, stated]) ** 2).sum(axis=1) + 1.0)
        if not refit:
            parts.append(_statistics(noise - weights @ basis.T, slow, columns))
    return _gate_of(parts, {"parameters": np.concatenate(moved)[:draws]})


def _stated(found: Fit) -> NDArray[np.bool_]:
    """Which parameters are the base model's own, with a prior that was stated; those of effects have none but ours."""
    own = {p.name for p in found.model.problem.base}
    return np.array([p.name in own and not np.isinf(p.std) for p in found.model.parameters], dtype=bool)


def _moved(found: Fit) -> float:
    """Squared standard deviations by which the base model's numbers are off what was stated, and one."""
    stated = zip(found.model.parameters, _stated(found), strict=True)
    off = [(found.values[p.name] - p.value) / p.std for p, counts in stated if counts]
    return float(np.sum(np.square(off))) + 1.0


def _gate_of(parts: Sequence[Mapping[str, Array]], more: Mapping[str, Array] | None = None) -> Gate:
    """The gate that draws of statistics make."""
    sample = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    sample |= {name: values[: len(sample["all"])] for name, values in (more or {}).items()}
    names = tuple(sample)
    table = np.stack([sample[name] for name in names], axis=1)
    mean, variance = table.mean(axis=0), np.maximum(table.var(axis=0), 1e-12)
    worst = _scores(table, mean, variance).max(axis=1)
    # The far quantile from the body: of the largest of several normal scores the law is close to Gumbel's.
    location, scale = stats.gumbel_r.fit(worst)
    threshold = float(max(stats.gumbel_r.ppf(1 - _LEVEL, location, scale), np.quantile(worst, 0.99)))
    return Gate(names, mean, variance, threshold)


def _key(found: Fit, signature_count: int, seed: int, draws: int) -> str:
    """Digest of what decides the null: design, noise, what is fitted; not the measured numbers."""
    model = found.model
    null = [
        _FORMAT, model.problem.kind, model.problem.design, model.trials, [form.id for form in model.forms],
        [(p.name, p.std) for p in model.scatter], signature_count, seed, draws, _LEVEL, LOW_MODES,
        [np.round(model.whitener.weights[trial], 6).tobytes().hex() for trial in model.trials],
    ]  # fmt: skip
    return hashlib.sha256(json.dumps(null).encode()).hexdigest()[:24]


def _read(path: Path | None) -> Gate | None:
    """The null that is kept in a file; None where there is none, or none that can be read."""
    if path is None or not path.exists():
        return None
    try:
        null = json.loads(path.read_text(encoding="utf-8"))
        if (digest := null.pop("digest", None)) is None:
            raise ValueError("an earlier version wrote it without a digest")
        if digest != digest_of_data(null):
            raise ValueError("its digest differs")
        return Gate(tuple(null["names"]), np.array(null["mean"]), np.array(null["variance"]), float(null["threshold"]))
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as problem:
        warnings.warn(f"the gate {path} cannot be read and is made anew: {problem}", stacklevel=2)
        return None


def _write(path: Path, gate: Gate) -> None:
    null = {"names": gate.names, "mean": gate.mean.tolist(), "variance": gate.variance.tolist(),
            "threshold": gate.threshold}  # fmt: skip
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        unfinished = path.with_suffix(f".{os.getpid()}")
        unfinished.write_text(json.dumps(null | {"digest": digest_of_data(null)}), encoding="utf-8")
        unfinished.replace(path)
    except OSError as problem:
        warnings.warn(f"the gate could not be kept: {problem}", stacklevel=2)


def column_basis(joint: Array) -> Array:
    """An orthonormal basis of the columns of `joint`, whatever their sizes."""
    joint = joint / np.maximum(np.linalg.norm(joint, axis=0), 1e-300)
    left, sizes, _ = np.linalg.svd(joint, full_matrices=False)
    return left[:, sizes > 1e-9 * max(float(sizes.max(initial=0.0)), 1e-300)]


def _refitted(found: Fit, random: np.random.Generator, tell: Callable[[float], None] | None, done: float) -> Array:
    """Residual modes of a full refit to data made at the fitted values."""
    if tell is not None:
        tell(done)
    model, shift = found.model, found.modes - random.standard_normal(found.count)
    made = _Shifted(model.problem, model.whitener, model.trials, model.forms, model.scatter, shift=shift)
    return fit(made, found.values, rounds=8).modes


@dataclass(frozen=True)
class _Shifted(Model):
    """A model whose data are other ones: residuals less a constant."""

    shift: Array | float = 0.0

    @property
    def unturned(self) -> Model:
        """This one: its data are modes."""
        return self

    def modes(self, residuals: Sequence[Mapping[str, Array]]) -> list[Array]:
        return [modes - self.shift for modes in super().modes(residuals)]
