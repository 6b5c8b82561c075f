"""The version of hedgebed, and what ``python -m hedgebed`` runs.

The code is in the packages ``dem``, ``rigid``, ``coupling``, ``experiments`` and ``vis``.
"""

import sys
from importlib import import_module

__all__ = ["__version__", "main"]

__version__: str = import_module("experiments.runs.version").__version__


def main() -> int:
    """Run the command line on ``sys.argv`` and return its exit status."""
    return import_module("experiments.cli.main").main()


if __name__ == "__main__":
    sys.exit(main())
