"""The version of hedgebed, and what ``python -m hedgebed`` runs.

The code is in the packages ``dem``, ``rigid``, ``coupling``, ``experiments`` and ``vis``.
"""

import sys

from experiments.runs.version import __version__

__all__ = ["__version__", "main"]


def main() -> int:
    """Run the command line on ``sys.argv`` and return its exit status."""
    from experiments.cli.main import main as command_line

    return command_line()


if __name__ == "__main__":
    sys.exit(main())
