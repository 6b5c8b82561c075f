"""Which effects a campaign cannot tell apart, from their fitted signatures.

The signature of an effect is what it changes in the predicted data where it is fitted, over the noise, less what the
other parameters could take up. The angle between two signatures says whether the design sees them as one, whatever the
noise was in these trials; their distance, how many standard deviations of noise lie between the two predictions. Half
its square is what the evidence can be expected to tell [nats], less where the misfit of form is louder than the noise.
"""

import math
from dataclasses import dataclass

import numpy as np

from experiments.diagnose.fit.evidence import Hypothesis, inflation
from experiments.diagnose.fit.fitting import Fit
from experiments.diagnose.fit.gate import column_basis
from experiments.diagnose.fit.problem import Array

from .prediction import Predicted

__all__ = ["CLOSE", "Rival", "compare"]

CLOSE = 4.0  # nats within which two names cannot be told apart
_SMALL_ANGLE = 25.0
"""Degrees below which two signatures count as one: forms of one and the same effect differ by as much."""

_SURE = 2.0  # nats of evidence and prediction together below which names whose signatures differ are both said


@dataclass(frozen=True)
class Rival:
    """Another name in the place of the first, weighed against it."""

    effect: str
    hypothesis: Hypothesis
    behind: float  # evidence of the best over this one [nats]
    angle: float  # between the two signatures [degrees]
    distance: float  # between the two predictions [standard deviations of the noise]
    expected: float  # what these trials can be expected to tell between the two [nats]
    predicted: Predicted | None = None  # of conditions left out in turn; None where that was not looked at
    behind_left_out: float | None = None  # the same for the prediction of conditions left out [nats]

    @property
    def close(self) -> bool:
        """Whether the evidence does not decide."""
        return self.behind < CLOSE

    @property
    def alike(self) -> bool:
        """Whether the design sees the two as one, or next to one."""
        return self.angle < _SMALL_ANGLE or self.expected < CLOSE

    @property
    def same(self) -> bool:
        """Whether these trials cannot tell the two apart: neither the evidence nor the design nor prediction does."""
        undecided = self.behind_left_out is None or abs(self.total) < CLOSE
        return self.close and undecided and (self.alike or self.total < _SURE)

    @property
    def total(self) -> float:
        """Evidence and prediction together [nats]."""
        return self.behind + (self.behind_left_out or 0.0)


def compare(effect: str, best: Hypothesis, other: Hypothesis, rest: Fit) -> Rival:
    """`other`, which has `effect` in the place of the best's first one, against `best`; `rest` has neither."""
    names = [p.name for p in best.fit.model.parameters]
    shared = [p for p in rest.model.parameters if p.name in names]
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
