"""Replicates: which trials are held out, the scatter beyond the sensors, a trial at odds with its replicates."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy import stats

from experiments.check.words import factor_words
from experiments.diagnose.fit.evidence import inflation, slow_count
from experiments.diagnose.fit.fitting import Fit, Model, fit, scanned
from experiments.diagnose.fit.gaps import size_words
from experiments.diagnose.fit.gate import low_modes
from experiments.diagnose.fit.problem import Array, Finding, Parameter, Values
from experiments.diagnose.fit.trials import TrialInfo

__all__ = ["Scatter", "deviations", "exchanged", "find_scatter", "groups_of", "has_replicates", "likeliest_scatter",
           "odd_trials", "order_chance", "parted", "split_trials", "trends", "with_scatter"]  # fmt: skip

_SURE = 1e-4  # chance below which replicates differ
_FROM_DATA = 0.5  # share of what is known of a trial's number that must come from its data
_ROUNDS = 12  # steps with all kinds of scatter at once; what is found is fitted in full
_AT_ODDS = 20.0  # times as far from its replicates as these from one another, in mean square, a trial is at odds
_FAR_PAIRS = 0.75  # share of all pairs of replicates that lie nearer than what one at odds is measured by
_SIZEABLE = 0.2  # share of what the base model leaves by which it must differ too: small errors of the path count there
_TREND, _DRAWS = 1e-3, 4999  # chance below which a kind of scatter is a trend from trial to trial; orders drawn
_ANOTHER = 1.1  # ratio of two depths or durations from which on trials do not go through the same


def groups_of(trials: Sequence[TrialInfo]) -> dict[tuple[object, ...], list[str]]:
    """Condition -> ids of its trials."""
    found: dict[tuple[object, ...], list[str]] = {}
    for trial in trials:
        found.setdefault(trial.condition, []).append(trial.id)
    return found


def has_replicates(trials: Sequence[TrialInfo]) -> bool:
    """Whether some condition has more than one trial: only then replicates show how much beds, or runs, differ."""
    return any(len(ids) > 1 for ids in groups_of(trials).values())


def parted(trials: Sequence[TrialInfo], sizes: Mapping[str, Sequence[float]]) -> tuple[TrialInfo, ...]:
    """The trials, those of one condition separated where they go half as deep, last half as long or do not come back:
    then they are no replicates. `sizes`: id -> what was measured of a trial (its depth, its duration), above 0, as many
    numbers for all trials of a condition. Sorted, they are cut where one exceeds the one before by more than a tenth.
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
    """Trials to fit and trials held out: a quarter of them, rounded up, none below four, spread over the conditions. A
    condition gives up one of its replicates before another loses its only trial. Of conditions with one trial those go
    first whose settings others share, and of these those that share least with what is held out already: two of one
    gravity would leave hardly any trial that shows what happens there."""
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

        held = [by_id[id].settings for id in out]

        def repeated(condition: tuple[object, ...], held: list[Mapping[str, float]] = held) -> int:
            mine = by_id[left[condition][0]].settings
            return sum(other.get(key) == value for other in held for key, value in mine.items())

        most = max(shared(c) for c in single)
        best = [c for c in single if shared(c) == most]
        fewest = min(repeated(c) for c in best)
        best = [c for c in best if repeated(c) == fewest]
        out.append(left[best[len(best) // 2]].pop())
    return tuple(t.id for t in trials if t.id not in out), tuple(t.id for t in trials if t.id in out)


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
    every = [trial.id for trial in trials if trial.id in (*fitted, *held_out)]
    return tuple(t for t in every if t not in held), tuple(t for t in every if t in held)


def find_scatter(
    found: Fit, *, apart: bool = False, kinds: Sequence[str] = (), alone: Sequence[Sequence[str]] = ()
) -> Scatter:
    """Random effects between replicates: nuisances, their priors estimated, and what is written as model_std.

    Each trial's own numbers (bed, friction, whatever the problem offers) are fitted, all kinds at once, so that none
    replaces another. Within a condition these must agree within their errors. What the model omits is the same for all
    replicates while it is small. Where it is large, it changes each trial's factors differently. Errors then are those
    of noise as large as the residual (`inflation`) or, `apart`, as each trial's own residual (`_own_noise`), and all
    kinds are examined. The scatter is the most likely one beside these errors, each condition's mean taken out
    (restricted likelihood): trials without information on a kind do not count. Once found, it is the prior under which
    all is fitted and examined again. `kinds`: those that are examined; none: all that have no search of their own.
    `alone`: sets of trials that are compared although none repeats another (`lone_beds`).
    """
    problem = found.model.problem
    others = (*(() if apart else problem.hidden_scatter), *problem.special_scatter)
    asked = kinds or [kind for kind in problem.scatter if kind not in others]
    offered = {kind: parameters for kind, parameters in problem.scatter.items() if kind in asked}
    groups = [list(ids) for ids in alone or groups_of(found.model.infos).values() if len(ids) > 1]
    if not groups or not offered:
        return Scatter()
    every = tuple(p for parameters in offered.values() for p in parameters)
    wide = fit(replace(found.model, scatter=every), found.values, rounds=_ROUNDS)
    differ = _scattered(wide, offered, groups, apart)
    while differ:
        active = tuple(replace(p, std=std) for kind, std in differ.items() for p in offered[kind])
        wide = with_scatter(replace(found.model, scatter=active), wide.values)
        sure = _scattered(wide, {kind: offered[kind] for kind in differ}, groups, apart)
        if sure.keys() == differ.keys():
            parameters = tuple(replace(p, std=sure[p.kind]) for p in active)
            return Scatter(parameters, sure, wide.values)
        differ = sure
    return Scatter()


def with_scatter(model: Model, values: Values) -> Fit:
    """The model's fit, from `values` and from the result of the problem's own search, which begins at what was stated:
    a base model whose trials cannot differ bends what is shared, and ends on wrong branches of stick and slip."""
    found = fit(model, {p.name: values[p.name] for p in model.parameters if p.name in values})
    contacts = model.problem.contacts
    if contacts is None or inflation(found) == 1:
        return found
    stated = {p.name: p.value for p in model.problem.base}
    begun = {p.name: values[p.name] for form in model.forms for p in form.parameters}
    other = fit(model, contacts.guess(model, {**stated, **begun}))
    return scanned(min(found, other, key=lambda one: one.objective))


@dataclass(frozen=True)
class Scatter:
    """Random effects between replicates beyond the sensors; none by default."""

    parameters: tuple[Parameter, ...] = ()
    model_std: Mapping[str, float] = field(default_factory=dict)
    values: Mapping[str, float] = field(default_factory=dict)  # of the model with it, for fits to begin from


def trends(scatter: Scatter, trials: Sequence[TrialInfo]) -> list[Finding]:
    """Kinds of scatter that grow or fall from trial to trial, as where beds settle, sensors drift and tips wear: these
    are not random. Replicates are compared with one another only, as conditions differ by more than time."""
    found = []
    place = {trial.id: k for k, trial in enumerate(trials)}
    for kind in scatter.model_std:
        own = {id: scatter.values[f"{kind}[{id}]"] for id in place if f"{kind}[{id}]" in scatter.values}
        groups = [np.array([(own[id], place[id]) for id in ids if id in own]) for ids in groups_of(trials).values()]
        pairs = [tuple((group - group.mean(axis=0)).T) for group in groups if len(group) > 1]
        chance = order_chance(pairs)
        if chance < _TREND:
            seen = sum(float(values @ order) for values, order in pairs)
            slope = seen / sum(float(order @ order) for _, order in pairs)
            way = "grows" if seen > 0 else "falls"
            size = size_words(kind, abs(slope))
            what = (
                f"what replicates differ by is no scatter: {kind} {way} from trial to trial, in the campaign's order, "
                f"by {size} each on the mean (by chance once in {1 / chance:.0f} times or less): "
                f"what has changed with time, the bed, the surface, a tip or a sensor's gain, no effect has"
            )
            found.append(Finding(trial="", what=what, doubt=True))
    return found


def order_chance(pairs: Sequence[tuple[Array, ...]]) -> float:
    """Permutation test: how often values drawn anew within each group correlate with their partners as much as these
    do. `pairs`: of each group values and partners, both less their means, shape [n]; 1 without groups."""
    if not pairs:
        return 1.0
    random = np.random.default_rng(0)
    seen = abs(sum(float(values @ partners) for values, partners in pairs))
    drawn = sum(np.array([random.permutation(values) @ partners for _ in range(_DRAWS)]) for values, partners in pairs)
    return (1 + int(np.sum(np.abs(drawn) >= seen * (1 - 1e-12)))) / (1 + _DRAWS)


def _scattered(
    found: Fit, offered: Mapping[str, Sequence[Parameter]], groups: Sequence[Sequence[str]], apart: bool
) -> dict[str, float]:
    """The scatter of those kinds in which replicates differ significantly."""
    least = found.model.problem.least_scatter
    factor = _own_noise(found, groups) if apart else inflation(found)
    scatter = {}
    for kind, parameters in offered.items():
        known = _from_data(found, parameters, factor)
        pairs = [np.array([known[id] for id in ids if id in known]) for ids in groups]
        pairs = [pair for pair in pairs if len(pair) > 1]
        surprise = sum(float((((b - _mean(b, s)) / s) ** 2).sum()) for b, s in (pair.T for pair in pairs))
        if not pairs or stats.chi2.sf(surprise, sum(len(pair) - 1 for pair in pairs)) >= _SURE:
            continue
        std = min(likeliest_scatter(pairs), max(p.std for p in parameters))
        if std > (least if parameters[0].least is None else parameters[0].least):
            scatter[kind] = std
    return scatter


def deviations(blocks: Sequence[Array]) -> Array:
    """How the modes of replicates deviate from their mean, shape [replicate_count, n], n being the fewest modes. Modes
    grow with the root of the number of rows: all are scaled to the mean number."""
    count, usual = min(map(len, blocks)), float(np.mean([len(block) for block in blocks]))
    together = np.stack([block[:count] * math.sqrt(usual / len(block)) for block in blocks])
    return together - together.mean(axis=0)


def _own_noise(found: Fit, groups: Sequence[Sequence[str]]) -> float:
    """By which factor what each replicate has of its own exceeds the sensors' noise (pure error, as in `wander`)."""
    rows = {(trial, channel): block for trial, channel, block in found.model.channel_rows()}
    left, freedom = 0.0, 0
    for ids, channel in itertools.product(groups, dict.fromkeys(channel for _, channel in rows)):
        blocks = [found.modes[rows[(id, channel)]] for id in ids if (id, channel) in rows]
        if len(blocks) > 1:
            own = deviations(blocks)
            left += float((own**2).sum())
            freedom += (len(blocks) - 1) * own.shape[1]
    beyond = max(left - freedom - 2 * math.sqrt(2.0 * freedom), 0.0)
    return min(inflation(found), math.sqrt(1 + beyond / slow_count(found)))


def _from_data(found: Fit, parameters: Sequence[Parameter], factor: float) -> dict[str, tuple[float, float]]:
    """A trial's own number by its data alone, and the error: trial -> value, std. What is shared is held, the trial's
    other numbers are free, the number's own prior does not count. `factor`: on the noise of the data."""
    mine = found.model.parameters
    precision = found.prior_precision()
    known = {}
    for p in parameters:
        if p.trial not in found.model.trials:
            continue
        own = [k for k, q in enumerate(mine) if q.trial == p.trial and found.free[k]]
        if p.name not in {mine[k].name for k in own}:
            continue  # at the end of its range
        slopes = found.jacobian[:, own]
        hessian = slopes.T @ slopes / factor**2 + np.diag(precision[own])
        covariance = np.linalg.pinv(hessian, rcond=1e-12, hermitian=True)
        here = [mine[k].name for k in own].index(p.name)
        whole = 1 / max(float(covariance[here, here]), 1e-300)
        data = whole - precision[own[here]]
        if data > _FROM_DATA * whole:
            known[p.trial or ""] = found.values[p.name] * whole / data, p.scale / math.sqrt(data)
    return known


def _mean(values: Array, errors: Array) -> float:
    return float((values / errors**2).sum() / (1 / errors**2).sum())


def likeliest_scatter(pairs: Sequence[Array]) -> float:
    """The most likely std between replicates, beside the errors of their numbers, the groups' means unknown. `pairs`:
    of each group values and errors, shape [trial_count, 2]."""

    def log_likelihood(scatter: float) -> float:
        total = 0.0
        for values, errors in (pair.T for pair in pairs):
            spread = np.hypot(errors, scatter)
            off = (values - _mean(values, spread)) / spread
            total -= float(np.log(spread).sum() + 0.5 * np.log((1 / spread**2).sum()) + 0.5 * (off @ off))
        return total

    widest = max(float(np.ptp(pair[:, 0])) for pair in pairs)
    tried = np.concatenate([[0.0], widest * np.geomspace(1e-3, 2.0, 200)])
    return float(tried[int(np.argmax([log_likelihood(scatter) for scatter in tried]))])


def _units(found: Fit, trial: str, others: Sequence[str]) -> str:
    """A clause where one of a trial's channels is its replicates' in another unit."""
    problem = found.model.problem
    read = {id: problem.compare(found.values, found.model.forms, id) for id in (trial, *others)}
    for channel, own in read[trial].items():
        if all(channel in read[id] for id in others):
            curves = [np.interp(own["t_s"], read[id][channel]["t_s"], read[id][channel]["measured"]) for id in others]
            if said := factor_words(channel, own["measured"], curves):
                return said
    return ""


def odd_trials(found: Fit) -> list[Finding]:
    """Trials at odds with at least two replicates that agree with one another."""
    modes: dict[str, Array] = {}
    for (trial, _), rows in low_modes(found.model).items():
        modes[trial] = np.concatenate([modes.get(trial, np.zeros(0)), found.modes[rows]])
    findings = []
    groups = [ids for ids in groups_of(found.model.infos).values() if len({len(modes[id]) for id in ids}) == 1]
    pairs = [pair for ids in groups for pair in itertools.permutations(ids, 2)]
    far = {(a, b): float(np.mean((modes[a] - modes[b]) ** 2)) / 2 for a, b in pairs}
    for ids in groups:
        for id in ids if len(ids) > 2 else ():
            others = [other for other in ids if other != id]
            mine = min(far[(id, other)] for other in others)
            # One pair that agrees by chance is no measure: of three numbers one lies 20 times as far in a third of all
            # draws. So all conditions are asked how far replicates lie apart.
            all_pairs = float(np.quantile([value for pair, value in far.items() if id not in pair], _FAR_PAIRS))
            theirs = max(float(np.median([far[(a, b)] for a in others for b in others if a != b])), all_pairs)
            size = float(np.median([np.mean(modes[other] ** 2) for other in others]))
            if mine > _AT_ODDS * max(theirs, 1.0) and mine > _SIZEABLE * size:
                what = (
                    f"trial {id} is at odds with its {len(others)} replicates, which agree with one another: in mean "
                    f"square it lies {mine / max(theirs, 1e-12):.0f} times as far from them; it is set aside"
                    f"{_units(found, id, others)}"
                )
                findings.append(Finding(trial=id, what=what, set_aside=True))
    return findings
