"""Effects of one's own, each in a file: examples, and what `hedgebed paper` adds to the model.

Imports `rigid`.
"""

__all__: list[str] = []
