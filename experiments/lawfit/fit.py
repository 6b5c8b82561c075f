"""A law fitted to runs in several beds, each bed with a random factor of its own.

The force of bin k in bed b is F = (1 + u_b) f(z, dz/dt; theta) + e, with u_b of variance tau^2 and e of variance
sigma^2, both normal and independent: each bed is stronger or weaker as a whole. The covariance within a bed is then
sigma^2 (I + lambda f f^T) with lambda = tau^2 / sigma^2 (Laird and Ware, Biometrics 38 (1982), 963). Two
steps alternate until nothing changes: lambda by maximum likelihood at the present theta, and theta by generalised least
squares at the present lambda and f.

Bins of one run are not independent, because grains are larger than bins. So standard deviations do not come from that
likelihood but from a jackknife over beds. It uses the largest of the usual three forms of the variance, (G - 1) / G sum
(theta_(-g) - theta)^2. Intervals have Student's t with G - 1 degrees of freedom for G beds (MacKinnon, Nielsen and
Webb, J. Applied Econometrics 38 (2023), 671). `experiments.lawfit.synthetic` measures their coverage.
"""

import math
from dataclasses import dataclass, replace
from typing import Generic, Protocol, Self, TypeVar

import numpy as np
from scipy.optimize import least_squares, minimize_scalar
from scipy.stats import chi2

from rigid.intervals import student

from .data import Array, Data

__all__ = [
    "CONFIDENCE",
    "Estimated",
    "Fittable",
    "Law",
    "LawFit",
    "fit_law",
    "fit_usable",
    "interval",
    "mean_of",
    "solve_law",
]

CONFIDENCE = 0.9
"""Confidence level of all intervals."""
_ROUNDS = 8
"""Largest number of alternations of theta and lambda; two to four are sufficient."""


@dataclass(frozen=True)
class Estimated:
    """A number with its standard deviation and its 90 % interval."""

    value: float
    std: float
    low: float
    high: float


class Fittable(Protocol):
    """What can be fitted: a law with free parameters."""

    @property
    def name(self) -> str:
        """Of the law."""

    @property
    def free(self) -> tuple[str, ...]:
        """Names of the free parameters."""

    @property
    def rate_parameter(self) -> str | None:
        """The free parameter of the rate term; None if there is none."""

    def without_rate(self) -> Self:
        """The same law with that parameter held at 0."""

    def bounds(self) -> tuple[Array, Array]:
        """Smallest and largest value of each free parameter, shapes [parameter_count]."""

    def start(self, data: Data) -> Array:
        """Initial values of the fit, shape [parameter_count]."""

    def predict(self, theta: Array, data: Data) -> Array:
        """Predicted `data.force`, shape [row_count]."""


Law = TypeVar("Law", bound=Fittable)


@dataclass(frozen=True)
class LawFit(Generic[Law]):
    """A candidate fitted to `data`."""

    candidate: Law
    data: Data
    theta: Array  # Free parameters, shape [parameter_count]
    left_out: Array  # theta without each bed, shape [bed_count, parameter_count]; empty without jackknife
    share: float  # lambda [1/N2]
    sigma: float  # [N]
    log_likelihood: float
    free_rate: Estimated | None = None
    """Value of the rate parameter in a free fit that gave less than 0; this fit then holds it at 0."""

    @property
    def bed_spread(self) -> float:
        """tau, the standard deviation of the factors of beds [1]."""
        return math.sqrt(self.share) * self.sigma

    @property
    def bed_spread_interval(self) -> tuple[float, float]:
        """90 % interval of `bed_spread` [1]: that of a standard deviation of as many normal factors as there are beds.

        The noise within a bed is not included. So the interval is too narrow where that noise causes most of the
        differences between beds.
        """
        free = len(self.data.beds) - 1
        ends = (0.5 + 0.5 * CONFIDENCE, 0.5 - 0.5 * CONFIDENCE)
        low, high = (self.bed_spread * math.sqrt(free / float(chi2.ppf(end, free))) for end in ends)
        return low, high

    @property
    def predicted(self) -> Array:
        """Force of the law at every bin [N], shape [row_count]."""
        return self.candidate.predict(self.theta, self.data)

    @property
    def information(self) -> float:
        """Akaike's information criterion, corrected for few rows: smaller is better [1].

        It assumes independent bins, which they are not, so differences grow with the number of bins. No law is
        chosen by it.
        """
        count, size = len(self.theta) + 2, len(self.data.force)
        return -2 * self.log_likelihood + 2 * count + 2 * count * (count + 1) / max(1, size - count - 1)

    def parameter(self, name: str) -> Estimated:
        """The parameter `name` with its uncertainty."""
        place = self.candidate.free.index(name)
        return interval(float(self.theta[place]), self.left_out[:, place])

    def at_bound(self, name: str) -> bool:
        """Whether the parameter is at a bound, or does not differ significantly from one.

        The 90 % interval of a parameter with two bounds, such as an exponent, must lie between them. A strength has one
        bound, 0; there only the value is tested, because its interval is wide if the exponent is free.
        """
        place, found = self.candidate.free.index(name), self.parameter(name)
        low, high = (float(ends[place]) for ends in self.candidate.bounds())
        if math.isfinite(low) and math.isfinite(high) and not low < found.low <= found.high < high:
            return True
        return any(
            math.isfinite(end) and math.isclose(found.value, end, rel_tol=1e-3, abs_tol=1e-6) for end in (low, high)
        )


def interval(value: float, left_out: Array) -> Estimated:
    """Jackknife uncertainty of `value` (see the module); `left_out`: values without a bed, shape [bed_count >= 2]."""
    count = len(left_out)
    std = math.sqrt((count - 1) / count * float(np.sum((left_out - value) ** 2)))
    return _within(value, std, count)


def mean_of(values: Array) -> Estimated:
    """The mean of independent `values`, one of each bed, shape [bed_count >= 2]."""
    count = len(values)
    return _within(float(values.mean()), float(values.std(ddof=1)) / math.sqrt(count), count)


def _within(value: float, std: float, count: int) -> Estimated:
    half = student(count - 1, CONFIDENCE) * std
    return Estimated(value, std, value - half, value + half)


def fit_usable(fitted: LawFit[Law]) -> LawFit[Law]:
    """`fitted`; if its rate parameter is below 0, which no law allows, a new fit with that parameter at 0."""
    rate = fitted.candidate.rate_parameter
    if rate is None or fitted.parameter(rate).value >= 0:
        return fitted
    return replace(fit_law(fitted.candidate.without_rate(), fitted.data), free_rate=fitted.parameter(rate))


def fit_law(candidate: Law, data: Data, *, jackknife: bool = True) -> LawFit[Law]:
    """Fit `candidate` to `data`; with `jackknife` also without each bed.

    Raises ValueError for fewer than two beds with `jackknife`, and RuntimeError where the fit does not converge.
    """
    if jackknife and len(data.beds) < 2:
        raise ValueError(f"{len(data.beds)} bed: at least two are needed for an uncertainty")
    theta, share = solve_law(candidate, data, candidate.start(data), None)
    left_out = np.empty((0, len(theta)))
    if jackknife:
        left_out = np.array([solve_law(candidate, data.without_bed(bed), theta, share)[0] for bed in data.beds])
    force = candidate.predict(theta, data)
    size, (square, spread) = len(data.force), _moments(data, force)
    best = float(np.sum(square - share * spread[0] ** 2 / (1 + share * spread[1])))
    sigma = math.sqrt(max(best, 1e-300) / size)
    log_likelihood = -0.5 * (size * (1 + math.log(2 * math.pi * sigma**2)) + float(np.log1p(share * spread[1]).sum()))
    return LawFit(candidate, data, theta, left_out, share, sigma, log_likelihood)


def _moments(data: Data, force: Array) -> tuple[Array, tuple[Array, Array]]:
    """For each bed r.r, and f.r and f.f, with the residual r = F - f, shapes [bed_count]."""
    left, beds, count = data.force - force, data.bed_of_row, len(data.beds)

    def sums(values: Array) -> Array:
        return np.asarray(np.bincount(beds, weights=values, minlength=count), dtype=float)

    return sums(left * left), (sums(force * left), sums(force * force))


def _best_share(data: Data, force: Array) -> float:
    """lambda of the largest likelihood at this force [1/N2]; 0 if factors of beds do not increase the likelihood."""
    size, (square, (cross, own)) = len(data.force), _moments(data, force)
    scale = float(own.mean()) or 1.0

    def cost(log_share: float) -> float:
        share = math.exp(log_share) / scale
        rest = float(np.sum(square - share * cross**2 / (1 + share * own)))
        return size * math.log(max(rest, 1e-300)) + float(np.log1p(share * own).sum())

    found = minimize_scalar(cost, bounds=(-14.0, 14.0), method="bounded")
    none = size * math.log(max(float(square.sum()), 1e-300))
    return math.exp(float(found.x)) / scale if float(found.fun) < none - 1e-9 else 0.0


def solve_law(candidate: Fittable, data: Data, theta: Array, share: float | None) -> tuple[Array, float]:
    """theta, shape [parameter_count], and lambda [1/N2]; `share`: a fixed lambda, or None to fit it."""
    size = np.where(theta != 0, np.abs(theta), 1.0)
    low, high = candidate.bounds()
    theta = np.clip(theta, low + 1e-9 * size, high - 1e-9 * size)
    beds, count = data.bed_of_row, len(data.beds)
    # Forces are scaled by their rms: the solver stops at an absolute slope, which tiny forces always have.
    unit = float(np.sqrt(np.mean(data.force**2))) or 1.0
    force = candidate.predict(theta, data)
    kept = 0.0 if share is None else share
    for turn in range(_ROUNDS):
        own = np.bincount(beds, weights=force * force, minlength=count)
        # (I + lambda f f^T)^(-1/2) r = r - (1 - (1 + lambda s)^(-1/2)) f (f.r) / s with s = f.f
        pull = (1 - 1 / np.sqrt(1 + kept * own)) / np.where(own > 0, own, 1.0)

        def whitened(x: Array, frozen: Array = force, pull: Array = pull) -> Array:
            left = data.force - candidate.predict(x * size, data)
            cross = np.bincount(beds, weights=frozen * left, minlength=count)
            return np.asarray((left - (pull * cross)[beds] * frozen) / unit)

        found = least_squares(
            whitened, theta / size, bounds=(low / size, high / size), x_scale="jac", xtol=1e-10, ftol=1e-12
        )
        if not found.success:
            raise RuntimeError(f"the fit of {candidate.name} did not converge: {found.message}")
        moved = float(np.max(np.abs(found.x - theta / size) / np.maximum(np.abs(found.x), 1e-3)))
        theta = found.x * size
        force = candidate.predict(theta, data)
        before, kept = kept, _best_share(data, force) if share is None else share
        if turn and moved < 1e-5 and abs(kept - before) <= 1e-3 * max(kept, before):
            break
    return theta, kept
