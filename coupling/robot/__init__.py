"""Robots of MuJoCo on any ground: named geoms are feet, MuJoCo keeps joints, motors and controllers.

`MujocoRobot` is a body for `coupling.Master`. Its grounds are `LawFeet` (a surface law under every point of contact),
`BedFeet` (a bed of grains) and `LammpsFeet` (grains in LAMMPS). `RobotRun` follows it with its energy balance. MuJoCo
itself is an extra: `pip install hedgebed[mujoco]`.

Imports `coupling`, `coupling.lammps`, `dem`, `rigid`.
"""

from .bed_feet import BedFeet
from .body import MujocoRobot
from .feet import Foot, Part, find_feet
from .foot_forces import FootForces
from .lammps_feet import LammpsFeet, by_regions
from .law_feet import LawFeet
from .models import LostRobotError, load_model
from .run import RobotRun
from .soles import foot_matrices, law_under_feet, sole_of
from .stability import check_exchange

__all__ = [
    "BedFeet", "Foot", "FootForces", "LammpsFeet", "LawFeet", "LostRobotError", "MujocoRobot", "Part", "RobotRun",
    "by_regions", "check_exchange", "find_feet", "foot_matrices", "law_under_feet", "load_model", "sole_of",
]  # fmt: skip
