"""The master that steps a body and a ground together."""

from .bed_footing import BedFooting, LeftTheBedError, platform_members, spatial_members
from .bed_ground import BedGround
from .footing import Footing, LawFooting
from .ground import Ground
from .master import Body, Master
from .penetration import Drive, Drop, Run, SetDown, drive, drop, overdamped_below, set_down
from .planar_body import PlanarBody
from .spatial_body import SpatialBody
from .spatial_run import SpatialRun
from .trajectory import Penetration
from .tumbles import Landing, Rest, TumblesInARow
from .tumbling import MOST_REVERSAL, CoupledTumble

__all__ = [
    "MOST_REVERSAL",
    "BedFooting",
    "BedGround",
    "Body",
    "CoupledTumble",
    "Drive",
    "Drop",
    "Footing",
    "Ground",
    "Landing",
    "LawFooting",
    "LeftTheBedError",
    "Master",
    "Penetration",
    "PlanarBody",
    "Rest",
    "Run",
    "SetDown",
    "SpatialBody",
    "SpatialRun",
    "TumblesInARow",
    "drive",
    "drop",
    "overdamped_below",
    "platform_members",
    "set_down",
    "spatial_members",
]
