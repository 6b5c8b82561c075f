"""`hedgebed bed refine`: the same bed with smaller grains, and how it differs from the one it was made from.

Its stages are those of the bed, then the packing fraction that the bed had; a cut or a tilt come after that.
"""

from dataclasses import replace

from dem.grains.graded import Graded
from dem.grains.materials import Facing, Material, of_before
from dem.grains.sizes import LogNormal, Normal, Sieve, Sizes, Uniform
from dem.prepare.bedfile import find_bed, read_preparation
from dem.prepare.prepare import check_options
from dem.prepare.recipe import check_stages, parse_stage
from dem.prepare.report import Prepared
from experiments.grains.graded import grading_told
from experiments.grains.sizes import KEPT, in_grains_of
from experiments.grains.where import check_where
from experiments.runs.folder import RunFolder
from experiments.runs.progress import Progress
from experiments.runs.result import Result
from experiments.runs.types import Json
from experiments.runs.whole_runs import whole_run

from .settings import BedRefineSettings, say
from .work import check_name, check_room, finish_bed, prepared_in

__all__ = ["check", "refined_options", "resume", "run"]


def refined_options(settings: BedRefineSettings) -> tuple[Json, Prepared]:
    """The options of `dem.prepare.prepare.prepare_as` for the finer bed, and what is known of the coarse one.

    Raises ValueError for what is no bed, a bed whose preparation is not known, and grains that are not smaller.
    """
    coarse = read_preparation(find_bed(settings.bed))
    if not coarse.reports:
        raise ValueError(say("unknown_preparation", s=settings))
    recipe = coarse.recipe
    sizes = _sizes(recipe["sizes"])
    grain = 0.5 * sizes.mean if settings.grain is None else settings.grain
    if not grain < sizes.mean:
        raise ValueError(f"grain = {grain:g} m is not smaller than the bed's, {sizes.mean:.6g} m: use a smaller one")
    share = grain / sizes.mean
    stuff = of_before(Material(**recipe["material"]))
    if stuff.cohesion != "none":
        stuff = in_grains_of(stuff, grain, keep=settings.keep, own=sizes.mean)
    last = [stage for stage in recipe["stages"] if stage.partition(":")[0] in ("cut", "tilt")]
    first = [stage for stage in recipe["stages"] if stage not in last]
    # Once grains stick nothing brings them closer: what was poured without adhesion comes to its packing before.
    if "stick" in first:
        last = [*first[first.index("stick") :], *last]
        first = first[: first.index("stick")]
    levelled = first[-1] if first[-1].partition(":")[0] == "level" else None
    # Before it was levelled: a shallow bed's packing is read lower, its floor and surface weighing in it.
    before = coarse.reports[len(first) - (1 if levelled is None else 2)]
    packing = f"packing:{before.packing_fraction:.4f}"
    middle = [packing] if levelled is None else [packing, levelled]
    stages = [*(first if levelled is None else first[:-1]), *middle, *last]
    options = {
        "material": stuff,
        "stages": stages,
        "size": tuple(recipe["size"]),
        "grain": _scaled(sizes, share),
        "seed": recipe["seed"] if settings.seed is None else settings.seed,
        "threads": settings.threads,
    } | {key: recipe[key] for key in ("gravity", "max_overlap", "precision", "arch")}
    if recipe["floor"] is not None:
        options["floor"] = Facing(**recipe["floor"])
    return options, coarse


def _sizes(described: Json) -> Sizes | Graded:
    if described["kind"] == "Graded":
        return Graded.of(described)
    kinds = {"Uniform": Uniform, "Normal": Normal, "LogNormal": LogNormal, "Sieve": Sieve}
    return kinds[described["kind"]](**{key: value for key, value in described.items() if key != "kind"})


def _scaled(sizes: Sizes | Graded, share: float) -> Sizes | Graded:
    if isinstance(sizes, Graded):
        return replace(sizes, fine=sizes.fine * share, coarse=sizes.coarse * share)
    if isinstance(sizes, Sieve):
        return replace(sizes, scale=sizes.scale * share)
    return replace(sizes, mean=sizes.mean * share)


def check(settings: BedRefineSettings) -> None:
    """Raise ValueError, naming key, value and what is allowed, for what cannot be refined, or not on this machine."""
    check_name(settings.name)
    options, _ = refined_options(settings)
    check_where(arch=options["arch"], threads=settings.threads, precision=options["precision"])
    sizes: Sizes | Graded = options["grain"]
    check_options(options["size"], sizes.mean, options["gravity"], options["seed"], options["max_overlap"])
    graded, local = (sizes, sizes.local) if isinstance(sizes, Graded) else (None, sizes)
    if graded is not None:
        graded.check(options["size"])
    check_room(options["size"], sizes.mean, local, graded)
    check_stages(
        [parse_stage(stage) for stage in options["stages"]], size=options["size"], grain=sizes.mean, sizes=local,
        cohesive=options["material"].cohesion != "none",
    )  # fmt: skip


def _carry_out(settings: BedRefineSettings, folder: RunFolder, progress: Progress) -> Result:
    options, coarse = refined_options(settings)
    with folder.lock():
        prepared = prepared_in(folder, progress, options, name=settings.name)
        old, new = coarse.reports[-1], prepared.reports[-1]
        rows = [
            [words, f"{was:.4g}", f"{now:.4g}", f"{100 * (now / was - 1):+.1f} %"]
            for words, was, now in (
                ("mean diameter [mm]", 1e3 * _sizes(coarse.recipe["sizes"]).mean, 1e3 * options["grain"].mean),
                ("grains", old.grain_count, new.grain_count),
                ("packing fraction", old.packing_fraction, new.packing_fraction),
                ("contacts of a grain", old.coordination_number, new.coordination_number),
                ("horizontal over vertical stress", old.pressure_ratio or float("nan"), new.pressure_ratio or 0.0),
                ("surface [mm]", 1e3 * old.surface, 1e3 * new.surface),
            )
        ]
        table = {"title": "Compared with the original bed", "head": ["", "before", "now", "change"], "rows": rows}
        stuff, (kept, _) = options["material"], KEPT[settings.keep]
        said = [f"the grains' {kept} is kept: surface_energy = {stuff.surface_energy:.4g} J/m2"]
        told = grading_told(prepared) if isinstance(options["grain"], Graded) else {}
        title = f"{settings.bed} with grains of {1e3 * options['grain'].mean:.4g} mm"
        told |= {
            "tables": [table, *told.get("tables", [])],
            "warnings": [*(said if stuff.cohesion != "none" else []), *told.get("warnings", [])],
        }
        return finish_bed(folder, prepared, progress, title=title, name=settings.name, told=told)


run, resume = whole_run("bed refine", BedRefineSettings, _carry_out, check=check)
