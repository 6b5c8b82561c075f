"""Plots and report of a hop: reads result.json, series/flight*.csv and trajectory.csv of its folder."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from vis.page.folder import read_columns
from vis.page.page import Block, Section, listing
from vis.page.plots import BED, DASHED, GREY, MODEL, handle
from vis.page.report import Report, given, report_of
from vis.page.states import by_state, legend_of_states, panels

from .answer import answer_tiles

__all__ = ["write_hop_report"]

_BEYOND = 1.25
"""Length of the line of the launch on rigid ground, over that of the path [1]."""


@report_of(dpi=130, named=True)
def write_hop_report(report: Report) -> Path:
    """Make figures/ and report.html of the folder of a hop, and return the report."""
    result = report.result
    beside = f" and {result['surface']}" if result["quantities"]["model_launch_speed"]["value"] is not None else ""
    # Without the speeds, which are in the table: a title has one line.
    report.about = report.about.partition(", by a wheel")[0] + f", rigid ground{beside}"
    drawn = [_flights(report)] if any((report.folder / "series").glob("flight*.csv")) else []
    if (report.folder / "trajectory.csv").exists():
        drawn.append(_launch(report))
    sections = [
        Section("", [listing(result["departures"]["sentences"]), *drawn]),
        Section("The numbers", [given(result["numbers"])]),
        report.numbers(),
        report.again("hedgebed hop run.toml", "result"),
    ]
    lead = ["hop", str(result["actuator"]), str(result["surface"])]
    return report.write(sections, lead=lead, tiles=answer_tiles(result))


def _flights(report: Report) -> Block:
    """Height against the way along the ground, theory's and the model's, both axes in one scale."""
    result, series = report.result, report.folder / "series"
    first, other = series / "flight.csv", series / "flight.model.csv"
    drawing, (axis,) = panels(1, 4.2)
    label = f"planar model on {result['surface']}, the same wheel"
    handles = []
    for file, words, style in (
        (first, "hop theory, rigid ground", {"color": BED}),
        (other, label, {"color": MODEL, "ls": DASHED}),
    ):
        if file.exists():
            columns, _ = read_columns(file)
            axis.plot(columns["along_m"], columns["height_m"], **style)
            handles.append(handle(words, **style))
    axis.axhline(0.0, color=GREY, lw=0.8, zorder=0)
    axis.set(xlabel="distance along the ground [m]", ylabel="height of the centre above launch [m]", aspect="equal")
    drawing.legend(handles=handles, loc="upper left", bbox_to_anchor=(0.075, 1.0), ncols=2)
    missing = "" if first.exists() else " From rigid ground it escapes: see the warnings."
    missing += "" if other.exists() else " The planar model has no flight that ends: see the warnings."
    sought = "sought for rigid ground" if result.get("asks_for", "distance") == "distance" else "the same on both"
    return report.draw("flights", drawing, sought=sought, missing=missing)


def _launch(report: Report) -> Block:
    """The planar model on the ground: speed of the centre, and where the centre goes."""
    numbers, states = read_columns(report.folder / "trajectory.csv")
    time, speed = 1e3 * numbers["t_s"], np.hypot(numbers["vx_m_s"], numbers["vy_m_s"])
    x, y = (1e3 * (numbers[name] - numbers[name][0]) for name in ("x_m", "y_m"))
    wanted, angle = (report.result["quantities"][name]["value"] for name in ("launch_speed", "launch_angle"))
    dashed: dict[str, Any] = {"color": BED, "ls": DASHED, "lw": 1.2}
    drawing, (rates, path) = panels(2, 3.5)
    by_state(rates, time, speed, states, lw=2.4)
    rates.axhline(wanted, **dashed)
    rates.set(xlabel="time [ms]", ylabel="speed of the centre [m/s]")
    by_state(path, x, y, states, lw=2.4)
    far = float(np.hypot(x, y).max())
    beyond = _BEYOND * far  # where the path lies on the line, its end shows it
    path.plot([0, beyond * math.cos(angle)], [0, beyond * math.sin(angle)], **dashed)
    path.set(xlabel="centre along the ground [mm]", ylabel="centre upwards [mm]")
    path.set_aspect("equal", adjustable="datalim")
    legend_of_states(drawing, states, (handle("launch on rigid ground", **dashed),), columns=6)
    return report.draw("launch", drawing, surface=report.result["surface"])
