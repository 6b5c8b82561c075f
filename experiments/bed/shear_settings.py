"""Settings of `hedgebed bed test shear`."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, model_validator

from experiments.runs.strict import StrictSettings

from .words import say

__all__ = ["BedShearSettings"]

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]


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
    def _can_be(self) -> BedShearSettings:
        if max(self.pressures) > 4:
            raise ValueError(
                say("pressures", pressures=" ".join(f"{p:g}" for p in self.pressures), most=max(self.pressures))
            )
        if len(set(self.pressures)) < len(self.pressures):
            raise ValueError("pressures holds a value twice: each once would do")
        return self
