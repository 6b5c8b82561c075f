"""`hedgebed view RUN`: a run as a page that one can turn, zoom and move through time."""

import math
import os
import sys
import time
import webbrowser
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from experiments.runs.folder import RunFolder
from experiments.runs.progress import make_progress
from experiments.runs.streams import refusing, say, stdout_to_stderr
from rigid.digests import check_digests

__all__ = ["view"]


def view(
    run: Annotated[Path, Parameter(help="The folder of a run.")],
    /,
    *,
    out: Annotated[Path | None, Parameter(help="The page; RUN/view.html if not given.")] = None,
    limit: Annotated[
        float, Parameter(help="Largest size of the page's data [MB]; frames, then grains are left out.")
    ] = 100.0,
    frames: Annotated[int, Parameter(help="Most frames of each run of the folder [1].")] = 240,
    live: Annotated[
        bool, Parameter(help="Make the page again while the run goes on; it reloads itself.", negative="")
    ] = False,
    interval: Annotated[float, Parameter(help="With --live: time from one page to the next [s].")] = 10.0,
    show: Annotated[bool, Parameter(name="open", help="Whether to open the page in a browser.")] = True,
    quiet: Annotated[bool, Parameter(help="Show no progress.", negative="")] = False,
) -> int:
    """Show a run as a page: its scene, which can be turned and zoomed, over time, with its curves beside it."""
    from vis.view.page import write_view

    with refusing():
        for name, value in (("limit", limit), ("interval", interval)):
            if not (math.isfinite(value) and value > 0.0):
                raise ValueError(f"{name} = {value!r}; it must be a positive number")
        if frames < 1:
            raise ValueError(f"frames = {frames}; a page shows at least 1")
        folder = RunFolder.open(run)
        check_digests(run)
        if not any((run / name).is_file() for name in ("status.json", "cost.json")):
            say(f"warning: {run / 'status.json'} is missing: whether the run has ended is not known")
        page = run / "view.html" if out is None else out
        if page.suffix != ".html" or not page.parent.is_dir():
            raise ValueError(f"out = {str(out)!r}; it must name a file that ends in .html, in a folder that exists")
        while True:
            again = live and folder.status == "running"
            with stdout_to_stderr(), make_progress(quiet=quiet) as progress:
                progress.stage("page", total=1.0)
                write_view(
                    run, page, size=1e6 * limit, frames=frames, live=interval if again else 0.0,
                    progress=progress.update,
                )  # fmt: skip
            if show:
                _open(page)
                show = False
            if not again:
                break
            time.sleep(interval)
            folder = RunFolder.open(run)
            check_digests(run)
    print(f"page: {page}")
    return 0


def _open(page: Path) -> None:
    """Open a page in the browser of a graphical session; elsewhere the user opens it from its path."""
    graphical = sys.platform in ("win32", "darwin") or os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    if not graphical or not webbrowser.open(page.resolve().as_uri()):
        say(f"no browser could be started here: open {page} in one")
