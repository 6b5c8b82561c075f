"""Plots of driven spikes: drag against depth, where the spring-damper departs from it, work in and out.

And what these plots share with those of drops: handles of bed and law, parts of a series, means by speed.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import TwoSlopeNorm
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.text import Annotation
from matplotlib.ticker import MaxNLocator

from rigid.intervals import half_width
from vis.page.folder import Run, RunFolder, Series
from vis.page.numbers import plain, quote, short
from vis.page.plots import BED, DASHED, GREY, INK, MODEL, Array, handle, legend_above, new_panels, sheet
from vis.page.sentences import Sentences
from vis.penetrate.summary_parts import Departure, departure_rows, value_of

__all__ = [
    "OVER_BEDS", "RECORDED", "Plot", "above_surface", "band_handle", "bar_handle", "by_speed", "drag_plot", "gap_plot",
    "has_model", "pair_of_handles", "spread_words", "work_plot",
]  # fmt: skip

say = Sentences(__package__)
captions = Sentences(__package__, "figures.toml")
RECORDED: dict[str, Any] = {"color": GREY, "lw": 0.7, "alpha": 0.7}
"""Line of a force of the bed as recorded: grey, so that only means are in the bed's blue."""
OVER_BEDS = "95 % interval of the mean over beds"
"""What a bar or a band is that shows a ±."""
_UNLOADING: Any = (0, (5, 1.3, 1, 1.3))
_BAR = 0.36
"""Width of a bar, over the distance of two speeds."""
_SMALL = 1e-3
"""Share of the largest number of a figure below which a number at a bar is "about 0"."""


@dataclass(frozen=True)
class Plot:
    """A figure with the name of its file (without ending), a title and a caption."""

    name: str
    title: str
    caption: str
    figure: Figure

    @classmethod
    def of(cls, key: str, figure: Figure, **values: Any) -> Plot:
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


def band_handle(label: str, color: Any, alpha: float) -> Patch:
    """What stands for a band in a legend."""
    return Patch(facecolor=color, alpha=alpha, lw=0, label=label)


def bar_handle(label: str = OVER_BEDS) -> Any:
    """What stands for an error bar in a legend."""
    return handle(label, INK, marker="|", ls="", ms=10, mew=1.0)


def above_surface(series: Series | None) -> Series | None:
    """The rows of loading above depth 0 from the first contact with a grain; None without such a contact."""
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
    """Mean over seeds of a quantity at each speed, and half of its 95 % interval; NaN where unknown."""
    mean, half = np.full(len(speeds), np.nan), np.full(len(speeds), np.nan)
    for i, speed in enumerate(speeds):
        numbers = [n for r in runs if r.speed == speed and (n := value_of(r.quantities, key)) is not None]
        if numbers:
            mean[i] = scale * float(np.mean(numbers))
        if len(numbers) > 1:
            half[i] = scale * (half_width(float(np.std(numbers, ddof=1)), len(numbers)) or np.nan)
    return mean, half


def spread_words(runs: list[Run]) -> str:
    """What the bars are, where several runs have one speed."""
    speeds = [r.speed for r in runs]
    return f" Bars: {OVER_BEDS}, where there are several." if len(set(speeds)) < len(speeds) else ""


def drag_plot(run: RunFolder) -> Plot | None:
    """Drag against depth, one panel per speed; every seed of the bed, their mean and spread; the spring-damper."""
    driven = [r for r in run.of_kind("driven") if r.bed is not None and r.speed is not None]
    speeds = sorted({r.speed for r in driven if r.speed is not None})
    if not speeds:
        return None
    figure, axes = new_panels(len(speeds), height=3.0, sharex=True, sharey=True)
    above = [part for r in driven if (part := above_surface(r.bed)) is not None]
    for axis, speed in zip(axes, speeds, strict=True):
        here = [r for r in driven if r.speed == speed]
        seeds = len(here)
        axis.set_title(f"{speed:.3g} m/s   ({seeds} bed{'s' if seeds > 1 else ''})")
        for way, dashes in (("in", "-"), ("out", _UNLOADING)):
            _band(axis, _parts([r.bed for r in here], way), dashes)
            if models := _parts([r.model for r in here], way):
                grid, mean, _ = _mean_by_depth(models)
                style = DASHED if way == "in" else (0, (1, 1.5))
                axis.plot(1e3 * grid, mean, color=MODEL, ls=style, lw=1.8)
        for part in filter(None, (above_surface(r.bed) for r in here)):
            axis.plot(1e3 * part.depth, part.force, **RECORDED)
            grid, mean, _ = _mean_by_depth([part], bins=8)
            axis.plot(1e3 * grid, mean, color=BED, lw=1.2)
        axis.axhline(0.0, color=GREY, lw=0.8)
        if above:
            axis.axvline(0.0, color=GREY, lw=0.8, ls=(0, (2, 2)))
        axis.set_xlim(left=1e3 * min((float(part.depth.min()) for part in above), default=0.0))
        axis.xaxis.set_major_locator(MaxNLocator(4, steps=[1, 2, 5, 10]))
    _label(axes, "depth of the tip [mm]", "force of the ground [N]")
    handles: list[Any] = [handle("bed, loading", BED, lw=2.2)]
    out = any(((r.bed.phase == "out") & (r.bed.depth >= 0.0)).any() for r in driven if r.bed is not None)
    handles += [handle("bed, unloading", BED, lw=1.8, ls=_UNLOADING)] if out else []
    handles += [handle("bed, as recorded", **RECORDED)]
    many = any(sum(r.speed == s for r in driven) > 1 for s in speeds)
    if many:
        handles.append(band_handle("band: one standard deviation between beds", BED, 0.2))
    law = has_model(driven)
    handles += [handle("spring-damper, in", MODEL, ls=DASHED)] if law else []
    handles += [handle("spring-damper, out", MODEL, ls=(0, (1, 1.5)))] if law and out else []
    legend_above(figure, handles)
    # The slices of depth that `_mean_by_depth` averages over, where they are the same at all speeds.
    slices = {part.depth.max() / _bins([part]) for part in _parts([r.bed for r in driven], "in")}
    widths = {quote(float(width), None, "m", significant=2) for width in slices}
    sentences = [
        say("drag_thick", width=widths.pop() if len(widths) == 1 else "slices"),
        say("drag_beds") if many else say("drag_bed"),
        say("drag_left") if above else "",
        say("drag_law") + say("drag_law_out" if out else "drag_law_in") if law else "",
    ]
    moved = f"driven in{' and pulled out' if out else ''}"
    return Plot.of("drag", figure, moved=moved, parts="".join(sentences))


def gap_plot(run: RunFolder) -> Plot | None:
    """Spring-damper minus bed by depth and speed, as a map with the numbers written in."""
    table = departure_rows(run.result) or _departures_of_series(run)
    if not table:
        return None
    speeds = sorted({row.speed for row in table})
    depths = sorted({(row.depth_from, row.depth_to) for row in table})
    difference = np.full((len(depths), len(speeds)), np.nan)
    cells: dict[tuple[int, int], Departure] = {
        (depths.index((row.depth_from, row.depth_to)), speeds.index(row.speed)): row for row in table
    }
    for at, row in cells.items():
        difference[at] = row.difference
    counted = any(row.known for row in table)
    bound = float(np.nanmax(np.abs(difference))) or 1.0
    figure, ((axis,),) = sheet(1, 1, max(2.6, 0.9 + (0.62 if counted else 0.42) * len(depths)))
    norm = TwoSlopeNorm(0.0, -bound, bound)
    image = axis.imshow(difference, cmap="RdBu_r", norm=norm, aspect="auto")
    axis.set_xticks(range(len(speeds)), [f"{s:.4g}" for s in speeds])
    axis.set_yticks(range(len(depths)), [f"{short(1e3 * a)} to {short(1e3 * b)}" for a, b in depths])
    axis.set_ylabel("depth [mm]")
    axis.grid(False)
    axis.set_xticks(np.arange(len(speeds) + 1) - 0.5, minor=True)
    axis.set_yticks(np.arange(len(depths) + 1) - 0.5, minor=True)
    axis.grid(True, which="minor", color="white", lw=2.0)
    axis.tick_params(which="both", length=0)
    axis.spines[:].set_visible(False)
    sure = False
    for (i, j), row in cells.items():
        number = row.difference
        text = f"{'+' if number > 0 else ''}{quote(number, None, 'N', significant=2)}"
        if row.share is not None:
            text += f"   ({'+' if row.share > 0 else ''}{plain(100.0 * row.share, 2)} %)"
        if row.known:
            half = half_width(row.bed_std, round(row.beds or 0))
            text += f"\n{'' if half is None else f'± {plain(half, 2)} N, '}{row.known}"
            sure = sure or half is not None
        dark = abs(number) > 0.55 * bound
        axis.text(j, i, text, ha="center", va="center", fontsize=8.5, color="white" if dark else INK)
    axis.set_xlabel(f"speed [m/s]{f'     (±: half of the {OVER_BEDS})' if sure else ''}")
    bar = figure.colorbar(image, ax=axis, pad=0.015, fraction=0.05)
    bar.set_label("spring-damper − bed [N]")
    bar.outline.set_visible(False)
    note = say("gap_told") if counted else ""
    return Plot.of("gap", figure, note=note)


def work_plot(run: RunFolder) -> Plot | None:
    """Work put in and got back, bed beside spring-damper, by speed."""
    known = (r for r in run.of_kind("driven") if r.speed is not None)
    driven = [r for r in known if value_of(r.quantities, "work_in") is not None]
    speeds = sorted({r.speed for r in driven if r.speed is not None})
    if not speeds:
        return None
    figure, axes = new_panels(2, height=2.7, sharey=True)
    law = any(value_of(r.quantities, "model_work_in") is not None for r in driven)
    sides = ((-0.2, "", BED), (0.2, "model_", MODEL)) if law else ((0.0, "", BED),)
    titles = {"work_in": "Work done in loading", "work_out": "Work recovered on withdrawal"}
    known_of = {prefix + key: by_speed(driven, speeds, prefix + key, 1e3) for _, prefix, _ in sides for key in titles}
    largest = float(np.nanmax(np.abs([mean for mean, _ in known_of.values()])))
    labels, bars = [], False
    for axis, (key, title) in zip(axes, titles.items(), strict=True):
        for shift, prefix, colour in sides:
            mean, half = known_of[prefix + key]
            where = np.arange(len(speeds)) + shift
            axis.bar(where, mean, _BAR, color=colour, hatch="///" if prefix else "", edgecolor="white", lw=0.6)
            if prefix:
                half = np.zeros_like(half)  # one law: its runs differ in where they start only
            else:
                axis.errorbar(where, mean, half, fmt="none", ecolor=INK, elinewidth=1.0, capsize=3)
                bars = bars or bool(np.isfinite(half).any())
            for x, y, over in zip(where, mean, np.nan_to_num(half), strict=True):
                if np.isfinite(y):
                    words = plain(y, 2 if abs(y) < 0.1 else 3) if abs(y) >= _SMALL * largest else "about 0"
                    labels.append(axis.annotate(
                        words, (x, max(y + over, 0.0)), xytext=(0, 3), fontsize=7.5,
                        textcoords="offset points", ha="center", color=INK,
                    ))  # fmt: skip
        axis.set_title(title)
        axis.set_xticks(range(len(speeds)), [f"{s:.4g}" for s in speeds])
        axis.grid(False, axis="x")
        axis.set_xlim(-0.7, max(len(speeds), 2) - 0.3 if len(speeds) > 1 else 0.7)
        axis.margins(y=0.15)
        axis.axhline(0.0, color=GREY, lw=0.8)
    _label(axes, "speed [m/s]", "work [mJ]")
    legend_above(figure, [*pair_of_handles(bars=True)[: 2 if law else 1], *([bar_handle()] if bars else [])])
    _stand_up(figure, axes, labels)
    return Plot.of("work", figure, words=_returned_words(driven) + spread_words(driven))


def _stand_up(figure: Figure, axes: list[Axes], labels: list[Annotation]) -> None:
    """Turn the numbers above bars upright where one is wider than its bar: it would lie on the next one."""
    figure.draw_without_rendering()
    wide = min(float(np.ptp(axis.transData.transform([(0.0, 0.0), (_BAR, 0.0)])[:, 0])) for axis in axes)
    if max((label.get_window_extent().width for label in labels), default=0.0) > wide:
        for label in labels:
            label.set_rotation(90)
        for axis in axes:
            axis.margins(y=0.3)


def _label(axes: list[Axes], x: str, y: str) -> None:
    for axis in axes:
        place = axis.get_subplotspec()
        axis.set_xlabel(x)
        if place is None or place.is_first_col():
            axis.set_ylabel(y)


def _band(axis: Axes, there: Sequence[Series], dashes: Any) -> None:
    """Force of the bed over depth: each part as recorded, their mean with these dashes, and their spread."""
    if not there:
        return
    grid, mean, spread = _mean_by_depth(there)
    for part in there:
        axis.plot(1e3 * part.depth, part.force, **RECORDED)
    if len(there) > 1:
        axis.fill_between(1e3 * grid, mean - spread, mean + spread, color=BED, alpha=0.2, lw=0)
    axis.plot(1e3 * grid, mean, color=BED, ls=dashes, lw=2.2 if dashes == "-" else 1.8)


def _parts(runs: Iterable[Series | None], way: str) -> list[Series]:
    """The rows of loading or unloading in the ground ("in", "out"), of those runs that have more than one."""
    parts = (series.part(way) for series in runs if series is not None)
    return [inside for part in parts if len(inside := part.where(part.depth >= 0.0)) > 1]


def _mean_by_depth(parts: Sequence[Series], bins: int = 40) -> tuple[Array, Array, Array]:
    """Depth [m], mean force [N] and its standard deviation between the parts [N], shape (bins,).

    Each part is averaged within a bin first, so that noise within one bed is not taken for spread between beds.
    """
    there = [part for part in parts if len(part) > 1]
    if not there:
        return np.zeros(0), np.zeros(0), np.zeros(0)
    deepest = max(float(part.depth.max()) for part in there)
    bins = _bins(there, bins)
    lowest = min(0.0, *(float(part.depth.min()) for part in there))
    edges = np.linspace(lowest, max(deepest, lowest + 1e-12), bins + 1)
    rows = np.full((len(there), bins), np.nan)
    for row, part in zip(rows, there, strict=True):
        which = np.clip(np.digitize(part.depth, edges) - 1, 0, bins - 1)
        count = np.bincount(which, minlength=bins)
        row[count > 0] = np.bincount(which, part.force, bins)[count > 0] / count[count > 0]
    filled = np.isfinite(rows).any(axis=0)
    rows = rows[:, filled]
    many = np.isfinite(rows).sum(axis=0)
    spread = np.nanstd(rows, axis=0, ddof=0) * np.sqrt(np.where(many > 1, many / np.maximum(many - 1, 1), 0.0))
    return (0.5 * (edges[1:] + edges[:-1]))[filled], np.nanmean(rows, axis=0), spread


def _bins(parts: list[Series], most: int = 40) -> int:
    return int(np.clip(min(len(part) for part in parts) // 3, 4, most))


def _departures_of_series(run: RunFolder) -> list[Departure]:
    """The table of departures made from the driven series, where none is written."""
    rows = []
    for speed in run.speeds("driven"):
        here = [r for r in run.of_kind("driven") if r.speed == speed and r.bed is not None and r.model is not None]
        grid, bed, _ = _mean_by_depth(_parts([r.bed for r in here], "in"), bins=5)
        grid2, model, _ = _mean_by_depth(_parts([r.model for r in here], "in"), bins=5)
        if len(grid) == len(grid2) > 1:
            half = 0.5 * (grid[1] - grid[0])
            rows += [
                Departure(speed, d - half, d + half, b, m)
                for d, b, m in zip(grid.tolist(), bed.tolist(), model.tolist(), strict=True)
            ]
    return rows


def _returned_words(runs: list[Run]) -> str:
    """The recovered share of the work of loading, of bed and spring-damper: the mean over these runs."""
    shares = []
    for prefix, what in (("", "the bed"), ("model_", "the spring-damper")):
        works = [
            out / put
            for r in runs
            if (put := value_of(r.quantities, f"{prefix}work_in") or 0.0) > 0.0
            and (out := value_of(r.quantities, f"{prefix}work_out")) is not None
        ]
        if works:
            shares.append(f"{what} {quote(float(np.mean(works)), None, '%', significant=2)}")
    return f" Share recovered, mean over the pushes: {', '.join(shares)}." if shares else ""
