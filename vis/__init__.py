"""Frames, pictures, plots and the report of a run folder.

Reads and writes run folders (docs/architecture.md) and plain arrays, and knows nothing of the runs themselves. A
picture can thus be made again, elsewhere, years later. The modules:

`vis.pictures.frames` (VTU and PVD), `vis.pictures.meshes` (triangle meshes), `vis.pictures.pictures` (off-screen
pictures and the animation), `vis.report` (`report.html`). What scripts want most can be had from `vis` itself, and is
loaded when it is first asked for: frames are written without matplotlib.

Imports `rigid`.
"""

from __future__ import annotations

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
