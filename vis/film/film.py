"""Still pictures and the film of one run or two: cameras that follow the platform, a colour scale that stays put.

A sheet shows each run through the cameras of its kind (`vis.film.cameras`). Two runs stand side by side, and below them
their states over time with a cursor. `python -m vis.film.film <job.json>` draws a job with OpenGL in a process of its
own, as `vis.pictures.render` does for spikes.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, TypedDict

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from vis.film.cameras import layout
from vis.film.reel import AnyReel, Reel, SpaceReel
from vis.page.numbers import quote, typeset
from vis.page.page import Block, figure
from vis.page.plots import Array, styled
from vis.page.report import Progress, capital
from vis.page.sentences import Sentences
from vis.page.states import state_strip
from vis.pictures import canvas
from vis.pictures.pictures import Picture, Pictures, carry_out
from vis.pictures.render import main, write_pictures

__all__ = [
    "ARROWS",
    "ARROWS_OF_FEET",
    "MOST_FRAMES",
    "Sheet",
    "draw_runs",
    "film_times",
    "moments",
    "run_film_job",
    "shown",
]

say = Sentences(__package__)
ARROWS, ARROWS_OF_FEET = say("arrows"), say("arrows_of_feet")
MOST_FRAMES = 48
_GRAVITY = re.compile(r"\b(?:rig|free) at \S+ m/s2")
"""In the title of a tumble."""
_INCHES = 12.8
"""Width of a sheet, which sets the size of its letters."""
_TITLE = 15.0
"""Size of a title [points]."""
_TALLEST = 2.0
"""Weights whose arrow is as long as the longest arrow of a run in space: a robot that hops pushes with several."""
_LEAST = 0.2
"""Least scale of the arrows, over that at which none is shortened: a blow of more than ten weights is cut, with its
number, so that others can be seen."""
_MET = 0.95
"""Of the largest force of a run: from there on a picture is at that moment."""
_WORDS = {"start": "when the torque begins", "half": "half way round", "end": "at the end"}


class _Picture(TypedDict):
    """A still at one time [s], or a film at several, of a size [pixels]."""

    file: str
    times: list[float]
    size: Sequence[int]
    by: str
    """What grains are coloured by."""


class FilmJob(TypedDict):
    """What a process of its own draws."""

    runs: list[tuple[str, tuple[float, float] | None]]
    """Folder, and in the plane the diameter of a spike and its length out of the hull [m]; None: a run in space."""
    labels: list[str] | None
    pictures: list[_Picture]


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
        self.reels, self.size = list(reels), size
        self.labels = [reel.called for reel in self.reels] if labels is None else list(labels)
        self.page = canvas.Page(size, by, max(reel.colour_top(by) for reel in self.reels) or 1.0)
        self.weight = max(reel.number("weight") for reel in self.reels)
        peak = max((reel.peak for reel in self.reels if isinstance(reel, SpaceReel)), default=0.0)
        self.shorter = float(np.clip(_TALLEST * self.weight / peak, _LEAST, 1.0)) if peak > 0.0 else 1.0
        reach = max(reel.reach for reel in self.reels)
        self.panels = layout(self.reels)
        self._still: Any = None
        self.stages, self.ways = [], []
        for panel in self.panels:
            own = (round(panel.place[2] * size[0]), round(panel.place[3] * size[1]))
            stage, way = panel.camera.set_up(self.reels[panel.run], own, reach, opengl=opengl)
            self.stages.append(stage)
            self.ways.append(way)

    def draw(self, time: float) -> NDArray[np.uint8]:
        """The sheet at `time` [s], shape (height, width, 3)."""
        with styled():
            if self._still is None:
                self._still = canvas.drawn(self._always())
            sheet = canvas.blank_page(self.size, _INCHES)
            for number in range(len(self.panels)):
                self._panel(sheet, number, time)
            for number, reel in enumerate(self.reels):
                line = reel.line(reel.nearest(time), short=len(self.reels) > 1)  # beside it stands the weight
                sheet.text(self._left(number), 0.93, line, fontsize=13, va="top", color="#444444")
            if all(len(reel.states) for reel in self.reels):
                runs = [{"t_s": reel.series["t_s"], "state": reel.states} for reel in self.reels]
                state_strip(sheet, runs, self.labels, time)
            return canvas.pixels(sheet, over=self._still)

    def _always(self) -> Figure:
        """The sheet with what is the same at all times, and lies on nothing else: titles, the weight, the colours."""
        sheet = canvas.blank_page(self.size, _INCHES)
        for number, reel in enumerate(self.reels):
            title = str(reel.result["title"]) if len(self.reels) == 1 else _with_surface(self.labels[number], reel)
            right = max(p.place[0] + p.place[2] for p in self.panels if p.run == number)
            if reel.result.get("experiment") != "mujoco":  # whose title begins with the name of a model
                title = capital(title)
            _entitle(sheet, typeset(title), self._left(number), right)
        for panel in self.panels:
            if panel.camera.arrow:
                share = self.shorter * panel.camera.arrow
                long = share * panel.place[3] * float(sheet.get_size_inches()[1])
                right = panel.place[0] + panel.place[2]
                canvas.draw_measure(sheet, right=right, height=0.915, length=long, weight=self.weight)
        if any(reel.on_grains for reel in self.reels):
            self.page.colour_bar(sheet, self.reels[0].bar, 10.5)
        return sheet

    def _left(self, number: int) -> float:
        """Where the first panel of a run begins, a share of the sheet."""
        return next(panel.place[0] for panel in self.panels if panel.run == number)

    def close(self) -> None:
        """Free the windows."""
        for stage in self.stages:
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
        stage.draw(axis, frame, self.page.colours(frame.grains), focus)
        camera.dress(axis, reel, stage, frame, focus)
        if camera.arrow:
            long = self.shorter * camera.arrow * stage.height / self.weight  # [m/N]
            points, fields = frame.clouds.get("row_forces", (np.zeros((0, 3)), {}))
            for point, force in zip(points, fields.get("force", np.zeros((0, 3))), strict=True):
                ends = stage.place(np.array([point, point + long * np.asarray(force, dtype=float)]), focus)
                canvas.draw_force(axis, ends[0], ends[1], float(np.linalg.norm(force)))


def _entitle(sheet: Figure, words: str, left: float, right: float) -> None:
    """The title of a run over its panels, `left` to `right` in shares of the sheet; a longer one in smaller letters."""
    size = _TITLE
    drawn = sheet.text(left, 0.975, words, fontsize=size, fontweight="bold", va="top")
    for _ in range(2):  # letters are whole pixels wide: the second step takes off what the first left
        size *= min(1.0, (right - left) / (drawn.get_window_extent().width / sheet.bbox.width))
        drawn.set_fontsize(size)


def _with_surface(label: str, reel: AnyReel) -> str:
    """What to call one of two runs on a picture: the surface is named, and the gravity, as its title has it."""
    surface = str(reel.result.get("surface") or "")
    named = label if not surface or surface in label else f"{label}, {surface}"
    gravity = _GRAVITY.search(str(reel.result["title"]))
    return f"{named}: {gravity[0]}" if gravity and gravity[0] not in named else named


def moments(reels: Sequence[AnyReel], labels: Sequence[str] | None = None) -> list[tuple[str, str, float, str]]:
    """Name, title, time [s] and caption of the stills: the start, the middle of the way, the end.

    Times at which the run with the fewest pictures has one, so that two runs, called `labels`, are shown at the same.
    """
    coarse, first = min(reels, key=len), reels[0]
    if isinstance(first, SpaceReel):
        return _moments_in_space([reel for reel in reels if isinstance(reel, SpaceReel)], coarse)
    end = min(float(reel.series["t_s"][-1]) for reel in reels)
    turned = np.abs(first.series["theta_rad"] - first.series["theta_rad"][0])
    half = float(first.series["t_s"][int(np.argmax(turned >= 0.5 * turned.max()))])
    found = []
    for (name, words), time in zip(_WORDS.items(), (0.0, min(half, end), end), strict=True):
        at = float(coarse.times[coarse.nearest(time)])
        lines = [reel.line(reel.nearest(at)) for reel in reels]
        parts = [f"{label}: {line}" for label, line in zip(labels, lines, strict=True)] if labels else lines
        found.append((name, f"Both {words}" if labels else capital(words), at, "; ".join(parts) + "."))
    return found


def _moments_in_space(reels: Sequence[SpaceReel], coarse: AnyReel) -> list[tuple[str, str, float, str]]:
    """Of one run the start, the picture with the largest force, and the end; the middle where that is one of both or
    there is no force, and of two runs."""
    end, first = min(float(reel.times[-1]) for reel in reels), reels[0]
    seen = f"Both {first.what}s" if len(reels) == 2 else f"The whole {first.what}"
    whence = " from above" if any(reel.on_grains for reel in reels) else ""
    near = ", and a foot from near" if whence and len(reels) == 1 else ""
    behind = f" {say('behind_the_cut')}" if whence else ""
    names, pushes = {"start": 0.0, "middle": 0.5 * end, "end": end}, ""
    hardest, met = int(np.argmax(first.loads)), False
    if len(reels) == 1 and 0 < hardest < len(first) - 1 and first.loads[hardest] > 0.0:
        names = {"start": 0.0, "force": float(first.times[hardest]), "end": end}
        pushes = say("hardest", force=quote(float(first.loads[hardest]), unit="N"))
        most = (first.result.get("quantities") or {}).get("largest_force")
        met = most is not None and float(first.loads[hardest]) >= _MET * float(most["value"])
        if most is not None:
            pushes += say("hardest_of_all", force=quote(float(most["value"]), unit="N"))
        pushes += "."
    wanted = {name: float(coarse.times[coarse.nearest(time)]) for name, time in names.items()}
    if len(set(wanted.values())) < len(wanted):
        wanted = {name: time for name, time in wanted.items() if name in ("start", "end")}
    titles = {"force": "At the largest force" if met else "At the largest force of all pictures"}
    return [
        (name, titles.get(name, f"At the {name}"), time,
         f"{seen}, seen along y{whence}{near}, at {time:.4g} s.{pushes if name == 'force' else ''}{behind}")
        for name, time in wanted.items()
    ]  # fmt: skip


def film_times(reels: Sequence[AnyReel]) -> Array:
    """When a film has a picture [s]: evenly over the longest run, and where the grains of the finest run have one."""
    finest = max((reel for reel in reels if reel.frames is not None), key=len, default=None)
    if isinstance(reels[0], SpaceReel):
        assert finest is not None
        chosen = np.unique(np.linspace(0, len(finest) - 1, min(MOST_FRAMES, len(finest))).round().astype(int))
        later = {float(time) for reel in reels for time in reel.times if time > finest.times[-1]}  # of the longer run
        return np.array([*finest.times[chosen], *sorted(later)])
    end = max(float(reel.times[-1]) for reel in reels)
    times = np.linspace(0.0, end, min(MOST_FRAMES, len(finest or max(reels, key=len))))
    if finest is None:
        return times
    # The finest run's own times, so that a law beside it is drawn when the grains are; a longer law goes on alone.
    own = [float(finest.times[finest.nearest(time)]) if time <= finest.times[-1] else float(time) for time in times]
    return np.unique(own)


def draw_runs(
    reels: Sequence[AnyReel],
    home: Path,
    stem: str,
    *,
    by: str,
    film: bool = True,
    labels: Sequence[str] | None = None,
    progress: Progress | None = None,
) -> Pictures:
    """Draw figures/STEM-*.png and film.gif of one run or two of one kind, by OpenGL in a child process or flat.

    ``home``: The folder that the pictures go to. ``stem``: How the stills' names begin. ``by``: What grains are
    coloured by, a key of `vis.pictures.canvas.COLOURS`. ``film``: Whether to make the film. ``labels``: What to call
    two runs. ``progress``: Called with the share that is done, 0 to 1.
    """
    kind = reels[0]
    planned = moments(reels, labels)
    stills = [Picture(home / "figures" / f"{stem}-{name}.png", title, caption) for name, title, _, caption in planned]
    pictures: list[_Picture] = [
        {"file": str(still.file), "times": [time], "size": kind.still, "by": by}
        for still, (_, _, time, _) in zip(stills, planned, strict=True)
    ]
    if _shows_heights(reels):  # what the robot leaves in the bed
        pictures[-1]["by"] = canvas.HEIGHT
        stills[-1] = replace(stills[-1], caption=f"{stills[-1].caption} {say('by_height')}")
    moving = None
    if film:
        times = film_times(reels).tolist()
        pictures.append({"file": str(home / "film.gif"), "times": times, "size": kind.film, "by": by})
        about = "" if isinstance(kind, SpaceReel) else f" of {times[-1]:.3g} s"
        caption = f"{len(times)} pictures{about}; the camera follows, the colours keep their scale."
        moving = Picture(home / "film.gif", "The film", caption)
    job: FilmJob = {
        "runs": [(str(reel.folder), reel.spikes if isinstance(reel, Reel) else None) for reel in reels],
        "labels": list(labels) if labels else None,
        "pictures": pictures,
    }
    costs = [1.0] * sum(len(picture["times"]) for picture in pictures)
    method, note = carry_out(job, run_film_job, costs, progress, failed=kind.failed, without=kind.without)
    return Pictures(stills, moving, method, note)


def _shows_heights(reels: Sequence[AnyReel]) -> bool:
    """Whether the still at the end shows changes of height: of one run in space on grains whose surface is known.

    Its frames must have the directions in which grains moved.
    """
    only = reels[0]
    if len(reels) != 1 or not isinstance(only, SpaceReel) or not only.on_grains or only.surface is None:
        return False
    return canvas.HEIGHT in only.grains(only.frames[len(only) - 1])


def shown(drawn: Pictures, *, first: int = 0) -> list[Block]:
    """Film and stills, from the still `first` on, as a report has them."""
    film = [drawn.animation] if drawn.animation is not None else []
    return [
        figure(one.file, title=one.title, caption=one.caption, show_file=one in film)
        for one in (*film, *drawn.stills[first:])
    ]


def run_film_job(job: FilmJob, *, opengl: bool, step: Callable[[], None] = lambda: None) -> None:
    """Draw every picture of a job; `step` is called after each."""
    reels: list[AnyReel] = [
        SpaceReel(folder) if spikes is None else Reel(folder, like=(spikes[0], spikes[1]))
        for folder, spikes in job["runs"]
    ]
    sheets: dict[tuple[int, int, str], Sheet] = {}

    def draw(size: Sequence[int], by: str, time: float) -> NDArray[np.uint8]:
        key = (int(size[0]), int(size[1]), by)
        if key not in sheets:
            sheets[key] = Sheet(reels, key[:2], by=by, opengl=opengl, labels=job["labels"])
        return sheets[key].draw(time)

    try:
        for picture in job["pictures"]:
            images = (draw(picture["size"], picture["by"], time) for time in picture["times"])
            write_pictures(Path(picture["file"]), images, step, frame_ms=100)
    finally:
        for each in sheets.values():
            each.close()


if __name__ == "__main__":
    sys.exit(main(run_film_job))
