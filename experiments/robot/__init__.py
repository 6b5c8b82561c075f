"""A robot of MuJoCo on a surface law or on a bed of grains.

`Settings`, `check`, `run` and `resume` are those of `hedgebed mujoco`; calling one imports what computes.
`experiments.robot.own_loop.law_of_run` is its surface law for a loop of one's own.

Imports `coupling`, `coupling.robot`, `dem`, `experiments.converge`, `experiments.grains`, `experiments.groundmap`,
`experiments.platform`, `experiments.runs`, `rigid`, `vis`.
"""

from experiments.runs.registry import face

from .settings import RobotSettings as Settings
from .settings import say as say

__all__ = ["Settings", "check", "resume", "run"]

check, resume, run = face("mujoco", Settings)
