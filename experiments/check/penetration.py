"""Pushes and drops that are not what the format asks for: signs, units, zeros, speeds, what an accelerometer reads."""

import math
from collections.abc import Iterator

import numpy as np

from experiments.campaign import PenetrationCampaign, Recording
from experiments.campaign.tables import PenetrationTrial
from rigid.platform.rig import STANDARD_GRAVITY

from .words import OFF, ZERO, Array, Odd, oddity, said, std_of, times

__all__ = ["penetration_oddities"]

_DEEP = 30.0  # diameters beyond which a depth over `_DEEP_METRES` is doubted
_DEEP_METRES = 0.3
_WIDE_METRES, _SHALLOW = 1.0, 0.02
"""A diameter above this is doubted where the spike goes in by less than this share of it."""
_FEW_ROWS = 5  # rows by which a drop may begin late
_OFF_SCALE = 30.0
"""Ratio of a measured force and that of the spring with the stated stiffness which no doubt of it explains."""


def penetration_oddities(tables: PenetrationCampaign, trial: PenetrationTrial, data: Recording) -> Iterator[Odd]:
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
    known = tables.uncertainty.stiffness if tables.uncertainty is not None else 0.0
    if known is not None and known >= 1:
        return  # a stiffness that nobody knows
    last = int(np.nanargmax(depth))
    near = np.abs(np.arange(len(depth)) - last) <= max(2, len(depth) // 100)
    spring = tables.surface.stiffness * float(depth[last])
    if trial.mode == "driven":
        push, what, key = data["force_N"], "force_N", "[surface] stiffness"
    else:
        mass = tables.spike.mass or 0.0
        push, what, key = mass * (trial.gravity - data["accel_m_s2"]), "mass (g - accel)", "[spike] mass or stiffness"
    also = ", or the force in mN" if trial.mode == "driven" else ""
    met = float(np.nanmedian(np.where(near, push, np.nan))) if np.isfinite(push[near]).any() else 0.0
    if met > 0 and not 1 / _OFF_SCALE < met / spring < _OFF_SCALE:
        yield oddity("force" if trial.mode == "driven" else "accel", "off_scale", what=what, met=met, tables=tables,
                     depth_mm=1e3 * depth[last], spring=spring, key=key, also=also)  # fmt: skip


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
                yield said("depth", f"speed = {trial.speed:g} m/s, but the depth goes in at {speed:.3g} m/s")


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
            yield said("depth", f"speed = {trial.speed:g} m/s at the surface, but the depth goes in at {speed:.3g} m/s")


def _second_derivative(trial: PenetrationTrial, time: Array, depth: Array, accel: Array, std: float) -> Iterator[Odd]:
    """Is accel_m_s2 the second derivative of the depth, or what an accelerometer reads?"""
    step = np.diff(time)
    if not len(step) or step.max() > 10 * np.median(step):
        return  # a gap: nothing can be integrated across it

    def twice(values: Array) -> Array:
        once = np.concatenate([[0.0], np.cumsum(0.5 * (values[1:] + values[:-1]) * step)])
        return np.concatenate([[0.0], np.cumsum(0.5 * (once[1:] + once[:-1]) * step)])

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
    }  # fmt: skip
    words, best = min(((words, left(model)) for words, model in others.items()), key=lambda pair: pair[1])
    if as_asked > ZERO * std and best < 0.2 * as_asked:
        yield said("accel", f"accel_m_s2 is not the second derivative of the depth; {words}")
