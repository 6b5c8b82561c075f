"""Bodies on grounds: a spike or a platform and what pushes on it, stepped together, with their energy balance.

A ground (`Ground`) is a surface law (`LawGround`, `rigid.SpringDamper`) or a bed of grains (`BedGround`). `drive`,
`drop` and `set_down` push a spike into one, `CoupledTumble` and `SpatialRun` follow a platform on one, `Master` steps
any body.

Imports `dem`, `rigid`.
"""

import hedgebed_renamed

from .bed_ground import BedGround, LeftTheBedError
from .ground import Ground
from .law_ground import LawGround
from .master import Body, Master
from .members import platform_members, spatial_members
from .penetration import Drive, Drop, Run, SetDown, drive, drop, overdamped_below, set_down
from .planar_body import PlanarBody
from .spatial_body import SpatialBody
from .spatial_run import SpatialRun
from .trajectory import Penetration
from .tumbles import Landing, Rest, TumblesInARow
from .tumbling import MOST_REVERSAL, CoupledTumble

__all__ = [
    "MOST_REVERSAL", "BedGround", "Body", "CoupledTumble", "Drive", "Drop", "Ground", "Landing", "LawGround",
    "LeftTheBedError", "Master", "Penetration", "PlanarBody", "Rest", "Run", "SetDown", "SpatialBody", "SpatialRun",
    "TumblesInARow", "drive", "drop", "overdamped_below", "platform_members", "set_down", "spatial_members",
]  # fmt: skip

__getattr__ = hedgebed_renamed.renamed_names(__name__, BedFooting=BedGround, Footing=Ground, LawFooting=LawGround)
