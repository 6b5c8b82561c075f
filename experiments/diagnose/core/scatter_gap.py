"""The gap weighed against what replicates differ by as well: is the model as good as another bed, or another run, is?

How sure it is: a delete-one-trial jackknife of the weighed sum (Efron and Stein, Ann. Stat. 9 (1981), 586), which holds
chi-square's own chance and that of few trials, and the chance of the scatter itself, whose variance rests on as many
degrees of freedom as there are trials beyond one a condition: its relative error is sqrt(2 / freedom), taken for the
share of the whole variance that it is.

`gap` has the sensors' noise alone (docs/diagnose.md). Where replicates differ by more, 1 is out of reach of any law of
the mean bed, and this says how near it comes: the same sum with the variance of what replicates differ by added, row by
row. A factor of a trial's own (`bed`, `friction`: relative) adds what one standard deviation of it changes in the
reading; what replicates do each in its own way (`unrest`: in the channel's unit) adds its mean square.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from experiments.diagnose.fit.problem import Array, Form, Problem, Values
from experiments.diagnose.noise.replicates import groups_of

from .outcome import Diagnosis

__all__ = ["ScatterGap", "gap_with_scatter", "scatter_std", "weighed_residuals"]

_LOST = 1e3  # residual over the noise where the model cannot be integrated


@dataclass(frozen=True)
class ScatterGap:
    """Chi-square per valid sample, the variance of what replicates differ by added to that of the sensors."""

    before: tuple[float, float | None]
    """Of the fitted trials and of those held out (None where there are none), the base model."""
    after: tuple[float, float | None]  # the same of the best model
    after_std: tuple[float | None, float | None]  # standard errors of `after`; None of a single trial
    freedom: int
    """Degrees of freedom on which the replicates' scatter rests: trials that have replicates less their conditions."""


def gap_with_scatter(found: Diagnosis) -> ScatterGap | None:
    """The gap weighed against what replicates differ by; None where they differ by the sensors alone."""
    if not found.model_std:
        return None

    model_std = found.model_std

    inside = (*found.fitted, *found.held_out)
    groups = [ids for ids in groups_of([t for t in found.problem.trials if t.id in inside]).values() if len(ids) > 1]
    freedom = sum(len(ids) - 1 for ids in groups)
    stages = [(found.base_values, ()), (found.best_values, found.forms)]
    told: list[list[tuple[float, float | None]]] = [
        [
            _per_sample(found.problem, model_std, values, forms, trials, freedom) if trials else (math.nan, None)
            for trials in (found.fitted, found.held_out)
        ]
        for values, forms in (stages[:1] if found.verdict == "none" else stages)
    ]

    def gap(stage: list[tuple[float, float | None]]) -> tuple[float, float | None]:
        return stage[0][0], stage[1][0] if found.held_out else None

    first, last = told[0], told[-1]
    return ScatterGap(gap(first), gap(last), (last[0][1], last[1][1]), freedom)


def _per_sample(
    problem: Problem, model_std: Mapping[str, float], values: Values, forms: Sequence[Form], trials: Sequence[str],
    freedom: int,
) -> tuple[float, float | None]:  # fmt: skip
    """The weighed sum over all readings that count, and its standard error."""
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
    problem: Problem, model_std: Mapping[str, float], values: Values, forms: Sequence[Form], trials: Sequence[str]
) -> dict[str, Array]:
    """(measured - model) over the root of the sensors' variance and that of what replicates differ by: trial ->
    shape [sample_count]."""
    found = {}
    for trial in trials:
        channel = problem.samples(trial).channel
        stds = problem.sensor_std(values, forms, trial)
        wide = scatter_std(problem, model_std, values, forms, trial)
        whole = np.zeros(len(channel))
        for name, columns in problem.compare(values, forms, trial).items():
            rest = (columns["measured"] - columns["model"]) / np.hypot(stds[name], wide[name])
            whole[channel == name] = np.where(np.isfinite(rest), rest, _LOST)
        found[trial] = whole
    return found


def scatter_std(
    problem: Problem, model_std: Mapping[str, float], values: Values, forms: Sequence[Form], trial: str
) -> dict[str, Array]:
    """By how much replicates of a trial differ beyond the sensors at each reading: channel -> std, in its unit."""
    here = problem.compare(values, forms, trial)
    variance = {name: np.full(len(columns["t_s"]), model_std.get(name, 0.0) ** 2) for name, columns in here.items()}
    for kind in (kind for kind in problem.scatter if kind in model_std):
        own = next((p for p in problem.scatter[kind] if p.trial == trial), None)
        if own is None:
            continue
        ends = [
            float(np.clip(own.value + step, own.lowest, own.highest)) for step in (model_std[kind], -model_std[kind])
        ]
        sides = [problem.compare({**values, own.name: end}, forms, trial) for end in ends]
        for name in variance:
            change = 0.5 * (sides[0][name]["model"] - sides[1][name]["model"])
            variance[name] += np.where(np.isfinite(change), change, 0.0) ** 2
    return {name: np.sqrt(own) for name, own in variance.items()}
