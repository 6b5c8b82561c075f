"""A material whose simulated strength is that of measured sand: design of samples, fit, material file.

`Settings`, `check`, `run` and `resume` are those of `hedgebed bed calibrate`; calling one imports what computes.

Imports `dem`, `experiments.bed`, `experiments.grains`, `experiments.penetrate`, `experiments.runs`, `rigid`, `vis`.
"""

from experiments.runs.registry import face

from .settings import CalibrateSettings as Settings

__all__ = ["Settings", "check", "resume", "run"]

check, resume, run = face("bed calibrate", Settings)
