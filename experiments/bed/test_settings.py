"""Settings of `hedgebed bed test repose`, `cone`, `cut`, `plates` and `shear`."""

from pathlib import Path
from typing import Annotated, Self

from pydantic import Field, model_validator

from experiments.penetrate.settings import STANDARD_GRAVITY, BedSize, Grain, GrainMaterial, Seeds, Spread
from experiments.runs.strict import Positive, StrictSettings, Threads

from .settings import say

__all__ = [
    "BedConeSettings", "BedCutSettings", "BedPlatesSettings", "BedReposeSettings", "BedShearSettings",
    "BedTestSettings",
]  # fmt: skip

SHAPES = ("ball", "cone", "cylinder")
"""Bodies of `bed test plates` that need no file."""
_OF_BED = ("size", "grain", "spread", "packing", "gravity", "seeds")


class BedTestSettings(StrictSettings):
    """Which beds are tested: one that is there, or beds prepared (or taken from the cache) for the test."""

    bed: str | None = Field(None, min_length=1)
    """Bed: its file, the folder of its bed make run, or its name. It sets material, size, grain, spread, packing,
    gravity and seed. If not given, beds are prepared or taken from the cache."""
    material: GrainMaterial = "sand"
    size: BedSize = (0.16, 0.024, 0.04)
    grain: Grain = 0.004
    spread: Spread = 0.15
    packing: float | None = Field(None, gt=0.1, le=0.74)
    """Packing fraction of the bed [1]; that after settling if not given."""
    gravity: Positive = Field(STANDARD_GRAVITY, description="Gravity of the grains [m/s2].")
    seeds: Seeds = (1, 2, 3)
    max_overlap: float | None = Field(None, ge=0.01, le=0.15)
    """Largest overlap of grains in the test [of a diameter]; the bound of the bed if not given."""
    threads: Threads = None

    @model_validator(mode="after")
    def _one_or_the_other(self) -> Self:
        if len(set(self.seeds)) < len(self.seeds):
            raise ValueError("seeds holds a seed twice: give each once")
        # A material beside a bed may be the bed's own: `tests.check_bed` reads it.
        for key in _OF_BED if self.bed is not None else ():
            value = getattr(self, key)
            if value != type(self).model_fields[key].default:
                raise ValueError(f"{key} = {value} beside bed = {self.bed!r}, which has its own: leave one of them out")
        return self


class BedReposeSettings(BedTestSettings):
    """Angle of repose: the bed drains through a slot, and the slopes that stay are measured."""

    slot: Positive | None = Field(None, description="Width of the slot [m]; six mean diameters if not given.")


class BedConeSettings(BedTestSettings):
    """A cone penetrometer: cone index against depth, and its gradient."""

    size: BedSize = (0.064, 0.064, 0.048)
    diameter: Positive = Field(0.016, description="Diameter of the cone's base [m].")
    angle: float = Field(60.0, ge=10, le=150, description="Full angle of the cone [degrees].")
    depth: Positive | None = None
    """Depth of the tip below the surface [m]; half the depth of the bed if not given."""
    speed: Positive | None = None
    """Speed of the cone [m/s]. If not given: 30 mm/s for a cone of 20.27 mm on Earth (ASAE S313.3), otherwise scaled
    with sqrt(g D)."""
    shaft: Positive | None = Field(
        None, description="Diameter of the shaft [m]; 0.783 of the diameter of the cone if not given."
    )
    friction: float | None = Field(None, ge=0, le=10)
    """Friction coefficient between grains and cone [1]; that of the grains if not given."""
    pushes: int = Field(2, ge=1, le=20, description="Pushes into each bed, each into a new copy at another place.")


class BedPlatesSettings(BedTestSettings):
    """Plates at several angles and directions of motion: the table of 3D-RFT of the bed, checked with other bodies."""

    size: BedSize = (0.064, 0.064, 0.052)
    side: Positive = Field(0.024, description="Side of the square plates [m].")
    thickness: Positive = Field(0.003, description="Thickness of the plates [m].")
    betas: tuple[Annotated[float, Field(gt=-90, lt=180)], ...] = Field((0.0, 30.0, 60.0, 90.0), min_length=1)
    """Angles of the plates [degrees]. 0: the plate faces down; 90: it faces forward."""
    gammas: tuple[Annotated[float, Field(ge=0, le=90)], ...] = Field((90.0, 45.0, 0.0), min_length=1)
    """Directions of motion, below the horizontal [degrees]. 90: straight down; 0: level; none between 0 and 20."""
    depth: Positive = Field(0.02, description="Depth of the middle of a plate, and of the foot of a shape [m].")
    shallow: float = Field(0.4, ge=0, lt=1)
    """Plates that go down count from this share of the depth on [1]."""
    travel: Positive = Field(0.018, description="Way of a body that is dragged level [m]; its second half counts.")
    speed: Positive | None = Field(None, description="Speed [m/s]; that of the inertial number if not given.")
    inertial_number: float = Field(0.1, gt=0, le=0.2)
    """Inertial number, speed / side x d sqrt(density / pressure), of the bed at half a side's depth [1].
    Below some 0.01 motion is slow; the default is faster, to be cheap."""
    shapes: tuple[Annotated[str, Field(min_length=1)], ...] = ("ball", "cone")
    """Bodies that the table has not seen, pushed into the same beds: ball, cone, cylinder, or files of closed surfaces
    (STL, OBJ)."""
    shape_size: Positive = Field(0.024, description="Diameter of a ball, cone or cylinder [m].")
    shape_scale: Positive = Field(1.0, description="Unit of the files [m]: 0.001 for millimetres.")
    shape_gammas: tuple[Annotated[float, Field(ge=0, le=90)], ...] = (90.0, 45.0)
    """Directions of motion of these bodies [degrees]."""
    friction: float | None = Field(None, ge=0, le=10)
    """Friction coefficient between grains and bodies [1]; that of the grains if not given."""
    max_overlap: float = Field(0.15, ge=0.01, le=0.2)
    """Largest overlap of grains at a body [of a diameter]."""

    @model_validator(mode="after")
    def _can_be_pushed(self) -> Self:
        for key in ("gammas", "shape_gammas"):
            if flat := [gamma for gamma in getattr(self, key) if 0 < gamma < 20]:
                raise ValueError(say("flat_gamma", key=key, gamma=flat[0]))
        for key in ("betas", "gammas", "shape_gammas", "shapes"):
            if len(set(getattr(self, key))) < len(getattr(self, key)):
                raise ValueError(f"{key} holds a value twice: give each once")
        for shape in self.shapes:
            if shape not in SHAPES and not Path(shape).is_file():
                raise ValueError(say("no_shape", shape=shape, known=", ".join(SHAPES)))
        names = [Path(shape).name for shape in self.shapes]
        if len(set(names)) < len(names):
            raise ValueError(say("same_name", names=" ".join(names)))
        if self.thickness > 0.5 * self.side:
            raise ValueError(say("thick_plate", s=self))
        return self


class BedCutSettings(BedTestSettings):
    """A vertical cut: gravity rises until a face falls; critical height and cohesion."""

    size: BedSize = (0.128, 0.024, 0.04)
    width: Positive | None = Field(None, description="Width of the cut [m]; the height of the bed if not given.")
    most: float = Field(4.0, ge=0.2, le=100)
    """Largest gravity [of that of the bed]."""
    friction_angle: float | None = Field(None, ge=0, lt=80)
    """Friction angle by Mohr's circle, with which the cohesion is computed [degrees] (bed calibrate, plane = 'mohr').
    The smaller angle of bed test shear gives too large a cohesion. Without it no cohesion is stated."""


class BedShearSettings(StrictSettings):
    """A bed sheared under a rough lid at several pressures: friction angles, peak and critical, and cohesion."""

    bed: str = Field(
        description="The bed: a file, the folder of a run of bed make, or its name in the folder HEDGEBED_BEDS."
    )
    pressures: tuple[Positive, ...] = Field((1.0, 2.0, 4.0), min_length=2)
    """Pressures on the lid, over the pressure at the floor of the bed [1]; at most 4."""
    way: Positive = Field(8.0, ge=2, le=200, description="Horizontal travel of the lid [mean diameters].")
    inertial_number: Positive = Field(5e-3, le=0.05)
    """Inertial number, speed / height x d sqrt(density / pressure), which sets the speed of the lid [1]."""
    threads: Threads = None

    @model_validator(mode="after")
    def _can_be(self) -> Self:
        if max(self.pressures) > 4:
            given = " ".join(f"{p:g}" for p in self.pressures)
            raise ValueError(say("pressures", pressures=given, most=max(self.pressures)))
        if len(set(self.pressures)) < len(self.pressures):
            raise ValueError("pressures holds a value twice: give each once")
        return self
