"""Jobs of pictures for a process of its own: stills and a film, drawn by views of one size each."""

from __future__ import annotations

import functools
import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, Protocol

from vis.pictures.render import replace_file, write_gif, write_png

__all__ = ["Drawer", "draw_job", "job_of"]


class Drawer(Protocol):
    """What draws pictures of one size until it is closed."""

    def draw(self, moment: Any, /) -> Any:
        """The picture of a moment, a time or the index of a frame."""

    def close(self) -> None:
        """Give back what drawing needs."""


def draw_job(
    job: dict[str, Any], make: Callable[[tuple[int, int]], Drawer], *, moment: str, moments: str,
    step: Callable[[], None] = lambda: None,
) -> None:  # fmt: skip
    """Draw every picture of a job; `step` is called after each.

    Args:
        job: Its `stills` have a `size`, a `file` and a moment under the key `moment`; its `film`, if any, moments under
            the key `moments`.
        make: A drawer of pictures of a size; each size is made once.
    """
    views: dict[tuple[int, int], Drawer] = {}

    def view(size: list[int]) -> Drawer:
        key = (int(size[0]), int(size[1]))
        if key not in views:
            views[key] = make(key)
        return views[key]

    try:
        for still in job["stills"]:
            image = view(still["size"]).draw(still[moment])
            replace_file(Path(still["file"]), functools.partial(write_png, image))
            step()
        if film := job.get("film"):
            images = []
            for at in film[moments]:
                images.append(view(film["size"]).draw(at))
                step()
            replace_file(Path(film["file"]), functools.partial(write_gif, images=images, frame_ms=100))
    finally:
        for each in views.values():
            each.close()


def job_of(arguments: list[str] | None) -> dict[str, Any]:
    """The job in the file that the command line, or `arguments`, names."""
    (name,) = sys.argv[1:] if arguments is None else arguments
    job: dict[str, Any] = json.loads(Path(name).read_text(encoding="utf-8"))
    return job
