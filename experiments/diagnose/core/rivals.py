"""Which effects a campaign cannot separate: signatures of fitted effects, and cross-validation over conditions.

The signature of an effect is the change that it makes in the predicted data where it is fitted, over the noise. The
part that the other parameters could take up is subtracted. The angle between two signatures says whether the design
sees them as one, whatever the noise was in these trials. Their distance says how many standard deviations of noise lie
between the two predictions. Half its square is the evidence that can be expected [nats], less where the misfit of form
exceeds the noise.

In the cross-validation every condition is left out in turn, and the model refitted to the others. A condition is torque
and gravity of a tumble; kind, speed and diameter of a penetration. The trials left out are then predicted; only their
own nuisances are refitted, within their priors. A base parameter of which the others say nothing (K of a diameter)
stays as all trials have it. What a prediction leaves is scored as a fit is (`evidence.tempered`): the form is never
nature's. Where motions are smooth in the parameters (pushes and drops), the fitted numbers count with their standard
errors. This is a predictive likelihood to first order in the errors (Gelman et al., Bayesian Data Analysis, 3rd ed.,
section 7.2): a drop that is sensitive to a number that the others determine badly is no evidence against a model.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from inspect import signature as arguments_of

import numpy as np

from experiments.diagnose.fit.evidence import SMALL, Hypothesis, held_out_fit, inflation, slow_count, tempered
from experiments.diagnose.fit.fitting import Fit, Linear, fit
from experiments.diagnose.fit.gate import column_basis
from experiments.diagnose.fit.problem import Array, Model, Values
from experiments.diagnose.fit.trials import TrialInfo
from experiments.diagnose.noise.replicates import groups_of

__all__ = ["CLOSE", "LEAD", "Predicted", "Rival", "compare", "folds_of", "marked", "predict"]

CLOSE = 4.0  # nats within which two effects cannot be separated
LEAD = 10.0  # nats by which a name must lead every rival
_SMALL_ANGLE = 25.0  # degrees below which two signatures count as one: forms of the same effect differ by as much
_SURE = 2.0  # nats of evidence and prediction together below which effects whose signatures differ are both named
_MOST_FOLDS = 4
_ROUNDS = 4
_WEAKEST = 1e-3  # of what all trials say of a number, what the others are taken to say at least


@dataclass(frozen=True)
class Predicted:
    """What is left of trials that were left out, all folds together."""

    chi_square: float
    count: int
    score: float  # tempered log likelihood of the prediction, comparable between models of one campaign [nats]
    learned: tuple[Values, ...] = ()  # what was fitted without each fold

    @property
    def per_sample(self) -> float:
        """Chi-square per sample of the likelihood's own noise; 1 is noise alone."""
        return self.chi_square / max(1, self.count)


@dataclass(frozen=True)
class Rival:
    """Another effect in the place of the first, compared with it."""

    effect: str
    hypothesis: Hypothesis
    behind: float  # evidence of the best over this one [nats]
    angle: float  # between the two signatures [degrees]
    distance: float  # between the two predictions [standard deviations of the noise]
    expected: float  # evidence that these trials can be expected to give between the two [nats]
    predicted: Predicted | None = None  # its cross-validation; None where there was none
    behind_left_out: float | None = None  # score of the best's cross-validation over this one's [nats]
    is_the_same: bool = False
    """Whether the best's form is this effect at its fitted numbers (`Form.becomes`), which explains the trials, too."""

    @property
    def close(self) -> bool:
        """Whether the evidence does not decide."""
        return self.behind < CLOSE

    @property
    def alike(self) -> bool:
        """Whether the design sees the two as one, or nearly so."""
        return self.angle < _SMALL_ANGLE or self.expected < CLOSE

    @property
    def same(self) -> bool:
        """Whether these trials cannot separate the two: neither the evidence nor the design nor prediction does."""
        undecided = self.behind_left_out is None or abs(self.total) < CLOSE
        return self.close and undecided and (self.alike or self.total < _SURE)

    @property
    def total(self) -> float:
        """Evidence and prediction together [nats]."""
        return self.behind + (self.behind_left_out or 0.0)

    @property
    def lead(self) -> float:
        """Nats by which the best leads this one, by the evidence or by prediction: both say much the same twice. None
        where the names mean the same: then forms are compared, and neither is nature's."""
        return 0.0 if self.is_the_same else max(self.behind, self.behind_left_out or 0.0)


def compare(effect: str, best: Hypothesis, other: Hypothesis, rest: Fit) -> Rival:
    """`other`, which has `effect` in the place of the best's first one, against `best`; `rest` has neither."""
    names = [p.name for p in best.fit.model.parameters]
    shared = [p for p in rest.model.parameters if p.name in names and p.name in other.fit.values]  # forms may differ
    columns = [names.index(p.name) for p in shared]
    weights = np.array([0.0 if math.isinf(p.std) else 1 / p.std for p in shared])
    scales = np.array([p.scale for p in shared])
    basis = column_basis(np.vstack([best.fit.jacobian[:, columns], np.diag(weights * scales)]))

    def point(found: Fit) -> Array:
        return np.concatenate([found.modes, weights * np.array([found.values[p.name] for p in shared])])

    def signature(found: Fit) -> Array:
        change = point(rest) - point(found)
        return change - basis @ (basis.T @ change)

    one, two = signature(best.fit), signature(other.fit)
    size = float(np.linalg.norm(one) * np.linalg.norm(two))
    cosine = float(one @ two) / size if size > 0 else 1.0
    distance = float(np.linalg.norm(one - two))
    return Rival(
        effect=effect, hypothesis=other, behind=best.score - other.score,
        angle=math.degrees(math.acos(float(np.clip(cosine, -1.0, 1.0)))), distance=distance,
        expected=0.5 * distance**2 / inflation(best.fit) ** 2,
    )  # fmt: skip


def marked(rivals: Sequence[Rival], best: Hypothesis) -> tuple[Rival, ...]:
    """Mark the rivals that mean the same as the best hypothesis in its last fit, and leave too little to matter."""
    names = _becomes(best) if best.effects else set()
    fits = [rival.hypothesis.fit for rival in rivals]
    return tuple(
        replace(rival, is_the_same=rival.effect in names and own.chi_square <= SMALL * own.count)
        for rival, own in zip(rivals, fits, strict=True)
    )


def _becomes(best: Hypothesis) -> set[str]:
    """Effects that each form of the first one is at its fitted numbers."""
    found = best.fit
    own = [form for form in best.forms if form.effect == best.effects[0]]
    names = [
        {other for other, asked in form.becomes if asked(*(
            found.model.problem.reported(found.values, form)[name][0] for name in arguments_of(asked).parameters
        ))}
        for form in own
    ]  # fmt: skip
    return set.intersection(*names) if names else set()


def folds_of(trials: Sequence[TrialInfo]) -> list[tuple[str, ...]]:
    """Trials to leave out together: one condition each, or neighbouring ones where there are more than four; none where
    all trials are of one condition."""
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
    if not folds:
        return None
    model, base = found.model, {p.name for p in found.model.problem.base}
    chi_square, wide, count, fits = 0.0, 0.0, 0, []
    for fold in folds:
        learned = fit(model.on([id for id in model.trials if id not in fold]), found.values, rounds=_ROUNDS)
        # Base parameters of which the other trials say nothing (K of a diameter that is left out) stay.
        slopes = zip(learned.model.parameters, learned.jacobian.T, strict=True)
        silent = {p.name: found.values[p.name] for p, slope in slopes if p.name in base and not slope.any()}
        values = held_out_fit(model, fold, {**found.values, **learned.values, **silent})
        fits.append(learned.values)
        if model.problem.contacts is None:
            left, spread, samples = _left_of(model.on(fold), values, learned, found, set(silent))
        else:
            (modes,) = model.on(fold).evaluate([values])
            left, spread, samples = float(modes @ modes), 0.0, len(modes)
        chi_square, wide, count = chi_square + left, wide + spread, count + samples
    return Predicted(chi_square, count, tempered(chi_square - count, slow_count(found)) - wide, tuple(fits))


def _left_of(part: Model, values: Values, learned: Fit, found: Fit, silent: set[str]) -> tuple[float, float, int]:
    """What a prediction of the trials of `part` leaves, the errors of what was `learned` counted as noise; half the
    log of the factor by which these errors widen it; number of samples. `silent`: what the others say nothing of."""
    there = Linear.of(part, values)
    full = {p.name: row for p, row in zip(found.model.parameters, np.diag(found.hessian()), strict=True)}
    names = [p.name for p in learned.model.parameters]
    weak = np.array([_WEAKEST * full[name] for name in names])
    covariance = np.linalg.inv(learned.hessian() + np.diag(np.maximum(weak, 1e-300)))
    shared = [
        (k, names.index(p.name)) for k, p in enumerate(there.parameters)
        if p.trial is None and p.name in names and p.name not in silent and learned.free[names.index(p.name)]
    ]  # fmt: skip
    mine, own = [k for k, _ in shared], [k for _, k in shared]
    errors = there.jacobian[:, mine] @ np.linalg.cholesky(covariance[np.ix_(own, own)])
    inner = np.eye(len(own)) + errors.T @ errors
    along = errors.T @ there.modes
    left = float(there.modes @ there.modes - along @ np.linalg.solve(inner, along))
    return left, 0.5 * float(np.linalg.slogdet(inner)[1]), len(there.modes)
