"""A hop: the wheel speed or torque for a distance, on rigid ground and on ground that gives.

`Settings`, `check`, `run` and `resume` are those of `hedgebed hop`; they are loaded when they are first used.

Imports `experiments.platform`, `experiments.runs`, `experiments.tumble`, `rigid`, `vis.page`.
"""

from experiments.runs.registry import face
from vis.page.sentences import Sentences

__all__ = ["Settings", "check", "resume", "run"]

say = Sentences(__package__)
__getattr__ = face("hop")
