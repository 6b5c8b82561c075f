"""Plots and report of `hedgebed bed test shear`: reads result.json and series/ of its folder."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.lines import Line2D

from vis.page.numbers import quote
from vis.page.page import Page, Section, Tile, code, table, text, write_page
from vis.page.style import BED, MODEL, styled
from vis.penetrate.plot_parts import Plot, drawn_into, legend_above, new_panels, shades
from vis.tumble.report import read_columns

__all__ = ["write_shear_report"]


def write_shear_report(folder: str | Path, *, progress: Callable[[float], None] | None = None) -> Path:
    """Make figures/ and report.html of the folder of a shear test, and return the report.

    Raises FileNotFoundError where the folder has no result.json or a series is missing.
    """
    tell = progress if progress is not None else lambda done: None
    folder = Path(folder)
    result = json.loads((folder / "result.json").read_text(encoding="utf-8"))
    drawn = drawn_into(folder, [_curves(folder, result), _lines(result)])
    tell(0.9)
    quantities = result["quantities"]
    tiles = [
        Tile("Critical friction angle", _said(quantities["critical_friction_angle"], "°"), "slope through the runs"),
        Tile("Peak friction angle", _said(quantities["peak_friction_angle"], "°"), "slope through the runs"),
        Tile("Cohesion, critical", _said(quantities["critical_cohesion"], " Pa"), "where the line begins"),
        Tile("Critical stress ratio", _said(quantities["critical_ratio"], ""), "shear over normal"),
    ]
    every = [
        (
            name,
            f"{entry['value']:.5g}",
            "–" if entry["std"] is None else f"{entry['std']:.2g}",
            "" if entry["unit"] == "1" else entry["unit"],
            entry["note"],
        )
        for name, entry in quantities.items()
    ]
    page = Page(
        title=str(result["title"]),
        lead=[f"hedgebed {result['version']}", "bed test shear"],
        tiles=tiles,
        warnings=[str(warning)[:1].upper() + str(warning)[1:] for warning in result["warnings"]],
        sections=[
            Section("", [table(t["head"], t["rows"], title=t["title"]) for t in result["tables"]] + drawn),
            Section(
                "Every number of the result", [table(("quantity", "value", "std", "unit", "note"), every, words=True)]
            ),
            Section("To do this again", [text("In this folder:"), code("hedgebed bed test shear run.toml")]),
        ],
    )
    report = write_page(folder / "report.html", page)
    tell(1.0)
    return report


def _said(entry: Mapping[str, Any], unit: str) -> str:
    value, std = entry["value"], entry["std"]
    return f"{quote(value)}{unit}" if std is None else f"{value:.3g} ± {std:.1g}{unit}"


def _curves(folder: Path, result: Mapping[str, Any]) -> Plot:
    grain = result["grain"]
    with styled():
        drawing, (ratio, height) = new_panels(2, height=3.2, sharex=True)
        colours = shades(len(result["runs"]))
        for run, colour in zip(result["runs"], colours, strict=True):
            columns, _ = read_columns(folder / run["series"])
            way = columns["way_m"] / grain
            count = max(1, len(way) // 60)
            kernel = np.ones(count) / count
            smooth = np.convolve(columns["shear_Pa"], kernel, "valid") / np.convolve(
                columns["normal_Pa"], kernel, "valid"
            )
            ratio.plot(way[count // 2 : count // 2 + len(smooth)], smooth, color=colour)
            height.plot(way, columns["height_m"] / grain, color=colour)
        ratio.set_ylabel("shear over normal stress, at the lid [1]")
        ratio.set_ylim(bottom=0.0)
        height.set_ylabel("the lid has risen by [diameters]")
        for axis in (ratio, height):
            axis.set_xlabel("way of the lid [diameters]")
        legend_above(
            drawing,
            [
                Line2D([], [], color=colour, label=f"{run['normal']:.0f} Pa")
                for run, colour in zip(result["runs"], colours, strict=True)
            ],
        )
    return Plot("shear", "The lid's way", "Both stresses smoothed over a sixtieth of the way.", drawing)


def _lines(result: Mapping[str, Any]) -> Plot:
    quantities, normal = result["quantities"], np.array([run["normal"] for run in result["runs"]])
    with styled():
        drawing, (axis,) = new_panels(1, height=3.2)
        reach = np.array([0.0, 1.05 * normal.max()])
        handles = []
        for kind, colour, mark in (("peak", MODEL, "D"), ("critical", BED, "o")):
            slope = math.tan(math.radians(quantities[f"{kind}_friction_angle"]["value"]))
            axis.plot(reach, quantities[f"{kind}_cohesion"]["value"] + slope * reach, color=colour, lw=1.2)
            error = [run["critical_error"] if kind == "critical" else 0.0 for run in result["runs"]]
            axis.errorbar(normal, [run[kind] for run in result["runs"]], yerr=error, color=colour, marker=mark, ls="")
            handles.append(Line2D([], [], color=colour, marker=mark, label=kind))
        axis.set_xlim(left=0.0)
        axis.set_ylim(bottom=0.0)
        axis.set_xlabel("normal stress [Pa]")
        axis.set_ylabel("shear stress [Pa]")
        legend_above(drawing, handles)
    return Plot("mohr-coulomb", "Mohr-Coulomb", "Least squares; bars: standard error of the critical stress.", drawing)
