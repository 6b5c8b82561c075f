"""The master that steps a body and a ground together."""

from .bed_ground import BedGround
from .ground import Ground
from .penetration import Drive, Drop, Run, SetDown, drive, drop, overdamped_below, set_down
from .trajectory import Penetration

__all__ = [
    "BedGround",
    "Drive",
    "Drop",
    "Ground",
    "Penetration",
    "Run",
    "SetDown",
    "drive",
    "drop",
    "overdamped_below",
    "set_down",
]
