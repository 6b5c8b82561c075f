"""Tumbles that are not what the format asks for: the camera's zero, gyro, wheel, gravity."""

import math
from collections.abc import Iterator, Mapping

import numpy as np

from experiments.campaign import Campaign, Recording, TumbleCampaign
from experiments.campaign.tables import TumbleTrial
from rigid.platform.rig import STANDARD_GRAVITY

from .turning import clock_oddities, sideways_oddities, turning_oddities
from .words import OFF, ZERO, Array, Odd, oddity, said, say, times, unit_words

__all__ = ["tumble_oddities"]

_LATE = 0.03  # seconds by which the wheel may begin to change late before t = 0 is doubted
_SIGMAS = 4.0
_LEAST = 0.2
"""Share of the weight within which counterweight and gravity may differ: both are rounded, and gravity_sim rules."""


def tumble_oddities(campaign: Campaign, tables: TumbleCampaign, trial: TumbleTrial) -> Iterator[Odd]:
    pose, imu, wheel = (campaign.recording(trial.id, sensor) for sensor in ("pose", "imu", "wheel"))
    for name, recording in (("pose", pose), ("imu", imu), ("wheel", wheel)):
        if recording is not None and len(recording) and not recording.time[0] < 1.0 <= 1.0 + recording.time[-1]:
            yield oddity(name, "other_zero_of_time", name=name, first=recording.time[0], last=recording.time[-1])
            return
    yield from _begins_late(tables, trial, {"pose": pose, "imu": imu, "wheel": wheel})
    yield from _gravity(tables, trial)
    turning: list[Odd] = []
    if pose is not None and imu is not None:
        clocks, told = clock_oddities(tables, pose, imu)
        yield from clocks
        turning = [] if told else list(turning_oddities(pose, imu))
    yield from turning
    if pose is not None:
        yield from _start(tables, trial, pose, angle=not turning)
        if not any("looks like" in odd.what for odd in turning):
            yield from sideways_oddities(tables, trial, pose, imu if not turning else None)
    if imu is not None:
        yield from _at_rest(tables, trial, imu)
    if wheel is not None:
        yield from _wheel(tables, trial, wheel)


def _gravity(tables: TumbleCampaign, trial: TumbleTrial) -> Iterator[Odd]:
    """Is (m + m_b) g_sim what (m - m_b) g leaves on the surface, within what is stated and rounding?

    The free-fall acceleration of the pair (`rigid.platform.rig`), which is what a campaign's gravity_sim means,
    whichever reading of a stated gravity made it.
    """
    if tables.rig is None:
        return
    mass, other, local = tables.platform.mass, tables.counterweight_of(trial), tables.rig.gravity
    hung, weight = (mass - other) * local, tables.weight_of(trial)
    doubt = math.hypot(tables.uncertainty.mass * mass * local, tables.uncertainty.gravity_sim * weight)
    if abs(hung - weight) <= max(_SIGMAS * doubt, _LEAST * weight):
        return
    gives = hung / (mass + other)
    words = ""
    if abs(trial.gravity_sim * STANDARD_GRAVITY / gives - 1) < _LEAST:
        words = f"it looks like units of g: {trial.gravity_sim * STANDARD_GRAVITY:.4g} m/s2 would fit"
    elif abs(trial.gravity_sim * mass / hung - 1) < _LEAST:
        words = say("weight_reading")
    yield oddity("gravity", "counterweight", other=other, hung=hung, gives=gives, trial=trial, weight=weight,
                 words=words or "one of the two is another")  # fmt: skip


def _begins_late(
    tables: TumbleCampaign, trial: TumbleTrial, recordings: Mapping[str, Recording | None]
) -> Iterator[Odd]:
    """No sensor has a row near t = 0, when the torque starts: was it not recorded, or does the clock begin late?"""
    there = {name: own for name, own in recordings.items() if own is not None and len(own)}
    if not there:
        return
    first = {name: float(own.time[0]) for name, own in there.items()}
    steps = {name: float(np.median(np.diff(own.time))) if len(own) > 1 else 0.0 for name, own in there.items()}
    name = min(first, key=lambda sensor: first[sensor])
    if first[name] <= max(_LATE, 5 * steps[name]):
        return
    words = ""
    wheel, sensor = there.get("wheel"), tables.sensors.wheel
    if wheel is not None and sensor is not None:
        slope = trial.torque / tables.wheel.inertia * (1 if trial.actuator == "motor" else -1)
        turns = wheel["omega_rad_s"] > 0.05 * trial.wheel_speed_0  # a brake has not stopped it yet
        rows = np.isfinite(wheel["omega_rad_s"]) & turns & (wheel.time < first["wheel"] + 0.2)
        if rows.sum() >= 6 and slope != 0 and wheel.time[rows][-1] < trial.torque_until:
            gained = wheel["omega_rad_s"][rows] - trial.wheel_speed_0
            began = float(np.median(wheel.time[rows] - gained / slope))
            doubt = 3 * sensor.std[0] / abs(slope) + 0.1 * first["wheel"]
            words = (
                f"; by the wheel's speed the torque set in at {began:.2g} s of this clock"
                if abs(began) > max(doubt, _LATE)
                else "; the wheel's speed fits the clock: the beginning was not recorded"
            )
    yield oddity("clock", "begins_late", first=first[name], words=words)


def _start(tables: TumbleCampaign, trial: TumbleTrial, pose: Recording, *, angle: bool) -> Iterator[Odd]:
    """x = 0, theta = 0 (unless the angle is known to be odd) and the height of a platform that stands on two rows.

    They stand W / 2K deep (docs/planar.md) by the K that is stated; a surface that the spring-damper does not describe
    may let them stand anywhere down to twice that.
    """
    sensor = tables.sensors.pose
    assert sensor is not None
    sunk = tables.weight_of(trial) / (2 * tables.surface.stiffness)
    height = tables.platform.spike_length * math.cos(math.pi / tables.platform.rows) - sunk
    if height <= 0:
        yield oddity("y", "stands_deep", tables=tables, sunk=sunk)
        return
    expected = {"y_m": (height, "m", 1), "x_m": (0.0, "m", 0), "theta_rad": (0.0, "rad", 2)}
    for column, (value, unit, place) in expected.items():
        std = sensor.std[place]
        early, channel = _early(pose, column), column.split("_")[0]
        if len(early) < 2:
            continue
        there = float(np.median(early))
        if value and abs(there / value * 1e3 - 1) < 0.15:
            length = tables.platform.spike_length
            yield oddity(
                channel, "length_in_mm", column=column, there=there, length=length, value=value, metres=1e-3 * length
            )
            return
        words = unit_words(there / value) if value else None
        if words is not None:
            yield said(channel, f"{column} is {there:.4g} at the start where {value:.4g} was expected; {words}")
            return
        if column == "theta_rad" and not angle:
            continue
        of_the_surface = sunk if column == "y_m" else 0.0
        if abs(there - value) > (ZERO + OFF / math.sqrt(len(early))) * std + of_the_surface:
            within = f" within {of_the_surface:.2g}" if of_the_surface > std else ""
            yield oddity(channel, "camera_zero", column=column, there=there, unit=unit, value=value, within=within,
                         ratio=times(abs(there - value) / std))  # fmt: skip


def _at_rest(tables: TumbleCampaign, trial: TumbleTrial, imu: Recording) -> Iterator[Odd]:
    """Specific force before the torque starts: 0 along body x, the local gravity along body y."""
    sensor = tables.sensors.imu
    assert sensor is not None
    gravity = tables.local_gravity_of(trial)
    up = _early(imu, "ay_m_s2")
    if len(up) < 2 or gravity < 20 * sensor.std[2]:
        return
    there = float(np.median(up))
    words = unit_words(there / gravity)
    if words is None and abs(there - gravity) > 0.2 * gravity:
        words = "which axis is up, and is gravity in it?"
    if words is not None:
        yield said(
            "ay",
            f"ay_m_s2 is {there:.4g} at rest where the local gravity, {gravity:.4g} m/s2, was expected; ",
            words,
        )


def _wheel(tables: TumbleCampaign, trial: TumbleTrial, wheel: Recording) -> Iterator[Odd]:
    """Its speed at the start, and how fast it changes at first: torque / wheel inertia."""
    sensor = tables.sensors.wheel
    assert sensor is not None
    speed = wheel["omega_rad_s"]
    expected = trial.torque / tables.wheel.inertia * (1 if trial.actuator == "motor" else -1)
    until = min(trial.torque_until, 0.3, 0.5 * trial.wheel_speed_0 / abs(expected) if expected < 0 else math.inf)
    early = _early(wheel, "omega_rad_s") if (wheel.time < 0).any() else speed[:0]
    if len(early) >= 2:
        there = float(np.median(early))
        words = unit_words(there / trial.wheel_speed_0) if trial.wheel_speed_0 > 20 * sensor.std[0] else None
        if words is not None or abs(there - trial.wheel_speed_0) > max(10 * sensor.std[0], 0.05 * trial.wheel_speed_0):
            yield said(
                "wheel",
                f"the wheel turns at {there:.4g} rad/s at the start where wheel_speed_0 = {trial.wheel_speed_0:g}"
                if words is None
                else f"; {words}",
            )
            return
    rows = (wheel.time >= 0) & (wheel.time <= until) & np.isfinite(speed)
    if rows.sum() < 6 or abs(expected) * np.ptp(wheel.time[rows]) < 20 * sensor.std[0]:
        return
    slope = float(np.polyfit(wheel.time[rows], speed[rows], 1)[0])
    words = unit_words(slope / expected)
    if words is None and not 0.6 < slope / expected < 1.6:
        late = _onset(wheel.time, speed, trial.wheel_speed_0, expected, sensor.std[0])
        if late is not None:
            yield said("wheel", f"the wheel's speed begins to change at {late:.3g} s; t = 0 is when the torque starts")
            return
        words = "the torque or the wheel's inertia is another"
        if abs(slope / expected * 1e3 - 1) < 0.15:
            words = f"torque = {trial.torque:g} looks like mN m: {1e-3 * trial.torque:g} N m would fit"
    if words is not None:
        yield oddity("wheel", "wheel_changes", slope=slope, expected=expected, words=words)


def _onset(time: Array, speed: Array, start: float, slope: float, std: float) -> float | None:
    """When the wheel begins to change as it should have from t = 0 [s]; None where it never does."""
    known = np.isfinite(speed)
    time, change = time[known], (speed[known] - start) * math.copysign(1.0, slope)
    moved = np.flatnonzero(change > max(20 * std, 0.02 * abs(slope)))
    if not len(moved):
        return None
    rows = (time >= time[moved[0]]) & (time <= time[moved[0]] + 0.2)
    if rows.sum() < 6:
        return None
    found, zero = np.polyfit(time[rows], change[rows], 1)
    onset = -zero / found if found > 0 else 0.0
    return float(onset) if 0.6 < found / abs(slope) < 1.6 and onset > _LATE else None


def _early(recording: Recording, column: str) -> Array:
    """Readings before the torque starts; where there are none, those of the first 20 ms."""
    values, time = recording[column], recording.time
    known = np.isfinite(values)
    rows = known & (time < 0) if (known & (time < 0)).sum() >= 2 else known & (time <= 0.02)
    return np.asarray(values[rows])
