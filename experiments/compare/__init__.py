"""Two finished runs in one report: numbers with differences, what both did over time.

`Settings`, `check`, `run` and `resume` are those of `hedgebed compare`; they are loaded when they are first used.
Imports `experiments.spatial` and what that may import.
"""

from experiments.runs.registry import face

__all__ = ["Settings", "check", "resume", "run"]

__getattr__ = face("compare")
