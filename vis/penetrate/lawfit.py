"""Plots and report of `hedgebed calibrate`: laws beside the runs, the map of trust, what each run contributed."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.colors import TwoSlopeNorm

from rigid.intervals import half_width
from vis.page.numbers import quote
from vis.page.page import Block, Section, Tile, listing, table
from vis.page.plots import BED, DASHED, GREY, INK, Array, handle, legend_above, line_styles, new_panels, sheet
from vis.page.report import Report, Result, report_of, tables

__all__ = ["answer_tiles", "write_lawfit_report"]

_MOST = 4
"""Speeds that have a panel of their own at most: the slowest, the fastest and those between."""
_FULL = 0.5
"""Error at which the colour of the map of trust is full [1]."""


@report_of(named=True)
def write_lawfit_report(report: Report) -> Path:
    """Make figures/ and report.html of the folder of a calibration, and return the report."""
    result = report.result
    cells: list[Result] = result.get("cells", [result])
    blocks = [listing(result["departures"]["sentences"]), *tables(result), *_crossed(report)]
    sections = [Section("", [*blocks, *([] if len(cells) > 1 else _of_cell(report, result, ""))])]
    for cell in cells if len(cells) > 1 else ():
        sections.append(Section(cell["name"], [*_of_cell(report, cell, cell["name"]), _parameters(cell["laws"])]))
    sections += [
        Section("Parameters", [_parameters(result.get("crossed", result["laws"]))]),
        Section("The spring-damper that is right at a load and a speed", [_tangents(cells)]),
        Section("What each run contributed", [*_design(result), _contributions(cells)]),
        report.numbers(std=True),
        report.again("hedgebed calibrate run.toml", "numbers"),
    ]
    runs = [one for cell in cells for one in cell["contributions"]]
    counted = f"{len(runs)} runs in beds of {len({one['bed'] for one in runs})} seeds"
    return report.write(sections, lead=["calibrate", counted], tiles=answer_tiles(result))


def answer_tiles(result: Result) -> list[Tile]:
    """Rows of the table at the top of the report: K, C and the error of the spring-damper in other beds."""
    cells: list[Result] = result.get("cells", [result])
    tiles, numbers = [], result["quantities"]
    for name, key, unit in (("Stiffness K", "stiffness", None), ("Damping C", "damping", None),
                            ("Error of the force, other beds", "held_out_error", "%")):  # fmt: skip
        own = numbers[key] if key in numbers else numbers[f"{key}@{cells[0]['name']}"]
        words = "one standard deviation" if unit is None else "rms of the spring-damper, std over beds"
        words += f", {cells[0]['name']}" if len(cells) > 1 else ""
        shown = quote(own["value"], own["std"], unit or own["unit"])
        tiles.append(Tile(name, shown, words))
    return tiles


def _of_cell(report: Report, cell: Result, name: str) -> list[Block]:
    """The figures of one tip and gravity; `name`: of the cell where there are several."""
    drawn = (_laws(report, cell["laws"], name), _trust(report, cell["laws"], name))
    return [block for block in drawn if block is not None]


def _laws(report: Report, laws: list[Result], cell: str) -> Block | None:
    """Mean force over beds of each speed's drives, with every law."""
    first = next((law["map"] for law in laws if law["map"] is not None), None)
    if first is None:
        return None
    speeds = first["speeds"]
    places = np.unique(np.linspace(0, len(speeds) - 1, min(_MOST, len(speeds))).round().astype(int))
    drawing, axes = new_panels(len(places), height=3.4, sharey=True)
    named = sorted((law["name"] for law in laws), key=lambda name: name != "spring-damper")  # its colour is MODEL
    styles = line_styles(named, without=(BED,))
    styles["spring-damper"] = {**styles["spring-damper"], "ls": DASHED, "zorder": 2.5}  # over those on which it lies
    file = f"series/bins-{cell}.csv" if cell else "series/bins.csv"
    columns = report.columns(file) if (report.folder / file).exists() else None  # a kept result has the means alone
    sure = False
    for axis, place in zip(axes, places, strict=True):
        depth, force = 1e3 * np.array(first["depth"]), np.array(first["force"][place])
        half = np.full(len(depth), np.nan)
        if columns is not None:
            rows = np.isclose(columns["rate_m_s"], speeds[place], rtol=1e-3)
            axis.plot(1e3 * columns["depth_m"][rows], columns["force_N"][rows], ".", color=BED, ms=3, alpha=0.4)
            half = _over_beds(1e3 * columns["depth_m"][rows], columns["force_N"][rows], depth)
        axis.errorbar(depth, force, half, fmt="o", color=BED, ms=4, lw=1.0, capsize=2)
        sure = sure or bool(np.isfinite(half).any())
        for law in laws:
            law_force = force * (1 + np.array(law["map"]["error"][place]))
            axis.plot(depth, law_force, lw=1.5, **styles[law["name"]])
        axis.set(title=f"{speeds[place]:.3g} m/s", xlabel="depth of the tip [mm]")
        axis.axhline(0.0, color=GREY, lw=0.8)
    axes[0].set_ylabel("force of the ground [N]")
    marks = [handle("a run on grains", BED, marker=".", ls="", alpha=0.5)] if columns is not None else []
    marks.append(handle(f"grains, mean of the beds{', 95 %' if sure else ''}", BED, marker="o", ms=4, ls=""))
    lines = [handle(law["name"], lw=1.5, **styles[law["name"]]) for law in laws]
    legend_above(drawing, [*marks, *lines], 3)
    return report.draw("laws", drawing, name=f"laws-{cell}" if cell else "")


def _over_beds(depth: Array, force: Array, middles: Array) -> Array:
    """Half of the 95 % interval of the mean force over runs [N] at each of the `middles` of depth; NaN of one run.

    Each reading counts at the nearest of the middles [mm], which it may miss by half of their distance.
    """
    nearest = np.abs(depth[:, None] - middles).argmin(axis=1)
    at = [force[nearest == place] for place in range(len(middles))]
    return np.array([half_width(float(own.std(ddof=1)), len(own)) if len(own) > 1 else np.nan for own in at])


def _crossed(report: Report) -> list[Block]:
    """Force over rho g D^3 of all cells with the best law: a row for each tip, a panel for each Froude number."""
    if "crossed" not in report.result:
        return []
    columns, best = report.columns("series/crossed.csv"), report.result["crossed"][0]["name"]
    cells = [cell["foundation"] for cell in report.result["cells"]]
    tips = list(dict.fromkeys((cell["tip"], cell["diameter"], cell["cone_angle"]) for cell in cells))
    gravities = sorted({cell["gravity"] for cell in cells}, reverse=True)
    styles = line_styles(gravities).values()
    looks = [{"marker": mark, "color": style["color"]} for mark, style in zip("ox+sd^v", styles, strict=False)]
    drives = _froudes(columns["froude"])
    drawing, grid = sheet(len(tips), len(drives), 0.5 + 2.5 * len(tips), sharex=True, sharey="row")
    for row, tip in zip(grid, tips, strict=True):
        own = [k for k, cell in enumerate(cells) if (cell["tip"], cell["diameter"], cell["cone_angle"]) == tip]
        for axis, (low, high) in zip(row, drives, strict=True):
            driven = (columns["froude"] >= low) & (columns["froude"] <= high)
            for k in own:
                there, look = driven & (columns["cell"] == k), looks[gravities.index(cells[k]["gravity"]) % len(looks)]
                axis.plot(columns["depth"][there], columns["force"][there], ls="", ms=4, alpha=0.6, **look)
            on = driven & np.isin(columns["cell"], own)
            depth, place = np.unique(columns["depth"][on], return_index=True)
            axis.plot(depth, columns[best][on][place], color=INK, lw=1.5)
            axis.set_title(f"{tip[0]} {1e3 * tip[1]:g} mm, v/√(g D) = {high:.2g}", fontsize=9)
        row[0].set_ylabel("force / (ρ g D³) [1]")
    for axis in grid[-1]:
        axis.set_xlabel("depth over diameter [1]")
    marks = [
        handle(f"grains at {gravity:.4g} m/s²", ls="", ms=4, **look)
        for gravity, look in zip(gravities, looks, strict=False)
    ]
    legend_above(drawing, [*marks, handle(f"{best}, one law for all", INK, lw=1.5)], 4)
    return [report.draw("crossed", drawing)]


def _froudes(froude: Array) -> list[tuple[float, float]]:
    """Least and largest v / sqrt(g D) of each group of drives; of more than `_MOST` groups, some between the ends.

    Drives of one nominal speed slow down a little at their ends: a gap of a fifth separates two groups.
    """
    values = np.unique(froude)
    groups = np.split(values, 1 + np.flatnonzero(values[1:] > 1.2 * values[:-1]))
    chosen = np.unique(np.linspace(0, len(groups) - 1, min(_MOST, len(groups))).round().astype(int))
    return [(float(groups[k][0]), float(groups[k][-1])) for k in chosen]


def _trust(report: Report, laws: list[Result], cell: str) -> Block | None:
    """Error of the spring-damper and of the best other law over depth and speed."""
    pair = next(law for law in laws if law["name"] == "spring-damper")
    other = next((law for law in laws if law is not pair), None)
    shown = [law for law in (pair, other) if law is not None and law["map"] is not None]
    if not shown:
        return None
    drawing, grid = sheet(1, len(shown), 0.6 * len(pair["map"]["speeds"]) + 2.0, sharey=True)
    image: Any = None
    for axis, law in zip(grid[0], shown, strict=True):
        found = law["map"]
        error = 100 * np.array(found["error"])
        depth = 1e3 * np.array(found["depth"])
        edges = np.concatenate([[0.0], 0.5 * (depth[1:] + depth[:-1]), [1.5 * depth[-1] - 0.5 * depth[-2]]])
        rows = np.arange(len(found["speeds"]) + 1) - 0.5
        norm = TwoSlopeNorm(0.0, -100 * _FULL, 100 * _FULL)
        image = axis.pcolormesh(edges, rows, error, cmap="RdBu_r", norm=norm)
        for row, values in enumerate(error):
            for place, value in zip(depth, values, strict=True):
                dark = abs(value) > 60 * _FULL
                words = f"{value:+.0f}".replace("-", "−") if abs(value) >= 0.5 else "0"
                axis.text(place, row, words, ha="center", va="center", fontsize=7.5, color="white" if dark else INK)
        axis.set_yticks(range(len(found["speeds"])), [f"{speed:.3g}" for speed in found["speeds"]])
        axis.set(title=law["name"], xlabel="depth of the tip [mm]")
        axis.grid(visible=False)
    grid[0][0].set_ylabel("speed [m/s]")
    drawing.colorbar(image, ax=grid[0].tolist(), label="law less grains, fitted runs [%]", extend="both", shrink=0.9)
    return report.draw("trust", drawing, name=f"trust-{cell}" if cell else "")


def _parameters(laws: list[Result]) -> Block:
    rows = [
        (law["name"], name, f"{one['value']:.4g}", f"{one['std']:.2g}", f"{one['low']:.4g} to {one['high']:.4g}",
         one.get("unit", "").removesuffix("1"))
        for law in laws for name, one in law["parameters"].items()
    ]  # fmt: skip
    rows += [
        (law["name"], name, f"{value:.4g}", "-", "not fitted", "")
        for law in laws
        for name, value in law.get("fixed", {}).items()
    ]
    return table(("law", "parameter", "value", "std", "90 %", "unit"), rows)


def _tangents(cells: list[Result]) -> Block:
    rows = [
        (*([cell["name"]] if len(cells) > 1 else []), row["law"], f"{row['load']:.3g} N", f"{row['speed']:.3g} m/s",
         f"{1e3 * row['depth']['value']:.3g} mm",
         *(f"{row[key]['value']:.3g} ({row[key]['low']:.3g} to {row[key]['high']:.3g})"
           for key in ("stiffness", "damping")))
        for cell in cells for row in cell["tangents"]
    ]  # fmt: skip
    head = ("law", "load", "speed", "depth", "K = dF/dz [N/m] (90 %)", "C = dF/d(dz/dt) [N s/m] (90 %)")
    return table(("tip and gravity", *head) if len(cells) > 1 else head, rows)


def _design(result: Result) -> list[Block]:
    """Which runs were computed and why; nothing where they were there before."""
    rows = [
        (str(number), step["why"], ", ".join(step["runs"]), f"{step['cost']:.3g} s", f"{100 * step['sure']:.2g} %")
        for number, step in enumerate(result["design"], 1)
    ]
    head = ("step", "why", "runs", "cost by estimate, one core", "90 % interval of the force, half")
    return [table(head, rows, words=True)] if rows else []


def _contributions(cells: list[Result]) -> Block:
    rows = [
        (one["run"], f"{100 * one['misfit']:.3g} %", f"{one['stiffness']:.4g}", f"{one['damping']:.3g}")
        for cell in cells
        for one in cell["contributions"]
    ]
    return table(("run", "rms error", "K without it [N/m]", "C without it [N s/m]"), rows)
