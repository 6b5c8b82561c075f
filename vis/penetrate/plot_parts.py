"""What plots share: the figure, its legend, their way into a report; the parts of a penetration run's series, words."""

from __future__ import annotations

from collections.abc import Iterable
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

from vis.page.folder import Run, Series
from vis.page.page import Block
from vis.page.page import figure as block_of
from vis.page.style import BED, MODEL, styled

__all__ = [
    "WIDTH",
    "Plot",
    "above_surface",
    "by_speed",
    "drawn_into",
    "has_model",
    "legend_above",
    "new_panels",
    "number_of",
    "pair_of_handles",
    "shades",
    "speed_words",
    "spread_words",
]

WIDTH = 8.6  # inches; all plots are as wide as the report's column


@dataclass(frozen=True)
class Plot:
    """A figure with the name of its file (without ending), a title and a caption."""

    name: str
    title: str
    caption: str
    figure: Figure

    def save(self, folder: Path) -> Path:
        """Write `<folder>/<name>.png`."""
        path = folder / f"{self.name}.png"
        with styled():
            self.figure.savefig(path)
        return path


def drawn_into(folder: Path, plots: Iterable[Plot]) -> list[Block]:
    """Write the plots to `<folder>/figures`; what shows them in a report."""
    figures = folder / "figures"
    figures.mkdir(exist_ok=True)
    return [block_of(plot.save(figures), title=plot.title, caption=plot.caption) for plot in plots]


def shades(count: int) -> list[Any]:
    """A colour for each of so many that have an order, from dark to light."""
    return [colormaps["cividis"](share) for share in np.linspace(0.0, 0.85, count)]


def new_panels(count: int, *, height: float, sharex: bool = False, sharey: bool = False) -> tuple[Figure, list[Axes]]:
    """A figure of `count` panels, four in a row at most, each `height` inches high; the figure and its panels."""
    rows = 1 if count <= 4 else -(-count // 4)
    columns = -(-count // rows)
    figure = Figure(figsize=(WIDTH, height * rows + 0.3))
    FigureCanvasAgg(figure)
    axes = list(figure.subplots(rows, columns, squeeze=False, sharex=sharex, sharey=sharey).ravel())
    for spare in axes[count:]:
        spare.set_visible(False)
    return figure, axes[:count]


def legend_above(figure: Figure, handles: list[Any]) -> None:
    """One legend for the whole figure, in a line above it."""
    figure.legend(handles=handles, loc="outside upper center", ncols=len(handles), handlelength=2.6)


def pair_of_handles(*, markers: bool = False, bars: bool = False) -> list[Any]:
    """What stands for the bed and for the spring-damper in a legend: lines, lines with marks, or bars."""
    if bars:
        from matplotlib.patches import Patch

        return [
            Patch(facecolor=BED, edgecolor="white", label="bed"),
            Patch(facecolor=MODEL, edgecolor="white", hatch="///", label="spring-damper"),
        ]
    marks = ("o", "D") if markers else ("", "")
    return [
        Line2D([], [], color=BED, marker=marks[0], label="bed"),
        Line2D([], [], color=MODEL, ls=(0, (4, 2)), marker=marks[1], label="spring-damper"),
    ]


def above_surface(series: Series | None) -> Series | None:
    """The way in before depth 0 from where grains are first felt; None where none are."""
    if series is None:
        return None
    touched = np.flatnonzero((series.depth < 0.0) & (series.force > 0.0) & (series.velocity > 0.0))
    if not len(touched):
        return None
    keep = (series.depth < 0.0) & (series.velocity > 0.0)
    keep[: touched[0]] = False
    return Series(series.time[keep], series.depth[keep], series.velocity[keep], series.force[keep], series.phase[keep])


def has_model(runs: Iterable[Run]) -> bool:
    """Whether the spring-damper did any of these runs."""
    return any(r.model is not None for r in runs)


def by_speed(
    runs: list[Run], speeds: list[float], key: str, scale: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Mean and standard deviation between seeds of a quantity at each speed; NaN where unknown."""
    mean, spread = np.full(len(speeds), np.nan), np.full(len(speeds), np.nan)
    for i, speed in enumerate(speeds):
        numbers = [n for r in runs if r.speed == speed and (n := number_of(r.quantities, key)) is not None]
        if numbers:
            mean[i] = scale * float(np.mean(numbers))
        if len(numbers) > 1:
            spread[i] = scale * float(np.std(numbers, ddof=1))
    return mean, spread


def number_of(quantities: Any, key: str) -> float | None:
    """The value of a quantity; None where there is none that is a number."""
    entry = quantities.get(key) if isinstance(quantities, dict) else None
    number = entry.get("value") if isinstance(entry, dict) else entry
    return float(number) if isinstance(number, int | float) and np.isfinite(number) else None


def speed_words(speed: float) -> str:
    """A speed, as captions say it."""
    return f"{speed:.3g} m/s"


def spread_words(runs: list[Run]) -> str:
    """What the bars are, where several runs have one speed."""
    speeds = [r.speed for r in runs]
    return " Bars: standard deviation between beds, where there are several." if len(set(speeds)) < len(speeds) else ""
