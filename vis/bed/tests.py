"""Reports of `hedgebed bed test`: shear, repose, cone and cut; grains seen from the side."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import EllipseCollection
from matplotlib.patheffects import withStroke
from matplotlib.ticker import LogLocator
from numpy.typing import NDArray

from rigid.intervals import NORMAL, half_width, student
from vis.bed.errors import in_95
from vis.page.numbers import quote
from vis.page.page import Block, Section, Tile, text
from vis.page.plots import BED, MODEL, Array, handle, legend_above, new_panels, shades, smooth_ratio
from vis.page.report import Report, Result, again, report_of, tables
from vis.page.sentences import Sentences
from vis.pictures.canvas import colourmap
from vis.pictures.frames import read_frames

__all__ = [
    "FALLEN_SHARE",
    "PARTS",
    "answer_tiles",
    "cut_profiles",
    "flank_lines",
    "quoted",
    "thicknesses",
    "write_shear_report",
    "write_test_report",
]

say = Sentences(__package__)
RIM = [withStroke(linewidth=4.0, foreground="white")]
"""Keeps a line apart from the grains that it lies on."""
Grains = Mapping[str, NDArray[Any]]


@report_of(named=True)
def write_test_report(report: Report) -> Path:
    """Make figures/ and report.html of the folder of such a test, shear aside, and return the report."""
    result, command = report.result, report.result["experiment"]
    plots, method = _TESTS[command.rpartition(" ")[2]]
    one = result["runs"][0]
    sides = " x ".join(f"{1e3 * side:.3g}" for side in one["size"][:2])
    scaled = {"mm": 1e3 * one["grain"], "deep": 1e3 * one["surface"], "mpa": 1e-6 * one["young"]}
    bed = say("first_bed", one=one, sides=sides, step=1e6 * one["time_step"], **scaled)
    sections = [
        Section("", [*tables(result), *(block for draw in plots for block in draw(report))]),
        Section("How it is computed", [*(text(words) for words in method), text(bed)]),
        report.numbers(std=True),
        again(f"hedgebed {command} run.toml"),
    ]
    return report.write(sections, lead=[command, f"{len(result['runs'])} runs"], tiles=answer_tiles(result))


def quoted(entry: Result, scale: float = 1.0, unit: str = "") -> str:
    """A quantity with its error, for a tile: a std that is half of a 95 % interval."""
    if entry["value"] is None:
        return "–"
    value, std = scale * entry["value"], entry["std"]
    return f"{quote(value, None if std is None else scale * std)}{unit}"


def _side_plot(
    report: Report,
    run: Result,
    draw: Callable[[Axes], None],
    key: str,
    *,
    top: float = 5.0,
    shown: Callable[[Grains], Grains] = lambda grains: grains,
) -> list[Block]:
    """The grains of a run's last frame from the side, coloured by how far each has moved; none where no frame is.

    ``draw``: draws over them, in mm. key: of its sentences. top: end of the colours' scale [mean diameters]. ``shown``:
    which grains, and where.
    """
    frames = read_frames(report.folder, run["frames"])
    if not len(frames):
        return []
    grains, period = shown(frames[len(frames) - 1].grains), float(run["size"][0])
    highest = float((grains["position"][:, 2] + grains["radius"]).max())
    # The grains fill the panel's width, or nearly.
    drawing, (axis,) = new_panels(1, height=min(5.5, 0.7 + 6.9 * highest / period))
    drawn = _draw_grains(axis, grains, period=period, unit=run["grain"], top=top)
    draw(axis)
    drawing.colorbar(drawn, ax=axis, shrink=0.8, extend="max", label="displacement since the start [grain diameters]")
    return [report.draw(key, drawing, name="side")]


def _draw_grains(axis: Axes, grains: Grains, *, period: float, unit: float, top: float) -> Any:
    """The grains, x against height in mm, those at the back first, within half a period of x = 0, for a colour bar."""
    position, radius = grains["position"], grains["radius"]
    order = np.argsort(-position[:, 1])
    x = np.mod(position[order, 0] + 0.5 * period, period) - 0.5 * period
    size, way = 2e3 * radius[order], np.linalg.norm(grains["displacement"][order], axis=1) / unit
    drawn = EllipseCollection(
        size, size, np.zeros(len(size)), units="xy", offsets=1e3 * np.column_stack([x, position[order, 2]]),
        offset_transform=axis.transData, array=way, cmap=colourmap(), edgecolors="#00000055", linewidths=0.25,
    )  # fmt: skip
    drawn.set_clim(0.0, top)
    axis.add_collection(drawn)
    highest = 1e3 * float((position[:, 2] + radius).max()) * 1.08
    axis.set(
        aspect="equal", xlim=(-5e2 * period, 5e2 * period), ylim=(0.0, highest), xlabel="x [mm]", ylabel="height [mm]"
    )
    axis.grid(False)
    return drawn


# A cone goes in -------------------------------------------------------------------------------------------------------


def _cone_tiles(result: Result) -> list[Tile]:
    quantities, one = in_95(result), result["runs"][0]
    return [
        Tile(
            "Gradient of the cone index",
            quoted(quantities["gradient"], 1e-6, " MPa/m"),
            f"mean of {len(result['runs'])} pushes",
        ),
        Tile("Over the unit weight", quoted(quantities["gradient_over_weight"]), "gradient / (bulk density g)"),
        Tile("Cone index at the end", quoted(quantities["index_at_end"], 1e-3, " kPa"), "last tenth of the way"),
        Tile("Speed", f"{1e3 * one['speed']:.3g} mm/s", f"v / sqrt(g D) = {one['froude']:.2g}"),
    ]


def _indices(report: Report) -> list[Block]:
    runs = report.result["runs"]
    drawing, (axis, lines) = new_panels(2, height=3.8, sharey=True)
    handles = []
    for run, colour in zip(runs, shades(len(runs)), strict=True):
        columns = report.columns(run["series"])
        depth = 1e3 * columns["base_depth_m"]
        axis.plot(1e-3 * columns["index_Pa"], depth, color=colour, lw=1.2)
        inside = depth >= 0
        lines.plot(1e-3 * columns["index_Pa"][inside], depth[inside], color=colour, lw=0.6, alpha=0.5)
        ends = np.array([0.0, depth[-1]])
        lines.plot(1e-3 * (run["start"] + run["gradient"] * 1e-3 * ends), ends, color=colour, lw=2.0)
        handles.append(handle(run["id"], colour))
    axis.axhline(0.0, color=MODEL, lw=1.0, ls="--")
    axis.invert_yaxis()
    axis.set(ylabel="depth of the cone's base [mm]", title="all the way")
    lines.set_title("fitted lines")
    for panel in (axis, lines):
        panel.set(xlim=(0.0, None), xlabel="cone index [kPa]")
    legend_above(drawing, handles)
    return [report.draw("index", drawing)]


def _cone_side(report: Report) -> list[Block]:
    run = report.result["runs"][0]

    def behind(grains: Mapping[str, Any]) -> Mapping[str, Any]:
        period = np.array(run["size"][:2])
        away = grains["position"][:, :2] - np.array(run["place"])
        away -= period * np.round(away / period)
        kept = {name: np.asarray(values) for name, values in grains.items()}
        kept["position"] = np.column_stack([away, grains["position"][:, 2]])
        return {name: values[away[:, 1] > 0] for name, values in kept.items()}

    def draw(axis: Axes) -> None:
        tip, length, half = 1e3 * (run["surface"] - run["depth"]), 1e3 * run["length"], 5e2 * run["diameter"]
        top = axis.get_ylim()[1]
        shaft, base = 0.5e3 * run["shaft"], tip + length
        for x, z in (([0.0, half, -half], [tip, base, base]), ([-shaft, shaft, shaft, -shaft], [base, base, top, top])):
            axis.fill(x, z, facecolor="#d9d9d9", edgecolor="black", lw=0.8)

    return _side_plot(report, run, draw, "cone_side", top=2.0, shown=behind)


# Plates are pushed ----------------------------------------------------------------------------------------------------


def _plates_tiles(result: Result) -> list[Tile]:
    quantities = in_95(result)

    def share(name: str) -> str:
        return f"{100 * quantities[name]['value']:.0f} %"

    tiles = [
        Tile("Stress gradient", quoted(quantities["gradient_1"], 1e-6, " MN/m3"), "xi_1 of 3D-RFT"),
        Tile("Error, unseen plates", share("unseen_error"), "of the force, rms"),
    ]
    if "shape_error" in quantities:
        tiles.append(Tile("Error, other shapes", share("shape_error"), "of the force, rms; none was fitted"))
    return tiles


def _forces_of_plates(report: Report) -> list[Block]:
    """Measured beside predicted forces of all plates and shapes, each component a panel."""
    rows = [*report.result["plates"], *report.result["shapes"]]
    names = [f"{row['body']}{'' if row['beta'] is None else '°'}, {row['gamma']:g}°" for row in rows]
    place = np.arange(len(rows))
    drawing, panels = new_panels(2, height=1.2 + 0.24 * len(rows), sharey=True)
    for axis, key, label in zip(panels, ("x", "z"), ("backwards, $-F_x$", "upwards, $F_z$"), strict=True):
        sign = -1.0 if key == "x" else 1.0
        measured = [sign * row[f"force_{key}"] for row in rows]
        half = [half_width(row[f"std_{key}"], row["beds"]) or 0.0 for row in rows]
        axis.errorbar(measured, place, xerr=half, fmt="o", color=BED, ms=4, capsize=2)
        axis.plot([sign * row[f"law_{key}"] for row in rows], place, "x", color=MODEL, ms=6)
        axis.axhline(len(report.result["plates"]) - 0.5, color="#999999", lw=0.8)
        axis.set(xlabel=f"force {label} [N]")
    panels[0].set_yticks(place, names)
    panels[0].invert_yaxis()
    bed = handle("bed, ± 95 % of the mean over beds", BED, marker="o", ms=4)
    legend_above(drawing, [bed, handle("fitted law", MODEL, marker="x", ms=6, ls="")])
    return [report.draw("plates", drawing)]


# A face is cut --------------------------------------------------------------------------------------------------------


FALLEN_SHARE = 0.2
"""Of a wedge's grains: `dem.measure.cutting`'s, which a test holds it to; reports read run folders only."""


def _cut_tiles(result: Result) -> list[Tile]:
    quantities, runs = in_95(result), result["runs"]
    bounds = [run["low"] for run in runs], [run["high"] for run in runs if run["high"] is not None]
    between = f"more than {1e3 * min(bounds[0]):.3g} mm" if any(bounds[0]) else "no face stood"
    if len(bounds[1]) == len(runs):
        between += f", less than {1e3 * max(bounds[1]):.3g} mm"
    note = str(quantities["cohesion"]["note"]).partition(";")[0]
    angle = f"Terzaghi, with {note.partition(' with ')[2]}" if " with phi" in note else note
    return [
        Tile("Critical height", quoted(quantities["critical_height"], 1e3, " mm"), between),
        Tile("Cohesion", quoted(quantities["cohesion"], 1.0, " Pa"), angle),
        Tile("Slumped to", quoted(quantities["slumped_to"], 1.0, "°"), "slope of a fallen face"),
        Tile("Height of the faces", f"{1e3 * runs[0]['height']:.3g} mm", f"{len(runs)} beds"),
    ]


def _cut_side(report: Report) -> list[Block]:
    run = report.result["runs"][0]

    def draw(axis: Axes) -> None:
        high = 1e3 * run["height"]
        axis.set_ylim(top=max(axis.get_ylim()[1], 1.1 * high))
        for side in (-1, 1):
            axis.plot(2 * [5e2 * side * run["width"]], [0.0, high], color=MODEL, lw=1.2, ls="--")
        if run["flanks"]:
            flank_lines(axis, run, start=0.0, period=run["size"][0], colour=MODEL)

    return _side_plot(report, run, draw, "cut_side")


def _cut_profiles(report: Report) -> list[Block]:
    return cut_profiles(report, report.result["runs"], lambda run: str(run["id"]), "tests_profiles", name="profiles")


def cut_profiles(
    report: Report, runs: Sequence[Result], title: Callable[[Result], str], key: str, *, name: str = ""
) -> list[Block]:
    """Profiles of cut beds, before a face fell and at the end, a panel a run under its ``title``."""

    def draw(axis: Axes, run: Result, x: Array, thickness: Array, standing: Array | None) -> str:
        if standing is not None:
            axis.step(x, standing, where="mid", color=BED, lw=1.2)
        axis.step(x, thickness, where="mid", color=MODEL, lw=1.2, ls="--")
        return title(run)

    handles = [handle("stood last", BED, lw=1.2), handle("at the end", MODEL, ls="--", lw=1.2)]
    return thicknesses(report, runs, draw, key, name=name, handles=handles)


def _trials(report: Report) -> list[Block]:
    runs = report.result["runs"]
    drawing, (axis,) = new_panels(1, height=2.6)
    handles = []
    for run, colour in zip(runs, shades(len(runs)), strict=True):
        trials = np.array(sorted(run["trials"]))
        axis.plot(1e3 * run["height"] * trials[:, 0], trials[:, 1], color=colour, marker="o", ms=4)
        handles.append(handle(run["id"], colour, marker="o", ms=4))
    axis.axhline(FALLEN_SHARE, color=MODEL, lw=1.0, ls="--")
    axis.set_xscale("log")
    heights = [1e3 * run["height"] for run in runs]
    axis.set_xlim(0.09 * min(heights), 4.4 * max(heights))
    axis.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.xaxis.set_major_formatter("{x:g}")
    axis.xaxis.set_minor_formatter("")
    axis.set(
        ylim=(-0.03, 1.03),
        xlabel="height of the face at the bed's own gravity [mm]",
        ylabel="grains of the wedge\nthat have moved [1]",
    )
    legend_above(drawing, handles)
    return [report.draw("trials", drawing)]


# A slot drains the bed ------------------------------------------------------------------------------------------------


def _repose_tiles(result: Result) -> list[Tile]:
    quantities, runs = in_95(result), result["runs"]
    return [
        Tile("Angle of repose", quoted(quantities["angle_of_repose"], 1.0, "°"), "drained; mean of two slopes a bed"),
        Tile("Slopes", f"{2 * len(runs)}", f"{len(runs)} beds, two each"),
        Tile("Crest", quoted(quantities["crest"], 1e3, " mm"), f"grains of {1e3 * runs[0]['grain']:.3g} mm"),
        Tile("Packing fraction", quoted(quantities["packing_fraction"]), "before the slot was opened"),
    ]


def flank_lines(axis: Axes, run: Result, *, start: float, period: float, colour: Any, base: float = 0.0) -> None:
    """The straight lines of both flanks in mm: full where they were fitted, dotted down to ``base`` [m]."""
    for sign, flank in zip((1.0, -1.0), run["flanks"], strict=True):
        slope = math.tan(math.radians(flank["angle"]))
        for ends, style in (
            (np.array([flank["foot"], flank["start"]]), ":"),
            (np.array([flank["start"], flank["end"]]), "-"),
        ):
            x = sign * (start + ends)
            x = np.where(np.abs(x) > 0.5 * period, np.nan, x)
            height = base + slope * (ends - flank["foot"])
            axis.plot(1e3 * x, 1e3 * height, color=colour, ls=style, lw=2.0, zorder=3, path_effects=RIM)


def _repose_side(report: Report) -> list[Block]:
    run = report.result["runs"][0]

    def draw(axis: Axes) -> None:
        half, plate = 0.5 * run["slot"], run["plate"]
        flank_lines(axis, run, start=half, period=run["size"][0], colour=MODEL, base=plate)
        for side in (-1.0, 1.0):
            ends = side * np.array([half, half, 0.5 * run["size"][0], 0.5 * run["size"][0]])
            heights = plate - 2.0 * run["grain"] * np.array([0.0, 1.0, 1.0, 0.0])
            axis.fill(1e3 * ends, 1e3 * heights, color="#444444", zorder=2)
        axis.set_title(f"{run['id']}: {run['flanks'][1]['angle']:.1f}° and {run['flanks'][0]['angle']:.1f}°")

    return _side_plot(report, run, draw, "repose_side")


def _repose_profiles(report: Report) -> list[Block]:
    def draw(axis: Axes, run: Result, x: Array, thickness: Array, standing: Array | None) -> str:
        axis.plot(x, thickness, color=BED, marker=".", ls="none")
        flank_lines(axis, run, start=0.5 * run["slot"], period=run["size"][0], colour=MODEL)
        axis.axhline(1e3 * run["surface"], color="#888888", lw=0.8, ls="--")
        return f"{run['id']}: {run['angle']:.1f} ± {NORMAL * run['error']:.1f}°"

    dots, fit = handle("bed", BED, marker=".", ls="none"), handle("fit", MODEL)
    before = handle("surface before", "#888888", ls="--", lw=0.8)
    handles = [dots, fit, before]
    return thicknesses(report, report.result["runs"], draw, "repose_profiles", name="profiles", handles=handles)


def thicknesses(
    report: Report, runs: Sequence[Result], draw: Callable[..., str], key: str, *, name: str = "", handles: Any = ()
) -> list[Block]:
    """Profiles in mm, a panel a run, each drawn by `draw`, which gives its title; none without runs."""
    if not runs:
        return []
    drawing, axes = new_panels(len(runs), height=2.4, sharey=True)
    for axis, run in zip(axes, runs, strict=True):
        columns = {name: 1e3 * values for name, values in report.columns(run["series"]).items()}
        title = draw(axis, run, columns["x_m"], columns["thickness_m"], columns.get("thickness_standing_m"))
        axis.set(title=title, xlabel="x [mm]", ylim=(0.0, None))
    axes[0].set_ylabel("thickness [mm]")
    if handles:
        legend_above(drawing, handles)
    return [report.draw(key, drawing, name=name)]


_Drawer = Callable[[Report], list[Block]]
_TESTS: dict[str, tuple[tuple[_Drawer, ...], tuple[str, ...]]] = {
    "cone": ((_indices, _cone_side), (say("cone_method_1"), say("cone_method_2"))),
    "plates": ((_forces_of_plates,), (say("plates_method_1"), say("plates_method_2"))),
    "cut": ((_cut_side, _cut_profiles, _trials), (say("cut_method_1"), say("cut_method_2"))),
    "repose": ((_repose_side, _repose_profiles), (say("repose_method_1"), say("repose_method_2"))),
}
"""What draws, and how the test is made, a paragraph each."""


# A lid shears it ------------------------------------------------------------------------------------------------------


PARTS = 5
"""Of a lid's way, whose scatter gives the error of a critical stress: `experiments.bed.shear`'s, as a test shows."""


@report_of(named=True)
def write_shear_report(report: Report) -> Path:
    """Make figures/ and report.html of the folder of a shear test, and return the report."""
    result = report.result
    sections = [
        Section("", [*tables(result), _curves(report), _lines(report)]),
        report.numbers(std=True),
        again("hedgebed bed test shear run.toml"),
    ]
    return report.write(sections, lead=["bed test shear"], tiles=answer_tiles(result))


def _shear_tiles(result: Result) -> list[Tile]:
    quantities = in_95(result)
    slope = f"slope through {len(result['runs'])} runs"
    numbers = (
        ("Critical friction angle", "critical_friction_angle", "°", slope),
        ("Peak friction angle", "peak_friction_angle", "°", slope),
        ("Cohesion, critical", "critical_cohesion", " Pa", "where the line begins"),
        ("Critical stress ratio", "critical_ratio", "", "shear over normal"),
    )

    return [Tile(label, quoted(quantities[name], 1.0, unit), note) for label, name, unit, note in numbers]


def _curves(report: Report) -> Block:
    grain, runs = report.result["grain"], report.result["runs"]
    drawing, (ratio, height) = new_panels(2, height=3.2, sharex=True)
    handles = []
    for run, colour in zip(runs, shades(len(runs)), strict=True):
        columns = report.columns(run["series"])
        way = columns["way_m"] / grain
        ratio.plot(*smooth_ratio(way, columns), color=colour)
        height.plot(way, columns["height_m"] / grain, color=colour)
        handles.append(handle(f"{run['normal']:.0f} Pa", colour))
    ratio.set(ylabel="shear over normal stress, at the lid [1]", ylim=(0.0, None))
    height.set_ylabel("the lid has risen by [diameters]")
    for axis in (ratio, height):
        axis.set_xlabel("way of the lid [diameters]")
    legend_above(drawing, handles)
    return report.draw("shear", drawing)


def _lines(report: Report) -> Block:
    quantities, runs = report.result["quantities"], report.result["runs"]
    normal = np.array([run["normal"] for run in runs])
    drawing, (axis,) = new_panels(1, height=3.2)
    reach = np.array([0.0, 1.05 * normal.max()])
    handles = []
    for kind, colour, mark in (("peak", MODEL, "D"), ("critical", BED, "o")):
        slope = math.tan(math.radians(quantities[f"{kind}_friction_angle"]["value"]))
        axis.plot(reach, quantities[f"{kind}_cohesion"]["value"] + slope * reach, color=colour, lw=1.2)
        error = [student(PARTS - 1) * run["critical_error"] if kind == "critical" else 0.0 for run in runs]
        axis.errorbar(normal, [run[kind] for run in runs], yerr=error, color=colour, marker=mark, ls="")
        handles.append(handle(kind, colour, marker=mark))
    axis.set(xlim=(0.0, None), ylim=(0.0, None), xlabel="normal stress [Pa]", ylabel="shear stress [Pa]")
    legend_above(drawing, handles)
    return report.draw("mohr_coulomb", drawing, name="mohr-coulomb")


_TILES: dict[str, Callable[[Result], list[Tile]]] = {
    "shear": _shear_tiles,
    "repose": _repose_tiles,
    "cone": _cone_tiles,
    "plates": _plates_tiles,
    "cut": _cut_tiles,
}


def answer_tiles(result: Result) -> list[Tile]:
    """The numbers of a test that a reader wants first."""
    return _TILES[str(result["experiment"]).rpartition(" ")[2]](result)
