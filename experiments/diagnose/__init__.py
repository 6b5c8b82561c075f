"""Diagnosis: where a model fails on measured trials, which effect it omits, and how sure that is.

`Settings`, `check`, `run` and `resume` are those of `hedgebed diagnose`; calling one imports what computes.

Imports `dem`, `experiments.campaign`, `experiments.check`, `experiments.grains`, `experiments.runs`, `rigid`, `vis`.
"""

from experiments.runs.registry import face

from .settings import DiagnoseSettings as Settings

__all__ = ["Settings", "check", "resume", "run"]

check, resume, run = face("diagnose", Settings)
