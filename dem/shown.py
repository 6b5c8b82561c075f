"""What a notebook shows for an object of ours that is the last line of a cell.

`dem` draws nothing and does not know of pictures. A package that draws says so as an entry point of the group
`hedgebed.html` (pyproject.toml), a function that takes the object and returns HTML.
"""

from contextlib import suppress
from importlib.metadata import entry_points
from typing import Any

__all__ = ["html_of"]


def html_of(kind: str, what: Any) -> str | None:
    """HTML for ``what`` by the installed package that draws a ``kind`` ("bed", "run").

    None where there is none, or where ``what`` cannot be drawn, as a run without rows: a notebook then shows its text.
    """
    for drawer in entry_points(group="hedgebed.html", name=kind):
        with suppress(ValueError, RuntimeError):
            return str(drawer.load()(what))
    return None
