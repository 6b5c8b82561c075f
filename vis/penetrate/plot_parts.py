"""What the plots of penetrations share: handles of bed and law, parts of a run's series, means by speed, words."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from vis.page.folder import Run, Series
from vis.page.plots import DASHED, Array, handle
from vis.page.sentences import Sentences
from vis.page.style import BED, MODEL
from vis.penetrate.summary_parts import value_of

__all__ = ["Plot", "above_surface", "by_speed", "has_model", "pair_of_handles", "speed_words", "spread_words"]


captions = Sentences(__package__, "figures.toml")


@dataclass(frozen=True)
class Plot:
    """A figure with the name of its file (without ending), a title and a caption."""

    name: str
    title: str
    caption: str
    figure: Figure

    @classmethod
    def said(cls, key: str, figure: Figure, **values: Any) -> Plot:
        """A figure called as its key, with its title and caption from the table `key` of figures.toml."""
        return cls(key, captions(f"{key}.title", **values), captions(f"{key}.caption", **values).strip(), figure)

    def save(self, folder: Path) -> Path:
        """Write `<folder>/<name>.png`."""
        path = folder / f"{self.name}.png"
        self.figure.savefig(path)
        return path


def pair_of_handles(*, markers: bool = False, bars: bool = False) -> list[Any]:
    """What stands for the bed and for the spring-damper in a legend: lines, lines with marks, or bars."""
    if bars:
        return [
            Patch(facecolor=BED, edgecolor="white", label="bed"),
            Patch(facecolor=MODEL, edgecolor="white", hatch="///", label="spring-damper"),
        ]
    marks = ("o", "D") if markers else ("", "")
    return [handle("bed", BED, marker=marks[0]), handle("spring-damper", MODEL, ls=DASHED, marker=marks[1])]


def above_surface(series: Series | None) -> Series | None:
    """The way in before depth 0 from where grains are first felt; None where none are."""
    if series is None:
        return None
    touched = np.flatnonzero((series.depth < 0.0) & (series.force > 0.0) & (series.velocity > 0.0))
    if not len(touched):
        return None
    keep = (series.depth < 0.0) & (series.velocity > 0.0)
    keep[: touched[0]] = False
    return series.where(keep)


def has_model(runs: Iterable[Run]) -> bool:
    """Whether the spring-damper did any of these runs."""
    return any(r.model is not None for r in runs)


def by_speed(runs: list[Run], speeds: list[float], key: str, scale: float) -> tuple[Array, Array]:
    """Mean and standard deviation between seeds of a quantity at each speed; NaN where unknown."""
    mean, spread = np.full(len(speeds), np.nan), np.full(len(speeds), np.nan)
    for i, speed in enumerate(speeds):
        numbers = [n for r in runs if r.speed == speed and (n := value_of(r.quantities, key)) is not None]
        if numbers:
            mean[i] = scale * float(np.mean(numbers))
        if len(numbers) > 1:
            spread[i] = scale * float(np.std(numbers, ddof=1))
    return mean, spread


def speed_words(speed: float) -> str:
    """A speed, as captions say it."""
    return f"{speed:.3g} m/s"


def spread_words(runs: list[Run]) -> str:
    """What the bars are, where several runs have one speed."""
    speeds = [r.speed for r in runs]
    return " Bars: standard deviation between beds, where there are several." if len(set(speeds)) < len(speeds) else ""
