"""What the baselines learn from, and what a learnt force leaves: residuals of one trial.

A force is learnt from the residual force beside the measured state, row by row (`make_rows`). It then acts in the base
model, which is run again on held-out trials: `held_out_gap` is the gap that is left.

Both kinds of trials: the base model is the one that diagnose fitted, and the residual is what it leaves. Of a tumble
it is measured less modelled specific force and angular acceleration, at the IMU's rows, times the inertia that resists.
The state is the measured one, smoothed by Savitzky-Golay polynomials of order 3 (camera 0.1 s, gyro and wheel 0.05 s):
a force belongs to where the platform was, not to where the model placed it. Of a penetration it is measured force (of a
drop, m (g - a)) less the base model's at the smoothed depth. Beside it stand depth, speed and the way back from the
deepest point.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import savgol_filter

__all__ = ["NAMES", "STANDING", "Rows", "held_out_gap", "make_rows", "touching"]

Array = NDArray[np.float64]
Force = Callable[[Array], Array]
"""States [row_count, state_count] (`NAMES`) -> forces [row_count, target_count] in SI units."""

_TERM = Path(__file__).with_name("discrepancy_term.py")
_TOLERANCE = 1e-6
_FALL_STEP = 1e-4  # s

NAMES = {
    "tumble": ("x", "y", "theta", "vx", "vy", "omega", "wheel", "touch"),
    "penetration": ("z", "v", "back", "inside"),
}
"""The state, by kind of trial. y from where it stands; touch and inside are 1 where a tip is below the surface."""
STANDING = {"tumble": ("force x", "force y", "torque"), "penetration": ("force",)}  # targets, by kind of trial
_HALF = math.pi / 8
_NEAR = 5e-4
"""Height of the lowest tip below which it is taken to touch: the smoothed camera knows it to two tenths of this [m]."""
_ROBUST = 1.4826
_LOUD = 6.0
"""Rows beyond this many robust standard deviations are cut back: impacts that come a moment too early or too late."""


@dataclass(frozen=True)
class Rows:
    """One trial, in the order of time."""

    trial: str
    state: Array  # [row_count, state_count]
    target: Array  # [row_count, target_count]
    std: Array  # noise of the targets [target_count], of the middle trial


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
    (x, vx), (y, vy), (theta, _) = (_smooth(data, name, time, 0.1) for name in ("x", "y", "theta"))
    (omega, _), (wheel, _) = (_smooth(data, name, time, 0.05) for name in ("gyro", "wheel"))
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
        force, std = latent["latent_force_N"], float(np.median(problem.gap_std(values, (), trial)))
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


def held_out_gap(problem: Any, values: Mapping[str, float], trials: Sequence[str], force: Force | None) -> float | None:
    """Chi-square per sample of these trials with `force` added to the base model at `values`.

    None where there are no trials; nan where the motion did not come to its end.
    """
    total, count = 0.0, 0
    for trial in trials:
        try:
            rest = (_tumble_left if problem.kind == "tumble" else _penetration_left)(problem, values, trial, force)
        except (RuntimeError, ValueError, OverflowError, ZeroDivisionError):
            return math.nan
        total, count = total + float(rest @ rest), count + len(rest)
    return total / count if count else None


def _tumble_left(problem: Any, values: Mapping[str, float], trial: str, force: Force | None) -> Array:
    """Residuals over the noise, by the accurate integrator."""
    from rigid import Effect, Trial, simulate
    from rigid.terms import load_effect

    data = next(one for one in problem.data.trials if one.id == trial)
    number = {name: values.get(name, problem.forward.nominal[name]) for name in problem.forward.nominal}
    gravity = values.get(f"gravity_sim[{trial}]", data.gravity_sim)
    tables = problem.data.tables
    term = load_effect(_TERM)
    effects = (Effect(id=term.id, file=_TERM),) if force is not None else ()
    pull = data.local_gravity if data.local_gravity is not None else gravity
    made = Trial(
        mass=number["mass"], inertia=number["inertia"], spike_length=tables.platform.spike_length,
        stiffness=number["stiffness"], damping=number["damping"], mu_s=number["mu_s"],
        mu_d=min(number["mu_d"], number["mu_s"]), gravity_sim=gravity,
        gravity=pull, counterweight=data.counterweight, torque=data.torque, torque_until=data.torque_until,
        actuator=data.actuator, wheel_inertia=tables.wheel.inertia, wheel_speed_0=data.wheel_speed_0, effects=effects,
    )  # fmt: skip
    window = problem.data.window
    imu = np.unique(data.time[data.of("ax") | data.of("ay")])
    edges = [imu - 0.5 * window, imu + 0.5 * window, data.time]
    end = float(max(edge.max(initial=0.0) for edge in edges)) + 1e-6
    times = np.unique(np.concatenate([[0.0, end], *(edge[edge > 0] for edge in edges)]))
    stand = made.spike_length * math.cos(math.pi / 8) - 0.5 * made.weight / made.stiffness

    def acting(s: Any) -> tuple[float, ...]:
        touch = float(touching(np.array([s.y - stand]), np.array([s.theta]), tables)[0])
        state = np.array([[s.x, s.y - stand, s.theta, s.vx, s.vy, s.omega, 0.01 * abs(s.wheel_speed), touch]])
        return tuple(force(state)[0].tolist())

    hooks = _hooks(term)
    if force is not None:
        hooks.append(acting)
    try:
        motion = simulate(made, duration=end, times=times, tolerance=_TOLERANCE)
    finally:
        if force is not None:
            hooks.pop()
    return _residual(data, motion, window, pull)


def _hooks(term: Any) -> list[Any]:
    """The list `acting` of the module in which the integrator finds the term."""
    return term.hooks["force"].__globals__["acting"]


def _residual(data: Any, motion: Any, window: float, pull: float) -> Array:
    """Measured less modelled over the noise, the camera's zero at its most probable value within three std."""
    time = motion.time

    def at(name: str, when: Array, before: float | None = None) -> Array:
        column = np.asarray(getattr(motion, name), dtype=float)
        return np.interp(when, time, column, left=before)

    def specific_force(when: Array) -> tuple[Array, Array]:
        if window > 0:
            low, high = when - 0.5 * window, when + 0.5 * window
            x, y = ((at(v, high, 0.0) - at(v, low, 0.0)) / window for v in ("vx", "vy"))
        else:
            x, y = at("ax", when, 0.0), at("ay", when, 0.0)
        sine, cosine = np.sin(at("theta", when)), np.cos(at("theta", when))
        return x * cosine - (y + pull) * sine, x * sine + (y + pull) * cosine

    read = {
        **{name: partial(at, name) for name in ("x", "y", "theta")},
        "gyro": lambda when: at("omega", when, 0.0),
        "ax": lambda when: specific_force(when)[0],
        "ay": lambda when: specific_force(when)[1],
        "wheel": lambda when: np.abs(at("wheel_speed", when)),
    }
    parts = []
    for channel, value_at in read.items():
        mine = data.of(channel)
        if not mine.any():
            continue
        value = value_at(data.time[mine])
        rest = (data.value[mine] - value) / data.std[mine]
        if channel in ("x", "y", "theta"):
            rest = rest - np.clip(rest.mean(), -3.0, 3.0)
        parts.append(rest)
    return np.concatenate(parts)


def _penetration_left(problem: Any, values: Mapping[str, float], trial: str, force: Force | None) -> Array:
    told = problem.compare(values, (), trial)
    samples = problem.samples(trial)
    driven = "force" in told
    state = problem.latent(values, (), trial)
    if driven:
        extra = np.zeros(len(state["t_s"]))
        if force is not None:
            extra = force(_state(state["depth_m"], state["velocity_m_s"], state["retreat_m"]))[:, 0]
        return (told["force"]["measured"] - told["force"]["model"] - extra) / problem.gap_std(values, (), trial)
    columns = {name: one["model"] for name, one in told.items()}
    if force is not None:
        table = next(one for one in problem.tables.trial if one.id == trial)
        end = max(float(one["t_s"].max()) for one in told.values())
        time, *found = _fall(problem, values, table, end, force)
        fell = dict(zip(("depth", "accel"), found, strict=True))
        columns = {name: np.interp(one["t_s"], time, fell[name]) for name, one in told.items() if name in fell}
    return np.concatenate([
        (told[name]["measured"] - columns[name]) / samples.std[samples.channel == name]
        for name in ("depth", "accel") if name in told
    ])  # fmt: skip


def _state(z: Any, v: Any, back: Any) -> Array:
    z = np.atleast_1d(z)
    return np.stack([z, np.atleast_1d(v), np.atleast_1d(back), (z > 0).astype(float)], axis=1)


def _fall(
    problem: Any, values: Mapping[str, float], table: Any, end: float, force: Force
) -> tuple[Array, Array, Array]:
    """m z'' = m g - K z - C max(0, v) - force, by the midpoint rule; time, depth, acceleration."""
    mass, stiffness, damping, gravity = fall_numbers(problem, values, table.id)
    top = 0.0

    def accelerate(z: float, v: float) -> float:
        bed = stiffness * z + damping * max(v, 0.0) if z > 0 else 0.0
        return gravity - (bed + float(force(_state(z, v, max(top, z, 0.0) - z))[0, 0])) / mass

    steps = math.ceil(end / _FALL_STEP) + 1
    time, depth, accel = _FALL_STEP * np.arange(steps + 1), np.empty(steps + 1), np.empty(steps + 1)
    z, v = 0.0, float(table.speed or 0.0)
    for k in range(steps + 1):
        a = accelerate(z, v)
        depth[k], accel[k] = z, a
        middle_v = v + 0.5 * _FALL_STEP * a
        a = accelerate(z + 0.5 * _FALL_STEP * v, middle_v)
        z, v = z + _FALL_STEP * middle_v, v + _FALL_STEP * a
        top = max(top, z)
        if not (math.isfinite(z) and abs(z) < 10.0):
            raise RuntimeError("the fall ran away")
    return time, depth, accel
