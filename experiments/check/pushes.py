"""Pushes and drops that are not what the format asks for: signs, units, zeros, speeds, what an accelerometer reads."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.integrate import cumulative_trapezoid

from experiments.campaign import Campaign, PenetrationCampaign, Recording
from experiments.campaign.tables import PenetrationTrial
from rigid.platform.rig import STANDARD_GRAVITY

from .words import OFF, ZERO, Array, Odd, oddity, say, std_of, times

__all__ = ["depth_zeros", "down", "force_units", "penetration_oddities", "trials_of"]

_DEEP, _DEEP_METRES = 30.0, 0.3  # diameters, and metres, beyond both of which a depth is doubted
_WIDE_METRES, _SHALLOW = 1.0, 0.02  # a diameter above this is doubted where the spike goes less than this share deep
_FEW_ROWS = 5  # rows by which a drop may begin late
_OFF_SCALE = 30.0  # ratio of a measured force and that of the stated spring which no uncertainty explains

_ROWS = 8  # rows that are averaged to see whether there is a force
_FORCE_SURE = 4.0  # standard errors from which on there is
_AFTER = 3  # such averages in a row with which it has set in
_LEAST_ZERO, _SHARE_OF_DEPTH = 5e-4, 0.05  # m, and share of the deepest point, by which the zero must be off
_BEGINS = 0.2  # share of what a force comes to that it may be where it begins
_ALIKE_ZEROS = 0.5  # share of it by which pushes may differ and yet be off alike

_SIGMAS = 4.0  # standard deviations of the stated numbers, in logarithms, beyond which a ratio is not their error
_LEAST_RATIO = 3.0  # ratio from which on a unit is suspected
_NEAR, _NEAR_SIGMAS = 0.25, 2.5
"""How near in logarithms a unit must be: what a missing effect may add, and what the stated numbers leave open."""
_ALIKE_RATIOS = 0.3  # standard deviation of the pushes' ratios, in logarithms, up to which they are one factor
_ONE_SHAPE = 0.3  # logarithm by which the ratio may differ between shallow and deep rows
_BY_DROPS = 0.15  # relative uncertainty of a stiffness from drops
_POUND = 4.4482216152605  # newtons of a pound of force
_FORCES = {
    "kilograms of force, kgf (times 9.80665 it is newtons)": (1 / STANDARD_GRAVITY, True),
    "grams of force, gf (times 0.00980665 it is newtons)": (1e3 / STANDARD_GRAVITY, True),
    "pounds of force, lbf (times 4.44822 it is newtons)": (1 / _POUND, False),
    "millinewtons (force_mN would say so)": (1e3, True),
    "kilonewtons (times 1,000 it is newtons)": (1e-3, True),
    "newtons that were multiplied by 9.81 once more": (STANDARD_GRAVITY, False),
    "newtons that were multiplied by 4.448 once more": (_POUND, False),
}
"""Unit -> a reading in it over the true force; whether no effect and no damper makes such a factor, so that a force of
any shape may have it."""


def trials_of(campaign: Campaign, mode: str) -> Iterator[tuple[PenetrationCampaign, PenetrationTrial, Recording]]:
    """The recorded trials of this mode, with their tables; none of a campaign of tumbles."""
    if isinstance(campaign.tables, PenetrationCampaign):
        for trial in campaign.tables.trial:
            data = campaign.recording(trial.id, "data")
            if trial.mode == mode and data is not None:
                yield campaign.tables, trial, data


def down(data: Recording, *, fewest: int = 1) -> tuple[Array, Array, Array] | None:
    """Time, depth and force of a push down to its deepest point, without gaps; None of fewer rows."""
    depth, force = data["depth_m"], data["force_N"]
    known = np.isfinite(depth) & np.isfinite(force)
    if known.sum() < fewest:
        return None
    rows = slice(int(np.argmax(depth[known])) + 1)
    return data.time[known][rows], depth[known][rows], force[known][rows]


def penetration_oddities(tables: PenetrationCampaign, trial: PenetrationTrial, data: Recording) -> Iterator[Odd]:
    """What is implausible about one trial."""
    time, depth = data.time, data["depth_m"]
    known = np.isfinite(depth)
    if known.sum() < 12:
        return
    deepest, std = float(depth[known].max()), std_of(tables.sensors.depth)
    highest = -float(depth[known].min())
    if deepest <= 3 * std or (trial.mode == "driven" and highest > 3 * deepest + 3 * std):
        yield oddity("depth", "hardly_in_the_bed", from_mm=-1e3 * highest, deepest_mm=1e3 * deepest)
        return
    diameter = tables.diameter_of(trial)
    if deepest > max(_DEEP * diameter, _DEEP_METRES):
        yield oddity("depth", "depth_in_mm", deepest=deepest, diameters=deepest / diameter)
        return
    if diameter > _WIDE_METRES and deepest < _SHALLOW * diameter:
        yield oddity("depth", "diameter_in_mm", diameter=diameter, depths=diameter / deepest,
                     deepest_mm=1e3 * deepest, metres=1e-3 * diameter)  # fmt: skip
    yield from _off_scale(tables, trial, depth, data)
    if trial.mode == "driven":
        yield from _driven(tables, trial, time, depth, data["force_N"], std)
    else:
        yield from _drop(tables, trial, time, depth, data["accel_m_s2"], std)


def _off_scale(tables: PenetrationCampaign, trial: PenetrationTrial, depth: Array, data: Recording) -> Iterator[Odd]:
    """A force, or a mass times what it is slowed down by, that is out of all proportion to K z."""
    if tables.uncertainty.stiffness >= 1:
        return  # nobody knows the stiffness
    last = int(np.nanargmax(depth))
    near = np.abs(np.arange(len(depth)) - last) <= max(2, len(depth) // 100)
    spring = tables.surface.stiffness * float(depth[last])
    if trial.mode == "driven":
        push, what, key = data["force_N"], "force_N", "[surface] stiffness"
    else:
        mass = tables.spike.mass or 0.0
        push, what, key = mass * (trial.gravity - data["accel_m_s2"]), "mass (g - accel)", "[spike] mass or stiffness"
    met = float(np.nanmedian(np.where(near, push, np.nan))) if np.isfinite(push[near]).any() else 0.0
    if met > 0 and not 1 / _OFF_SCALE < met / spring < _OFF_SCALE:
        first = "" if trial.mode == "drop" else "is force_N in mN, or " if met > spring else "is force_N in kN, or "
        yield oddity("force" if trial.mode == "driven" else "accel", "off_scale", what=what, met=met, tables=tables,
                     depth_mm=1e3 * depth[last], spring=spring, key=key, first=first)  # fmt: skip


def _driven(
    tables: PenetrationCampaign, trial: PenetrationTrial, time: Array, depth: Array, force: Array, std: float
) -> Iterator[Odd]:
    last = int(np.nanargmax(depth))
    into = np.arange(len(depth)) <= last
    deep = into & (depth > 0.3 * depth[last]) & np.isfinite(force)
    if deep.sum() >= 8 and float(np.median(force[deep])) < -4 * std_of(tables.sensors.force):
        yield oddity("force", "force_downwards", force=np.median(force[deep]))
    above = into & (depth < -3 * std - 0.02 * depth[last]) & np.isfinite(force)
    if above.sum() >= 3:
        zero = float(np.median(force[above]))
        error = 1.25 * std_of(tables.sensors.force) / math.sqrt(above.sum())
        if abs(zero) > max(OFF * error, std_of(tables.sensors.force)) and not _rises(force[above]):
            yield oddity("force", "force_zero", zero=zero, ratio=times(abs(zero) / std_of(tables.sensors.force)))
    if trial.speed:
        # Until it is first so deep: rows of a hold that the noise lifts are none of the way in.
        moving = into & (depth > 0.05 * depth[last]) & (np.fmax.accumulate(depth) < 0.95 * depth[last])
        if moving.sum() >= 8 and np.ptp(time[moving]) > 0:
            speed = float(np.polyfit(time[moving], depth[moving], 1)[0])
            if not 0.5 < speed / trial.speed < 2.0:
                unit = _time_unit(speed / trial.speed)
                yield Odd("depth", f"speed = {trial.speed:g} m/s, but the depth goes in at {speed:.3g} m/s{unit}")


def _time_unit(ratio: float) -> str:
    """A question about the unit of time, where a speed is that many times what it should be; else nothing."""
    known = {1e-3: "; is t_s in ms? Then name the column t_ms", 60.0: "; is t_s in minutes?"}
    return next((words for unit, words in known.items() if abs(ratio / unit - 1) < 0.2), "")


def _rises(force: Array) -> bool:
    """Whether a force above the surface grows on the way down, from next to nothing: the depth's zero is off then."""
    third = max(len(force) // 3, 1)
    first, last = abs(float(force[:third].mean())), abs(float(force[-third:].mean()))
    return len(force) >= 6 and last > 2 * first


def _drop(
    tables: PenetrationCampaign, trial: PenetrationTrial, time: Array, depth: Array, accel: Array, std: float
) -> Iterator[Odd]:
    assert trial.speed is not None
    both = np.isfinite(depth) & np.isfinite(accel) & (time >= 0)
    if both.sum() >= 12:
        yield from _second_derivative(trial, time[both], depth[both], accel[both], std)
    first = float(time[np.isfinite(depth)][0])
    if first > max(_FEW_ROWS * float(np.median(np.diff(time))), 0.2 * float(np.nanmax(depth)) / trial.speed):
        there = float(depth[np.isfinite(depth)][0])
        yield oddity("depth", "drop_begins_late", first_ms=1e3 * first, there_mm=1e3 * there)
        return
    known = np.isfinite(depth) & (np.abs(time) < 0.2 * max(float(np.nanmax(depth)), 1e-9) / trial.speed)
    if known.sum() >= 6 and np.ptp(time[known]) > 0:
        (_, speed, start), covariance = np.polyfit(time[known], depth[known], 2, cov="unscaled")
        errors = max(std, 1e-12) * np.sqrt(np.diag(covariance))
        if abs(start) > max(OFF * errors[2], ZERO * std):
            yield oddity("depth", "touches_later", start_mm=1e3 * start)
        elif abs(speed - trial.speed) > max(OFF * errors[1], 0.2 * trial.speed):
            unit = _time_unit(speed / trial.speed)
            what = f"speed = {trial.speed:g} m/s at the surface, but the depth goes in at {speed:.3g} m/s{unit}"
            yield Odd("depth", what)


def _second_derivative(trial: PenetrationTrial, time: Array, depth: Array, accel: Array, std: float) -> Iterator[Odd]:
    """Is accel_m_s2 the second derivative of the depth, or what an accelerometer reads?"""
    step = np.diff(time)
    if not len(step) or step.max() > 10 * np.median(step):
        return  # a gap: nothing can be integrated across it

    def twice(values: Array) -> Array:
        return cumulative_trapezoid(cumulative_trapezoid(values, time, initial=0), time, initial=0)

    straight = np.column_stack([np.ones(len(time)), time])
    of_accel, of_gravity = twice(accel), 0.5 * trial.gravity * (time - time[0]) ** 2

    def left(model: Array) -> float:
        rest = depth - model
        rest = rest - straight @ np.linalg.lstsq(straight, rest, rcond=None)[0]
        return float(np.sqrt(np.mean(rest**2)))

    as_asked = left(of_accel)
    others = {
        "the sign is reversed: downwards is positive": -of_accel,
        "it is what an accelerometer reads, 0 in free fall: gravity is to be added": of_accel + of_gravity,
        "it is what an accelerometer reads, upwards positive: gravity less the reading is d2(depth)/dt2":
            of_gravity - of_accel,
        "it looks like units of g: accel_g would say so": STANDARD_GRAVITY * of_accel,
        "it looks like mm/s2 (divided by 1,000 it is m/s2)": 1e-3 * of_accel,
        "the times look like ms: t_ms would say so": 1e-6 * of_accel,
    }  # fmt: skip
    words, best = min(((words, left(model)) for words, model in others.items()), key=lambda pair: pair[1])
    if as_asked > ZERO * std and best < 0.2 * as_asked:
        yield Odd("accel", f"accel_m_s2 is not the second derivative of the depth; {words}")


def depth_zeros(campaign: Campaign) -> Iterator[tuple[str, str]]:
    """Is depth 0 where the bed begins? (trial, sentence) where the force sets in deeper or less deep than 0; trial ""
    for what all pushes share."""
    found: dict[str, float] = {}
    pushes = list(trials_of(campaign, "driven"))
    for tables, trial, data in pushes:
        begun = _force_onset(data, std_of(tables.sensors.force))
        if begun is None:
            continue
        onset, doubt = begun
        deepest, std = float(np.nanmax(data["depth_m"])), std_of(tables.sensors.depth)
        if deepest > 0 and abs(onset) > max(_LEAST_ZERO, _SHARE_OF_DEPTH * deepest, 2 * doubt, 5 * std):
            found[trial.id] = onset
    if not found:
        return
    onsets = np.array(list(found.values()))
    middle = float(np.median(onsets))
    if len(found) == len(pushes) > 1 and bool(np.ptp(onsets) < _ALIKE_ZEROS * abs(middle)):
        low, high = (1e3 * float(edge) for edge in (onsets.min(), onsets.max()))
        yield (
            "",
            f"in all {len(found)} pushes the force sets in at a depth of {low:.3g} to {high:.3g} mm" + _meaning(middle),
        )
        return
    for id, onset in found.items():
        yield id, f"the force sets in at a depth of {1e3 * onset:.3g} mm{_meaning(onset)}"


def _meaning(onset: float) -> str:
    other = "is the top of the bed loose, or" if onset > 0 else "do grains stick out of the bed, or"
    return say("depth_zero", other=other)


def _force_onset(data: Recording, std: float) -> tuple[float, float] | None:
    """The depth at which a push begins to feel a force, and the uncertainty of that [m]; None where it is unknown:
    there is no force, or a sizeable one from the first row on. `std`: the force's noise [N]. By averages of `_ROWS`
    rows; the force's own zero is that of the first rows, where they are alike."""
    pushed = down(data, fewest=6 * _ROWS)
    if pushed is None:
        return None
    _, z, f = pushed
    fresh = np.concatenate([[True], np.diff(f) != 0])  # a force that is held is no new reading
    z, f = z[fresh], f[fresh]
    count = len(f) // _ROWS
    if count < 6:
        return None
    means = f[: count * _ROWS].reshape(count, _ROWS).mean(axis=1)
    starts, ends = z[: count * _ROWS : _ROWS], z[_ROWS - 1 : count * _ROWS : _ROWS]
    error = max(std, 1e-12) / math.sqrt(_ROWS)
    flat = abs(means[1] - means[0]) < _FORCE_SURE * math.sqrt(2) * error
    zero = 0.5 * float(means[0] + means[1]) if flat else 0.0
    pushes = means - zero > _FORCE_SURE * error
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
    return bool(comes_to > 2 * _FORCE_SURE * std and begins < _BEGINS * comes_to)


def _nothing_before(depth: Array, force: Array, onset: float, std: float) -> bool:
    """Whether the rows from depth 0 to the onset [m] show that there is no force, not only that none is seen."""
    before, there = (depth > 0) & (depth < onset), (depth > 1.6 * onset) & (depth < 2.4 * onset)
    if before.sum() < _ROWS or not there.any():
        return False
    expected = float(force[there].mean()) * float(((depth[before] / (2 * onset)) ** 2).mean())
    error = max(std, 1e-12) / math.sqrt(before.sum())
    return expected > 2 * _FORCE_SURE * error and float(force[before].mean()) < 0.5 * expected


@dataclass(frozen=True)
class _Push:
    ratio: float  # force over that of spring and damper, in the deeper half
    bend: float  # logarithm of the same, deep over shallow; NaN where it is unknown
    doubt: float  # relative uncertainty of what spring and damper give, one sigma


def force_units(campaign: Campaign) -> Iterator[str]:
    """Is force_N in newtons? It has a sentence where the force of all pushes is off by the factor between two units.
    The force is compared with what spring and damper give as stated.

    Such a factor is the same in every push and at every depth, and far from what a stated uncertainty allows. Without a
    stiffness stated to better than its own size, that of drops is taken: m (g - accel) over the depth where they turn.
    """
    tables = campaign.tables
    if not isinstance(tables, PenetrationCampaign):
        return
    known = tables.uncertainty.stiffness
    stated = known < 1
    by_drops = {} if stated else _stiffness_of_drops(campaign)
    pushes = []
    for _, trial, data in trials_of(campaign, "driven"):
        stiffness = tables.surface.stiffness if stated else by_drops.get(tables.diameter_of(trial))
        push = _push(tables, data, stiffness, known if stated else _BY_DROPS) if stiffness else None
        pushes += [push] if push is not None else []
    if not pushes:
        return
    logs = np.log([push.ratio for push in pushes])
    middle, doubt = float(np.median(logs)), float(np.median([push.doubt for push in pushes]))
    if abs(middle) < max(_SIGMAS * doubt, math.log(_LEAST_RATIO)) or (
        len(logs) > 1 and float(np.std(logs)) > _ALIKE_RATIOS
    ):
        return
    bends = [push.bend for push in pushes if math.isfinite(push.bend)]
    straight = bool(bends) and abs(float(np.median(bends))) < _ONE_SHAPE and tables.uncertainty.damping < 1
    off = {unit: abs(middle - math.log(ratio)) for unit, (ratio, alone) in _FORCES.items() if alone or straight}
    near = [unit for unit in sorted(off, key=lambda unit: off[unit]) if off[unit] < max(_NEAR, _NEAR_SIGMAS * doubt)]
    if not near:
        return
    whose = "stiffness and damping, as stated, give" if stated else "the drops of the same diameter show for the spring"
    ratio, several = math.exp(middle), len(pushes) > 1
    size = times(ratio) if ratio > 1 else f"{ratio:.2g} of"
    words = say("force_units", size=size, whose=whose, all="all " if several else "", count=len(pushes),
                es="es" if several else "")  # fmt: skip
    yield (
        f"{words}{', or like '.join(near[:2])}"
        f"{'; or is [surface] stiffness in other units (N/mm), or another than stated?' if stated else '.'}"
        " Nothing was converted: a model that is fitted to it takes the factor for a stiffness"
    )


def _push(tables: PenetrationCampaign, data: Recording, stiffness: float, doubt: float) -> _Push | None:
    pushed = down(data, fewest=6 * _ROWS)
    if pushed is None:
        return None
    time, z, f = pushed
    deepest = float(z[-1])
    if deepest <= 0 or len(z) <= 4 * _ROWS:
        return None
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
    return _Push(met, bend, math.hypot(doubt * spring, tables.uncertainty.damping * damper) / (spring + damper))


def _stiffness_of_drops(campaign: Campaign) -> dict[float, float]:
    """K by diameter, from where drops turn: there the damper gives nothing."""
    found: dict[float, list[float]] = {}
    for tables, trial, data in trials_of(campaign, "drop"):
        depth, accel = data["depth_m"], data["accel_m_s2"]
        if not tables.spike.mass or not np.isfinite(depth).any():
            continue
        last = int(np.nanargmax(depth))
        near = slice(max(last - 2, 0), last + 3)
        push = tables.spike.mass * (trial.gravity - accel[near])
        if 2 < last < len(depth) - 3 and np.isfinite(push).any() and float(np.nanmedian(push)) > 0 and depth[last] > 0:
            found.setdefault(tables.diameter_of(trial), []).append(float(np.nanmedian(push)) / float(depth[last]))
    return {diameter: float(np.median(own)) for diameter, own in found.items()}
