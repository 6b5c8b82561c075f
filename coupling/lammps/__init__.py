"""Grains in LAMMPS, a program of its own under MPI, as a bed: the same bodies, the same master, the same balance.

`LammpsBed` takes over the grains of a `dem.Bed`, `FreeLammpsBed` those under bodies that turn out of the plane of x and
z. `LammpsGround` puts a body on them.

Imports `dem`, `rigid`, and of `coupling` the ground of a bed.
"""

from .bed import LammpsBed
from .free_bed import FreeLammpsBed
from .ground import LammpsGround
from .pieces import OutOfPlaneError
from .process import INSTALL, LammpsEndedError, LammpsMissingError, check_ranks, cohesion_fault, find_lammps
from .regions import check_count, check_plane

__all__ = [
    "INSTALL", "FreeLammpsBed", "LammpsBed", "LammpsEndedError", "LammpsGround", "LammpsMissingError",
    "OutOfPlaneError", "check_count", "check_plane", "check_ranks", "cohesion_fault", "find_lammps",
]  # fmt: skip
