"""`hedgebed tumble --method coupled`: the spring-damper through the coupling's master, as a bed of grains is stepped.

What comes out is that of `rigid.planar` to its tolerance (docs/coupling.md); what it is for is a spring-damper that is
stepped, booked and read as grains are, so that only the ground differs between two runs.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from coupling import CoupledTumble, LawFooting

from .tips import tip_depth
from .tumble_settings import TumbleSettings
from .tumble_steppers import own_quantities, stepper_of
from .tumble_trial import TumblePlan

__all__ = ["check_coupled", "coupled_quantities", "coupled_tumble", "feet_columns", "law_feet"]

STEP = 4e-5
"""The law's own step [s]: with ten of them, the default, every channel is within the planar model's tolerance.

At 1 ms omega is off by twice of that after 0.9 s, as the torque ends with the step in which the last tip lifts off.
"""


def check_coupled(settings: TumbleSettings, plan: TumblePlan) -> None:
    """Raise ValueError, naming key, value and what would do, for a trial that the master cannot step."""
    if settings.ground != "spring-damper":
        raise ValueError(
            f"method = 'coupled' with ground = {settings.ground!r}: the master takes the spring-damper (and "
            f"ground = 'bed', where it is the only method); method = 'located' would do"
        )
    if plan.trial.effects:
        named = ", ".join(effect.id for effect in plan.trial.effects)
        raise ValueError(
            f"method = 'coupled' with effects = {named}: the master has the base model only; method = 'located' would "
            f"do, or no effects"
        )
    step = settings.substeps * STEP
    if step > 1e-3 * (1 + 1e-9):
        raise ValueError(
            f"substeps = {settings.substeps} makes a step of {1e3 * step:g} ms, and trajectory.csv has at least a row "
            f"a millisecond: {int(1e-3 / STEP + 1e-9)} or less would do"
        )


def coupled_tumble(settings: TumbleSettings, plan: TumblePlan, *, duration: float) -> CoupledTumble:
    """The trial on the spring-damper, ready to be stepped."""
    footing = LawFooting.of_trial(plan.trial)
    footing.grounds = [replace(ground, time_step=STEP) for ground in footing.grounds]
    return stepper_of(
        settings, plan.trial, footing, duration=duration, substeps=settings.substeps,
        body_steps=settings.body_steps, extrapolation=settings.extrapolation, iterations=settings.iterations,
        max_wheel_speed=plan.max_wheel_speed, energy_interval=1e-3,
    )  # fmt: skip


def coupled_quantities(run: CoupledTumble) -> tuple[dict[str, dict[str, Any]], dict[str, Any]]:
    """What it has beyond the planar model's numbers; and what a row of tumbles adds to the result besides."""
    sinkage, normal = law_feet(run)
    gap = run.columns["given"] - run.columns["taken"]
    found = {
        "sinkage_start": (
            float(sinkage[0][[0, -1]].mean()), "m", "of the two rows it stands on, mean, when the torque begins",
        ),
        "sinkage_largest": (float(sinkage.max()), "m", "of any row"),
        "largest_row_force": (float(normal.max()), "N", "upwards, mean of one macro step"),
        "exchange_residual": (
            float(np.abs(gap - gap[0]).max()) / run.energy_scale, "1",
            "work that the body gives less what the ground takes, largest, over max(|work of the torque|, W l)",
        ),
    }  # fmt: skip
    own, more = own_quantities(run, sinkage, normal)
    return {
        name: {"value": value, "std": 0.0, "unit": unit, "note": note} for name, (value, unit, note) in found.items()
    } | own, more


def feet_columns(run: CoupledTumble) -> dict[str, Any]:
    """The columns of series/feet.csv: work given and taken; load, slip and sinkage of each row.

    Friction is not among them: rows that stick share it, and the law itself says only how large it may be.
    """
    rows = run.columns
    sinkage, normal = law_feet(run)
    columns: dict[str, Any] = {"t_s": rows["time"], "given_J": rows["given"], "taken_J": rows["taken"]}
    for row in range(run.trial.spike_count):
        columns[f"normal_{row}_N"] = normal[:, row]
        columns[f"slip_{row}_m_s"] = run.feet[:, 2, row]
        columns[f"sinkage_{row}_m"] = sinkage[:, row]
    return columns


def law_feet(run: CoupledTumble) -> tuple[np.ndarray, np.ndarray]:
    """Depth of each row's tip [m], 0 above the surface, and its load [N], shape [step, row] both.

    The load is the mean over the step before; at the start, before any, it is what the spring carries at rest.
    """
    rows, trial = run.columns, run.trial
    depth = tip_depth(rows["theta"], rows["y"], count=trial.spike_count, length=trial.spike_length)
    sinkage = np.maximum(0.0, depth)
    normal = run.feet[:, 0].copy()
    normal[0] = trial.stiffness * sinkage[0]
    return sinkage, normal
