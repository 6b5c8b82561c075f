"""Slopes of noisy readings, by polynomials through neighbouring rows."""

import numpy as np

from .problem import Array

__all__ = ["acceleration", "slope"]

_SHARE = 1 / 12  # of a recording, over which an acceleration is taken
_FEWEST = 7


def slope(time: Array, values: Array, *, rows: int) -> Array:
    """Slope of a straight line through each `rows` neighbouring readings; shapes [n]."""
    return _fitted(time, values, rows, 1)


def acceleration(time: Array, values: Array) -> Array:
    """Second derivative, of a parabola through the readings of a twelfth of the time; shapes [n]."""
    return 2.0 * _fitted(time, values, max(_FEWEST, round(_SHARE * len(time))), 2)


def _fitted(time: Array, values: Array, rows: int, degree: int) -> Array:
    """The coefficient of the highest power of a polynomial through the rows around each; 0 where there are too few."""
    half, found = rows // 2, np.zeros(len(time))
    for k in range(len(time)):
        own = slice(max(0, k - half), k + half + 1)
        t = time[own] - time[own].mean()
        span = float(np.ptp(t))
        if len(t) > degree and span > 0:
            powers = (t / span)[:, None] ** np.arange(degree + 1)
            found[k] = np.linalg.lstsq(powers, values[own], rcond=None)[0][degree] / span**degree
    return found
