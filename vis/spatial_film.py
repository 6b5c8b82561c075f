"""Pictures of a platform in space from its frames: one view from above and aside, whose camera follows it.

`python -m vis.spatial_film <job.json>` draws a job with OpenGL in a process of its own, as `vis.render` does.

    {"folder", "by", "stills": [{"file", "index", "size"}...], "film": {"file", "indices": [...], "size"} or null}
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from vis.arrows import FORCE, HALO, draw_force
from vis.canvas import COLOURS, colour_values, colourmap, nice_above
from vis.frames import Frame, Frames, read_frames
from vis.jobs import draw_job, job_of
from vis.numbers import quote
from vis.stage import FlatStage, Stage
from vis.style import INK, styled

__all__ = ["NAME", "View", "main", "run_spatial_job"]

NAME = "tumble"
"""Of the frames in the run folder."""
_WIDE = 4.4
"""Width of the picture, over the largest distance of a tip from the centre."""
_PITCH = 0.5
"""How far the view goes downwards [rad]."""
_ARROW = 0.22
"""Length of the arrow of the whole weight, over the picture's height."""
_PLACE = (0.015, 0.02, 0.895, 0.865)
"""Of the picture on its sheet: left, foot, width, height in fractions."""
_BLOCK = 0.06
"""Depth of the ground that is drawn where there are no grains [m]."""


class View:
    """Draws the pictures of one run.

    Args:
        folder: The run folder, with frames.
        size: Of the picture [pixels].
        by: What grains are coloured by, a key of `vis.canvas.COLOURS`.
        opengl: Whether to render with OpenGL.
    """

    def __init__(self, folder: str | Path, size: tuple[int, int], *, by: str, opengl: bool) -> None:
        self.size, self.by = size, by
        self.result = json.loads((Path(folder) / "result.json").read_text(encoding="utf-8"))
        self.frames: Frames = read_frames(folder, NAME)
        self.norm = Normalize(0.0, _top(self.frames, by))
        self.map = colourmap()
        first = self.frames[0]
        centres = np.array([_centre(self.frames[k]) for k in range(len(self.frames))])
        points = np.concatenate([part for part, _ in first.bodies.values()])
        self.reach = float(np.linalg.norm(points - centres[0], axis=1).max())
        position = first.grains["position"]
        if len(position):
            radius = first.grains["radius"][:, None]
            low, high = (position - radius).min(axis=0), (position + radius).max(axis=0)
            mean: float | None = float(first.grains["radius"].mean())
        else:
            low, high = centres.min(axis=0) - 4 * self.reach, centres.max(axis=0) + 4 * self.reach
            low[2], high[2], mean = -_BLOCK, 0.0, None
        # The plane that the stage looks at is the front of the bed: no grain is left out.
        self.cut, width = float(low[1]), _WIDE * self.reach
        pixels = (round(_PLACE[2] * size[0]), round(_PLACE[3] * size[1]))
        if opengl:
            self.stage: Stage | FlatStage = Stage(
                pixels, width=width, cut=self.cut, low=low, high=high, radius=mean, pitch=_PITCH
            )
            self.stage.reach = 0.5 * width + 2.0 * float(np.linalg.norm(high - low))
        else:
            self.cut = float(centres[:, 1].mean())
            self.stage = FlatStage(pixels, width=width, cut=self.cut, low=low, high=high, radius=mean)
        level = centres[:, 2] + (centres[:, 1] - self.cut) * np.tan(self.stage.pitch)
        way = np.column_stack([centres[:, 0], level - 0.12 * self.stage.height])
        self.way = gaussian_filter1d(way, 0.03 * len(way), axis=0, mode="nearest") if len(way) > 3 else way

    def draw(self, index: int) -> NDArray[np.uint8]:
        """The picture of a frame, shape (height, width, 3)."""
        width, height = self.size
        frame, focus = self.frames[index], (float(self.way[index, 0]), float(self.way[index, 1]))
        count = len(frame.grains["position"])
        colours = self.map(self.norm(colour_values(frame.grains, self.by))) if count else np.zeros((0, 4))
        with styled():
            sheet = Figure(figsize=(12.8, 12.8 * height / width), dpi=width / 12.8)
            sheet.set_layout_engine("none")
            canvas = FigureCanvasAgg(sheet)
            axis = sheet.add_axes(_PLACE)
            axis.set_xlim(0.0, 1.0)
            axis.set_ylim(0.0, 1.0)
            axis.set_autoscale_on(False)
            axis.grid(False)
            axis.set_xticks([])
            axis.set_yticks([])
            if isinstance(self.stage, Stage):
                image = self.stage.render(frame, colours, focus)
                axis.imshow(image, extent=(0.0, 1.0, 0.0, 1.0), aspect="auto", interpolation="nearest")
            else:
                self.stage.draw(axis, frame, colours, focus)
            self._arrows(axis, frame, focus)
            sheet.text(0.02, 0.975, str(self.result["title"]), fontsize=15, fontweight="bold", va="top")
            sheet.text(0.02, 0.93, f"t = {self.frames.times[index]:.3f} s", fontsize=13, va="top", color="#444444")
            if count:
                bar = sheet.colorbar(
                    ScalarMappable(self.norm, self.map), cax=sheet.add_axes((0.93, 0.25, 0.012, 0.5)), extend="max",
                    extendfrac=0.04,
                )  # fmt: skip
                bar.set_label(COLOURS[self.by][0], fontsize=10.5)
                bar.outline.set_visible(False)  # type: ignore[operator]
            canvas.draw()
            return np.asarray(canvas.buffer_rgba())[..., :3].copy()

    def close(self) -> None:
        """Free the window."""
        if isinstance(self.stage, Stage):
            self.stage.close()

    def _arrows(self, axis: Any, frame: Frame, focus: tuple[float, float]) -> None:
        """The force on each spike that touches, and the weight as a measure."""
        weight = float(self.result["trial"]["weight"]["value"])
        long = _ARROW * self.stage.height / weight  # [m/N]
        points, fields = frame.clouds.get("row_forces", (np.zeros((0, 3)), {}))
        for point, force in zip(points, fields.get("force", np.zeros((0, 3))), strict=True):
            ends = self.stage.place(np.array([point, point + long * np.asarray(force, dtype=float)]), focus)
            draw_force(axis, ends[0], ends[1], float(np.linalg.norm(force)))
        axis.annotate("", (0.025, 0.97), (0.025, 0.97 - _ARROW), arrowprops=FORCE)
        axis.text(0.04, 0.96, f"weight, {quote(weight, unit='N')}", fontsize=10, va="top", color=INK, bbox=HALO)


def _centre(frame: Frame) -> NDArray[np.float64]:
    """Middle of what the hull's corners span [m]."""
    points = frame.bodies["hull"][0]
    return np.asarray(points.mean(axis=0), dtype=float)


def _top(frames: Frames, by: str) -> float:
    """Upper end of a scale for all pictures, by those grains that take part."""
    most = 0.0
    for index in {len(frames) // 3, 2 * len(frames) // 3, len(frames) - 1}:
        grains = frames[index].grains
        values = colour_values(grains, by) if len(grains["position"]) else np.zeros(0)
        taking = values[values > 0.05 * values.max()] if len(values) else values
        most = max(most, float(np.percentile(taking, 97)) if len(taking) else 0.0)
    return nice_above(most)


def run_spatial_job(job: dict[str, Any], *, opengl: bool, step: Callable[[], None] = lambda: None) -> None:
    """Draw every picture of a job (see the module); `step` is called after each."""
    draw_job(
        job, lambda size: View(job["folder"], size, by=job["by"], opengl=opengl), moment="index", moments="indices",
        step=step,
    )  # fmt: skip


def main(arguments: list[str] | None = None) -> int:
    """Carry out the job in the file that is named; exit status 0."""
    run_spatial_job(job_of(arguments), opengl=True, step=lambda: print("done", flush=True))
    return 0


if __name__ == "__main__":
    sys.exit(main())
