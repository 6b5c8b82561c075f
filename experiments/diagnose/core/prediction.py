"""How well a hypothesis predicts trials of conditions that it was not fitted to.

Every condition (torque and gravity of a tumble; kind, speed and diameter of a penetration) is left out in turn, the
model refitted to the others, and the trials left out are predicted with nothing but their own nuisances refitted within
their priors; a base parameter of which the others say nothing at all (K of a diameter) stays as all trials have it. A
name whose form happens to bend to the trials at hand predicts others badly. What a prediction leaves is weighed as the
evidence weighs a fit (`evidence.tempered`), since the form is never nature's.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from experiments.diagnose.fit.evidence import held_out_fit, slow_count, tempered
from experiments.diagnose.fit.fitting import Fit, fit
from experiments.diagnose.fit.problem import TrialInfo, Values
from experiments.diagnose.noise.replicates import groups_of

__all__ = ["Predicted", "folds_of", "predict"]

_MOST_FOLDS = 4
_ROUNDS = 4


@dataclass(frozen=True)
class Predicted:
    """What is left of trials that were left out, all folds together."""

    chi_square: float
    count: int
    score: float  # tempered log likelihood of the prediction, comparable between models of one campaign [nats]
    learned: tuple[Values, ...] = ()  # what was fitted without each fold

    @property
    def per_sample(self) -> float:
        """Chi-square per sample of the likelihood's own noise; 1 is all that can be told."""
        return self.chi_square / max(1, self.count)


def folds_of(trials: Sequence[TrialInfo]) -> list[tuple[str, ...]]:
    """Trials to leave out together: one condition each, or neighbouring ones where there are more than four.

    Empty where all trials are of one condition.
    """
    groups = groups_of(trials)
    if len(groups) < 2:
        return []
    order = sorted(groups, key=repr)
    count = min(_MOST_FOLDS, len(order))
    folds: list[list[str]] = [[] for _ in range(count)]
    for place, condition in enumerate(order):
        folds[place * count // len(order)] += groups[condition]
    return [tuple(fold) for fold in folds]


def predict(found: Fit, folds: Sequence[tuple[str, ...]]) -> Predicted | None:
    """What `found`'s model leaves of each fold when it is fitted to the others; None without folds."""
    model = found.model
    if not folds:
        return None
    chi_square, count, taught = 0.0, 0, []
    for fold in folds:
        rest = tuple(id for id in model.trials if id not in fold)
        learned = fit(model.on(rest), found.values, rounds=_ROUNDS)
        values = held_out_fit(model, fold, {**found.values, **learned.values, **_untold(learned, found)})
        taught.append(learned.values)
        (modes,) = model.on(fold).evaluate([values])
        chi_square += float(modes @ modes)
        count += len(modes)
    return Predicted(chi_square, count, tempered(chi_square - count, slow_count(found)), tuple(taught))


def _untold(learned: Fit, found: Fit) -> dict[str, float]:
    """Base parameters of which the trials that are left say nothing (K of a diameter that is left out), as all say."""
    base = {p.name for p in found.model.problem.base}
    silent = [
        p.name for p, slope in zip(learned.model.parameters, learned.jacobian.T, strict=True)
        if p.name in base and not slope.any()
    ]  # fmt: skip
    return {name: found.values[name] for name in silent}
