"""A run or a bed in a notebook."""

from __future__ import annotations

import html
import json
import tempfile
from pathlib import Path
from typing import Any

from vis.pictures.frames import GRAIN_FIELDS, FrameWriter
from vis.view.page import write_view

__all__ = ["View", "html_of_bed", "html_of_run"]

_UNASKED = 6e6
"""Most bytes of the data of a bed that a notebook shows by itself."""


class View:
    """The view of a run, or of the present bed, that a notebook shows for the last line of a cell.

    ``what``: A run folder, or a `dem.Bed` (anything with `time` and `grains()` as a bed has them). ``size``: Most
    bytes of the data. ``height``: Of the frame in the notebook [pixels]. Raises FileNotFoundError or ValueError as
    `vis.view.page.write_view`.
    """

    def __init__(self, what: Any, *, size: float = 30e6, height: int = 640) -> None:
        self.height = height
        with tempfile.TemporaryDirectory() as scratch:
            if isinstance(what, str | Path):
                home = Path(what)
            else:
                home = Path(scratch)
                _write_bed(what, home)
            self._page = write_view(home, Path(scratch) / "view.html", size=size).read_text(encoding="utf-8")

    def save(self, path: str | Path) -> Path:
        """Write the page as a file of its own, and return it."""
        Path(path).write_text(self._page, encoding="utf-8")
        return Path(path)

    def _repr_html_(self) -> str:
        source = html.escape(self._page, quote=True)
        return (
            f'<iframe srcdoc="{source}" width="100%" height="{self.height}" style="border: 0" '
            'sandbox="allow-scripts" title="hedgebed view"></iframe>'
        )


def html_of_bed(bed: Any) -> str:
    """The frame of a bed that is the last line of a cell."""
    return View(bed, size=_UNASKED)._repr_html_()


def html_of_run(run: Any) -> str:
    """The frame of a run of a script, as `coupling.Penetration`, that is the last line of a cell."""
    with tempfile.TemporaryDirectory() as scratch:
        return View(run.save(Path(scratch) / "run"), size=_UNASKED)._repr_html_()


def _write_bed(bed: Any, home: Path) -> None:
    """One frame of a bed, as a run folder. Raises ValueError for what is no bed."""
    try:
        grains = bed.grains().as_dict()
    except AttributeError:
        raise ValueError(f"a view shows a run folder or a bed; it was given {type(bed).__name__}") from None
    FrameWriter(home, name="bed").write(
        0.0, {name: grains[name] for name in ("position", *GRAIN_FIELDS) if name in grains}
    )
    title = f"A bed of {len(grains['position'])} grains at t = {bed.time:.4g} s"
    (home / "result.json").write_text(json.dumps({"title": title, "experiment": "bed", "status": "done"}))
