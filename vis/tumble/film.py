"""Still pictures, the film and the tracks of a tumble: a camera that follows the platform, a scale that stays put.

A sheet shows one run (the whole platform beside its feet from near) or two (the same of both, side by side), and below
them the states over time with a cursor. `python -m vis.tumble.film <job.json>` draws a job with OpenGL in a process of
its own, as `vis.pictures.render` does for spikes.

    {"runs": [folder...], "labels": [...] or null, "by", "stills": [{"file", "time", "size"}...],
     "film": {"file", "times": [...], "size"} or null, "spikes": [[diameter, length out of the hull] or null...]}
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from vis.page.style import INK, styled
from vis.pictures.arrows import HALO, draw_force, draw_measure
from vis.pictures.canvas import COLOURS, colour_values, colourmap
from vis.pictures.frames import Frame
from vis.pictures.jobs import draw_job, job_of
from vis.pictures.stage import Eye, FlatStage, Stage
from vis.tumble.reel import Reel
from vis.tumble.state_figures import state_strip

__all__ = ["Sheet", "main", "run_film_job"]

Array = NDArray[np.float64]
_WHOLE, _TALL = 3.1, 2.75
"""Least width and height of the picture of the whole platform, over its spikes' length."""
_NEAR = 0.75
"""Width of the picture of its feet, over its spikes' length."""
_ARROW = 0.28
"""Length of the arrow of the whole weight, over the height of the picture from near."""
_STEADY = 0.03
"""Over which the camera's way is smoothed (standard deviation), over the run's duration."""


_MARK = INK
"""Of the line that shows how far the platform has turned: forces are red."""


@dataclass(frozen=True)
class _Panel:
    """One picture on a sheet."""

    run: int
    near: bool
    place: tuple[float, float, float, float]
    """Left, foot, width, height in fractions of the sheet."""


class Sheet:
    """Draws the pictures of one or two tumbles.

    Args:
        reels: The runs, one or two.
        size: Of the sheet [pixels].
        by: What grains are coloured by, a key of `vis.pictures.canvas.COLOURS`.
        opengl: Whether to render with OpenGL.
        top: Upper end of the colour scale, in its unit; the highest of the runs' own if not given.
        labels: What to call the runs; by their ground if not given.
    """

    def __init__(
        self,
        reels: Sequence[Reel],
        size: tuple[int, int],
        *,
        by: str,
        opengl: bool,
        top: float | None = None,
        labels: Sequence[str] | None = None,
    ) -> None:
        self.reels, self.size, self.by = list(reels), size, by
        self.labels = [reel.ground for reel in self.reels] if labels is None else list(labels)
        self.panels = _layout(len(self.reels))
        self.norm = Normalize(0.0, max(reel.colour_top(by) for reel in self.reels) if top is None else top)
        self.map = colourmap()
        self.length = max(reel.number("spike_length") for reel in self.reels)
        self.weight = max(reel.number("weight") for reel in self.reels)
        kind = Stage if opengl else FlatStage
        self.stages: list[Stage | FlatStage] = []
        self.ways = []
        for panel in self.panels:
            reel = self.reels[panel.run]
            pixels = (round(panel.place[2] * size[0]), round(panel.place[3] * size[1]))
            low, high = reel.box
            width = _NEAR if panel.near else max(_WHOLE, _TALL * pixels[0] / pixels[1])
            self.stages.append(
                kind(pixels, width=width * self.length, cut=reel.cut, low=low, high=high,
                     radius=reel.radius)
            )  # fmt: skip
            self.ways.append(self._way(panel, self.stages[-1]))

    def draw(self, time: float) -> NDArray[np.uint8]:
        """The sheet at `time` [s], shape (height, width, 3)."""
        width, height = self.size
        with styled():
            sheet = Figure(figsize=(12.8, 12.8 * height / width), dpi=width / 12.8)
            sheet.set_layout_engine("none")
            canvas = FigureCanvasAgg(sheet)
            for panel, stage, way in zip(self.panels, self.stages, self.ways, strict=True):
                reel = self.reels[panel.run]
                index = reel.nearest(time)
                self._panel(sheet, panel, stage, reel.frame(index), (float(way[index, 0]), float(way[index, 1])))
            for number, reel in enumerate(self.reels):
                index = reel.nearest(time)
                left = next(panel.place[0] for panel in self.panels if panel.run == number)
                title = str(reel.result["title"]) if len(self.reels) == 1 else self.labels[number]
                sheet.text(left, 0.975, title, fontsize=15, fontweight="bold", va="top")
                sheet.text(left, 0.93, reel.line(index), fontsize=13, va="top", color="#444444")
            for panel in self.panels:
                if panel.near:
                    draw_measure(
                        sheet, right=panel.place[0] + panel.place[2], height=0.915,
                        length=_ARROW * panel.place[3] * float(sheet.get_size_inches()[1]), weight=self.weight,
                    )  # fmt: skip
            runs = [{"t_s": reel.series["t_s"], "state": reel.states} for reel in self.reels]
            state_strip(sheet, runs, self.labels, time)
            if any(reel.frames is not None for reel in self.reels):
                self._bar(sheet)
            canvas.draw()
            return np.asarray(canvas.buffer_rgba())[..., :3].copy()

    def close(self) -> None:
        """Free the windows."""
        for stage in self.stages:
            if isinstance(stage, Stage):
                stage.close()

    # Its parts --------------------------------------------------------------------------------------------------------

    def _way(self, panel: _Panel, stage: Eye) -> Array:
        """Focus of a panel at every picture of its run [m], shape (n, 2)."""
        reel = self.reels[panel.run]
        centres = reel.centres()
        if panel.near:
            x = reel.feet()
            z = np.full(len(x), reel.surface + 0.06 * stage.height)
        else:
            x = centres[:, 0]
            slack = 0.2 * self.length
            risen = centres[:, 1] - centres[0, 1]
            z = centres[0, 1] - 0.06 * stage.height + np.maximum(0.0, risen - slack)
        width = _STEADY * len(x)
        steady = [gaussian_filter1d(way, width, mode="nearest") if len(way) > 3 else way for way in (x, z)]
        return np.column_stack(steady)

    def _panel(
        self, sheet: Figure, panel: _Panel, stage: Stage | FlatStage, frame: Frame, focus: tuple[float, float]
    ) -> None:
        reel = self.reels[panel.run]
        axis = sheet.add_axes(panel.place)
        axis.set_xlim(0.0, 1.0)
        axis.set_ylim(0.0, 1.0)
        axis.set_autoscale_on(False)
        axis.grid(False)
        axis.set_xticks([])
        axis.set_yticks([])
        for spine in axis.spines.values():
            spine.set_visible(True)
            spine.set_color("#bbbbbb")
        count = len(frame.grains["position"])
        colours = self.map(self.norm(colour_values(frame.grains, self.by))) if count else np.zeros((0, 4))
        if isinstance(stage, Stage):
            image = stage.render(frame, colours, focus)
            axis.imshow(image, extent=(0.0, 1.0, 0.0, 1.0), aspect="auto", interpolation="nearest")
        else:
            stage.draw(axis, frame, colours, focus)
        level = stage.place(np.array([[focus[0], reel.cut, reel.surface]]), focus)[0, 1]
        axis.plot([0.0, 1.0], [level, level], color=INK, lw=0.8, ls=(0, (5, 4)))
        self._ruler(axis, stage, panel.near)
        if not panel.near:
            self._mark(axis, stage, frame, focus)
        else:
            axis.text(0.012, level + 0.012, "undisturbed surface", fontsize=9, va="bottom", bbox=HALO)
            self._arrows(axis, stage, frame, focus)

    def _mark(self, axis: Any, stage: Eye, frame: Frame, focus: tuple[float, float]) -> None:
        """A line from the centre to where row 0 begins: it shows how far the platform has turned, and says so."""
        hull = frame.bodies["hull"][0]
        ring = hull[: len(hull) // 2]  # its face in front
        ends = stage.place(np.array([ring.mean(axis=0), ring[0]]), focus)
        axis.plot(ends[:, 0], ends[:, 1], color=_MARK, lw=1.6, solid_capstyle="round")
        axis.plot(ends[:1, 0], ends[:1, 1], "o", color=_MARK, ms=4)
        axis.plot([0.02, 0.06], [0.96, 0.96], color=_MARK, lw=1.6)
        axis.plot([0.02], [0.96], "o", color=_MARK, ms=4)
        axis.text(0.075, 0.96, "from the centre to row 0", fontsize=9, va="center", color=INK, bbox=HALO)

    def _ruler(self, axis: Any, stage: Eye, near: bool) -> None:
        """A length along the foot."""
        step = _round_length(0.2 * stage.width)
        right = 0.97
        axis.plot([right - step / stage.width, right], [0.035, 0.035], color=INK, lw=2.5, solid_capstyle="butt")
        middle = right - 0.5 * step / stage.width
        axis.text(middle, 0.05, f"{1e3 * step:g} mm", ha="center", va="bottom", fontsize=10, bbox=HALO)

    def _arrows(self, axis: Any, stage: Eye, frame: Frame, focus: tuple[float, float]) -> None:
        """The force on each row that touches."""
        long = _ARROW * stage.height / self.weight  # [m/N]
        points, fields = frame.clouds.get("row_forces", (np.zeros((0, 3)), {}))
        for point, force in zip(points, fields.get("force", np.zeros((0, 3))), strict=True):
            ends = stage.place(np.array([point, point + long * np.asarray(force, dtype=float)]), focus)
            draw_force(axis, ends[0], ends[1], float(np.linalg.norm(force)))

    def _bar(self, sheet: Figure) -> None:
        axis = sheet.add_axes((0.925, 0.27, 0.012, 0.5))
        bar = sheet.colorbar(ScalarMappable(self.norm, self.map), cax=axis, extend="max", extendfrac=0.04)
        bar.set_label(COLOURS[self.by][0], fontsize=10.5)
        bar.outline.set_visible(False)  # type: ignore[operator]


def _layout(runs: int) -> list[_Panel]:
    if runs == 1:
        return [_Panel(0, False, (0.02, 0.17, 0.40, 0.70)), _Panel(0, True, (0.435, 0.17, 0.465, 0.70))]
    left, wide = 0.02, 0.44
    panels = []
    for run in range(2):
        x = left + run * (wide + 0.01)
        panels += [_Panel(run, False, (x, 0.53, wide, 0.36)), _Panel(run, True, (x, 0.17, wide, 0.35))]
    return panels


def _round_length(length: float) -> float:
    power = 10.0 ** np.floor(np.log10(length))
    return float(max(n * power for n in (1.0, 2.0, 5.0) if n * power <= 1.0001 * length))


def run_film_job(job: dict[str, Any], *, opengl: bool, step: Callable[[], None] = lambda: None) -> None:
    """Draw every picture of a job (see the module); `step` is called after each."""
    spikes = job.get("spikes") or [None] * len(job["runs"])
    reels = [
        Reel.open(folder, like=None if like is None else (float(like[0]), float(like[1])))
        for folder, like in zip(job["runs"], spikes, strict=True)
    ]
    draw_job(
        job, lambda size: Sheet(reels, size, by=job["by"], opengl=opengl, labels=job.get("labels")), moment="time",
        moments="times", step=step,
    )  # fmt: skip


def main(arguments: list[str] | None = None) -> int:
    """Carry out the job in the file that is named; exit status 0."""
    run_film_job(job_of(arguments), opengl=True, step=lambda: print("done", flush=True))
    return 0


if __name__ == "__main__":
    sys.exit(main())
