"""Beds that differ although no trial repeats another.

Replicates tell what differs between beds without any model. Where each trial is of a condition of its own, a factor of
each trial's own on the bed may stand for anything that changes with the condition. So it counts only where all of these
hold: the factors scatter beyond their errors, and not for one trial alone; with them every trial is explained from its
first row to its last (the gate passes, which asks for the shape within each trial); and they go with nothing by which
trials differ, neither with speed, gravity and kind of trial nor with the campaign's order. What goes with one of these
is an effect, or a drift, and is said instead.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.stats import rankdata

from experiments.diagnose.fit.fitting import Fit
from experiments.diagnose.fit.gaps import size_words
from experiments.diagnose.fit.problem import Finding, TrialInfo

from .replicates import Scatter, find_scatter, groups_of

__all__ = ["find_lone_scatter", "lone_finding"]

_FEWEST = 5
"""Trials that can tell whether their factors go with something: of four, one order in twelve is monotone by chance."""
_GOES = 0.02  # chance below which a factor goes with a setting
_DRAWS = 4999
_EXPLAINED = 0.75
"""Share of the factors' variance that a setting explains, by a straight line, from which on they go with it."""
_WITHOUT = 0.25
"""Share of the spread that must be left without the farthest trial: else that one is at odds with all others."""


def find_lone_scatter(found: Fit, kinds: Sequence[str]) -> tuple[Scatter, list[Finding]]:
    """The scatter of these kinds between trials none of which repeats another, asked of those of `found`; and what
    speaks against it."""
    problem = found.model.problem
    trials = [trial for trial in problem.trials if trial.id in found.model.trials]
    sets: dict[float, list[str]] = {}
    for trial in trials:
        sets.setdefault(trial.settings.get(problem.own_base, 0.0), []).append(trial.id)
    if sum(len(ids) - 1 for ids in sets.values()) < _FEWEST - 1 or max(map(len, groups_of(trials).values())) > 1:
        return Scatter(), []
    scatter = find_scatter(found, kinds=kinds, alone=list(sets.values()))
    findings = []
    order = {trial.id: float(place) for place, trial in enumerate(trials)}
    settings: dict[str, Mapping[str, float]] = {"order": order}
    for name in dict.fromkeys(name for trial in trials for name in trial.settings):
        settings[name] = {trial.id: trial.settings[name] for trial in trials if name in trial.settings}
    for kind in scatter.model_std:
        own = {id: scatter.values[f"{kind}[{id}]"] for id in order if f"{kind}[{id}]" in scatter.values}
        alike = [[id for id in ids if id in own] for ids in _alike(trials, sets)]
        modes = {trial.id: float(trial.condition[0] == trials[0].condition[0]) for trial in trials}
        same = [[id for id in ids if id in own] for ids in sets.values()]
        chances = {name: _chance(own, numbers, alike) for name, numbers in settings.items()}
        chances["kind"] = 0.0 if _explained(own, modes, same) > _EXPLAINED else _chance(own, modes, same)
        for name, numbers in settings.items():
            if max(_explained(own, numbers, compared) for compared in (alike, same)) > _EXPLAINED:
                chances[name] = 0.0
        without = _without_farthest([[own[id] for id in ids if id in own] for ids in sets.values()])
        if without[1] < _WITHOUT:
            farthest = next(id for id, value in own.items() if value == without[0])
            what = f"{kind} is another in trial {farthest} than in all others, which agree: it is no scatter of beds"
            findings.append(Finding(trial=farthest, what=what))
        for name, chance in chances.items():
            if chance < _GOES:
                what = (
                    f"{kind} differs from trial to trial, but not at random: it goes with {_words(name)}, so that it "
                    f"is no scatter of beds"
                )
                findings.append(Finding(trial="", what=what))
    return (Scatter(), findings) if findings else (scatter, [])


def lone_finding(scatter: Scatter) -> Finding:
    """What is said of it."""
    sizes = [f"{kind} by {size_words(kind, std)}" for kind, std in scatter.model_std.items()]
    zeros = all(kind.endswith("zero") for kind in scatter.model_std)
    own = "a zero that is set anew" if zeros else "what a bed has of its own"
    what = (
        f"trials differ beyond the sensors ({', '.join(sizes)}, standard deviation), although none repeats another: "
        f"with that each is explained from end to end, and it goes with neither speed nor order, as {own} does; "
        f"replicates would show it without a model"
    )
    return Finding(trial="", what=what)


def _alike(trials: Sequence[TrialInfo], sets: Mapping[float, Sequence[str]]) -> list[list[str]]:
    """Trials whose ranks are compared: of one kind (pushes, drops) and one set."""
    kinds = {trial.id: trial.condition[0] for trial in trials}
    found: dict[tuple[object, float], list[str]] = {}
    for size, ids in sets.items():
        for id in ids:
            found.setdefault((kinds[id], size), []).append(id)
    return list(found.values())


def _chance(own: Mapping[str, float], numbers: Mapping[str, float], alike: Sequence[Sequence[str]]) -> float:
    """How often orders drawn anew within each set go with `numbers` as far as these do, in rank."""
    pairs = []
    for ids in alike:
        inside = [id for id in ids if id in numbers]
        if len(inside) > 1 and len({numbers[id] for id in inside}) > 1:
            ranks = (rankdata([own[id] for id in inside]), rankdata([numbers[id] for id in inside]))
            pairs.append(tuple(r - r.mean() for r in ranks))
    if not pairs:
        return 1.0
    random = np.random.default_rng(0)
    seen = abs(sum(float(a @ b) for a, b in pairs))
    drawn = sum(np.array([random.permutation(a) @ b for _ in range(_DRAWS)]) for a, b in pairs)
    return (1 + int(np.sum(np.abs(drawn) >= seen * (1 - 1e-12)))) / (1 + _DRAWS)


def _explained(own: Mapping[str, float], numbers: Mapping[str, float], alike: Sequence[Sequence[str]]) -> float:
    """The share of the variance within the sets that goes with `numbers`, in proportion."""
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
