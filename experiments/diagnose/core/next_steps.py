"""What to do next where something unknown is missing: repeat the worst trial, or, where it has replicates, follow up
what the missing force correlates with.

What is left of one replicate and returns in the others is in the body or its ground. The rest differs from trial to
trial, by its cause or because the fit found a wrong branch.
"""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from experiments.diagnose.fit.localise import Place
from experiments.diagnose.fit.problem import Array, Form, Problem, Values
from experiments.diagnose.noise.replicates import groups_of
from vis.page.sentences import Sentences

__all__ = ["after_unknown", "common_share"]

say = Sentences(__package__)

_SHARES = np.linspace(0.0, 1.0, 401)  # places along a trial at which replicates are compared
_COMMON, _IN_PART = 0.5, 0.25  # shares of what is left from which on it comes back, or does in part
_AS_BAD = 0.3  # share of the worst trial's misfit from which on one that has replicates replaces it
_MAINLY = 0.5  # share of it from which on a phase holds it
_CORRELATES = 0.1  # share of the latent force that a column must explain to be followed up


def after_unknown(
    problem: Problem, values: Values, forms: Sequence[Form], worst: Sequence[Place], shares: Mapping[str, float],
    *, beside: Sequence[str] = (), is_scatter: bool = False,
) -> str:  # fmt: skip
    """The next experiment, a sentence or two. `worst`: where the best model fails; `shares`: what the latent force
    correlates with; `beside`: effects of the model; `is_scatter`: whether it leaves no more than scatter."""
    sums: dict[str, float] = {}
    for place in worst:
        sums[place.trial] = sums.get(place.trial, 0.0) + place.excess
    known = {trial.id: trial for trial in problem.trials}
    trial = max(sums, key=lambda name: sums[name]) if sums else problem.trials[0].id
    groups = groups_of(problem.trials)
    repeated = [id for id in sums if len(groups[known[id].condition]) > 1 and sums[id] > _AS_BAD * sums[trial]]
    trial = max(repeated, key=lambda name: sums[name], default=trial)
    alike = [id for id in groups[known[trial].condition] if id != trial]
    if not alike:
        which = f"trial {trial}, the one with the largest gap," if sums else f"trial {trial}"
        return say("no_replicates", which=which, whole=problem.whole, follow=_follow(worst, shares))
    share = common_share(problem, values, forms, (trial, *alike))
    others = f"{alike[0]} to {alike[-1]}" if len(alike) > 3 else " and ".join(alike)
    part = "nothing" if share < 0.005 else f"{100 * share:.0f} %"
    measured = say("comes_back", trial=trial, part=part, others=others)
    if is_scatter:
        return say("only_scatter", measured=measured)
    # What comes back at the same time in every trial is no sensor's drift: time stands for where the spike is.
    follow = _follow(worst, {name: part for name, part in shares.items() if name != "t_s" or share < _IN_PART})
    if share >= _COMMON:
        return say("repeats", measured=measured, whole=problem.whole, follow=follow)
    if share >= _IN_PART:
        return say("repeats_in_part", measured=measured, follow=follow)
    alone = say("own_to_a_trial", follow_t_s=say("follow_t_s"))
    if not beside:
        return say("no_repeat", measured=measured, alone=alone)
    return say("no_repeat_beside", names=" and ".join(beside), measured=measured, alone=alone)


def _follow(worst: Sequence[Place], shares: Mapping[str, float]) -> str:
    phases: dict[str, float] = {}
    for place in worst:
        phases[place.phase] = phases.get(place.phase, 0.0) + place.excess
    for phase, excess in phases.items():
        if f"phase_{phase}" in say.templates and excess > _MAINLY * sum(phases.values()):
            return f"since most of it is in phase {phase}, {say(f'phase_{phase}')}"
    known = [(share, name) for name, share in shares.items() if f"follow_{name}" in say.templates]
    share, name = max(known, default=(0.0, ""))
    return say("another_sensor") if share < _CORRELATES else say(f"follow_{name}")


def common_share(problem: Problem, values: Values, forms: Sequence[Form], trials: Sequence[str]) -> float:
    """Share of a model's residual, beyond the sensors, that all replicates have in common (0 to 1). Residuals over the
    noise are compared channel by channel at equal shares of the trials' time. The share is the mean of the products of
    two different trials over the mean of the squares."""
    curves: dict[str, list[Array]] = {}
    for trial in trials:
        samples = problem.samples(trial)
        for name, shown in problem.compare(values, forms, trial).items():
            std = samples.std[samples.channel == name]
            rest = (shown["measured"] - shown["model"]) / std if len(std) == len(shown["t_s"]) else np.zeros(0)
            good = np.isfinite(rest)
            if good.sum() > 1:
                time = shown["t_s"][good]
                span = max(float(np.ptp(time)), 1e-300)
                curves.setdefault(name, []).append(np.interp(_SHARES, (time - time[0]) / span, rest[good]))
    both = whole = 0.0
    for own in [own for own in curves.values() if len(own) > 1]:
        together, count = np.stack(own), len(own)
        total = float((together**2).sum(axis=0).mean())
        products = float((together.sum(axis=0) ** 2).mean()) - total  # of every pair twice
        both += products / (count - 1)
        whole += max(total - count, 0.0)
    share = both / whole if whole > 0 else 0.0
    return min(max(share, 0.0), 1.0) if math.isfinite(share) else 0.0
