"""Wrong units found from the readings where no stiffness is stated: by a sensor's noise, by the other trials, and by
the load that a bed of grains can carry."""

import math
from collections.abc import Iterator, Mapping

import numpy as np

from experiments.campaign import Campaign, PenetrationCampaign

from .pushes import down, trials_of
from .words import say

__all__ = ["noise_unit", "push_units"]

_Units = tuple[tuple[float, str, str], ...]


def _lengths(name: str) -> _Units:
    """Units of a length whose column has this name."""
    return ((1e3, "mm", f"{name}_mm would say so"), (100.0, "cm", "times 0.01 it is metres"),
            (1 / 0.0254, "inches", "times 0.0254 it is metres"))  # fmt: skip


_BY_NOISE: Mapping[str, _Units] = {
    "force_N": ((1e3, "mN", "force_mN would say so"), (1e-3, "kN", "times 1,000 it is newtons")),
    "depth_m": _lengths("depth"),
    "x_m": _lengths("x"),
    "y_m": _lengths("y"),
    "theta_rad": ((180 / math.pi, "deg", "theta_deg would say so"),),
}
"""Column -> other units: how many times too large a reading in it is, its name, and what to do. Pounds and kilograms of
force are too near to newtons for a stated noise to show them."""
_LIKE = 1.5  # factor within which the scatter of a sensor is that of another unit: a data sheet is no nearer
_THOUSAND = 1e3
_BEDS = 3.0  # factor by which pushes into one bed may differ: other depths, other feet
_STIFFEST, _SOFTEST = 5e8, 3e3
"""Bounds of pressure over depth [N/m3]: no bed of grains reaches the first at depths of some diameters, or falls below
the second at _HEAVY. Sand at 1 g has 3e5 (loose, fine grains) to 2e6 (plates of 60 to 100 mm: the CMU recordings), our
simulated beds up to 7e7."""
_HEAVY = 5.0  # m/s2
_MILLI = "mN (force_mN would say so)"


def noise_unit(column: str, ratio: float) -> str | None:
    """What a column may be instead, by its scatter from row to row over the stated noise, as a question. None where
    that ratio is not the ratio of two units."""
    for factor, unit, advice in _BY_NOISE.get(column, ()):
        if ratio > 0 and abs(math.log(ratio / factor)) <= math.log(_LIKE):
            size = "small" if factor > 1 else "large"
            return say("unit_by_noise", column=column, unit=unit, advice=advice, size=size)
    return None


def push_units(campaign: Campaign) -> Iterator[tuple[str, str, str]]:
    """(trial, channel, sentence) of driven trials: one that is 1,000 times off all others, or a bed that no grains are.
    Trial "" for what all pushes share."""
    tables = campaign.tables
    if not isinstance(tables, PenetrationCampaign):
        return
    pressures: dict[str, float] = {}  # over depth [N/m3]
    speeds: dict[str, float] = {}
    heavy = True
    for _, trial, data in trials_of(campaign, "driven"):
        pushed = down(data, fewest=24)
        if pushed is None or pushed[1][-1] <= 0:
            continue
        time, depth, force = pushed
        deep = depth > 0.5 * depth[-1]
        area = math.pi * tables.diameter_of(trial) ** 2 / 4
        pressures[trial.id] = float(np.median(force[deep])) / float(np.median(depth[deep])) / area
        span = float(np.ptp(time[deep]))
        if trial.speed is None and span > 0:
            speeds[trial.id] = float(np.ptp(depth[deep])) / span
        heavy = heavy and min(trial.gravity, trial.grain_gravity or trial.gravity) >= _HEAVY
    off = dict(_alone(pressures))
    for id, ratio in off.items():
        yield id, "force", say("force_alone", times=_words(ratio), unit=_MILLI if ratio > 1 else "kN")
    for id, ratio in _alone(speeds):
        yield (
            id,
            "clock",
            say("time_alone", times=_words(1 / ratio), unit="ms (t_ms would say so)" if ratio < 1 else "ks"),
        )
    if not off and pressures and tables.surface.granular and tables.uncertainty.stiffness >= 1:
        usual = float(np.median(list(pressures.values())))
        if usual > _STIFFEST or (0 < usual < _SOFTEST and heavy):
            unit = _MILLI if usual > _STIFFEST else "kN"
            yield "", "force", say("no_bed", usual=usual, unit=unit)


def _alone(sizes: Mapping[str, float]) -> Iterator[tuple[str, float]]:
    """Trials whose size is about 1,000 times, or a thousandth of, that of all others, which are alike: (trial, ratio).
    Of two trials neither can be the one."""
    for id, size in sizes.items():
        others = np.array([other for name, other in sizes.items() if name != id])
        if len(others) < 2 or size <= 0 or others.min() <= 0 or others.max() > _BEDS**2 * others.min():
            continue
        ratio = size / float(np.median(others))
        if abs(abs(math.log(ratio)) - math.log(_THOUSAND)) < math.log(_BEDS):
            yield id, ratio


def _words(ratio: float) -> str:
    return f"{ratio:,.0f} times" if ratio >= 1 else f"{ratio:.1g} of"
