"""Frames, pictures, plots and the report of a run folder.

Reads and writes run folders (docs/architecture.md) and plain arrays, and knows nothing of the runs themselves. A
picture can thus be made again, elsewhere, years later. The modules:

`vis.pictures.frames` (VTU and PVD), `vis.pictures.meshes` (triangle meshes), `vis.pictures.pictures` (off-screen
pictures and the animation), `vis.report` (`report.html`). What scripts want most can be had from `vis` itself, and is
loaded when it is first asked for: frames are written without matplotlib. In a notebook, `import vis` makes a `dem.Bed`
that is the last line of a cell show itself.

Imports `rigid`.
"""

from __future__ import annotations

import sys
from importlib import import_module
from typing import TYPE_CHECKING, Any

import hedgebed_renamed  # noqa: F401  (old names of modules)

if TYPE_CHECKING:
    from vis.pictures.frames import FrameWriter, read_frames
    from vis.report import write_report
    from vis.view.notebook import View

__all__ = ["FrameWriter", "View", "read_frames", "write_report"]

_HOMES = {"FrameWriter": "vis.pictures.frames", "read_frames": "vis.pictures.frames", "write_report": "vis.report"}
_HOMES["View"] = "vis.view.notebook"


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


def _show_beds() -> None:
    """Show a bed in a notebook, where one runs: a bed itself draws nothing, as `dem` does not know of pictures."""
    ipython = sys.modules.get("IPython")
    shell = None if ipython is None else ipython.get_ipython()
    if shell is not None:
        of_html = shell.display_formatter.formatters["text/html"]
        of_html.for_type_by_name("dem.bed", "Bed", lambda bed: import_module("vis.view.notebook").html_of_bed(bed))


_show_beds()
