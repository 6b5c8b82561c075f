"""Plots and report of a hop: reads result.json, series/flight*.csv and trajectory.csv of its folder."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from vis.page.numbers import short
from vis.page.page import Block, Page, Section, Tile, code, figure, listing, table, text, write_page
from vis.page.style import BED, GREY, INK, MODEL, styled
from vis.tumble.report import STATES, read_columns, state_runs

__all__ = ["write_hop_report"]

_DASHES = (0, (4, 2))
_DPI = 130


def write_hop_report(folder: str | Path, *, progress: Callable[[float], None] | None = None) -> Path:
    """Make figures/ and report.html of the folder of a hop, and return the report.

    Raises FileNotFoundError where the folder has no result.json.
    """
    tell = progress if progress is not None else lambda done: None
    folder = Path(folder)
    result = json.loads((folder / "result.json").read_text(encoding="utf-8"))
    figures = folder / "figures"
    figures.mkdir(exist_ok=True)
    flights = any((folder / "series").glob("flight*.csv"))
    drawn = [_flights(folder, result, figures)] if flights else []
    tell(0.5)
    if (folder / "trajectory.csv").exists():
        drawn.append(_launch(folder, result, figures))
    tell(0.9)
    report = write_page(folder / "report.html", _page(result, drawn))
    tell(1.0)
    return report


# Figures --------------------------------------------------------------------------------------------------------------


def _axes(width: float, height: float, columns: int = 1) -> tuple[Figure, list[Axes]]:
    with mpl.rc_context({"figure.constrained_layout.use": False}):
        drawing = Figure(figsize=(width, height))
    FigureCanvasAgg(drawing)
    axes = drawing.subplots(1, columns, squeeze=False)[0]
    drawing.subplots_adjust(left=0.09, right=0.985, bottom=0.5 / height, top=1 - 0.38 / height, wspace=0.23)
    return drawing, list(axes)


def _flights(folder: Path, result: Mapping[str, Any], figures: Path) -> Block:
    """Height against the way along the ground, theory's and the model's, both axes in one scale."""
    first, other = folder / "series" / "flight.csv", folder / "series" / "flight.model.csv"
    with styled():
        drawing, (axis,) = _axes(8.6, 4.2)
        handles = []
        if first.exists():
            theory, _ = read_columns(first)
            axis.plot(theory["along_m"], theory["height_m"], color=BED)
            handles = [Line2D([], [], color=BED, label="hop theory, rigid ground")]
        if other.exists():
            model, _ = read_columns(other)
            axis.plot(model["along_m"], model["height_m"], color=MODEL, ls=_DASHES)
            label = f"planar model on {result['surface']}, the same wheel"
            handles.append(Line2D([], [], color=MODEL, ls=_DASHES, label=label))
        axis.axhline(0.0, color=GREY, lw=0.8, zorder=0)
        axis.set_xlabel("distance along the ground [m]")
        axis.set_ylabel("height of the centre above launch [m]")
        axis.set_aspect("equal")
        drawing.legend(handles=handles, loc="upper left", bbox_to_anchor=(0.075, 1.0), ncols=2)
        drawing.savefig(figures / "flights.png", dpi=_DPI)
    missing = "" if first.exists() else " From rigid ground it escapes: see the warnings."
    missing += "" if other.exists() else " The planar model has no flight that ends: see the warnings."
    sought = "sought for rigid ground" if result.get("asks_for", "distance") == "distance" else "the same on both"
    return figure(
        figures / "flights.png",
        title="The flight",
        caption=f"One scale both ways. The wheel is {sought}; what gives way springs back.{missing}",
    )


def _launch(folder: Path, result: Mapping[str, Any], figures: Path) -> Block:
    """The planar model on the ground: speed of the centre, and where the centre goes."""
    numbers, states = read_columns(folder / "trajectory.csv")
    time, speed = 1e3 * numbers["t_s"], np.hypot(numbers["vx_m_s"], numbers["vy_m_s"])
    x, y = (1e3 * (numbers[name] - numbers[name][0]) for name in ("x_m", "y_m"))
    wanted = result["quantities"]["launch_speed"]["value"]
    angle = result["quantities"]["launch_angle"]["value"]
    with styled():
        drawing, (rates, path) = _axes(8.6, 3.5, 2)
        _by_state(rates, time, speed, states)
        rates.axhline(wanted, color=BED, ls=_DASHES, lw=1.2)
        rates.set_xlabel("time [ms]")
        rates.set_ylabel("speed of the centre [m/s]")
        _by_state(path, x, y, states)
        far = float(np.hypot(x, y).max())
        path.plot([0, far * math.cos(angle)], [0, far * math.sin(angle)], color=BED, ls=_DASHES, lw=1.2)
        path.set_xlabel("centre along the ground [mm]")
        path.set_ylabel("centre upwards [mm]")
        path.set_aspect("equal", adjustable="datalim")
        handles = [Line2D([], [], color=STATES[name], lw=3, label=name) for name in STATES if name in states]
        handles.append(Line2D([], [], color=BED, ls=_DASHES, lw=1.2, label="launch on rigid ground"))
        drawing.legend(handles=handles, loc="upper left", bbox_to_anchor=(0.075, 1.0), ncols=6)
        drawing.savefig(figures / "launch.png", dpi=_DPI)
    return figure(
        figures / "launch.png",
        title=f"The launch from {result['surface']}",
        caption="The planar model, events located in time. Left: speed of the centre; right: its path, both from the "
        "start of the torque until a little after it has left.",
    )


def _by_state(axis: Axes, x: NDArray[np.float64], y: NDArray[np.float64], states: NDArray[np.str_]) -> None:
    for low, high, name in state_runs(states):
        axis.plot(x[low : high + 1], y[low : high + 1], color=STATES.get(name, INK), lw=2.4)


# The page -------------------------------------------------------------------------------------------------------------


def _said(result: Mapping[str, Any], name: str, scale: float = 1.0, unit: str | None = None) -> str:
    entry = result["quantities"][name]
    if entry["value"] is None:
        return "none"
    words = short(scale * entry["value"], 3)
    shown = entry["unit"] if unit is None else unit
    return f"{words}{shown}" if shown in ("°", "") else f"{words} {shown}"


def _wheel_on_surface(result: Mapping[str, Any]) -> list[Tile]:
    """The wheel speed for the same distance from ground that gives, where one was sought and found."""
    if result["quantities"]["model_wheel_speed"]["value"] is None:
        return []
    said = _said(result, "model_wheel_speed")
    return [Tile(f"Wheel speed, {result['surface']}", said, "for that distance, planar model", second=True)]


def _page(result: Mapping[str, Any], drawn: list[Block]) -> Page:
    quantities, degrees = result["quantities"], math.degrees(1.0)
    tiles = [
        Tile("Wheel speed", _said(result, "wheel_speed"), quantities["wheel_speed"]["note"]),
        *_wheel_on_surface(result),
        Tile(
            "Launch, rigid ground", _said(result, "launch_speed"), f"at {_said(result, 'launch_angle', degrees, '°')}"
        ),
        Tile("Distance, rigid ground", _said(result, "distance"), f"in {_said(result, 'flight_time')}"),
        Tile(
            f"Launch from {result['surface']}",
            _said(result, "model_launch_speed"),
            f"at {_said(result, 'model_launch_angle', degrees, '°')}, planar model",
            second=True,
        ),
        Tile(
            f"Distance from {result['surface']}",
            _said(result, "model_distance"),
            "the same wheel",
            second=True,
        ),
    ]
    numbers = [
        (name, _value(entry["value"]), _unit(entry["unit"]), entry["origin"])
        for name, entry in result["numbers"].items()
    ]
    every = [
        (name, "null" if entry["value"] is None else _value(entry["value"]), _unit(entry["unit"]), entry["note"])
        for name, entry in quantities.items()
    ]
    again = [
        text(f"With hedgebed {result['version']}, in this folder:"),
        code("hedgebed hop run.toml"),
        text("The same settings give the same result.", small=True),
    ]
    return Page(
        title=str(result["title"]),
        lead=[f"hedgebed {result['version']}", "hop", str(result["actuator"]), str(result["surface"])],
        tiles=tiles,
        warnings=[str(warning)[:1].upper() + str(warning)[1:] for warning in result["warnings"]],
        sections=[
            Section("", [listing(result["departures"]["sentences"]), *drawn]),
            Section("The numbers", [table(("number", "value", "unit", "where from"), numbers, words=True)]),
            Section("Every number of the result", [table(("quantity", "value", "unit", "note"), every, words=True)]),
            Section("To do this again", again),
        ],
    )


def _value(value: float | None) -> str:
    return "–" if value is None else f"{value:.6g}"


def _unit(unit: str) -> str:
    return "" if unit == "1" else unit
