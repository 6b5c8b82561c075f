"""Beds prepared as in a laboratory, and the tests that a laboratory makes of them.

`Settings`, `check`, `run` and `resume` are those of `hedgebed bed make`; they are loaded when they are first used.
Imports `experiments.runs`, `experiments.grains`, `dem` and `vis`.
"""

from experiments.runs.registry import face

__all__ = ["Settings", "check", "resume", "run"]

__getattr__ = face("bed make")
