"""The experiments: settings, runs, results, and the command line over them. See docs/architecture.md."""

import hedgebed_renamed  # noqa: F401  (old names of modules)

__all__: list[str] = []
