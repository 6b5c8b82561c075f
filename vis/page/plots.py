"""What figures share: the empty sheet, its legend, the colours of a row, means over a window, the way into a report."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from vis.page.sentences import Sentences
from vis.page.style import styled

__all__ = [
    "DASHED", "DOTTED", "WIDTH", "Array", "Plot", "handle", "legend_above", "mean_over", "new_figure", "new_panels",
    "shades", "sheet", "smooth_ratio",
]  # fmt: skip

Array = NDArray[np.float64]
WIDTH = 8.6  # inches; all plots are as wide as the report's column
DASHED, DOTTED = (0, (4, 2)), (0, (1, 1.2))


@dataclass(frozen=True)
class Plot:
    """A figure with the name of its file (without ending), a title and a caption."""

    name: str
    title: str
    caption: str
    figure: Figure

    @classmethod
    def said(cls, captions: Sentences, key: str, figure: Figure, *, name: str = "", **values: Any) -> Plot:
        """A figure called `name`, or as its key, with its title and caption from the table `key` of figures.toml."""
        return cls(name or key, captions(f"{key}.title", **values), captions(f"{key}.caption", **values), figure)

    def save(self, folder: Path, dpi: int | None = None) -> Path:
        """Write `<folder>/<name>.png`."""
        path = folder / f"{self.name}.png"
        with styled():
            self.figure.savefig(path, dpi=dpi)
        return path


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
    """One legend for the whole figure: in one line above its middle, or in so many columns above its left."""
    if columns is None:
        figure.legend(handles=handles, loc="outside upper center", ncols=len(handles), handlelength=2.6)
    else:
        figure.legend(handles=handles, loc="outside upper left", ncols=columns, **options)


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
