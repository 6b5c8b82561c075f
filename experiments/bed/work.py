"""What `bed make` and `bed refine` share: the preparation with its progress, the run folder, the result."""

from collections.abc import Callable, Mapping
from dataclasses import asdict
from typing import Any

import numpy as np

from dem import Bed
from dem.grains.graded import Graded
from dem.grains.materials import caveat
from dem.grains.sizes import Sizes
from dem.prepare.bedfile import load_prepared, save_prepared, shelf_path
from dem.prepare.prepare import prepare_as
from dem.prepare.report import Prepared, StageReport
from experiments.grains.bed_progress import Stages
from experiments.grains.sizes import expected_grain_count
from experiments.grains.where import check_memory
from experiments.runs.folder import RunFolder
from experiments.runs.progress import Progress
from experiments.runs.result import Result, quantities_of
from experiments.runs.stopping import held_back
from experiments.runs.types import Json
from experiments.runs.whole_runs import publish
from rigid.checks.unfit import UnfitSettingsError

from .settings import say
from .tests import table, write_frame

__all__ = ["check_name", "check_room", "finish_bed", "prepared_in"]

_COSTS = {"rain": 3.0, "level": 1.0, "fluff": 3.0, "compact": 6.0, "packing": 6.0, "cut": 2.0, "tilt": 2.0}
"""What a stage costs beside others; guesses, for the time that is shown."""


def check_room(size: tuple[float, float, float], grain: float, local: Sizes, graded: Graded | None) -> None:
    """Raise ValueError for more grains, of the sizes `local` or by place where `graded`, than there is memory for."""
    share = (1.0 if graded is None else graded.share(size)) * grain**3 / local.mean_cube
    check_memory(1.2 * share * expected_grain_count(size, grain, 0.0), grain, "size")


def check_name(name: str | None) -> None:
    """Raise ValueError for a name that a bed cannot have, or that one on the shelf has already."""
    if name is not None and shelf_path(name).exists():
        raise ValueError(
            f"name = {name!r} is taken: {shelf_path(name)} is there already; another name, or take that file away first"
        )


def prepared_in(folder: RunFolder, progress: Progress, options: Mapping[str, Any], *, name: str | None) -> Prepared:
    """The bed of the run: prepared now, gone on with, or that of bed.npz, where it is finished.

    Raises RuntimeError where it cannot be made as asked for.
    """
    file = folder.path / "bed.npz"
    if folder.is_done("bed"):
        return load_prepared(file, threads=options.get("threads"), make=Bed)
    stages = list(options["stages"])
    costs: dict[str, float] = {}
    for stage in stages:
        costs[stage] = costs.get(stage, 0.0) + _COSTS.get(stage.partition(":")[0], 1.0)
    progress.plan(costs, seconds={"report": 10.0})
    keep = folder.path / "checkpoint" / "bed.npz"
    keep.parent.mkdir(exist_ok=True)
    try:
        with held_back() as asked_to_stop:
            prepared = prepare_as(**options, make=Bed, progress=Stages(progress, asked_to_stop), keep=keep)
    except ValueError as error:  # found while it was prepared, as a packing that cannot be reached
        raise UnfitSettingsError(str(error)) from error
    save_prepared(prepared, file)
    if name is not None:
        save_prepared(prepared, shelf_path(name))
    folder.mark_done("bed", {"name": name})
    for kept in (keep, keep.with_suffix(".json")):
        kept.unlink(missing_ok=True)
    return prepared


def finish_bed(
    folder: RunFolder, prepared: Prepared, progress: Progress, *, title: str, name: str | None, told: Json
) -> Result:
    """Write series, frame, result and report of a prepared bed; return the result.

    ``told``: further tables, warnings and quantities, each where there are any.
    """
    bed, last = prepared.bed, prepared.reports[-1]
    assert bed is not None
    entries, reports = [], prepared.reports
    for k, report in enumerate(reports, start=1):
        safe = f"{k}-{report.stage.replace(':', '-').replace('@', '-')}"
        columns = {f"{key}_{_UNITS[key]}" if _UNITS[key] else key: np.array(v) for key, v in report.profile.items()}
        entry = {key: value for key, value in asdict(report).items() if key != "profile"}
        entries.append(entry | {"series": folder.write_series(safe, columns)})
        if "trace" in report.notes:
            trace = np.array(report.notes["trace"])
            what = {"pass": np.arange(len(trace)), "packing": trace}
            entries[-1]["trace_series"] = folder.write_series(f"{safe}.passes", what)
    write_frame(folder, "bed", bed)
    own = {
        "packing_fraction": (last.packing_fraction, "1", "between two diameters above the floor and two below"),
        "coordination_number": (last.coordination_number, "1", "contacts of a grain, the floor's included"),
        "surface": (last.surface, "m", "height where the packing falls to half"),
        "pressure_ratio": (last.pressure_ratio, "1", "horizontal over vertical stress, away from the ends"),
        "kinetic_energy": (last.kinetic_energy, "1", "mean of a grain, over m g d"),
        "floor_share": (last.floor_share, "1", "what the floor carries over the weight"),
        "loosest": (min(r.packing_fraction for r in reports), "1", "packing after any stage"),
        "densest": (max(r.packing_fraction for r in reports), "1", "packing after any stage"),
        "grain_count": (last.grain_count, "1", "grains"),
        "young": (prepared.recipe["young"], "Pa", "of the grains, softened"),
        "time_step": (bed.time_step, "s", "of the grains"),
        "max_overlap": (max(r.max_overlap for r in reports), "1", "while it was made, over diameter"),
    }
    result = Result.make(
        folder.command,
        code=prepared.recipe["code"],
        title=title,
        quantities=quantities_of(own, std=None) | told.get("quantities", {}),
        stages=entries,
        tables=[table("Stage by stage", reports, _STAGE), *told.get("tables", [])],
        bed={"file": "bed.npz", "name": name, "surface": {"value": bed.surface, "unit": "m"}, **prepared.recipe},
        warnings=[*told.get("warnings", []), *_warnings(prepared)],
    )
    return publish(folder, result, progress)


_UNITS = {"height": "m", "packing": "", "stress_zz": "Pa", "stress_xx": "Pa", "stress_yy": "Pa", "stress_xz": "Pa"}
_STAGE: dict[str, Callable[[StageReport], str]] = {
    "stage": lambda report: report.stage,
    "packing": lambda report: f"{report.packing_fraction:.4f}",
    "contacts": lambda report: f"{report.coordination_number:.2f}",
    "K": lambda report: "-" if report.pressure_ratio is None else f"{report.pressure_ratio:.2f}",
    "surface [mm]": lambda report: f"{1e3 * report.surface:.4g}",
    "grains": lambda report: str(report.grain_count),
    "energy [m g d]": lambda report: f"{report.kinetic_energy:.1e}",
    "floor / weight": lambda report: f"{report.floor_share:.4f}",
}
"""Columns of the table of stages."""


def _warnings(prepared: Prepared) -> list[str]:
    bed = prepared.bed
    assert bed is not None
    said = []
    grain = 2 * float(bed.grains().radius.mean())
    if min(bed.size[:2]) < 10 * grain:
        said.append(say("few_grains_wide", grains=min(bed.size[:2]) / grain))
    if prepared.reports[-1].surface < 8 * grain:
        said.append(say("few_grains_deep", grains=prepared.reports[-1].surface / grain))
    if doubt := caveat(bed.material):
        said.append(doubt)
    return said
