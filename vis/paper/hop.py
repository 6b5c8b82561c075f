"""Plots and report of a hop: reads result.json, series/flight*.csv and trajectory.csv of its folder."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from vis.page.folder import read_columns
from vis.page.numbers import short
from vis.page.page import Block, Section, Tile, listing
from vis.page.plots import BED, DASHED, GREY, MODEL, handle
from vis.page.report import Report, Result, given, report_of
from vis.page.states import by_state, legend_of_states, panels

__all__ = ["write_hop_report"]

_BEYOND = 1.25
"""Length of the line of the launch on rigid ground, over that of the path [1]."""


@report_of(dpi=130, named=True)
def write_hop_report(report: Report) -> Path:
    """Make figures/ and report.html of the folder of a hop, and return the report."""
    result = report.result
    drawn = [_flights(report)] if any((report.folder / "series").glob("flight*.csv")) else []
    if (report.folder / "trajectory.csv").exists():
        drawn.append(_launch(report))
    sections = [
        Section("", [listing(result["departures"]["sentences"]), *drawn]),
        Section("The numbers", [given(result["numbers"])]),
        report.numbers(),
        report.again("hedgebed hop run.toml", "result"),
    ]
    return report.write(sections, lead=["hop", str(result["actuator"]), str(result["surface"])], tiles=_tiles(result))


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


def _show(result: Result, name: str, scale: float = 1.0, unit: str | None = None) -> str:
    entry = result["quantities"][name]
    if entry["value"] is None:
        return "none"
    words = short(scale * entry["value"], 3)
    shown = entry["unit"] if unit is None else unit
    return f"{words}{shown}" if shown in ("°", "") else f"{words} {shown}"


def _tiles(result: Result) -> list[Tile]:
    ground, degrees = result["surface"], math.degrees(1.0)
    at, at_model = (_show(result, f"{which}launch_angle", degrees, "°") for which in ("", "model_"))
    tiles = [
        Tile("Wheel speed", _show(result, "wheel_speed"), result["quantities"]["wheel_speed"]["note"]),
        Tile("Launch, rigid ground", _show(result, "launch_speed"), f"at {at}"),
        Tile("Distance, rigid ground", _show(result, "distance"), f"in {_show(result, 'flight_time')}"),
        Tile(f"Launch from {ground}", _show(result, "model_launch_speed"), f"at {at_model}, planar model"),
        Tile(f"Distance from {ground}", _show(result, "model_distance"), "the same wheel"),
    ]
    if result["quantities"]["model_wheel_speed"]["value"] is not None:  # sought on ground that gives, and found
        speed = _show(result, "model_wheel_speed")
        tiles.insert(1, Tile(f"Wheel speed, {ground}", speed, "for that distance, planar model"))
    return tiles
