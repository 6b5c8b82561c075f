"""Noise of the second simulator: it has the stated standard deviation, but is not white and Gaussian.

Each channel of a campaign draws one kind. `tails`: Student's t with five degrees of freedom. `coloured`: each value
keeps a part of the one before. `coarse`: readings are rounded to whole steps. `plain`: white and Gaussian.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["KINDS", "Noise", "draw_noise"]

Array = NDArray[np.float64]
KINDS = ("tails", "coloured", "coarse", "plain")
_FREEDOM = 5.0  # of Student's t: its variance is freedom / (freedom - 2)


@dataclass(frozen=True)
class Noise:
    """One sensor's noise: `kind`, `persistence` from value to value [1], `coarseness`, a step over the std [1]."""

    kind: str
    persistence: float = 0.0
    coarseness: float = 0.0

    def on(self, true: Array, std: float, random: np.random.Generator) -> Array:
        """Readings of `true` with noise of standard deviation `std`, shape [row_count]."""
        white = random.standard_normal(len(true))
        if self.kind == "tails":
            white = random.standard_t(_FREEDOM, len(true)) * np.sqrt((_FREEDOM - 2.0) / _FREEDOM)
        if self.kind == "coloured":
            fresh = np.sqrt(1.0 - self.persistence**2)
            for row in range(1, len(white)):
                white[row] = self.persistence * white[row - 1] + fresh * white[row]
        if self.kind == "coarse":  # a rounding has a variance of step^2 / 12, which the rest leaves room for
            step = self.coarseness * std
            read = true + np.sqrt(1.0 - self.coarseness**2 / 12.0) * std * white
            return np.round(read / step) * step
        return true + std * white


def draw_noise(random: np.random.Generator) -> Noise:
    """One of the four kinds, with its number."""
    return Noise(str(random.choice(KINDS)), float(random.uniform(0.1, 0.5)), float(random.uniform(0.3, 1.2)))
