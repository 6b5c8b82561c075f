"""A material whose simulated strength is that of measured sand: design of samples, fit, material file.

`Settings`, `check`, `run` and `resume` are those of `hedgebed bed calibrate`; they are loaded when they are first used.

Imports `dem`, `experiments.bed`, `experiments.grains`, `experiments.penetrate`, `experiments.runs`, `vis`.
"""

from experiments.runs.registry import face

__all__ = ["Settings", "check", "resume", "run"]

__getattr__ = face("bed calibrate")
