"""A tumble in the plane: on the spring-damper or a law, over a range, on grains; campaigns made of tumbles.

`Settings`, `check`, `run` and `resume` are those of `hedgebed tumble`; they are loaded when they are first used.

Imports `coupling`, `dem`, `experiments.campaign`, `experiments.grains`, `experiments.platform`, `experiments.runs`,
`rigid`, `vis`.
"""

from experiments.runs.registry import face
from vis.page.sentences import Sentences

__all__ = ["Settings", "check", "resume", "run"]

say = Sentences(__package__)
__getattr__ = face("tumble")
