"""Platform, rig and ground as a co-simulation FMU (FMI 3): what it does in a step, and how the file is made.

Imports `coupling`, `rigid`, `experiments.platform`, `experiments.runs`, `experiments.tumble`, `vis.page`.
"""

from vis.page.sentences import Sentences

__all__ = ["say"]

say = Sentences(__package__)
