"""The base model with a learnt force added, run again on held-out trials: the gap that is left."""

import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from .rows import Array, fall_numbers, force_std, touching

__all__ = ["held_out_gap"]

Force = Callable[[Array], Array]
"""States [row_count, state_count] (`baseline_rows.NAMES`) -> forces [row_count, target_count] in SI units."""

_TERM = Path(__file__).with_name("discrepancy_term.py")
_TOLERANCE = 1e-6
_FALL_STEP = 1e-4  # s


def held_out_gap(problem: Any, values: Mapping[str, float], trials: Sequence[str], force: Force | None) -> float | None:
    """Chi-square per sample of these trials with `force` added to the base model at `values`.

    None where there are no trials; nan where the motion did not come to its end.
    """
    total, count = 0.0, 0
    for trial in trials:
        try:
            rest = (_tumble if problem.kind == "tumble" else _penetration)(problem, values, trial, force)
        except (RuntimeError, ValueError, OverflowError, ZeroDivisionError):
            return math.nan
        total, count = total + float(rest @ rest), count + len(rest)
    return total / count if count else None


def _tumble(problem: Any, values: Mapping[str, float], trial: str, force: Force | None) -> Array:
    """Residuals over the noise, by the accurate integrator."""
    from rigid import Effect, Trial, simulate
    from rigid.terms import load_effect

    data = next(one for one in problem.data.trials if one.id == trial)
    number = {name: values.get(name, problem.forward.nominal[name]) for name in problem.forward.nominal}
    gravity = values.get(f"gravity_sim[{trial}]", data.gravity_sim)
    tables = problem.data.tables
    term = load_effect(_TERM)
    effects = (Effect(id=term.id, file=_TERM),) if force is not None else ()
    made = Trial(
        mass=number["mass"], inertia=number["inertia"], spike_length=tables.platform.spike_length,
        stiffness=number["stiffness"], damping=number["damping"], mu_s=number["mu_s"],
        mu_d=min(number["mu_d"], number["mu_s"]), gravity_sim=gravity,
        gravity=data.local_gravity if data.local_gravity is not None else gravity, counterweight=data.counterweight,
        torque=data.torque, torque_until=data.torque_until, actuator=data.actuator,
        wheel_inertia=tables.wheel.inertia, wheel_speed_0=data.wheel_speed_0, effects=effects,
    )  # fmt: skip
    window = problem.data.window
    imu = np.unique(data.time[data.of("ax") | data.of("ay")])
    edges = [imu - 0.5 * window, imu + 0.5 * window, data.time]
    end = float(max(edge.max(initial=0.0) for edge in edges)) + 1e-6
    times = np.unique(np.concatenate([[0.0, end], *(edge[edge > 0] for edge in edges)]))
    stand = made.spike_length * math.cos(math.pi / 8) - 0.5 * made.weight / made.stiffness
    hooks = _hooks(load_effect(_TERM))
    if force is not None:
        hooks.append(lambda s: _acting(s, stand, tables, force))
    try:
        motion = simulate(made, duration=end, times=times, tolerance=_TOLERANCE)
    finally:
        if force is not None:
            hooks.pop()
    pull = data.local_gravity if data.local_gravity is not None else gravity
    return _residual(data, motion, window, pull)


def _hooks(term: Any) -> list[Any]:
    """The list `acting` of the module in which the integrator finds the term."""
    return term.hooks["force"].__globals__["acting"]


def _acting(s: Any, stand: float, tables: Any, force: Force) -> tuple[float, float, float]:
    y = s.y - stand
    touch = float(touching(np.array([y]), np.array([s.theta]), tables)[0])
    state = np.array([[s.x, y, s.theta, s.vx, s.vy, s.omega, 0.01 * abs(s.wheel_speed), touch]])
    x, up, turn = force(state)[0]
    return float(x), float(up), float(turn)


def _residual(data: Any, motion: Any, window: float, pull: float) -> Array:
    """Measured less modelled over the noise, the camera's zero at its most probable value within three std."""
    time = motion.time

    def at(name: str, when: Array, before: float | None = None) -> Array:
        column = np.asarray(getattr(motion, name), dtype=float)
        return np.interp(when, time, column, left=before)

    parts = []
    for channel in ("x", "y", "theta", "gyro", "ax", "ay", "wheel"):
        mine = data.of(channel)
        if not mine.any():
            continue
        when = data.time[mine]
        if channel in ("ax", "ay"):
            turn = at("theta", when)
            if window > 0:
                low, high = when - 0.5 * window, when + 0.5 * window
                x, y = ((at(v, high, 0.0) - at(v, low, 0.0)) / window for v in ("vx", "vy"))
            else:
                x, y = at("ax", when, 0.0), at("ay", when, 0.0)
            y = y + pull
            sine, cosine = np.sin(turn), np.cos(turn)
            value = x * cosine - y * sine if channel == "ax" else x * sine + y * cosine
        elif channel == "gyro":
            value = at("omega", when, 0.0)
        elif channel == "wheel":
            value = np.abs(at("wheel_speed", when))
        else:
            value = at(channel, when)
        rest = (data.value[mine] - value) / data.std[mine]
        if channel in ("x", "y", "theta"):
            rest = rest - np.clip(rest.mean(), -3.0, 3.0)
        parts.append(rest)
    return np.concatenate(parts)


def _penetration(problem: Any, values: Mapping[str, float], trial: str, force: Force | None) -> Array:
    told = problem.compare(values, (), trial)
    samples = problem.samples(trial)
    driven = "force" in told
    state = problem.latent(values, (), trial)
    if driven:
        extra = np.zeros(len(state["t_s"]))
        if force is not None:
            extra = force(_state(state["depth_m"], state["velocity_m_s"], state["retreat_m"]))[:, 0]
        return (told["force"]["measured"] - told["force"]["model"] - extra) / force_std(problem, values, trial)
    if force is None:
        return np.concatenate([
            (told[name]["measured"] - told[name]["model"]) / samples.std[samples.channel == name]
            for name in ("depth", "accel") if name in told
        ])  # fmt: skip
    table = next(one for one in problem.tables.trial if one.id == trial)
    time, depth, accel = _fall(problem, values, table, max(float(one["t_s"].max()) for one in told.values()), force)
    return np.concatenate([
        (told[name]["measured"] - np.interp(told[name]["t_s"], time, column)) / samples.std[samples.channel == name]
        for name, column in (("depth", depth), ("accel", accel)) if name in told
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
