"""Which way a tumble turns and when, by camera, gyro and accelerometer: scales, signs and clocks that disagree."""

import math
from collections.abc import Iterator

import numpy as np
from scipy.ndimage import median_filter

from experiments.campaign import Recording, TumbleCampaign
from experiments.campaign.tables import TumbleTrial

from .lags import Lag, find_lag, pieces
from .words import Odd, oddity, said

__all__ = ["clock_oddities", "sideways_oddities", "turning_oddities"]

_SCALE = 0.1  # relative difference of gyro and camera that neither noise nor a clock makes
_TURNS = {
    -1.0: "one of the two has its sign reversed: clockwise is positive",
    180 / math.pi: "gyro_rad_s looks like degrees a second: gyro_deg_s would say so",
    math.pi / 180: "theta_rad looks like degrees: theta_deg would say so",
    30 / math.pi: "gyro_rad_s looks like revolutions a minute: gyro_rpm would say so",
}
_NO_TURN = "one of the two has another scale, or is not about the axis of rotation"
_LATE = 0.03  # seconds of a constant lag from which on it is said; `diagnose` finds smaller ones as clock-offset
_APART = 0.02  # seconds by which the lag of a trial's second half must be another
_ONE_MOTION = 1.5  # misfit over the noise's, up to which each half is one motion: a marker that jumps is no clock
_FIRST = 0.3  # radians of the first turn, in which a platform still pivots about the row that it stands on
_ROWS = 9  # rows whose median is taken
_SURE_OF_AXES = 0.9  # correlation from which on one column follows another


def clock_oddities(tables: TumbleCampaign, pose: Recording, imu: Recording) -> tuple[list[Odd], bool]:
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


def turning_oddities(pose: Recording, imu: Recording) -> Iterator[Odd]:
    """The gyro, integrated, against the camera's angle."""
    angle, rate = pose["theta_rad"], imu["gyro_rad_s"]
    seen, felt = np.isfinite(angle), np.isfinite(rate)
    if min(seen.sum(), felt.sum()) < 20:
        return
    time, steps = imu.time[felt], np.diff(imu.time[felt])
    if steps.max() > max(10 * np.median(steps), 0.05):
        return
    turned = np.concatenate([[0.0], np.cumsum(0.5 * (rate[felt][1:] + rate[felt][:-1]) * steps)])
    inside = seen & (pose.time >= time[0]) & (pose.time <= time[-1])
    if inside.sum() < 20:
        return
    by_gyro, by_camera = np.interp(pose.time[inside], time, turned), angle[inside]
    if np.ptp(by_camera) == 0 or np.ptp(by_gyro) == 0 or abs(np.corrcoef(by_gyro, by_camera)[0, 1]) < 0.98:
        return
    slope = float(np.polyfit(by_camera, by_gyro, 1)[0])
    if abs(slope - 1) > _SCALE:
        words = next((words for ratio, words in _TURNS.items() if abs(slope / ratio - 1) < _SCALE), _NO_TURN)
        yield said("gyro", f"the gyro turns {slope:.3g} times as far as the camera's angle; {words}")


def sideways_oddities(
    tables: TumbleCampaign, trial: TumbleTrial, pose: Recording, imu: Recording | None
) -> Iterator[Odd]:
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
