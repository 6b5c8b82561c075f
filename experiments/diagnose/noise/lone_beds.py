"""Beds that differ although no trial repeats another.

Replicates show what differs between beds without any model. Where each trial has a condition of its own, separate
factors on the beds of trials may represent anything that changes with the condition. So it counts only where three
conditions hold. The factors scatter beyond their errors, and not for one trial alone. With them every trial is
explained from its first row to its last: the gate passes, which examines the shape within each trial. They correlate
with nothing by which trials differ, neither speed, gravity and kind of trial nor the campaign's order. What correlates
with one of these is an effect, or a drift, and becomes a finding instead.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.stats import rankdata

from experiments.diagnose.fit.fitting import Fit
from experiments.diagnose.fit.gaps import size_words
from experiments.diagnose.fit.problem import Finding

from .replicates import Scatter, find_scatter, groups_of, order_chance

__all__ = ["find_lone_scatter", "lone_finding"]

_FEWEST = 5  # trials that can show a correlation: of four, one order in twelve is monotone by chance
_CHANCE = 0.02  # below which a factor correlates with a setting
_EXPLAINED = 0.75  # share of the factors' variance that a straight line in a setting explains, from which on they do
_WITHOUT = 0.25  # share of the spread that must be left without the farthest trial: else that one is at odds


def find_lone_scatter(found: Fit, kinds: Sequence[str]) -> tuple[Scatter, list[Finding]]:
    """The scatter of these kinds between the trials of `found`, none of which repeats another; and what contradicts
    it."""
    trials = found.model.infos
    sets: dict[float, list[str]] = {}
    for trial in trials:
        sets.setdefault(trial.settings.get(found.model.problem.own_base, 0.0), []).append(trial.id)
    if sum(len(ids) - 1 for ids in sets.values()) < _FEWEST - 1 or max(map(len, groups_of(trials).values())) > 1:
        return Scatter(), []
    scatter = find_scatter(found, kinds=kinds, alone=list(sets.values()))
    findings = []
    settings: dict[str, dict[str, float]] = {"order": {trial.id: float(k) for k, trial in enumerate(trials)}}
    for name in dict.fromkeys(name for trial in trials for name in trial.settings):
        settings[name] = {trial.id: trial.settings[name] for trial in trials if name in trial.settings}
    settings["kind"] = {trial.id: float(trial.condition[0] == trials[0].condition[0]) for trial in trials}
    kind_of = {trial.id: trial.condition[0] for trial in trials}
    for kind in scatter.model_std:
        own = {t.id: scatter.values[f"{kind}[{t.id}]"] for t in trials if f"{kind}[{t.id}]" in scatter.values}
        same = [[id for id in ids if id in own] for ids in sets.values()]
        # Ranks are compared of one kind of trial (pushes, drops) and one set.
        modes = [(ids, mode) for ids in sets.values() for mode in dict.fromkeys(kind_of[id] for id in ids)]
        alike = [[id for id in ids if id in own and kind_of[id] == mode] for ids, mode in modes]
        farthest, spread = _without_farthest([[own[id] for id in ids] for ids in same])
        if spread < _WITHOUT:
            odd = next(id for id, value in own.items() if value == farthest)
            what = f"{kind} differs in trial {odd} from all others, which agree: this is no scatter of beds"
            findings.append(Finding(trial=odd, what=what))
        for name, numbers in settings.items():
            groups = (same,) if name == "kind" else (alike, same)
            explained = max(_explained(own, numbers, compared) for compared in groups) > _EXPLAINED
            if explained or _chance(own, numbers, groups[0]) < _CHANCE:
                what = (
                    f"{kind} differs from trial to trial, but not at random: it correlates with {_words(name)}, so it "
                    f"is no scatter of beds"
                )
                findings.append(Finding(trial="", what=what))
    return (Scatter(), findings) if findings else (scatter, [])


def lone_finding(scatter: Scatter) -> Finding:
    """The finding of such a scatter."""
    sizes = [f"{kind} by {size_words(kind, std)}" for kind, std in scatter.model_std.items()]
    zeros = all(kind.endswith("zero") for kind in scatter.model_std)
    own = "a zero that is set again" if zeros else "a difference of beds"
    what = (
        f"trials differ beyond the sensors ({', '.join(sizes)}, standard deviation), and there are no replicates: "
        f"this explains each trial whole, and correlates with neither speed nor order, like {own}; "
        f"replicates would show it without a model"
    )
    return Finding(trial="", what=what)


def _chance(own: Mapping[str, float], numbers: Mapping[str, float], alike: Sequence[Sequence[str]]) -> float:
    """How often values in random order within each set correlate with `numbers` as much as these do, in rank."""
    pairs = []
    for ids in alike:
        inside = [id for id in ids if id in numbers]
        if len({numbers[id] for id in inside}) > 1:
            ranks = (rankdata([own[id] for id in inside]), rankdata([numbers[id] for id in inside]))
            pairs.append(tuple(r - r.mean() for r in ranks))
    return order_chance(pairs)


def _explained(own: Mapping[str, float], numbers: Mapping[str, float], alike: Sequence[Sequence[str]]) -> float:
    """The share of the variance within the sets that a straight line in `numbers` explains."""
    pairs = []
    for ids in alike:
        inside = [id for id in ids if id in numbers]
        if len(inside) > 1:
            pairs.append((np.array([own[id] for id in inside]), np.array([numbers[id] for id in inside])))
    if not pairs:
        return 0.0
    a = np.concatenate([values - values.mean() for values, _ in pairs])
    b = np.concatenate([settings - settings.mean() for _, settings in pairs])
    whole = float(a @ a) * float(b @ b)
    return float(a @ b) ** 2 / whole if whole > 0 and len(a) - len(pairs) >= _FEWEST - 2 else 0.0


def _without_farthest(groups: Sequence[Sequence[float]]) -> tuple[float, float]:
    """The value farthest from its group's median, and the spread without it over the whole one."""
    away = [(abs(value - float(np.median(group))), value) for group in groups for value in group]
    farthest = max(away)[1]

    def spread(parts: Sequence[Sequence[float]]) -> float:
        freedom = sum(len(part) - 1 for part in parts if part)
        return float(np.sqrt(sum(len(part) * float(np.var(part)) for part in parts if part) / max(freedom, 1)))

    rest = [[value for value in group if value != farthest] for group in groups]
    return farthest, spread(rest) / max(spread(groups), 1e-300)


def _words(setting: str) -> str:
    if setting == "order":
        return "the campaign's order"
    return "the kind of trial" if setting == "kind" else f"the trial's {setting.partition('_')[0]}"
