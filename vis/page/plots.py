"""How every figure looks, and what figures share: the empty sheet, its legend, colours of a row, means over a window.

The colours are safe for the colour-blind (Okabe and Ito).
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from textwrap import fill, wrap
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from matplotlib.lines import Line2D
from matplotlib.rcsetup import cycler
from numpy.typing import NDArray

__all__ = [
    "AMENDED", "AXES", "AXIS_LINES", "BED", "DASHED", "DOTTED", "DPI", "GREY", "INK", "MODEL", "PHASES", "RED",
    "STATES", "WIDTH", "Array", "as_it_lies", "handle", "legend_above", "line_handles", "line_styles", "mean_over",
    "new_figure", "new_panels", "nice_below", "shades", "sheet", "smooth_ratio", "styled", "title_above",
]  # fmt: skip

Array = NDArray[np.float64]
WIDTH = 8.6  # inches; all plots are as wide as the report's column
DASHED, DOTTED = (0, (4, 2)), (0, (1, 1.2))
RED = "#c0392b"
"""What was found to be wrong, in every figure."""
_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#222222", "#E69F00", "#56B4E9", "#8a6d3b")
_DASHES: tuple[Any, ...] = ("-", (0, (4, 1.6)), (0, (1, 1.4)))
BED = "#0072B2"  # what the grains do
MODEL = "#D55E00"  # what the spring-damper does; always dashed as well, for print in grey
AMENDED = "#009E73"  # what the spring-damper does with an effect added
AXES: dict[str, str] = {"x": BED, "y": "#009E73", "z": MODEL}
AXIS_LINES: dict[str, Mapping[str, Any]] = {
    "x": {"color": AXES["x"], "lw": 3.4, "zorder": 2.0},
    "y": {"color": AXES["y"], "lw": 1.8, "ls": DASHED, "zorder": 2.2},
    "z": {"color": AXES["z"], "lw": 1.8, "zorder": 2.1},
}
"""Lines of the three axes in one panel: each shows where they lie on one another, as where all are 0."""
INK = "#222222"
GREY = "#8a8a8a"
STATES = {"stand": "#a4a4a4", "pivot": BED, "slip": MODEL, "hop": "#882255"}
"""The states in the order of losing hold, with their colours: apart for the colour-blind too (tests/vis/test_style.py),
to whom Okabe and Ito's green is the grey of standing or the blue of pivoting; Tol's wine is neither."""
PHASES = {"free": "#eeaa00", "in": "#332288", "rest": STATES["stand"], "out": "#503f00"}
"""The phases of a push: apart from one another, and from the states of a tumble except standing, which is rest."""
DPI = 160
_TITLE, _TITLE_LINE, _TITLE_LETTERS = 10.5, 0.185, 11.2
"""Title of a figure: its size [points], the height of a line [inch], letters in an inch of a line."""
_LEGEND_LETTERS, _KEY = 13.5, 8
"""Letters in an inch of a line of a legend, and how many of them a line or mark with its gaps takes."""
_TOO_LONG = 8.0  # times as long as high: drawn in its true shape such a way is a line

_STYLE: dict[Any, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 9.5,
    "axes.prop_cycle": cycler(color=_COLOURS),
    "axes.titlesize": 10.0,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.labelsize": 9.5,
    "axes.labelcolor": INK,
    "axes.edgecolor": "#666666",
    "axes.linewidth": 0.8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#e4e4e4",
    "grid.linewidth": 0.7,
    "xtick.color": "#444444",
    "ytick.color": "#444444",
    "xtick.labelsize": 8.5,
    "ytick.labelsize": 8.5,
    "lines.linewidth": 1.8,
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "text.color": INK,
    "figure.facecolor": "white",
    "savefig.facecolor": "white",
    "figure.dpi": DPI,  # text is up to 15 % wider than at 100: the layout must know it
    "savefig.dpi": DPI,
    "figure.constrained_layout.use": True,
    "image.cmap": "cividis",
}


@contextmanager
def styled() -> Iterator[None]:
    """The style, for as long as the block lasts; the user's own matplotlib settings stay as they are."""
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(_STYLE)
        yield


def as_it_lies(axis: Axes) -> bool:
    """Give both axes one scale where the heights of the paths stay visible; else the title says "heights stretched".

    Returns whether the paths are drawn in proportion.
    """
    ways = axis.dataLim
    if ways.width <= _TOO_LONG * ways.height:
        axis.set_aspect("equal", adjustable="datalim")
        return True
    axis.set_title("heights stretched", fontsize=8.5, fontweight="normal", color=GREY)
    return False


def new_figure(height: float, *, width: float = WIDTH, **options: Any) -> Figure:
    """An empty figure [inch]."""
    figure = Figure(figsize=(width, height), **options)
    FigureCanvasAgg(figure)
    return figure


def sheet(rows: int, columns: int, height: float, **options: Any) -> tuple[Figure, Any]:
    """A figure of panels in rows and columns; the axes have the shape (rows, columns)."""
    figure = new_figure(height)
    return figure, figure.subplots(rows, columns, squeeze=False, **options)


def new_panels(count: int, *, height: float, sharex: bool = False, sharey: bool = False) -> tuple[Figure, list[Axes]]:
    """A figure of `count` panels, four in a row at most, each `height` inches high; the figure and its panels."""
    rows = 1 if count <= 4 else -(-count // 4)
    figure, grid = sheet(rows, -(-count // rows), height * rows + 0.3, sharex=sharex, sharey=sharey)
    axes = list(grid.ravel())
    for spare in axes[count:]:
        spare.set_visible(False)
    return figure, axes[:count]


def legend_above(figure: Figure, handles: Sequence[Any], columns: int | None = None, **options: Any) -> None:
    """One legend for the whole figure: above its middle in lines that hold it, or in so many columns at its left."""
    if columns is None:
        for lines in range(1, len(handles) + 1):
            count = -(-len(handles) // lines)
            legend = figure.legend(handles=handles, loc="outside upper center", ncols=count, handlelength=2.6)
            if lines == len(handles) or _fits(figure, legend):
                return
            legend.remove()
        return
    legend = figure.legend(handles=handles, loc="outside upper left", ncols=columns, **options)
    if not _fits(figure, legend):
        for words in legend.get_texts():
            words.set_text(fill(words.get_text(), int(_LEGEND_LETTERS * figure.get_size_inches()[0] / columns) - _KEY))


def _fits(figure: Figure, legend: Legend) -> bool:
    return bool(legend.get_window_extent().width < figure.bbox.width)


def title_above(figure: Figure, words: str) -> None:
    """Title a figure with what it is of, such as its surface: above its legend, and the figure grows by as much.

    Where the title of a panel says so already, nothing is added.
    """
    if not words or words in {axis.get_title("left") for axis in figure.axes}:
        return
    width, height = figure.get_size_inches()
    lines = [part for line in words.split("\n") for part in wrap(line, int(_TITLE_LETTERS * width))]
    grown = height + _TITLE_LINE * len(lines) + 0.06
    share = height / grown
    figure.draw_without_rendering()  # the panels keep the places that the layout gives them
    figure.set_layout_engine("none")
    figure.set_size_inches(width, grown)
    boxes = [axis.get_position(original=True) for axis in figure.axes]  # all before one moves: twins move together
    for axis, box in zip(figure.axes, boxes, strict=True):
        axis.set_position((box.x0, share * box.y0, box.width, share * box.height))
    for legend in figure.legends:
        box = legend.get_bbox_to_anchor().transformed(figure.transFigure.inverted())
        anchor = (box.x0, share * box.y0, box.width, share * box.height)
        legend.set_bbox_to_anchor(anchor, transform=figure.transFigure)
    top = 1.0 - 0.07 / grown
    figure.text(0.09 / width, top, "\n".join(lines), fontsize=_TITLE, fontweight="bold", ha="left", va="top")


def handle(label: str, color: Any, **style: Any) -> Line2D:
    """A line, or a mark, of a legend."""
    return Line2D([], [], color=color, label=label, **style)


def shades(count: int) -> list[Any]:
    """A colour for each of so many that have an order, from dark to light."""
    return [colormaps["cividis"](share) for share in np.linspace(0.0, 0.85, count)]


def mean_over(window: float, time: Array, columns: Iterable[Array]) -> list[Array]:
    """Running means over `window` [s], over what there is of it at both ends."""
    count = max(1, round(window / float(np.median(np.diff(time))))) if len(time) > 1 else 1
    kernel = np.ones(min(count, len(time)))
    held = np.convolve(np.ones(len(time)), kernel, mode="same")  # fewer at both ends
    return [np.convolve(values, kernel, mode="same") / held for values in columns]


def smooth_ratio(way: Array, columns: dict[str, Array]) -> tuple[Array, Array]:
    """`way`, and shear over normal stress of a lid, each smoothed over a sixtieth of the rows."""
    count = max(1, len(way) // 60)
    shear, normal = (np.convolve(columns[name], np.ones(count) / count, "valid") for name in ("shear_Pa", "normal_Pa"))
    return way[count // 2 : count // 2 + len(shear)], shear / normal


def line_styles(
    keys: Sequence[Hashable], *, beside_axes: bool = False, without: Sequence[str] = ()
) -> dict[Hashable, Mapping[str, Any]]:
    """Colour and dash of a line for each different key, in their order: replicates that share a key share a line.

    ``beside_axes``: Whether x, y and z are in the same figure or report, so that their colours are left out.
    ``without``: Further colours that are left out. Beyond 24 keys, or 15 beside axes, they begin again.
    """
    taken = {*without, *(AXES.values() if beside_axes else ())}
    colours = tuple(colour for colour in _COLOURS if colour not in taken)
    count = len(colours)
    return {
        key: {"color": colours[place % count], "ls": _DASHES[place // count % len(_DASHES)]}
        for place, key in enumerate(dict.fromkeys(keys))
    }


def line_handles(labels: Sequence[str], keys: Sequence[Hashable]) -> list[Line2D]:
    """For the legend: a line for each different key, followed by the labels that share it."""
    styles = line_styles(keys)
    named = {key: [label for label, own in zip(labels, keys, strict=True) if own == key] for key in styles}
    return [handle(f"{key}: {_listed(named[key])}", lw=1.6, **style) for key, style in styles.items()]


def _listed(labels: Sequence[str]) -> str:
    return ", ".join(labels) if len(labels) <= 4 else f"{labels[0]} to {labels[-1]} ({len(labels)})"


def nice_below(number: float) -> float:
    """The next 1, 2 or 5 times a power of ten not above `number`."""
    power = 10.0 ** np.floor(np.log10(number))
    return float(max(n * power for n in (1.0, 2.0, 5.0) if n * power <= 1.0001 * number))
