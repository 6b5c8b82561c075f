"""Replicates in a campaign, looked at without a model: which trials are alike, and is one at odds with the others?"""

from typing import Any

import numpy as np

from experiments.campaign import Campaign, PenetrationCampaign, Recording, TumbleCampaign
from experiments.campaign.tables import PenetrationTrial, TumbleTrial

from .words import Array, Finding, factor_words, say

__all__ = ["Condition", "condition_of", "condition_words", "odd_replicates"]

Condition = tuple[object, ...]

_AT_ODDS = 20.0
"""How many times as far from its replicates as they are from one another, in mean square, a trial is at odds."""
_NOISE = 4.0  # and how many times farther, in mean square, than the sensors' noise would put it
_SIZEABLE = 0.1
"""And by which share of what the channel does (its standard deviation) it must differ: beds differ by some percent."""
_POINTS = 80  # places at which replicates are compared


def condition_of(tables: TumbleCampaign | PenetrationCampaign, trial: Any) -> Condition:
    """What replicates share; driven trials without a nominal speed are alike (driven by hand)."""
    if isinstance(tables, TumbleCampaign):
        assert isinstance(trial, TumbleTrial)
        return (
            trial.gravity_sim, trial.torque, trial.actuator, trial.torque_until, trial.wheel_speed_0,
            tables.counterweight_of(trial),
        )  # fmt: skip
    assert isinstance(trial, PenetrationTrial)
    grains = trial.gravity if trial.grain_gravity is None else trial.grain_gravity
    return trial.mode, tables.diameter_of(trial), trial.gravity, grains, trial.speed


def condition_words(tables: TumbleCampaign | PenetrationCampaign, trial: Any) -> str:
    """The condition in short."""
    if isinstance(tables, TumbleCampaign):
        return f"{trial.actuator} {trial.torque:g} N m, {trial.gravity_sim:.4g} m/s2"
    speed = f" {trial.speed:g} m/s" if trial.speed is not None else ""
    size = f", {1e3 * tables.diameter_of(trial):g} mm" if trial.diameter is not None else ""
    pulled = f", {trial.gravity:.4g} m/s2" if trial.mode == "drop" else ""
    return f"{trial.mode}{speed}{size}{pulled}"


def odd_replicates(campaign: Campaign) -> list[Finding]:
    """Trials at odds with two or more replicates that agree with one another, the channel said in which most.

    Compared over the time that all of them have: cameras from the mean of their first tenth, driven forces on the way
    in by depth. In mean square a trial at odds lies `_AT_ODDS` times as far from its nearest replicate as the others
    from one another (median), `_NOISE` times what the sensors' noise makes of it, and `_SIZEABLE` of the channel's
    own size.
    """
    tables = campaign.tables
    groups: dict[Condition, list[Any]] = {}
    for trial in tables.trial:
        groups.setdefault(condition_of(tables, trial), []).append(trial)
    found = []
    for trials in groups.values():
        if len(trials) < 3:
            continue
        worst: dict[str, tuple[float, str]] = {}
        units: dict[str, str] = {}
        for sensor in trials[0].files:
            own = [campaign.recording(trial.id, sensor) for trial in trials]
            here = [(trial, recording) for trial, recording in zip(trials, own, strict=True) if recording is not None]
            if len(here) < 3:
                continue
            for channel, std, curves in _curves(tables, sensor, here):
                for name, ratio in _at_odds([trial.id for trial, _ in here], curves, std):
                    worst[name] = max(worst.get(name, (0.0, "")), (ratio, channel))
                    units[name] = units.get(name) or factor_words(
                        channel, *_parted([trial.id for trial, _ in here], curves, name)
                    )
        if 2 * len(worst) < len(trials):  # where half of them are odd, none is
            found += [
                Finding(
                    trial=id, channel=channel,
                    what=say("at_odds", id=id, others=len(trials) - 1, channel=channel, ratio=ratio) + units[id]
                    + _own_gravity(tables),
                )
                for id, (ratio, channel) in worst.items()
            ]  # fmt: skip
    return found


def _parted(ids: list[str], curves: list[Array], name: str) -> tuple[Array, list[Array]]:
    """The curve of one trial, and those of the others."""
    return curves[ids.index(name)], [curve for id, curve in zip(ids, curves, strict=True) if id != name]


def _own_gravity(tables: TumbleCampaign | PenetrationCampaign) -> str:
    """What may be behind it where every trial has a gravity of its own."""
    std = tables.uncertainty.gravity_sim if isinstance(tables, TumbleCampaign) else 0.0
    if not std:
        return ""
    return say("own_gravity", percent=100 * std)


def _curves(
    tables: TumbleCampaign | PenetrationCampaign, sensor: str, here: list[tuple[Any, Recording]]
) -> list[tuple[str, float, list[Array]]]:
    """(channel, its noise, a curve of each trial at common places)."""
    if isinstance(tables, PenetrationCampaign):
        sensors = tables.sensors
        if here[0][0].mode == "driven":
            std = sensors.force.std[0] if sensors.force else 0.0
            return [("force", std, _resampled([_way_in(recording) for _, recording in here]))]
        names = {"depth_m": ("depth", sensors.depth), "accel_m_s2": ("accel", sensors.accel)}
        return [
            (name, table.std[0] if table else 0.0, _resampled([(r.time, r[column]) for _, r in here]))
            for column, (name, table) in names.items()
        ]
    stds = getattr(tables.sensors, sensor).std
    return [
        (column.rsplit("_", 1)[0] if sensor == "pose" else column, std,
         _resampled([(r.time, _from_start(r[column]) if sensor == "pose" else r[column]) for _, r in here]))
        for column, std in zip(list(here[0][1].columns)[1:], stds, strict=True)
    ]  # fmt: skip


def _way_in(recording: Recording) -> tuple[Array, Array]:
    """Depth and force down to the deepest point, by depth."""
    depth, force = recording["depth_m"], recording["force_N"]
    known = np.isfinite(depth) & np.isfinite(force)
    depth, force = depth[known], force[known]
    if not len(depth):
        return depth, force
    last = int(np.argmax(depth))
    order = np.argsort(depth[: last + 1], kind="stable")
    return depth[: last + 1][order], force[: last + 1][order]


def _from_start(values: Array) -> Array:
    first = values[: max(1, len(values) // 10)]
    return values - (float(np.nanmean(first)) if np.isfinite(first).any() else 0.0)


def _resampled(pairs: list[tuple[Array, Array]]) -> list[Array]:
    """Medians of each curve over common stretches of its first part: lone readings do not count; NaN for none."""
    known = [(x[np.isfinite(x) & np.isfinite(y)], y[np.isfinite(x) & np.isfinite(y)]) for x, y in pairs]
    if min(len(x) for x, _ in known) < 8:
        return []
    low, high = max(x.min() for x, _ in known), min(x.max() for x, _ in known)
    if not high > low:
        return []
    count = min(_POINTS, *(len(x) // 4 for x, _ in known))
    edges = np.linspace(low, high, max(2, count) + 1)
    curves = []
    for x, y in known:
        place = np.digitize(x, edges) - 1
        inside = (place >= 0) & (place < len(edges) - 1)
        own = [y[inside][place[inside] == k] for k in range(len(edges) - 1)]
        curves.append(np.array([np.median(values) if len(values) else np.nan for values in own]))
    return curves


def _at_odds(ids: list[str], curves: list[Array], std: float) -> list[tuple[str, float]]:
    """(trial, how many times as far from its nearest replicate as the others are from one another)."""
    if not curves:
        return []
    count = len(ids)
    far = np.zeros((count, count))
    for a in range(count):
        for b in range(a + 1, count):
            difference = curves[a] - curves[b]
            far[a, b] = far[b, a] = float(np.nanmean(difference**2)) / 2 if np.isfinite(difference).any() else 0.0
    found = []
    for k in range(count):
        others = [j for j in range(count) if j != k]
        mine = min(far[k, j] for j in others)
        theirs = float(np.median([far[a, b] for a in others for b in others if a < b]))
        size = float(np.median([np.nanvar(curves[j]) if np.isfinite(curves[j]).any() else 0.0 for j in others]))
        if mine > max(_AT_ODDS * theirs, _NOISE * std**2, _SIZEABLE**2 * size):
            found.append((ids[k], mine / max(theirs, 1e-300)))
    return found
