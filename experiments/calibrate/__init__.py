"""Grain parameters from bulk figures: a response surface over sheared samples.

`Settings`, `check`, `run` and `resume` are those of `hedgebed bed calibrate`; they are loaded when they are first used.
Imports `experiments.bed` and what that may import.
"""

from experiments.runs.registry import face

__all__ = ["Settings", "check", "resume", "run"]

__getattr__ = face("bed calibrate")
