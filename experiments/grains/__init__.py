"""Grains under a platform or a spike: the bed's size and preparation, softening, the run on it.

Imports `coupling`, `coupling.robot`, `dem`, `experiments.platform`, `experiments.runs`, `rigid`, `vis`.
"""

from vis.page.sentences import Sentences

__all__ = ["say"]

say = Sentences(__package__)
