"""What a bed is prepared from: the options, their checks, the rain they make, and the place of the bed in the cache.

The cache is keyed by everything that shapes a bed, the code included, so that nobody waits for the same rain twice.
"""

import hashlib
import json
import math
import warnings
from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import Any, Required, TypedDict

import numpy as np

from dem.contact.timestep import choose_young
from dem.grains.graded import Graded
from dem.grains.materials import LEAST_ROLLING, Facing, Material
from dem.grains.materials import material as find_material
from dem.grains.packing import RAIN_COLUMN, draw_radii, rain_column, rain_positions
from dem.grains.sizes import Json, Sizes, describe, sizes_of
from dem.measure.grading import measure_grading, surface_under

from .code import cache_folder, fingerprint
from .report import B

__all__ = ["BEARING", "BedOptions", "Specification", "kept_in_cache"]

_EXPECTED_PACKING = 0.57
# Penetration resistance of sand grows with depth about sixty times as fast as its overburden (3D-RFT, Agarwal et al.
# 2023: 0.9 MN/m3 at mu = 0.5 against 16 kN/m3); a bed is made for a tip that may go half its depth.
BEARING = 30.0
# A grain that strikes the floor at the end of its fall does the bed no harm: until it is made, this is allowed.
_RAIN_OVERLAP = 0.05
# Numbers of a specification that its bed and its recipe take as they are.
_NUMBERS = ("gravity", "seed", "young", "max_overlap", "time_step")
# Smallest over mean diameter of the sizes with which ``CHAIN`` was measured.
_NARROW = 0.85


class BedOptions(TypedDict, total=False):
    """The options that every preparation takes.

    size: lateral periods (x, y) and depth after levelling (z) [m].
    grain: mean diameter [m], a distribution of ``dem.grains.sizes``, or ``dem.Graded``: sizes by place.
    spread: with a mean diameter: diameters are uniform within +- this share of it [1]; 0.15 when None.
    gravity: of the grains, downwards [m/s2]; 9.81 if not given. seed: of sizes and positions; 1 if not given.
    young: Young's modulus of the softened grains [Pa]; when None chosen from ``max_overlap``
        (``dem.contact.timestep.choose_young``).
    max_overlap: bound on overlap over diameter, 0.05 if not given; also ends a later run that goes past it. While the
        bed is being made the bound is 5 % if that is more: grains that land do so harder than they are ever pressed.
    floor: how grains touch the floor; as one another when None.
    time_step, precision, arch, threads: as for ``Bed.from_grains``.
    """

    size: Required[Sequence[float]]
    grain: Required[float | Sizes | Graded]
    spread: float | None
    gravity: float
    seed: int
    young: float | None
    max_overlap: float
    time_step: float | None
    floor: Facing | None
    precision: str
    arch: str
    threads: int | None


@dataclass(frozen=True, kw_only=True)
class Specification:
    """What a bed is rained from: ``BedOptions``, checked and chosen where left open; ``young``: of softened grains."""

    material: Material
    size: tuple[float, float, float]
    sizes: Sizes | Graded
    gravity: float
    seed: int
    young: float
    max_overlap: float
    time_step: float | None = None
    floor: Facing | None = None
    precision: str = "float64"
    arch: str = "cpu"
    threads: int | None = None

    @classmethod
    def of(
        cls,
        material: str | Material,
        *,
        size: Sequence[float],
        grain: float | Sizes | Graded,
        spread: float | None = None,
        gravity: float = 9.81,
        seed: int = 1,
        young: float | None = None,
        max_overlap: float = 0.05,
        **others: Any,
    ) -> "Specification":
        """Check the options and choose the modulus where it is None. Raises ValueError."""
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
        others |= {"gravity": float(gravity), "young": float(young), "max_overlap": float(max_overlap)}
        return cls(material=stuff, size=(x, y, z), sizes=sizes, seed=int(seed), **others)

    def poured(self, friction: float | None) -> "Specification":
        """The same of grains that stick neither to one another nor to the floor.

        With this friction and no rolling friction, or their own where it is None [1]. Enlarged grains that keep a
        powder's strength rain into a gauze far looser than the powder. Neither taps nor a lid bring them together
        (docs/bed.md). So they are poured like this, and stick once the bed lies as it should
        (``dem.prepare.laboratory.touching_as``). ``dem.measure.element`` presses its samples in the same way.
        """
        stuff = replace(self.material, cohesion="none", surface_energy=0.0)
        if friction is not None:
            stuff = replace(stuff, friction=friction, rolling_friction=min(stuff.rolling_friction, LEAST_ROLLING))
        floor = None if self.floor is None else replace(self.floor, surface_energy=None)
        return replace(self, material=stuff, floor=floor)

    @property
    def local(self) -> Sizes:
        """The sizes of grains side by side: those under the footprints where the bed is graded."""
        return self.sizes.local if isinstance(self.sizes, Graded) else self.sizes

    @property
    def coarsest(self) -> float:
        """Mean diameter of the grains where they are largest [m]."""
        return self.sizes.largest(self.size) if isinstance(self.sizes, Graded) else self.sizes.mean

    def recipe(self) -> Json:
        """What shapes the bed, as JSON takes it, with the code's digest; threads do not."""
        return {
            "code": fingerprint(),
            "material": {f.name: getattr(self.material, f.name) for f in fields(self.material) if f.name != "sources"},
            "size": list(self.size),
            "sizes": describe(self.sizes),
            **{name: getattr(self, name) for name in _NUMBERS},
            "floor": None if self.floor is None else asdict(self.floor),
            "precision": self.precision,
            "arch": self.arch,
        }

    def rain(self, volume: float, make: type[B]) -> B:
        """Grains of this solid volume [m3] in the air, at rest, in a loose column: a bed of the class ``make``."""
        rng = np.random.default_rng(self.seed)
        if isinstance(self.sizes, Graded):
            positions, radii = self.sizes.column(rng, volume, self.size)
        else:
            radii = draw_radii(rng, volume, self.sizes)
            positions = rain_positions(rng, radii, self.size[:2])
        top = float((positions[:, 2] + radii).max())
        bed = make.from_grains(
            self.material,
            positions=positions,
            radii=radii,
            size=self.size,
            height=top + 10 * self.sizes.mean,
            floor=True if self.floor is None else self.floor,
            **{name: getattr(self, name) for name in (*_NUMBERS, "precision", "arch", "threads")},
        )
        bed.overlap_limit = max(bed.overlap_limit, _RAIN_OVERLAP)
        return bed

    def finish(self, bed: B, recipe: Json) -> B:
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


def kept_in_cache(recipe: Json) -> tuple[Path, Path]:
    """Where the cache keeps the bed of a recipe (which names its material), and where it while it is under way."""
    key = hashlib.sha256(json.dumps(recipe, sort_keys=True).encode()).hexdigest()[:24]
    name = f"{recipe['material']['name']}-{key}.npz"
    return cache_folder() / "beds" / name, cache_folder() / "unfinished" / name


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
                f"size: {name} = {length} m is less than {least} grains of {grain} m; give {least * grain:.4g} m"
            )
