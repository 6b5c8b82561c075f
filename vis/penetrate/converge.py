"""Plots and report of a sweep over grain size, width, depth, overlap and speed: reads result.json of its folder."""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.patches import Patch

from vis.page.numbers import column, quantity, quote
from vis.page.page import Block, Section, Tile, listing
from vis.page.plots import BED, DASHED, GREY, INK, MODEL, handle, legend_above, new_figure
from vis.page.report import Report, Result, capital, report_of, tables, title_of
from vis.penetrate.summary_parts import NBSP, say

__all__ = ["answer_tiles", "titled", "write_converge_report"]

_SHOWN = {"m": (1e3, "mm"), "J": (1e3, "mJ"), "1": (1.0, "")}
"""SI unit -> how many of the unit shown it has, and that unit."""
_BEYOND = 0.4
"""How far the axis of a figure goes beyond beds and line for all errors, over their height [1]."""
_TILES = {
    "stiffness": "Fitted stiffness K",
    "damping": "Fitted damping C",
    "sinkage": "Sinkage{load}",
    "stiffness_standing": "Stiffness of a foot that stands",
    "work": "Work to the deepest point",
}


@report_of(named=True)
def write_converge_report(report: Report) -> Path:
    """Make figures/ and report.html of the folder of a sweep, and return the report."""
    result = report.result
    report.about = titled(report)
    first, *others = tables(result)
    drawn = [_figure(report, name, told) for name, told in result["convergence"].items()]
    sections = [
        Section("", [listing(result["departures"]["sentences"]), first]),
        Section("Quantities over grain size", drawn),
        Section("Variants, and the effect of each change", others),
        report.numbers(std=True),
        report.again("hedgebed converge run.toml", "bits"),
    ]
    counted = f"{result['quantities']['members']['value']} runs"
    return report.write(sections, lead=["converge", counted], tiles=answer_tiles(result))


def titled(report: Report) -> str:
    """Title of the figures: what was run, with the gravity of all beds, which run.toml has, and the rest."""
    settings = report.folder / "run.toml"
    given = tomllib.loads(settings.read_text(encoding="utf-8")) if settings.exists() else {}
    body, comma, rest = str(report.result["title"]).partition(", ")
    return title_of({"title": body, "bed": given.get("settings")}) + comma + rest


def answer_tiles(result: Result) -> list[Tile]:
    """The numbers that a reader wants first, each at the real grain with all of its known errors and their sum."""
    numbers = result["quantities"]
    load = f" under {quantity(numbers['load'])}" if "load" in numbers else ""
    tiles = []
    for name, label in _TILES.items():
        entry = numbers.get(name)
        if entry is not None:
            row = [entry["value"], *(_known(entry, key) for key in ("chance", "grain_size", "rest", "total"))]
            unit, (_, *errors) = column(row, entry["unit"], significant=2)
            value = column(row, entry["unit"])[1][0]
            cells = tuple(say("not_known") if error == "\N{EN DASH}" else f"{error}{NBSP}{unit}" for error in errors)
            tiles.append(Tile(label.format(load=load), f"{value}{NBSP}{unit}", errors=cells))
    return tiles


def _known(entry: Result, key: str) -> float | None:
    """An error of a number, 0 for round-off."""
    error = entry[key]
    return error if error is None or error > 1e-9 * abs(entry["value"]) else 0.0


def _figure(report: Report, name: str, told: Result) -> Block:
    """One quantity over grain size, and beside it what the other changes change."""
    entry = report.result["quantities"][name]
    scale, unit = _SHOWN.get(told["unit"], (1.0, told["unit"]))
    changes = told["differences"]
    drawing = new_figure(3.6)
    if changes:
        sizes, rest = drawing.subplots(1, 2, width_ratios=(1.7, 1.0))
        _changes(rest, changes, scale, unit)
    else:
        sizes = drawing.subplots()
    _over_size(sizes, told, report.result["life"], scale)
    sizes.set_title(f"{capital(entry['note'])}{f' [{unit}]' if unit else ''}")
    handles: list[Artist] = [
        handle("a bed", BED, marker="o", ms=3.5, ls="", alpha=0.45),
        handle("mean, 95 %", INK, marker="s", ms=4.5, ls=""),
        handle("line", MODEL, ls=DASHED),
        handle("real grain (thick: chance, thin: all errors)", MODEL, marker="D", ms=5.5, ls=""),
    ]
    if told["line"]:
        handles.insert(3, Patch(facecolor=MODEL, alpha=0.2, label="its 95 %"))
    legend_above(drawing, handles)
    missing = f" Not measured, and in no error: {', '.join(told['unknown'])}." if told["unknown"] else ""
    shown = {key: _plain(told[key], scale, unit) for key in ("chance", "grain", "rest")}
    value = quote(told["value"], told["total"] or told["chance"], told["unit"])
    return report.draw(
        "convergence", drawing, name=f"convergence-{name}", quantity=capital(name.replace("_", " ")), value=value,
        missing=missing, **shown,
    )  # fmt: skip


def _plain(value: float | None, scale: float, unit: str) -> str:
    return "unknown" if value is None else f"{scale * value:.2g} {unit}".strip()


def _over_size(axis: Axes, told: Result, life: float, scale: float) -> None:
    """Beds, means, the line and the value at the real grain, over d / D."""
    ends = [size["x"] for size in told["sizes"]]
    beside = 0.012 * max(ends)
    for size in told["sizes"]:
        values = scale * np.array(size["values"])
        axis.plot(np.full(len(values), size["x"] - beside), values, color=BED, marker="o", ms=3.5, ls="", alpha=0.45)
        half = None if size["half"] is None else scale * size["half"]
        mean = scale * size["mean"]
        axis.errorbar([size["x"]], [mean], yerr=half, color=INK, marker="s", ms=4.5, capsize=3, zorder=4)
    if told["line"]:
        x, y = (np.array([point[k] for point in told["line"]], dtype=float) for k in (0, 1))
        axis.plot(x, scale * y, color=MODEL, ls=DASHED, lw=1.4)
        if all(point[2] is not None for point in told["line"]):
            half = np.array([point[2] for point in told["line"]], dtype=float)
            axis.fill_between(x, scale * (y - half), scale * (y + half), color=MODEL, alpha=0.2, lw=0)
        value = scale * told["value"]
        for error, width in ((told["total"], 1.0), (told["chance"], 3.0)):
            if error is not None:
                capped = 3 if width == 1.0 else 0
                axis.errorbar([life], [value], yerr=scale * error, color=MODEL, elinewidth=width, capsize=capped)
        axis.plot([life], [value], color=MODEL, marker="D", ms=5.5, zorder=5)
    axis.axhline(0.0, color=GREY, lw=0.8, zorder=0)
    axis.set_ylim(*_heights(told, scale))
    ticks = [(x, f"{x:.3g}\nD/d = {1 / x:.3g}") for x in ends] + (
        [(life, f"{life:.2g}\nreal grain")] if told["line"] else []
    )
    axis.set_xticks(*zip(*ticks, strict=True))
    axis.set(xlim=(0.0, 1.08 * max(ends)), xlabel="grain over tip diameter, d / D [1]")


def _heights(told: Result, scale: float) -> tuple[float, float]:
    """Ends of the axis: all beds and the line with its interval; of all errors as much as leaves those visible."""
    value, total = told["value"], told["total"] or 0.0
    shown = [0.0, value, *(bed for size in told["sizes"] for bed in size["values"])]
    shown += [y + sign * (half or 0.0) for _, y, half in told["line"] for sign in (-1, 1)]
    shown += [size["mean"] + sign * (size["half"] or 0.0) for size in told["sizes"] for sign in (-1, 1)]
    low, high = min(shown), max(shown)
    room = _BEYOND * (high - low)
    ends = (max(min(low, value - total), low - room), min(max(high, value + total), high + room))
    margin = 0.05 * (ends[1] - ends[0])
    return scale * (ends[0] - margin), scale * (ends[1] + margin)


def _changes(axis: Axes, changes: Sequence[Result], scale: float, unit: str) -> None:
    """Paired differences to the base: bars with their intervals, beds as points."""
    for place, one in enumerate(changes):
        half = None if one["half"] is None else scale * one["half"]
        axis.bar([place], [scale * one["mean"]], width=0.55, color=BED, alpha=0.3)
        axis.errorbar([place], [scale * one["mean"]], yerr=half, color=INK, ls="", capsize=3)
        values = scale * np.array(list(one["values"].values()))
        axis.plot(np.full(len(values), place + 0.14), values, color=BED, marker="o", ms=3.0, ls="", alpha=0.45)
    axis.axhline(0.0, color=GREY, lw=0.8)
    axis.set_xticks(range(len(changes)), [_label(one) for one in changes])
    axis.margins(y=0.12)
    axis.set_title(f"Change from the base{f' [{unit}]' if unit else ''}")


def _label(one: Result) -> str:
    what, value = one["what"], one["value"]
    shown = {"overlap": f"{100 * value:g} %", "speed": f"\N{MULTIPLICATION SIGN} {value:g}"}.get(what, f"{value:g} D")
    return f"{what}\n{shown}"
