"""The gap weighed against what replicates differ by as well: is the model as good as another bed, or another run, is?

`gap` has the sensors' noise alone (docs/diagnose.md). Where replicates differ by more, 1 is out of reach of any law of
the mean bed, and this says how near it comes: the same sum with the variance of what replicates differ by added, row by
row. A factor of a trial's own (`bed`, `friction`: relative) adds what one standard deviation of it changes in the
reading; what replicates do each in its own way (`unrest`: in the channel's unit) adds its mean square.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from .problem import Array, Form, Problem, Values

if TYPE_CHECKING:
    from .diagnosis import Diagnosis

__all__ = ["ScatterGap", "gap_with_scatter", "scatter_std", "sensor_std", "weighed_residuals"]

_LOST = 1e3
"""Residual over the noise where the model cannot be integrated."""


@dataclass(frozen=True)
class ScatterGap:
    """Chi-square per valid sample, the variance of what replicates differ by added to that of the sensors."""

    before: tuple[float, float | None]
    """Of the fitted trials and of those held out (None where there are none), the base model."""
    after: tuple[float, float | None]
    """The same of the best model."""


def gap_with_scatter(found: Diagnosis) -> ScatterGap | None:
    """The gap weighed against what replicates differ by; None where they differ by the sensors alone."""
    if not found.model_std:
        return None

    model_std = found.model_std

    def stage(values: Values, forms: Sequence[Form]) -> tuple[float, float | None]:
        fitted = _per_sample(found.problem, model_std, values, forms, found.fitted)
        held_out = found.held_out
        return fitted, _per_sample(found.problem, model_std, values, forms, held_out) if held_out else None

    before = stage(found.base_values, ())
    return ScatterGap(before, before if found.verdict == "none" else stage(found.best_values, found.forms))


def _per_sample(
    problem: Problem, model_std: Mapping[str, float], values: Values, forms: Sequence[Form], trials: Sequence[str]
) -> float:
    found = weighed_residuals(problem, model_std, values, forms, trials)
    count = sum(len(rest) for rest in found.values())
    return sum(float(rest @ rest) for rest in found.values()) / max(count, 1)


def weighed_residuals(
    problem: Problem, model_std: Mapping[str, float], values: Values, forms: Sequence[Form], trials: Sequence[str]
) -> dict[str, Array]:
    """(measured - model) over the root of the sensors' variance and that of what replicates differ by: trial ->
    shape [sample_count]."""
    found = {}
    for trial in trials:
        channel = problem.samples(trial).channel
        stds = sensor_std(problem, values, forms, trial)
        wide = scatter_std(problem, model_std, values, forms, trial)
        whole = np.zeros(len(channel))
        for name, columns in problem.compare(values, forms, trial).items():
            rest = (columns["measured"] - columns["model"]) / np.hypot(stds[name], wide[name])
            whole[channel == name] = np.where(np.isfinite(rest), rest, _LOST)
        found[trial] = whole
    return found


def sensor_std(problem: Problem, values: Values, forms: Sequence[Form], trial: str) -> dict[str, Array]:
    """Noise of each reading as `gap` takes it, by channel: of a driven force with the error of its depth; endless where
    a tumble was read while a contact switched."""
    samples = problem.samples(trial)
    found = {str(name): samples.std[samples.channel == name] for name in dict.fromkeys(samples.channel.tolist())}
    own: Any = getattr(problem, "gap_std", None)
    if own is not None and "force" in found:
        found["force"] = own(values, forms, trial)
    switches: Any = getattr(problem, "switches", None)
    if switches is not None:
        doubtful = switches(values, forms, [trial])[trial] != 0
        found = {name: np.where(doubtful[samples.channel == name], np.inf, std) for name, std in found.items()}
    return found


def scatter_std(
    problem: Problem, model_std: Mapping[str, float], values: Values, forms: Sequence[Form], trial: str
) -> dict[str, Array]:
    """By how much replicates of a trial differ beyond the sensors at each reading: channel -> std, in its unit."""
    here = problem.compare(values, forms, trial)
    variance = {name: np.full(len(columns["t_s"]), model_std.get(name, 0.0) ** 2) for name, columns in here.items()}
    offered: Any = getattr(problem, "scatter", {})
    for kind in (kind for kind in offered if kind in model_std):
        own = next((p for p in offered[kind] if p.trial == trial), None)
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
