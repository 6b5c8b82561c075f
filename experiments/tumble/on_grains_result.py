"""Output of a tumble on grains: frames, series, and the result beside that of the spring-damper."""

import math
from dataclasses import asdict
from pathlib import Path
from typing import cast

import numpy as np
from numpy.typing import NDArray

from coupling import MOST_REVERSAL, BedGround, CoupledTumble
from coupling.members import HULL
from dem import Graded
from dem.measure.grading import measure_grading
from dem.prepare.prepare import fingerprint
from experiments.grains import bed_result as grains
from experiments.grains.graded import (
    coarsest_touched,
    graded_quantities,
    grading_warning,
    tips_in_ground,
    unmatched_warning,
)
from experiments.grains.softening import Softening
from experiments.grains.tracked_frames import PlatformFrames, member_mesh
from experiments.platform.surfaces import find_surface
from experiments.runs.folder import write_series
from experiments.runs.result import quantities_of as as_quantities
from experiments.runs.types import Json
from rigid.planar.trajectory import Trajectory
from rigid.platform.solids import Mesh, merge
from rigid.spatial.quaternions import to_matrix
from vis.tumble.beside import HEAD, beside_rows, beside_words

from . import say
from .coupled import feet_columns, row_quantities
from .result import motion_columns, passages, quantities_of, result_of, trajectory_columns
from .settings import TumbleSettings
from .steppers import own_quantities, own_warning, words
from .trial import TumblePlan

__all__ = ["TumbleFrames", "conclude", "write_trajectory"]

SERIES = {
    "own": "trajectory.csv", "feet": "series/feet.csv", "bed": "series/bed.csv", "beside": "series/spring-damper.csv",
}  # fmt: skip
Array = NDArray[np.float64]


class TumbleFrames(PlatformFrames[CoupledTumble]):
    """The slice on the bed: one spike a row and the hull's cylinder; `row_forces` are of all spikes of a row."""

    def body_meshes(self, run: CoupledTumble) -> dict[str, Mesh]:
        parts = {
            name: [member_mesh(member, segments=24) for member in _ground(run).members if (member.row == HULL) == hull]
            for name, hull in (("spikes", False), ("hull", True))
        }
        return {name: merge(meshes) for name, meshes in parts.items() if meshes}

    def values(self, run: CoupledTumble) -> dict[str, float]:
        """The angle, and the ground's force on the platform [N]."""
        force = run.master.wrench.force
        return {"theta_deg": math.degrees(float(run.body.place[2])), "force_x": force[0], "force_z": force[2]}

    def row_forces(self, run: CoupledTumble, origin: Array) -> tuple[Array, dict[str, Array]]:
        """At the lowest points of the rows that touch: means of the last macro step."""
        pose = run.body.pose
        place, turn = origin + pose.position, to_matrix(pose.turn).T
        members = {member.row: member for member in _ground(run).members}
        normal, along, _, _ = run.feet[-1]
        rows = np.flatnonzero(normal)
        touching = [members[int(row)] for row in rows]
        at = [place + member.at @ turn - [0.0, 0.0, member.radius] for member in touching]
        force = np.column_stack([along[rows], np.zeros(len(rows)), normal[rows]])
        return np.array(at).reshape(-1, 3), {"force": force, "row": rows.astype(float)}


def _ground(run: CoupledTumble) -> BedGround:
    return cast(BedGround, run.ground)


def write_trajectory(run: CoupledTumble, folder: Path) -> Trajectory:
    """trajectory.csv and the series of a run, as far as it has come."""
    found = run.trajectory()
    write_series(folder / "trajectory.csv", trajectory_columns(found))
    write_series(folder / "series" / "motion.csv", motion_columns(found))
    write_series(folder / "series" / "feet.csv", feet_columns(run))
    grains.write_bed_series(folder, run)
    return found


def conclude(
    settings: TumbleSettings,
    plan: TumblePlan,
    run: CoupledTumble,
    beside: Trajectory,
    softening: Softening,
    folder: Path,
    graded: Graded | None = None,
) -> Json:
    """The result, its series written. `beside`: the trial on the spring-damper; `graded`: the bed's sizes by place."""
    series = write_trajectory(run, folder)
    write_series(folder / "series" / "spring-damper.csv", trajectory_columns(beside))
    result = result_of(settings, plan, series, run.body.wheel_at_limit)
    bed, spikes = _ground(run).bed, plan.spikes
    result["title"] = words(settings, say("title_on_grains", plan=plan, rest=result["title"].partition(": ")[2]))
    result["code"] = fingerprint()
    added, tables = own_quantities(run)
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
    coarsest, coarser, lies = settings.grain, None, None
    if graded is not None:
        found = asdict(measure_grading(bed, graded))
        result["quantities"] |= graded_quantities([found])
        lies = grading_warning(found, after=" at the end")
        coarsest = coarsest_touched(run, graded, size=settings.bed_size)
        result["grains"]["graded"] = {
            "fine": graded.fine, "coarse": graded.coarse, "footprints": [list(strip) for strip in graded.footprints],
            "depth": graded.depth, "growth": graded.growth, "coarsest_touched": coarsest,
        }  # fmt: skip
        if coarsest > settings.grain:
            coarser = say("coarser_than_expected", coarsest=1e3 * coarsest, fine=1e3 * settings.grain)
    surface = find_surface(plan.surface)
    warnings = [
        grains.residual_warning(run.energy_residual), grains.reversal_warning(run.dissipation_reversal),
        grains.unsettled_warning(run.master), own_warning(run),
        grains.overlap_warning(bed, softening, settings.max_overlap),
        _same_sand_again(settings, run, spikes.diameter), coarser, lies,
        unmatched_warning(graded, bed.material, stages=settings.bed_stages),
        *grains.bed_warnings(bed, plan.surface, across=spikes.diameter / coarsest),
        say("law_in_flight", plan=plan) if surface.granular and plan.trial.counterweight == 0 else None,
        say("one_bed") if surface.granular else None,
    ]  # fmt: skip
    result["warnings"] += [warning for warning in warnings if warning]
    return result


def _same_sand_again(settings: TumbleSettings, run: CoupledTumble, spike: float) -> str | None:
    """Warning of a way on a bed of copies that is longer than one copy; `spike`: its diameter [m]."""
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
    found = grains.bed_numbers(settings, run, _ground(run).bed, softening, in_rig=plan.trial.counterweight > 0)
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
    """Quantities of a tumble on grains that the planar model does not have."""
    numbers = run.balance_numbers
    found = row_quantities(run, start=say("of_sinkage_start_on_grains"), ground="bed")
    notes = {
        "dissipation_reversal": say("of_reversal", limit=MOST_REVERSAL), "momentum_residual": say("of_momentum"),
        "angular_momentum_residual": say("of_angular_momentum"),
        **{f"dissipated_{name}": say("dissipated_by_grains", what=say(f"to_{name}")) for name in run.losses},
        "coupling_residual": say("of_coupling"),
    }  # fmt: skip
    return as_quantities(found | {name: (*numbers[name], note) for name, note in notes.items()}, std=None)
