"""Plots, pictures and report of a platform in space: reads trajectory.csv, series, frames and result.json."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from vis.film.film import ARROWS, draw_runs, shown
from vis.film.reel import SpaceReel
from vis.page.folder import read_columns
from vis.page.page import Block, Section, listing, text
from vis.page.plots import (
    AXIS_LINES,
    BED,
    DASHED,
    DOTTED,
    GREY,
    INK,
    MODEL,
    Array,
    legend_above,
    mean_over,
    sheet,
)  # fmt: skip
from vis.page.report import Report, Result, given, report_of
from vis.page.states import States, draw_bands, draw_states, passages
from vis.pictures.canvas import COLOURS
from vis.pictures.frames import frames_of
from vis.view.page import report_scene

from .answer import answer_tiles

__all__ = ["draw_energy", "pair", "say_grains", "write_spatial_report"]

Columns = Mapping[str, Array]
_MOST_TICKS = 5  # Of the time: labels of a short run, as 0.0025, lie beside one another
_TURN = "rotation from the start [degrees]"


@report_of(dpi=130, named=True)
def write_spatial_report(
    report: Report, *, pictures: bool = True, colour: str = "displacement", film: bool = True
) -> Path:
    """Make figures/, film.gif and report.html of the folder of a run in space, and return the report.

    ``pictures``: Whether to draw the platform on its ground, where there are frames. ``colour``: What grains are
    coloured by, a key of `vis.pictures.canvas.COLOURS`. ``film``: Whether to make the film. Raises FileNotFoundError
    where the folder has no trajectory.csv or result.json, ValueError for an unknown `colour`.
    """
    if colour not in COLOURS:
        raise ValueError(f"colour is {colour!r}; it must be one of {', '.join(COLOURS)}")
    home, result = report.folder, report.result
    (path, states), motion = read_columns(home / "trajectory.csv"), report.columns("series/motion.csv")
    drawn = [report.draw("path", _draw_path(path)), *_states(report, path, states)]
    for key, drawing in (
        ("turning", _draw_turning(path, motion)),
        ("ground", _draw_ground(motion)),
        ("energy", draw_energy(motion)),
    ):
        drawn.append(report.draw(key, drawing))
    seen = []
    if pictures and frames_of(home):
        made = draw_runs([SpaceReel(home)], home, "space", by=colour, film=film, progress=report.rest())
        seen = [
            Section(
                "Pictures",
                [*report_scene(home), *shown(made), text(ARROWS, small=True), *(text(note) for note in made.notes)],
            )
        ]
    changes = result.get("transitions")  # an older folder has none
    sections = [
        Section("", [listing(result["departures"]["sentences"]), *drawn, *say_grains(result)]),
        *seen,
        *([Section("Transitions", passages(changes, angle="turn", label="turn [degrees]"))] if changes else []),
        Section("The trial", [given(result["trial"])]),
        report.numbers(beside=(result.get("grains") or {}).get("beside") or {}),
        report.again("hedgebed tumble spatial run.toml"),
    ]
    lead = ["tumble spatial", f"{result['duration']:g} s", f"{len(path['t_s'])} rows"]
    return report.write(sections, lead=lead, tiles=answer_tiles(result))


def say_grains(result: Result) -> list[Block]:
    """The bed's numbers in a sentence; nothing on a law."""
    if "grains" not in result:
        return []
    grains = result["grains"]
    return [
        text(
            f"{grains['mode']}. {grains['grain_count']} grains, packing {grains['packing_fraction']:.3g}, E = "
            f"{grains['young'] / 1e6:.3g} MPa, step {1e6 * grains['time_step']:.3g} µs; largest overlap "
            f"{100 * grains['max_overlap']:.2g} %.",
            small=True,
        )
    ]


def _states(report: Report, path: Columns, states: States) -> list[Block]:
    """The states over time and turn, and on grains those of the spring-damper beside them; an older folder has none."""
    if not len(states):
        return []
    turn = np.degrees(path["turn_rad"])
    drawn = [report.draw("states", draw_states(path["t_s"], turn, states, label=_TURN))]
    beside = report.folder / "series" / "spring-damper.csv"
    if beside.exists():
        other, others = read_columns(beside)
        runs = [(path["t_s"], turn, states), (other["t_s"], np.degrees(other["turn_rad"]), others)]
        drawn.append(report.draw("beside", draw_bands(runs, ("grains", "spring-damper"), label=_TURN)))
    return drawn


def pair(left: str, right: str) -> tuple[Figure, Axes, Axes]:
    """Two panels over time, with their labels."""
    drawing, ((one, other),) = sheet(1, 2, 3.2)
    for axis, label in ((one, left), (other, right)):
        axis.set(xlabel="time [s]", ylabel=label)
        axis.xaxis.set_major_locator(MaxNLocator(_MOST_TICKS, steps=[1, 2, 5, 10]))
    return drawing, one, other


def _draw_path(path: Columns) -> Figure:
    drawing, way, speed = pair("displacement of the centre [mm]", "velocity [m/s]")
    for axis, style in AXIS_LINES.items():
        way.plot(path["t_s"], 1e3 * (path[f"{axis}_m"] - path[f"{axis}_m"][0]), label=axis, **style)
        speed.plot(path["t_s"], path[f"v{axis}_m_s"], **style)
    legend_above(drawing, way.lines, 3)
    return drawing


def _draw_turning(path: Columns, motion: Columns) -> Figure:
    drawing, spin, wheels = pair("angular velocity [rad/s]", "wheel speeds [rad/s]")
    for axis, style in AXIS_LINES.items():
        spin.plot(path["t_s"], path[f"w{axis}_rad_s"], label=axis, **style)
        wheels.plot(motion["t_s"], motion[f"wheel_{axis}_rad_s"], **style)
    legend_above(drawing, spin.lines, 3)
    return drawing


def _draw_ground(motion: Columns) -> Figure:
    drawing, force, depth = pair("force of the ground [N]", "sinkage of the deepest spike [mm]")
    time = motion["t_s"]
    means = mean_over(5e-3, time, (motion[f"f{axis}_N"] for axis in AXIS_LINES))
    for (axis, style), mean in zip(AXIS_LINES.items(), means, strict=True):
        force.plot(time, mean, label=axis, **style)
    depth.plot(time, 1e3 * motion["sinkage_m"], color=INK)
    depth.invert_yaxis()
    legend_above(drawing, force.lines, 3)
    return drawing


def draw_energy(motion: Columns, who: str = "the platform") -> Figure:
    """What the torques gave, what `who` gained, what the ground took; and what is left over."""
    drawing, energy, left = pair("energy [mJ]", "left over [µJ]")
    time = motion["t_s"]
    gained = 1e3 * (motion["kinetic_J"] + motion["potential_J"])
    gained = gained - gained[0]
    work, taken = 1e3 * motion["torque_work_J"], 1e3 * (motion["taken_J"] - motion["taken_J"][0])
    energy.plot(time, work, color=BED, label="work of the torques" if who == "the platform" else f"work in {who}")
    energy.plot(time, gained, color=MODEL, ls=DASHED, label=f"gained by {who}")
    energy.plot(time, taken, color=GREY, ls=DOTTED, label="taken by the ground")
    left.plot(time, 1e3 * (gained - work + taken), color=INK, lw=1.0)
    legend_above(drawing, energy.lines, 3)
    return drawing
