"""Two finished runs in one report: numbers with differences, what both did over time.

`Settings`, `check`, `run` and `resume` are those of `hedgebed compare`; they are loaded when they are first used.

Imports `experiments.grains`, `experiments.platform`, `experiments.runs`, `experiments.spatial`, `rigid`, `vis.page`.
"""

from experiments.runs.registry import face
from vis.page.sentences import Sentences

__all__ = ["Settings", "check", "resume", "run"]

say = Sentences(__package__)
__getattr__ = face("compare")
