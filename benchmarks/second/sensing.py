"""Sensors of tumbles: what camera, IMU and wheel read of a motion; what uncertain numbers do not explain of a change.

Nothing here comes from `rigid`, `coupling` or `experiments`, and nothing moves a platform: it serves any simulator.
Camera, IMU and wheel have clocks and origins of their own: the camera's scale is about its own origin on the
surface, the IMU's first sample falls where its clock puts it.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from .drawing import Made, Numbers, Table
from .noise import Noise, draw_noise

__all__ = [
    "CHANNELS", "RATES", "SIGMA", "SIGMA_GRAVITY", "Plan", "Readings", "Weighing", "draw_conditions", "draw_sensors",
    "draw_true", "read", "record", "weigh",
]  # fmt: skip

Array = NDArray[np.float64]
Readings = list[dict[str, Array]]
CHANNELS = ("x", "y", "theta", "gyro", "ax", "ay", "wheel")
RATES = {"camera": 120.0, "imu": 100.0, "wheel": 600.0}
SIGMA = {"mass": 0.002, "inertia": 0.03, "stiffness": 0.1, "damping": 0.2, "mu_s": 0.05, "mu_d": 0.05}
SIGMA_GRAVITY = 0.02
_G = 9.80665
_LEAD, _WINDOW = 0.2, 0.004


@dataclass(frozen=True)
class Plan:
    """What is done and stated."""

    rig: bool
    surface: str
    stated: dict[str, float]
    true: dict[str, float]
    gravity_factor: Array  # of each trial
    trials: tuple[Table, ...]
    duration: float
    std: dict[str, float]
    noise: dict[str, Noise]
    phase: dict[str, float]  # of each sensor's first sample, in samples
    legs: dict[str, float] = field(default_factory=dict)


def draw_true(random: np.random.Generator, stated: Numbers) -> Numbers:
    """The true numbers beside the stated ones, as uncertain as is stated; at most 2.5 standard deviations away."""
    return {name: value * (1 + SIGMA[name] * float(np.clip(random.standard_normal(), -2.5, 2.5)))
            for name, value in stated.items()}  # fmt: skip


def draw_conditions(
    random: np.random.Generator, gravities: Sequence[float] | None = None
) -> list[tuple[float, float, str, float]]:
    """Gravity [m/s2], torque [N m], actuator and speed of the wheel [rad/s]: two motors and a brake in each gravity."""
    gravities = gravities or random.choice((0.03, 0.06, 0.1, 0.15), 2, replace=False).tolist()
    motors = random.choice((0.125, 0.16, 0.22, 0.3), 2, replace=False).tolist()
    brake, spin = float(random.choice((2.0, 4.0, 6.0))), float(random.choice((200.0, 300.0, 400.0)))
    return [(g, t, "motor", 0.0) for g in gravities for t in motors] + [(g, brake, "brake", spin) for g in gravities]


def draw_sensors(
    random: np.random.Generator, loud: float
) -> tuple[dict[str, float], dict[str, Noise], dict[str, float]]:
    """Standard deviation of each channel, `loud` times the usual one, its noise, and the phase of each sensor."""
    std = {"x": 5e-4, "y": 5e-4, "theta": 3e-3, "gyro": 0.01, "ax": 0.02, "ay": 0.02, "wheel": 0.5}
    return (
        {name: round(value * loud, 6) for name, value in std.items()}, {name: draw_noise(random) for name in CHANNELS},
        {name: float(random.random()) for name in RATES},
    )  # fmt: skip


class Weighing:
    """What a change of the readings leaves beside all that is uncertain, over the noise."""

    def __init__(self, plan: Plan, clean: Readings, slopes: Sequence[Array], per_trial: Sequence[Array]) -> None:
        self._plan, self._base = plan, _stacked(plan, clean)
        lengths = [[len(one[name]) for name in CHANNELS] for one in clean]
        self._channel = np.concatenate([np.repeat(np.arange(len(CHANNELS)), own) for own in lengths])
        trial = np.repeat(np.arange(len(clean)), [sum(own) for own in lengths])
        rows = list(slopes) + [np.where(trial == n, slope, 0.0) for slope in per_trial for n in range(len(clean))]
        self._poses = [(trial == n) & (self._channel == k) for n in range(len(clean)) for k in range(3)]
        self._matrix = np.array(rows, dtype=float)
        self._normal = self._matrix @ self._matrix.T + np.eye(len(rows))

    def _left(self, readings: Readings) -> Array:
        change = _stacked(self._plan, readings) - self._base
        for pose in self._poses:  # the camera's zeros: within 3 std
            change[pose] -= np.clip(np.mean(change[pose]), -3.0, 3.0)
        return np.asarray(change - np.linalg.solve(self._normal, self._matrix @ change) @ self._matrix)

    def most(self, readings: Readings) -> float:
        """Root mean square in the channel with the largest."""
        rest = self._left(readings)
        return max(float(np.sqrt(np.mean(rest[self._channel == k] ** 2))) for k in range(len(CHANNELS)))

    def whole(self, readings: Readings) -> float:
        """Root mean square over all readings: chi-square a sample rises by its square."""
        return float(np.sqrt(np.mean(self._left(readings) ** 2)))


def weigh(plan: Plan, measure: Callable[[list[Numbers]], list[Readings]]) -> tuple[Readings, Weighing]:
    """Readings with nothing hidden, and what weighs a change of them: slopes by half a standard deviation each.

    `measure`: readings without noise for each of several settings.
    """
    half = 0.5
    nudged = [{name: plan.true[name] * (1 + half * sigma)} for name, sigma in SIGMA.items()]
    clean, by_gravity, *rest = measure([{}, {"gravity_factor": 1 + half * SIGMA_GRAVITY}, *nudged])
    base = _stacked(plan, clean)
    slopes = [(_stacked(plan, one) - base) / half for one in rest]
    return clean, Weighing(plan, clean, slopes, [(_stacked(plan, by_gravity) - base) / half])


def _stacked(plan: Plan, readings: Readings) -> Array:
    return np.concatenate([one[name] / plan.std[name] for one in readings for name in CHANNELS])


def read(plan: Plan, time: Array, motion: Array, pull: float, settings: Mapping[str, float]) -> dict[str, Array]:
    """What camera, IMU and wheel read of one motion, each on its own clock; ``<sensor>_t`` [s] beside the channels."""
    stamps = {name: (np.arange(math.ceil(-_LEAD * rate), int(plan.duration * rate)) + plan.phase[name]) / rate
              for name, rate in RATES.items()}  # fmt: skip
    true = stamps["imu"] - settings.get("clock", 0.0)  # when the IMU's sample was really taken
    x, y, theta, vx, vy, omega, wheel = motion[:, :7].T
    lean, scale = settings.get("slope", 0.0), 1.0 + settings.get("scale", 0.0)

    def at(times: Array, values: Array) -> Array:  # at rest before t = 0
        return np.interp(times, time, values)

    def before(values: Array) -> Array:
        return np.where(true < 0.0, 0.0, np.interp(true, time, values))

    late, early = true + 0.5 * _WINDOW, true - 0.5 * _WINDOW
    speeds = [np.concatenate([[0.0], values]) for values in (vx, vy)]
    whole = np.concatenate([[time[0] - 1e-9], time])
    ax, ay = ((np.interp(late, whole, v) - np.interp(early, whole, v)) / _WINDOW for v in speeds)
    ax, ay, turn = ax + pull * math.sin(lean), ay + pull * math.cos(lean), at(true, theta)
    camera, drift = stamps["camera"], settings.get("drift", 0.0)
    return {
        "camera_t": camera, "imu_t": stamps["imu"], "wheel_t": stamps["wheel"],
        "x": scale * at(camera, x), "y": scale * at(camera, y), "theta": at(camera, theta),
        "gyro": before(omega) + drift * np.maximum(true, 0.0) ** 2,
        "ax": ax * np.cos(turn) - ay * np.sin(turn), "ay": ax * np.sin(turn) + ay * np.cos(turn),
        "wheel": np.abs(at(stamps["wheel"], wheel)),
    }  # fmt: skip


def record(random: np.random.Generator, plan: Plan, readings: Readings, *, title: str) -> Made:
    """The campaign of these readings, with noise, zeros of the camera and the name `title`."""
    sensors = {
        "pose": ("camera_t", {"x_m": "x", "y_m": "y", "theta_rad": "theta"}),
        "imu": ("imu_t", {"gyro_rad_s": "gyro", "ax_m_s2": "ax", "ay_m_s2": "ay"}),
        "wheel": ("wheel_t", {"omega_rad_s": "wheel"}),
    }
    columns, trials, std = {}, [], plan.std
    for number, (trial, one) in enumerate(zip(plan.trials, readings, strict=True), 1):
        id = f"{number:03d}"
        zero = {name: float(random.uniform(-2.5, 2.5)) * std[name] for name in ("x", "y", "theta")}
        noisy = {name: plan.noise[name].on(one[name] + zero.get(name, 0.0), std[name], random) for name in CHANNELS}
        noisy["wheel"] = np.abs(noisy["wheel"])
        for sensor, (stamp, labels) in sensors.items():
            columns[id, sensor] = {"t_s": one[stamp]} | {label: noisy[name] for label, name in labels.items()}
        stated = {key: value for key, value in trial.items() if key != "counterweight" or plan.rig}
        trials.append(
            {"id": id, **stated, "pose": f"{id}-pose.csv", "imu": f"{id}-imu.csv", "wheel": f"{id}-wheel.csv"}
        )
    stated = plan.stated
    tables: Table = {
        "format": "hedgehog-campaign/1", "kind": "tumble", "name": title,
        "platform": {"mass": stated["mass"], "inertia": stated["inertia"], "spike_length": 0.2},
        "wheel": {"inertia": 1.2e-3},
        "surface": {"kind": plan.surface, "granular": plan.surface in ("sand", "gravel"),
                    **{key: stated[key] for key in ("stiffness", "damping", "mu_s", "mu_d")}},
        "uncertainty": SIGMA | {"gravity_sim": SIGMA_GRAVITY},
        "sensors": {"pose": {"std": (std["x"], std["y"], std["theta"])},
                    "imu": {"std": (std["gyro"], std["ax"], std["ay"]), "window": _WINDOW},
                    "wheel": {"std": (std["wheel"],)}},
        "trial": tuple(trials),
    }  # fmt: skip
    if plan.rig:
        tables["rig"] = {"counterweight": plan.trials[0]["counterweight"], "gravity": _G}
    return Made(tables, columns)
