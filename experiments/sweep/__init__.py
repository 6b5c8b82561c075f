"""Many runs of one experiment over its settings: on the cores here or on a cluster, one table in the end.

`Settings`, `check`, `run` and `resume` are those of `hedgebed sweep`; calling one imports what computes.

Imports `experiments.converge`, `experiments.penetrate`, `experiments.pool`, `experiments.runs`, `experiments.suite`,
`experiments.tumble`, `rigid`, `vis.page`, `vis.penetrate`.
"""

from experiments.runs.registry import face

from .settings import SweepSettings as Settings

__all__ = ["Settings", "check", "resume", "run"]

check, resume, run = face("sweep", Settings)
