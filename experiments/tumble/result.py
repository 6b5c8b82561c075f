"""The result of one tumble: its quantities, the columns of its series, and what result.json holds."""

import numpy as np

from experiments.platform.tips import ball_radius, tip_depth
from experiments.runs.result import quantity
from experiments.runs.types import Json
from rigid.planar.trajectory import Trajectory

from . import say
from .settings import TumbleSettings
from .trial import TumblePlan
from .words import stayed_words, tumble_sentences

__all__ = ["motion_columns", "passages", "quantities_of", "result_of", "title_of", "trajectory_columns"]


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
    """What else the plots show, by time."""
    columns: Json = {
        "t_s": trajectory.time,
        "ax_m_s2": trajectory.ax,
        "ay_m_s2": trajectory.ay,
        "wheel_speed_rad_s": trajectory.wheel_speed,
    }
    energies = {
        "kinetic": trajectory.kinetic_energy, "potential": trajectory.potential_energy,
        "stored": trajectory.stored_energy, "energy": trajectory.energy, "torque_work": trajectory.torque_work,
        "dissipated": trajectory.dissipated,
    }  # fmt: skip
    return columns | {f"{name}_J": values for name, values in energies.items()}


def passages(trajectory: Trajectory) -> list[Json]:
    """The changes of state, as result.json holds them."""
    return [{"time": float(t), "state": state, "theta": float(theta)} for t, state, theta in trajectory.transitions]


def title_of(plan: TumblePlan) -> str:
    """The title of a tumble's result."""
    return say("title", plan=plan, where="rig" if plan.trial.counterweight > 0 else "free")


def result_of(settings: TumbleSettings, plan: TumblePlan, trajectory: Trajectory, full: float | None) -> Json:
    """The entries of the result of one trial; what ran it adds its own."""
    trial, warnings = plan.trial, list(plan.warnings)
    if full is not None:
        warnings.append(say("wheel_at_limit", limit=plan.max_wheel_speed, when=full))
    if trajectory.trajectory_angle is None:
        warnings.append(stayed_words(trajectory))
    return {
        "title": title_of(plan),
        "status": "done",
        "quantities": quantities_of(trajectory),
        "departures": {"sentences": tumble_sentences(trajectory)},
        "trial": plan.trial_table(trial.weight),
        "surface": plan.surface,
        "ground": settings.ground,
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
