"""Tumbles that are not what the format asks for: the camera's zero, gyro, wheel, gravity, scales, signs and clocks.

How late one clock is against another shows in the camera's angle against the integral of the gyro's rate:
theta(t) = c + b t + G(t - lag), G being the integral of the rate: c is the unknown start, b the gyro's zero. Nothing is
known of a lag where the rate stays the same. Where it changes, at a touch or while the torque acts, the lag shows.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.integrate import cumulative_trapezoid
from scipy.ndimage import median_filter

from experiments.campaign import Campaign, Recording, TumbleCampaign
from experiments.campaign.tables import TumbleTrial
from rigid.platform.rig import STANDARD_GRAVITY
from rigid.terms import EFFECTS

from .words import OFF, ZERO, Array, Odd, oddity, say, times, unit_words

__all__ = ["Lag", "find_lag", "pieces", "tumble_oddities"]

_OF_THE_TORQUE = tuple(id for id, effect in EFFECTS.items() if effect.on_torque_alone)
_MILLI = (200.0, 5000.0)  # times as long as another's of the same trial a recording lasts whose times are in ms
_LATE = 0.03  # seconds of a lag between clocks or of a late beginning that are reported; `diagnose` finds smaller lags
_SIGMAS = 4.0
_LEAST = 0.2  # share of the weight within which counterweight and gravity may differ: both are rounded
_SCALE = 0.1  # relative difference of gyro and camera that neither noise nor a clock makes
_TURNS = {
    -1.0: "one of the two has its sign reversed: clockwise is positive",
    180 / math.pi: "gyro_rad_s looks like degrees a second: gyro_deg_s would say so",
    math.pi / 180: "theta_rad looks like degrees: theta_deg would say so",
    30 / math.pi: "gyro_rad_s looks like revolutions a minute: gyro_rpm would say so",
    1e3: "the times look like ms: t_ms would say so (or gyro_rad_s is in mrad/s)",
}
_NO_TURN = "one of the two has another scale, or is not about the axis of rotation"
_APART = 0.02  # seconds by which the lag of a trial's second half must be another
_ONE_MOTION = 1.5  # misfit over the noise's, up to which each half is one motion: a marker that jumps is no clock
_FIRST = 0.3  # radians of the first turn, in which a platform still pivots about its first row of spikes
_ROWS = 9  # rows whose median is taken
_SURE_OF_AXES = 0.9  # correlation from which on one column follows another

_REACH, _STEP = 0.6, 0.005  # range of lags to either side, and their first grid [s]
_FEW = 16  # rows of either sensor below which no lag is sought
_SURE = 50.0  # chi-square by which a lag must be better than the one that was expected
_ZERO = 3.0  # the gyro's zero in standard deviations of its noise, one sigma


def tumble_oddities(campaign: Campaign, tables: TumbleCampaign, trial: TumbleTrial) -> Iterator[Odd]:
    """What is implausible about one trial."""
    recordings = {sensor: campaign.recording(trial.id, sensor) for sensor in ("pose", "imu", "wheel")}
    there = {name: own for name, own in recordings.items() if own is not None and len(own)}
    for name, own in there.items():
        if not own.time[0] < 1.0 <= 1.0 + own.time[-1]:
            yield oddity(name, "other_zero_of_time", name=name, first=own.time[0], last=own.time[-1])
            return
    spans = {name: float(own.time[-1] - own.time[0]) for name, own in there.items()}
    for name, span in spans.items():
        others = [other for sensor, other in spans.items() if sensor != name]
        if others and _MILLI[0] * min(others) < span < _MILLI[1] * min(others):
            yield oddity(name, "times_in_ms", name=name, span=span, other=min(others))
            return
    yield from _begins_late(tables, trial, there)
    yield from _gravity(tables, trial)
    pose, imu, wheel = recordings.values()
    turning: list[Odd] = []
    if pose is not None and imu is not None:
        clocks, one_motion = _clocks(tables, pose, imu)
        yield from clocks
        turning = [] if one_motion else list(_turning(pose, imu))
    yield from turning
    if pose is not None:
        yield from _start(tables, trial, pose, angle=not turning)
        if not any("looks like" in odd.what for odd in turning):
            yield from _sideways(tables, pose, imu if not turning else None)
    if imu is not None:
        yield from _at_rest(tables, trial, imu)
    if wheel is not None:
        yield from _wheel(tables, trial, wheel)


def _gravity(tables: TumbleCampaign, trial: TumbleTrial) -> Iterator[Odd]:
    """Is (m + m_b) g_sim what (m - m_b) g leaves on the surface, within what is stated and rounding? gravity_sim is the
    free-fall acceleration of the pair (`rigid.platform.rig`), whichever reading of a stated gravity made it."""
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


def _begins_late(tables: TumbleCampaign, trial: TumbleTrial, there: Mapping[str, Recording]) -> Iterator[Odd]:
    """No sensor has a row near t = 0, when the torque starts: was it not recorded, or does the clock begin late?"""
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
    """x = 0, theta = 0 (unless the angle is known to be odd) and the height of a platform on two rows of spikes: by the
    stated K W / 2K deep (docs/planar.md); on a surface that is no spring-damper, anywhere down to twice that."""
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
            yield oddity(channel, "length_in_mm", column=column, there=there, length=length, value=value,
                         metres=1e-3 * length)  # fmt: skip
            return
        words = unit_words(there / value) if value else None
        if words is not None:
            yield Odd(channel, f"{column} is {there:.4g} at the start where {value:.4g} was expected; {words}")
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
    words = unit_words(there / gravity, is_acceleration=True)
    if words is None and abs(there - gravity) > 0.2 * gravity:
        words = "which axis is up, and is gravity in it?"
    if words is not None:
        yield Odd("ay", f"ay_m_s2 is {there:.4g} at rest where the local gravity, {gravity:.4g} m/s2, was expected; "
                  + words)  # fmt: skip


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
            expected_speed = f"wheel_speed_0 = {trial.wheel_speed_0:g}"
            turns = f"the wheel turns at {there:.4g} rad/s at the start where {expected_speed}"
            yield Odd("wheel", turns if words is None else f"{turns}; {words}")
            return
    rows = (wheel.time >= 0) & (wheel.time <= until) & np.isfinite(speed)
    if rows.sum() < 6 or abs(expected) * np.ptp(wheel.time[rows]) < 20 * sensor.std[0]:
        return
    slope = float(np.polyfit(wheel.time[rows], speed[rows], 1)[0])
    words = unit_words(slope / expected)
    if words is None and 0.6 < slope / expected < 1.6:
        return
    if abs(slope / expected * 1e3 - 1) < 0.15:
        words = f"torque = {trial.torque:g} looks like mN m: {1e-3 * trial.torque:g} N m would fit"
        yield oddity("wheel", "wheel_changes", slope=slope, expected=expected, words=words)
        return
    late = None
    if words is None:
        late = _onset(wheel.time, speed, trial.wheel_speed_0, expected, sensor.std[0])
        words = "the torque or the wheel's inertia is another"
    by_torque = 0 < slope / expected < 1  # an effect of the torque is a factor from 0 to 1 on it
    if late is not None:
        words = "t = 0 is when the torque starts"
    if by_torque:
        words = say("fault_or_effect", words=words, effects=", ".join(_OF_THE_TORQUE))
    odd = (
        oddity("wheel", "wheel_changes", slope=slope, expected=expected, words=words) if late is None
        else Odd("wheel", f"the wheel's speed begins to change at {late:.3g} s; {words}")
    )  # fmt: skip
    yield odd._replace(maybe_effect=by_torque)


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
    before = known & (time < 0)
    return np.asarray(values[before if before.sum() >= 2 else known & (time <= 0.02)])


def _clocks(tables: TumbleCampaign, pose: Recording, imu: Recording) -> tuple[list[Odd], bool]:
    """What the clocks of camera and IMU are off by, and whether the two are one motion at some lag."""
    seen, felt = np.isfinite(pose["theta_rad"]), np.isfinite(imu["gyro_rad_s"])
    camera, gyro = tables.sensors.pose, tables.sensors.imu
    assert camera is not None and gyro is not None
    if camera.std[2] == 0 or gyro.std[0] == 0:
        return [], False

    def lag(part: slice, near: float = 0.0) -> Lag | None:
        return find_lag(
            pose.time[seen], pose["theta_rad"][seen], imu.time[felt][part], imu["gyro_rad_s"][felt][part],
            std=(camera.std[2], gyro.std[0]), near=near,
        )  # fmt: skip

    parts = pieces(imu.time[felt])
    if len(parts) > 1:
        start = lag(slice(*parts[0]))
        first_lag = start.value if start is not None and start.is_another else 0.0
        others = [lag(slice(*part), first_lag) for part in parts[1:]]
        if any(o is not None and o.is_another and abs(o.value - first_lag) > _APART for o in others):
            return [], True  # said, and set aside, where the rows are looked at
    whole = lag(slice(None))
    if whole is not None and whole.is_right:
        if not whole.is_another or abs(whole.value) < _LATE:
            return [], True
        first, second = ("camera's angle", "gyro") if whole.value > 0 else ("gyro", "camera's angle")
        gap = f", or jumped in the gap after {imu.time[felt][parts[0][1] - 1]:.3g} s" if len(parts) > 1 else ""
        return [oddity("gyro", "clock_lags", first=first, lag=abs(whole.value), second=second, gap=gap)], True
    if len(parts) > 1 or len(pieces(pose.time[seen])) > 1:
        return [], False
    middle = int(felt.sum()) // 2
    early = lag(slice(None, middle))
    if early is None or early.left > _ONE_MOTION:
        return [], False
    before = early.value if early.is_another else 0.0
    late = lag(slice(middle, None), before)
    if late is None or not late.is_another or late.left > _ONE_MOTION or abs(late.value - before) < _APART:
        return [], False
    return [oddity("gyro", "clock_jumps", before=before, later=late.value)], True


def _turning(pose: Recording, imu: Recording) -> Iterator[Odd]:
    """The gyro, integrated, against the camera's angle."""
    angle, rate = pose["theta_rad"], imu["gyro_rad_s"]
    seen, felt = np.isfinite(angle), np.isfinite(rate)
    if min(seen.sum(), felt.sum()) < 20:
        return
    time, steps = imu.time[felt], np.diff(imu.time[felt])
    if steps.max() > max(10 * np.median(steps), 0.05):
        return
    turned = cumulative_trapezoid(rate[felt], time, initial=0)
    inside = seen & (pose.time >= time[0]) & (pose.time <= time[-1])
    if inside.sum() < 20:
        return
    by_gyro, by_camera = np.interp(pose.time[inside], time, turned), angle[inside]
    if np.ptp(by_camera) == 0 or np.ptp(by_gyro) == 0 or abs(np.corrcoef(by_gyro, by_camera)[0, 1]) < 0.98:
        return
    slope = float(np.polyfit(by_camera, by_gyro, 1)[0])
    if abs(slope - 1) > _SCALE:
        words = next((words for ratio, words in _TURNS.items() if abs(slope / ratio - 1) < _SCALE), _NO_TURN)
        yield Odd("gyro", f"the gyro turns {slope:.3g} times as far as the camera's angle; {words}")


def _sideways(tables: TumbleCampaign, pose: Recording, imu: Recording | None) -> Iterator[Odd]:
    """A platform that pivots clockwise moves along +x; and in the rig gravity tilts into body x as it turns."""
    sensor = tables.sensors.pose
    assert sensor is not None
    angle, x = pose["theta_rad"], pose["x_m"]
    if np.isfinite(angle).sum() > _ROWS:  # single rows of a lost marker turn nothing
        angle = np.where(np.isfinite(angle), median_filter(angle, size=_ROWS, mode="nearest"), np.nan)
    known = np.isfinite(angle) & np.isfinite(x) & (pose.time >= 0)
    far = np.flatnonzero(known & (np.abs(angle) > _FIRST))
    known &= np.arange(len(angle)) <= (far[0] if len(far) else len(angle))
    if known.sum() < 8 or np.ptp(angle[known]) < max(0.1, 10 * sensor.std[2]):
        return
    if len(far) and angle[far[0]] < 0:
        yield oddity("theta", "anticlockwise")
        return
    moved = float(np.polyfit(angle[known], x[known], 1)[0])
    if moved < -0.3 * tables.platform.spike_length and np.corrcoef(angle[known], x[known])[0, 1] < -_SURE_OF_AXES:
        yield oddity("x", "counted_to_the_left")
        return
    if imu is None or tables.rig is None or tables.sensors.imu is None:
        return
    felt = np.isfinite(imu["ax_m_s2"]) & (imu.time >= pose.time[0]) & (imu.time <= pose.time[-1])
    seen = np.isfinite(angle)
    if felt.sum() < 20 or seen.sum() < 20:
        return
    tilt = -tables.rig.gravity * np.sin(np.interp(imu.time[felt], pose.time[seen], angle[seen]))
    ax = imu["ax_m_s2"][felt]
    if np.ptp(tilt) < max(1.0, 20 * tables.sensors.imu.std[1]) or np.ptp(ax) == 0:
        return
    if np.corrcoef(tilt, ax)[0, 1] < -_SURE_OF_AXES:
        yield oddity("ax", "ax_reversed")


@dataclass(frozen=True)
class Lag:
    """Of the angle behind the integral of the rate."""

    value: float  # [s]; positive where the angle comes late
    left: float  # mean squared misfit at this lag, over the noise's
    without: float  # the same at the lag that was expected; infinite where the two do not overlap there
    count: int  # rows of the angle that were compared

    @property
    def is_right(self) -> bool:
        """Whether the two are one motion at this lag."""
        return self.left < 4.0

    @property
    def is_another(self) -> bool:
        """Whether the lag that was expected is wrong: the misfit says so, by chi-square and plainly."""
        return self.is_right and self.without > 2 * self.left and (self.without - self.left) * self.count > _SURE


def find_lag(
    seen: Array, angle: Array, felt: Array, rate: Array, *, std: tuple[float, float], near: float = 0.0
) -> Lag | None:
    """The lag of `angle` [rad] at the times `seen` [s] behind the integral of `rate` [rad/s] at the times `felt` [s].
    `std`: noise of angle and rate. `near`: the lag that is expected [s]. None where the rate changes too little, and
    where the best lag is at the end of the range."""
    if min(len(seen), len(felt)) < _FEW or np.ptp(felt) <= 0:
        return None
    turned = cumulative_trapezoid(rate, felt, initial=0)
    noise = float(np.hypot(std[0], std[1] * np.sqrt(np.median(np.diff(felt)) * np.ptp(felt))))

    def misfit(lag: float) -> tuple[float, int]:
        inside = (seen - lag >= felt[0]) & (seen - lag <= felt[-1])
        count = int(inside.sum())
        if count < max(_FEW, 0.25 * len(seen)):
            return np.inf, count
        rest = (angle[inside] - np.interp(seen[inside] - lag, felt, turned)) / noise
        time = (seen[inside] - seen[inside].mean()) / noise
        one, two = np.append(np.full(count, 1 / noise), 0.0), np.append(time, 1 / max(_ZERO * std[1], 1e-9))
        values, columns = np.append(rest, 0.0), np.column_stack([one, two])
        left = values - columns @ np.linalg.lstsq(columns, values, rcond=None)[0]
        return float(left @ left) / count, count

    tried = near + np.arange(-_REACH, _REACH + _STEP / 2, _STEP)
    costs = np.array([misfit(lag)[0] for lag in tried])
    best = int(np.argmin(costs))
    if not np.isfinite(costs[best]) or best in (0, len(tried) - 1) or not np.isfinite(costs[best - 1 : best + 2]).all():
        return None
    fine = tried[best] + np.linspace(-_STEP, _STEP, 21)
    small = [misfit(lag) for lag in fine]
    least = min(range(len(fine)), key=lambda k: small[k][0])
    lowest, count = small[least]
    if costs[best - 1] - 2 * costs[best] + costs[best + 1] <= 0:
        return None
    return Lag(float(fine[least]), lowest, misfit(near)[0], count)


def pieces(time: Array) -> list[tuple[int, int]]:
    """Stretches [low, high) of rows between steps of the time that are four times the usual one and more."""
    if len(time) < 2:
        return [(0, len(time))]
    steps = np.diff(time)
    breaks = np.flatnonzero(steps > max(4 * float(np.median(steps)), 2e-3)) + 1
    return list(pairwise([0, *breaks.tolist(), len(time)]))
