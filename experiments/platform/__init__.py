"""The platform of an experiment: its numbers with where they come from, surfaces, lengths that are refused.

Imports `experiments.runs`, `rigid` and `vis.page` only.
"""

from vis.page.sentences import Sentences

__all__ = ["say"]

say = Sentences(__package__)
