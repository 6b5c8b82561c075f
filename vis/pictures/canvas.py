"""The page around a picture of the bed: title, colour bar, depth scale. The same with OpenGL and without.

A picture is 4:3. The three-dimensional image, or the cross-section that stands in for it, fills the page to the left of
the colour bar. `place` maps points of the bed onto it, (n, 3) [m] -> (n, 2), in fractions of the page from its lower
left corner.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.colorbar import Colorbar
from matplotlib.colors import Colormap, ListedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke
from numpy.typing import NDArray

from vis.page.numbers import quote
from vis.page.plots import DASHED, INK, styled

__all__ = [
    "BED_SPACE", "COLOURS", "FORCE", "HALO", "HEIGHT", "Page", "blank_page", "colour_top", "colour_values", "colourmap",
    "draw_force", "draw_measure", "drawn", "even_steps", "moved_since", "nice_above", "pixels",
]  # fmt: skip

#: What grains are coloured by: name -> (label with unit, factor from SI).
COLOURS: dict[str, tuple[str, float]] = {
    "displacement": ("displacement since the start [mm]", 1e3),
    "speed": ("speed [mm/s]", 1e3),
    "force": ("net contact force [mN]", 1e3),
    "coordination": ("contacts of the grain [1]", 1.0),
}
HEIGHT = "height"
"""A further colouring, of the ends of runs in space: how far a grain has risen since the start, around 0."""
_LABELS = COLOURS | {HEIGHT: ("change of height since the start [mm]", 1e3)}
HALO = {"facecolor": "white", "alpha": 0.7, "edgecolor": "none", "pad": 1.5}
"""Box of a word on a picture."""
FORCE: dict[str, Any] = {
    "arrowstyle": "-|>,head_width=0.28,head_length=0.55", "color": "#B00020", "lw": 2.2, "shrinkA": 0, "shrinkB": 0,
    "path_effects": [withStroke(linewidth=5.0, foreground="white")],
}  # fmt: skip
"""How an arrow of a force is drawn; its white rim keeps it apart from dark grains and metal."""
_STEPS = {1.0: 5, 1.5: 3, 2.0: 4, 3.0: 3, 4.0: 4, 5.0: 5, 6.0: 6, 8.0: 4}
"""Ends of a colour scale, over a power of ten, and how many equal steps of a round number each is divided into."""
_SHORTEST = 0.005
"""A shorter arrow is not drawn, in fractions of the picture."""
_NUMBERS = 0.7
"""Where the lines of numbers begin on a page, over its width: to the right of the widest body."""
_SMALL, _LETTERS = 9.5, 100
"""Size of the small print [points], and how many letters a line of it has at most across a page."""
BED_SPACE = (0.125, 0.865, 0.15, 0.78)
"""Left, right, foot and head of a bed on a page: beside the scales, over the small print, below title and numbers."""
_SCALE, _SCALE_END = 0.25, 0.825
"""Of the scale of arrows: most of its length, over the page's height, and where it ends, over its width."""
_RIM = 0.01
"""Left free at the picture's edge by an arrow that is cut, in fractions of it."""
Place = Callable[[NDArray[np.float64]], NDArray[np.float64]]


def colourmap() -> Colormap:
    """Pale sand for grains at rest, through orange and red to violet: perceptually uniform (magma, its light part)."""
    return ListedColormap(colormaps["magma_r"](np.linspace(0.03, 0.80, 256)), name="sand")


def colour_values(grains: dict[str, NDArray[Any]], by: str) -> NDArray[np.float64]:
    """What a grain is coloured by, in the unit of the scale's label, shape (n,).

    Raises ValueError: an unknown `by`, or a frame without the field it needs.
    """
    if by not in _LABELS:
        raise ValueError(f"colour is {by!r}; it must be one of {', '.join(COLOURS)}")
    name = "velocity" if by == "speed" else by
    if name not in grains:
        raise ValueError(f"the frame has no {name!r} to colour the grains by")
    field = np.asarray(grains[name], dtype=np.float64)
    amount = np.linalg.norm(field, axis=1) if field.ndim == 2 else field if by == HEIGHT else np.abs(field)
    return _LABELS[by][1] * amount


def moved_since(grains: dict[str, NDArray[Any]], first: dict[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    """The fields of a frame's grains, their displacement [m] counted from the `first` frame on, not from before it.

    The placement presses a bed under a platform before time begins. Fields without displacements stay unchanged.
    """
    if "displacement" not in grains or "displacement" not in first:
        return grains
    before = np.asarray(first["displacement"], dtype=np.float64)
    if "id" in grains and "id" in first:
        places = np.argsort(first["id"])
        before = before[places[np.searchsorted(first["id"], grains["id"], sorter=places)]]
    return grains | {"displacement": np.asarray(grains["displacement"], dtype=np.float64) - before}


def colour_top(sample: Iterable[dict[str, NDArray[Any]]], by: str) -> float:
    """Upper end of a scale for all pictures, in the unit of its label, by those grains of a `sample` that take part."""
    most = 0.0
    for grains in sample:
        values = colour_values(grains, by)
        taking = values[values > 0.05 * values.max()] if len(values) else values
        most = max(most, float(np.percentile(taking, 97)) if len(taking) else 0.0)
    return nice_above(most)


def nice_above(value: float) -> float:
    """The next of 1, 1.5, 2, 3, 4, 5, 6, 8 times a power of ten not below `value`; 1 for 0 or what is no number."""
    if not (np.isfinite(value) and value > 0.0):
        return 1.0
    power = 10.0 ** np.floor(np.log10(value))
    return float(next((n * power for n in _STEPS if n * power >= 0.9999 * value), 10 * power))


def even_steps(top: float) -> NDArray[np.float64]:
    """Numbers at a colour bar: round ones at equal distances from 0 to its end, where that is a `nice_above`."""
    power = 10.0 ** np.floor(np.log10(top) + 1e-9)
    return np.linspace(0.0, top, 1 + _STEPS.get(round(top / power, 6), 5))


class Page:
    """A page of 4:3 for pictures that share a colour scale, which begins at 0; that of heights has 0 in its middle.

    ``size``: Width and height [pixels]. ``by``: What grains are coloured by, a key of `COLOURS`. ``top``: Upper end of
    the scale, in the unit of its label.
    """

    def __init__(self, size: tuple[int, int], by: str, top: float) -> None:
        self.size, self.by, self.norm, self.map = size, by, Normalize(0.0, top), colourmap()
        if by == HEIGHT:
            self.norm, self.map = Normalize(-top, top), colormaps["RdBu"]

    def colours(self, grains: dict[str, NDArray[Any]]) -> NDArray[np.float64]:
        """Colours of the grains of a frame, shape (n, 4)."""
        if not len(grains["position"]):
            return np.zeros((0, 4))
        return np.asarray(self.map(self.norm(colour_values(grains, self.by))))

    def compose(
        self,
        title: str,
        lines: str,
        draw: Callable[[Any], None],
        *,
        place: Place,
        section: tuple[float, float, float, float, float],
        note: str = "",
        arrow: NDArray[np.float64] | None = None,
        newtons: float = 0.0,
    ) -> NDArray[np.uint8]:
        """The finished picture, shape (height, width, 3).

        ``title``, ``lines``: Its words, a few short lines of numbers beside the body. ``draw``: Draws the scene on an
        axes that fills the page, in the page's fractions. ``place``: Where a point of the bed lies on the page.
        ``section``: Of the plane of the cut: x of its left and right end, its y, z of the floor and of the undisturbed
        surface [m]. ``note``: Small print at the foot. ``arrow``: Foot and head of that of a force, in the page's
        fractions, shape (2, 2). ``newtons``: Force of an arrow as long as the picture is high [N]; 0: there are none.
        """
        with styled():
            figure = blank_page(self.size, 8.0)
            axis = figure.add_axes((0.0, 0.0, 1.0, 1.0))
            axis.set_axis_off()
            axis.set(xlim=(0.0, 1.0), ylim=(0.0, 1.0), autoscale_on=False)
            draw(axis)
            foot_line = self._rulers(axis, place, section)
            if newtons > 0.0:
                self._arrow_scale(axis, foot_line, newtons)
            if arrow is not None:
                axis.annotate("", arrow[1], arrow[0], arrowprops=FORCE)
            figure.text(0.03, 0.965, title, fontsize=16, fontweight="bold", va="top", bbox=HALO)
            # Beside the body, where they lie on no grains.
            style: dict[str, Any] = {"va": "top", "color": "#444444", "linespacing": 1.35, "bbox": HALO}
            figure.text(_NUMBERS, 0.965, lines, fontsize=12.5, **style)
            if note:
                foot = figure.text(0.03, 0.016, fill(note, _LETTERS), fontsize=_SMALL, va="bottom", color="#666666")
                foot.set_linespacing(1.3)
            self.colour_bar(figure, (0.885, 0.2, 0.018, 0.5), 11.5).ax.tick_params(labelsize=11)
            return pixels(figure)

    def colour_bar(self, figure: Figure, place: tuple[float, float, float, float], fontsize: float) -> Colorbar:
        """The bar of the colour scale: left, foot, width, height in fractions of the figure."""
        scale = ScalarMappable(self.norm, self.map)
        both = self.by == HEIGHT
        bar = figure.colorbar(scale, cax=figure.add_axes(place), extend="both" if both else "max", extendfrac=0.04)
        steps = even_steps(float(self.norm.vmax or 1.0))
        bar.set_ticks([*-steps[:0:-1], *steps] if both else steps.tolist())
        bar.set_label(_LABELS[self.by][0], fontsize=fontsize)
        bar.outline.set_visible(False)  # type: ignore[operator]
        return bar

    def _arrow_scale(self, axis: Any, height: float, newtons: float) -> None:
        """An arrow of a round force at the right of the page's foot, opposite the length, at this `height` of it."""
        force = _round_below(_SCALE * newtons)
        long = force / newtons * self.size[1] / self.size[0]
        axis.annotate("", (_SCALE_END, height), (_SCALE_END - long, height), arrowprops=FORCE)
        place = {"ha": "center", "va": "top", "fontsize": 11}
        axis.text(_SCALE_END - 0.5 * long, height - 0.022, f"{force:g} N", **place)

    def _rulers(self, axis: Any, place: Place, section: tuple[float, float, float, float, float]) -> float:
        """Depth below the surface along the left edge of the cut, a length along its foot; at which height that is."""
        left, right, y, floor, surface = section
        step = _ruler_step(surface - floor)
        offset = 0.025 * (right - left)

        def line(points: list[tuple[float, float, float]], **style: Any) -> NDArray[np.float64]:
            on_page = place(np.array(points))
            axis.plot(on_page[:, 0], on_page[:, 1], solid_capstyle="butt", **style)
            return on_page

        x = left - offset
        count = int(np.floor((surface - floor) / step + 1e-9))
        line([(x, y, surface), (x, y, floor)], color=INK, lw=1.0)
        # Across the cut, over the spike too: how deep its tip is shows against this line, not against the far surface.
        line([(left, y, surface), (right, y, surface)], color="white", lw=2.4, alpha=0.6)
        line([(left, y, surface), (right, y, surface)], color=INK, lw=1.1, ls=DASHED)
        for i in range(count + 1):
            z = surface - i * step
            ends = line([(x, y, z), (x - 0.5 * offset, y, z)], color=INK, lw=1.0)
            axis.text(ends[1, 0] - 0.006, ends[1, 1], f"{1e3 * i * step:g}", ha="right", va="center", fontsize=11)
            if not i:  # beside the bed: on it the words would hide grains
                words = {"fontsize": 8.5, "ha": "right", "va": "bottom", "linespacing": 1.1}
                axis.text(ends[0, 0], ends[0, 1] + 0.02, "undisturbed\nsurface", **words)
        middle = place(np.array([[x - 0.5 * offset, y, 0.5 * (floor + surface)]]))[0]
        style = {"ha": "center", "va": "center", "fontsize": 11.5}
        axis.text(middle[0] - 0.06, middle[1], "depth below the surface [mm]", rotation=90, **style)
        low = floor - 1.2 * offset
        tick = 0.25 * offset
        right_end = left + step
        ends = line([(left, y, low), (right_end, y, low)], color=INK, lw=1.6)
        for end in (left, right_end):
            line([(end, y, low - tick), (end, y, low + tick)], color=INK, lw=1.6)
        x, z = ends[:, 0].mean(), ends[:, 1].min()
        axis.text(x, z - 0.012, f"{1e3 * step:g} mm", ha="center", va="top", fontsize=11)
        return float(z)


def blank_page(size: tuple[int, int], inches: float) -> Figure:
    """A figure of a size [pixels], as if it were so wide [inch], laid out by hand."""
    figure = Figure(figsize=(inches, inches * size[1] / size[0]), dpi=size[0] / inches)
    figure.set_layout_engine("none")
    FigureCanvasAgg(figure)
    return figure


def drawn(figure: Figure) -> Any:
    """A figure drawn once, for `pixels` to draw others of its size over."""
    canvas = figure.canvas
    assert isinstance(canvas, FigureCanvasAgg)
    canvas.draw()
    return canvas.copy_from_bbox(figure.bbox)  # type: ignore[no-untyped-call]


def pixels(figure: Figure, *, over: Any = None) -> NDArray[np.uint8]:
    """A figure drawn, shape (height, width, 3); drawn over the picture `over`, without its background."""
    canvas = figure.canvas
    assert isinstance(canvas, FigureCanvasAgg)
    if over is None:
        canvas.draw()
    else:
        canvas.restore_region(over)  # type: ignore[no-untyped-call]
        figure.patch.set_visible(False)
        figure.draw(canvas.get_renderer())  # type: ignore[no-untyped-call]
    return np.asarray(canvas.buffer_rgba())[..., :3].copy()


def _round_below(value: float) -> float:
    """The next of 1, 2, 5 times a power of ten not above `value`, which is above 0."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(max(n * power for n in (1.0, 2.0, 5.0) if n * power <= value * (1 + 1e-9)))


def _ruler_step(length: float) -> float:
    rough = max(length, 1e-9) / 4.0
    power = 10.0 ** np.floor(np.log10(rough))
    return float(min((n * power for n in (1.0, 2.0, 5.0, 10.0)), key=lambda step: abs(np.log(step / rough))))


# Arrows of forces: one that is too long for its picture ends at its edge, with the number beside it -------------------


def draw_force(axis: Any, foot: NDArray[np.float64], head: NDArray[np.float64], force: float) -> None:
    """An arrow from `foot` to `head`, places of shape (2,) in an `axis` from 0 to 1; `force` is its amount [N].

    What would lie outside is cut off, and the number says so. Where nothing of it lies inside, nothing is drawn.
    """
    if np.linalg.norm(head - foot) <= _SHORTEST:
        return
    low, high = _inside(foot, head)
    if low >= high:
        return
    start, end = foot + low * (head - foot), foot + high * (head - foot)
    axis.annotate("", end, start, arrowprops=FORCE)
    if high < 1.0:
        _note(axis, end, f"{quote(force, unit='N')}, arrow cut")


def draw_measure(sheet: Figure, *, right: float, height: float, length: float, weight: float) -> None:
    """The weight [N] as an arrow of `length` [inch] above the pictures, where it hides and meets nothing.

    right, height: where it ends on the sheet, in fractions of that.
    """
    wide = length / float(sheet.get_size_inches()[0])
    axis = sheet.add_axes((right - wide, height - 0.01, wide, 0.02))
    axis.set_axis_off()
    axis.set(xlim=(0.0, 1.0), ylim=(0.0, 1.0))
    axis.annotate("", (1.0, 0.5), (0.0, 0.5), arrowprops=FORCE)
    words = f"weight, {quote(weight, unit='N')}"
    sheet.text(right - wide - 0.008, height, words, fontsize=10, ha="right", va="center", color=INK)


def _inside(foot: NDArray[np.float64], head: NDArray[np.float64]) -> tuple[float, float]:
    """From which share of the way to which it lies inside the rim (Liang and Barsky); from >= to: nowhere."""
    low, high = 0.0, 1.0
    for at, along in zip(foot, head - foot, strict=True):
        if along == 0.0:
            if not _RIM <= at <= 1.0 - _RIM:
                return 1.0, 0.0
            continue
        first, last = sorted(((_RIM - at) / along, (1.0 - _RIM - at) / along))
        low, high = max(low, first), min(high, last)
    return low, high


def _note(axis: Any, end: NDArray[np.float64], words: str) -> None:
    """Words beside the end of an arrow and over its shaft, towards the middle."""
    x, y = float(end[0]), float(np.clip(end[1] + 0.05, 0.06, 0.96))
    aside, side = (0.03, "left") if x < 0.6 else (-0.03, "right")
    axis.text(x + aside, y, words, fontsize=10, ha=side, va="center", color=INK, bbox=HALO)
