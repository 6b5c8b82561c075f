"""The trials of Reid, Roveda, Nesnas and Pavone (i-SAIRAS 2014) beside what the paper states.

`Settings`, `check`, `run` and `resume` are those of `hedgebed paper`; they are loaded when they are first used.

Imports `experiments.platform`, `experiments.runs`, `experiments.tumble`, `rigid`, `vis.page`.
"""

from experiments.runs.registry import face
from vis.page.sentences import Sentences

__all__ = ["Settings", "check", "resume", "run"]

say = Sentences(__package__)
__getattr__ = face("paper")
