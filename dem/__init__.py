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
    "Cone",
    "Cylinder",
    "Facing",
    "LogNormal",
    "MATERIALS",
    "Material",
    "Normal",
    "Plane",
    "SAND",
    "Sieve",
    "Uniform",
    "material",
]

# Taichi greets on stdout as it is imported; what a script prints is the script's.
os.environ.setdefault("ENABLE_TAICHI_HEADER_PRINT", "0")
os.environ.setdefault("TI_LOG_LEVEL", "error")

if TYPE_CHECKING:
    from .bed import Bed, BedFailure
    from .materials import MATERIALS, SAND, Facing, Material, material
    from .shapes import Ball, Cone, Cylinder, Plane
    from .sizes import LogNormal, Normal, Sieve, Uniform

_ROOMS = {
    "bed": ("Bed", "BedFailure"),
    "materials": ("Facing", "MATERIALS", "Material", "SAND", "material"),
    "shapes": ("Ball", "Cone", "Cylinder", "Plane"),
    "sizes": ("LogNormal", "Normal", "Sieve", "Uniform"),
}


def __getattr__(name: str) -> Any:
    for room, names in _ROOMS.items():
        if name in names:
            return getattr(importlib.import_module(f".{room}", __name__), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
