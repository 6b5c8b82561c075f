"""A platform in six degrees of freedom on the spring-damper or on grains.

`Settings`, `check`, `run` and `resume` are those of `hedgebed tumble spatial`, loaded when they are first used.

Imports `coupling`, `dem`, `experiments.grains`, `experiments.platform`, `experiments.runs`, `experiments.tumble`,
`rigid`, `vis.page`.
"""

from experiments.runs.registry import face
from vis.page.sentences import Sentences

__all__ = ["Settings", "check", "resume", "run"]

say = Sentences(__package__)
__getattr__ = face("tumble spatial")
