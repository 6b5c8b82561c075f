"""The experiments: settings, runs, results, and the command line over them. See docs/architecture.md."""

__all__: list[str] = []
