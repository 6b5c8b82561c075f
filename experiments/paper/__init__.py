"""The trials of Reid, Roveda, Nesnas and Pavone (i-SAIRAS 2014) beside what the paper states.

`Settings`, `check`, `run` and `resume` are those of `hedgebed paper`; calling one imports what computes.

Imports `experiments.platform`, `experiments.runs`, `experiments.tumble`, `rigid`, `vis.page`.
"""

from experiments.runs.registry import face

from .settings import PaperSettings as Settings

__all__ = ["Settings", "check", "resume", "run"]

check, resume, run = face("paper", Settings)
