"""A push whose depth has another zero than that of its replicates: shown by these, without a model of the bed."""

import math
from collections.abc import Iterator, Sequence
from itertools import combinations

import numpy as np
from scipy.optimize import minimize_scalar

from experiments.campaign import Campaign
from experiments.campaign.tables import PenetrationTrial

from .pushes import down, trials_of
from .replicas import Condition, condition_of
from .words import Array, row_noise, say, std_of, times

__all__ = ["shifted_depths"]

_FEWEST = 3  # pushes of one condition: two that differ do not show which of them is off
_ROWS = 20  # of each on the way down
_FARTHEST = 0.3  # share of the depth by which a zero is looked for
_TRIED = 121  # shifts that are tried before the best is refined
_PLACES = 200  # depths at which curves are compared
_AGREE = 4.0  # mean square by which the others may differ, over the noise of the force: two of three agree by chance
_OFF = 6.0  # mean square of what is off, over what the replicates differ by, from which a zero is looked for
_FITS = 2.0  # the same up to which the moved curve is theirs
_BETTER = 3.0  # and how many times better than any factor on the force it must be: beds differ by one
_AS_GOOD = 1.5  # ratio up to which another zero of the force does as well: of a straight spring the two are the same
_SURE = 5.0  # standard errors, and standard deviations of the depth, by which the zero must be off
_LEAST = 0.01  # share of the depth by which it must be off

Curve = tuple[Array, Array]  # depth, rising, and force


def shifted_depths(campaign: Campaign) -> Iterator[tuple[str, str]]:
    """(trial, sentence) of pushes that are their replicates' curve once their depth is moved.

    Of at least `_FEWEST` pushes of one condition all but one agree. The mean square distance of that one from the mean
    of the others is compared with the differences among these. It is compared as recorded, and with the shift of its
    depth that fits best (least squares), the one parameter of the comparison."""
    groups: dict[Condition, list[tuple[str, Curve]]] = {}
    force_std = depth_std = 0.0
    for tables, trial, data in trials_of(campaign, "driven"):
        assert isinstance(trial, PenetrationTrial)
        pushed = down(data, fewest=_ROWS)
        if pushed is None:
            continue
        force_std, depth_std = std_of(tables.sensors.force), std_of(tables.sensors.depth)
        _, depth, force = pushed
        order = np.argsort(depth, kind="stable")
        groups.setdefault(condition_of(tables, trial), []).append((trial.id, (depth[order], force[order])))
    for pushes in groups.values():
        found = [(id, said) for id, said in _in_group(pushes, force_std, depth_std) if said]
        if len(found) == 1:  # where several are off, none of them shows how far the others are
            yield found[0]


def _in_group(pushes: Sequence[tuple[str, Curve]], force_std: float, depth_std: float) -> Iterator[tuple[str, str]]:
    for place, (id, own) in enumerate(pushes) if len(pushes) >= _FEWEST else ():
        others = [curve for k, (_, curve) in enumerate(pushes) if k != place]
        yield id, _shifted(own, others, force_std, depth_std)


def _shifted(own: Curve, others: Sequence[Curve], force_std: float, depth_std: float) -> str:
    """What to say of a push beside its replicates; empty where no shift makes it one of them."""
    low, high = max(z[0] for z, _ in others), min(z[-1] for z, _ in others)
    if not high > max(low, 0.0):
        return ""
    places = np.linspace(low, high, _PLACES)
    curves = [np.interp(places, *curve) for curve in others]
    mean = np.mean(curves, axis=0)
    theirs = float(np.mean([np.mean((a - b) ** 2) for a, b in combinations(curves, 2)])) / 2
    noise = max(force_std, *(row_noise(force) for _, force in others)) ** 2
    unit = max(theirs, force_std**2) * (1 + 1 / len(others))
    if not unit > 0 or theirs > _AGREE * noise:
        return ""

    def left(shift: float) -> float:
        """Mean square of force less the others' mean, the depth moved by `shift` [m], over what chance makes of it."""
        mine, rows = own[0] + shift, (own[0] + shift >= low) & (own[0] + shift <= high)
        if rows.sum() < _ROWS:
            return math.inf
        return float(np.mean((own[1][rows] - np.interp(mine[rows], places, mean)) ** 2)) / unit

    before = left(0.0)
    if not _OFF < before < math.inf:
        return ""
    grid = np.linspace(-_FARTHEST * high, _FARTHEST * high, _TRIED)
    best, step = float(grid[int(np.argmin([left(float(shift)) for shift in grid]))]), float(grid[1] - grid[0])
    best = float(minimize_scalar(left, bounds=(best - step, best + step), method="bounded").x)
    after = left(best)
    slope = np.gradient(mean, places)
    error = math.sqrt(unit / max(float(np.mean(slope**2)) * len(own[0]), 1e-300))
    far = max(_SURE * error, _SURE * depth_std, _LEAST * high)
    rows = (own[0] >= low) & (own[0] <= high)
    here, there = own[1][rows], np.interp(own[0][rows], places, mean)
    factor = float(here @ there) / max(float(there @ there), 1e-300)
    zero = float(np.mean(here - there))
    scaled, offset = (float(np.mean((here - model) ** 2)) / unit for model in (factor * there, there + zero))
    if after > _FITS or abs(best) < far or _BETTER * after > scaled:
        return ""
    also = say("or_force_zero", zero=-zero) if offset < _AS_GOOD * after else ""
    return say("moved_depth", others=len(others), shift=1e3 * best, also=also, before=times(before), after=times(after))
