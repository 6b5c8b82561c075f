"""Two finished runs in one report: numbers with differences, what both did over time.

`Settings`, `check`, `run` and `resume` are those of `hedgebed compare`; calling one imports what computes.

Imports `experiments.grains`, `experiments.platform`, `experiments.runs`, `experiments.spatial`, `rigid`, `vis.page`,
`vis.penetrate`.
"""

from experiments.runs.registry import face

from .settings import CompareSettings as Settings

__all__ = ["Settings", "check", "resume", "run"]

check, resume, run = face("compare", Settings)
