"""The sentences of this package, from the file of text beside this module."""

from vis.page.sentences import Sentences

__all__ = ["say"]

say = Sentences(__package__)
