"""A hop: the wheel speed or torque for a distance, on rigid and on compliant ground.

`Settings`, `check`, `run` and `resume` are those of `hedgebed hop`; calling one imports what computes.

Imports `experiments.platform`, `experiments.runs`, `experiments.tumble`, `rigid`, `vis.page`.
"""

from experiments.runs.registry import face

from .settings import HopSettings as Settings

__all__ = ["Settings", "check", "resume", "run"]

check, resume, run = face("hop", Settings)
