"""Settings of `hedgebed converge`: those of the penetration case that is the base, and what is varied about it."""

from typing import Self

from pydantic import Field, model_validator

from experiments.penetrate.settings import MaxOverlap, PenetrateSettings, Seeds
from experiments.runs.strict import Positive, Scheduler, Workers
from vis.page.sentences import Sentences

__all__ = ["FEWEST_ACROSS", "LEAST_WIDTH", "ConvergeSettings", "say"]

say = Sentences(__package__)

FEWEST_ACROSS = 5.0
"""Grains across the tip that `penetrate` asks for [1]."""
LEAST_WIDTH = 4.0
"""Width of a bed that `penetrate` asks for [tips]."""
_NOT_HERE = ("bed", "model", "campaign", "reference", "time_step")
"""Settings of `penetrate` that one case has and a sweep has not."""


class ConvergeSettings(PenetrateSettings):
    """A penetration case made again with finer grains, wider and deeper beds, stiffer grains and other speeds.

    The settings of `penetrate` describe the base case. One thing at a time is varied about it.
    """

    # The base, where it is not as in `penetrate`
    seeds: Seeds = (1, 2, 3, 4, 5)
    max_overlap: MaxOverlap = 0.04
    """Largest overlap of two grains for which the modulus of the base case is chosen [of a diameter]. A run ends at
    twice that."""
    other_speeds: tuple[Positive, ...] = ()
    """Not used: every bed has all pushes of speeds [m/s]."""
    other_drop_speeds: tuple[Positive, ...] = ()
    """Not used: every bed has all drops of drop_speeds [m/s]."""
    frame_count: int = Field(0, ge=0, le=2000, description="Frames of each pictured run of each member [1]; 0: none.")

    # What is varied, one thing at a time
    ratios: tuple[Positive, ...] = (5.0, 7.0, 10.0)
    """Grain sizes of the sweep, as tip diameter over mean grain diameter [1]. The base case has tip_diameter /
    grain."""
    widths: tuple[Positive, ...] = (6.0, 9.0)
    """Widths of the bed [tip diameters]. The base case has the smaller width of bed_size."""
    bed_depths: tuple[Positive, ...] = (6.0,)
    """Depths of the bed [tip diameters]. The base case has the third number of bed_size."""
    overlaps: tuple[MaxOverlap, ...] = (0.02,)
    """Largest overlaps for which the modulus is chosen [of a diameter]. The base case has max_overlap."""
    paces: tuple[Positive, ...] = (0.5,)
    """Factors on speeds and lowering_speed [1]. The base case has 1; speeds of drops do not change."""

    # Speeds and sizes
    speed_grain: Positive | None = None
    """Mean grain diameter to which speeds and lowering_speed belong [m]. In grains of diameter d they are multiplied by
    speed_grain / d, so that the inertial number stays the same. The finest of the sweep if not given."""
    life_grain: Positive = 0.0002
    """Mean diameter of the real grains [m], to which the results are extrapolated."""

    # The work
    budget: Positive | None = None
    """Most time of one core, by estimate [h]. Further runs are left out and listed. No limit if not given."""
    members: str | None = Field(None, min_length=1)
    """Folder of the single runs. Sweeps share it and find runs by their settings. 'members' in the folder of the run if
    not given."""
    workers: Workers = None
    scheduler: Scheduler = None

    @model_validator(mode="after")
    def _varied(self) -> Self:
        for key in ("ratios", "widths", "bed_depths", "overlaps", "paces"):
            if len(set(getattr(self, key))) < len(getattr(self, key)):
                raise ValueError(f"{key} = {list(getattr(self, key))} holds a value twice: give each once")
        for key in _NOT_HERE:
            if getattr(self, key) is not None:
                raise ValueError(say("not_here", key=key, value=getattr(self, key)))
        if not self.set_down:
            raise ValueError(say("needs_set_down"))
        if self.ground != "bed":
            raise ValueError(f"ground = {self.ground!r} has no grains to be made finer: ground = 'bed' is accepted")
        if self.life_grain > self.finest:
            raise ValueError(say("life_grain", s=self, finest=self.finest))
        return self

    @property
    def ratio(self) -> float:
        """Grains across the tip of the base [1]."""
        return self.tip_diameter / self.grain

    @property
    def width(self) -> float:
        """Width of the base's bed [tip diameters]."""
        return min(self.bed_size[:2]) / self.tip_diameter

    @property
    def bed_depth(self) -> float:
        """Depth of the base's bed [tip diameters]."""
        return self.bed_size[2] / self.tip_diameter

    @property
    def finest(self) -> float:
        """Mean diameter of the finest grains of the sweep [m]."""
        return self.tip_diameter / max(self.ratio, *self.ratios, 0.0)

    @property
    def driven_grain(self) -> float:
        """The grain that the speeds are meant for [m]."""
        return self.speed_grain or self.finest
