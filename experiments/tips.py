"""Where the tips of a platform's rows are."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rigid.trial import Trial

__all__ = ["tip_angles"]


def tip_angles(trial: Trial, theta: NDArray[np.float64]) -> NDArray[np.float64]:
    """Angle of each row's spike from straight down, clockwise [rad], shape [step, row]; theta [rad], shape [step]."""
    half = math.pi / trial.spike_count
    return np.asarray(theta[:, None] + half + 2 * half * np.arange(trial.spike_count))
