"""Effects of one's own, each in a file: examples to start from.

Imports `rigid`.
"""

__all__: list[str] = []
