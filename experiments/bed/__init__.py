"""Beds prepared as in a laboratory, and tests of their strength: shear, repose, cone, vertical cut.

`Settings`, `check`, `run` and `resume` are those of `hedgebed bed make`; they are loaded when they are first used.

Imports `dem`, `experiments.grains`, `experiments.penetrate`, `experiments.runs`, `vis`.
"""

from experiments.runs.registry import face

__all__ = ["Settings", "check", "resume", "run"]

__getattr__ = face("bed make")
