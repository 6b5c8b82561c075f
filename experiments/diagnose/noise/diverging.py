"""Trials that follow the model up to a moment and diverge from it there.

Where a tip is only just caught, or only just touches, the smallest thing decides how a trial continues: two integrators
diverge there, and so do a model and nature. What follows does not show what the model omits, but would be most of what
it leaves. Such a trial is set aside, with a finding, only as the last resort, where nothing else explains the campaign.
One model must pass the gate on all the others, fitted and held out. It must follow this trial, too, for a good part of
its time. Few may be: what shows in one trial of six is hardly an effect, what shows in two is. Beside an effect that
the others call for, one of the trials that were fitted and one of those held out may.
"""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from experiments.diagnose.fit.bounds import is_strained
from experiments.diagnose.fit.evidence import held_out_fit
from experiments.diagnose.fit.fitting import Fit, by_beginnings, fit
from experiments.diagnose.fit.gate import held_out_gate, open_gate
from experiments.diagnose.fit.problem import Finding

from .replicates import groups_of

__all__ = ["divergence_finding", "diverging_held_out", "diverging_trials", "most_diverging"]

_ONE_OF = 6  # of so many trials one may diverge; of fewer one
_MOST_LEFT = 0.5  # share of what a model leaves, left without those trials to first order, up to which it is refitted
_OF_CONDITION = 3  # times the trials of one condition: of so many these may diverge together, beside an effect
_FAR = 3.0  # chi-square per sample from which a trial is not explained; one that diverges may bend another's as far


def most_diverging(trials: int) -> int:
    """How many of a campaign's trials may diverge."""
    return max(1, round(trials / _ONE_OF))


def diverging_trials(
    found: Fit, held_out: Sequence[str], *, seed: int = 0, recoloured: Callable[[Fit], Fit] = lambda fit: fit
) -> tuple[Finding, ...]:
    """The fitted trials without which this model passes the gate and which it follows at first; () if there are none.

    `found`: the model on all fitted trials, and where fits begin. `recoloured`: the same fit with the noise that it
    leaves, which a diverging trial would hide. Problems without contacts have none.
    """
    problem, trials = found.model.problem, found.model.trials
    if problem.contacts is None:
        return ()
    most = most_diverging(len(trials))
    bare = not found.model.forms  # then one of all of them: what shows in two trials may be an effect
    groups = {} if bare else groups_of(found.model.infos)
    largest = max((len(ids) for ids in groups.values() if len(ids) * _OF_CONDITION <= len(trials)), default=0)
    left = {trial: float(found.modes[rows] @ found.modes[rows]) / (rows.stop - rows.start)
            for trial, rows in found.model.rows().items()}  # fmt: skip
    if sum(per_sample > _FAR for per_sample in left.values()) > max(most, largest) + 1:
        return ()  # these are more than single trials
    order = sorted(trials, key=lambda trial: -left[trial])
    tried = [order[:count] for count in range(1, most + 1)]
    worst = next((list(ids) for ids in groups.values() if order[0] in ids), [])
    if most < len(worst) <= largest:
        tried.append(worst)
    for gone in tried:
        rest = tuple(trial for trial in trials if trial not in gone)
        if len(rest) < 3:
            break
        if _unexplained(found, rest) > _MOST_LEFT * _unexplained(found, trials):
            continue  # these trials are not what is unexplained
        learned = recoloured(_refitted(found, rest))
        if is_strained(learned) or not open_gate(learned, seed=seed)[1].passed:
            continue
        values = held_out_fit(learned.model, held_out, learned.values)
        others = most_diverging(len(trials) + len(held_out)) - len(gone) if bare else most_diverging(len(held_out))
        if diverging_held_out(learned, held_out, values, others, seed=seed) is None:
            return ()
        findings = [divergence_finding(learned, trial, learned.values) for trial in gone]
        return tuple(one for one in findings if one is not None) if None not in findings else ()
    return ()


def diverging_held_out(
    found: Fit, held_out: Sequence[str], values: Mapping[str, float], most: int, *, seed: int = 0, enough: float = 0.0,
    share: float = 0.0,
) -> tuple[str, ...] | None:  # fmt: skip
    """Those held-out trials, `most` at most, that the model follows at first only, while all others pass the gate. None
    where more fail, or fail from the start. `enough`: chi-square per sample up to which trials pass in any case.
    `share`: of its time up to which each must be followed."""
    problem = found.model.problem

    def explained(trials: Sequence[str]) -> bool:
        left = [problem.chi_square(values, found.model.forms, trial) for trial in trials]
        per_sample = sum(total for total, _ in left) / max(1, sum(count for _, count in left))
        return per_sample <= enough or held_out_gate(found, trials, values, seed=seed).passed

    if not held_out or explained(held_out):
        return ()
    failing = [t for t in held_out if not explained((t,))]
    if not failing or len(failing) > most:
        return None
    for trial in failing:
        until = problem.follows(values, found.model.forms, trial)
        if until is None or until < share * float(np.max(problem.samples(trial).time)):
            return None
    rest = tuple(trial for trial in held_out if trial not in failing)
    if rest and not explained(rest):
        return None
    return tuple(failing)


def _unexplained(found: Fit, trials: Sequence[str]) -> float:
    """Chi-square of these trials beyond their noise that a refit to them alone would leave, to first order."""
    parts = [rows for trial, rows in found.model.rows().items() if trial in trials]
    modes = np.concatenate([found.modes[rows] for rows in parts])
    slopes = np.concatenate([found.jacobian[rows] for rows in parts])
    hessian = slopes.T @ slopes + np.diag(found.prior_precision())
    size = np.sqrt(np.maximum(np.diag(hessian), 1e-300))
    gradient = slopes.T @ modes / size
    taken = gradient @ np.linalg.pinv(hessian / np.outer(size, size), rcond=1e-10, hermitian=True) @ gradient
    return max(float(modes @ modes - taken) - len(modes), 0.0)


def _refitted(found: Fit, trials: tuple[str, ...]) -> Fit:
    """The fit on these trials alone, searched anew: on all of them the fit was bent."""
    model = found.model.on(trials)
    contacts = model.problem.contacts
    if not model.forms or contacts is None:
        return by_beginnings(fit(model))
    (values,) = contacts.refine([model], [found.values])
    return fit(model, values)


def divergence_finding(
    found: Fit, trial: str, values: Mapping[str, float], *, set_aside: bool = True
) -> Finding | None:
    """The finding of a trial that follows the model up to a moment only; None where it does not even that."""
    problem = found.model.problem
    until = problem.follows(values, found.model.forms, trial)
    if until is None:
        return None
    end = float(np.max(problem.samples(trial).time))
    done = "it is set aside" if set_aside else "it was held out, and stays in the gap"
    what = (
        f"trial {trial} follows the model that explains the others up to {until:.2f} s and goes another way from "
        f"there, after a touch or a catch that hangs on next to nothing: {done}"
    )
    return Finding(trial=trial, what=what, from_s=until, to_s=end, set_aside=set_aside)
