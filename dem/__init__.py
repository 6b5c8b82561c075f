"""The granular bed: spherical grains, shapes that move among them, their preparation and measurement.

The names in ``__all__`` are public and are imported from here. They are looked up when they are first used, so that
``import dem`` does not start Taichi.

Imports nothing of ours outside itself.
"""
# ruff: noqa: F401  # the names below are in __all__, which is made of the table of modules

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

import hedgebed_renamed  # old names of modules

if TYPE_CHECKING:
    from .bed import Bed
    from .engine.values import BedFailure, Grains, Sleep
    from .grains.graded import Graded
    from .grains.materials import MATERIALS, SAND, SAND_WEAK, Facing, Material, material
    from .grains.sizes import LogNormal, Normal, Sieve, Uniform
    from .measure.grading import measure_grading
    from .prepare.report import Prepared, StageReport
    from .shapes.basic import Ball, Cone, Cylinder, Plane
    from .shapes.mesh import Mesh, Polyhedron, mesh_from_file
    from .shapes.solids import Box, Capsule, Placed, Tube

_MODULES = {
    "bed": ("Bed",),
    "engine.values": ("BedFailure", "Grains", "Sleep"),
    "grains.graded": ("Graded",),
    "grains.materials": ("Facing", "MATERIALS", "Material", "SAND", "SAND_WEAK", "material"),
    "grains.sizes": ("LogNormal", "Normal", "Sieve", "Uniform"),
    "measure.grading": ("measure_grading",),
    "prepare.report": ("Prepared", "StageReport"),
    "shapes.basic": ("Ball", "Cone", "Cylinder", "Plane"),
    "shapes.mesh": ("Mesh", "Polyhedron", "mesh_from_file"),
    "shapes.solids": ("Box", "Capsule", "Placed", "Tube"),
}
__all__ = sorted(name for names in _MODULES.values() for name in names)


def __getattr__(name: str) -> Any:
    for module, names in _MODULES.items():
        if name in names:
            return getattr(importlib.import_module(f".{module}", __name__), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
