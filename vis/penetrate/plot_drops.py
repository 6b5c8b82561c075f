"""Plots of drops and of a spike set down under its load, and of the spread between beds."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from rigid.intervals import half_width
from vis.page.folder import Run, RunFolder, Series
from vis.page.numbers import quote
from vis.page.plots import BED, DASHED, GREY, INK, MODEL, Array, handle, legend_above, new_panels, nice_below, sheet
from vis.page.report import capital
from vis.page.sentences import Sentences
from vis.penetrate.errors import half_of_fit, in_95
from vis.penetrate.plot_drag import (
    OVER_BEDS,
    RECORDED,
    Plot,
    above_surface,
    band_handle,
    bar_handle,
    by_speed,
    has_model,
    pair_of_handles,
    spread_words,
)
from vis.penetrate.summary_parts import joined, std_of, value_of

__all__ = ["drop_peaks_plot", "drops_plot", "set_down_plot", "spread_plot"]

say = Sentences(__package__)


def drops_plot(run: RunFolder) -> Plot | None:
    """Depth and force of each drop against time, one column per speed."""
    drops = [r for r in run.of_kind("drop") if r.bed is not None and r.speed is not None]
    speeds = sorted({r.speed for r in drops if r.speed is not None})
    if not speeds:
        return None
    figure, axes = sheet(2, len(speeds), 4.6, sharex="col", sharey="row")
    window = nice_below(0.04 * max(_settled(r) for r in drops))
    free = False
    for column, speed in enumerate(speeds):
        above, below = axes[0, column], axes[1, column]
        here = [r for r in drops if r.speed == speed]
        end = max(_settled(r) for r in here)
        early = [r.bed.time[0] - _touch(r.bed) for r in here if r.bed is not None and above_surface(r.bed)]
        begin = min(-0.03 * end, *(max(_first_touch(r.bed), -0.5 * end) for r in here)) if early else -0.03 * end
        # One law: dashes of several runs, which differ in where they start only, look like a full line.
        law = next((r for r in here if r.model is not None), None)
        for r in here:
            for series, colour, style in ((r.bed, BED, "-"), (r.model if r is law else None, MODEL, DASHED)):
                if series is None:
                    continue
                start = _touch(series)
                shown = (series.time - start <= end) & (series.time - start >= begin)
                time = 1e3 * (series.time[shown] - start)
                thin = len(here) > 1 and colour == BED
                above.plot(time, 1e3 * series.depth[shown], color=colour, ls=style, lw=1.1 if thin else 1.8)
                force = series.force
                if colour == BED:
                    below.plot(time, force[shown], **RECORDED)
                    force = _running_mean(series.time, force, window)
                inside, width = time >= 0.0, 1.2 if thin else 1.8
                below.plot(time[inside], force[shown][inside], color=colour, ls=style, lw=width)
                below.plot(time[~inside], force[shown][~inside], color=colour, ls=style, lw=width, alpha=0.4)
                peak = int(np.argmax(series.force))
                below.plot(
                    1e3 * (series.time[peak] - start), series.force[peak], "o" if colour == BED else "D",
                    color=colour, ms=5, mec="white", mew=0.8, zorder=5,
                )  # fmt: skip
        above.set_title(f"dropped at {speed:.3g} m/s")
        above.axhline(0.0, color=GREY, lw=0.8)
        if early:
            for axis in (above, below):
                axis.axvline(0.0, color=GREY, lw=0.8, ls=(0, (2, 2)))
        free = free or bool(early)
        below.set_xlabel("time since touch-down [ms]")
    axes[0, 0].set_ylabel("depth of the tip [mm]")
    axes[1, 0].set_ylabel("force of the ground [N]")
    axes[0, 0].invert_yaxis()
    recorded = handle("bed, as recorded", **RECORDED)
    peaks = handle("peak force, as recorded", GREY, marker="o", ls="", ms=5)
    bed, *model = pair_of_handles()[: 2 if has_model(drops) else 1]
    legend_above(figure, [bed, recorded, *model, peaks])
    each = ", a line for each bed" if len({(r.speed, r.seed) for r in drops}) > len(speeds) else ""
    left, later = say("drops_left") if free else "", say("drops_later") if has_model(drops) else ""
    return Plot.of("drops", figure, each=each, window=quote(window, 0.0, "s"), left=left, later=later)


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
        if any(value_of(r.quantities, key) is not None for r in drops)
    ]
    if not columns:
        return None
    figure, axes = new_panels(len(columns), height=2.6)
    bars = False
    for axis, (key, title, unit, scale) in zip(axes, columns, strict=True):
        for prefix, colour, style in (("", BED, "o-"), ("model_", MODEL, "D--")):
            mean, half = by_speed(drops, speeds, prefix + key, scale)
            half = np.full_like(half, np.nan) if prefix else half  # one law: its runs differ in where they start only
            bars = bars or bool(np.isfinite(half).any())
            axis.errorbar(speeds, mean, half, fmt=style, color=colour, ms=5, mec="white", mew=0.8, capsize=3)
        label, top = f"{title[0].lower()}{title[1:]} [{unit}]", 1.1 * axis.get_ylim()[1]
        axis.set(ylabel=label, xlabel="speed at touch-down [m/s]", ylim=(0.0, top))
        axis.margins(x=0.12)
        if len(speeds) <= 5:
            axis.set_xticks(speeds, [f"{s:.4g}" for s in speeds])
    law = any(value_of(r.quantities, "model_peak_force") is not None for r in drops)
    legend_above(figure, [*pair_of_handles(markers=True)[: 2 if law else 1], *([bar_handle()] if bars else [])])
    listed = joined([title[0].lower() + title[1:] for _, title, *_ in columns])
    return Plot.of("drop_peaks", figure, listed=capital(listed), spread=spread_words(drops))


def set_down_plot(run: RunFolder) -> Plot | None:
    """Depth against time of the spike set down under its load, to rest."""
    sets = [r for r in run.of_kind("set_down") if r.bed is not None]
    if not sets:
        return None
    figure, ((axis,),) = sheet(1, 1, 3.1)
    # A set-down ends where it is at rest: its whole series is shown, and of the law what fits beside it.
    end = 1.04 * max(float(r.bed.time[-1]) for r in sets if r.bed is not None)
    dots: list[Line2D] = []
    for i, r in enumerate(sets):
        # One law: its runs differ in where they start only, and dashes that overlap look like a full line.
        model = None if any(s.model is not None for s in sets[:i]) else r.model
        for series, colour, style in ((r.bed, BED, "-"), (model, MODEL, DASHED)):
            if series is not None:
                shown = (series.time <= end) & (series.time >= 0.0)  # before, both are lowered
                axis.plot(1e3 * series.time[shown], 1e3 * series.depth[shown], color=colour, ls=style, lw=1.4)
        assert r.bed is not None
        if value_of(r.quantities, "sinkage") is not None:
            dots = [handle("at rest", BED, marker="o", ls="", ms=5)]
            end_of = 1e3 * r.bed.time[-1], 1e3 * r.bed.depth[-1]
            axis.plot(*end_of, "o", color=BED, ms=5, mec="white", mew=0.8, zorder=5)
    axis.invert_yaxis()
    rests = _rests(run, sets)
    _draw_rests(axis, rests)
    axis.set_xlim(0.0, 1e3 * end)
    axis.axhline(0.0, color=GREY, lw=0.8)
    axis.set(xlabel="time since the release [ms]", ylabel="depth of the tip [mm]")
    sure = any(half for _, half, *_ in rests)
    bars = [bar_handle(f"bar and ±: {OVER_BEDS}")] if sure else []
    legend_above(figure, [*pair_of_handles()[: 2 if has_model(sets) else 1], *dots, *bars])
    still = sum(value_of(r.quantities, "sinkage") is not None for r in sets)
    many = len(sets) > 1
    caption = f"Sinking under the load, {len(sets)} bed{'s' if many else ''}."
    if still < len(sets):
        caption += (
            f" {still or 'None'} of them came to rest in the time that was followed."
            if many
            else (" It did not come to rest in the time that was followed.")
        )
    if rests:
        caption += " Right: the depth at rest."
    if sure:
        caption += f" ±: half of the {OVER_BEDS}; a bar with an arrow is longer than shown."
    if has_model(sets):
        fitted = "all beds" if many else "this bed's drives and drops"
        caption += f" The spring-damper is the one fitted to {fitted}; where it rests is predicted, not fitted."
    departures = run.result.get("departures")
    if isinstance(departures, dict) and isinstance(departures.get("set_down"), str):
        caption += f" {departures['set_down']}"
    return Plot("set_down", "Set down under its load", caption, figure)


_Rest = tuple[float, float | None, str, str]
"""Depth at rest and half of its 95 % interval [mm], of what, its colour."""


def _rests(run: RunFolder, sets: list[Run]) -> list[_Rest]:
    """Where bed and law rest, the means over beds."""
    found: list[_Rest] = []
    for key, what, colour in (("sinkage", "bed", BED), ("model_sinkage", "spring-damper", MODEL)):
        depths = [1e3 * n for r in sets if (n := value_of(r.quantities, key)) is not None]
        if depths:
            half = half_width(float(np.std(depths, ddof=1)), len(depths)) if len(depths) > 1 else None
            if what != "bed":  # one law here; between beds it is the fits that differ
                std = std_of(in_95(run.result), "sinkage_spring_damper")
                half = 1e3 * std if std else None
            found.append((float(np.mean(depths)), half, what, colour))
    return found


def _draw_rests(axis: Axes, rests: list[_Rest]) -> None:
    """A line for each, its number beside it, and its interval a bar at the right edge, within the picture."""
    for depth, _, _, colour in rests:
        axis.axhline(depth, color=colour, lw=0.8, alpha=0.6)
    ends = axis.get_ylim()
    low, high = sorted(ends)
    gap, last, place = 0.075 * (high - low), -np.inf, axis.get_yaxis_transform()
    for number, (depth, half, what, colour) in enumerate(sorted(rests, key=lambda rest: rest[0])):
        last = max(depth, last + gap)
        words = quote(1e-3 * depth, None if half is None else 1e-3 * half, "m", significant=2)
        axis.text(1.01, last, f"{what}: {words}", color=colour, va="center", transform=place)
        if half:
            x = 0.992 - 0.012 * number
            span = [max(depth - half, low), min(depth + half, high)]
            axis.plot([x, x], span, color=colour, lw=2.0, transform=place, solid_capstyle="butt")
            caps = [end for end in (depth - half, depth + half) if low <= end <= high]
            axis.plot([x] * len(caps), caps, "_", color=colour, ms=8, mew=1.5, transform=place)
            for end, beyond, mark in ((low, depth - half < low, "^"), (high, depth + half > high, "v")):
                if beyond:  # depth grows downwards
                    axis.plot(x, end, mark, color=colour, ms=7, transform=place, clip_on=False)
    axis.set_ylim(ends)


def spread_plot(run: RunFolder) -> Plot | None:
    """K and C fitted to each seed of the bed, their spread, and what is fitted to all of them."""
    fits = [f for f in run.result.get("fits") or [] if isinstance(f, dict)]
    panels = [
        (key, title, unit)
        for key, title, unit in (("stiffness", "Stiffness K", "N/m"), ("damping", "Damping C", "N s/m"))
        if any(value_of(f, key) is not None for f in fits)
    ]
    if not panels or len(fits) < 2 or not all(f.get("separates", True) for f in fits):
        return None
    figure, axes = new_panels(len(panels), height=2.5)
    known = banded = False
    for axis, (key, title, unit) in zip(axes, panels, strict=True):
        rows = [
            (f.get("seed", i + 1), n, half_of_fit(run.result, f, key))
            for i, f in enumerate(fits)
            if (n := value_of(f, key)) is not None
        ]
        values = np.array([value for _, value, _ in rows])
        spread = float(values.std(ddof=1)) if len(values) > 1 else None
        pooled = value_of(run.result.get("quantities"), key)
        mean = float(values.mean())
        together = mean if pooled is None else pooled
        axis.axhline(together, color=INK, lw=1.0)
        if spread:
            axis.axhspan(mean - spread, mean + spread, color=MODEL, alpha=0.15, lw=0)
        errors = [np.nan if error is None else error for *_, error in rows]
        known = known or any(error is not None for *_, error in rows)
        banded = banded or bool(spread)
        axis.errorbar(range(len(rows)), values, errors, fmt="o", color=MODEL, ms=7, mec="white", capsize=3)
        axis.set_xticks(range(len(rows)), [str(seed) for seed, *_ in rows])
        axis.set(xlim=(-0.6, len(rows) - 0.4), xlabel="seed of the bed")
        axis.set(title=title, ylabel=f"{title.split()[1]} [{unit}]")
        reach = max(2.2 * (spread or 0.0), 0.1 * abs(mean), 1e-12)
        axis.set_ylim(
            min(mean - reach, together - 0.2 * reach, *axis.get_ylim()),
            max(mean + reach, together + 0.2 * reach, *axis.get_ylim()),
        )
        axis.grid(False, axis="x")
    handles: list[Any] = [
        handle("fit to one bed", MODEL, marker="o", ls="", ms=6),
        handle("fit to all runs of all beds", INK, lw=1.0),
    ]
    handles += [band_handle("band: one standard deviation between beds", MODEL, 0.15)] if banded else []
    legend_above(figure, [*handles, *([bar_handle("95 % interval of the fit")] if known else [])])
    bars = "; bars: 95 % interval of the fit" if known else "; how well each fit is determined is not known"
    return Plot.of("spread", figure, bars=bars)


def _first_touch(series: Series | None) -> float:
    """Time from the first grain felt to depth 0 [s], below 0; 0 where no grain sticks out."""
    part = above_surface(series)
    return 0.0 if part is None or series is None else float(part.time[0]) - _touch(series)


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


def _running_mean(time: Array, force: Array, window: float) -> Array:
    """Mean of the force over `window` [s] around each time, over what there is of it at the ends."""
    if len(time) < 2:
        return force
    impulse = np.concatenate([[0.0], np.cumsum(0.5 * (force[1:] + force[:-1]) * np.diff(time))])
    reach = np.minimum(0.5 * window, np.minimum(time - time[0], time[-1] - time))  # stays centred at the ends
    low, high = time - reach, time + reach
    mean = (np.interp(high, time, impulse) - np.interp(low, time, impulse)) / np.maximum(high - low, 1e-300)
    return np.where(high > low, mean, force)
