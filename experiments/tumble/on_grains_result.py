"""What comes of a tumble on grains: its series, and the result that stands beside the spring-damper's."""

from pathlib import Path
from typing import cast

import numpy as np

from coupling import MOST_REVERSAL, BedGround, CoupledTumble
from dem import Bed, Graded
from dem.prepare.prepare import fingerprint
from experiments.grains.bed_result import (
    bed_numbers,
    bed_warnings,
    overlap_warning,
    residual_warning,
    reversal_warning,
    unsettled_warning,
    write_bed_series,
)
from experiments.grains.graded import coarsest_touched, tips_in_ground
from experiments.grains.softening import Softening
from experiments.platform.surfaces import find_surface
from experiments.runs.folder import RunFolder, write_series
from experiments.runs.result import quantities_of as as_quantities
from experiments.runs.types import Json
from rigid.planar.trajectory import Trajectory
from vis.tumble.beside import HEAD, beside_rows, beside_words

from . import say
from .result import motion_columns, passages, quantities_of, result_of, trajectory_columns
from .settings import TumbleSettings
from .steppers import own_quantities, own_warning, words
from .trial import TumblePlan

__all__ = ["conclude", "sinkage_start", "write_trajectory"]

SERIES = {
    "own": "trajectory.csv", "feet": "series/feet.csv", "bed": "series/bed.csv", "beside": "series/spring-damper.csv",
}  # fmt: skip
FEET = (("normal", "N"), ("along", "N"), ("slip", "m_s"), ("sinkage", "m"))
"""Of each row in series/feet.csv, as `CoupledTumble.feet` has them."""


def write_trajectory(folder: Path, run: CoupledTumble) -> Trajectory:
    """trajectory.csv and the series of a run, as far as it has come."""
    found = run.trajectory()
    (folder / "series").mkdir(exist_ok=True)
    write_series(folder / "trajectory.csv", trajectory_columns(found))
    write_series(folder / "series" / "motion.csv", motion_columns(found))
    rows = run.columns
    columns: Json = {"t_s": rows["time"], "given_J": rows["given"], "taken_J": rows["taken"]}
    for row in range(run.trial.spike_count):
        columns |= {f"{name}_{row}_{unit}": run.feet[:, k, row] for k, (name, unit) in enumerate(FEET)}
    write_series(folder / "series" / "feet.csv", columns)
    write_bed_series(folder, run)
    return found


def conclude(
    settings: TumbleSettings,
    plan: TumblePlan,
    run: CoupledTumble,
    beside: Trajectory,
    softening: Softening,
    folder: RunFolder,
    graded: Graded | None = None,
) -> Json:
    """The result, its series written. `beside`: the trial on the spring-damper; `graded`: the bed's sizes by place."""
    series = write_trajectory(folder.path, run)
    write_series(folder.path / "series" / "spring-damper.csv", trajectory_columns(beside))
    result = result_of(settings, plan, series, run.body.wheel_at_limit)
    bed, spikes = _bed(run), plan.spikes
    result["title"] = words(settings, say("title_on_grains", plan=plan, rest=result["title"].partition(": ")[2]))
    result["code"] = fingerprint()
    added, tables = own_quantities(run, run.feet[:, 3], run.feet[:, 0])
    result["quantities"] |= _own_quantities(run) | added
    result |= tables
    next_to = quantities_of(beside)
    shown = [list(row) for row in beside_rows(result["quantities"], next_to)]
    both = {"title": say("beside_title"), "head": list(HEAD), "rows": shown}
    result["tables"] = [both, *tables.get("tables", [])]
    if settings.drop_speed is None:
        result["departures"]["sentences"].insert(0, beside_words(result["quantities"], next_to))
    if run.losses:
        result["quantities"]["energy_residual"]["note"] += say("residual_with_losses", every=1e3 * run.energy_interval)
    result["grains"] = _grains(settings, plan, run, softening) | {
        "beside": next_to, "beside_transitions": passages(beside)
    }  # fmt: skip
    coarsest, coarser = settings.grain, None
    if graded is not None:
        coarsest = coarsest_touched(run, graded, size=settings.bed_size)
        result["grains"]["graded"] = {
            "fine": graded.fine, "coarse": graded.coarse, "footprints": [list(strip) for strip in graded.footprints],
            "depth": graded.depth, "growth": graded.growth, "coarsest_touched": coarsest,
        }  # fmt: skip
        if coarsest > settings.grain:
            coarser = say("coarser_than_expected", coarsest=1e3 * coarsest, fine=1e3 * settings.grain)
    surface = find_surface(plan.surface)
    warnings = [
        residual_warning(run.energy_residual), reversal_warning(run.dissipation_reversal),
        unsettled_warning(run.master), own_warning(run), overlap_warning(bed, softening, settings.max_overlap),
        _same_sand_again(settings, run, spikes.diameter), coarser,
        *bed_warnings(bed, plan.surface, across=spikes.diameter / coarsest),
        say("law_in_flight", plan=plan) if surface.granular and plan.trial.counterweight == 0 else None,
        say("one_bed") if surface.granular else None,
    ]  # fmt: skip
    result["warnings"] += [warning for warning in warnings if warning]
    return result


def _bed(run: CoupledTumble) -> Bed:
    return cast(BedGround, run.ground).bed


def sinkage_start(run: CoupledTumble) -> float:
    """Mean depth of the two rows that it stands on when the torque begins [m]."""
    return float(run.feet[0, 3, [0, -1]].mean())


def _same_sand_again(settings: TumbleSettings, run: CoupledTumble, spike: float) -> str | None:
    """Where the platform's way on a bed of copies is longer than one of them, in words; `spike`: its diameter [m]."""
    if settings.bed_repeats == 1:
        return None
    piece = settings.bed_size[0]
    x, _ = tips_in_ground(run)
    way = float(np.ptp(x)) + spike if len(x) else 0.0
    if way <= piece:
        return None
    return say("same_sand_again", s=settings, piece=piece, way=way)


def _grains(settings: TumbleSettings, plan: TumblePlan, run: CoupledTumble, softening: Softening) -> Json:
    """The bed and how it was stepped, for ``grains`` of result.json."""
    found = bed_numbers(settings, run, _bed(run), softening, in_rig=plan.trial.counterweight > 0)
    own, whole = found["grain_steps"], found["grain_steps_all_awake"]
    return found | {
        "series": SERIES, "macro_step": run.master.macro_step, "arch": settings.arch, "steps": run.master.count,
        "repeats": settings.bed_repeats, "piece_length": settings.bed_size[0],
        "spike_diameter": plan.spikes.diameter, "spike_clear": plan.spikes.clear,
        "awake_share": own / whole if whole else None,
        "grain_steps_lowering": float(run.samples["grain_steps"][0]),
        "lowering_time": run.placing_steps * run.master.macro_step, "worst_guess": run.master.exchange.worst_guess,
        "largest_force": run.master.exchange.largest_force,
    }  # fmt: skip


def _own_quantities(run: CoupledTumble) -> dict[str, Json]:
    """What a tumble on grains has beyond the planar model's numbers."""
    sinkage = run.feet[:, 3]
    gap = run.columns["given"] - run.columns["taken"]
    found: dict[str, tuple[float, str, str]] = {
        "sinkage_start": (sinkage_start(run), "m", say("of_sinkage_start_on_grains")),
        "sinkage_largest": (float(sinkage.max()), "m", say("of_any_row")),
        "largest_row_force": (float(run.feet[:, 0].max()), "N", say("of_row_force")),
        "exchange_residual": (
            float(np.abs(gap - gap[0]).max()) / run.energy_scale, "1", say("of_exchange", ground="bed")
        ),
        "dissipation_reversal": (run.dissipation_reversal, "1", say("of_reversal", limit=MOST_REVERSAL)),
        "momentum_residual": (float(run.samples["momentum_error"].max()), "N s", say("of_momentum")),
        "angular_momentum_residual": (
            float(run.samples["angular_momentum_error"].max()), "N m s", say("of_angular_momentum"),
        ),
    }  # fmt: skip
    notes = {"damping": say("to_damping"), "friction": say("to_friction"), "rolling": say("to_rolling")}
    for name, values in run.losses.items():
        found[f"dissipated_{name}"] = float(values[-1]), "J", say("dissipated_by_grains", what=notes[name])
    coupled = float(np.abs(run.balance).max()) / run.energy_scale
    found["coupling_residual"] = coupled, "1", say("of_coupling")
    return as_quantities(found, std=None)
