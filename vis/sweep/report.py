"""Plots and report of `hedgebed sweep`: reads result.json and table.csv of its folder."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from textwrap import fill
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rigid.series import read_series
from vis.page.numbers import scale_of, typeset
from vis.page.page import Block, Section, Tile, text
from vis.page.plots import BED, GREY, MODEL, handle, legend_above, new_panels, shades
from vis.page.report import Report, Result, again, capital, report_of, tables
from vis.page.sentences import label_of

__all__ = ["answer_tiles", "on_axis", "write_sweep_report"]

MOST_DRAWN = 8
"""Quantities that have a figure."""
_WIDTH = 40  # letters of a line of a label
_LEAST_SPAN = 3.0  # from which logarithmic axes serve [1]
_MOST_COLOURS = 6  # values that are told apart by colour


@report_of()
def write_sweep_report(report: Report) -> Path:
    """Make figures/ and report.html of the folder of a sweep, and return the report."""
    result = report.result
    table = read_series(report.folder / "table.csv")
    report.about = "; ".join(filter(None, (typeset(result.get("each", "")), str(result["title"]))))
    drawn = result["columns"][:MOST_DRAWN]
    figures = [_over(report, table, column) for column in drawn]
    if len(result["columns"]) > len(drawn):
        figures.append(text(f"Figures show the first {len(drawn)} of {len(result['columns'])} that vary.", small=True))
    listed = text("table.csv has every run; table.nc the same for xarray. Each run's folder is under members/.")
    sections = [
        *([Section("", [_sensitivities(report, result["sensitivities"])])] if result["sensitivities"] else []),
        Section("Results", figures),
        Section("Numbers", [*tables(result), listed]),
        again("hedgebed sweep run.toml"),
    ]
    return report.write(sections, lead=[f"sweep of {result['of']}"], tiles=answer_tiles(result))


def answer_tiles(result: Result) -> list[Tile]:
    """How many runs there are, and how many failed."""
    return [Tile(name.capitalize(), f"{result['quantities'][name]['value']}") for name in ("runs", "failed")]


def _over(report: Report, table: Mapping[str, NDArray], entry: Result) -> Block:
    """One quantity over each factor, coloured by the factor of fewest values."""
    factors, (values, label) = report.result["factors"], on_axis(table[entry["head"]], entry, entry["name"])
    bars = _bars(table, entry, values)
    counts = {factor["key"]: len(np.unique(table[factor["key"]])) for factor in factors}
    by = min(counts, key=lambda key: counts[key]) if len(factors) > 1 else ""
    if by and counts[by] > _MOST_COLOURS:
        by = ""
    groups = list(dict.fromkeys(table[by].tolist())) if by else [None]
    colours = shades(len(groups)) if by else [BED]
    drawing, axes = new_panels(len(factors), height=2.8, sharey=True)
    for axis, factor in zip(axes, factors, strict=True):
        x, under = on_axis(table[factor["key"]], factor, factor["key"])
        for group, colour in zip(groups, colours, strict=True):
            own = np.ones(len(x), bool) if group is None else table[by] == group
            axis.errorbar(
                x[own], values[own], yerr=None if bars is None else bars[:, own], color=colour, marker="o", ms=4, ls="",
            )  # fmt: skip
        axis.set_xlabel(fill(under, _WIDTH))
        if _wide(x) and _wide(values) and (bars is None or _wide(values - bars[0])):
            _logarithmic(axis)
        if x.dtype.kind not in "fiu":
            axis.tick_params(axis="x", labelrotation=30)
    axes[0].set_ylabel(fill(label, _WIDTH))
    varied: Result = next((factor for factor in factors if factor["key"] == by), {})
    if by:
        shown, under = on_axis(np.array(groups), varied, by)
        marks = [handle(f"{under}: {_plain(one)}", colour, marker="o", ls="")
                 for one, colour in zip(shown.tolist(), colours, strict=True)]  # fmt: skip
        legend_above(drawing, marks)
    name, key = capital(_words(entry, entry["name"])), "over" if by else "over_plain"
    said = "" if bars is None else " Bars: 95 % intervals of the runs, where they know them."
    return report.draw(
        key, drawing, name=f"over-{entry['name']}", quantity=name, colour=_words(varied, by) if by else "", bars=said
    )


def _bars(table: Mapping[str, NDArray], entry: Result, values: NDArray) -> NDArray | None:
    """Lengths of the bars of 95 % intervals in the unit of the axis, shape [2, runs], 0 where a run has none."""
    heads = entry.get("ends", [])
    if not heads or any(head not in table for head in heads):
        return None
    scale, _ = scale_of(table[entry["head"]].tolist(), str(entry["unit"] or "1"))
    low, high = (table[head] / scale for head in heads)
    return np.maximum(np.nan_to_num(np.array([values - low, high - values])), 0.0)


def _wide(values: NDArray) -> bool:
    """Whether numbers are above 0 and their largest is at least `_LEAST_SPAN` times the least."""
    there = values[np.isfinite(values)] if values.dtype.kind in "fiu" else np.array([])
    return bool(there.size and there.min() > 0 and there.max() >= _LEAST_SPAN * there.min())


def _logarithmic(axis: Any) -> None:
    """Both axes logarithmic: a power law is a straight line. Ticks are plain numbers."""
    from matplotlib.ticker import LogFormatter

    axis.set(xscale="log", yscale="log")
    for one in (axis.xaxis, axis.yaxis):
        one.set_major_formatter(LogFormatter())
        one.set_minor_formatter(LogFormatter(minor_thresholds=(2, 0.5)))


def _words(entry: Result, name: str) -> str:
    """How tables call a quantity or a setting; an older folder has only its `name`."""
    return str(entry.get("words") or label_of(name))


def on_axis(values: NDArray, entry: Result, name: str) -> tuple[NDArray, str]:
    """Numbers of a quantity or a setting in the unit of other reports (mm, degrees), and their label with that unit."""
    shown = ""
    if values.dtype.kind in "fiu":
        scale, shown = scale_of(values.tolist(), str(entry["unit"] or "1"))
        values = values / scale if scale != 1.0 else values
    return values, f"{_words(entry, name)}{f' [{typeset(shown)}]' if shown else ''}"


def _plain(value: Any) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def _sensitivities(report: Report, entries: list[Result]) -> Block:
    """First order and total of each setting, a panel for each quantity."""
    names = list(dict.fromkeys(entry["quantity"] for entry in entries))[:MOST_DRAWN]
    drawing, axes = new_panels(len(names), height=2.4, sharey=True)
    for axis, name in zip(axes, names, strict=True):
        own = [entry for entry in entries if entry["quantity"] == name]
        places = np.arange(len(own))
        for kind, colour, shift in (("first", BED, -0.15), ("total", MODEL, 0.15)):
            known = [(place, entry) for place, entry in zip(places, own, strict=True) if entry[kind] is not None]
            if known:
                axis.errorbar(
                    [place + shift for place, _ in known], [entry[kind] for _, entry in known],
                    yerr=[entry[f"{kind}_conf"] for _, entry in known], color=colour, marker="o", ms=5, ls="",
                )  # fmt: skip
        axis.axhline(0.0, color=GREY, lw=0.8)
        words = {factor["key"]: _words(factor, factor["key"]) for factor in report.result["factors"]}
        under = [fill(words.get(entry["key"], label_of(entry["key"])), _WIDTH // 2) for entry in own]
        axis.set_xticks(places, under, rotation=30)
        axis.set(title=fill(label_of(name), _WIDTH), xlim=(-0.6, len(own) - 0.4))
    axes[0].set_ylabel("share of the variance [1]")
    marks = [handle("first order", BED, marker="o", ls=""), handle("total", MODEL, marker="o", ls="")]
    legend_above(drawing, marks if any(entry["total"] is not None for entry in entries) else marks[:1])
    return report.draw("sensitivities", drawing)
