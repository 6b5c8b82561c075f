"""What comes of a tumble on grains: its series, and the result that stands beside the spring-damper's."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from coupling import MOST_REVERSAL, CoupledTumble
from dem import Graded
from dem.materials import caveat
from dem.prepare import fingerprint
from rigid.trajectory import Trajectory
from vis.tumble_beside import HEAD, beside_rows, beside_words

from .bed_graded import coarsest_touched, tips_in_ground
from .runfolder import RunFolder, write_series
from .softening import Softening, stable_overlap
from .surfaces import find_surface
from .tumble_settings import TumbleSettings
from .tumble_steppers import own_quantities, own_warning, words
from .tumble_trial import TumblePlan
from .tumble_words import residual_warning, reversal_warning, unsettled_warning

__all__ = ["conclude", "sinkage_start", "write_trajectory"]

PACKING_OFF = 0.02
"""A bed whose packing differs by more from that at which its grains were calibrated is worth a warning [1]."""


def write_trajectory(folder: Path, run: CoupledTumble) -> Trajectory:
    """trajectory.csv and the series of a run, as far as it has come."""
    from .tumble import motion_columns, trajectory_columns

    found = run.trajectory()
    (folder / "series").mkdir(exist_ok=True)
    write_series(folder / "trajectory.csv", trajectory_columns(found))
    write_series(folder / "series" / "motion.csv", motion_columns(found))
    rows = run.columns
    columns: dict[str, Any] = {"t_s": rows["time"], "given_J": rows["given"], "taken_J": rows["taken"]}
    for row in range(run.trial.spike_count):
        for k, (name, unit) in enumerate((("normal", "N"), ("along", "N"), ("slip", "m_s"), ("sinkage", "m"))):
            columns[f"{name}_{row}_{unit}"] = run.feet[:, k, row]
    write_series(folder / "series" / "feet.csv", columns)
    samples = run.samples
    for name, values in run.losses.items():
        samples[f"{name}_lost"] = values
    units = {"time": "t_s", "momentum_error": "momentum_error_N_s", "grain_steps": "grain_steps"}
    units["angular_momentum_error"] = "angular_momentum_error_N_m_s"
    write_series(folder / "series" / "bed.csv", {units.get(name, f"{name}_J"): v for name, v in samples.items()})
    return found


def conclude(
    settings: TumbleSettings,
    plan: TumblePlan,
    run: CoupledTumble,
    series: Trajectory,
    beside: Trajectory,
    softening: Softening,
    folder: RunFolder,
    graded: Graded | None = None,
) -> dict[str, Any]:
    """The result, its series written. `beside`: the trial on the spring-damper; `graded`: the bed's sizes by place."""
    from .tumble import quantities_of, result_of, trajectory_columns

    write_trajectory(folder.path, run)
    write_series(folder.path / "series" / "spring-damper.csv", trajectory_columns(beside))
    result = result_of(settings, plan, series, run.body.wheel_at_limit)
    bed, books = run.footing.bed, run.master.books  # type: ignore[attr-defined]
    spikes = plan.spikes
    result["title"] = words(settings, f"A tumble on a bed of {plan.surface}: {result['title'].partition(': ')[2]}")
    result["code"] = fingerprint()
    added, tables = own_quantities(run, run.feet[:, 3], run.feet[:, 0])
    result["quantities"] |= _own_quantities(run) | added
    result |= tables
    next_to = quantities_of(beside)
    shown = [list(row) for row in beside_rows(result["quantities"], next_to)]
    both = {"title": "On grains, and on the spring-damper beside", "head": list(HEAD), "rows": shown}
    result["tables"] = [both, *tables.get("tables", [])]
    if settings.drop_speed is None:
        result["departures"]["sentences"].insert(0, beside_words(result["quantities"], next_to))
    if run.losses:
        result["quantities"]["energy_residual"]["note"] += (
            "; also of all together: what the bed holds and what its dashpots, friction and rolling took are measured, "
            f"every {1e3 * run.energy_interval:g} ms (series/bed.csv)"
        )
    if open_books := residual_warning(run.energy_residual):
        result["warnings"].append(open_books)
    result["grains"] = {
        "mode": "rig: grains at 1 g" if plan.trial.counterweight > 0 else "flight: grains at the platform's gravity",
        "series": {
            "own": "trajectory.csv", "feet": "series/feet.csv", "bed": "series/bed.csv",
            "beside": "series/spring-damper.csv",
        },
        "grain_count": int(bed.grain_count), "packing_fraction": float(bed.packing_fraction),
        "surface": float(bed.surface), "young": softening.young, "softer_than_real": softening.factor,
        "time_step": float(bed.time_step), "macro_step": run.master.macro_step,
        "max_overlap": float(bed.max_overlap), "seed": settings.seed, "arch": settings.arch, "steps": run.master.count,
        "repeats": settings.bed_repeats, "piece_length": settings.bed_size[0],
        "spike_diameter": spikes.diameter, "spike_clear": spikes.clear,
        **_grain_steps(settings, run), "worst_guess": books.worst_guess, "largest_force": books.largest_force,
        "beside": next_to,
        "beside_transitions": [
            {"time": float(t), "state": state, "theta": float(theta)}
            for t, state, theta in beside.transitions
        ],
    }  # fmt: skip
    if reversed_ := reversal_warning(run.dissipation_reversal):
        result["warnings"].append(reversed_)
    result["warnings"] += [said for said in (unsettled_warning(run.master), own_warning(run)) if said]
    stable = stable_overlap(bed.material, settings.max_overlap)
    if pressed := softening.overlapping(float(bed.max_overlap), settings.max_overlap, stable):
        result["warnings"].append(pressed)
    if met_again := _same_sand_again(settings, run, spikes.diameter):
        result["warnings"].append(met_again)
    coarsest = settings.grain
    if graded is not None:
        coarsest = coarsest_touched(run, graded, size=settings.bed_size)
        result["grains"]["graded"] = {
            "fine": graded.fine, "coarse": graded.coarse, "footprints": [list(strip) for strip in graded.footprints],
            "depth": graded.depth, "growth": graded.growth, "coarsest_touched": coarsest,
        }  # fmt: skip
        if coarsest > settings.grain:
            result["warnings"].append(
                f"tips were in grains of {1e3 * coarsest:.3g} mm, beyond the spring-damper's footprints, under which "
                f"they have {1e3 * settings.grain:.3g} mm"
            )
    across = spikes.diameter / coarsest
    if across < 10:
        result["warnings"].append(
            f"a spike is {across:.2g} grains across: 10 are wanted for a number to be quoted, 5 for a quick look"
        )
    surface = find_surface(plan.surface)
    if surface.packing is not None and abs(bed.packing_fraction - surface.packing) > PACKING_OFF:
        result["warnings"].append(
            f"the bed's packing fraction is {bed.packing_fraction:.3g}, and its grains ({surface.grains}) were "
            f"calibrated at {surface.packing:g}: what they show is not {plan.surface}"
        )
    if doubt := caveat(bed.material):
        result["warnings"].append(doubt)
    if surface.granular and plan.trial.counterweight == 0:
        result["warnings"].append(
            f"the spring-damper beside has {plan.surface}'s K and C of 1 g, where the strength of grains goes with "
            f"gravity ({plan.trial.gravity_sim:.3g} m/s2), and no hull: it is no forecast of this run"
        )
    if surface.granular:
        result["warnings"].append("one bed of one seed: two valid beds differ, so differences need several seeds")
    return result


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
    return (
        f"bed_repeats = {settings.bed_repeats}: the bed has the same grains every {piece:g} m, and tips came down over "
        f"{way:.3g} m, so the platform met the same sand again; what it did there is no new sample of the bed"
    )


def _grain_steps(settings: TumbleSettings, run: CoupledTumble) -> dict[str, Any]:
    """Grains computed, step by step, since the torque began, and how many there would be with all of them awake."""
    done = run.samples["grain_steps"]
    steps = (run.master.count - run.placing_steps) * settings.substeps
    whole = steps * int(run.footing.bed.grain_count)  # type: ignore[attr-defined]
    own = float(done[-1] - done[0])
    return {
        "sleep": settings.sleep, "grain_steps": own, "grain_steps_all_awake": float(whole),
        "awake_share": own / whole if whole else None, "grain_steps_lowering": float(done[0]),
        "lowering_time": run.placing_steps * run.master.macro_step,
    }  # fmt: skip


def _own_quantities(run: CoupledTumble) -> dict[str, dict[str, Any]]:
    """What a tumble on grains has beyond the planar model's numbers."""
    sinkage = run.feet[:, 3]
    gap = run.columns["given"] - run.columns["taken"]
    found = {
        "sinkage_start": (
            sinkage_start(run), "m",
            "of the two rows it stands on, mean, when the torque begins; a tip above the mean surface counts as 0",
        ),
        "sinkage_largest": (float(sinkage.max()), "m", "of any row"),
        "largest_row_force": (float(run.feet[:, 0].max()), "N", "upwards, mean of one macro step"),
        "exchange_residual": (
            float(np.abs(gap - gap[0]).max()) / run.energy_scale, "1",
            "work that the body gives less what the bed takes, largest, over max(|work of the torque|, W l)",
        ),
        "dissipation_reversal": (
            run.dissipation_reversal, "1",
            "largest fall of the dissipated energy below what it was before, over max(|work of the torque|, W l), at "
            f"the times of series/bed.csv: energy that the bed made beyond what it dissipated; a warning above "
            f"{MOST_REVERSAL:g}",
        ),
        "momentum_residual": (
            float(run.samples["momentum_error"].max()), "N s",
            "largest of body and grains together, less the impulses of gravity and floor",
        ),
        "angular_momentum_residual": (
            float(run.samples["angular_momentum_error"].max()), "N m s",
            "likewise about the tumble's axis, less the moments of weight, wires, floor and wheel, of what crosses the "
            "bed's periodic ends and of sleepers; what the exchange leaves is of first order in the bed's step",
        ),
    }  # fmt: skip
    notes = {
        "damping": "to the dashpots of normal forces", "friction": "to tangential forces, their dashpots included",
        "rolling": "to rolling and twisting resistance",
    }  # fmt: skip
    for name, values in run.losses.items():
        found[f"dissipated_{name}"] = float(values[-1]), "J", f"by the grains {notes[name]}, measured, at the end"
    coupled = float(np.abs(run.balance).max()) / run.energy_scale
    found["coupling_residual"] = (
        coupled,
        "1",
        "energy_residual of platform and exchange alone, what the bed took as given",
    )
    return {
        name: {"value": value, "std": None, "unit": unit, "note": note} for name, (value, unit, note) in found.items()
    }
