"""A spike driven into, dropped on and set down on a bed, beside the spring-damper fitted to it.

`Settings`, `check`, `run` and `resume` are those of `hedgebed penetrate`; they are loaded when they are first used.

Imports `coupling`, `dem`, `experiments.campaign`, `experiments.diagnose`, `experiments.grains`, `experiments.runs`,
`rigid`, `vis`.
"""

from experiments.runs.registry import face
from vis.page.sentences import Sentences

__all__ = ["Settings", "check", "resume", "run"]

say = Sentences(__package__)
__getattr__ = face("penetrate")
