"""Diagnose: where a model fails on measured trials, which effect it lacks, and how sure that is (docs/diagnose.md).

`Settings`, `check`, `run` and `resume` are those of `hedgebed diagnose`; they are loaded when they are first used.
Imports `experiments.runs`, `campaign`, `check`, `platform` and `tumble`, `rigid` and `vis`.
"""

from experiments.runs.registry import face

__all__ = ["Settings", "check", "resume", "run"]

__getattr__ = face("diagnose")
