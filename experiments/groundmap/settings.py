"""Settings of `hedgebed ground`."""

from typing import Annotated, Literal

from pydantic import Field

from experiments.runs.strict import Positive, StrictSettings, Threads
from rigid.platform.rig import STANDARD_GRAVITY
from vis.page.sentences import Sentences

__all__ = ["GroundSettings"]

say = Sentences(__package__)


class GroundSettings(StrictSettings):
    """K, C and sinkage of a ball-tipped spike, from the map that ships: no grains are computed."""

    material: str = Field("sand", description="Material of the map: sand or jsc-1a-loose-cut.")
    gravity: Positive = Field(STANDARD_GRAVITY, description="Gravity of the grains [m/s2]; in a rig they are at 1 g.")
    tip_diameter: Positive = Field(
        0.012, description="Diameter of the tip [m].", json_schema_extra={"option_alias": "--spike-diameter"}
    )
    tip: Literal["sphere", "cone", "flat"] = Field(
        "sphere", description="Shape of the tip: only sphere, a ball tip, has a map; cone and flat are refused."
    )
    packing: Annotated[float, Field(gt=0, lt=1)] | None = None
    """Packing fraction [1]; that of the rained bed of the map if not given."""
    grain: Positive | None = None
    """Mean grain diameter of the soil [m]; if not given, 0.0002 m of sand and 0.0001 m of JSC-1A."""
    load: Positive | None = None
    """Load under which the sinkage is stated [N]; if not given, 0.219 N for 12 mm at 1 g, and in proportion to gravity
    and to the cube of the diameter."""
    threads: Threads = None
