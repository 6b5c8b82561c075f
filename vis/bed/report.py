"""Plots, picture and report of a prepared bed: reads result.json, series/ and frames/ of its folder."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from vis.page.numbers import short
from vis.page.page import Block, Page, Section, Tile, code, figure, listing, table, text, write_page
from vis.page.style import styled
from vis.penetrate.plot_parts import Plot, drawn_into, legend_above, new_panels, shades
from vis.pictures.canvas import colour_values, nice_above
from vis.pictures.frames import read_frames
from vis.pictures.pictures import opengl_available, render_apart
from vis.pictures.render import run_job
from vis.tumble.report import read_columns

__all__ = ["write_bed_report"]

Columns = dict[str, NDArray[np.float64]]


def write_bed_report(folder: str | Path, *, progress: Callable[[float], None] | None = None) -> Path:
    """Make figures/ and report.html of the folder of a prepared bed, and return the report.

    Raises FileNotFoundError where the folder has no result.json or a series is missing.
    """
    tell = progress if progress is not None else lambda done: None
    folder = Path(folder)
    result = json.loads((folder / "result.json").read_text(encoding="utf-8"))
    drawn = drawn_into(folder, [_profiles(folder, result), *_passes(folder, result)])
    tell(0.4)
    picture, note = _picture(folder, result)
    tell(0.9)
    report = write_page(folder / "report.html", _page(result, [*picture, *drawn], note))
    tell(1.0)
    return report


def _profiles(folder: Path, result: Mapping[str, Any]) -> Plot:
    """Packing and stresses against height, a colour for each stage."""
    with styled():
        drawing, (packing, vertical, sideways) = new_panels(3, height=3.6, sharey=True)
        colours = shades(len(result["stages"]))
        for stage, colour in zip(result["stages"], colours, strict=True):
            columns, _ = read_columns(folder / stage["series"])
            height = 1e3 * columns["height_m"]
            packing.plot(columns["packing"], height, color=colour, marker=".")
            vertical.plot(columns["stress_zz_Pa"], height, color=colour, marker=".")
            sideways.plot(columns["stress_xx_Pa"], height, color=colour, marker=".")
            sideways.plot(columns["stress_yy_Pa"], height, color=colour, marker=".", ls=(0, (4, 2)))
        _label(packing, "packing fraction [1]")
        _label(vertical, "vertical stress [Pa]")
        _label(sideways, "horizontal stresses [Pa]")
        packing.set_ylabel("height above the floor [mm]")
        packing.set_ylim(bottom=0.0)
        for axis in (vertical, sideways):
            axis.set_xlim(left=0.0)
        handles = [
            Line2D([], [], color=colour, marker=".", label=stage["stage"])
            for stage, colour in zip(result["stages"], colours, strict=True)
        ]
        legend_above(drawing, handles)
    return Plot(
        "profiles",
        "Packing and stress against height",
        "Means over layers of one and a half diameters, after each stage. Stress is that of the contacts' springs "
        "(Love, Weber); right: along x, and dashed along y.",
        drawing,
    )


def _label(axis: Axes, label: str) -> None:
    axis.set_xlabel(label)


def _passes(folder: Path, result: Mapping[str, Any]) -> list[Plot]:
    """Packing against taps or presses of the lid, where a stage had any."""
    stages = [stage for stage in result["stages"] if "trace_series" in stage]
    if not stages:
        return []
    with styled():
        drawing, (axis,) = new_panels(1, height=2.6)
        for stage, colour in zip(stages, shades(len(stages)), strict=True):
            columns, _ = read_columns(folder / stage["trace_series"])
            axis.plot(columns["pass"], columns["packing"], color=colour, marker=".", label=stage["stage"])
        axis.set_xlabel("taps, or presses of the lid, that were kept [1]")
        axis.set_ylabel("packing fraction [1]")
        legend_above(drawing, axis.get_legend_handles_labels()[0])
    words = "Between two points the bed is at rest. A tap that went too far was taken back and is not shown."
    return [Plot("passes", "How the bed was compacted", words, drawing)]


def _picture(folder: Path, result: Mapping[str, Any]) -> tuple[list[Block], str]:
    """The bed cut open, coloured by the contacts of each grain; and what stands in for what."""
    frames = read_frames(folder, "bed")
    if not len(frames):
        return [], "There is no frame to draw a picture of."
    grains = frames[0].grains
    position, radius = grains["position"], grains["radius"][:, None]
    low, high = (position - radius).min(axis=0), (position + radius).max(axis=0)
    file = folder / "figures" / "bed.png"
    count = f"{len(position):,}".replace(",", "\N{NO-BREAK SPACE}")
    view = {
        "name": "bed",
        "frames": [0],
        "by": "coordination",
        "top": nice_above(float(colour_values(grains, "coordination").max())),
        "title": "The bed",
        "lines": [f"packing {result['quantities']['packing_fraction']['value']:.4f}"],
        "note": f"{count} grains; cut open in the middle",
        "low": low.tolist(),
        "high": high.tolist(),
        "cut": 0.5 * float(low[1] + high[1]),
        "radius": float(radius.mean()),
        "surface": float(result["bed"]["surface"]["value"]),
        "file": str(file),
        "size": [1600, 1200],
    }
    job = {"folder": str(folder), "stills": [view], "animation": None}
    note = "This machine has no OpenGL for off-screen pictures; a cross-section stands in for the picture."
    if opengl_available():
        failure = render_apart(job, 120.0, lambda: None)
        note = (
            f"Rendering with OpenGL failed ({failure}); a cross-section stands in for the picture." if failure else ""
        )
    if note:
        run_job(job, opengl=False)
    return [figure(file, title="The bed", caption="Grains coloured by the number of their contacts.")], note


def _page(result: Mapping[str, Any], drawn: list[Block], note: str) -> Page:
    quantities = result["quantities"]

    def said(name: str, scale: float = 1.0, unit: str = "") -> str:
        value = quantities[name]["value"]
        return "–" if value is None else f"{short(scale * value, 4)} {unit}".strip()

    tiles = [
        Tile("Packing fraction", said("packing_fraction"), f"from {said('loosest')} to {said('densest')} on the way"),
        Tile("Contacts of a grain", said("coordination_number"), f"{quantities['grain_count']['value']} grains"),
        Tile("Surface", said("surface", 1e3, "mm"), "above the floor"),
        Tile("Horizontal over vertical stress", said("pressure_ratio"), "away from floor and surface"),
    ]
    criteria = [f"{stage['stage']}: {stage['criterion']}." for stage in result["stages"]]
    every = [
        (name, "null" if entry["value"] is None else f"{entry['value']:.6g}", _unit(entry["unit"]), entry["note"])
        for name, entry in quantities.items()
    ]
    command = result["experiment"]
    tables = [table(listed["head"], listed["rows"], title=listed["title"]) for listed in result["tables"]]
    return Page(
        title=str(result["title"]),
        lead=[f"hedgebed {result['version']}", command, f"seed {result['bed']['seed']}"],
        tiles=tiles,
        warnings=[str(warning)[:1].upper() + str(warning)[1:] for warning in result["warnings"]],
        sections=[
            Section("", [*tables, *drawn]),
            Section("How each stage came to rest", [listing(criteria)]),
            Section("Every number of the result", [table(("quantity", "value", "unit", "note"), every, words=True)]),
            Section(
                "To do this again",
                [
                    text(f"With hedgebed {result['version']}, in this folder:"),
                    code(f"hedgebed {command} run.toml\nhedgebed bed show bed.npz"),
                    text("The same settings give the same bits.", small=True),
                ],
            ),
        ],
        missing=[note] if note else [],
    )


def _unit(unit: str) -> str:
    return "" if unit == "1" else unit
