"""A penetration case on finer grains, in wider and deeper beds, stiffer, at other speeds, on several beds.

`Settings`, `check`, `run` and `resume` are those of `hedgebed converge`; calling one imports what computes.

Imports `dem`, `experiments.grains`, `experiments.penetrate`, `experiments.pool`, `experiments.runs`, `rigid`, `vis`.
"""

from experiments.runs.registry import face

from .settings import ConvergeSettings as Settings

__all__ = ["Settings", "check", "resume", "run"]

check, resume, run = face("converge", Settings)
