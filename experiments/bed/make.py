"""`hedgebed bed make`: a bed prepared as in a laboratory, in a run folder with a report of every stage."""

from dem.contact.timestep import time_step_for
from dem.grains.materials import Material, material
from dem.prepare.prepare import check_options, fingerprint, soft_enough
from experiments.grains.graded import grading_told
from experiments.grains.kept_material import MATERIAL_COPY, keep_material
from experiments.grains.sizes import bond_number, in_grains_of, scaling_told, sizes_table
from experiments.grains.where import check_where
from experiments.runs.folder import RunFolder
from experiments.runs.progress import Progress
from experiments.runs.result import Result, quantity
from experiments.runs.types import Json
from experiments.runs.whole_runs import whole_run

from .settings import GRADED, SPREAD_OUT, BedSettings
from .work import check_name, check_room, finish_bed, prepared_in

__all__ = ["check", "fingerprint", "resume", "run"]


def check(settings: BedSettings) -> None:
    """Raise ValueError, naming key, value and what is allowed, for what machine or material cannot serve."""
    check_name(settings.name)
    check_where(arch=settings.arch, threads=settings.threads, precision=settings.precision)
    check_options(settings.size, settings.grain, settings.gravity, settings.seed, settings.max_overlap)
    graded, local = settings.graded, settings.local
    check_room(settings.size, settings.grain, local, graded)
    sizes = local if graded is None else graded
    stuff = material_of(settings, settings.material)
    young = settings.young or soft_enough(
        stuff, size=settings.size, sizes=sizes, gravity=settings.gravity, max_overlap=settings.max_overlap
    )
    if young > stuff.young:
        raise ValueError(f"young = {young:g} Pa is more than {stuff.name} itself has: at most {stuff.young:g} Pa")
    soft, overlap = stuff.softened(young), settings.max_overlap
    time_step_for(soft, diameter=sizes.bounds[0], max_overlap=overlap, wanted=settings.time_step)


def material_of(settings: BedSettings, name: str) -> Material:
    """The material of that name or file, as the grains of this bed have it."""
    own = material(name)
    if settings.keep == "strength" or own.grain is None:
        return own.for_grain(settings.grain)
    return in_grains_of(own, settings.grain, keep=settings.keep, own=own.grain)


def _carry_out(settings: BedSettings, folder: RunFolder, progress: Progress) -> Result:
    options = settings.model_dump(exclude={"name", "coarse", "keep", "distribution", *SPREAD_OUT, *GRADED})
    graded = settings.graded
    if graded is not None:
        options |= {"grain": graded, "spread": None}
    elif settings.distribution != "uniform":
        options |= {"grain": settings.local, "spread": None}
    with folder.lock():
        name = keep_material(settings.material, folder.path)
        options["material"] = material_of(settings, name)
        prepared = prepared_in(folder, progress, options, name=settings.name)
        assert prepared.bed is not None
        if graded is not None:
            told: Json = grading_told(prepared)
        else:
            told = {"tables": [sizes_table(prepared.bed.grains().radius, settings.local)]}
        own = material(name)
        if own.cohesion != "none":
            now, at = prepared.bed.material, {"diameter": settings.grain, "gravity": settings.gravity}
            bond = quantity(bond_number(now, **at), "1", "pull-off of two grains over one's weight", std=None)
            told.setdefault("quantities", {})["bond_number"] = bond
            if own.grain != settings.grain:
                told.setdefault("warnings", []).append(scaling_told(own, now, **at, keep=settings.keep))
        title = f"A bed of {prepared.recipe['material']['name']}: {' '.join(settings.stages)}"
        return finish_bed(folder, prepared, progress, title=title, name=settings.name, told=told)


run, resume = whole_run("bed make", BedSettings, _carry_out, check=check, material_copy=MATERIAL_COPY)
