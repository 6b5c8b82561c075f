"""Diagnosis: where a model fails on measured trials, which effect it lacks, and how sure that is.

`Settings`, `check`, `run` and `resume` are those of `hedgebed diagnose`; they are loaded when they are first used.

Imports `dem`, `experiments.campaign`, `experiments.check`, `experiments.grains`, `experiments.runs`, `rigid`, `vis`.
"""

from experiments.runs.registry import face

__all__ = ["Settings", "check", "resume", "run"]

__getattr__ = face("diagnose")
