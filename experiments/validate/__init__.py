"""The verification suite of the bed: cases with a known answer, run by `hedgebed validate`.

``suite.SUITE`` lists them; a family of cases is a module with ``CASES``.

Imports `coupling.lammps`, `dem`, `experiments.bed`, `experiments.calibrate`, `experiments.pool`, `experiments.runs`,
`rigid`, `vis`.
"""

from experiments.runs.registry import face

from .settings import ValidateSettings as Settings

__all__ = ["Settings", "check", "resume", "run"]

check, resume, run = face("validate", Settings)
