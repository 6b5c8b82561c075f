"""Prepares a bed as in a laboratory: rain the grains in, let them settle, level the surface, settle again.

Prepared beds are kept in a cache, keyed by everything that shaped them, so nobody waits for the same rain twice.
"""

from __future__ import annotations

import functools
import hashlib
import json
import math
import os
import warnings
from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from . import runtime
from .bed import Bed, BedFailure
from .graded import Graded
from .grading import measure_grading, surface_under
from .materials import Facing, Material
from .materials import material as find_material
from .packing import RAIN_COLUMN, draw_radii, rain_column, rain_positions
from .recipe import check_packing
from .sizes import Sizes, Uniform, describe, sizes_of
from .stages import Preparation
from .timestep import choose_young

__all__ = [
    "BEARING",
    "Specification",
    "bound_of_mean",
    "cache_folder",
    "check_options",
    "fingerprint",
    "prepare_bed",
    "soft_enough",
]

_EXPECTED_PACKING = 0.57
# Penetration resistance of sand grows with depth about sixty times as fast as its overburden (3D-RFT, Agarwal et al.
# 2023: 0.9 MN/m3 at mu = 0.5 against 16 kN/m3); a bed is made for a tip that may go half its depth.
BEARING = 30.0
# A grain that strikes the floor at the end of its fall does the bed no harm: until it is made, this is allowed.
_RAIN_OVERLAP = 0.05
# Smallest over mean diameter of the sizes with which ``CHAIN`` was measured.
_NARROW = 0.85
# More is rained in than is kept: this much higher, and at least this many diameters.
_SURPLUS, _SURPLUS_DIAMETERS = 0.06, 2.0


def cache_folder() -> Path:
    """Where prepared beds are kept: ``HEDGEBED_CACHE``, or ~/.cache/hedgebed."""
    given = os.environ.get("HEDGEBED_CACHE")
    return Path(given).expanduser() if given else Path.home() / ".cache" / "hedgebed"


@dataclass(frozen=True, kw_only=True)
class Specification:
    """What a bed is rained from: the options that every preparation takes, checked, and chosen where left open.

    Attributes:
        material: as given; ``young`` is the softened grains' modulus [Pa].
        size: lateral periods and depth [m]. sizes: of the grains.

    The others are as in ``prepare_bed``.
    """

    material: Material
    size: tuple[float, float, float]
    sizes: Sizes | Graded
    gravity: float
    seed: int
    young: float
    max_overlap: float
    time_step: float | None
    floor: Facing | None
    precision: str
    arch: str
    threads: int | None

    @classmethod
    def of(
        cls,
        material: str | Material,
        *,
        size: Sequence[float],
        grain: float | Sizes | Graded,
        spread: float | None,
        gravity: float,
        seed: int,
        young: float | None,
        max_overlap: float,
        **others: Any,
    ) -> Specification:
        """Check the options of ``prepare_bed`` and choose the modulus where it is None. Raises ValueError."""
        if isinstance(grain, Graded) and spread is not None:
            raise ValueError(f"spread = {spread} is for a mean diameter; Graded has a spread of its own")
        sizes = grain if isinstance(grain, Graded) else sizes_of(grain, spread)
        stuff = find_material(material, grain=sizes.mean)
        check_options(size, sizes.mean, gravity, seed, max_overlap)
        if isinstance(sizes, Graded):
            sizes.check(size)
        x, y, z = (float(s) for s in size)
        if young is None:
            young = soft_enough(stuff, size=(x, y, z), sizes=sizes, gravity=gravity, max_overlap=max_overlap)
        return cls(
            material=stuff,
            size=(x, y, z),
            sizes=sizes,
            gravity=float(gravity),
            seed=int(seed),
            young=float(young),
            max_overlap=float(max_overlap),
            **others,
        )

    @property
    def local(self) -> Sizes:
        """The sizes of grains side by side: those under the footprints where the bed is graded."""
        return self.sizes.local if isinstance(self.sizes, Graded) else self.sizes

    @property
    def coarsest(self) -> float:
        """Mean diameter of the grains where they are largest [m]."""
        return self.sizes.largest(self.size) if isinstance(self.sizes, Graded) else self.sizes.mean

    def recipe(self) -> dict[str, Any]:
        """What shapes the bed, as JSON takes it, with the code's digest; threads do not."""
        return {
            "code": fingerprint(),
            "material": {f.name: getattr(self.material, f.name) for f in fields(self.material) if f.name != "sources"},
            "size": list(self.size),
            "sizes": describe(self.sizes),
            "gravity": self.gravity,
            "seed": self.seed,
            "young": self.young,
            "max_overlap": self.max_overlap,
            "time_step": self.time_step,
            "floor": None if self.floor is None else asdict(self.floor),
            "precision": self.precision,
            "arch": self.arch,
        }

    def rain(self, volume: float) -> Bed:
        """Grains of this solid volume [m3] in the air, at rest, in a loose column."""
        rng = np.random.default_rng(self.seed)
        if isinstance(self.sizes, Graded):
            positions, radii = self.sizes.column(rng, volume, self.size)
        else:
            radii = draw_radii(rng, volume, self.sizes)
            positions = rain_positions(rng, radii, self.size[:2])
        top = float((positions[:, 2] + radii).max())
        bed = Bed.from_grains(
            self.material,
            positions=positions,
            radii=radii,
            size=self.size,
            height=top + 10 * self.sizes.mean,
            gravity=self.gravity,
            young=self.young,
            max_overlap=self.max_overlap,
            time_step=self.time_step,
            floor=True if self.floor is None else self.floor,
            seed=self.seed,
            precision=self.precision,
            arch=self.arch,
            threads=self.threads,
        )
        bed.overlap_limit = max(bed.overlap_limit, _RAIN_OVERLAP)
        return bed

    def finish(self, bed: Bed, recipe: dict[str, Any]) -> Bed:
        """The prepared bed at time 0, bound by ``max_overlap``, with displacements counted from here.

        Of a graded bed ``surface`` is that under the footprints; warns where its small grains did not stay in place.
        """
        bed.material = self.material.softened(self.young)
        bed.recipe = recipe
        if isinstance(self.sizes, Graded):
            bed.surface = surface_under(bed, self.sizes)
            found = measure_grading(bed, self.sizes)
            if not found.held:
                warnings.warn(
                    f"the grading did not hold: {100 * found.strayed_share:.2g} % of the grains' volume lies farther "
                    f"out than it belongs, {100 * found.drained_share:.2g} % could fall through; try a smaller growth",
                    stacklevel=3,
                )
        bed.overlap_limit = self.max_overlap
        bed.mark_origin()
        bed.max_overlap = 0.0
        bed.steps = 0
        return bed


@functools.cache
def fingerprint() -> str:
    """A short digest of the code that computes beds and of Taichi's version: other code may give other bits."""
    import taichi

    digest = hashlib.sha256(repr(taichi.__version__).encode())
    for path in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def kept_in_cache(recipe: dict[str, Any]) -> tuple[Path, Path]:
    """Where the cache keeps the bed of a recipe (which names its material), and where it while it is under way."""
    key = hashlib.sha256(json.dumps(recipe, sort_keys=True).encode()).hexdigest()[:24]
    name = f"{recipe['material']['name']}-{key}.npz"
    return cache_folder() / "beds" / name, cache_folder() / "unfinished" / name


def prepare_bed(
    material: str | Material,
    *,
    size: Sequence[float],
    grain: float | Sizes | Graded,
    spread: float | None = None,
    packing: float | None = None,
    gravity: float = 9.81,
    seed: int = 1,
    young: float | None = None,
    max_overlap: float = 0.05,
    time_step: float | None = None,
    floor: Facing | None = None,
    precision: str = "float64",
    arch: str = "cpu",
    threads: int | None = None,
    cache: bool = True,
    progress: Any = None,
) -> Bed:
    """A bed rained in, levelled and settled under gravity, or the same one from the cache.

    Args:
        material: a name, the file of a material or a Material; its surface energy is taken for these grains, where it
            says for which it holds (``Material.for_grain``).
        size: lateral periods (x, y) and depth after levelling (z) [m].
        grain: mean diameter [m], a distribution of ``dem.sizes``, or ``dem.Graded``: sizes by place.
        spread: with a mean diameter: diameters are uniform within +- this share of it [1]; 0.15 when None.
        packing: bulk packing fraction [1]; the bed is tapped until it is reached, and where it is denser than that
            loosened from below first. As rained when None.
        gravity: of the grains, downwards [m/s2].
        seed: of sizes and positions.
        young: Young's modulus of the softened grains [Pa]; chosen from ``max_overlap`` when None
            (``dem.timestep.choose_young``).
        max_overlap: bound on overlap over diameter; also ends a later run that goes past it. While the bed is being
            made the bound is 5 % if that is more: grains that land do so harder than they are ever pressed.
        time_step: [s]; at most ``dem.timestep.longest_step``. When None an eighth of the contact time, or for strongly
            damped grains the longest that is stable where that is shorter.
        floor: how grains touch the floor; as one another when None.
        precision: "float64" or "float32". arch: "cpu" or "cuda". threads: all when None.
        cache: whether to look in the cache, and to leave the bed there.
        progress: anything with ``stage(name, total)`` and ``update(done)``, or None. A KeyboardInterrupt out of
            ``update`` stops the preparation where it can be gone on with.

    With the cache, what is under way is kept there every minute, and the next call goes on from it.

    The grains fall as a loose column from rest, come to rest in a drag that stands in for the long ringing of a soft
    bed, lose what lies above the level, and settle again, at the end without drag. Settled means: mean kinetic energy
    of a grain below 1e-5 m g d, and floor force within 1 % of the weight.

    Raises:
        ValueError: an unknown material, a size or grain that is not positive, grains too large for the bed, a spread
            outside 0 to 0.5 or beside a distribution, a packing that cannot be reached, a time step too long.
        BedFailure: the bed did not come to rest.
    """
    wanted = Specification.of(
        material, size=size, grain=grain, spread=spread, gravity=gravity, seed=seed, young=young,
        max_overlap=max_overlap, time_step=time_step, floor=floor, precision=precision, arch=arch, threads=threads,
    )  # fmt: skip
    stuff, sizes = wanted.material, wanted.sizes
    if packing is not None:
        check_packing(packing, wanted.local, cohesive=stuff.cohesion != "none")
    recipe = wanted.recipe() | {
        "grain": float(sizes.mean),
        "spread": sizes.spread if isinstance(sizes, Uniform) else None,
        "packing": packing,
    }
    runtime.start(arch=arch, threads=threads, precision=precision)
    path, unfinished = kept_in_cache(recipe)
    if cache and path.exists():
        try:
            bed = Bed.load(path, arch=arch, threads=threads)
        except ValueError as problem:
            warnings.warn(f"the cached bed {path.name} cannot be read and is made anew: {problem}", stacklevel=2)
        else:
            bed.material = stuff.softened(wanted.young)
            bed.recipe = recipe
            return bed
    work = Preparation(
        _rain(wanted),
        grain=sizes.mean,
        depth=wanted.size[2],
        packing=packing,
        progress=progress,
        path=unfinished if cache else None,
    )
    work.find(arch=arch, threads=threads)
    try:
        bed = work.run()
    except BedFailure as failure:
        kept = work.bed.save(cache_folder() / "failed" / path.name)
        raise BedFailure(f"{failure.reason}; the bed as it was is in {kept}") from None
    bed = wanted.finish(bed, recipe)
    if cache:
        try:
            bed.save(path)
            (path.with_suffix(".json")).write_text(json.dumps(recipe, indent=1))
        except OSError as problem:
            warnings.warn(f"the bed could not be kept in the cache: {problem}", stacklevel=2)
    return bed


def soft_enough(
    material: Material, *, size: Sequence[float], sizes: Sizes | Graded, gravity: float, max_overlap: float
) -> float:
    """Young's modulus that a bed is given where none is asked for [Pa]: for the rain, and a tip in half its depth."""
    bulk = _EXPECTED_PACKING * material.density
    column = RAIN_COLUMN if isinstance(sizes, Graded) else rain_column(sizes)
    return choose_young(
        material,
        pressure=(1 + BEARING) * bulk * gravity * size[2],
        speed=math.sqrt(2 * gravity * column * size[2]),
        max_overlap=bound_of_mean(sizes, max_overlap),
        diameter=sizes.mean,
    )


def bound_of_mean(sizes: Sizes | Graded, max_overlap: float) -> float:
    """Overlap over diameter at which a grain of the mean size is held, so that the smallest keep ``max_overlap``.

    What a contact gives in is much the same, and more of a small grain's diameter. Within ``_NARROW``, the sizes for
    which forces among many grains were measured, it is ``max_overlap``.
    """
    share = sizes.bounds[0] / sizes.mean / _NARROW
    return max_overlap if share > 1 - 1e-9 else max_overlap * share


def check_options(size, grain, gravity, seed, max_overlap) -> None:
    """Refuse what no bed can be made from, whatever is done with it later. Raises ValueError."""
    if not 0 < max_overlap <= 0.2:
        raise ValueError(f"max_overlap = {max_overlap} must be above 0 and at most 0.2 of a diameter")
    if int(seed) != seed or seed < 0:
        raise ValueError(f"seed = {seed} must be a whole number, 0 or more")
    if len(size) != 3 or not all(math.isfinite(s) and s > 0 for s in size):
        raise ValueError(f"size = {tuple(size)} must be three positive lengths [m]")
    if not (math.isfinite(gravity) and gravity > 0):
        raise ValueError(f"gravity = {gravity} must be positive [m/s2]; nothing settles without it")
    for name, length, least in (("x", size[0], 6), ("y", size[1], 6), ("z", size[2], 4)):
        if length < least * grain * (1 - 1e-9):  # 6 * 0.006 is more than 0.036 to a computer
            raise ValueError(
                f"size: {name} = {length} m is less than {least} grains of {grain} m; {least * grain:.4g} m would do"
            )


def _rain(wanted: Specification) -> Bed:
    """The grains in the air, at rest, in a loose column, for a bed that is cut level."""
    x, y, z = wanted.size
    return wanted.rain(0.60 * max(z * (1 + _SURPLUS), z + _SURPLUS_DIAMETERS * wanted.coarsest) * x * y)
