"""What a load cell reads before a push touches: its zero, and how far that differs from push to push.

Rows above the surface are the one place where a force zero shows without any model of the bed. Where these means differ
by more than their errors the zeros are a nuisance of each push with one common spread: it is marginalised in the
likelihood (`PenetrationProblem.rewhiten`). Rows above the surface determine most of it, and a push without such rows
has it from the others.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import stats

from experiments.diagnose.fit.problem import Array, Finding
from experiments.diagnose.noise.replicates import likeliest_scatter

from .data import Prepared

__all__ = ["ForceZeros", "find_force_zeros"]

_FEWEST = 8  # rows above the surface that determine a zero
_CLEAR = 4.0  # standard errors of the smoothed depth by which such a row is above
_SURE = 1e-4  # chance below which zeros differ
_EDGE = 0.5  # this share of all pushes must be read for their spread to be that of all of them
_WITHIN = 4.0  # spreads within which a zero is one of them


@dataclass(frozen=True)
class ForceZeros:
    """How far the zeros of the pushes' forces differ."""

    std: float  # of one push's zero about that of all [N]
    zeros: dict[str, float]  # as read above the surface [N], by trial
    finding: Finding

    def usual(self, trial: str) -> bool:
        """Whether this push's zero is one of those whose spread is known."""
        return trial in self.zeros and abs(self.zeros[trial]) < _WITHIN * self.std


def find_force_zeros(trials: Sequence[Prepared], noise: float) -> ForceZeros | None:
    """Zeros that differ by more than chance; None where they do not. `noise`: of the force as stated [N]."""
    read = {trial.info.id: rows for trial in trials if trial.driven and len(rows := _before_touch(trial)) >= _FEWEST}
    if len(read) < 2 or len(read) < _EDGE * sum(trial.driven for trial in trials):
        return None
    apart = [rows - rows.mean() for rows in read.values()]
    freedom = sum(len(rows) - 1 for rows in apart)
    variance = sum(float(rows @ rows) for rows in apart) / freedom
    # A mean of noise that is correlated has a larger error: that of an autoregressive law of first order.
    along = sum(float(rows[1:] @ rows[:-1]) for rows in apart) / max(freedom * variance, 1e-300)  # 0 of a simulation
    longer = (1 + along) / (1 - along) if along > 2 / np.sqrt(freedom) else 1.0
    one = np.sqrt(max(variance, noise**2) * longer)
    means = np.array([rows.mean() for rows in read.values()])
    errors = one / np.sqrt([len(rows) for rows in read.values()])
    middle = float((means / errors**2).sum() / (1 / errors**2).sum())
    if stats.chi2.sf(float((((means - middle) / errors) ** 2).sum()), len(means) - 1) >= _SURE:
        return None
    std = likeliest_scatter([np.column_stack([means, errors])])
    what = (
        f"the zero of the force differs by {std:.2g} N from push to push, {std / noise:.2g} times its noise, as rows "
        f"above the surface show ({means.min():.2g} to {means.max():.2g} N in {len(means)} pushes): taken into account "
        f"as a zero of each push's own"
    )
    zeros = {id: float(mean) for id, mean in zip(read, means, strict=True)}
    return ForceZeros(std, zeros, Finding(trial="", channel="force", what=what))


def _before_touch(trial: Prepared) -> Array:
    """Forces read before the spike first comes near the surface [N]."""
    smooth = trial.path
    near = smooth.depth > -_CLEAR * smooth.depth_std - np.abs(smooth.speed) * np.gradient(trial.time)
    first = int(np.argmax(near)) if near.any() else len(near)
    rows = trial.other[:first]
    return rows[np.isfinite(rows)]
