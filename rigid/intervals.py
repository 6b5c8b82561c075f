"""Half-widths of the intervals that results quote: Student's of a mean over a few beds, and the normal law's."""

import math
from collections.abc import Mapping
from typing import Any

__all__ = ["CONFIDENCE", "NORMAL", "half_of", "half_width", "joint_freedom", "student"]

CONFIDENCE = 0.95
"""Share of cases in which an interval contains the true value, where nothing else is stated."""
NORMAL = 1.96
"""Half of a 95 % interval over the standard deviation of a normal distribution [1]."""


def student(freedom: float, confidence: float = CONFIDENCE) -> float:
    """Student's t [1]: half of a two-sided interval over the standard error, for a number of degrees of freedom.

    ``freedom``: Above 0, not only whole; infinity gives the normal distribution.
    """
    # Not scipy.stats, and only here: `hedgebed --help` imports modules that use this, and each loads slowly.
    from scipy.special import stdtrit

    return float(stdtrit(freedom, 0.5 + 0.5 * confidence))


def half_width(std: float | None, count: int) -> float | None:
    """Half of Student's 95 % interval of the mean of `count` values with this standard deviation, t s / sqrt(n).

    ``std``: Of the values, with n - 1 in the denominator, in any unit. None for fewer than two values and where the
    standard deviation is None: one value shows no scatter.
    """
    return None if std is None or count < 2 else student(count - 1) * std / math.sqrt(count)


def joint_freedom(std: float, part: float, freedom: float) -> float:
    """Effective degrees of freedom of a standard error, by Welch and Satterthwaite (JCGM 100:2008, G.4.1).

    ``std``: The whole. ``part``: The part that was found from ``freedom`` degrees of freedom, above 0; the rest counts
    as known.
    """
    return freedom * (std / part) ** 4


def half_of(entry: Mapping[str, Any]) -> float | None:
    """Half of the 95 % interval of a fitted number, such as a quantity of result.json with its standard error ``std``.

    Student's where its ``freedom`` is known, else that of the normal distribution. None for a number without a standard
    error.
    """
    std, freedom = entry.get("std"), entry.get("freedom")
    return None if std is None else (NORMAL if freedom is None else student(freedom)) * std
