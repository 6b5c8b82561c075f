"""The result of one tumble: its quantities, the columns of its series, its sentences, and what result.json holds."""

import math
from collections.abc import Sequence

import numpy as np

from experiments.platform.ground_file import law_warnings, range_warnings
from experiments.platform.numbers import ball_radius, tip_depth
from experiments.runs.result import quantity
from experiments.runs.types import Json
from rigid.planar.trajectory import Trajectory, Transition

from . import say
from .settings import TumbleSettings
from .trial import TumblePlan

__all__ = [
    "motion_columns", "passages", "quantities_of", "result_of", "title_of", "trajectory_columns", "tumble_sentences",
    "way_through",
]  # fmt: skip

MOST = 8  # Changes of state that are stated one by one
AFTER = 1.0  # When way, height, rotation and work are taken [s]: they scatter less from bed to bed than the first angle


def quantities_of(trajectory: Trajectory) -> dict[str, Json]:
    """The numbers that every tumble has, as result.json holds them; a value is null where there is none."""
    trial, entry = trajectory.trial, say("of_entry")
    base = say("of_base") if trial.effects else ""
    tips = tip_depth(
        trajectory.theta, trajectory.y, count=trial.spike_count, length=trial.spike_length, radius=ball_radius(trial)
    )
    sinkage = np.maximum(tips, 0.0)
    return {
        "trajectory_angle": quantity(trajectory.trajectory_angle, "rad", say("of_angle")),
        "max_speed": quantity(trajectory.max_speed, "m/s", "of the centre"),
        "time_of_max_speed": quantity(trajectory.time_of_max_speed, "s", "when the centre is that fast"),
        "max_angular_velocity": quantity(trajectory.max_angular_velocity, "rad/s", ""),
        "transition_angle_slip": quantity(trajectory.transition_angle("slip"), "rad", entry),
        "transition_angle_hop": quantity(trajectory.transition_angle("hop"), "rad", entry),
        "tipping_torque": quantity(trial.tipping_torque, "N m", say("of_tipping", base=base)),
        "slip_torque": quantity(trial.slip_torque, "N m", say("of_slip", base=base)),
        "energy_residual": quantity(trajectory.energy_residual, "1", say("of_residual")),
        "sinkage_start": quantity(float(sinkage[0, [0, -1]].mean()), "m", say("of_sinkage_start")),
        "sinkage_largest": quantity(float(sinkage.max()), "m", say("of_any_row_then")),
    } | _after_a_second(trajectory)


def _after_a_second(trajectory: Trajectory) -> dict[str, Json]:
    """How far ahead and up the centre is, how far it has rotated and what work the torque has done, one second after
    the start; null in a shorter trial."""
    note = say("of_after", after=AFTER)
    columns = {
        "ahead_1s": (trajectory.x, "m"),
        "up_1s": (trajectory.y, "m"),
        "rotation_1s": (trajectory.theta, "rad"),
        "torque_work_1s": (trajectory.torque_work, "J"),
    }
    long_enough = trajectory.time[-1] >= AFTER
    return {
        name: quantity(
            float(np.interp(AFTER, trajectory.time, values) - values[0]) if long_enough else None, unit, note
        )
        for name, (values, unit) in columns.items()
    }


def trajectory_columns(trajectory: Trajectory) -> Json:
    """The columns of trajectory.csv."""
    return {
        "t_s": trajectory.time,
        "x_m": trajectory.x,
        "y_m": trajectory.y,
        "theta_rad": trajectory.theta,
        "vx_m_s": trajectory.vx,
        "vy_m_s": trajectory.vy,
        "omega_rad_s": trajectory.omega,
        "state": np.array(trajectory.state_names),
    }


def motion_columns(trajectory: Trajectory) -> Json:
    """Further columns of the plots, over time."""
    names = {"t_s": "time", "ax_m_s2": "ax", "ay_m_s2": "ay", "wheel_speed_rad_s": "wheel_speed"}
    names |= {f"{energy}_J": f"{energy}_energy" for energy in ("kinetic", "potential", "stored")}
    names |= {f"{energy}_J": energy for energy in ("energy", "torque_work", "dissipated")}
    return {column: getattr(trajectory, name) for column, name in names.items()}


def passages(trajectory: Trajectory) -> list[Json]:
    """The changes of state, as result.json holds them."""
    return [{"time": float(t), "state": state, "theta": float(theta)} for t, state, theta in trajectory.transitions]


def title_of(plan: TumblePlan) -> str:
    """The title of a tumble's result."""
    return say("title", plan=plan, where="rig" if plan.trial.counterweight > 0 else "free")


def result_of(settings: TumbleSettings, plan: TumblePlan, trajectory: Trajectory, full: float | None) -> Json:
    """The entries of the result of one trial; each experiment adds its own."""
    trial, warnings = plan.trial, list(plan.warnings)
    if full is not None:
        warnings.append(say("wheel_at_limit", limit=plan.max_wheel_speed, when=full))
    if trajectory.trajectory_angle is None:
        warnings.append(stayed_words(trajectory))
    fitted = plan.fitted
    warnings += range_warnings(fitted, trajectory, gravity=trial.gravity, diameter=plan.spikes.diameter)
    warnings += law_warnings(fitted)
    return {
        "title": title_of(plan),
        "status": "done",
        "quantities": quantities_of(trajectory),
        "departures": {"sentences": tumble_sentences(trajectory)},
        "trial": plan.trial_table(trial.weight),
        "surface": plan.surface,
        "ground": ("bed" if settings.on_grains else settings.ground) if fitted is None else fitted.law,
        **({} if fitted is None else {"ground_file": {"material": fitted.material, "source": fitted.source}}),
        "actuator": settings.actuator,
        "method": trajectory.method,
        "duration": settings.duration,
        "spike_count": trial.spike_count,
        "tip_radius": ball_radius(trial),
        "effects": [{"id": effect.id, "parameters": dict(effect.values)} for effect in trial.effects],
        "wheel_at_limit": full,
        "transitions": passages(trajectory),
        "warnings": warnings,
    }


def tumble_sentences(trajectory: Trajectory) -> list[str]:
    """Sentences on the states in their order, each with time and angle of its entry, and on the largest speed."""
    said = [way_through(trajectory.transitions)]
    said += _does_not_tip(trajectory)
    if trajectory.max_speed > 0:
        when = trajectory.time_of_max_speed
        state = [name for time, name, _ in trajectory.transitions if time < when or time == 0][-1]
        said.append(say("fastest", when=when, state=state, speed=trajectory.max_speed))
    return said


def way_through(transitions: Sequence[Transition]) -> str:
    """The first few states in their order, each with time and angle of its entry."""
    changes = [
        f"{state} at {time:.4g} s, {_degrees(angle)}" if time > 0 else f"{state} at once"
        for time, state, angle in transitions[:MOST]
    ]
    more = len(transitions) - MOST
    rest = say("more_changes", more=more, s="s" if more > 1 else "") if more > 0 else ""
    return f"{' -> '.join(changes)}{rest}."


def stayed_words(trajectory: Trajectory) -> str:
    """Sentence that there is no trajectory angle, with the largest displacement of the centre."""
    along, up = (values - values[0] for values in (trajectory.x, trajectory.y))
    k = int(np.argmax(np.hypot(along, up)))
    far = 1e3 * math.hypot(along[k], up[k])
    return say("stayed", far=far, along=1e3 * along[k], up=1e3 * up[k], time=trajectory.time[k])


def _does_not_tip(trajectory: Trajectory) -> list[str]:
    """Whether it stayed on its first rows: a pivot may be only a rocking motion."""
    trial, most = trajectory.trial, float(abs(trajectory.theta).max())
    if most >= math.pi / trial.spike_count or any(state == "hop" for _, state, _ in trajectory.transitions):
        return []
    below = trial.actuator == "motor" and not trial.effects and trial.torque < trial.tipping_torque
    return [say("does_not_tip", most=_degrees(most), why=say("below_tipping", trial=trial) if below else "")]


def _degrees(theta: float) -> str:
    return f"{math.degrees(theta):.3g} degrees"
