"""Beds prepared as in a laboratory, and tests of their strength: shear, repose, cone, cut, plates.

`Settings`, `check`, `run` and `resume` are those of `hedgebed bed make`; calling one imports what computes.

Imports `dem`, `experiments.grains`, `experiments.penetrate`, `experiments.runs`, `rigid`, `vis`.
"""

from experiments.runs.registry import face

from .settings import BedSettings as Settings

__all__ = ["Settings", "check", "resume", "run"]

check, resume, run = face("bed make", Settings)
