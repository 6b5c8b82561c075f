"""`hedgebed bed make`: a bed prepared as in a laboratory, in a run folder with a report of every stage."""

from __future__ import annotations

from typing import Any

from .bed_graded import grading_told
from .bed_settings import GRADED, BedSettings
from .bed_work import check_memory, check_name, finish_bed, prepared_in
from .kept_material import MATERIAL_COPY, keep_material
from .progress import Progress
from .runfolder import RunFolder
from .whole_runs import whole_run

__all__ = ["check", "fingerprint", "resume", "run"]


def check(settings: BedSettings) -> None:
    """Raise ValueError, naming key, value and what would do, for what this machine or the material cannot serve."""
    from dem.materials import material
    from dem.prepare import check_options, soft_enough
    from dem.sizes import Uniform
    from dem.timestep import time_step_for

    check_name(settings.name)
    check_options(settings.size, settings.grain, settings.gravity, settings.seed, settings.max_overlap)
    graded = settings.sizes
    share = 1.0 if graded is None else graded.share(settings.size)
    check_memory(settings.size, settings.grain, settings.spread, share=share)
    sizes = Uniform(settings.grain, settings.spread) if graded is None else graded
    stuff = material(settings.material, grain=settings.grain)
    young = settings.young or soft_enough(
        stuff, size=settings.size, sizes=sizes, gravity=settings.gravity, max_overlap=settings.max_overlap
    )
    if young > stuff.young:
        raise ValueError(f"young = {young:g} Pa is more than {stuff.name} itself has: at most {stuff.young:g} Pa")
    time_step_for(
        stuff.softened(young),
        diameter=sizes.bounds[0],
        max_overlap=settings.max_overlap,
        wanted=settings.time_step,
    )


def fingerprint() -> str:
    """A digest of the code that computes beds: other code may give other bits."""
    from dem.prepare import fingerprint as of_dem

    return of_dem()


def _carry_out(settings: BedSettings, folder: RunFolder, progress: Progress) -> dict[str, Any]:
    options = settings.model_dump(exclude={"name", "coarse", *GRADED})
    if (graded := settings.sizes) is not None:
        options |= {"grain": graded, "spread": None}
    with folder.lock():
        options["material"] = keep_material(settings.material, folder.path)
        prepared = prepared_in(folder, progress, options, name=settings.name)
        told = {} if graded is None else grading_told(prepared)
        title = f"A bed of {prepared.recipe['material']['name']}: {' '.join(settings.stages)}"
        return finish_bed(folder, prepared, progress, experiment="bed make", title=title, name=settings.name, **told)


run, resume = whole_run("bed make", BedSettings, _carry_out, check=check, material_copy=MATERIAL_COPY)
