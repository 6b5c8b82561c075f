"""Prepares a bed as in a laboratory: through stages of your choice, or by the usual recipe, with a cache of beds."""

import json
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Unpack

from dem.engine import runtime
from dem.engine.core import BedCore
from dem.engine.values import BedFailure
from dem.grains.graded import Graded
from dem.grains.materials import Material
from dem.grains.sizes import Json, Uniform

from .bedfile import load_prepared, save_prepared
from .code import cache_folder, fingerprint
from .laboratory import Laboratory
from .recipe import DENSEST_UNIFORM, Stage, check_packing, check_stages, parse_stage
from .report import B, Prepared
from .specification import (
    BedOptions,
    Specification,
    bound_of_mean,
    check_options,
    kept_in_cache,
    soft_enough,
)

__all__ = ["bound_of_mean", "cache_folder", "check_options", "fingerprint", "prepare_as", "prepare_bed", "soft_enough"]

# More is rained in than is kept, for a level surface: this much higher, and at least this many diameters.
_SURPLUS, _SURPLUS_DIAMETERS = 0.06, 2.0
# What progress calls a stage of ``prepare_bed``.
_LABELS = {"level": "settle", "packing": "tap"}


def prepare_as(
    material: str | Material,
    *,
    stages: Sequence[str | Stage],
    make: type[B] = BedCore,
    keep: str | Path | None = None,
    cache: bool = False,
    progress: Any = None,
    **options: Unpack[BedOptions],
) -> Prepared[B]:
    """A bed that went through these stages, at rest after each of them, or the same one from the cache.

    Args:
        material, make: as for ``prepare_bed``.
        stages: as ``dem.prepare.recipe.parse_stage`` reads them: ``["rain", "fluff", "level", "compact:0.6"]``.
        keep: a file (.npz; a .json comes beside it) where unfinished work is kept every minute and after every stage.
            The next call with it continues from there, bitwise reproducibly.
        cache: whether to look in the cache of ``prepare_bed``, and to leave the bed there, finished or not.
        progress: anything with ``stage(name, total)`` and ``update(done)``, or None; where it has ``show_bed(bed)``
            that is called before each ``update``. A KeyboardInterrupt out of ``update`` stops the preparation where it
            can be continued.
        options: see ``dem.prepare.specification.BedOptions``.

    The rain is more than is wanted, so that a bed that is levelled last has its depth up to a packing fraction of 0.64.
    Raises ValueError: what ``prepare_bed`` refuses; stages that cannot be; a packing, or a slope, that is out of reach;
    both ``keep`` and ``cache``. BedFailure: the bed did not come to rest.
    """
    wanted = Specification.of(material, **options)
    stuff, (x, y, z) = wanted.material, wanted.size
    plan = [parse_stage(stage) if isinstance(stage, str) else stage for stage in stages]
    check_stages(plan, size=wanted.size, grain=wanted.sizes.mean, sizes=wanted.local, cohesive=stuff.cohesion != "none")
    recipe = wanted.recipe() | {"stages": [str(stage) for stage in plan]}
    if cache and keep is not None:
        raise ValueError(f"keep = {str(keep)!r} beside cache: the cache has a place of its own for what is under way")
    dense = DENSEST_UNIFORM if isinstance(wanted.local, Uniform) else 0.70
    volume = (z + _SURPLUS_DIAMETERS * wanted.coarsest) * dense * x * y
    first = wanted.poured(plan[0].value) if plan[0].dry else wanted
    return _prepared(
        wanted, plan, recipe, make=make, first=first, volume=volume, cache=cache, progress=progress,
        keep=None if keep is None else Path(keep),
    )  # fmt: skip


def prepare_bed(
    material: str | Material,
    *,
    packing: float | None = None,
    make: type[B] = BedCore,
    cache: bool = True,
    progress: Any = None,
    **options: Unpack[BedOptions],
) -> B:
    """A bed rained in, levelled and settled under gravity, or the same one from the cache.

    It is the recipe ``rain, level`` of ``prepare_as``, followed by ``packing:...`` where a packing is given. Two things
    differ, so that beds stay bitwise equal to those of earlier versions. Fewer grains rain in. The rain is cut level
    when it is nearly at rest (mean kinetic energy of a grain below 1e-2 m g d). There are no reports.

    Args:
        material: a name, the file of a material or a Material. Where it states for which grains its surface energy
            holds, that is converted to these grains (``Material.for_grain``).
        packing: bulk packing fraction [1]; the bed is tapped until it is reached, and where it is denser than that
            loosened from below first. As rained when None.
        make: the class of the bed; ``dem.Bed.prepare`` passes its own.
        cache: whether to look in the cache, and to leave the bed there. What is unfinished is kept there every minute,
            and the next call continues from it.
        progress, options: as for ``prepare_as``.

    The grains fall as a loose column from rest. They come to rest in a drag, which replaces the long ringing of a soft
    bed. Then the grains above the level are removed, and the others settle again, at the end without drag. Settled
    means: mean kinetic energy of a grain below 1e-5 m g d, and floor force within 1 % of the weight. Raises ValueError:
    an unknown material; a size or grain that is not positive; grains too large for the bed; a time step too long. Also
    for a spread outside 0 to 0.5 or beside a distribution, and for a packing that cannot be reached. BedFailure: the
    bed did not come to rest.
    """
    wanted = Specification.of(material, **options)
    sizes, (x, y, z) = wanted.sizes, wanted.size
    plan = [Stage("rain", by="rough"), Stage("level")]
    if packing is not None:
        check_packing(packing, wanted.local, cohesive=wanted.material.cohesion != "none")
        plan.append(Stage("packing", packing))
    recipe = wanted.recipe() | {
        "grain": float(sizes.mean),
        "spread": sizes.spread if isinstance(sizes, Uniform) else None,
        "packing": packing,
    }
    volume = 0.60 * max(z * (1 + _SURPLUS), z + _SURPLUS_DIAMETERS * wanted.coarsest) * x * y
    return _prepared(
        wanted, plan, recipe, make=make, first=wanted, volume=volume, cache=cache, progress=progress, plain=True
    ).whole


def _prepared(
    wanted: Specification,
    plan: list[Stage],
    recipe: Json,
    *,
    make: type[B],
    first: Specification,
    volume: float,
    cache: bool,
    progress: Any,
    keep: Path | None = None,
    plain: bool = False,
) -> Prepared[B]:
    """The bed from the cache, or made of what ``first`` rains, ``volume`` of solid [m3]; ``plain``: without reports."""
    runtime.start(arch=wanted.arch, threads=wanted.threads, precision=wanted.precision)
    own = wanted.material.softened(wanted.young)
    shelf, unfinished = kept_in_cache(recipe)
    if cache:
        keep = unfinished
        if shelf.exists():
            try:
                found = load_prepared(shelf, arch=wanted.arch, threads=wanted.threads, make=make)
            except ValueError as problem:
                warnings.warn(f"the cached bed {shelf.name} cannot be read and is made anew: {problem}", stacklevel=3)
            else:
                found.whole.material, found.whole.recipe = own, found.recipe or recipe
                return found
    work = Laboratory(
        first.rain(volume, make),
        stages=plan,
        grain=wanted.sizes.mean,
        progress=progress,
        path=keep,
        recipe=recipe,
        graded=wanted.sizes if isinstance(wanted.sizes, Graded) else None,
        sticking=(own, wanted.floor),
        labels=_LABELS if plain else None,
    )
    work.find(arch=wanted.arch, threads=wanted.threads)
    try:
        bed = work.run()
    except BedFailure as failure:
        if not plain:
            raise
        kept = work.bed.save(cache_folder() / "failed" / shelf.name)
        raise BedFailure(f"{failure.reason}; the bed at that time is in {kept}") from None
    prepared = Prepared(wanted.finish(bed, recipe), recipe, work.reports)
    if cache:
        try:
            if plain:
                bed.save(shelf)
                shelf.with_suffix(".json").write_text(json.dumps(recipe, indent=1))
            else:
                save_prepared(prepared, shelf)
        except OSError as problem:
            warnings.warn(f"the bed could not be kept in the cache: {problem}", stacklevel=3)
        else:
            work.forget()
    return prepared
