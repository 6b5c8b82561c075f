"""The platform of an experiment: its numbers with where they come from, and its surface.

Imports `dem.grains`, `experiments.runs`, `rigid`, `vis.page`.
"""

from vis.page.sentences import Sentences

__all__ = ["say"]

say = Sentences(__package__)
