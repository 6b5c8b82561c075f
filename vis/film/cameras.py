"""The cameras that follow a platform or robot.

In the plane: the whole of it, and its feet from near. In space: the whole of it, from above on grains, where a foot is
seen from near too, from the side on a law.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.ndimage import gaussian_filter1d

from vis.film.reel import AnyReel, Reel, SpaceReel
from vis.page.plots import DOTTED, INK, Array, nice_below
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
_SEEN = 0.04
"""Length of the arrow of a height below which it is left out, over the picture's height."""
_MEASURE = {"arrowstyle": "<->", "color": INK, "lw": 1.2, "shrinkA": 0.0, "shrinkB": 0.0, "mutation_scale": 11.0}
"""Of the height of a foot."""
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
        _dash_surface(axis, stage, reel.surface, focus)
        self.mark(axis, stage, frame, focus)

    def mark(self, axis: Any, stage: Eye, frame: Frame, focus: Focus) -> None:
        """A line from the centre to where row 0 begins: it shows how far the platform has turned, with a key."""
        hull = frame.bodies["hull"][0]
        ring = hull[: len(hull) // 2]  # its face in front
        ends = stage.place(np.array([ring.mean(axis=0), ring[0]]), focus)
        axis.plot(ends[:, 0], ends[:, 1], color=INK, lw=1.6, solid_capstyle="round")
        axis.plot(ends[:1, 0], ends[:1, 1], "o", color=INK, ms=4)
        _key(axis, 1, "from the centre to row 0", lw=1.6, marker="o", ms=4, markevery=[0])
        if radius := frame.values.get("hull_radius"):
            turn = np.linspace(0.0, 2 * np.pi, 181)
            circle = ring.mean(axis=0) + radius * np.column_stack([np.cos(turn), 0.0 * turn, np.sin(turn)])
            axis.plot(*stage.place(circle, focus).T, color=INK, lw=1.4, ls=DOTTED)
            _key(axis, 2, "the cylinder that grains touch", lw=1.4, ls=DOTTED)


class _Near(_Plane):
    """The same from near, on the feet, with the forces on them."""

    width, tall, arrow = 0.75, 0.0, 0.28

    def way(self, reel: Reel, stage: Eye, reach: float) -> Array:
        high = np.minimum(reel.surface + 0.06 * stage.height, reel.lowest() + _BELOW * stage.height)
        return np.column_stack([reel.feet(), high])

    def mark(self, axis: Any, stage: Eye, frame: Frame, focus: Focus) -> None:
        """Nothing: which row is which shows on the whole of it."""


class _Space(Camera):
    """From above and aside; least width and height of the picture over the largest distance of a tip from the centre.

    The plane that a rendered picture looks at is the front of the bed: no grain is left out. ``whole``: A bed that is
    narrower than the picture fills it, from its floor to the top of the body; two runs side by side keep one scale
    instead.
    """

    width, tall, pitch, most = 4.4, 2.6, 0.5, 3.0

    def __init__(self, *, whole: bool = False) -> None:
        self.whole, self.arrow = whole, 0.0 if whole else 0.22

    def set_up(self, reel: SpaceReel, pixels: tuple[int, int], reach: float, *, opengl: bool) -> View:
        width = max(self.width, self.tall * pixels[0] / pixels[1]) * reach
        (low, high), centres = reel.box, reel.centres
        cut, pitch = (float(low[1]), self.pitch) if opengl else (float(centres[:, 1].mean()), 0.0)
        narrow = self.whole and reel.on_grains and float(high[0] - low[0]) < width
        tops = reel.ends[:, 1] + (centres[:, 1] - cut) * np.tan(pitch)
        floor, shown = float(low[2]), float(tops.max() - low[2])
        if narrow:  # a body that goes higher than so many times its own height is followed
            tall = float((reel.ends[:, 1] - reel.ends[:, 0]).max())
            shown = min(shown, float(high[2] - low[2]) + self.most * tall)
            across = max(float(high[0]), float(centres[:, 0].max()) + 0.5 * reach)
            across -= min(float(low[0]), float(centres[:, 0].min()) - 0.5 * reach)
            width = max(across, shown * np.cos(pitch) * pixels[0] / pixels[1]) / _INNER
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
        if narrow:
            middle = np.maximum(floor + 0.5 * shown, tops - 0.5 * shown)
            return stage, _steady(np.column_stack([np.full(len(middle), 0.5 * (low[0] + high[0])), middle]))
        level = centres[:, 2] + (centres[:, 1] - cut) * np.tan(pitch)
        return stage, _steady(np.column_stack([centres[:, 0], level - 0.12 * stage.height]))

    def dress(self, axis: Any, reel: SpaceReel, stage: Stage | FlatStage, frame: Frame, focus: Focus) -> None:
        _frame_and_ruler(axis, stage)
        _mark_lowest(axis, reel, stage, frame, focus)


class _Foot(Camera):
    """One foot in the bed from near, with the forces; the bed is cut along the middle of the foot.

    Width of its picture over that of the foot, and the least and most over the largest distance of a tip.
    """

    width, least, most, arrow = 3.0, 0.75, 1.5, 0.22

    def set_up(self, reel: SpaceReel, pixels: tuple[int, int], reach: float, *, opengl: bool) -> View:
        foot, (low, high), kind = reel.foot, reel.box, Stage if opengl else FlatStage
        width = float(np.clip(self.width * foot.wide, self.least * reach, self.most * reach))
        stage = kind(pixels, width=width, cut=foot.cut, low=low, high=high, radius=reel.radius)
        stage.reach = 0.5 * width + 2.0 * float(np.linalg.norm(high - low))
        surface = float(high[2]) if reel.surface is None else reel.surface
        middle = np.minimum(surface + 0.06 * stage.height, foot.low + _BELOW * stage.height)
        return stage, _steady(np.column_stack([foot.x, middle]))

    def dress(self, axis: Any, reel: SpaceReel, stage: Stage | FlatStage, frame: Frame, focus: Focus) -> None:
        _frame_and_ruler(axis, stage)
        if reel.surface is not None:
            _dash_surface(axis, stage, reel.surface, focus)


class _Level(Camera):
    """From the side, level, over a ground without grains that is cut open in front of the body.

    The picture has a line of the undisturbed surface, a scale of heights above it, and the height of the lowest foot.
    It holds the whole way up and down where that is at most `most` times as high as the body; else it follows.
    ``reels``: All runs on the sheet, which share a scale.
    """

    width, arrow, most = 3.1, 0.22, 3.0
    margin = 0.14
    """Above what is seen and below it, over the picture's height."""

    def __init__(self, reels: Sequence[SpaceReel]) -> None:
        ends = [reel.ends for reel in reels]
        tall = max(float((each[:, 1] - each[:, 0]).max()) for each in ends)
        self.bottom = min(0.0, *(float(each[:, 0].min()) for each in ends))
        self.rise = max(float(each[:, 1].max()) for each in ends) - self.bottom
        self.shown = min(self.rise, self.most * tall)

    def set_up(self, reel: SpaceReel, pixels: tuple[int, int], reach: float, *, opengl: bool) -> View:
        (low, high), ends = reel.box, reel.ends
        width = max(self.width * reach, self.shown / (1.0 - 2.0 * self.margin) * pixels[0] / pixels[1])
        height = width * pixels[1] / pixels[0]
        low = np.array([low[0] - width, low[1], self.bottom - 2.0 * height])
        high = np.array([high[0] + width, high[1], 0.0])
        seen: dict[str, Any] = {
            "width": width, "cut": float(low[1]), "pitch": 0.0, "low": low, "high": high, "radius": reel.radius
        }  # fmt: skip
        stage = Stage(pixels, **seen, opacity=OPACITY) if opengl else FlatStage(pixels, **seen)
        stage.reach = 0.5 * width + 2.0 * float(high[1] - low[1])
        still = self.bottom + (0.5 - self.margin) * height
        follows = self.rise > self.shown
        middle = np.maximum(still, 0.5 * ends.sum(axis=1)) if follows else np.full(len(ends), still)
        return stage, _steady(np.column_stack([reel.centres[:, 0], middle]))

    def dress(self, axis: Any, reel: SpaceReel, stage: Stage | FlatStage, frame: Frame, focus: Focus) -> None:
        _frame_and_ruler(axis, stage)
        level = float(stage.place(np.array([[focus[0], stage.cut, 0.0]]), focus)[0, 1])
        if 0.0 < level < 1.0:
            axis.plot([0.0, 1.0], [level, level], color=INK, lw=1.0)
            axis.text(0.988, level + 0.012, "undisturbed surface", fontsize=9, ha="right", va="bottom", color=INK)
        _heights(axis, stage, focus)
        _mark_lowest(axis, reel, stage, frame, focus)


def _dash_surface(axis: Any, stage: Stage | FlatStage, height: float, focus: Focus) -> None:
    """A dashed line of the undisturbed surface at this height [m] across the picture, and its key above all grains."""
    level = float(stage.place(np.array([[focus[0], stage.cut, height]]), focus)[0, 1])
    axis.plot([0.0, 1.0], [level, level], color=INK, lw=0.8, ls=(0, (5, 4)))
    if 0.0 < level < 1.0:
        _key(axis, 0, "undisturbed surface at the cut", lw=0.8, ls=(0, (5, 4)))


def _key(axis: Any, number: int, words: str, **style: Any) -> None:
    """A line of the key in the upper left corner of a picture: a line of a style, and what it is."""
    y = 1.0 - (0.9 + number) * _LINE / axis.get_position().height
    axis.plot([0.014, 0.066], [y, y], color="white", lw=9.0, alpha=HALO["alpha"], solid_capstyle="butt")  # off a hull
    axis.plot([0.02, 0.06], [y, y], color=INK, **style)
    axis.text(0.075, y, words, fontsize=9, va="center", color=INK, bbox=HALO)


def _heights(axis: Any, stage: Stage | FlatStage, focus: Focus) -> None:
    """A scale of heights over the undisturbed surface along the left edge of a level picture."""
    step = nice_below(_RULER * stage.height)
    low, high = ((focus[1] + share * stage.height) / step for share in (-0.44, 0.42))
    for count in range(int(np.ceil(low)), int(np.floor(high)) + 1):
        y = 0.5 + (count * step - focus[1]) / stage.height
        axis.plot([0.0, 0.01], [y, y], color=INK, lw=1.0)
        number = f"{1e3 * count * step:g}".replace("-", "\N{MINUS SIGN}")
        axis.text(0.015, y, number, fontsize=9, va="center", color=INK, bbox=HALO)
    axis.text(0.015, 0.975, "height [mm]", fontsize=9, va="center", color=INK, bbox=HALO)


def _mark_lowest(axis: Any, reel: SpaceReel, stage: Stage | FlatStage, frame: Frame, focus: Focus) -> None:
    """An arrow from the undisturbed surface to the lowest point of the feet, where it can be seen."""
    lowest = reel.lowest(frame)
    if lowest is None or reel.surface is None:
        return
    height = float(lowest[2]) - reel.surface
    ends = stage.place(np.array([[*lowest[:2], reel.surface], lowest]), focus)
    if abs(ends[1, 1] - ends[0, 1]) < _SEEN:
        return
    x = float(ends[0, 0])
    low, high = sorted((float(ends[0, 1]), float(ends[1, 1])))
    low, high = max(low, 0.0), min(high, 1.0)
    axis.annotate("", (x, high), (x, low), arrowprops=_MEASURE)
    words = f"{1e3 * abs(height):.3g} mm"
    axis.text(x + 0.012, 0.5 * (low + high), words, fontsize=10, va="center", color=INK, bbox=HALO)


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
        spaces = [reel for reel in reels if isinstance(reel, SpaceReel)]
        level = not any(reel.on_grains for reel in spaces)
        if len(reels) == 1:
            foot = 0.17 if len(reels[0].states) else 0.03  # below it the states, where there are any
            if level:  # there is no bar of colours beside it
                return [Panel(0, _Level(spaces), (0.015, foot, 0.97, 0.885 - foot))]
            tall = 0.885 - foot
            return [
                Panel(0, _Space(whole=True), (0.015, foot, 0.40, tall)),
                Panel(0, _Foot(), (0.43, foot, 0.48, tall)),
            ]
        wide = 0.485 if level else 0.445
        places = [(left, 0.18, wide, 0.70) for left in (0.015, 0.025 + wide)]
        return [Panel(run, _Level(spaces) if level else _Space(), place) for run, place in enumerate(places)]
    if len(reels) == 1:
        return [Panel(0, _Plane(), (0.02, 0.17, 0.40, 0.70)), Panel(0, _Near(), (0.435, 0.17, 0.465, 0.70))]
    panels = []
    for run in range(2):
        x, wide = 0.02 + run * (0.44 + 0.01), 0.44
        panels += [Panel(run, _Plane(), (x, 0.53, wide, 0.36)), Panel(run, _Near(), (x, 0.17, wide, 0.35))]
    return panels


def _steady(way: Array) -> Array:
    return gaussian_filter1d(way, _STEADY * len(way), axis=0, mode="nearest") if len(way) > 3 else way
