"""What is the same in all beds of a campaign of pushes although K is not: it may be of the machine, not of the ground.

A bed that is prepared anew has another strength. A stiffness of unloading, or the depth of a layer, that stays the same
to within its errors is then doubtful. Each push is fitted alone, with its own K and that number, all others held. No
scatter of the number may be seen, one as large as that of K is excluded, so is an unloading that follows K.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import brentq
from scipy.special import chdtri

from experiments.diagnose.fit.evidence import inflation
from experiments.diagnose.fit.fitting import Fit, fit_each
from experiments.diagnose.fit.problem import Array, Model, Parameter

from .freedom import Freedoms
from .outcome import Diagnosis, Estimated

__all__ = ["Same", "same_in_all_beds", "scatter_bounds"]

_FEWEST = 3  # pushes
_LOOSE = 0.3  # relative error from which on a push does not show a number
_SIDE = 0.05  # chance beyond either bound of a scatter
_WHAT = {"unload_stiffness": "unloading", "layer_depth": "layer"}
"""Number of a form's law -> what is compared."""


@dataclass(frozen=True)
class Same:
    """One number that no bed changes."""

    what: str  # ``unloading`` (its stiffness) or ``layer`` (its depth)
    effect: str
    pushes: int
    lowest: float  # of the pushes, in `unit`
    highest: float
    unit: str
    scatter_at_most: float  # relative standard deviation over the pushes, upper 95 % bound
    k_scatter: float  # of K, the same, as estimated
    k_at_most: Estimated | None  # of the ground alone, if the machine unloads; None of a layer


def same_in_all_beds(found: Diagnosis) -> list[Same]:
    """The numbers of named effects that are the same in all beds of pushes. None where K does not scatter, where the
    scatter of such a number could not be seen beside it, and in campaigns of several diameters."""
    if found.problem.kind != "penetration" or "stiffness" not in found.best_values:
        return []
    numbers = {
        name: (_WHAT[slot.name], form)
        for form in found.forms if form.effect in found.effects
        for name, slot in form.slots.items() if slot.name in _WHAT
    }  # fmt: skip
    fits = _alone(found, list(numbers)) if numbers else []
    shown = []
    for name, (what, form) in numbers.items():
        rows = [row for one in fits if (row := _logs(found, one, name, what)) is not None]
        if len(rows) < _FEWEST:
            continue
        own, own_std, k, k_std, apart, apart_std = np.array(rows).T
        (seen, most), (differs, _) = scatter_bounds(own, own_std), scatter_bounds(k, k_std)
        spread = math.sqrt(max(float(np.var(k, ddof=1) - np.mean(k_std**2)), 0.0))
        follows = what == "unloading" and scatter_bounds(apart, apart_std)[0] == 0
        if seen > 0 or differs == 0 or most >= spread or follows:
            continue
        value, unit = found.problem.reported(found.best_values, form)[form.slots[name].name]
        bound = None
        if what == "unloading":
            bound = _k_at_most(found, name, value)
            value, unit = found.best_values["stiffness"] * (1 + value), "N/m"
        lowest, highest = (float(value * math.exp(end)) for end in (own.min(), own.max()))
        shown.append(Same(what, form.effect, len(rows), lowest, highest, unit, most, spread, bound))
    return shown


def _k_at_most(found: Diagnosis, name: str, u: float) -> Estimated | None:
    """K of the ground where the machine alone unloads, with a stiffness K (1 + u): in series 1 / (1 / K - 1 / (K (1 +
    u))) = K (1 + u) / u. A stiffer machine has a K nearer to the fitted one."""
    one = found.best
    places = {p.name: place for place, p in enumerate(one.model.parameters)}
    if u <= 0 or not {"stiffness", name} <= places.keys():
        return None
    k, slope = found.best_values["stiffness"], np.zeros(len(places))
    slope[places["stiffness"]], slope[places[name]] = (1 + u) / u, -k / u**2
    covariance = one.covariance(inflation=inflation(one))
    std = math.sqrt(max(float(slope @ covariance @ slope), 0.0))
    freedom = Freedoms(one, covariance, (found.known_scatter or {}).get("freedom")).of(slope, std)
    bound: Estimated = {"value": k * (1 + u) / u, "std": std, "unit": "N/m"}
    return bound if freedom is None else {**bound, "freedom": freedom}


def scatter_bounds(values: Array, stds: Array) -> tuple[float, float]:
    """Bounds of the standard deviation of true values, each 95 % one-sided, from `values` whose errors are known.

    A lower one of 0: no scatter is seen. The sum of squares about the weighted mean, over both variances, is chi-square
    with one degree less than there are values. For the upper one it is no smaller than errors make it on average, since
    errors that are stated too large exclude no scatter.
    """
    count = len(values) - 1

    def chi_square(scatter: float) -> float:
        weights = 1 / (stds**2 + scatter**2)
        return float(weights @ (values - weights @ values / weights.sum()) ** 2)

    short = max(count - chi_square(0.0), 0.0)

    def bound(chance: float, missing: float) -> float:
        def beyond(scatter: float) -> float:
            of_errors = missing * float(np.mean(stds**2 / (stds**2 + scatter**2)))
            return chi_square(scatter) + of_errors - float(chdtri(count, chance))

        top = 1e3 * (float(np.ptp(values)) + float(stds.max()))
        return float(brentq(beyond, 0.0, top)) if beyond(0.0) > 0 else 0.0

    return bound(_SIDE, 0.0), bound(1 - _SIDE, short)


def _alone(found: Diagnosis, names: Sequence[str]) -> list[Fit]:
    """The fit of each push by itself: its factors on K and on unloading, and of `names` a layer's depth; all other
    shared numbers are held. Priors of these are left out: they are of beds that are alike."""
    problem, best = found.problem, found.best.model
    used = (*found.fitted, *found.held_out)
    starts: list[tuple[Model, Mapping[str, float]]] = []
    for trial in problem.trials:
        if trial.id not in used or trial.condition[0] != "driven":
            continue
        free = [p for kind in ("bed", "bed unloading") for p in problem.scatter.get(kind, ()) if p.trial == trial.id]
        free += [replace(p, trial=trial.id) for p in _parameters(found) if p.name in names and _is_layer(found, p.name)]
        kept = [p for p in best.scatter if p.trial == trial.id and p.name not in {one.name for one in free}]
        own = tuple(replace(p, std=math.inf) for p in free) + tuple(kept)
        model = replace(best.on([trial.id]).holding(found.best_values), scatter=own)
        starts.append((model, {**{p.name: p.value for p in own}, **found.best_values}))
    return fit_each(starts)


def _parameters(found: Diagnosis) -> list[Parameter]:
    return [p for form in found.forms for p in form.parameters]


def _is_layer(found: Diagnosis, name: str) -> bool:
    return any(name in form.slots and _WHAT.get(form.slots[name].name) == "layer" for form in found.forms)


def _logs(found: Diagnosis, one: Fit, name: str, what: str) -> tuple[float, ...] | None:
    """Logarithms of the number over its shared value, of K over its own, and of the ratio of both, each with its error;
    None of a push that does not show them."""
    (trial,) = one.model.trials
    places = {p.name: place for place, p in enumerate(one.model.parameters)}
    bed, back = f"bed[{trial}]", f"bed unloading[{trial}]"
    own = back if what == "unloading" else name
    if not {bed, own} <= places.keys():
        return None
    k, k_slope, slope = math.log1p(one.values[bed]), np.zeros(len(places)), np.zeros(len(places))
    k_slope[places[bed]] = 1 / (1 + one.values[bed])
    if what == "unloading":  # a factor on K (1 + u)
        value, slope[places[own]] = k + math.log1p(one.values[own]), 1 / (1 + one.values[own])
        slope += k_slope
    else:  # the depth is fitted as a logarithm
        value, slope[places[own]] = one.values[own] - found.best_values[own], 1.0
    covariance = one.covariance(inflation=inflation(found.best))
    ways = (slope, k_slope, slope - k_slope)
    stds = [math.sqrt(max(float(way @ covariance @ way), 0.0)) for way in ways]
    if any(one.leaves_open(way) or not 0 < std < _LOOSE for way, std in zip(ways, stds, strict=True)):
        return None
    return value, stds[0], k, stds[1], value - k, stds[2]
