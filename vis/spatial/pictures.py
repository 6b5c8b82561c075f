"""Stills and the film of one run in space, or of two side by side: which moments, drawn by OpenGL or flat."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from vis.pictures.frames import read_frames
from vis.pictures.pictures import Picture, Pictures, opengl_available, render_apart
from vis.spatial.film import NAME, run_spatial_job

__all__ = ["ARROWS", "draw_in_space"]

ARROWS = (
    "Red arrows: the force on a spike, to the scale of the weight's above the picture; on the spring-damper without "
    "friction."
)

_MOST_FRAMES = 48


def draw_in_space(
    folders: Sequence[Path],
    home: Path,
    *,
    stem: str,
    by: str,
    film: bool,
    labels: Sequence[str] | None = None,
    progress: Callable[[float], None],
) -> Pictures:
    """Draw figures/STEM-start.png, -middle, -end and film.gif in `home`, by OpenGL in a child process or flat.

    Args:
        folders: One run folder or two, all with frames.
        home: Where the pictures go.
        stem: How the stills' names begin.
        by: What grains are coloured by, a key of `vis.pictures.canvas.COLOURS`.
        film: Whether to make the film.
        labels: What to call two runs.
        progress: Called with the share that is done, 0 to 1.
    """
    every = [read_frames(folder, NAME).times for folder in folders]
    coarse, fine = min(every, key=len), max(every, key=len)
    end = min(float(times[-1]) for times in every)
    # Moments at which the run with the fewest frames has one, so that two are shown at the same.
    moments = dict.fromkeys(float(coarse[np.argmin(np.abs(coarse - time))]) for time in (0.0, 0.5 * end, end))
    names = ("start", "middle", "end") if len(moments) == 3 else ("start", "end")
    stills = [(home / "figures" / f"{stem}-{name}.png", name, time) for name, time in zip(names, moments, strict=False)]
    chosen = np.unique(np.linspace(0, len(fine) - 1, min(_MOST_FRAMES, len(fine))).round().astype(int))
    later = sorted({float(time) for times in every for time in times if time > fine[-1]})  # a longer run goes on alone
    times = [*fine[chosen].tolist(), *later]
    job: dict[str, Any] = {
        "runs": [str(folder) for folder in folders], "labels": list(labels) if labels else None, "by": by,
        "stills": [{"file": str(file), "time": time, "size": [1600, 1000]} for file, _, time in stills],
        "film": {"file": str(home / "film.gif"), "times": times, "size": [960, 600]} if film else None,
    }  # fmt: skip
    seen = "Both platforms" if len(folders) == 2 else "The whole platform"
    drawn = [Picture(file, f"At the {name}", f"{seen}, seen along y from above, at {time:.4g} s.")
             for file, name, time in stills]  # fmt: skip
    moving = None
    if film:
        caption = f"{len(times)} pictures; the camera follows, the colours keep their scale."
        moving = Picture(home / "film.gif", "The film", caption)
    total, done = len(stills) + (len(times) if film else 0), 0

    def step() -> None:
        nonlocal done
        done += 1
        progress(min(1.0, done / max(total, 1)))

    notes: list[str] = []
    if opengl_available():
        failure = render_apart(job, 120.0, step, module="vis.spatial.film")
        if failure is None:
            return Pictures(drawn, moving, "opengl", notes)
        notes.append(f"Rendering with OpenGL failed ({failure}); flat pictures stand in.")
        done = 0
    else:
        notes.append("This machine has no OpenGL for off-screen pictures; flat ones stand in for them.")
    run_spatial_job(job, opengl=False, step=step)
    return Pictures(drawn, moving, "sections", notes)
