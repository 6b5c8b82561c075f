"""A spike driven into, dropped on and set down on a bed, beside the spring-damper fitted to it.

`Settings`, `check`, `run` and `resume` are those of `hedgebed penetrate`; calling one imports what computes.

Imports `coupling`, `dem`, `experiments.campaign`, `experiments.diagnose`, `experiments.grains`, `experiments.platform`,
`experiments.runs`, `rigid`, `vis`.
"""

from experiments.runs.registry import face

from .settings import PenetrateSettings as Settings

__all__ = ["Settings", "check", "resume", "run"]

check, resume, run = face("penetrate", Settings)
