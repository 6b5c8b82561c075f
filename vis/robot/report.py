"""Plots, pictures and report of a robot: reads trajectory.csv, series, frames and result.json."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from vis.film.film import ARROWS_OF_FEET, draw_runs, shown
from vis.film.reel import SpaceReel
from vis.page.page import Section, listing, table_of, text
from vis.page.plots import AXES, AXIS_LINES, GREY, INK, Array, legend_above, line_styles, mean_over
from vis.page.report import Report, given, report_of
from vis.pictures.canvas import COLOURS
from vis.pictures.frames import frames_of
from vis.spatial.report import draw_energy, pair, say_grains
from vis.view.curves import MOST_LINES, joint_columns, law_beside
from vis.view.page import report_scene

from .answer import answer_tiles
from .beds import draw_beside, write_beds_report

__all__ = ["write_robot_report"]

Columns = Mapping[str, Array]
REACHED = {
    "clearance_largest": "clearance [mm]", "clearance_end": "height at the end [mm]", "sinkage_largest": "sinkage [mm]",
    "sinkage_end": "sinkage at the end [mm]",
}  # fmt: skip
"""Number of a foot in result.json -> head of its column."""
STILL = 1e-3
"""Displacement below which an axis is left out of the path [mm]: a rail keeps a robot in its place."""
NO_FRAMES = "There are no pictures of the robot: the run has --frame-count 0."
HEIGHTS = (
    "Largest height and depth of the lowest point of each foot, from the undisturbed surface. The clearance is that "
    "after the first touch of any foot."
)


@report_of(dpi=130, named=True)
def write_robot_report(
    report: Report, *, pictures: bool = True, colour: str = "displacement", film: bool = True
) -> Path:
    """Make figures/, film.gif and report.html of the folder of a robot's run, and return the report.

    ``pictures``: Whether to draw the robot on its ground, where there are frames. ``colour``: What grains are coloured
    by, a key of `vis.pictures.canvas.COLOURS`. ``film``: Whether to make the film. Raises FileNotFoundError where the
    folder has no series, ValueError for an unknown `colour`.
    """
    if colour not in COLOURS:
        raise ValueError(f"colour is {colour!r}; it must be one of {', '.join(COLOURS)}")
    home, result = report.folder, report.result
    if "beds" in result:
        return write_beds_report(report)
    motion, feet, joints = (report.columns(f"series/{name}.csv") for name in ("motion", "feet", "joints"))
    drawn = [report.draw("path", _draw_path(motion, feet))]
    drawn.append(report.draw("ground", _draw_ground(motion, feet, result["feet"])))
    if (law := law_beside(home)) is not None:
        beside = draw_beside([motion], report.columns(f"series/{law}.csv"), law, called="grains")
        drawn.append(report.draw("beside", beside, law=law))
    drawn += [report.draw("joints", _draw_joints(joints)), report.draw("energy", draw_energy(motion, "the robot"))]
    seen = []
    if pictures and frames_of(home):
        made = draw_runs([SpaceReel(home)], home, "robot", by=colour, film=film, progress=report.rest())
        notes = [text(ARROWS_OF_FEET, small=True), *(text(note) for note in made.notes)]
        seen = [Section("Pictures", [*report_scene(home), *shown(made), *notes])]
    elif not frames_of(home):
        seen = [Section("Pictures", [text(NO_FRAMES, small=True)])]
    sections = [
        Section("", [listing(result["departures"]["sentences"])]),
        *seen,
        Section("Over time", [*drawn, *say_grains(result)]),
        *_feet(result.get("feet_reached") or {}),
        Section("The trial", [given(result["trial"])]),
        report.numbers(beside=(result.get("grains") or {}).get("beside") or {}, law=law or ""),
        report.again("hedgebed mujoco run.toml"),
    ]
    return report.write(sections, lead=["mujoco", f"{result['duration']:g} s"], tiles=answer_tiles(result))


def _feet(reached: Mapping[str, Mapping[str, float]]) -> list[Section]:
    """How high and how deep each foot went; nothing in a folder of an older hedgebed."""
    rows = [(name, *(f"{1e3 * numbers[key]:.4g}" for key in REACHED)) for name, numbers in reached.items()]
    blocks = table_of(("foot", *REACHED.values()), rows)
    return [Section("The feet", [text(HEIGHTS), *blocks])] if blocks else []


def _draw_path(motion: Columns, feet: Columns) -> Figure:
    """Path of the centre of mass, along the axes in which it moves, and the height of the lowest foot."""
    drawing, way, low = pair("way of the centre of mass [mm]", "height of the lowest foot [mm]")
    for axis, style in AXIS_LINES.items():
        moved = 1e3 * (motion[f"{axis}_m"] - motion[f"{axis}_m"][0])
        if axis == "z" or np.ptp(moved) > STILL:
            way.plot(motion["t_s"], moved, label="z (rise)" if axis == "z" else axis, **style)
    heights = [column for name, column in feet.items() if name.endswith("_height_m")]
    lowest = np.min(heights, axis=0) if heights else -motion["sinkage_m"]  # a folder of an older hedgebed
    low.axhline(0.0, color=GREY, lw=0.8, label="undisturbed surface")
    low.plot(motion["t_s"], 1e3 * lowest, color=INK, lw=1.2, label="lowest foot")
    low.legend(loc="best")
    legend_above(drawing, way.lines, 3)
    return drawing


def _draw_ground(motion: Columns, feet: Columns, names: list[str]) -> Figure:
    drawing, force, depth = pair("force of the ground [N]", "depth of the feet [mm]")
    time = motion["t_s"]
    means = mean_over(5e-3, time, (motion[f"f{axis}_N"] for axis in AXES))
    for (axis, style), mean in zip(AXIS_LINES.items(), means, strict=True):
        if axis == "z" or np.any(mean):  # a rail may hold a robot in x and y, where it has no force
            force.plot(time, mean, label=axis, **style)
    for name, own in line_styles(names[:MOST_LINES], beside_axes=True).items():
        depth.plot(time, 1e3 * feet[f"{name}_depth_m"], label=str(name), **own)
    depth.invert_yaxis()
    depth.legend(loc="best")
    legend_above(drawing, force.lines, 3)
    return drawing


def _draw_joints(joints: Columns) -> Figure:
    moved, driven = joint_columns(joints)
    units = sorted({name.rpartition("_")[2] for name in moved}) or ["m"]
    forces = {"m": "N", "rad": "N m"}
    drawing, place, force = pair(
        f"position [{', '.join(units)}]", f"force [{', '.join(forces.get(unit, unit) for unit in units)}]"
    )
    time = joints["t_s"]
    for name, style in zip(moved, line_styles(moved, beside_axes=True).values(), strict=True):
        place.plot(time, joints[name], label=name.rpartition("_")[0], **style)
    for name, style in zip(driven, line_styles(driven, beside_axes=True).values(), strict=True):
        force.plot(time, joints[name], label=name.removesuffix("_force"), **style)
    for axis in (place, force):
        if axis.lines:
            axis.legend(loc="best")
    return drawing
