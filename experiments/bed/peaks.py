"""Whether a sample has a peak: its largest stress ratio stands out of the fluctuations at large strain, or it does not.

A curve that only fluctuates has some thirty windows. The largest lies 2 standard deviations above their mean, and in
one sample of twenty 3: so does the maximum of thirty normal numbers. `LEAST_PEAK` is the latter.
"""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

__all__ = ["LEAST_PEAK", "peak_over_noise", "without_peak"]

LEAST_PEAK = 3.0
"""Standard deviations of the fluctuations by which a peak exceeds the mean at large strain, at least [1]."""


def peak_over_noise(smooth: NDArray[np.float64]) -> float:
    """How far the largest of a curve's windowed means lies above the mean of their second half [1].

    In standard deviations of that half; infinite where it does not fluctuate.
    """
    late = smooth[len(smooth) // 2 :]
    spread = float(late.std(ddof=1)) if len(late) > 1 else 0.0
    above = float(smooth.max() - late.mean())
    return above / spread if spread > 0 else np.inf


def without_peak(peaks: Iterable[float | None]) -> float | None:
    """The mean of these `peak_over_noise` where it is below `LEAST_PEAK`, else None; None too where none is known."""
    known = [over for over in peaks if over is not None]
    mean = float(np.mean(known)) if known else LEAST_PEAK
    return mean if mean < LEAST_PEAK else None
