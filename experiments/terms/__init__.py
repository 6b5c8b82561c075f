"""Effects of one's own, each in a file: examples, and what `hedgebed paper` adds to the model."""

__all__: list[str] = []
