"""A platform in six degrees of freedom on the spring-damper or on grains.

`Settings`, `check`, `run` and `resume` are those of `hedgebed tumble spatial`; calling one imports what computes.

Imports `coupling`, `dem`, `experiments.grains`, `experiments.platform`, `experiments.runs`, `experiments.tumble`,
`rigid`, `vis.page`.
"""

from experiments.runs.registry import face

from .settings import SpatialSettings as Settings
from .settings import say as say

__all__ = ["Settings", "check", "resume", "run"]

check, resume, run = face("tumble spatial", Settings)
