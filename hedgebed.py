"""The version of hedgebed, and the way in for ``python -m hedgebed``.

Everything else lives in the rooms: ``dem``, ``rigid``, ``coupling``, ``experiments`` and ``vis``.
"""

import sys

__all__ = ["__version__", "main"]

__version__ = "0.1.0"


def main() -> int:
    """Run the command line on ``sys.argv`` and return its exit status."""
    from experiments.cli import main as command_line

    return command_line()


if __name__ == "__main__":
    sys.exit(main())
