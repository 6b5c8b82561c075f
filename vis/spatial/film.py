"""Pictures of one platform in space or two from their frames: from above and aside, with a camera that follows.

`python -m vis.spatial.film <job.json>` draws a job with OpenGL in a process of its own, as `vis.pictures.render` does.

    {"runs": [folder...], "labels": [...] or null, "by", "stills": [{"file", "time", "size"}...],
     "film": {"file", "times": [...], "size"} or null}
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from vis.page.style import styled
from vis.page.tumble_series import read_columns
from vis.pictures.arrows import draw_force, draw_measure
from vis.pictures.canvas import COLOURS, colour_values, colourmap, moved_since, nice_above
from vis.pictures.frames import Frame, Frames, read_frames
from vis.pictures.jobs import draw_job, job_of
from vis.pictures.stage import FlatStage, Stage
from vis.tumble.state_figures import state_strip

__all__ = ["NAME", "Scene", "View", "main", "run_spatial_job"]

NAME = "tumble"
"""Of the frames in the run folder."""
_WIDE, _TALL = 4.4, 2.6
"""Least width and height of a picture, over the largest distance of a tip from the centre."""
_PITCH = 0.5
"""How far the view goes downwards [rad]."""
_ARROW = 0.22
"""Length of the arrow of the whole weight, over the picture's height."""
_PLACES = {
    1: ((0.015, 0.17, 0.895, 0.715),),
    2: ((0.015, 0.18, 0.445, 0.70), (0.47, 0.18, 0.445, 0.70)),
}
"""Of one run's picture on its sheet, and of two: left, foot, width, height in fractions."""
_BLOCK = 0.06
"""Depth of the ground that is drawn where there are no grains [m]."""


class Scene:
    """One run through the camera that follows it.

    Args:
        folder: The run folder, with frames. `set_up` before the first picture.
    """

    def __init__(self, folder: str | Path) -> None:
        home = Path(folder)
        self.result = json.loads((home / "result.json").read_text(encoding="utf-8"))
        self.frames: Frames = read_frames(home, NAME)
        series, states = read_columns(home / "trajectory.csv")
        self.track: dict[str, NDArray[Any]] = {"t_s": series["t_s"], "state": states}
        """Its states over time; none in a folder of an older hedgebed."""
        self.centres = np.array([_centre(self.frames[k]) for k in range(len(self.frames))])
        points = np.concatenate([part for part, _ in self.frames[0].bodies.values()])
        self.reach = float(np.linalg.norm(points - self.centres[0], axis=1).max())
        self.weight = float(self.result["trial"]["weight"]["value"])

    def set_up(self, pixels: tuple[int, int], reach: float, *, opengl: bool) -> None:
        """Its stage, for pictures of this size that show a platform of this reach [m]."""
        width = max(_WIDE, _TALL * pixels[0] / pixels[1]) * reach
        centres, position = self.centres, self.frames[0].grains["position"]
        if len(position):
            radius = self.frames[0].grains["radius"][:, None]
            low, high = (position - radius).min(axis=0), (position + radius).max(axis=0)
            mean: float | None = float(radius.mean())
        else:
            low, high = centres.min(axis=0) - 4 * self.reach, centres.max(axis=0) + 4 * self.reach
            low[2], high[2], mean = -_BLOCK, 0.0, None
        # The plane that the stage looks at is the front of the bed: no grain is left out.
        cut = float(low[1])
        if opengl:
            self.stage: Stage | FlatStage = Stage(
                pixels, width=width, cut=cut, low=low, high=high, radius=mean, pitch=_PITCH
            )
            self.stage.reach = 0.5 * width + 2.0 * float(np.linalg.norm(high - low))
        else:
            cut = float(centres[:, 1].mean())
            self.stage = FlatStage(pixels, width=width, cut=cut, low=low, high=high, radius=mean)
        level = centres[:, 2] + (centres[:, 1] - cut) * np.tan(self.stage.pitch)
        way = np.column_stack([centres[:, 0], level - 0.12 * self.stage.height])
        self.way = gaussian_filter1d(way, 0.03 * len(way), axis=0, mode="nearest") if len(way) > 3 else way

    def nearest(self, time: float) -> int:
        """The frame nearest to this time [s]."""
        return int(np.argmin(np.abs(self.frames.times - time)))

    def line(self, time: float) -> str:
        """Time and state, as a picture says it."""
        at = float(self.frames.times[self.nearest(time)])
        states = self.track["state"]
        state = f"    {states[int(np.argmin(np.abs(self.track['t_s'] - at)))]}" if len(states) else ""
        return f"t = {at:.3f} s{state}"

    def draw(
        self, axis: Any, time: float, *, colours: Callable[[Frame, Frame], NDArray[np.float64]], weight: float
    ) -> None:
        """Its picture at `time` [s] on an axes. A force of `weight` [N] is an arrow of `_ARROW` times its height."""
        index = self.nearest(time)
        frame, focus = self.frames[index], (float(self.way[index, 0]), float(self.way[index, 1]))
        axis.set_xlim(0.0, 1.0)
        axis.set_ylim(0.0, 1.0)
        axis.set_autoscale_on(False)
        axis.grid(False)
        axis.set_xticks([])
        axis.set_yticks([])
        if isinstance(self.stage, Stage):
            image = self.stage.render(frame, colours(frame, self.frames[0]), focus)
            axis.imshow(image, extent=(0.0, 1.0, 0.0, 1.0), aspect="auto", interpolation="nearest")
        else:
            self.stage.draw(axis, frame, colours(frame, self.frames[0]), focus)
        long = _ARROW * self.stage.height / weight  # [m/N]
        points, fields = frame.clouds.get("row_forces", (np.zeros((0, 3)), {}))
        for point, force in zip(points, fields.get("force", np.zeros((0, 3))), strict=True):
            ends = self.stage.place(np.array([point, point + long * np.asarray(force, dtype=float)]), focus)
            draw_force(axis, ends[0], ends[1], float(np.linalg.norm(force)))

    def close(self) -> None:
        """Free the window."""
        if isinstance(self.stage, Stage):
            self.stage.close()


class View:
    """Draws the pictures of one run, or of two side by side at the same scale, their states over time below.

    Args:
        folders: The run folders, one or two, with frames.
        size: Of the picture [pixels].
        by: What grains are coloured by, a key of `vis.pictures.canvas.COLOURS`.
        opengl: Whether to render with OpenGL.
        labels: What to call two runs.
    """

    def __init__(
        self,
        folders: Sequence[str | Path],
        size: tuple[int, int],
        *,
        by: str,
        opengl: bool,
        labels: Sequence[str] | None = None,
    ) -> None:
        self.size, self.by = size, by
        self.scenes = [Scene(folder) for folder in folders]
        titles = [str(scene.result["title"]) for scene in self.scenes]
        self.labels = titles if labels is None or len(folders) == 1 else list(labels)
        on_grains = [scene.frames for scene in self.scenes if len(scene.frames[0].grains["position"])]
        self.norm = Normalize(0.0, max((_top(frames, by) for frames in on_grains), default=1.0))
        self.map, self.coloured = colourmap(), bool(on_grains)
        self.weight = max(scene.weight for scene in self.scenes)
        self.places = _PLACES[len(self.scenes)]
        for scene, place in zip(self.scenes, self.places, strict=True):
            pixels = (round(place[2] * size[0]), round(place[3] * size[1]))
            scene.set_up(pixels, max(each.reach for each in self.scenes), opengl=opengl)

    def draw(self, time: float) -> NDArray[np.uint8]:
        """The picture at `time` [s], shape (height, width, 3)."""
        width, height = self.size
        with styled():
            sheet = Figure(figsize=(12.8, 12.8 * height / width), dpi=width / 12.8)
            sheet.set_layout_engine("none")
            canvas = FigureCanvasAgg(sheet)
            for scene, place, label in zip(self.scenes, self.places, self.labels, strict=True):
                scene.draw(sheet.add_axes(place), time, colours=self._colours, weight=self.weight)
                sheet.text(place[0], 0.975, label, fontsize=15, fontweight="bold", va="top")
                sheet.text(place[0], 0.93, scene.line(time), fontsize=13, va="top", color="#444444")
                draw_measure(
                    sheet, right=place[0] + place[2], height=0.915,
                    length=_ARROW * place[3] * float(sheet.get_size_inches()[1]), weight=self.weight,
                )  # fmt: skip
            if all(len(scene.track["state"]) for scene in self.scenes):
                state_strip(sheet, [scene.track for scene in self.scenes], self.labels, time)
            if self.coloured:
                bar = sheet.colorbar(
                    ScalarMappable(self.norm, self.map), cax=sheet.add_axes((0.93, 0.3, 0.012, 0.45)), extend="max",
                    extendfrac=0.04,
                )  # fmt: skip
                bar.set_label(COLOURS[self.by][0], fontsize=10.5)
                bar.outline.set_visible(False)  # type: ignore[operator]
            canvas.draw()
            return np.asarray(canvas.buffer_rgba())[..., :3].copy()

    def close(self) -> None:
        """Free the windows."""
        for scene in self.scenes:
            scene.close()

    def _colours(self, frame: Frame, first: Frame) -> NDArray[np.float64]:
        if not len(frame.grains["position"]):
            return np.zeros((0, 4))
        return np.asarray(self.map(self.norm(colour_values(moved_since(frame.grains, first.grains), self.by))))


def _centre(frame: Frame) -> NDArray[np.float64]:
    """Middle of what the hull's corners span [m]."""
    points = frame.bodies["hull"][0]
    return np.asarray(points.mean(axis=0), dtype=float)


def _top(frames: Frames, by: str) -> float:
    """Upper end of a scale for all pictures, by those grains that take part."""
    most = 0.0
    for index in {len(frames) // 3, 2 * len(frames) // 3, len(frames) - 1}:
        values = colour_values(moved_since(frames[index].grains, frames[0].grains), by)
        taking = values[values > 0.05 * values.max()]
        most = max(most, float(np.percentile(taking, 97)) if len(taking) else 0.0)
    return nice_above(most)


def run_spatial_job(job: dict[str, Any], *, opengl: bool, step: Callable[[], None] = lambda: None) -> None:
    """Draw every picture of a job (see the module); `step` is called after each."""
    draw_job(
        job, lambda size: View(job["runs"], size, by=job["by"], opengl=opengl, labels=job.get("labels")),
        moment="time", moments="times", step=step,
    )  # fmt: skip


def main(arguments: list[str] | None = None) -> int:
    """Carry out the job in the file that is named; exit status 0."""
    run_spatial_job(job_of(arguments), opengl=True, step=lambda: print("done", flush=True))
    return 0


if __name__ == "__main__":
    sys.exit(main())
