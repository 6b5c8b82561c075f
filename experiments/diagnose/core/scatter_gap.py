"""The gap against the scatter of replicates as well: is the model as good as another bed, or another run, is?

`gap` has the sensors' noise alone (docs/diagnose.md). Where replicates differ by more, no law of the mean bed can reach
1, and this says how near it comes: the same sum with the variance between replicates added, row by row. A factor of a
trial's own (`bed`, `friction`: relative) adds what one standard deviation of it changes in the reading; the wander of
replicates (`wander`: in the channel's unit) adds its mean square.

Its standard error: a delete-one-trial jackknife of the weighted sum (Efron and Stein, Ann. Stat. 9 (1981), 586), which
holds chi-square's own chance and that of few trials, and the chance of the scatter itself, whose variance rests on as
many degrees of freedom as there are trials beyond one a condition: its relative error is sqrt(2 / freedom), taken for
the share of the whole variance that it is.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from experiments.diagnose.fit.problem import Array, Form, Problem, Values
from experiments.diagnose.noise.replicates import groups_of

__all__ = ["ScatterGap", "gap_with_scatter", "scatter_std", "weighed_residuals"]

_LOST = 1e3  # residual over the noise where the model cannot be integrated

Pair = tuple[float, float | None]
Stds = Mapping[str, float]


@dataclass(frozen=True)
class ScatterGap:
    """Chi-square per valid sample against the sensors' noise and the scatter of replicates. Each is a pair: of the
    fitted trials and of those held out (None where there are none)."""

    before: Pair  # of the base model
    after: Pair  # of the best model
    after_std: tuple[float | None, float | None]  # standard errors of `after`; None of a single trial
    freedom: int  # degrees of freedom of the scatter: trials that have replicates less their conditions


def gap_with_scatter(
    problem: Problem, model_std: Stds, stages: Sequence[tuple[Values, Sequence[Form]]], fitted: Sequence[str],
    held_out: Sequence[str], *, scattered: Sequence[str] | None = None,
) -> ScatterGap | None:  # fmt: skip
    """The gap of the base model, the first of `stages`, and of the best model, the last; None without scatter.

    `scattered`: trials from whose replicates `model_std` was estimated; None: all.
    """
    if not model_std:
        return None
    whose = (*fitted, *held_out) if scattered is None else scattered
    groups = groups_of([t for t in problem.trials if t.id in whose])
    freedom = sum(len(ids) - 1 for ids in groups.values())
    sums = [
        [
            _per_sample(problem, model_std, values, forms, trials, freedom) if trials else (math.nan, None)
            for trials in (fitted, held_out)
        ]
        for values, forms in stages
    ]
    before, after = ((stage[0][0], stage[1][0] if held_out else None) for stage in (sums[0], sums[-1]))
    return ScatterGap(before, after, (sums[-1][0][1], sums[-1][1][1]), freedom)


def _per_sample(
    problem: Problem, model_std: Stds, values: Values, forms: Sequence[Form], trials: Sequence[str], freedom: int
) -> Pair:
    """The weighted sum over all readings that count, and its standard error."""
    found = weighed_residuals(problem, model_std, values, forms, trials)
    totals, counts, of_scatter = [], [], []
    for trial in trials:
        stds, wide = problem.sensor_std(values, forms, trial), scatter_std(problem, model_std, values, forms, trial)
        channel = problem.samples(trial).channel
        counted, share = np.zeros(len(channel), dtype=bool), np.zeros(len(channel))
        for name in stds:
            counted[channel == name] = np.isfinite(stds[name])
            with np.errstate(invalid="ignore", divide="ignore"):
                share[channel == name] = wide[name] ** 2 / (wide[name] ** 2 + stds[name] ** 2)
        rest = found[trial][counted]
        totals.append(float(rest @ rest))
        counts.append(len(rest))
        of_scatter.append(float((share[counted] * rest**2).sum()))
    whole, rows = float(np.sum(totals)), int(np.sum(counts))
    value = whole / max(rows, 1)
    if len(trials) < 2 or freedom < 1:
        return value, None
    without = np.array([(whole - total) / max(rows - count, 1) for total, count in zip(totals, counts, strict=True)])
    jackknife = (len(without) - 1) * float(without.var())
    loose = float(np.sum(of_scatter)) / max(rows, 1) * math.sqrt(2 / freedom)
    return value, math.hypot(math.sqrt(jackknife), loose)


def weighed_residuals(
    problem: Problem, model_std: Stds, values: Values, forms: Sequence[Form], trials: Sequence[str]
) -> dict[str, Array]:
    """(measured - model) over the root of the sensors' variance and that between replicates: trial -> shape
    [sample_count]."""
    found = {}
    for trial in trials:
        channel = problem.samples(trial).channel
        stds, wide = problem.sensor_std(values, forms, trial), scatter_std(problem, model_std, values, forms, trial)
        found[trial] = np.zeros(len(channel))
        for name, columns in problem.compare(values, forms, trial).items():
            rest = (columns["measured"] - columns["model"]) / np.hypot(stds[name], wide[name])
            found[trial][channel == name] = np.where(np.isfinite(rest), rest, _LOST)
    return found


def scatter_std(
    problem: Problem, model_std: Stds, values: Values, forms: Sequence[Form], trial: str
) -> dict[str, Array]:
    """By how much replicates of a trial differ beyond the sensors at each reading: channel -> std, in its unit."""
    here = problem.compare(values, forms, trial)
    variance = {name: np.full(len(columns["t_s"]), model_std.get(name, 0.0) ** 2) for name, columns in here.items()}
    own = {kind: p for kind, ps in problem.scatter.items() for p in ps if kind in model_std and p.trial == trial}
    for kind, p in own.items():
        ends = [float(np.clip(p.value + step, p.lowest, p.highest)) for step in (model_std[kind], -model_std[kind])]
        high, low = (problem.compare({**values, p.name: end}, forms, trial) for end in ends)
        for name in variance:
            change = 0.5 * (high[name]["model"] - low[name]["model"])
            variance[name] += np.where(np.isfinite(change), change, 0.0) ** 2
    return {name: np.sqrt(each) for name, each in variance.items()}
