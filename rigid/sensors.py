"""What the rig's sensors would have recorded of a motion: camera, IMU and wheel, with noise that a seed fixes.

A `Motion` is arrays over time, from t = 0 when the torque starts; before that the platform stands still. Conventions
are those of a measured trial:

- camera: x, y, theta of the geometric centre; x from the start, y from the undisturbed surface; its zero may be off.
- IMU at the geometric centre: gyro d theta/dt, clockwise positive, instantaneous; specific force, the acceleration of
  the centre + g_loc upwards, in body axes. It is the mean over a window centred on the row's time (the value itself
  where the window is 0). Body x in the world is (cos theta, -sin theta), body y (sin theta, cos theta).
- wheel: |omega_w|.

The mean over the window is exact through jumps of the force: with R the turn from body to world axes, the mean of R^T a
is taken by parts, [R^T v] - integral of dR^T/dt v. This needs only v, theta and omega, all continuous. So a motion
sampled at `sensor_times` needs no acceleration at all, unless the window is 0.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import SimpleNamespace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .checks import check_above_zero, check_not_negative
from .terms import EFFECTS, Term, sensor_terms

_FIELDS = {
    "clock-offset": {"offset": "clock_offset", "drift": "clock_drift"},
    "camera-scale": {"scale": "camera_scale", "bend": "camera_bend"},
}
"""Effects whose parameters a `SensorSet` has as fields."""

__all__ = ["Measured", "Motion", "SensorSet", "measure", "sensor_times"]

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Motion:
    """A planar motion: arrays of shape [sample_count], the first at t = 0.

    Raises ValueError for arrays of other shapes, times that do not rise, or a start that is not at t = 0.
    """

    time: Array  # [s]
    x: Array  # Of the geometric centre [m]
    y: Array  # [m]
    theta: Array  # Clockwise positive [rad]
    vx: Array  # [m/s]
    vy: Array  # [m/s]
    omega: Array  # d theta/dt [rad/s]
    wheel_speed: Array  # Absolute speed of the flywheel [rad/s]
    ax: Array | None = None  # Acceleration of the geometric centre [m/s2]; asked for only where the IMU has no window
    ay: Array | None = None  # [m/s2]

    def __post_init__(self) -> None:
        for name, value in list(vars(self).items()):
            if value is not None:
                array = np.asarray(value, dtype=float)
                if array.shape != (len(np.atleast_1d(self.time)),) or not np.isfinite(array).all():
                    raise ValueError(f"{name} has shape {array.shape}: it must be one finite number a time")
                object.__setattr__(self, name, array)
        if len(self.time) < 2 or self.time[0] != 0.0 or not (np.diff(self.time) > 0).all():
            raise ValueError("time must begin at 0 and rise, with two samples at least")


@dataclass(frozen=True, kw_only=True)
class SensorSet:
    """Rates, noise (standard deviations, white and Gaussian) and faults of the sensors.

    Raises ValueError, naming the key, for a rate that is not above 0, a negative noise or a scale that is not above 0.
    """

    camera_rate: float = 120.0  # [Hz]
    imu_rate: float = 100.0  # [Hz]
    wheel_rate: float = 600.0  # [Hz]
    pose_std: tuple[float, float, float] = (0.0005, 0.0005, 0.003)  # Of x, y [m] and theta [rad]
    imu_std: tuple[float, float, float] = (0.01, 0.02, 0.02)  # Of the gyro [rad/s] and both specific forces [m/s2]
    wheel_std: float = 0.5  # [rad/s]
    imu_window: float = 0.004  # Over which each specific force is averaged [s]
    camera_scale: float = 1.0  # Measured over true, of x and y [1]
    camera_bend: float = 0.0  # Added to the scale by the square of the distance from where the platform stood [1/m2]
    clock_offset: float = 0.0  # The IMU's time minus the true time at t = 0 [s]
    clock_drift: float = 0.0  # What the IMU's clock gains in a second [1]
    lead: float = 0.2  # How long before t = 0 recording starts [s]
    effects: Mapping[str, Mapping[str, float]] = field(default_factory=dict)  # Of `rigid.terms` on sensors: parameters
    camera_zero_spread: float = 3.0  # The camera's zero is drawn evenly from within this many `pose_std` [1]

    def __post_init__(self) -> None:
        rates = ("camera_rate", "imu_rate", "wheel_rate")
        check_above_zero(**{name: getattr(self, name) for name in (*rates, "camera_scale")})
        sizes = ("imu_window", "lead", "wheel_std", "camera_zero_spread")
        check_not_negative(**{name: getattr(self, name) for name in sizes})
        for name in ("pose_std", "imu_std"):
            values = getattr(self, name)
            if len(values) != 3 or not all(math.isfinite(value) and value >= 0 for value in values):
                raise ValueError(f"{name} = {values!r} must be three numbers of 0 or more")
        for id, names in _FIELDS.items():
            for parameter in self.effects.get(id, ()):
                object.__setattr__(self, names[parameter], self.effects[id][parameter])
            for number in EFFECTS[id].parameters:
                number.check(getattr(self, names[number.name]), names[number.name])

    def true_times(self, written: Array) -> Array:
        """True times [s] of times on the IMU's clock."""
        for term in sensor_terms("clock"):
            written = term.hooks["clock"](written, *self._parameters(term, "clock"))
        return written

    def seen(self, square: Array) -> Array:
        """What the camera makes of lengths [1] at these squares of the distance from the start [m2]."""
        parts = (term.hooks["lens"](square, *self._parameters(term, "lens")) for term in sensor_terms("lens"))
        return np.asarray(math.prod(parts))

    def _parameters(self, term: Term, hook: str) -> list[float]:
        own = {parameter: getattr(self, name) for parameter, name in _FIELDS.get(term.id, {}).items()}
        values = term.values(own | dict(self.effects.get(term.id, {})))
        return [values[name] for name in term.arguments(hook)]

    @property
    def _lateness(self) -> float:
        """By how much the clocks of effects beyond `clock_offset` and `clock_drift` are off at t = 0 and 1 s [s]."""
        others = [term for term in sensor_terms("clock") if term.id not in _FIELDS]
        return sum(
            abs(at - term.hooks["clock"](at, *self._parameters(term, "clock"))) for term in others for at in (0.0, 1.0)
        )


@dataclass(frozen=True)
class Measured:
    """What was recorded: name of the column -> array of shape [row_count], by sensor."""

    pose: dict[str, Array] = field(repr=False)  # t_s, x_m, y_m, theta_rad
    imu: dict[str, Array] = field(repr=False)  # t_s, gyro_rad_s, ax_m_s2, ay_m_s2
    wheel: dict[str, Array] = field(repr=False)  # t_s, omega_rad_s
    camera_zero: tuple[float, float, float] = (0.0, 0.0, 0.0)  # What was added to x, y [m] and theta [rad]


def sensor_times(sensors: SensorSet, duration: float, *, step: float = 1e-3) -> Array:
    """The times [s], shape [n], at which a motion from 0 to `duration` has to be sampled for `measure`.

    The rows of every sensor, both ends of every window of the IMU, and a grid of `step` [s] between them.
    """
    at = sensors.true_times(_imu_times(sensors, duration))
    half = 0.5 * sensors.imu_window
    grid = np.arange(0, math.floor(duration / step + 1e-9) + 1) * step
    rows = (_rows(rate, sensors.lead, duration) for rate in (sensors.camera_rate, sensors.wheel_rate))
    wanted = np.concatenate([grid, *rows, at - half, at, at + half, [0.0, duration]])
    kept = np.unique(wanted[(wanted >= 0) & (wanted <= duration)])
    # Two ways to the same instant differ by round-off: one of them is enough, and the ends stay exact.
    apart = np.append(np.diff(kept) > 1e-9, True)
    apart[0] = True
    result = kept[apart]
    result[-1] = duration
    return result


def measure(
    motion: Motion,
    sensors: SensorSet,
    *,
    gravity_local: float,
    up: tuple[float, float] = (0.0, 1.0),
    seed: int | tuple[int, ...] | None = None,
    camera_zero: tuple[float, float, float] | None = None,
) -> Measured:
    """Record `motion` with the sensors.

    Args:
        motion: From t = 0; samples at `sensor_times` make the result exact, others are interpolated linearly.
        sensors: Rates, noise and faults.
        gravity_local: g_loc [m/s2]: the local gravity in the rig, where the wires carry part of it; g_sim without one.
        up: The vertical in the surface's axes, a unit vector; not (0, 1) on a slope.
        seed: Fixes noise and camera zero; None: no noise, and a camera zero of 0.
        camera_zero: Added to x, y [m] and theta [rad]; None: drawn (with a seed) within `camera_zero_spread`.

    Raises ValueError where the window is 0 and the motion holds no accelerations.
    """
    streams = [None] * 4 if seed is None else [np.random.default_rng(s) for s in np.random.SeedSequence(seed).spawn(4)]
    duration = float(motion.time[-1])
    moving = _with_lead(motion, sensors)
    if camera_zero is None:
        zero = np.zeros(3)
        if streams[0] is not None:
            zero = streams[0].uniform(-1, 1, 3) * sensors.camera_zero_spread * np.array(sensors.pose_std)
    else:
        zero = np.asarray(camera_zero, dtype=float)

    at = _rows(sensors.camera_rate, sensors.lead, duration)
    x, y = np.interp(at, moving.time, moving.x), np.interp(at, moving.time, moving.y)
    scale = sensors.seen((x - motion.x[0]) ** 2 + (y - motion.y[0]) ** 2)
    pose = {
        "t_s": at,
        "x_m": scale * x + zero[0],
        "y_m": scale * y + zero[1],
        "theta_rad": np.interp(at, moving.time, moving.theta) + zero[2],
    }
    _add_noise(pose, sensors.pose_std, streams[1])

    written = _imu_times(sensors, duration)
    true = sensors.true_times(written)
    ax, ay = _specific_force(moving, true, sensors.imu_window, (gravity_local * up[0], gravity_local * up[1]))
    gyro = np.interp(true, moving.time, moving.omega)
    imu = {"t_s": written, "gyro_rad_s": gyro, "ax_m_s2": ax, "ay_m_s2": ay}
    _add_noise(imu, sensors.imu_std, streams[2])

    at = _rows(sensors.wheel_rate, sensors.lead, duration)
    wheel = {"t_s": at, "omega_rad_s": np.abs(np.interp(at, moving.time, moving.wheel_speed))}
    _add_noise(wheel, (sensors.wheel_std,), streams[3])
    return Measured(pose, imu, wheel, (float(zero[0]), float(zero[1]), float(zero[2])))


def _rows(rate: float, lead: float, duration: float) -> Array:
    """Times of the rows [s]: whole multiples of 1 / rate from -lead to duration."""
    first, last = math.ceil(-lead * rate - 1e-9), math.floor(duration * rate + 1e-9)
    return np.arange(first, last + 1) / rate


def _imu_times(sensors: SensorSet, duration: float) -> Array:
    """Times on the IMU's clock whose whole window, in true time, has been seen."""
    late = abs(sensors.clock_offset) + abs(sensors.clock_drift) * duration + sensors._lateness * (1.0 + duration)
    at = _rows(sensors.imu_rate, sensors.lead, duration + late)
    return at[sensors.true_times(at) + 0.5 * sensors.imu_window <= duration + 1e-9]


def _with_lead(motion: Motion, sensors: SensorSet) -> SimpleNamespace:
    """`motion` with the rest before it, from as early as the sensors record."""
    before = (
        sensors.lead / (1.0 - abs(sensors.clock_drift))
        + 2.0 * abs(sensors.clock_offset)
        + sensors.imu_window
        + sensors._lateness * (1.0 + sensors.lead)
        + 1.0 / min(sensors.camera_rate, sensors.imu_rate, sensors.wheel_rate)
    )
    begin = dict.fromkeys(("vx", "vy", "omega", "ax", "ay"), 0.0) | {"time": -before}
    whole = {
        name: np.concatenate([[begin.get(name, values[0])], values])
        for name, values in vars(motion).items()
        if values is not None
    }
    return SimpleNamespace(**vars(motion) | whole)


def _specific_force(
    moving: SimpleNamespace, at: ArrayLike, window: float, gravity: tuple[float, float]
) -> tuple[Array, Array]:
    """Specific force in body axes [m/s2], (ax, ay) of shape [row_count] each, averaged over `window` [s] about `at`."""
    at = np.asarray(at, dtype=float)
    time = moving.time
    if window == 0:
        if moving.ax is None or moving.ay is None:
            raise ValueError("imu_window = 0 asks for the motion's accelerations, ax and ay: it holds none")
        # Before t = 0 the platform is at rest: nothing is to be interpolated towards the first acceleration.
        ax = np.where(at < 0, 0.0, np.interp(at, time, moving.ax)) + gravity[0]
        ay = np.where(at < 0, 0.0, np.interp(at, time, moving.ay)) + gravity[1]
        theta = np.interp(at, time, moving.theta)
        return ax * np.cos(theta) - ay * np.sin(theta), ax * np.sin(theta) + ay * np.cos(theta)
    sine, cosine = np.sin(moving.theta), np.cos(moving.theta)
    # Velocity in body axes, whose change is the mean of R^T a plus what the axes' own turning adds.
    along, up = moving.vx * cosine - moving.vy * sine, moving.vx * sine + moving.vy * cosine
    start, end = at - 0.5 * window, at + 0.5 * window
    pull_x, pull_y = gravity[0] * cosine - gravity[1] * sine, gravity[0] * sine + gravity[1] * cosine
    mean_x = _change(time, along, start, end) + _integral(time, moving.omega * up + pull_x, start, end)
    mean_y = _change(time, up, start, end) + _integral(time, pull_y - moving.omega * along, start, end)
    return mean_x / window, mean_y / window


def _change(time: Array, values: Array, start: Array, end: Array) -> Array:
    return np.interp(end, time, values) - np.interp(start, time, values)


def _integral(time: Array, values: Array, start: Array, end: Array) -> Array:
    """Of `values`, taken as linear between their times, from `start` to `end` [s]."""
    summed = np.concatenate([[0.0], np.cumsum(0.5 * (values[1:] + values[:-1]) * np.diff(time))])

    def up_to(limit: Array) -> Array:
        index = np.clip(np.searchsorted(time, limit, side="right") - 1, 0, len(time) - 2)
        part = limit - time[index]
        slope = (values[index + 1] - values[index]) / (time[index + 1] - time[index])
        return summed[index] + part * (values[index] + 0.5 * slope * part)

    return up_to(end) - up_to(start)


def _add_noise(columns: dict[str, Array], std: tuple[float, ...], stream: np.random.Generator | None) -> None:
    if stream is None:
        return
    names = [name for name in columns if name != "t_s"]
    for name, size in zip(names, std, strict=True):
        columns[name] = columns[name] + size * stream.standard_normal(len(columns[name]))
