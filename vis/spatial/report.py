"""Plots, pictures and report of a platform in space: reads trajectory.csv, series, frames and result.json."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from vis.page.numbers import quantity
from vis.page.page import Block, Page, Section, Tile, code, figure, listing, table, text, write_page
from vis.page.style import BED, GREY, INK, MODEL, styled
from vis.page.tumble_series import read_columns
from vis.pictures.canvas import COLOURS
from vis.pictures.frames import frame_names
from vis.pictures.pictures import Pictures
from vis.spatial.film import NAME
from vis.spatial.pictures import ARROWS, draw_in_space
from vis.tumble.state_figures import draw_bands, draw_states, passages

__all__ = ["write_spatial_report"]

Array = NDArray[np.float64]
_AXES = (("x", BED), ("y", "#009E73"), ("z", MODEL))


def write_spatial_report(
    folder: str | Path,
    *,
    pictures: bool = True,
    colour: str = "displacement",
    film: bool = True,
    progress: Callable[[float], None] | None = None,
) -> Path:
    """Make figures/, film.gif and report.html of the folder of a run in space, and return the report.

    Args:
        folder: The run folder.
        pictures: Whether to draw the platform on its ground, where there are frames.
        colour: What grains are coloured by, a key of `vis.pictures.canvas.COLOURS`.
        film: Whether to make the film.
        progress: Called with the share that is done, 0 to 1.

    Raises FileNotFoundError where the folder has no trajectory.csv or result.json, ValueError for an unknown `colour`.
    """
    if colour not in COLOURS:
        raise ValueError(f"colour is {colour!r}; it must be one of {', '.join(COLOURS)}")
    tell = progress if progress is not None else lambda done: None
    home = Path(folder)
    result = json.loads((home / "result.json").read_text(encoding="utf-8"))
    path, states = read_columns(home / "trajectory.csv")
    motion = read_columns(home / "series" / "motion.csv")[0]
    figures = home / "figures"
    figures.mkdir(exist_ok=True)
    blocks = []
    for name, title, caption, draw in (
        ("path", "Where it goes", "Way of the centre of mass from its start, and its velocity.", _draw_path),
        ("turning", "How it turns", "Angular velocity in axes of the ground; speeds of its wheels.", _draw_turning),
        ("ground", "What the ground does", "Force on the platform, mean over 5 ms; depth of the deepest spike.",
         _draw_ground),
        ("energy", "The energy book", "Left: what the torques put in, what the platform gained, what the ground took. "
         "Right: what is left over of platform and exchange.", _draw_energy),
    ):  # fmt: skip
        with styled():
            draw(path, motion).savefig(figures / f"{name}.png", dpi=130)
        blocks.append(figure(figures / f"{name}.png", title=title, caption=caption))
    if len(states):  # an older folder has none
        blocks[1:1] = _states(home, path, states)
    tell(0.2)
    seen: list[Section] = []
    if pictures and NAME in frame_names(home):
        drawn = draw_in_space(
            [home], home, stem="space", by=colour, film=film, progress=lambda done: tell(0.2 + 0.75 * done)
        )
        seen = [_seen(drawn)]
    report = write_page(home / "report.html", _page(result, blocks, seen, len(path["t_s"])))
    tell(1.0)
    return report


def _states(home: Path, path: Mapping[str, Array], states: NDArray[np.str_]) -> list[Block]:
    """The states over time and turn, and on grains those of the spring-damper beside them."""
    turn, label = np.degrees(path["turn_rad"]), "turn from the start [degrees]"
    drawings = [(
        "states", "Pivot, slip, hop", "Left: the angle of the one turn from the start, at most 180 degrees. Right: "
        "state against it: stand (three spikes stick that are not in a line), pivot (those that stick lie in one line, "
        "or one does), slip (all that touch slide), hop (none touches).",
        draw_states(path["t_s"], turn, states, label=label),
    )]  # fmt: skip
    beside = home / "series" / "spring-damper.csv"
    if beside.exists():
        other, others = read_columns(beside)
        runs = [(path["t_s"], turn, states), (other["t_s"], np.degrees(other["turn_rad"]), others)]
        with styled():
            bands = draw_bands(runs, ("grains", "spring-damper"), label=label)
        caption = "The same trial on both: above the turn, below the states."
        drawings.append(("beside", "Grains and spring-damper", caption, bands))
    blocks = []
    for name, title, caption, drawing in drawings:
        with styled():
            drawing.savefig(home / "figures" / f"{name}.png", dpi=130)
        blocks.append(figure(home / "figures" / f"{name}.png", title=title, caption=caption))
    return blocks


# Figures --------------------------------------------------------------------------------------------------------------


def _panels(height: float) -> tuple[Figure, Any]:
    with mpl.rc_context({"figure.constrained_layout.use": True}):
        drawing = Figure(figsize=(8.6, height))
    FigureCanvasAgg(drawing)
    return drawing, drawing.subplots(1, 2)


def _draw_path(path: Mapping[str, Array], motion: Mapping[str, Array]) -> Figure:
    drawing, (way, speed) = _panels(3.2)
    for axis, colour in _AXES:
        way.plot(path["t_s"], 1e3 * (path[f"{axis}_m"] - path[f"{axis}_m"][0]), color=colour, label=axis)
        speed.plot(path["t_s"], path[f"v{axis}_m_s"], color=colour)
    way.set_xlabel("time [s]")
    way.set_ylabel("way of the centre of mass [mm]")
    speed.set_xlabel("time [s]")
    speed.set_ylabel("velocity [m/s]")
    drawing.legend(handles=way.lines, loc="outside upper left", ncols=3)
    return drawing


def _draw_turning(path: Mapping[str, Array], motion: Mapping[str, Array]) -> Figure:
    drawing, (spin, wheels) = _panels(3.2)
    for axis, colour in _AXES:
        spin.plot(path["t_s"], path[f"w{axis}_rad_s"], color=colour, label=axis)
        wheels.plot(motion["t_s"], motion[f"wheel_{axis}_rad_s"], color=colour)
    spin.set_xlabel("time [s]")
    spin.set_ylabel("angular velocity [rad/s]")
    wheels.set_xlabel("time [s]")
    wheels.set_ylabel("wheels [rad/s]")
    drawing.legend(handles=spin.lines, loc="outside upper left", ncols=3)
    return drawing


def _draw_ground(path: Mapping[str, Array], motion: Mapping[str, Array]) -> Figure:
    drawing, (force, depth) = _panels(3.2)
    time = motion["t_s"]
    window = max(1, round(5e-3 / float(np.median(np.diff(time))))) if len(time) > 1 else 1
    kernel = np.ones(min(window, len(time)))
    held = np.convolve(np.ones(len(time)), kernel, mode="same")  # fewer at both ends
    for axis, colour in _AXES:
        mean = np.convolve(motion[f"f{axis}_N"], kernel, mode="same") / held
        force.plot(time, mean, color=colour, label=axis)
    depth.plot(time, 1e3 * motion["sinkage_m"], color=INK)
    depth.invert_yaxis()
    force.set_xlabel("time [s]")
    force.set_ylabel("force of the ground [N]")
    depth.set_xlabel("time [s]")
    depth.set_ylabel("sinkage of the deepest spike [mm]")
    drawing.legend(handles=force.lines, loc="outside upper left", ncols=3)
    return drawing


def _draw_energy(path: Mapping[str, Array], motion: Mapping[str, Array]) -> Figure:
    drawing, (book, left) = _panels(3.2)
    time = motion["t_s"]
    gained = 1e3 * (motion["kinetic_J"] + motion["potential_J"])
    gained = gained - gained[0]
    work, taken = 1e3 * motion["torque_work_J"], 1e3 * (motion["taken_J"] - motion["taken_J"][0])
    book.plot(time, work, color=BED, label="work of the torques")
    book.plot(time, gained, color=MODEL, ls=(0, (4, 2)), label="gained by the platform")
    book.plot(time, taken, color=GREY, ls=(0, (1, 1.2)), label="taken by the ground")
    left.plot(time, 1e3 * (gained - work + taken), color=INK, lw=1.0)
    book.set_xlabel("time [s]")
    book.set_ylabel("energy [mJ]")
    left.set_xlabel("time [s]")
    left.set_ylabel("left over [µJ]")
    drawing.legend(handles=book.lines, loc="outside upper left", ncols=3)
    return drawing


# Pictures -------------------------------------------------------------------------------------------------------------


def _seen(drawn: Pictures) -> Section:
    film = [drawn.animation] if drawn.animation is not None else []
    blocks = [figure(one.file, title=one.title, caption=one.caption, show_file=one in film)
              for one in (*film, *drawn.stills)]  # fmt: skip
    return Section("Seen", [*blocks, text(ARROWS, small=True), *(text(note) for note in drawn.notes)])


# The page -------------------------------------------------------------------------------------------------------------


def _page(result: Mapping[str, Any], drawn: list[Block], seen: list[Section], row_count: int) -> Page:
    quantities = result["quantities"]
    tiles = [
        Tile("Largest speed", quantity(quantities["max_speed"]), "of the centre of mass"),
        Tile("Largest angular velocity", quantity(quantities["max_angular_velocity"]), ""),
        Tile("Deepest", quantity(quantities["sinkage_largest"]), "of any spike"),
        Tile("Energy left over", quantity(quantities["energy_residual"]), "of all there was", second=True),
    ]
    numbers = [
        (name, "–" if entry["value"] is None else f"{entry['value']:.6g}", _unit(entry["unit"]), entry["origin"])
        for name, entry in result["trial"].items()
    ]
    beside = (result.get("grains") or {}).get("beside")
    head = ("quantity", "value", *(("spring-damper",) if beside else ()), "unit", "note")
    every = [
        (name, _value(entry), *((_value(beside.get(name)),) if beside else ()), _unit(entry["unit"]),
         entry.get("note", ""))
        for name, entry in quantities.items()
    ]  # fmt: skip
    facts, told = [], result.get("transitions")  # an older folder has none
    if "grains" in result:
        grains = result["grains"]
        facts = [text(
            f"{grains['mode']}. {grains['grain_count']} grains, packing {grains['packing_fraction']:.3g}, E = "
            f"{grains['young'] / 1e6:.3g} MPa, step {1e6 * grains['time_step']:.3g} µs; largest overlap "
            f"{100 * grains['max_overlap']:.2g} %.", small=True,
        )]  # fmt: skip
    return Page(
        title=str(result["title"]),
        lead=[f"hedgebed {result['version']}", "tumble spatial", f"{result['duration']:g} s", f"{row_count} rows"],
        tiles=tiles,
        warnings=[str(warning)[:1].upper() + str(warning)[1:] for warning in result["warnings"]],
        sections=[
            Section("", [listing(result["departures"]["sentences"]), *drawn, *facts]),
            *seen,
            *([Section("Transitions", passages(told, angle="turn", label="turn [degrees]"))] if told else []),
            Section("The trial", [table(("number", "value", "unit", "where from"), numbers, words=True)]),
            Section("Every number of the result", [table(head, every, words=True)]),
            Section("To do this again", [
                text(f"With hedgebed {result['version']}, in this folder:"),
                code("hedgebed tumble spatial run.toml"),
            ]),
        ],
    )  # fmt: skip


def _value(entry: Mapping[str, Any] | None) -> str:
    return "–" if entry is None or entry["value"] is None else f"{entry['value']:.6g}"


def _unit(unit: str) -> str:
    return "" if unit == "1" else unit
