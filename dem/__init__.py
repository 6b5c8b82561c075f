"""The granular bed. Knows nothing of platforms or spikes.

Names are looked up when they are first used, so that ``import dem`` does not start Taichi.
"""

from __future__ import annotations

import importlib
import os
from typing import TYPE_CHECKING, Any

__all__ = [
    "Ball",
    "Bed",
    "BedFailure",
    "Box",
    "Capsule",
    "Cone",
    "Cylinder",
    "Facing",
    "Graded",
    "LogNormal",
    "MATERIALS",
    "Material",
    "Mesh",
    "Normal",
    "Placed",
    "Plane",
    "Polyhedron",
    "SAND",
    "Sieve",
    "Sleep",
    "Tube",
    "Uniform",
    "material",
    "measure_grading",
    "mesh_from_file",
]

# Taichi greets on stdout as it is imported; what a script prints is the script's.
os.environ.setdefault("ENABLE_TAICHI_HEADER_PRINT", "0")
os.environ.setdefault("TI_LOG_LEVEL", "error")

if TYPE_CHECKING:
    from .bed import Bed, BedFailure
    from .graded import Graded
    from .grading import measure_grading
    from .materials import MATERIALS, SAND, Facing, Material, material
    from .mesh import Mesh, Polyhedron, mesh_from_file
    from .shapes import Ball, Cone, Cylinder, Plane
    from .sizes import LogNormal, Normal, Sieve, Uniform
    from .sleep import Sleep
    from .solids import Box, Capsule, Placed, Tube

_ROOMS = {
    "bed": ("Bed", "BedFailure"),
    "graded": ("Graded",),
    "grading": ("measure_grading",),
    "materials": ("Facing", "MATERIALS", "Material", "SAND", "material"),
    "mesh": ("Mesh", "Polyhedron", "mesh_from_file"),
    "shapes": ("Ball", "Cone", "Cylinder", "Plane"),
    "sizes": ("LogNormal", "Normal", "Sieve", "Uniform"),
    "sleep": ("Sleep",),
    "solids": ("Box", "Capsule", "Placed", "Tube"),
}


def __getattr__(name: str) -> Any:
    for room, names in _ROOMS.items():
        if name in names:
            return getattr(importlib.import_module(f".{room}", __name__), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
