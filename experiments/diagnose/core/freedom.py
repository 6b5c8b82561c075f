"""Degrees of freedom of the standard error of a fitted number, of which the scatter of few beds is a part.

Few replicates show a scatter s with few degrees of freedom, so that half of a 95 % interval is Student's t times the
standard error, not 1.96 times it. The variance of a number is what it is where the beds are known, and what not knowing
them adds. The latter rests on the freedom of s; the rest counts as known (Welch and Satterthwaite).
"""

import math

from experiments.diagnose.fit.evidence import inflation
from experiments.diagnose.fit.fitting import Fit
from experiments.diagnose.fit.problem import Array, Estimate
from rigid.intervals import joint_freedom

__all__ = ["Freedoms", "from_beds"]

_MANY = 1e3  # degrees of freedom from which on Student's t is that of the normal distribution to three digits


def from_beds(found: Estimate, covariance: Array, inflation: float) -> Array | None:
    """What not knowing the beds adds to the covariance of a fit, shape [p, p]; None where their scatter was not found
    from trials. `covariance`: with this `inflation`."""
    stated = found.model.problem.known_std  # what the readings themselves show
    own = {p.name for p in found.model.scatter if p.kind not in stated}
    return covariance - found.covariance(inflation=inflation, known=own) if own else None


class Freedoms:
    """Of the numbers of one fit, whose scatter was found from `freedom` degrees of freedom; None: it has none.

    `covariance`: of the fit, with its inflation.
    """

    def __init__(self, found: Fit, covariance: Array, freedom: float | None) -> None:
        self._freedom = freedom or None
        self._beds = from_beds(found, covariance, inflation(found)) if freedom else None

    def of(self, slope: Array, std: float | None) -> float | None:
        """Of a number with this standard error. `slope`: its derivatives by the parameters, shape [p]. None where its
        error is as good as known."""
        if self._beds is None or self._freedom is None or not std:
            return None
        part = min(math.sqrt(max(float(slope @ self._beds @ slope), 0.0)), std)
        found = joint_freedom(std, part, self._freedom) if part > 0 else math.inf
        return found if found < _MANY else None
