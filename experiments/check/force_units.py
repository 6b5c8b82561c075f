"""Is force_N in newtons? What all pushes read over what spring and damper give, as they are stated or as drops have it.

A factor between two units is the same in every push and at every depth, and far from what a stated uncertainty allows.
It is a suspicion, said by name; nothing is converted.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from experiments.campaign import Campaign, PenetrationCampaign, Recording
from experiments.campaign.tables import PenetrationTrial
from rigid.platform.rig import STANDARD_GRAVITY

from .words import say, times

__all__ = ["force_units"]

_POUND = 4.4482216152605  # newtons of a pound of force


@dataclass(frozen=True)
class _Unit:
    ratio: float  # read over true
    what: str
    alone: bool  # whether no effect and no damper makes such a factor, so that a force of any shape may have it


_UNITS = (
    _Unit(1 / STANDARD_GRAVITY, "kilograms of force, kgf (times 9.80665 it is newtons)", True),
    _Unit(1e3 / STANDARD_GRAVITY, "grams of force, gf (times 0.00980665 it is newtons)", True),
    _Unit(1 / _POUND, "pounds of force, lbf (times 4.44822 it is newtons)", False),
    _Unit(STANDARD_GRAVITY, "newtons that were multiplied by 9.81 once more", False),
    _Unit(_POUND, "newtons that were multiplied by 4.448 once more", False),
)
_SIGMAS = 4.0  # standard deviations of what is stated, in logarithms, beyond which a ratio is no parameter's error
_LEAST = 3.0  # ratio from which on it is asked for at all
_NEAR, _NEAR_SIGMAS = 0.25, 2.5
"""How near in logarithms a unit must be: what a missing effect may add, and what the stated numbers leave open."""
_ALIKE = 0.3  # standard deviation of the pushes' ratios, in logarithms, up to which they are one factor
_ONE_SHAPE = 0.3  # logarithm by which the ratio may differ between shallow and deep rows
_ROWS = 8
_BY_DROPS = 0.15  # relative uncertainty of a stiffness that drops tell


@dataclass(frozen=True)
class _Push:
    ratio: float  # force over that of spring and damper, in the deeper half of the way in
    bend: float  # logarithm of the same, deep over shallow; NaN where it cannot be told
    doubt: float  # relative uncertainty of what spring and damper give, one sigma


def force_units(campaign: Campaign) -> Iterator[str]:
    """A sentence where the force of all pushes is off by the factor between two units; none else.

    Without a stiffness that is stated to better than its own size, drops stand for it: m (g - accel) over the depth
    where they turn.
    """
    tables = campaign.tables
    if not isinstance(tables, PenetrationCampaign):
        return
    known = tables.uncertainty.stiffness if tables.uncertainty is not None else 0.0
    stated = known is None or known < 1
    by_drops = {} if stated else _stiffness_of_drops(campaign, tables)
    pushes = []
    for trial in tables.trial:
        assert isinstance(trial, PenetrationTrial)
        data = campaign.recording(trial.id, "data")
        stiffness = tables.surface.stiffness if stated else by_drops.get(tables.diameter_of(trial))
        if trial.mode == "driven" and data is not None and stiffness:
            push = _push(tables, data, stiffness, (known or 0.0) if stated else _BY_DROPS)
            if push is not None:
                pushes.append(push)
    if not pushes:
        return
    logs = np.log([push.ratio for push in pushes])
    middle, doubt = float(np.median(logs)), float(np.median([push.doubt for push in pushes]))
    if abs(middle) < max(_SIGMAS * doubt, math.log(_LEAST)) or (len(logs) > 1 and float(np.std(logs)) > _ALIKE):
        return
    bends = [push.bend for push in pushes if math.isfinite(push.bend)]
    loose = tables.uncertainty is not None and (tables.uncertainty.damping or 0.0) >= 1  # a damper of any size
    straight = bool(bends) and abs(float(np.median(bends))) < _ONE_SHAPE and not loose
    near = [
        (abs(middle - math.log(unit.ratio)), unit) for unit in _UNITS
        if abs(middle - math.log(unit.ratio)) < max(_NEAR, _NEAR_SIGMAS * doubt) and (unit.alone or straight)
    ]  # fmt: skip
    if not near:
        return
    units = [unit for _, unit in sorted(near, key=lambda pair: pair[0])][:2]
    whose = "stiffness and damping, as stated, give" if stated else "the drops of the same diameter say of the spring"
    ratio = math.exp(middle)
    size = times(ratio) if ratio > 1 else f"{ratio:.2g} of"
    yield (
        say(
            "force_units",
            size=size,
            whose=whose,
            all="all " if len(pushes) > 1 else "",
            count=len(pushes),
            es="es" if len(pushes) > 1 else "",
        )
        + ", or like ".join(unit.what for unit in units)
        + ("; or the stiffness is another than stated" if stated else "")
        + ". Nothing was converted: a model that is fitted to it takes the factor for a stiffness"
    )


def _push(tables: PenetrationCampaign, data: Recording, stiffness: float, doubt: float) -> _Push | None:
    depth, force = data["depth_m"], data["force_N"]
    known = np.isfinite(depth) & np.isfinite(force)
    if known.sum() < 6 * _ROWS:
        return None
    time, z, f = data.time[known], depth[known], force[known]
    last = int(np.argmax(z))
    deepest = float(z[last])
    if deepest <= 0 or last < 4 * _ROWS:
        return None
    time, z, f = time[: last + 1], z[: last + 1], f[: last + 1]
    below = z > 0.05 * deepest
    span = float(np.ptp(time[below]))
    speed = float(np.polyfit(time[below], z[below], 1)[0]) if below.sum() >= _ROWS and span > 0 else 0.0
    damper = tables.surface.damping * max(speed, 0.0)
    gives = stiffness * np.maximum(z, 0.0) + damper
    deep, shallow = z > 0.5 * deepest, (z > 0.15 * deepest) & (z < 0.4 * deepest)
    met = float(np.median(f[deep])) / float(np.median(gives[deep]))
    if met <= 0:
        return None
    bend = math.nan
    if shallow.sum() >= _ROWS and float(np.median(f[shallow])) > 0:
        bend = math.log(met / (float(np.median(f[shallow])) / float(np.median(gives[shallow]))))
    spring = float(np.median(gives[deep])) - damper
    loose = tables.uncertainty.damping if tables.uncertainty is not None else 0.0
    return _Push(met, bend, math.hypot(doubt * spring, (loose or 0.0) * damper) / (spring + damper))


def _stiffness_of_drops(campaign: Campaign, tables: PenetrationCampaign) -> dict[float, float]:
    """K by diameter, from where drops turn: there the damper gives nothing."""
    found: dict[float, list[float]] = {}
    for trial in tables.trial:
        assert isinstance(trial, PenetrationTrial)
        data = campaign.recording(trial.id, "data")
        if trial.mode != "drop" or data is None or not tables.spike.mass:
            continue
        depth, accel = data["depth_m"], data["accel_m_s2"]
        if not np.isfinite(depth).any():
            continue
        last = int(np.nanargmax(depth))
        near = slice(max(last - 2, 0), last + 3)
        push = tables.spike.mass * (trial.gravity - accel[near])
        if 2 < last < len(depth) - 3 and np.isfinite(push).any() and float(np.nanmedian(push)) > 0 and depth[last] > 0:
            found.setdefault(tables.diameter_of(trial), []).append(float(np.nanmedian(push)) / float(depth[last]))
    return {diameter: float(np.median(own)) for diameter, own in found.items()}
