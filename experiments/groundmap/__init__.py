"""K, C and sinkage of a spike over gravity, packing and tip diameter, looked up in kept results.

`Settings`, `check`, `run` and `resume` are those of `hedgebed ground`; calling one imports what computes.

Imports `dem.grains`, `experiments.grains`, `experiments.runs`, `rigid`, `vis.page`.
"""

from experiments.runs.registry import face

from .settings import GroundSettings as Settings

__all__ = ["Settings", "check", "resume", "run"]

check, resume, run = face("ground", Settings)
