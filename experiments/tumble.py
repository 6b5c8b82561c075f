"""`hedgebed tumble`: one trial of the planar model, integrated and written down.

The folder holds trajectory.csv, series/motion.csv (accelerations, wheel, energies), result.json, figures and a report.
"""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

import numpy as np

from hedgebed import __version__
from rigid.planar import PAPER_STEP, check_step, simulate
from rigid.trajectory import Trajectory

from .campaign import read_model
from .kept_platform import keep_platform
from .progress import Progress
from .reporting import write_report
from .runfolder import RunFolder, write_series
from .synthesis import check_tumble_campaign, write_tumble_campaign
from .tips import ball_radius, tip_depth
from .tumble_platform import PlatformNumbers, platform_numbers, torque_within_limit
from .tumble_settings import TumbleSettings
from .tumble_sweep import check_sweep, middle_of_sweep, run_sweep
from .tumble_trial import TumblePlan, plan_tumble
from .tumble_words import stayed_words, tumble_sentences, unsettled_warning
from .whole_runs import whole_run

__all__ = ["check", "motion_columns", "quantities_of", "result_of", "resume", "run", "trajectory_columns"]

MODEL_COPY = "model.toml"
"""The model that was run, in the run's folder; effects of one's own lie beside it."""


def check(settings: TumbleSettings) -> None:
    """Raise ValueError, naming key, value and what would do, for what the settings class cannot see."""
    if settings.ground == "bed":
        from .tumble_grains import check_on_grains  # loads the room of the grains

        check_on_grains(settings)
        return
    check_sweep(settings)
    plan = plan_tumble(middle_of_sweep(settings))
    check_tumble_campaign(settings)
    if settings.method == "paper":
        _check_paper_step(plan)
    if settings.method == "coupled":
        from .tumble_coupled import check_coupled

        check_coupled(settings, plan)
        return
    _integrate(settings, plan, duration=1e-3)


def _check_paper_step(plan: TumblePlan) -> None:
    try:
        check_step(plan.trial, PAPER_STEP)
    except ValueError as error:
        raise ValueError(f"method = 'paper': {error}; method = 'located' would do") from None


def quantities_of(trajectory: Trajectory) -> dict[str, dict[str, Any]]:
    """The numbers that every tumble has, as result.json holds them; a value is null where there is none."""
    angle = "first point 10 mm from the start, atan2(dy, dx); null if never reached"
    entry = "theta at the first entry; null if there is none"
    trial = trajectory.trial
    base = " of the base model, effects left out" if trial.effects else ""
    return {
        "trajectory_angle": _quantity(trajectory.trajectory_angle, "rad", angle),
        "max_speed": _quantity(trajectory.max_speed, "m/s", "of the centre"),
        "time_of_max_speed": _quantity(trajectory.time_of_max_speed, "s", "when the centre is that fast"),
        "max_angular_velocity": _quantity(trajectory.max_angular_velocity, "rad/s", ""),
        "transition_angle_slip": _quantity(trajectory.transition_angle("slip"), "rad", entry),
        "transition_angle_hop": _quantity(trajectory.transition_angle("hop"), "rad", entry),
        "tipping_torque": _quantity(
            trial.tipping_torque, "N m", f"least that tips it where it comes up slowly{base}: W l sin(pi / n), n rows"
        ),
        "slip_torque": _quantity(
            trial.slip_torque,
            "N m",
            f"least that makes it slip at rest where it is there at once{base}: mu_s W (J + m h^2) / (m h), h = "
            f"l cos(pi / n)",
        ),
        "energy_residual": _quantity(
            trajectory.energy_residual,
            "1",
            "largest |E(t) - E(0) - work of the torque + dissipated| over max(|work of the torque|, W l)",
        ),
    } | _tip_sinkage(trajectory)


def _tip_sinkage(trajectory: Trajectory) -> dict[str, dict[str, Any]]:
    """How deep the rows' tips go below the undisturbed surface: on a law its compression there."""
    trial = trajectory.trial
    tips = tip_depth(
        trajectory.theta, trajectory.y, count=trial.spike_count, length=trial.spike_length, radius=ball_radius(trial)
    )
    sinkage = np.maximum(tips, 0.0)
    start = "of the two rows it stands on, mean, when the torque begins"
    return {
        "sinkage_start": _quantity(float(sinkage[0, [0, -1]].mean()), "m", start),
        "sinkage_largest": _quantity(float(sinkage.max()), "m", "of any row, at the times of trajectory.csv"),
    }


def trajectory_columns(trajectory: Trajectory) -> dict[str, Any]:
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


def _quantity(value: float | None, unit: str, note: str) -> dict[str, Any]:
    known = {"value": None, "std": None} if value is None else {"value": float(value), "std": 0.0}
    return known | {"unit": unit} | ({"note": note} if note else {})


def _integrate(settings: TumbleSettings, plan: TumblePlan, *, duration: float) -> tuple[Trajectory, float | None]:
    """The trajectory, and when the wheel comes to its limit [s], where it does."""
    method: Literal["located", "paper"] = "paper" if settings.method == "paper" else "located"
    trial, full = torque_within_limit(
        plan.trial, max_wheel_speed=plan.max_wheel_speed, duration=duration, method=method
    )
    interval = min(settings.sample_interval, duration)
    return simulate(trial, duration=duration, method=method, sample_interval=interval), full


def _carry_out(settings: TumbleSettings, folder: RunFolder, progress: Progress) -> dict[str, Any]:
    if settings.ground == "bed":
        from .tumble_grains import tumble_on_grains

        return tumble_on_grains(settings, folder, progress)
    with folder.lock():
        copied = _keep_model(settings, folder)
        platform = platform_numbers(
            settings.platform, file=keep_platform(settings.platform, folder.path, progress.message)
        )
        middle = middle_of_sweep(settings, model_file=copied, platform=platform)
        plan = plan_tumble(middle, model_file=copied, platform=platform)
        for sentence in plan.sentences():
            progress.message(sentence)
        for warning in plan.warnings:
            progress.message(f"warning: {warning}")
        progress.stage("tumble", total=1.0)
        more: dict[str, Any] = {}
        besides: dict[str, Any] = {}
        warnings: list[str] = []
        if settings.method == "coupled":
            trajectory, full, more, besides, warnings = _step_through_master(settings, plan, folder, progress)
        else:
            trajectory, full = _integrate(settings, plan, duration=settings.duration)
        progress.update(1.0)
        write_series(folder.path / "trajectory.csv", trajectory_columns(trajectory))
        folder.write_series("motion", motion_columns(trajectory))
        result = result_of(settings, plan, trajectory, full)
        result["quantities"] |= more
        result["warnings"] += warnings
        if settings.method == "coupled":
            from .tumble_steppers import words

            result["title"] = words(settings, result["title"])
            result |= besides
        if settings.sweep:
            progress.message("the numbers above are those of one trial of the sweep, in its middle or nearest to it")
            progress.stage("sweep")
            _add_sweep(result, settings, folder, copied, platform)
        made = write_tumble_campaign(settings, plan, folder.path, progress)
        result |= {"campaign": made} if made is not None else {}
        folder.write_result(result)
        progress.stage("report", total=1.0)
        write_report(folder.path, progress)
    return result


def _step_through_master(
    settings: TumbleSettings, plan: TumblePlan, folder: RunFolder, progress: Progress
) -> tuple[Trajectory, float | None, dict[str, Any], dict[str, Any], list[str]]:
    """The trial by the master, series/feet.csv written: `_integrate`'s, `coupled_quantities`' two, its warnings."""
    from .tumble_coupled import coupled_quantities, coupled_tumble, feet_columns
    from .tumble_steppers import own_warning

    run = coupled_tumble(settings, plan, duration=settings.duration)
    trajectory = run.run(on_step=lambda run: progress.update(run.fraction))
    folder.write_series("feet", feet_columns(run))
    quantities, besides = coupled_quantities(run)
    warnings = [said for said in (unsettled_warning(run.master), own_warning(run)) if said]
    return trajectory, run.body.wheel_at_limit, quantities, besides, warnings


def _add_sweep(
    result: dict[str, Any], settings: TumbleSettings, folder: RunFolder, model: Path | None, platform: PlatformNumbers
) -> None:
    """Integrate the sweep and put what came out beside the trial in its middle."""
    swept = run_sweep(settings, folder, model_file=model, platform=platform)
    result["departures"]["sentences"] += swept["sweep"]["sentences"]
    result["title"] += ", one trial of a sweep of " + " and ".join(settings.sweep)
    result |= swept


def _keep_model(settings: TumbleSettings, folder: RunFolder) -> Path | None:
    """Copy the model and the files of its effects into the folder, once; return the copy."""
    if settings.model is None:
        return None
    copy, source = folder.path / MODEL_COPY, Path(settings.model)
    if not copy.exists():
        for effect in getattr(read_model(source), "effect", ()):
            if effect.file is not None:
                target = folder.path / effect.file
                target.parent.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(source.parent / effect.file, target)
        shutil.copyfile(source, copy)
    return copy


def motion_columns(trajectory: Trajectory) -> dict[str, Any]:
    """What else the plots show, by time."""
    columns: dict[str, Any] = {
        "t_s": trajectory.time,
        "ax_m_s2": trajectory.ax,
        "ay_m_s2": trajectory.ay,
        "wheel_speed_rad_s": trajectory.wheel_speed,
    }
    for name, values in _energies(trajectory).items():
        columns[f"{name}_J"] = values
    return columns


def _energies(trajectory: Trajectory) -> Mapping[str, Any]:
    return {
        "kinetic": trajectory.kinetic_energy,
        "potential": trajectory.potential_energy,
        "stored": trajectory.stored_energy,
        "energy": trajectory.energy,
        "torque_work": trajectory.torque_work,
        "dissipated": trajectory.dissipated,
    }


def result_of(settings: TumbleSettings, plan: TumblePlan, trajectory: Trajectory, full: float | None) -> dict[str, Any]:
    """What result.json holds of one trial."""
    trial = plan.trial
    stated = (
        f"rig at {trial.gravity_sim:.4g} m/s2" if trial.counterweight > 0 else f"free at {trial.gravity_sim:.4g} m/s2"
    )
    warnings = list(plan.warnings)
    if full is not None:
        warnings.append(
            f"the wheel comes to its limit, max_wheel_speed = {plan.max_wheel_speed:g} rad/s, at {full:.4g} s: from "
            f"there on the motor has no torque"
        )
    if trajectory.trajectory_angle is None:
        warnings.append(stayed_words(trajectory))
    return {
        "format": "hedgebed-result/1",
        "experiment": "tumble",
        "version": __version__,
        "title": f"A tumble on {plan.surface}: {trial.torque:g} N m, {stated}",
        "status": "done",
        "quantities": quantities_of(trajectory),
        "departures": {"sentences": tumble_sentences(trajectory)},
        "trial": {
            name: {"value": number.value, "unit": number.unit, "origin": number.origin}
            for name, number in plan.numbers.items()
        }
        | {"weight": {"value": trial.weight, "unit": "N", "origin": "(m + m_b) g_sim"}},
        "surface": plan.surface,
        "ground": settings.ground,
        "actuator": settings.actuator,
        "method": trajectory.method,
        "duration": settings.duration,
        "spike_count": trial.spike_count,
        "tip_radius": ball_radius(trial),
        "effects": [{"id": effect.id, "parameters": dict(effect.values)} for effect in trial.effects],
        "wheel_at_limit": full,
        "transitions": [
            {"time": float(time), "state": state, "theta": float(theta)}
            for time, state, theta in trajectory.transitions
        ],
        "warnings": warnings,
    }


run, resume = whole_run("tumble", TumbleSettings, _carry_out, check=check)
