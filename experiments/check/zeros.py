"""Is depth 0 where the bed begins? Where the force sets in, push by push, compared over all pushes of a machine."""

import math
from collections.abc import Iterator

import numpy as np

from experiments.campaign import Campaign, PenetrationCampaign
from experiments.campaign.tables import PenetrationTrial

from .words import Array, say, std_of

__all__ = ["depth_zeros", "force_onset"]

_ROWS = 8  # rows that are averaged to tell whether there is a force
_SURE = 4.0  # standard errors from which on there is
_AFTER = 3  # such averages in a row with which it has set in
_LEAST = 5e-4  # m by which the zero must be off to be said
_SHARE = 0.05  # and the share of the deepest point
_BEGINS = 0.2  # share of what a force comes to that it may be where it begins
_ALIKE = 0.5  # share of it by which pushes may differ and yet be off alike


def depth_zeros(campaign: Campaign) -> Iterator[tuple[str, str]]:
    """(trial, sentence) where the force sets in deeper or less deep than 0; trial "" for what all pushes share."""
    tables = campaign.tables
    if not isinstance(tables, PenetrationCampaign):
        return
    std_force, std_depth = std_of(tables.sensors.force), std_of(tables.sensors.depth)
    found: dict[str, tuple[float, float]] = {}
    asked = 0
    for trial in tables.trial:
        assert isinstance(trial, PenetrationTrial)
        data = campaign.recording(trial.id, "data")
        if trial.mode != "driven" or data is None:
            continue
        asked += 1
        told = force_onset(data["depth_m"], data["force_N"], std_force)
        if told is None:
            continue
        onset, doubt = told
        deepest = float(np.nanmax(data["depth_m"]))
        if deepest > 0 and abs(onset) > max(_LEAST, _SHARE * deepest, 2 * doubt, 5 * std_depth):
            found[trial.id] = onset, deepest
    if not found:
        return
    onsets = np.array([onset for onset, _ in found.values()])
    middle = float(np.median(onsets))
    alike = len(found) == asked > 1 and bool(np.ptp(onsets) < _ALIKE * abs(middle))
    if alike:
        low, high = (1e3 * float(edge) for edge in (onsets.min(), onsets.max()))
        yield "", f"in all {asked} pushes the force sets in at a depth of {low:.3g} to {high:.3g} mm{_meaning(middle)}"
        return
    for id, (onset, _) in found.items():
        yield id, f"the force sets in at a depth of {1e3 * onset:.3g} mm{_meaning(onset)}"


def _meaning(onset: float) -> str:
    other = "is the top of the bed loose, or" if onset > 0 else "do grains stick out of the bed, or"
    return say("depth_zero", other=other)


def force_onset(depth: Array, force: Array, std: float) -> tuple[float, float] | None:
    """The depth at which a push begins to feel a force, and how far from that it may be [m]; None where it cannot be
    told: there is no force, or a sizeable one from the first row on.

    Averages of `_ROWS` rows on the way in; the force's own zero is that of the first rows, where they are alike.
    `depth` [m] and `force` [N], shape [n], NaN in gaps; `std`: the force's noise [N].
    """
    known = np.isfinite(depth) & np.isfinite(force)
    if known.sum() < 6 * _ROWS:
        return None
    z, f = depth[known], force[known]
    last = int(np.argmax(z))
    fresh = np.concatenate([[True], np.diff(f[: last + 1]) != 0])  # a force that is held says nothing new
    z, f = z[: last + 1][fresh], f[: last + 1][fresh]
    count = len(f) // _ROWS
    if count < 6:
        return None
    means = f[: count * _ROWS].reshape(count, _ROWS).mean(axis=1)
    starts, ends = z[: count * _ROWS : _ROWS], z[_ROWS - 1 : count * _ROWS : _ROWS]
    error = max(std, 1e-12) / math.sqrt(_ROWS)
    flat = abs(means[1] - means[0]) < _SURE * math.sqrt(2) * error
    zero = 0.5 * float(means[0] + means[1]) if flat else 0.0
    pushes = means - zero > _SURE * error
    if pushes[0]:
        return (float(starts[0]), float(ends[0] - starts[0])) if _from_nothing(z, f, float(starts[0]), std) else None
    for place in range(1, count - _AFTER):
        if pushes[place : place + _AFTER].all():
            onset, width = float(starts[place]), max(float(ends[place] - starts[place]), 0.0)
            return (onset, width) if onset <= 0 or _nothing_before(z, f - zero, onset, std) else None
    return None


def _from_nothing(depth: Array, force: Array, first: float, std: float) -> bool:
    """Whether a force that is there from the first row on, at the depth `first` [m], begins at nothing there."""
    rows = depth <= (2 * first if first > 0 else 0.0)
    if first == 0 or rows.sum() < _ROWS:
        return False
    (slope, start), covariance = np.polyfit(depth[rows] - first, force[rows], 1, cov="unscaled")
    comes_to = slope * abs(first)
    begins = abs(start) + 2 * std * math.sqrt(covariance[1, 1])
    return bool(comes_to > 2 * _SURE * std and begins < _BEGINS * comes_to)


def _nothing_before(depth: Array, force: Array, onset: float, std: float) -> bool:
    """Whether the rows from depth 0 to the onset [m] show that there is no force, not only that none is seen."""
    before, there = (depth > 0) & (depth < onset), (depth > 1.6 * onset) & (depth < 2.4 * onset)
    if before.sum() < _ROWS or not there.any():
        return False
    expected = float(force[there].mean()) * float(((depth[before] / (2 * onset)) ** 2).mean())
    error = max(std, 1e-12) / math.sqrt(before.sum())
    return expected > 2 * _SURE * error and float(force[before].mean()) < 0.5 * expected
