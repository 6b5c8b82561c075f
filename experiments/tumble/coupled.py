"""`hedgebed tumble --method coupled`: the spring-damper, stepped by the coupling's master as a bed of grains is.

The result is that of `rigid.planar.simulate` within its tolerance (docs/coupling.md). This method steps, records and
evaluates a spring-damper as grains, so that only the ground differs between two runs.
"""

from dataclasses import replace

from coupling import CoupledTumble, LawGround
from experiments.grains.bed_result import unsettled_warning
from experiments.runs.folder import RunFolder
from experiments.runs.progress import Progress
from experiments.runs.result import quantities_of
from experiments.runs.types import Json
from rigid.planar.trajectory import Trajectory

from . import say
from .result import result_of, title_of
from .settings import TumbleSettings
from .steppers import own_quantities, own_warning, row_feet, sinkage_start, stepper_of, words
from .trial import TumblePlan

__all__ = ["STEP", "check_coupled", "compute_coupled", "feet_columns", "row_quantities"]

STEP = 4e-5
"""The law's own step [s]: with ten of them every channel is within the planar model's tolerance; at 1 ms omega is off
by twice of that after 0.9 s, as the torque ends with the step in which the last tip lifts off."""


def check_coupled(settings: TumbleSettings, plan: TumblePlan) -> None:
    """Raise ValueError, naming key, value and what is accepted, for a trial that the master cannot step."""
    if plan.trial.ground is not None:
        raise ValueError(say("master_takes", s=settings))
    if other := [effect.id for effect in plan.trial.effects if not effect.term.on_torque_alone]:
        raise ValueError(say("no_effects", named=", ".join(other)))
    step = settings.substeps * STEP
    if step > 1e-3 * (1 + 1e-9):
        raise ValueError(say("long_step", s=settings, step=1e3 * step, most=int(1e-3 / STEP + 1e-9)))


def compute_coupled(
    settings: TumbleSettings, plan: TumblePlan, folder: RunFolder, progress: Progress
) -> tuple[Trajectory, Json]:
    """The trial by the master, series/feet.csv written: the trajectory, and the entries of the result."""
    ground = LawGround.of_trial(plan.trial)
    ground.grounds = [replace(ground, time_step=STEP) for ground in ground.grounds]
    run = stepper_of(
        settings, plan.trial, ground, **settings.stepping(), duration=settings.duration,
        max_wheel_speed=plan.max_wheel_speed, energy_interval=1e-3,
    )  # fmt: skip
    trajectory = run.run(on_step=lambda run: progress.update(run.fraction))
    folder.write_series("feet", feet_columns(run))
    result = result_of(settings, plan, trajectory, run.body.wheel_at_limit)
    own, more = own_quantities(run)
    result["quantities"] |= quantities_of(row_quantities(run, start=say("of_sinkage_start"), ground="ground")) | own
    result["warnings"] += [warning for warning in (unsettled_warning(run.master), own_warning(run)) if warning]
    return trajectory, result | more | {"title": words(settings, title_of(plan))}


def row_quantities(run: CoupledTumble, *, start: str, ground: str) -> dict[str, tuple[float, str, str]]:
    """Sinkage, load and error of the exchange: name -> value, unit, note. `start`: note of the sinkage at the start;
    `ground`: name of the ground in a note."""
    sinkage, load = row_feet(run)
    return {
        "sinkage_start": (sinkage_start(run), "m", start),
        "sinkage_largest": (float(sinkage.max()), "m", say("of_any_row")),
        "largest_row_force": (float(load.max()), "N", say("of_row_force")),
        "exchange_residual": (*run.balance_numbers["exchange_residual"], say("of_exchange", ground=ground)),
    }


def feet_columns(run: CoupledTumble) -> Json:
    """The columns of series/feet.csv: work given and taken; load, friction, slip and sinkage of each row.

    Friction is missing on a law: rows that stick share it, and the law gives only its bound.
    """
    rows, feet = run.columns, run.feet
    sinkage, load = row_feet(run)
    columns: Json = {"t_s": rows["time"], "given_J": rows["given"], "taken_J": rows["taken"]}
    for row in range(run.trial.spike_count):
        columns[f"normal_{row}_N"] = load[:, row]
        if run.ground.gives_friction:
            columns[f"along_{row}_N"] = feet[:, 1, row]
        columns |= {f"slip_{row}_m_s": feet[:, 2, row], f"sinkage_{row}_m": sinkage[:, row]}
    return columns
