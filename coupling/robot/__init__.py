"""Robots of MuJoCo on any ground: named geoms are feet, MuJoCo keeps joints, motors and controllers.

`MujocoRobot` is a body for `coupling.Master`; its grounds are `LawFeet` (a surface law under every point of contact)
and `BedFeet` (a bed of grains); `RobotRun` follows it with its energy balance. MuJoCo itself is an extra:
`pip install hedgebed[mujoco]`.

Imports `coupling`, `dem`, `rigid`.
"""

from .bed_feet import BedFeet
from .body import MujocoRobot
from .feet import Foot, Part, find_feet
from .foot_forces import FootForces
from .law_feet import LawFeet
from .models import LostRobotError, load_model
from .run import RobotRun
from .stability import check_exchange

__all__ = [
    "BedFeet", "Foot", "FootForces", "LawFeet", "LostRobotError", "MujocoRobot", "Part", "RobotRun", "check_exchange",
    "find_feet", "load_model",
]  # fmt: skip
