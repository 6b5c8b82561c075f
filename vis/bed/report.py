"""Plots, picture and report of a prepared bed: reads result.json, series/ and frames/ of its folder."""

from __future__ import annotations

from pathlib import Path

from vis.page.folder import surface_words
from vis.page.numbers import short
from vis.page.page import Block, Section, Tile, figure, listing
from vis.page.plots import DASHED, handle, legend_above, new_panels, shades
from vis.page.report import Report, Result, report_of, tables
from vis.pictures.canvas import colour_values, nice_above
from vis.pictures.frames import grains_box, read_frames
from vis.pictures.pictures import carry_out
from vis.pictures.render import PictureJob, View, run_job
from vis.view.page import report_scene

__all__ = ["answer_tiles", "write_bed_report"]


@report_of(named=True)
def write_bed_report(report: Report) -> Path:
    """Make figures/ and report.html of the folder of a prepared bed, and return the report."""
    result = report.result
    drawn = [_profiles(report), *_passes(report)]
    picture, note = _picture(report)
    criteria = [f"{stage['stage']}: {stage['criterion']}." for stage in result["stages"]]
    command = result["experiment"]
    sections = [
        Section("", [*tables(result), *picture, *report_scene(report.folder), *drawn]),
        Section("Rest after each stage", [listing(criteria)]),
        report.numbers(),
        report.again(f"hedgebed {command} run.toml\nhedgebed bed show bed.npz", "bits"),
    ]
    lead = [command, f"seed {result['bed']['seed']}"]
    return report.write(sections, lead=lead, tiles=answer_tiles(result), missing=[note] if note else [])


def answer_tiles(result: Result) -> list[Tile]:
    """What the bed is after its preparation."""
    quantities = result["quantities"]

    def show(name: str, scale: float = 1.0, unit: str = "") -> str:
        value = quantities[name]["value"]
        return "–" if value is None else f"{short(scale * value, 4)} {unit}".strip()

    return [
        Tile("Packing fraction", show("packing_fraction"), f"from {show('loosest')} to {show('densest')} on the way"),
        Tile("Contacts of a grain", show("coordination_number"), f"{quantities['grain_count']['value']} grains"),
        Tile("Surface", show("surface", 1e3, "mm"), "above the floor"),
        Tile("Horizontal over vertical stress", show("pressure_ratio"), "away from floor and surface"),
    ]


def _profiles(report: Report) -> Block:
    """Packing and stresses against height, a colour for each stage."""
    stages = report.result["stages"]
    drawing, (packing, vertical, sideways) = new_panels(3, height=3.6, sharey=True)
    handles = []
    for stage, colour in zip(stages, shades(len(stages)), strict=True):
        columns = report.columns(stage["series"])
        height = 1e3 * columns["height_m"]
        for axis, name, dash in (
            (packing, "packing", "-"),
            (vertical, "stress_zz_Pa", "-"),
            (sideways, "stress_xx_Pa", "-"),
            (sideways, "stress_yy_Pa", DASHED),
        ):
            axis.plot(columns[name], height, color=colour, marker=".", ls=dash)
        handles.append(handle(stage["stage"], colour, marker="."))
    packing.set(xlabel="packing fraction [1]", ylabel="height above the floor [mm]", ylim=(0.0, None))
    vertical.set(xlabel="vertical stress [Pa]", xlim=(0.0, None))
    sideways.set(xlabel="horizontal stresses [Pa]", xlim=(0.0, None))
    legend_above(drawing, handles)
    return report.draw("profiles", drawing)


def _passes(report: Report) -> list[Block]:
    """Packing against taps or presses of the lid, where a stage had any."""
    stages = [stage for stage in report.result["stages"] if "trace_series" in stage]
    if not stages:
        return []
    drawing, (axis,) = new_panels(1, height=2.6)
    for stage, colour in zip(stages, shades(len(stages)), strict=True):
        columns = report.columns(stage["trace_series"])
        axis.plot(columns["pass"], columns["packing"], color=colour, marker=".", label=stage["stage"])
    axis.set(xlabel="taps, or presses of the lid, that were kept [1]", ylabel="packing fraction [1]")
    legend_above(drawing, axis.lines)
    return [report.draw("passes", drawing)]


def _picture(report: Report) -> tuple[list[Block], str]:
    """The bed cut open, coloured by the contacts of each grain; and what stands in for what."""
    folder, result = report.folder, report.result
    frames = read_frames(folder, "bed")
    if not len(frames):
        return [], "There is no frame to draw a picture of."
    grains, (low, high) = frames[0].grains, grains_box(frames[0])
    file = folder / "figures" / "bed.png"
    count = f"{len(grains['position']):,}".replace(",", "\N{NO-BREAK SPACE}")
    view: View = {
        "name": "bed", "frames": [0], "by": "coordination",
        "title": "\n".join(filter(None, ("The bed", surface_words(result)))),
        "top": nice_above(float(colour_values(grains, "coordination").max())),
        "forces": [None], "strongest": 0.0,
        "lines": [f"packing {result['quantities']['packing_fraction']['value']:.4f}"],
        "note": f"{count} grains; cut open in the middle; dashed: the surface", "low": low.tolist(),
        "high": high.tolist(), "cut": 0.5 * float(low[1] + high[1]), "radius": float(grains["radius"].mean()),
        "surface": float(result["bed"]["surface"]["value"]), "file": str(file), "size": [1600, 1200], "tilt": 0.4,
    }  # fmt: skip
    job: PictureJob = {"folder": str(folder), "views": [view]}
    stands_in = "a cross-section stands in for the picture"
    _, notes = carry_out(job, run_job, [1.0], report.rest(), failed=stands_in, without=stands_in)
    caption = "Grains coloured by the number of their contacts."
    return [figure(file, title="The bed", caption=caption)], "".join(notes)
