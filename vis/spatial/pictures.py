"""Stills and the film of one run in space, or of two side by side: which moments, drawn by OpenGL or flat."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from vis.film.film import MOST_FRAMES, draw_reels
from vis.film.reel import SpaceReel
from vis.page.report import Progress
from vis.page.sentences import Sentences
from vis.pictures.pictures import Pictures

__all__ = ["ARROWS", "draw_in_space"]

say = Sentences(__package__)
ARROWS = say("arrows")


def draw_in_space(
    folders: Sequence[Path],
    home: Path,
    *,
    stem: str,
    by: str,
    film: bool,
    progress: Progress,
    labels: Sequence[str] | None = None,
) -> Pictures:
    """Draw figures/STEM-start.png, -middle, -end and film.gif in `home`, by OpenGL in a child process or flat.

    Args:
        folders: One run folder or two, all with frames.
        home: Where the pictures go.
        stem: How the stills' names begin.
        by: What grains are coloured by, a key of `vis.pictures.canvas.COLOURS`.
        film: Whether to make the film.
        progress: Called with the share that is done, 0 to 1.
        labels: What to call two runs.
    """
    reels = [SpaceReel(folder) for folder in folders]
    coarse, fine = (of(reels, key=len).times for of in (min, max))
    end = min(float(reel.times[-1]) for reel in reels)
    # Moments at which the run with the fewest frames has one, so that two are shown at the same.
    moments = dict.fromkeys(float(coarse[np.argmin(np.abs(coarse - time))]) for time in (0.0, 0.5 * end, end))
    names = ("start", "middle", "end") if len(moments) == 3 else ("start", "end")
    seen = "Both platforms" if len(folders) == 2 else "The whole platform"
    stills = [
        (home / "figures" / f"{stem}-{name}.png", f"At the {name}", time,
         f"{seen}, seen along y from above, at {time:.4g} s.")
        for name, time in zip(names, moments, strict=False)
    ]  # fmt: skip
    chosen = np.unique(np.linspace(0, len(fine) - 1, min(MOST_FRAMES, len(fine))).round().astype(int))
    later = sorted({float(time) for reel in reels for time in reel.times if time > fine[-1]})  # of the longer run
    times = [*fine[chosen].tolist(), *later]
    return draw_reels(
        reels, stills, home / "film.gif" if film else None, times, by=by, labels=labels, progress=progress
    )
