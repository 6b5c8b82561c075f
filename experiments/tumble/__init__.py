"""A tumble in the plane: on the spring-damper or a law, over a range, on grains; campaigns made of tumbles.

`Settings`, `check`, `run` and `resume` are those of `hedgebed tumble`; calling one imports what computes.

Imports `coupling`, `dem`, `experiments.campaign`, `experiments.grains`, `experiments.platform`, `experiments.runs`,
`rigid`, `vis`.
"""

from experiments.runs.registry import face

from .settings import TumbleSettings as Settings
from .settings import say as say

__all__ = ["Settings", "check", "resume", "run"]

check, resume, run = face("tumble", Settings)
