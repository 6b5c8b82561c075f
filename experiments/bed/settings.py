"""Settings of `hedgebed bed make` and `hedgebed bed refine`."""

from dataclasses import replace
from typing import Annotated, Self

from pydantic import Field, model_validator

from dem.grains.graded import Graded
from dem.grains.materials import material
from dem.grains.sizes import LogNormal, Normal, Sieve, Sizes, Uniform
from dem.prepare.recipe import check_stages, parse_stage
from experiments.grains.sizes import Distribution, Kept
from experiments.penetrate.settings import (
    STANDARD_GRAVITY,
    Arch,
    BedSize,
    Grain,
    GrainMaterial,
    MaxOverlap,
    Precision,
    Spread,
    TimeStep,
    Young,
)
from experiments.runs.strict import Positive, SeedNumber, StrictSettings, Threads
from vis.page.sentences import Sentences

__all__ = ["GRADED", "SPREAD_OUT", "BedRefineSettings", "BedSettings"]

say = Sentences(__package__)

GRADED = ("footprints", "fine_depth", "growth")
"""Settings that a graded bed alone has, beside ``coarse``."""
SPREAD_OUT = ("deviation", "cut", "openings", "passing")
"""Settings of ``distribution``, each of some of them."""
_OF = {"normal": ("deviation", "cut"), "log-normal": ("deviation", "cut"), "sieve": ("openings", "passing")}
_NAME = (
    "Name under which the bed is kept in the folder HEDGEBED_BEDS; if not given, it is only in the folder of the run."
)
ShelfName = Annotated[str | None, Field(min_length=1, description=_NAME)]


class BedSettings(StrictSettings):
    """A bed prepared as in a laboratory, stage by stage."""

    material: GrainMaterial = "sand"
    stages: tuple[str, ...] = Field(("rain", "level"), min_length=1)
    """Stages of preparation, in this order: rain[:dry|:FRICTION], stick, level[:HEIGHT], fluff[:TIMES],
    compact:PACKING[@lid], compact:densest, packing:PACKING, cut:WIDTH, tilt:DEGREES."""
    size: BedSize = (0.04, 0.04, 0.03)
    grain: Grain = 0.004
    spread: Spread = 0.15
    distribution: Distribution = "uniform"
    """Distribution of grain diameters with the mean `grain`: uniform, normal or log-normal by number; sieve: a table by
    mass, scaled to that mean."""
    deviation: Positive | None = None
    """Relative standard deviation (normal), or standard deviation of ln diameter (log-normal) [1]."""
    cut: Positive | None = None
    """Truncation of normal and log-normal [standard deviations]; 2 if not given."""
    openings: tuple[Positive, ...] = Field((), description="Sieve table: openings, ascending [m].")
    passing: tuple[Annotated[float, Field(ge=0, le=1)], ...] = ()
    """Sieve table: share of the mass that passes each opening, from 0 to 1 [1]."""
    keep: Kept = "strength"
    """Cohesive material in grains of another size than its file states: quantity that stays the same. strength:
    pull-off force over d^2; bond: pull-off force over weight; or the surface energy."""
    coarse: Positive | None = None
    """Graded bed: largest mean grain diameter, away from the footprints, under which it is `grain` [m]; one size
    throughout if not given."""
    footprints: tuple[Annotated[float, Field(ge=0, allow_inf_nan=False)], ...] = ()
    """Graded bed: begin and end of each strip of fine grains along x [m]."""
    fine_depth: Positive | None = None
    """Graded bed: depth of the fine grains [m]; the whole bed if not given."""
    growth: Positive | None = None
    """Graded bed: growth of the mean diameter with distance [1]; 0.15 if not given."""
    gravity: Positive = Field(STANDARD_GRAVITY, description="Gravity of the grains [m/s2].")
    seed: SeedNumber = Field(1, description="Seed of sizes and positions.")
    name: ShelfName = None
    max_overlap: MaxOverlap = 0.05
    young: Young = None
    time_step: TimeStep = None
    precision: Precision = "float64"
    arch: Arch = "cpu"
    threads: Threads = None

    @model_validator(mode="after")
    def _can_be(self) -> Self:
        local = self.local
        if (graded := self.graded) is not None:
            graded.check(self.size)
        stuff = material(self.material)
        if self.keep != "strength" and stuff.grain is None:
            why = "does not stick" if stuff.cohesion == "none" else "does not say for which grains its numbers hold"
            raise ValueError(f"keep = {self.keep!r}: material {stuff.name!r} {why}; leave keep out")
        check_stages(
            [parse_stage(stage) for stage in self.stages], size=self.size, grain=self.grain, sizes=local,
            cohesive=stuff.cohesion != "none",
        )  # fmt: skip
        return self

    @property
    def local(self) -> Sizes:
        """Sizes of grains side by side, under the footprints of one that is graded. Raises ValueError for bad ones."""
        for key in SPREAD_OUT:
            value = getattr(self, key) or None
            if value is not None and key not in _OF.get(self.distribution, ()):
                owners = " or ".join(f"{name!r}" for name, keys in _OF.items() if key in keys)
                raise ValueError(say("of_another", s=self, key=key, value=value, owners=owners))
        if self.distribution == "uniform":
            return Uniform(self.grain, self.spread)
        if self.spread != BedSettings.model_fields["spread"].default:
            raise ValueError(say("spread_of_uniform", s=self))
        if self.distribution == "sieve":
            if not self.openings or not self.passing:
                raise ValueError(say("sieve_needs"))
            table = Sieve(self.openings, self.passing)
            return replace(table, scale=self.grain / table.mean)
        if self.deviation is None:
            raise ValueError(say("needs_deviation", s=self))
        made = Normal if self.distribution == "normal" else LogNormal
        return made(self.grain, self.deviation, *([] if self.cut is None else [self.cut]))

    @property
    def graded(self) -> Graded | None:
        """Sizes by place, where the bed is graded. Raises ValueError for what cannot be, or is given by halves."""
        if self.coarse is None:
            if given := [name for name in GRADED if getattr(self, name) not in (None, ())]:
                would = f"coarse = {2 * self.grain:g} would make one"
                raise ValueError(f"{', '.join(given)}: only of a graded bed; {would}")
            return None
        if self.distribution != "uniform":
            raise ValueError(say("graded_distribution", s=self))
        ends = self.footprints
        if not ends or len(ends) % 2:
            raise ValueError(f"footprints = {list(ends)} must be pairs: where each begins and ends along x [m]")
        return Graded(
            fine=self.grain, coarse=self.coarse, footprints=tuple(zip(ends[::2], ends[1::2], strict=True)),
            depth=self.fine_depth, spread=self.spread, **{} if self.growth is None else {"growth": self.growth},
        )  # fmt: skip


class BedRefineSettings(StrictSettings):
    """The same bed with smaller grains: the same material, size, gravity and stages, brought to the same packing."""

    bed: str = Field(description="Bed: its file, the folder of its bed make run, or its name.")
    grain: Positive | None = Field(None, description="Mean grain diameter [m]; half of that of the bed if not given.")
    keep: Kept = "strength"
    """Cohesive grains: quantity that stays the same. strength: pull-off force over d^2; bond: pull-off force over
    weight; or the surface energy."""
    seed: SeedNumber | None = Field(None, description="Seed of sizes and positions; that of the bed if not given.")
    name: ShelfName = None
    threads: Threads = None
