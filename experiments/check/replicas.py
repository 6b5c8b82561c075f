"""Replicates in a campaign, without a model: which trials are alike, and whether one is at odds with the others."""

from itertools import combinations
from typing import Any

import numpy as np

from experiments.campaign import Campaign, PenetrationCampaign, Recording, TumbleCampaign
from experiments.campaign.tables import PenetrationTrial, TumbleTrial

from .pushes import down
from .words import Array, Finding, factor_words, say, std_of

__all__ = ["Condition", "condition_of", "condition_words", "odd_replicates", "pace_of"]

Condition = tuple[object, ...]

_AT_ODDS = 20.0  # times as far from its replicates as these from one another, in mean square, a trial is at odds
_NOISE = 4.0  # and times farther, in mean square, than the sensors' noise would put it
_SIZEABLE = 0.1  # and share of the channel's standard deviation by which it differs: beds differ by some percent
_FASTER, _FASTER_OF_ALL = 1.1, 2.0
"""Ratio of two speeds beyond which pushes are never of one condition: usually, and where all pushes of the campaign are
within it, so that speed is no setting of theirs."""
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
    return trial.mode, tables.diameter_of(trial), trial.gravity, grains, pace_of(tables, trial)


def pace_of(tables: PenetrationCampaign, trial: PenetrationTrial) -> float | None:
    """The speed that stands for a trial's among replicates [m/s]; None where none is stated.

    Of a drop its own. Of a push the least stated one from which on C times the difference is below the noise of the
    force, and the ratio small: a mean speed that changes the force by less than the noise makes no new condition.
    """
    if trial.speed is None or trial.mode == "drop" or tables.sensors.force is None:
        return trial.speed
    speeds = sorted(abs(t.speed) for t in tables.trial if t.mode == trial.mode and t.speed is not None)
    least, noise = speeds[0], tables.sensors.force.std[0]
    most = _FASTER_OF_ALL if speeds[-1] <= _FASTER_OF_ALL * least else _FASTER
    for speed in speeds:
        if tables.surface.damping * (speed - least) > noise or speed > most * least:
            least = speed
        if speed >= abs(trial.speed):
            break
    return least


def condition_words(tables: TumbleCampaign | PenetrationCampaign, trial: Any) -> str:
    """The condition in short."""
    if isinstance(tables, TumbleCampaign):
        return f"{trial.actuator} {trial.torque:g} N m, {trial.gravity_sim:.4g} m/s2"
    speed = f" {trial.speed:g} m/s" if trial.speed is not None else ""
    size = f", {1e3 * tables.diameter_of(trial):g} mm" if trial.diameter is not None else ""
    pulled = f", {trial.gravity:.4g} m/s2" if trial.mode == "drop" else ""
    return f"{trial.mode}{speed}{size}{pulled}"


def odd_replicates(campaign: Campaign) -> list[Finding]:
    """Trials at odds with two or more replicates that agree with one another, in the channel where they are most so.

    Compared over the time that all of them have: cameras from the mean of their first tenth, driven forces downwards by
    depth. An odd trial lies far from its nearest replicate, by three bounds on the mean square. They are `_AT_ODDS`
    times the distance of the others from one another (median), `_NOISE` times the noise, and `_SIZEABLE` of the
    channel's own size."""
    tables = campaign.tables
    std = tables.uncertainty.gravity_sim if isinstance(tables, TumbleCampaign) else 0.0
    also = say("own_gravity", percent=100 * std) if std else ""  # each trial's gravity may be behind it
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
            own = {trial.id: campaign.recording(trial.id, sensor) for trial in trials}
            here = {id: recording for id, recording in own.items() if recording is not None}
            if len(here) < 3:
                continue
            for channel, std, curves in _curves(tables, sensor, trials[0], list(here.values())):
                for place, ratio in _at_odds(curves, std):
                    id = list(here)[place]
                    worst[id] = max(worst.get(id, (0.0, "")), (ratio, channel))
                    others = [curve for k, curve in enumerate(curves) if k != place]
                    units[id] = units.get(id) or factor_words(channel, curves[place], others)
        if 2 * len(worst) < len(trials):  # where half of them are odd, none is
            found += [
                Finding(
                    trial=id, channel=channel,
                    what=say("at_odds", id=id, others=len(trials) - 1, channel=channel, ratio=ratio) + units[id] + also,
                )
                for id, (ratio, channel) in worst.items()
            ]  # fmt: skip
    return found


def _curves(
    tables: TumbleCampaign | PenetrationCampaign, sensor: str, trial: Any, here: list[Recording]
) -> list[tuple[str, float, list[Array]]]:
    """(channel, its noise, a curve of each recording at common places); `trial`: one of them."""
    if isinstance(tables, PenetrationCampaign):
        sensors = tables.sensors
        if trial.mode == "driven":
            return [("force", std_of(sensors.force), _resampled([_by_depth(recording) for recording in here]))]
        names = {"depth_m": ("depth", sensors.depth), "accel_m_s2": ("accel", sensors.accel)}
        return [
            (name, std_of(table), _resampled([(r.time, r[column]) for r in here]))
            for column, (name, table) in names.items()
        ]
    stds = getattr(tables.sensors, sensor).std
    return [
        (column.rsplit("_", 1)[0] if sensor == "pose" else column, std,
         _resampled([(r.time, _from_start(r[column]) if sensor == "pose" else r[column]) for r in here]))
        for column, std in zip(list(here[0].columns)[1:], stds, strict=True)
    ]  # fmt: skip


def _by_depth(recording: Recording) -> tuple[Array, Array]:
    """Depth and force down to the deepest point, by depth."""
    pushed = down(recording)
    if pushed is None:
        return np.zeros(0), np.zeros(0)
    _, depth, force = pushed
    order = np.argsort(depth, kind="stable")
    return depth[order], force[order]


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


def _at_odds(curves: list[Array], std: float) -> list[tuple[int, float]]:
    """(place of a curve, times as far from its nearest replicate as the others are from one another)."""
    count = len(curves)
    far = np.zeros((count, count))
    for a, b in combinations(range(count), 2):
        difference = curves[a] - curves[b]
        far[a, b] = far[b, a] = float(np.nanmean(difference**2)) / 2 if np.isfinite(difference).any() else 0.0
    found = []
    for k in range(count):
        others = [j for j in range(count) if j != k]
        mine = min(far[k, j] for j in others)
        theirs = float(np.median([far[pair] for pair in combinations(others, 2)]))
        size = float(np.median([np.nanvar(curves[j]) if np.isfinite(curves[j]).any() else 0.0 for j in others]))
        if mine > max(_AT_ODDS * theirs, _NOISE * std**2, _SIZEABLE**2 * size):
            found.append((k, mine / max(theirs, 1e-300)))
    return found
