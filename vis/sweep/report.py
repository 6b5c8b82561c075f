"""Plots and report of `hedgebed sweep`: reads result.json and table.csv of its folder."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rigid.series import read_series
from vis.page.numbers import typeset
from vis.page.page import Block, Section, Tile, text
from vis.page.plots import BED, GREY, MODEL, handle, legend_above, new_panels, shades
from vis.page.report import Report, Result, again, report_of, tables, unit_text

__all__ = ["answer_tiles", "write_sweep_report"]

MOST_DRAWN = 8
"""Quantities that have a figure."""
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


def _over(report: Report, table: Mapping[str, NDArray], column: Result) -> Block:
    """One quantity over each factor, coloured by the factor of fewest values."""
    factors, values, unit = report.result["factors"], table[column["head"]], unit_text(column["unit"])
    if column["unit"] == "rad":
        values, unit = np.degrees(values), "degrees"
    counts = {factor["key"]: len(np.unique(table[factor["key"]])) for factor in factors}
    by = min(counts, key=lambda key: counts[key]) if len(factors) > 1 else ""
    if by and counts[by] > _MOST_COLOURS:
        by = ""
    groups = list(dict.fromkeys(table[by].tolist())) if by else [None]
    colours = shades(len(groups)) if by else [BED]
    drawing, axes = new_panels(len(factors), height=2.8, sharey=True)
    for axis, factor in zip(axes, factors, strict=True):
        x = table[factor["key"]]
        for group, colour in zip(groups, colours, strict=True):
            own = np.ones(len(x), bool) if group is None else table[by] == group
            axis.plot(x[own], values[own], color=colour, marker="o", ms=4, ls="")
        axis.set_xlabel(f"{factor['key']} [{factor['unit']}]" if factor["unit"] else factor["key"])
        if x.dtype.kind not in "fiu":
            axis.tick_params(axis="x", labelrotation=30)
    axes[0].set_ylabel(f"{column['name'].replace('_', ' ')}{f' [{unit}]' if unit else ''}")
    if by:
        marks = [
            handle(f"{by} = {group}", colour, marker="o", ls="") for group, colour in zip(groups, colours, strict=True)
        ]
        legend_above(drawing, marks)
    name = column["name"].replace("_", " ").capitalize()
    key = "over" if by else "over_plain"
    return report.draw(key, drawing, name=f"over-{column['name']}", quantity=name, colour=by)


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
        axis.set_xticks(places, [entry["key"] for entry in own], rotation=30)
        axis.set(title=name.replace("_", " "), xlim=(-0.6, len(own) - 0.4))
    axes[0].set_ylabel("share of the variance [1]")
    marks = [handle("first order", BED, marker="o", ls=""), handle("total", MODEL, marker="o", ls="")]
    legend_above(drawing, marks if any(entry["total"] is not None for entry in entries) else marks[:1])
    return report.draw("sensitivities", drawing)
