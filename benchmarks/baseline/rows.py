"""What the baselines learn from: residual force beside the measured state, row by row, of one trial.

Both kinds of trials: the base model is the one that diagnose fitted, and the residual is what it leaves. Of a tumble
it is measured less modelled specific force and angular acceleration, at the IMU's rows, times the inertia that resists;
the state is the measured one, smoothed by Savitzky-Golay polynomials of order 3 (camera 0.1 s, gyro and wheel 0.05 s),
since a force belongs to where the platform was, not to where the model thought it was. Of a penetration it is measured
force (of a drop, m (g - a)) less the base model's at the smoothed depth, beside depth, speed and the way back from the
deepest point.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import savgol_filter

__all__ = ["NAMES", "STANDING", "Rows", "fall_numbers", "force_std", "make_rows", "touching"]

Array = NDArray[np.float64]

NAMES = {
    "tumble": ("x", "y", "theta", "vx", "vy", "omega", "wheel", "touch"),
    "penetration": ("z", "v", "back", "inside"),
}
"""The state, by kind of trial. y from where it stands; touch and inside are 1 where a tip is below the surface."""
STANDING = {"tumble": ("force x", "force y", "torque"), "penetration": ("force",)}
"""Targets, by kind of trial."""
_HALF = math.pi / 8
_NEAR = 5e-4
"""Height of the lowest tip below which it is taken to touch: the smoothed camera knows it to two tenths of this [m]."""
_ROBUST = 1.4826
_LOUD = 6.0
"""Rows beyond this many robust standard deviations are cut back: impacts that come a moment too early or too late."""


@dataclass(frozen=True)
class Rows:
    """One trial: states [row_count, state_count], targets [row_count, target_count], in the order of time.

    `std`: noise of the targets [target_count], of the middle trial.
    """

    trial: str
    state: Array
    target: Array
    std: Array


def make_rows(problem: Any, values: Mapping[str, float], trials: Sequence[str]) -> list[Rows]:
    """Rows of these trials. `values` are the fitted base model's. Trials without an accelerometer have none."""
    make = _tumble if problem.kind == "tumble" else _penetration
    found = [make(problem, values, trial) for trial in trials]
    found = [rows for rows in found if len(rows.state) > 20]
    if not found:
        return []
    unit = np.median([rows.std for rows in found], axis=0)  # one law must have one size in all trials
    return [Rows(rows.trial, rows.state, rows.target, unit) for rows in found]


def _cut(target: Array, std: Array) -> Array:
    """Targets with what is loud beyond all proportion cut back."""
    middle = np.median(target, axis=0)
    spread = np.maximum(_ROBUST * np.median(np.abs(target - middle), axis=0), std)
    return np.clip(target, middle - _LOUD * spread, middle + _LOUD * spread)


def _tumble(problem: Any, values: Mapping[str, float], trial: str) -> Rows:
    data = next(one for one in problem.data.trials if one.id == trial)
    latent = problem.latent(values, (), trial)
    time = latent["t_s"]
    kept = time >= 0
    time = time[kept]
    if len(time) < 20:
        return Rows(trial, np.zeros((0, 8)), np.zeros((0, 3)), np.ones(3))
    target = np.stack([latent[name][kept] for name in ("latent_force_x_N", "latent_force_y_N", "latent_torque_N_m")], 1)
    x, vx = _smooth(data, "x", time, 0.1)
    y, vy = _smooth(data, "y", time, 0.1)
    theta, _ = _smooth(data, "theta", time, 0.1)
    omega, _ = _smooth(data, "gyro", time, 0.05)
    wheel, _ = _smooth(data, "wheel", time, 0.05)
    x, y, theta = x - _still(data, "x"), y - _still(data, "y"), theta - _still(data, "theta")
    state = np.stack([x, y, theta, vx, vy, omega, 0.01 * wheel, touching(y, theta, problem.data.tables)], axis=1)
    mass, inertia = (values.get(name, problem.forward.nominal[name]) for name in ("mass", "inertia"))
    noise = {name: float(data.std[data.of(name)][0]) for name in ("gyro", "ax", "ay")}
    step = float(np.median(np.diff(time)))
    slope = noise["gyro"] / (step * math.sqrt(10.0))  # of a line through five rows
    std = np.array([mass * noise["ax"], (mass + data.counterweight) * noise["ay"], inertia * slope])
    return Rows(trial, state, _cut(target, std), std)


def touching(y: Array, theta: Array, tables: Any) -> Array:
    """1 where the lowest tip is below the surface, within the noise; y from where it stands."""
    length = tables.platform.spike_length
    turned = np.mod(theta + _HALF, 2 * _HALF) - _HALF  # the nearest multiple of an eighth turn is a stand on two
    lowest = length * np.cos(np.abs(turned) - _HALF)
    return (y + length * math.cos(_HALF) - lowest < _NEAR).astype(float)


def _smooth(data: Any, channel: str, at: Array, window: float) -> tuple[Array, Array]:
    """Smoothed value and slope of a tumble's channel at these times; zeros where it was not measured."""
    mine = data.of(channel)
    if mine.sum() < 10:
        return np.zeros(len(at)), np.zeros(len(at))
    return smooth(data.time[mine], data.value[mine], at, window)


def smooth(time: Array, value: Array, at: Array, window: float) -> tuple[Array, Array]:
    """Savitzky-Golay's value and slope at these times, from an even grid over `time`; `window` [s]."""
    step = float(np.median(np.diff(time)))
    grid = np.arange(time[0], time[-1] + 0.5 * step, step)
    even = np.interp(grid, time, value)
    width = min(max(5, 2 * round(0.5 * window / step) + 1), len(grid) - 1 + len(grid) % 2)
    slope = savgol_filter(even, width, 3, deriv=1, delta=step)
    return np.interp(at, grid, savgol_filter(even, width, 3)), np.interp(at, grid, slope)


def _still(data: Any, channel: str) -> float:
    """The camera's reading before the torque starts, which is its zero; the first rows where it starts with it."""
    mine = data.of(channel)
    if not mine.any():
        return 0.0
    before = data.value[mine & (data.time < 0)]
    return float(np.mean(before if len(before) >= 3 else data.value[mine][:3]))


def _penetration(problem: Any, values: Mapping[str, float], trial: str) -> Rows:
    told, samples = problem.compare(values, (), trial), problem.samples(trial)
    if "force" in told:
        latent = problem.latent(values, (), trial)
        depth, speed, back = latent["depth_m"], latent["velocity_m_s"], latent["retreat_m"]
        force, std = latent["latent_force_N"], float(np.median(force_std(problem, values, trial)))
    elif "accel" in told and "depth" in told:  # m (g - a) less the bed's force at the measured depth
        mass, stiffness, damping, gravity = fall_numbers(problem, values, trial)
        time = told["accel"]["t_s"]
        depth, speed = smooth(told["depth"]["t_s"], told["depth"]["measured"], time, 0.02)
        back = np.maximum.accumulate(np.maximum(depth, 0.0)) - depth
        bed = np.where(depth > 0, stiffness * depth + damping * np.maximum(speed, 0.0), 0.0)
        force = mass * (gravity - told["accel"]["measured"]) - bed
        std = mass * float(samples.std[samples.channel == "accel"][0])
    else:
        return Rows(trial, np.zeros((0, 4)), np.zeros((0, 1)), np.ones(1))
    noise = np.array([std])
    state = np.stack([depth, speed, back, (depth > 0).astype(float)], axis=1)
    return Rows(trial, state, _cut(force[:, None], noise), noise)


def fall_numbers(problem: Any, values: Mapping[str, float], trial: str) -> tuple[float, float, float, float]:
    """Mass [kg], K [N/m], C [N s/m] and gravity [m/s2] of a drop at these values."""
    tables = problem.tables
    table = next(one for one in tables.trial if one.id == trial)
    diameter = table.diameter if table.diameter is not None else tables.spike.diameter
    stiffness, damping = (
        float(values.get(f"{name}@{diameter:g}", values.get(name, getattr(tables.surface, name))))
        for name in ("stiffness", "damping")
    )
    return float(tables.spike.mass), stiffness, damping, table.gravity


def force_std(problem: Any, values: Mapping[str, float], trial: str) -> Array:
    """Noise of a driven trial's residual force [N], shape [row_count]: the sensor's and what the depth's error adds."""
    return np.asarray(problem.gap_std(values, (), trial))
