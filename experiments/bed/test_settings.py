"""Settings of `hedgebed bed test repose`, `cone`, `cut` and `shear`."""

from typing import Annotated, Self

from pydantic import Field, model_validator

from experiments.penetrate.settings import MATERIAL, STANDARD_GRAVITY
from experiments.runs.strict import StrictSettings

from .settings import say

__all__ = ["BedConeSettings", "BedCutSettings", "BedReposeSettings", "BedShearSettings", "BedTestSettings"]

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Size = tuple[Positive, Positive, Positive]
SeedNumber = Annotated[int, Field(ge=0, lt=2**31)]
_SIZE = "Bed: both widths (periodic) and depth of grains [m]."
_OF_BED = ("material", "size", "grain", "spread", "packing", "gravity", "seeds")


class BedTestSettings(StrictSettings):
    """Which beds are tested: one that is there, or beds prepared (or taken from the cache) for the test."""

    bed: str | None = Field(
        None,
        min_length=1,
        description="The bed: a file, the folder of a run of bed make, or a name on the shelf. Decides material, size, "
        "grain, spread, packing, gravity and seed; beds are prepared, or taken from the cache, if not given.",
    )
    material: str = Field("sand", description=MATERIAL)
    size: Size = Field((0.16, 0.024, 0.04), description=_SIZE)
    grain: Positive = Field(0.004, description="Mean grain diameter [m].")
    spread: float = Field(0.15, ge=0, le=0.5, description="Grain diameters are uniform within 1 +- this [1].")
    packing: float | None = Field(
        None, gt=0.1, le=0.74, description="Packing fraction to prepare the bed to [1]; as it settles if not given."
    )
    gravity: Positive = Field(STANDARD_GRAVITY, description="Gravity of the grains [m/s2].")
    seeds: tuple[SeedNumber, ...] = Field((1, 2, 3), min_length=1, description="Seeds: one bed each.")
    threads: int | None = Field(None, ge=1, le=1024, description="CPU threads; all there are if not given.")

    @model_validator(mode="after")
    def _one_or_the_other(self) -> Self:
        if len(set(self.seeds)) < len(self.seeds):
            raise ValueError("seeds holds a seed twice: each once would do")
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

    size: Size = Field((0.064, 0.064, 0.048), description=_SIZE)
    diameter: Positive = Field(0.016, description="Diameter of the cone's base [m].")
    angle: float = Field(60.0, ge=10, le=150, description="Full angle of the cone [degrees].")
    depth: Positive | None = Field(
        None, description="How deep the tip goes below the surface [m]; half the bed's depth if not given."
    )
    speed: Positive | None = Field(
        None,
        description="Speed of the cone [m/s]; if not given 30 mm/s for a cone of 20.27 mm on Earth (ASAE S313.3), and "
        "as sqrt(g D) for others.",
    )
    shaft: Positive | None = Field(None, description="Diameter of the shaft [m]; 0.783 of the cone's if not given.")
    friction: float | None = Field(
        None, ge=0, le=10, description="Friction of grains on the cone [1]; the grains' own if not given."
    )
    max_overlap: float | None = Field(
        None,
        ge=0.01,
        le=0.15,
        description="Largest overlap of grains under the cone [of a diameter]; the bed's own bound, for which its "
        "grains were made, if not given.",
    )
    pushes: int = Field(2, ge=1, le=20, description="Pushes into each bed, each into a fresh copy, in another place.")


class BedCutSettings(BedTestSettings):
    """A vertical cut: gravity rises until a face falls; critical height and cohesion."""

    size: Size = Field((0.128, 0.024, 0.04), description=_SIZE)
    width: Positive | None = Field(None, description="Width of the cut [m]; the bed's height if not given.")
    most: float = Field(
        4.0, ge=0.2, le=100, description="Gravity to which it rises if no face falls [of the bed's own]."
    )
    friction_angle: float | None = Field(
        None,
        ge=0,
        lt=80,
        description="Friction angle for the cohesion [degrees], of Mohr's circle (bed calibrate, plane = 'mohr'): that "
        "of the plane of shear, as bed test shear gives it, is smaller and tells too large a cohesion; none is told if "
        "not given.",
    )


class BedShearSettings(StrictSettings):
    """A bed sheared under a rough lid at several pressures: friction angles, peak and critical, and cohesion."""

    bed: str = Field(description="The bed: a file, the folder of a run of bed make, or a name on the shelf.")
    pressures: tuple[Positive, ...] = Field(
        (1.0, 2.0, 4.0),
        min_length=2,
        description="Pressures on the lid, over what lies on the bed's floor [1]; at most 4.",
    )
    way: Positive = Field(8.0, ge=2, le=200, description="How far the lid goes sideways [mean diameters].")
    inertial_number: Positive = Field(
        5e-3, le=0.05, description="Speed of the lid, as speed / height d sqrt(density / pressure) [1]."
    )
    threads: int | None = Field(None, ge=1, le=1024, description="CPU threads; all there are if not given.")

    @model_validator(mode="after")
    def _can_be(self) -> Self:
        if max(self.pressures) > 4:
            given = " ".join(f"{p:g}" for p in self.pressures)
            raise ValueError(say("pressures", pressures=given, most=max(self.pressures)))
        if len(set(self.pressures)) < len(self.pressures):
            raise ValueError("pressures holds a value twice: each once would do")
        return self
