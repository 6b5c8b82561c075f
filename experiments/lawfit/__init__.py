"""Surface laws fitted to finished runs of a spike in grains: K and C, rivals, the range in which each holds.

`Settings`, `check`, `run` and `resume` are those of `hedgebed calibrate`; calling one imports what computes. (`hedgebed
bed calibrate`, which fits the grains, is `experiments.calibrate`.)

Imports `coupling`, `dem`, `experiments.converge`, `experiments.grains`, `experiments.penetrate`,
`experiments.platform`, `experiments.pool`, `experiments.runs`, `rigid`, `vis.page`.
"""

from experiments.runs.registry import face

from .settings import LawFitSettings as Settings

__all__ = ["Settings", "check", "resume", "run"]

check, resume, run = face("calibrate", Settings)
