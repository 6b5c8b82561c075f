"""Plots of a run folder: each function takes a `RunFolder` and returns a `Plot`, or None where there is no data.

The bed is blue and solid, the spring-damper orange and dashed, in every plot. Depth is in mm, positive downwards.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import TwoSlopeNorm
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from vis.folder import Run, RunFolder, Series
from vis.numbers import column, plain, quote, short
from vis.style import BED, GREY, INK, MODEL, styled

__all__ = [
    "PLOTS",
    "Plot",
    "drag_plot",
    "drop_peaks_plot",
    "drops_plot",
    "gap_plot",
    "make_plots",
    "set_down_plot",
    "spread_plot",
    "work_plot",
]

_WIDTH = 8.6  # inches; all plots are as wide as the report's column


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


def make_plots(run: RunFolder, folder: str | Path | None = None) -> tuple[list[tuple[Plot, Path]], list[str]]:
    """Draw and write every plot the folder has data for.

    Args:
        run: The run folder.
        folder: Where the PNGs go; by default the run's `figures/`.

    Returns:
        The plots with their files, and a sentence on each that could not be drawn.
    """
    target = Path(folder) if folder is not None else run.path / "figures"
    target.mkdir(parents=True, exist_ok=True)
    drawn: list[tuple[Plot, Path]] = []
    missing: list[str] = []
    for what, draw in PLOTS.items():
        try:
            plot = draw(run)
        except (ValueError, TypeError, KeyError, IndexError, ZeroDivisionError, FloatingPointError) as error:
            missing.append(f"{what}: could not be drawn ({type(error).__name__}: {error}).")
            continue
        if plot is None:
            missing.append(f"{what}: no data.")
        else:
            drawn.append((plot, plot.save(target)))
    return drawn, missing


# ---- drag ----------------------------------------------------------------------------------------------------------


def drag_plot(run: RunFolder) -> Plot | None:
    """Drag against depth, one panel per speed; every seed of the bed, their mean and spread; the spring-damper."""
    driven = [r for r in run.of_kind("driven") if r.bed is not None and r.speed is not None]
    speeds = sorted({r.speed for r in driven if r.speed is not None})
    if not speeds:
        return None
    with styled():
        figure, axes = _panels(len(speeds), height=3.0, sharex=True, sharey=True)
        above = [part for r in driven if (part := _above_surface(r.bed)) is not None]
        for axis, speed in zip(axes, speeds, strict=True):
            here = [r for r in driven if r.speed == speed]
            seeds = len(here)
            axis.set_title(f"{_speed(speed)}   ({seeds} bed{'s' if seeds > 1 else ''})")
            for way, shade in (("in", 1.0), ("out", 0.45)):
                parts = [_way(r.bed, way) for r in here]
                _band(axis, parts, BED, alpha=shade, solid=way == "in")
                models = [_way(r.model, way) for r in here if r.model is not None]
                if models:
                    grid, mean, _ = _mean_by_depth(models)
                    style = (0, (4, 2)) if way == "in" else (0, (1, 1.5))
                    axis.plot(1e3 * grid, mean, color=MODEL, ls=style, lw=1.8)
            for part in (_above_surface(r.bed) for r in here):
                if part is not None:
                    axis.plot(1e3 * part.depth, part.force, color=BED, lw=0.6, alpha=0.25)
                    grid, mean, _ = _mean_by_depth([part], bins=8)
                    axis.plot(1e3 * grid, mean, color=BED, lw=1.6, alpha=0.4)
            axis.axhline(0.0, color=GREY, lw=0.8)
            if above:
                axis.axvline(0.0, color=GREY, lw=0.8, ls=(0, (2, 2)))
            axis.set_xlim(left=1e3 * min((float(part.depth.min()) for part in above), default=0.0))
            axis.xaxis.set_major_locator(MaxNLocator(4, steps=[1, 2, 5, 10]))
        _label(axes, "depth of the tip [mm]", "force on the spike [N]")
        handles = [Line2D([], [], color=BED, lw=2.2, label="bed, way in")]
        out = any(len(_way(r.bed, "out") or ()) for r in driven)
        handles += [Line2D([], [], color=BED, lw=2.2, alpha=0.45, label="bed, way out")] if out else []
        handles += [Line2D([], [], color=BED, lw=0.7, alpha=0.55, label="bed, as recorded")]
        law = _has_model(driven)
        handles += [Line2D([], [], color=MODEL, ls=(0, (4, 2)), label="spring-damper, in")] if law else []
        handles += [Line2D([], [], color=MODEL, ls=(0, (1, 1.5)), label="spring-damper, out")] if law and out else []
        _legend(figure, handles)
    many = any(sum(r.speed == s for r in driven) > 1 for s in speeds)
    width = _bin_width([_way(r.bed, "in") for r in driven])
    spread = f"Thick: mean over {width} of depth" if width else "Thick: mean over slices of depth"
    spread += f"{' and over the beds' if many else ''}. Faint: as recorded{', each bed' if many else ''}. "
    spread += "Band: one standard deviation between beds. " if many else ""
    if above:
        spread += (
            "Left of 0, pale: before the tip has reached the surface it is carried by grains that stick out of it; the "
            "fit leaves that out. "
        )
    if law:
        spread += "Dashed: the fitted spring-damper in the same motion"
        spread += "; dotted: its way out, predicted, not fitted." if out else "."
    return Plot(
        "drag",
        "Drag against depth",
        "The ground's force on the spike, upwards, while it is driven in"
        f"{' and pulled out' if out else ''} at constant speed. {spread}".strip(),
        figure,
    )


def gap_plot(run: RunFolder) -> Plot | None:
    """Spring-damper minus bed by depth and speed, as a map with the numbers written in."""
    table = _gap_table(run)
    if not table:
        return None
    speeds = sorted({row["speed"] for row in table})
    depths = sorted({(row["depth_from"], row["depth_to"]) for row in table})
    difference = np.full((len(depths), len(speeds)), np.nan)
    share = np.full_like(difference, np.nan)
    for row in table:
        at = depths.index((row["depth_from"], row["depth_to"])), speeds.index(row["speed"])
        difference[at] = row["model_force"] - row["bed_force"]
        share[at] = difference[at] / row["bed_force"] if row["bed_force"] > 0 else np.nan
    unit, words = column([float(cell) for cell in difference.ravel()], "N")
    bound = float(np.nanmax(np.abs(difference))) or 1.0
    with styled():
        figure = Figure(figsize=(_WIDTH, max(2.6, 0.9 + 0.42 * len(depths))))
        FigureCanvasAgg(figure)
        axis = figure.add_subplot()
        norm = TwoSlopeNorm(0.0, -bound, bound)
        image = axis.imshow(difference, cmap="PuOr_r", norm=norm, aspect="auto")
        axis.set_xticks(range(len(speeds)), [f"{s:.4g}" for s in speeds])
        axis.set_yticks(range(len(depths)), [f"{short(1e3 * a)} to {short(1e3 * b)}" for a, b in depths])
        axis.set_xlabel("speed [m/s]")
        axis.set_ylabel("depth [mm]")
        axis.grid(False)
        axis.set_xticks(np.arange(len(speeds) + 1) - 0.5, minor=True)
        axis.set_yticks(np.arange(len(depths) + 1) - 0.5, minor=True)
        axis.grid(True, which="minor", color="white", lw=2.0)
        axis.tick_params(which="both", length=0)
        axis.spines[:].set_visible(False)
        for ((i, j), cell), word in zip(np.ndenumerate(difference), words, strict=True):
            number = float(cell)
            if not np.isfinite(number):
                continue
            text = f"{'+' if number > 0 else ''}{word} {unit}"
            if np.isfinite(share[i, j]):
                text += f"   ({_signed(100.0 * float(share[i, j]), 2)} %)"
            dark = abs(number) > 0.62 * bound
            axis.text(j, i, text, ha="center", va="center", fontsize=8.5, color="white" if dark else INK)
        bar = figure.colorbar(image, ax=axis, pad=0.015, fraction=0.05)
        bar.set_label(f"spring-damper − bed [{unit}]")
        bar.outline.set_visible(False)
    return Plot(
        "gap",
        "Where the spring-damper departs",
        "Mean drag of the spring-damper minus the bed's on the way in, by depth and speed; in brackets as a share of "
        "the bed's. Orange: the spring-damper pushes back too hard; purple: too softly.",
        figure,
    )


def work_plot(run: RunFolder) -> Plot | None:
    """Work put in and got back, bed beside spring-damper, by speed."""
    driven = [r for r in run.of_kind("driven") if r.speed is not None and _number(r.quantities, "work_in") is not None]
    speeds = sorted({r.speed for r in driven if r.speed is not None})
    if not speeds:
        return None
    with styled():
        figure, axes = _panels(2, height=2.7, sharey=True)
        law = any(_number(r.quantities, "model_work_in") is not None for r in driven)
        sides = ((-0.2, "", BED), (0.2, "model_", MODEL)) if law else ((0.0, "", BED),)
        for axis, key, title in zip(
            axes, ("work_in", "work_out"), ("put in, way in", "got back, way out"), strict=True
        ):
            for shift, prefix, colour in sides:
                mean, spread = _by_speed(driven, speeds, prefix + key, 1e3)
                where = np.arange(len(speeds)) + shift
                axis.bar(where, mean, 0.36, color=colour, hatch="///" if prefix else "", edgecolor="white", lw=0.6)
                axis.errorbar(where, mean, spread, fmt="none", ecolor=INK, elinewidth=1.0, capsize=3)
                for x, y, s in zip(where, mean, np.nan_to_num(spread), strict=True):
                    if np.isfinite(y):
                        _above(axis, x, max(y, 0.0) + s, plain(y, 2 if abs(y) < 0.1 else 3))
            axis.set_title(f"Work {title}")
            axis.set_xticks(range(len(speeds)), [f"{s:.4g}" for s in speeds])
            axis.grid(False, axis="x")
            axis.set_xlim(-0.7, max(len(speeds), 2) - 0.3 if len(speeds) > 1 else 0.7)
            axis.margins(y=0.15)
            axis.axhline(0.0, color=GREY, lw=0.8)
        _label(axes, "speed [m/s]", "work [mJ]")
        _legend(figure, _pair(bars=True)[: 2 if law else 1])
    return Plot(
        "work",
        "Work in and out",
        "Work done on the ground on the way in, and got back from it on the way out; below zero, pulling out took "
        f"work as well.{_returned_words(driven)}{_spread_words(driven)}",
        figure,
    )


# ---- drops and rest ------------------------------------------------------------------------------------------------


def drops_plot(run: RunFolder) -> Plot | None:
    """Depth and force of each drop against time, one column per speed."""
    drops = [r for r in run.of_kind("drop") if r.bed is not None and r.speed is not None]
    speeds = sorted({r.speed for r in drops if r.speed is not None})
    if not speeds:
        return None
    with styled():
        figure = Figure(figsize=(_WIDTH, 4.6))
        FigureCanvasAgg(figure)
        axes = figure.subplots(2, len(speeds), sharex="col", sharey="row", squeeze=False)
        window = _nice(0.04 * max(_settled(r) for r in drops))
        free = False
        for column, speed in enumerate(speeds):
            above, below = axes[0, column], axes[1, column]
            here = [r for r in drops if r.speed == speed]
            end = max(_settled(r) for r in here)
            early = [r.bed.time[0] - _touch(r.bed) for r in here if r.bed is not None and _above_surface(r.bed)]
            begin = min(-0.03 * end, *(max(_first_touch(r.bed), -0.5 * end) for r in here)) if early else -0.03 * end
            for r in here:
                for series, colour, style in ((r.bed, BED, "-"), (r.model, MODEL, (0, (4, 2)))):
                    if series is None:
                        continue
                    start = _touch(series)
                    shown = (series.time - start <= end) & (series.time - start >= begin)
                    time = 1e3 * (series.time[shown] - start)
                    thin = len(here) > 1 and colour == BED
                    above.plot(time, 1e3 * series.depth[shown], color=colour, ls=style, lw=1.1 if thin else 1.8)
                    force = series.force
                    if colour == BED:
                        below.plot(time, force[shown], color=colour, lw=0.6, alpha=0.4)
                        force = _running_mean(series.time, force, window)
                    inside, width = time >= 0.0, 1.2 if thin else 1.8
                    below.plot(time[inside], force[shown][inside], color=colour, ls=style, lw=width)
                    below.plot(time[~inside], force[shown][~inside], color=colour, ls=style, lw=width, alpha=0.4)
                    peak = int(np.argmax(series.force))
                    below.plot(
                        1e3 * (series.time[peak] - start), series.force[peak], "o" if colour == BED else "D",
                        color=colour, ms=5, mec="white", mew=0.8, zorder=5,
                    )  # fmt: skip
            above.set_title(f"dropped at {_speed(speed)}")
            above.axhline(0.0, color=GREY, lw=0.8)
            if early:
                for axis in (above, below):
                    axis.axvline(0.0, color=GREY, lw=0.8, ls=(0, (2, 2)))
            free = free or bool(early)
            below.set_xlabel("time since touch-down [ms]")
        axes[0, 0].set_ylabel("depth of the tip [mm]")
        axes[1, 0].set_ylabel("force on the spike [N]")
        axes[0, 0].invert_yaxis()
        recorded = Line2D([], [], color=BED, lw=0.7, alpha=0.55, label="bed, as recorded")
        peaks = Line2D([], [], color=GREY, marker="o", ls="", ms=5, label="peak force, as recorded")
        bed, *model = _pair()[: 2 if _has_model(drops) else 1]
        _legend(figure, [bed, recorded, *model, peaks])
    each = ", a line for each bed" if len({(r.speed, r.seed) for r in drops}) > len(speeds) else ""
    return Plot(
        "drops",
        "Drops",
        f"Depth (downwards) and the ground's force against time since touch-down{each}. Of the bed's force the running "
        f"mean over {quote(window, 0.0, 's')} is drawn full, what was recorded faint; the peaks are those of what was "
        "recorded."
        + (" Left of 0, pale: grains that stick out of the surface, which the fit leaves out." if free else "")
        + (" The fit uses each drop up to its first stop; what follows is predicted." if _has_model(drops) else ""),
        figure,
    )


def drop_peaks_plot(run: RunFolder) -> Plot | None:
    """Peak force, greatest depth and time to stop of the drops against speed, bed beside spring-damper."""
    drops = [r for r in run.of_kind("drop") if r.speed is not None]
    speeds = sorted({r.speed for r in drops if r.speed is not None})
    columns = [
        (key, title, unit, scale)
        for key, title, unit, scale in (
            ("peak_force", "Peak force", "N", 1.0),
            ("max_depth", "Greatest depth", "mm", 1e3),
            ("stop_time", "Time to first stop", "ms", 1e3),
        )
        if any(_number(r.quantities, key) is not None for r in drops)
    ]
    if not columns:
        return None
    with styled():
        figure, axes = _panels(len(columns), height=2.6)
        for axis, (key, title, unit, scale) in zip(axes, columns, strict=True):
            for prefix, colour, style in (("", BED, "o-"), ("model_", MODEL, "D--")):
                mean, spread = _by_speed(drops, speeds, prefix + key, scale)
                axis.errorbar(speeds, mean, spread, fmt=style, color=colour, ms=5, mec="white", mew=0.8, capsize=3)
            axis.set_ylabel(unit_label(title, unit))
            axis.set_xlabel("speed at touch-down [m/s]")
            axis.set_ylim(0.0, 1.1 * axis.get_ylim()[1])
            axis.margins(x=0.12)
            if len(speeds) <= 5:
                axis.set_xticks(speeds, [f"{s:.4g}" for s in speeds])
        law = any(_number(r.quantities, "model_peak_force") is not None for r in drops)
        _legend(figure, _pair(markers=True)[: 2 if law else 1])
    names = [title[0].lower() + title[1:] for _, title, *_ in columns]
    listed = ", ".join(names[:-1]) + (" and " if len(names) > 1 else "") + names[-1]
    return Plot(
        "drop_peaks",
        "Peaks of the drops",
        f"{listed[0].upper()}{listed[1:]} of the drops by their speed at touch-down.{_spread_words(drops)}",
        figure,
    )


def set_down_plot(run: RunFolder) -> Plot | None:
    """Depth against time of the spike set down under its load, to rest."""
    sets = [r for r in run.of_kind("set_down") if r.bed is not None]
    if not sets:
        return None
    with styled():
        figure = Figure(figsize=(_WIDTH, 3.1))
        FigureCanvasAgg(figure)
        axis = figure.add_subplot()
        end, begin = 1.15 * max(_settled(r) + _touch(r.bed) for r in sets if r.bed is not None), 0.0
        dots = 0
        for r in sets:
            for series, colour, style in ((r.bed, BED, "-"), (r.model, MODEL, (0, (4, 2)))):
                if series is not None:
                    shown = (series.time <= end) & (series.time >= -0.1 * end)
                    axis.plot(1e3 * series.time[shown], 1e3 * series.depth[shown], color=colour, ls=style, lw=1.4)
                    begin = min(begin, float(series.time[shown].min(initial=0.0)))
            assert r.bed is not None
            if _number(r.quantities, "sinkage") is not None and r.bed.time[-1] <= end:
                dots += 1
                axis.plot(
                    1e3 * r.bed.time[-1], 1e3 * r.bed.depth[-1], "o", color=BED, ms=5, mec="white", mew=0.8, zorder=5
                )
        rests = []
        for key, what, colour in (("sinkage", "bed", BED), ("model_sinkage", "spring-damper", MODEL)):
            depths = [1e3 * n for r in sets if (n := _number(r.quantities, key)) is not None]
            if depths:
                spread = float(np.std(depths, ddof=1)) if len(depths) > 1 else None
                rests.append((float(np.mean(depths)), spread, what, colour))
        axis.invert_yaxis()
        low, high = sorted(axis.get_ylim())
        gap = 0.075 * (high - low)
        last = -np.inf
        for depth, spread, what, colour in sorted(rests, key=lambda rest: rest[0]):
            axis.axhline(depth, color=colour, lw=0.8, alpha=0.6)
            if spread:
                axis.axhspan(depth - spread, depth + spread, color=colour, alpha=0.12, lw=0)
            last = max(depth, last + gap)
            # one law: its beds differ in their start only
            known = None if what != "bed" and spread is not None and spread < 0.005 else spread
            number = quote(1e-3 * depth, None if known is None else 1e-3 * known, "m", significant=2)
            axis.text(1.01, last, f"{what}: {number}", color=colour, va="center", transform=axis.get_yaxis_transform())
        axis.set_xlim(1e3 * begin, 1e3 * end)
        axis.axhline(0.0, color=GREY, lw=0.8)
        axis.set_xlabel("time since the spike was let go [ms]")
        axis.set_ylabel("depth of the tip [mm]")
        _legend(
            figure,
            [
                *_pair()[: 2 if _has_model(sets) else 1],
                *([_dot("at rest")] if dots else []),
            ],
        )
    still = sum(_number(r.quantities, "sinkage") is not None for r in sets)
    many = len(sets) > 1
    said = f"Sinking under the load, {len(sets)} bed{'s' if many else ''}."
    if still < len(sets):
        said += f" {still or 'None'} of them came to rest in the time that was followed." if many else (
            " It did not come to rest in the time that was followed."
        )  # fmt: skip
    if rests:
        said += f" Right: the depth at rest{', ± the standard deviation between beds' if still > 1 else ''}."
    if _has_model(sets):
        fitted = "all beds" if many else "this bed's drives and drops"
        said += f" The spring-damper is the one fitted to {fitted}; where it rests is predicted, not fitted."
    departures = run.result.get("departures")
    if isinstance(departures, dict) and isinstance(departures.get("set_down"), str):
        said += f" {departures['set_down']}"
    return Plot(
        "set_down",
        "Set down under its load",
        said,
        figure,
    )


def spread_plot(run: RunFolder) -> Plot | None:
    """K and C fitted to each seed of the bed, with their mean and spread."""
    fits = [f for f in run.result.get("fits") or [] if isinstance(f, dict)]
    panels = [
        (key, title, unit)
        for key, title, unit in (("stiffness", "Stiffness K", "N/m"), ("damping", "Damping C", "N s/m"))
        if any(_number(f, key) is not None for f in fits)
    ]
    if not panels or len(fits) < 2:
        return None
    with styled():
        figure, axes = _panels(len(panels), height=2.5)
        for axis, (key, title, unit) in zip(axes, panels, strict=True):
            rows = [
                (f.get("seed", i + 1), n, _error(f, key))
                for i, f in enumerate(fits)
                if (n := _number(f, key)) is not None
            ]
            values = np.array([value for _, value, _ in rows])
            mean, spread = float(values.mean()), float(values.std(ddof=1)) if len(values) > 1 else None
            axis.axhline(mean, color=INK, lw=1.0)
            if spread:
                axis.axhspan(mean - spread, mean + spread, color=MODEL, alpha=0.15, lw=0)
            axis.errorbar(
                range(len(rows)),
                values,
                [np.nan if error is None else error for *_, error in rows],
                fmt="o",
                color=MODEL,
                ms=7,
                mec="white",
                capsize=3,
            )
            axis.set_xticks(range(len(rows)), [str(seed) for seed, *_ in rows])
            axis.set_xlim(-0.6, len(rows) - 0.4)
            axis.set_title(title)
            axis.set_xlabel("seed of the bed")
            axis.set_ylabel(f"{title.split()[1]} [{unit}]")
            reach = max(2.2 * (spread or 0.0), 0.1 * abs(mean), 1e-12)
            axis.set_ylim(min(mean - reach, *axis.get_ylim()), max(mean + reach, *axis.get_ylim()))
            axis.grid(False, axis="x")
    known = any(_error(f, key) is not None for f in fits for key in ("stiffness", "damping"))
    bars = "; bars: standard error of the fit" if known else "; how well each fit is determined is not known"
    return Plot(
        "spread",
        "Spread between beds",
        f"The spring-damper fitted to each bed by itself, on the runs that every bed has{bars}. Line and band: mean "
        "and standard deviation between beds. The axes do not start at zero.",
        figure,
    )


#: What is drawn, in the report's order: name in words -> function.
PLOTS: dict[str, Callable[[RunFolder], Plot | None]] = {
    "Drag against depth": drag_plot,
    "Where the spring-damper departs": gap_plot,
    "Set down under its load": set_down_plot,
    "Drops": drops_plot,
    "Peaks of the drops": drop_peaks_plot,
    "Work in and out": work_plot,
    "Spread between beds": spread_plot,
}


# ---- parts ---------------------------------------------------------------------------------------------------------


def unit_label(title: str, unit: str) -> str:
    """The label of an axis: quantity and unit."""
    return f"{title[0].lower()}{title[1:]} [{unit}]"


def _panels(count: int, *, height: float, sharex: bool = False, sharey: bool = False) -> tuple[Figure, list[Axes]]:
    rows = 1 if count <= 4 else -(-count // 4)
    columns = -(-count // rows)
    figure = Figure(figsize=(_WIDTH, height * rows + 0.3))
    FigureCanvasAgg(figure)
    axes = list(figure.subplots(rows, columns, squeeze=False, sharex=sharex, sharey=sharey).ravel())
    for spare in axes[count:]:
        spare.set_visible(False)
    return figure, axes[:count]


def _label(axes: list[Axes], x: str, y: str) -> None:
    for axis in axes:
        place = axis.get_subplotspec()
        axis.set_xlabel(x)
        if place is None or place.is_first_col():
            axis.set_ylabel(y)


def _legend(figure: Figure, handles: list[Any]) -> None:
    figure.legend(handles=handles, loc="outside upper center", ncols=len(handles), handlelength=2.6)


def _pair(*, markers: bool = False, bars: bool = False) -> list[Any]:
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


def _band(axis: Axes, parts: Iterable[Series | None], colour: str, *, alpha: float, solid: bool) -> None:
    there = [part for part in parts if part is not None and len(part) > 1]
    if not there:
        return
    grid, mean, spread = _mean_by_depth(there)
    if len(there) > 1:
        for part in there:
            axis.plot(1e3 * part.depth, part.force, color=colour, lw=0.6, alpha=0.45 * alpha)
        axis.fill_between(1e3 * grid, mean - spread, mean + spread, color=colour, alpha=0.2 * alpha, lw=0)
    else:
        axis.plot(1e3 * there[0].depth, there[0].force, color=colour, lw=0.7, alpha=0.55 * alpha)
    axis.plot(1e3 * grid, mean, color=colour, alpha=alpha, lw=2.2 if solid else 1.8)


def _way(series: Series | None, way: str) -> Series | None:
    """The rows on the way in or out, in the ground."""
    if series is None:
        return None
    part = series.part(way)
    keep = part.depth >= 0.0
    return Series(part.time[keep], part.depth[keep], part.velocity[keep], part.force[keep], part.phase[keep])


def _above_surface(series: Series | None) -> Series | None:
    """The way in before depth 0 from where grains are first felt; None where none are."""
    if series is None:
        return None
    touched = np.flatnonzero((series.depth < 0.0) & (series.force > 0.0) & (series.velocity > 0.0))
    if not len(touched):
        return None
    keep = (series.depth < 0.0) & (series.velocity > 0.0)
    keep[: touched[0]] = False
    return Series(series.time[keep], series.depth[keep], series.velocity[keep], series.force[keep], series.phase[keep])


def _first_touch(series: Series | None) -> float:
    """Time from the first grain felt to depth 0 [s], below 0; 0 where no grain sticks out."""
    part = _above_surface(series)
    return 0.0 if part is None or series is None else float(part.time[0]) - _touch(series)


def _has_model(runs: Iterable[Run]) -> bool:
    return any(r.model is not None for r in runs)


def _mean_by_depth(
    parts: Iterable[Series | None], bins: int = 40
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Depth [m], mean force [N] and its standard deviation between the parts [N], shape (bins,).

    Each part is averaged within a bin first, so that noise within one bed is not taken for spread between beds.
    """
    there = [part for part in parts if part is not None and len(part) > 1]
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
    spread = np.nanstd(rows, axis=0, ddof=0) * np.sqrt(_bessel(np.isfinite(rows).sum(axis=0)))
    return (0.5 * (edges[1:] + edges[:-1]))[filled], np.nanmean(rows, axis=0), spread


def _bins(parts: list[Series], most: int = 40) -> int:
    return int(np.clip(min(len(part) for part in parts) // 3, 4, most))


def _bessel(count: NDArray[np.int64]) -> NDArray[np.float64]:
    return np.where(count > 1, count / np.maximum(count - 1, 1), 0.0)


def _gap_table(run: RunFolder) -> list[dict[str, float]]:
    """The table of departures as written, or else made from the driven series."""
    names = ("speed", "depth_from", "depth_to", "bed_force", "model_force")
    departures = run.result.get("departures")
    given = departures.get("table") if isinstance(departures, dict) else None
    rows = []
    for row in given or []:
        if isinstance(row, dict) and all(isinstance(row.get(name), int | float) for name in names):
            rows.append({name: float(row[name]) for name in names})
    if rows:
        return rows
    for speed in run.speeds("driven"):
        here = [r for r in run.of_kind("driven") if r.speed == speed and r.bed is not None and r.model is not None]
        beds, models = [_way(r.bed, "in") for r in here], [_way(r.model, "in") for r in here]
        if not here:
            continue
        grid, bed, _ = _mean_by_depth(beds, bins=5)
        grid2, model, _ = _mean_by_depth(models, bins=5)
        if len(grid) == len(grid2) > 1:
            half = 0.5 * (grid[1] - grid[0])
            rows += [
                dict(zip(names, (speed, d - half, d + half, b, m), strict=True))
                for d, b, m in zip(grid.tolist(), bed.tolist(), model.tolist(), strict=True)
            ]
    return rows


def _by_speed(
    runs: list[Run], speeds: list[float], key: str, scale: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Mean and standard deviation between seeds of a quantity at each speed; NaN where unknown."""
    mean, spread = np.full(len(speeds), np.nan), np.full(len(speeds), np.nan)
    for i, speed in enumerate(speeds):
        numbers = [n for r in runs if r.speed == speed and (n := _number(r.quantities, key)) is not None]
        if numbers:
            mean[i] = scale * float(np.mean(numbers))
        if len(numbers) > 1:
            spread[i] = scale * float(np.std(numbers, ddof=1))
    return mean, spread


def _number(quantities: Any, key: str) -> float | None:
    entry = quantities.get(key) if isinstance(quantities, dict) else None
    number = entry.get("value") if isinstance(entry, dict) else entry
    return float(number) if isinstance(number, int | float) and np.isfinite(number) else None


def _error(fit: dict[str, Any], key: str) -> float | None:
    """Standard error of a bed's own fit; None where unknown."""
    entry = fit.get(key)
    number = entry.get("std") if isinstance(entry, dict) else fit.get(f"{key}_error", fit.get(f"{key}_std"))
    return float(number) if isinstance(number, int | float) and np.isfinite(number) else None


def _touch(series: Series) -> float:
    inside = np.flatnonzero(series.depth >= 0.0)
    return float(series.time[inside[0]] if len(inside) else series.time[0])


def _settled(run: Run) -> float:
    """Time [s] since touch-down after which nothing moves any more, of bed and spring-damper, with a margin."""
    last = 0.0
    for series in (run.bed, run.model):
        if series is not None:
            travel = max(float(np.ptp(series.depth)), 1e-12)
            moving = np.flatnonzero(np.abs(series.depth - series.depth[-1]) > 0.03 * travel)
            end = series.time[min(moving[-1] + 1, len(series) - 1)] if len(moving) else series.time[-1]
            last = max(last, float(end) - _touch(series))
    return 1.25 * last if last > 0.0 else 1.0


def _running_mean(time: NDArray[np.float64], force: NDArray[np.float64], window: float) -> NDArray[np.float64]:
    """Mean of the force over `window` [s] around each time, over what there is of it at the ends."""
    if len(time) < 2:
        return force
    impulse = np.concatenate([[0.0], np.cumsum(0.5 * (force[1:] + force[:-1]) * np.diff(time))])
    reach = np.minimum(0.5 * window, np.minimum(time - time[0], time[-1] - time))  # stays centred at the ends
    low, high = time - reach, time + reach
    mean = (np.interp(high, time, impulse) - np.interp(low, time, impulse)) / np.maximum(high - low, 1e-300)
    return np.where(high > low, mean, force)


def _nice(number: float) -> float:
    """The next 1, 2 or 5 times a power of ten not above `number`."""
    power = 10.0 ** np.floor(np.log10(number))
    return float(next(n * power for n in (5.0, 2.0, 1.0) if n * power <= 1.0001 * number))


def _bin_width(parts: Iterable[Series | None]) -> str:
    """The slices of depth that `_mean_by_depth` averages over, in words; "" where they differ between speeds."""
    there = [part for part in parts if part is not None and len(part) > 1]
    widths = {quote(float(part.depth.max()) / _bins([part]), None, "m", significant=2) for part in there}
    return widths.pop() if len(widths) == 1 else ""


def _dot(label: str) -> Line2D:
    return Line2D([], [], color=BED, marker="o", ls="", ms=5, label=label)


def _above(axis: Axes, x: float, y: float, text: str) -> None:
    axis.annotate(text, (x, y), xytext=(0, 3), textcoords="offset points", ha="center", fontsize=7.5, color=INK)


def _speed(speed: float) -> str:
    return f"{speed:.3g} m/s"


def _signed(number: float, significant: int = 3) -> str:
    return ("+" if number > 0 else "") + plain(number, significant)


def _returned_words(runs: list[Run]) -> str:
    """What share of the work put in was got back, of bed and spring-damper: the mean over these runs."""
    shares = []
    for prefix, what in (("", "the bed"), ("model_", "the spring-damper")):
        works = [
            out / put
            for r in runs
            if (put := _number(r.quantities, f"{prefix}work_in") or 0.0) > 0.0
            and (out := _number(r.quantities, f"{prefix}work_out")) is not None
        ]
        if works:
            shares.append(f"{what} {quote(float(np.mean(works)), None, '%', significant=2)}")
    return f" Got back over put in, mean of the driven runs: {', '.join(shares)}." if shares else ""


def _spread_words(runs: list[Run]) -> str:
    speeds = [r.speed for r in runs]
    return " Bars: standard deviation between beds, where there are several." if len(set(speeds)) < len(speeds) else ""
