"""Still pictures and the film of one run or two: cameras that follow the platform, a colour scale that stays put.

A sheet shows each run through the cameras of its kind (`vis.film.cameras`), two runs side by side, and below them their
states over time with a cursor. `python -m vis.film.film <job.json>` draws a job with OpenGL in a process of its own, as
`vis.pictures.render` does for spikes.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NotRequired, TypedDict

import numpy as np
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from numpy.typing import NDArray

from vis.film.cameras import layout
from vis.film.reel import AnyReel, Reel, SpaceReel
from vis.page.page import Block, Progress, figure
from vis.page.plots import Array
from vis.page.sentences import Sentences
from vis.page.states import state_strip
from vis.page.style import styled
from vis.pictures.arrows import draw_force, draw_measure
from vis.pictures.canvas import COLOURS, blank_page, colour_bar, colour_values, colourmap, pixels
from vis.pictures.frames import Frame
from vis.pictures.pictures import Counter, Picture, Pictures, carry_out
from vis.pictures.render import replace_file, write_gif, write_png
from vis.pictures.stage import Stage

__all__ = ["ARROWS", "MOST_FRAMES", "Sheet", "Stills", "draw_in_space", "draw_reels", "run_film_job", "shown"]

say = Sentences(__package__)
ARROWS = say("arrows")
MOST_FRAMES = 48
Stills = Sequence[tuple[Path, str, float, str]]
"""Of each still: file, title, time [s], caption."""


class _Still(TypedDict):
    file: str
    time: float
    size: Sequence[int]


class _Film(TypedDict):
    file: str
    times: list[float]
    size: Sequence[int]


class FilmJob(TypedDict):
    """What a process of its own draws: runs by their folders, at times [s], in sizes [pixels]."""

    runs: list[str]
    labels: list[str] | None
    by: str
    stills: list[_Still]
    film: _Film | None
    in_space: NotRequired[bool]
    spikes: NotRequired[list[list[float]]]
    """Of runs in the plane: diameter of a spike, its length out of the hull [m]."""


class Sheet:
    """Draws the pictures of one or two runs.

    ``reels``: The runs, one or two, of one kind. ``size``: Of the sheet [pixels]. ``by``: What grains are coloured by,
    a key of `vis.pictures.canvas.COLOURS`. ``opengl``: Whether to render with OpenGL. ``labels``: What to call two
    runs; by their ground or title if not given.
    """

    def __init__(
        self,
        reels: Sequence[AnyReel],
        size: tuple[int, int],
        *,
        by: str,
        opengl: bool,
        labels: Sequence[str] | None = None,
    ) -> None:
        self.reels, self.size, self.by = list(reels), size, by
        self.labels = [reel.called for reel in self.reels] if labels is None else list(labels)
        self.norm = Normalize(0.0, max(reel.colour_top(by) for reel in self.reels) or 1.0)
        self.map = colourmap()
        self.weight = max(reel.number("weight") for reel in self.reels)
        reach = max(reel.reach for reel in self.reels)
        self.panels = layout(self.reels)
        self.stages, self.ways = [], []
        for panel in self.panels:
            own = (round(panel.place[2] * size[0]), round(panel.place[3] * size[1]))
            stage, way = panel.camera.set_up(self.reels[panel.run], own, reach, opengl=opengl)
            self.stages.append(stage)
            self.ways.append(way)

    def draw(self, time: float) -> NDArray[np.uint8]:
        """The sheet at `time` [s], shape (height, width, 3)."""
        with styled():
            sheet = blank_page(self.size, 12.8)
            for number in range(len(self.panels)):
                self._panel(sheet, number, time)
            for number, reel in enumerate(self.reels):
                left = next(panel.place[0] for panel in self.panels if panel.run == number)
                title = str(reel.result["title"]) if len(self.reels) == 1 else self.labels[number]
                sheet.text(left, 0.975, title, fontsize=15, fontweight="bold", va="top")
                sheet.text(left, 0.93, reel.line(reel.nearest(time)), fontsize=13, va="top", color="#444444")
            for panel in self.panels:
                if panel.camera.arrow:
                    long = panel.camera.arrow * panel.place[3] * float(sheet.get_size_inches()[1])
                    right = panel.place[0] + panel.place[2]
                    draw_measure(sheet, right=right, height=0.915, length=long, weight=self.weight)
            if all(len(reel.states) for reel in self.reels):
                runs = [{"t_s": reel.series["t_s"], "state": reel.states} for reel in self.reels]
                state_strip(sheet, runs, self.labels, time)
            if any(reel.on_grains for reel in self.reels):
                colour_bar(sheet, self.reels[0].bar, self.norm, self.map, COLOURS[self.by][0], 10.5)
            return pixels(sheet)

    def close(self) -> None:
        """Free the windows."""
        for stage in self.stages:
            if isinstance(stage, Stage):
                stage.close()

    def _panel(self, sheet: Figure, number: int, time: float) -> None:
        """One picture: ground and platform, what its camera draws over them, forces."""
        panel, stage = self.panels[number], self.stages[number]
        reel, camera = self.reels[panel.run], panel.camera
        index = reel.nearest(time)
        frame, focus = reel.frame(index), (float(self.ways[number][index, 0]), float(self.ways[number][index, 1]))
        axis = sheet.add_axes(panel.place)
        axis.set(xlim=(0.0, 1.0), ylim=(0.0, 1.0), autoscale_on=False, xticks=[], yticks=[])
        axis.grid(False)
        if isinstance(stage, Stage):
            image = stage.render(frame, self._colours(frame), focus)
            axis.imshow(image, extent=(0.0, 1.0, 0.0, 1.0), aspect="auto", interpolation="nearest")
        else:
            stage.draw(axis, frame, self._colours(frame), focus)
        camera.dress(axis, reel, stage, frame, focus)
        if camera.arrow:
            long = camera.arrow * stage.height / self.weight  # [m/N]
            points, fields = frame.clouds.get("row_forces", (np.zeros((0, 3)), {}))
            for point, force in zip(points, fields.get("force", np.zeros((0, 3))), strict=True):
                ends = stage.place(np.array([point, point + long * np.asarray(force, dtype=float)]), focus)
                draw_force(axis, ends[0], ends[1], float(np.linalg.norm(force)))

    def _colours(self, frame: Frame) -> Array:
        if not len(frame.grains["position"]):
            return np.zeros((0, 4))
        return np.asarray(self.map(self.norm(colour_values(frame.grains, self.by))))


def draw_reels(
    reels: Sequence[AnyReel],
    stills: Stills,
    film: Path | None,
    times: Sequence[float],
    *,
    by: str,
    about: str = "",
    labels: Sequence[str] | None = None,
    progress: Progress | None = None,
) -> Pictures:
    """Stills and film of one or two runs, by OpenGL in a child process or flat.

    ``film``: Its file; None: none is made. ``times``: Of its pictures [s]. ``about``: What its caption says after their
    number.
    """
    kind = reels[0]
    job: FilmJob = {
        "runs": [str(reel.folder) for reel in reels],
        "labels": list(labels) if labels else None,
        "by": by,
        "stills": [{"file": str(file), "time": time, "size": kind.still} for file, _, time, _ in stills],
        "film": {"file": str(film), "times": list(times), "size": kind.film} if film else None,
        "in_space": isinstance(kind, SpaceReel),
    }
    job["spikes"] = [list(reel.spikes) for reel in reels if isinstance(reel, Reel)]
    moving = None
    if film:
        caption = f"{len(times)} pictures{about}; the camera follows, the colours keep their scale."
        moving = Picture(film, "The film", caption)
    counter = Counter([1.0] * (len(stills) + (len(times) if film else 0)), progress)
    flat = partial(run_film_job, job, opengl=False, step=counter.step)
    method, note = carry_out(job, counter, flat, module="vis.film.film", failed=kind.failed, without=kind.without)
    return Pictures([Picture(file, title, said) for file, title, _, said in stills], moving, method, note)


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

    ``folders``: One run folder or two, all with frames. ``home``: Where the pictures go. ``stem``: How the stills'
    names begin. ``by``: What grains are coloured by, a key of `vis.pictures.canvas.COLOURS`. ``film``: Whether to make
    the film. ``progress``: Called with the share that is done, 0 to 1. ``labels``: What to call two runs.
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


def shown(drawn: Pictures, *, first: int = 0) -> list[Block]:
    """Film and stills, from the still `first` on, as a report has them."""
    film = [drawn.animation] if drawn.animation is not None else []
    return [
        figure(one.file, title=one.title, caption=one.caption, show_file=one in film)
        for one in (*film, *drawn.stills[first:])
    ]


def run_film_job(job: FilmJob, *, opengl: bool, step: Callable[[], None] = lambda: None) -> None:
    """Draw every picture of a job; `step` is called after each."""
    spikes: Sequence[Any] = job.get("spikes") or [None] * len(job["runs"])
    reels: list[AnyReel] = (
        [SpaceReel(folder) for folder in job["runs"]]
        if job.get("in_space")
        else [
            Reel.open(folder, like=None if like is None else (float(like[0]), float(like[1])))
            for folder, like in zip(job["runs"], spikes, strict=True)
        ]
    )
    sheets: dict[tuple[int, int], Sheet] = {}

    def draw(size: Sequence[int], time: float) -> NDArray[np.uint8]:
        key = (int(size[0]), int(size[1]))
        if key not in sheets:
            sheets[key] = Sheet(reels, key, by=job["by"], opengl=opengl, labels=job.get("labels"))
        return sheets[key].draw(time)

    try:
        for still in job["stills"]:
            replace_file(Path(still["file"]), partial(write_png, draw(still["size"], still["time"])))
            step()
        if film := job.get("film"):
            images = []
            for time in film["times"]:
                images.append(draw(film["size"], time))
                step()
            replace_file(Path(film["file"]), partial(write_gif, images=images, frame_ms=100))
    finally:
        for each in sheets.values():
            each.close()


def main(arguments: list[str] | None = None) -> int:
    """Carry out the job in the file that is named; exit status 0."""
    (name,) = sys.argv[1:] if arguments is None else arguments
    job: FilmJob = json.loads(Path(name).read_text(encoding="utf-8"))
    run_film_job(job, opengl=True, step=lambda: print("done", flush=True))
    return 0


if __name__ == "__main__":
    sys.exit(main())
