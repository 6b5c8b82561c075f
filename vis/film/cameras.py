"""The cameras that follow a platform: in the plane the whole of it and its feet from near, in space the whole of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.ndimage import gaussian_filter1d

from vis.film.reel import AnyReel, Reel, SpaceReel
from vis.page.plots import INK, Array, nice_below
from vis.pictures.canvas import HALO
from vis.pictures.frames import Frame
from vis.pictures.scene import OPACITY, Eye, Stage
from vis.pictures.sections import FlatStage

__all__ = ["Camera", "Panel", "layout"]

Focus = tuple[float, float]
"""x and z of the middle of a picture [m]."""
View = tuple[Stage | FlatStage, Array]
"""The stage, and the focus at every picture [m], shape (n, 2)."""
_INNER = 0.94
"""Share of a picture's height that its margins leave."""
_BELOW = 0.3
"""How far a tip lies at most below the middle of the picture from near, over its height: its arrow stays inside."""
_SHEET = 1e-4
"""Extent behind the plane of the spikes of the ground of a law in that plane's pictures [m]: its upper edge is the
surface, and no upper side is seen behind that."""
_RULER = 0.2
"""Longest ruler of a picture, over its width; lines on the ground of a law in space are one ruler apart."""
_LINE = 0.0315
"""From one line of a key to the next, over the height of the sheet."""
_STEADY = 0.03
"""Over which a camera's way is smoothed (standard deviation), over the run's duration."""


class Camera:
    """Sees one run."""

    arrow = 0.0
    """Length of the arrow of the whole weight, over the picture's height; 0: forces are not shown."""

    def set_up(self, reel: Any, pixels: tuple[int, int], reach: float, *, opengl: bool) -> View:
        """The view for pictures of this size that show a platform of this reach [m]."""
        raise NotImplementedError

    def dress(self, axis: Any, reel: Any, stage: Stage | FlatStage, frame: Frame, focus: Focus) -> None:
        """Draw what lies over the ground and the platform: nothing."""


@dataclass(frozen=True)
class Panel:
    """One picture on a sheet."""

    run: int
    camera: Camera
    place: tuple[float, float, float, float]
    """Left, foot, width, height in fractions of the sheet."""


class _Plane(Camera):
    """In front of the plane of the spikes: a level line, a ruler.

    Least `width` and height `tall` of its picture are over the spikes' length.
    """

    width, tall = 3.1, 2.75

    def set_up(self, reel: Reel, pixels: tuple[int, int], reach: float, *, opengl: bool) -> View:
        width = max(self.width, self.tall * pixels[0] / pixels[1])
        (low, high), kind = reel.box, Stage if opengl else FlatStage
        if reel.frames is None:
            high = np.array([high[0], reel.cut + _SHEET, high[2]])
        stage = kind(pixels, width=width * reach, cut=reel.cut, low=low, high=high, radius=reel.radius)
        return stage, _steady(self.way(reel, stage, reach))

    def way(self, reel: Reel, stage: Eye, reach: float) -> Array:
        centres = reel.centres()
        risen = np.maximum(0.0, centres[:, 1] - centres[0, 1] - 0.2 * reach)
        return np.column_stack([centres[:, 0], centres[0, 1] - 0.06 * stage.height + risen])

    def dress(self, axis: Any, reel: Reel, stage: Stage | FlatStage, frame: Frame, focus: Focus) -> None:
        _frame_and_ruler(axis, stage)
        level = stage.place(np.array([[focus[0], reel.cut, reel.surface]]), focus)[0, 1]
        axis.plot([0.0, 1.0], [level, level], color=INK, lw=0.8, ls=(0, (5, 4)))
        if 0.0 < level < 0.8:
            axis.text(0.012, level + 0.012, "undisturbed surface", fontsize=9, va="bottom", color=INK, bbox=HALO)
        self.mark(axis, stage, frame, focus, level)

    def mark(self, axis: Any, stage: Eye, frame: Frame, focus: Focus, level: float) -> None:
        """A line from the centre to where row 0 begins: it shows how far the platform has turned, with a key."""
        hull = frame.bodies["hull"][0]
        ring = hull[: len(hull) // 2]  # its face in front
        ends = stage.place(np.array([ring.mean(axis=0), ring[0]]), focus)
        axis.plot(ends[:, 0], ends[:, 1], color=INK, lw=1.6, solid_capstyle="round")
        axis.plot(ends[:1, 0], ends[:1, 1], "o", color=INK, ms=4)
        line = _LINE / axis.get_position().height
        first, second = 1.0 - 0.9 * line, 1.0 - 1.9 * line
        axis.plot([0.02, 0.06], [first, first], color=INK, lw=1.6)
        axis.plot([0.02], [first], "o", color=INK, ms=4)
        axis.text(0.075, first, "from the centre to row 0", fontsize=9, va="center", color=INK, bbox=HALO)
        if radius := frame.values.get("hull_radius"):
            turn = np.linspace(0.0, 2 * np.pi, 181)
            circle = ring.mean(axis=0) + radius * np.column_stack([np.cos(turn), 0.0 * turn, np.sin(turn)])
            axis.plot(*stage.place(circle, focus).T, color=INK, lw=1.0, ls=(0, (4, 3)))
            axis.plot([0.02, 0.06], [second, second], color=INK, lw=1.0, ls=(0, (4, 3)))
            axis.text(0.075, second, "the cylinder that grains touch", fontsize=9, va="center", color=INK, bbox=HALO)


class _Near(_Plane):
    """The same from near, on the feet, with the forces on them."""

    width, tall, arrow = 0.75, 0.0, 0.28

    def way(self, reel: Reel, stage: Eye, reach: float) -> Array:
        high = np.minimum(reel.surface + 0.06 * stage.height, reel.lowest() + _BELOW * stage.height)
        return np.column_stack([reel.feet(), high])

    def mark(self, axis: Any, stage: Eye, frame: Frame, focus: Focus, level: float) -> None:
        """Nothing: which row is which shows on the whole of it."""


class _Space(Camera):
    """From above and aside; least width and height of the picture over the largest distance of a tip from the centre.

    The plane that a rendered picture looks at is the front of the bed: no grain is left out. ``whole``: A bed that is
    narrower than the picture is seen down to its floor; two runs side by side keep one scale instead.
    """

    width, tall, arrow, pitch = 4.4, 2.6, 0.22, 0.5

    def __init__(self, *, whole: bool = False) -> None:
        self.whole = whole

    def set_up(self, reel: SpaceReel, pixels: tuple[int, int], reach: float, *, opengl: bool) -> View:
        width = max(self.width, self.tall * pixels[0] / pixels[1]) * reach
        (low, high), centres = reel.box, reel.centres
        cut, pitch = (float(low[1]), self.pitch) if opengl else (float(centres[:, 1].mean()), 0.0)
        level = centres[:, 2] + (centres[:, 1] - cut) * np.tan(pitch)
        narrow = self.whole and reel.on_grains and float(high[0] - low[0]) < width
        if narrow:
            deep = float(level.max() - low[2]) * np.cos(pitch) + reach
            width = max(width, deep / _INNER * pixels[0] / pixels[1])
        seen: dict[str, Any] = {
            "width": width,
            "cut": cut,
            "pitch": pitch,
            "low": low,
            "high": high,
            "radius": reel.radius,
        }
        ruled = nice_below(_RULER * width)
        stage = Stage(pixels, **seen, opacity=OPACITY, ruled=ruled) if opengl else FlatStage(pixels, **seen)
        stage.reach = 0.5 * width + 2.0 * float(np.linalg.norm(high - low))
        focus = level - 0.12 * stage.height
        if narrow:
            focus = np.minimum(focus, low[2] + 0.5 * _INNER * stage.height / np.cos(pitch))
        return stage, _steady(np.column_stack([centres[:, 0], focus]))

    def dress(self, axis: Any, reel: SpaceReel, stage: Stage | FlatStage, frame: Frame, focus: Focus) -> None:
        _frame_and_ruler(axis, stage)


def _frame_and_ruler(axis: Any, stage: Stage | FlatStage) -> None:
    """A thin frame around the picture, and a length in its lower right corner: the same everywhere on the picture."""
    for spine in axis.spines.values():
        spine.set(visible=True, color="#bbbbbb")
    step, right = nice_below(_RULER * stage.width), 0.97
    for colour, thick in (("white", 5.0), (INK, 2.5)):
        ends = [right - step / stage.width, right]
        axis.plot(ends, [0.035, 0.035], color=colour, lw=thick, solid_capstyle="butt")
    middle = right - 0.5 * step / stage.width
    axis.text(middle, 0.05, f"{1e3 * step:g} mm", ha="center", va="bottom", fontsize=10, bbox=HALO)


def layout(reels: Sequence[AnyReel]) -> list[Panel]:
    """The pictures of one run or two: in space one each; in the plane the whole beside the feet, or above them."""
    if isinstance(reels[0], SpaceReel):
        if len(reels) == 1:
            foot = 0.17 if len(reels[0].states) else 0.03  # below it the states, where there are any
            return [Panel(0, _Space(whole=True), (0.015, foot, 0.895, 0.885 - foot))]
        return [Panel(run, _Space(), (left, 0.18, 0.445, 0.70)) for run, left in enumerate((0.015, 0.47))]
    if len(reels) == 1:
        return [Panel(0, _Plane(), (0.02, 0.17, 0.40, 0.70)), Panel(0, _Near(), (0.435, 0.17, 0.465, 0.70))]
    panels = []
    for run in range(2):
        x, wide = 0.02 + run * (0.44 + 0.01), 0.44
        panels += [Panel(run, _Plane(), (x, 0.53, wide, 0.36)), Panel(run, _Near(), (x, 0.17, wide, 0.35))]
    return panels


def _steady(way: Array) -> Array:
    return gaussian_filter1d(way, _STEADY * len(way), axis=0, mode="nearest") if len(way) > 3 else way
