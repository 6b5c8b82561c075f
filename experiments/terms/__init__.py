"""Terms of one's own, each in a file with a `TERM`: examples, and what `hedgebed paper` adds to the model."""

__all__: list[str] = []
