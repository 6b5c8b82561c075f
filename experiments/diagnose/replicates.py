"""What replicates say: which trials are held out, scatter beyond the sensors, a trial at odds with its like."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy import stats

from .evidence import inflation
from .fitting import Fit, fit
from .gate import low_modes
from .problem import Finding, Parameter, Problem, TrialInfo

__all__ = ["exchanged", "find_scatter", "groups_of", "odd_trials", "parted", "split_trials"]

_SURE = 1e-4
_LEAST = 0.005
"""Relative scatter below this is not the bed's: the smoothing of a depth column does as much."""
_AT_ODDS = 20.0
"""How many times as far from its replicates as they are from one another, in mean square, a trial is at odds."""

_ANOTHER = 1.1
"""Ratio of two depths or durations from which on trials do not go through the same."""
_SIZEABLE = 0.2
"""And by which share of what the base model leaves it must differ: small errors of the path count for more there."""


def groups_of(trials: Sequence[TrialInfo]) -> dict[tuple[object, ...], list[str]]:
    """Condition -> ids of its trials."""
    found: dict[tuple[object, ...], list[str]] = {}
    for trial in trials:
        found.setdefault(trial.condition, []).append(trial.id)
    return found


def parted(trials: Sequence[TrialInfo], sizes: Mapping[str, Sequence[float]]) -> tuple[TrialInfo, ...]:
    """The same, those of one condition parted where they do not go through the same: trials that go half as deep, last
    half as long or do not come back are no replicates of the others.

    `sizes`: id -> what was measured of a trial (its depth, its duration), above 0, as many numbers for all trials of a
    condition. Sorted, they are cut where one exceeds the one before by more than a tenth.
    """
    found = {trial.id: trial for trial in trials}
    for ids in groups_of(trials).values():
        for numbers in zip(*(sizes[id] for id in ids), strict=True):
            order = np.argsort(numbers, kind="stable")
            ranked = np.array(numbers)[order]
            place = np.concatenate([[0], np.cumsum(ranked[1:] > _ANOTHER * ranked[:-1])])
            for k, where in zip(order, place, strict=True):
                found[ids[k]] = replace(found[ids[k]], condition=(*found[ids[k]].condition, int(where)))
    return tuple(found[trial.id] for trial in trials)


def split_trials(trials: Sequence[TrialInfo]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Trials to fit and trials held out: a quarter of them, rounded up, none below four, spread over the conditions.

    A condition gives up one of its replicates before another loses its only trial, and of conditions with one trial
    those go first whose settings others share.
    """
    if len(trials) < 4:
        return tuple(trial.id for trial in trials), ()
    wanted = math.ceil(len(trials) / 4)
    groups = groups_of(trials)
    by_id = {trial.id: trial for trial in trials}
    order = sorted(groups, key=repr)
    left = {condition: list(groups[condition]) for condition in order}
    out: list[str] = []
    while len(out) < wanted:
        spare = [c for c in order if len(left[c]) > 1]
        if spare:
            taken = {c: len(groups[c]) - len(left[c]) for c in spare}
            fewest = min(taken.values())
            spare = [c for c in spare if taken[c] == fewest]
            need = wanted - len(out)
            chosen = spare if len(spare) <= need else [spare[round((k + 0.5) * len(spare) / need - 0.5)]
                                                       for k in range(need)]  # fmt: skip
            out += [left[c].pop(-1) for c in chosen]
            continue
        single = [c for c in order if left[c]]

        def shared(condition: tuple[object, ...], single: list[tuple[object, ...]] = single) -> int:
            mine = by_id[left[condition][0]].settings
            others = [by_id[left[c][0]].settings for c in single if c != condition]
            return sum(min(1, sum(other.get(key) == value for other in others)) for key, value in mine.items())

        most = max(shared(c) for c in single)
        best = [c for c in single if shared(c) == most]
        out.append(left[best[len(best) // 2]].pop())
    held = set(out)
    return tuple(t.id for t in trials if t.id not in held), tuple(t.id for t in trials if t.id in held)


def exchanged(
    trials: Sequence[TrialInfo], fitted: Sequence[str], held_out: Sequence[str], wanted: Sequence[str]
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """A split in which the `wanted` held-out trials are fitted, and as many others held out: their replicates
    first, then trials that share most of their condition."""
    condition = {trial.id: trial.condition for trial in trials}
    held = [trial for trial in held_out if trial not in wanted]
    for trial in [trial for trial in held_out if trial in wanted]:
        left = [other for other in fitted if other not in held]
        if not left:
            break

        def shared(other: str, mine: tuple[object, ...] = condition[trial]) -> int:
            return sum(a == b for a, b in zip(condition[other], mine, strict=False))

        held.append(max(left, key=shared))
    out = set(held)
    whole = {*fitted, *held_out}
    every = [trial.id for trial in trials if trial.id in whole]
    return tuple(t for t in every if t not in out), tuple(t for t in every if t in out)


def find_scatter(found: Fit) -> tuple[tuple[Parameter, ...], dict[str, float]]:
    """Nuisances that the replicates call for, their priors estimated, and what is written as model_std.

    Each trial's own bed (or whatever the problem offers) is fitted; within a condition these must agree within their
    errors. What the model lacks is the same for all replicates as long as it is small; where it is not, each trial's
    factors are bent by it in their own way: errors are those of noise as loud as what is left (`inflation`).
    """
    problem: Problem = found.model.problem
    offered: dict[str, tuple[Parameter, ...]] = getattr(problem, "scatter", {})
    inside = [t for t in problem.trials if t.id in found.model.trials]
    groups = [ids for ids in groups_of(inside).values() if len(ids) > 1]
    active: tuple[Parameter, ...] = ()
    model_std: dict[str, float] = {}
    if not groups:
        return active, model_std
    for kind, parameters in offered.items():
        wide = fit(replace(found.model, scatter=(*active, *parameters)), found.values)
        value = {p.trial: wide.values[p.name] for p in parameters if p.trial in wide.model.trials}
        louder = inflation(wide)
        error = {p.trial: louder * _error(wide, p) for p in parameters if p.trial in wide.model.trials}
        surprise, count, between, within = 0.0, 0, 0.0, 0.0
        for ids in groups:
            b, s = np.array([value[id] for id in ids]), np.array([error[id] for id in ids])
            mean = float((b / s**2).sum() / (1 / s**2).sum())
            surprise += float((((b - mean) / s) ** 2).sum())
            count += len(ids) - 1
            between += float(((b - b.mean()) ** 2).sum())
            within += float((s**2).sum() * (len(ids) - 1) / len(ids))
        std = math.sqrt(max(between - within, 0.0) / count)
        if stats.chi2.sf(surprise, count) < _SURE and std > getattr(problem, "least_scatter", _LEAST):
            model_std[kind] = std
            active = (*active, *(replace(p, std=std) for p in parameters))
    return active, model_std


def _error(found: Fit, parameter: Parameter) -> float:
    """Standard error of a trial's nuisance, its other nuisances let free, what is shared held."""
    own = [k for k, p in enumerate(found.model.parameters) if p.trial == parameter.trial]
    names = [found.model.parameters[k].name for k in own]
    block = found.hessian()[np.ix_(own, own)]
    covariance = np.linalg.pinv(block, rcond=1e-12, hermitian=True)
    here = names.index(parameter.name)
    return parameter.scale * math.sqrt(max(float(covariance[here, here]), 1e-300))


def odd_trials(found: Fit) -> list[Finding]:
    """Trials at odds with at least two replicates that agree with one another."""
    slow = low_modes(found.model)
    modes: dict[str, np.ndarray] = {}
    for (trial, _), rows in slow.items():
        modes[trial] = np.concatenate([modes.get(trial, np.zeros(0)), found.modes[rows]])
    findings = []
    inside = [t for t in found.model.problem.trials if t.id in found.model.trials]
    for ids in groups_of(inside).values():
        if len(ids) < 3 or len({len(modes[id]) for id in ids}) > 1:
            continue
        far = {(a, b): float(np.mean((modes[a] - modes[b]) ** 2)) / 2 for a in ids for b in ids if a != b}
        for id in ids:
            others = [other for other in ids if other != id]
            mine = min(far[(id, other)] for other in others)
            theirs = float(np.median([far[(a, b)] for a in others for b in others if a != b]))
            size = float(np.median([np.mean(modes[other] ** 2) for other in others]))
            if mine > _AT_ODDS * max(theirs, 1.0) and mine > _SIZEABLE * size:
                what = (
                    f"trial {id} is at odds with its {len(others)} replicates, which agree with one another: in mean "
                    f"square it lies {mine / max(theirs, 1e-12):.0f} times as far from them; it is set aside"
                )
                findings.append(Finding(trial=id, what=what, set_aside=True))
    return findings
