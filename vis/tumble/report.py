"""Plots, animation and report of a tumble: reads trajectory.csv, series/motion.csv, result.json and run.toml."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from vis.page.numbers import quantity, short
from vis.page.page import Block, Page, Section, Tile, code, figure, table, text, write_page
from vis.page.style import BED, GREY, INK, MODEL, styled
from vis.page.tumble_series import STATES, read_columns, state_runs
from vis.pictures.pictures import Pictures
from vis.tumble.beside import HEAD
from vis.tumble.grains import grains_section
from vis.tumble.state_figures import by_state, draw_states, legend_of_states, panels, passages
from vis.tumble.sweep import sweep_section

__all__ = ["STATES", "read_columns", "state_runs", "write_tumble_report"]

Array = NDArray[np.float64]

_DPI = 130
_FOLLOWED = 1.2
"""How far from its start the animation follows the centre [m]."""
_JOULES = (("mJ", 1.0), ("µJ", 1e3), ("nJ", 1e6), ("pJ", 1e9), ("fJ", 1e12))
"""Units of energy, and how many of them a mJ has."""


def write_tumble_report(
    folder: str | Path,
    *,
    pictures: bool | None = None,
    colour: str = "displacement",
    film: bool = True,
    progress: Callable[[float], None] | None = None,
) -> Path:
    """Make figures/, animation.gif and report.html of the folder of a tumble, and return the report.

    Args:
        folder: The run folder.
        pictures: Whether to draw the platform on its ground in space, stills and film; None: where there are grains.
        colour: What grains are coloured by, a key of `vis.pictures.canvas.COLOURS`.
        film: Whether to make the film.
        progress: Called with the share that is done, 0 to 1.

    Raises FileNotFoundError where the folder has no trajectory.csv or result.json.
    """
    tell = progress if progress is not None else lambda done: None
    folder = Path(folder)
    result = json.loads((folder / "result.json").read_text(encoding="utf-8"))
    numbers, states = read_columns(folder / "trajectory.csv")
    motion, _ = read_columns(folder / "series" / "motion.csv")
    figures = folder / "figures"
    figures.mkdir(exist_ok=True)
    drawn = []
    for index, draw in enumerate((_draw_trajectory, _draw_states, _draw_energy)):
        name, title, caption, drawing = draw(result, numbers, states, motion)
        with styled():
            drawing.savefig(figures / f"{name}.png", dpi=_DPI)
        drawn.append(figure(figures / f"{name}.png", title=title, caption=caption))
        tell(0.1 * (index + 1))
    moving = _animate(folder / "animation.gif", result, numbers, states)
    tell(0.4)
    page = _page(folder, result, drawn, moving, len(numbers["t_s"]))
    if "sweep" in result:
        swept, _ = read_columns(folder / result["sweep"]["file"])
        page = replace(page, sections=[sweep_section(result, figures, swept), *page.sections])
    if "footfalls" in result:
        own = [shown for shown in result["tables"] if tuple(shown["head"]) != HEAD]
        listed = [table(shown["head"], shown["rows"], title=shown["title"]) for shown in own]
        page = replace(page, sections=[*page.sections[:1], Section("Tumble by tumble", listed), *page.sections[1:]])
    if "grains" in result:
        tables = {name: read_columns(folder / file) for name, file in result["grains"]["series"].items()}
        tables["motion"] = motion, states
        page = replace(page, sections=[*page.sections[:1], grains_section(result, figures, tables), *page.sections[1:]])
    if pictures if pictures is not None else "grains" in result and (folder / "frames" / "tumble.pvd").exists():
        from vis.tumble.pictures import make_tumble_pictures

        drawn_apart = make_tumble_pictures(folder, by=colour, film=film, progress=lambda done: tell(0.4 + 0.55 * done))
        page = replace(page, sections=[*page.sections[:1], _seen(drawn_apart), *page.sections[1:]])
    report = write_page(folder / "report.html", page)
    tell(1.0)
    return report


def _seen(drawn: Pictures) -> Section:
    """The section of pictures in space."""
    film = [drawn.animation] if drawn.animation is not None else []
    blocks = [figure(one.file, title=one.title, caption=one.caption, show_file=one in film)
              for one in (*film, *drawn.stills)]  # fmt: skip
    camera = (
        "In front of the spikes' plane the grains are left out. Red arrows: the force on a row, to the scale of the "
        "weight's above the picture; one that would leave the picture ends at its edge, with its number. The black "
        "line from the centre to where row 0 begins shows how far the platform has turned."
    )
    return Section("Seen from near", [*blocks, text(camera, small=True), *(text(note) for note in drawn.notes)])


# Figures --------------------------------------------------------------------------------------------------------------

Drawn = tuple[str, str, str, Figure]


def _draw_trajectory(
    result: Mapping[str, Any], numbers: Mapping[str, Array], states: NDArray[np.str_], motion: Mapping[str, Array]
) -> Drawn:
    time = numbers["t_s"]
    far = max(float(np.ptp(numbers["x_m"])), float(np.ptp(numbers["y_m"])))
    unit, scale = ("m", 1.0) if far > 2.0 else ("mm", 1e3)
    x, y = scale * numbers["x_m"], scale * numbers["y_m"]
    angle = _value(result, "trajectory_angle")
    with styled():
        drawing, (path, rates) = panels(2, 3.5, widths=(1.25, 1.0), right=0.925)
        by_state(path, x, y, states, lw=2.4, solid_capstyle="round")
        path.plot(x[:1], y[:1], "o", color=INK, ms=4)
        more: tuple[Line2D, ...] = ()
        if angle is not None:
            reach = 0.35 * scale * max(far, 0.01)
            path.plot(
                x[0] + np.array([0, reach]) * math.cos(angle),
                y[0] + np.array([0, reach]) * math.sin(angle),
                color=INK,
                lw=1.0,
                ls=(0, (4, 3)),
            )
            label = f"trajectory angle {short(math.degrees(angle), 3)}°"
            more = (Line2D([], [], color=INK, lw=1.0, ls=(0, (4, 3)), label=label),)
        path.ticklabel_format(useOffset=False)
        if far < 1e-4:  # it has not moved to speak of
            half = max(1.5 * scale * far, 1e-3)
            path.set_xlim(x[0] - half, x[0] + half)
            path.set_ylim(y[0] - half, y[0] + half)
            path.locator_params(nbins=5)
        else:
            path.set_aspect("equal", adjustable="datalim")
            path.margins(0.08)
        path.set_xlabel(f"x of the centre [{unit}]")
        path.set_ylabel(f"y of the centre above the surface [{unit}]")
        speed = np.hypot(numbers["vx_m_s"], numbers["vy_m_s"])
        by_state(rates, time, speed, states, lw=1.8)
        rates.set_xlabel("time [s]")
        rates.set_ylabel("speed of the centre [m/s]")
        rates.set_ylim(bottom=0.0)
        other = rates.twinx()
        other.plot(time, numbers["omega_rad_s"], color=INK, lw=1.1, ls=(0, (1, 1.2)))
        other.set_ylabel("dθ/dt [rad/s], dotted")
        for axis in (rates, other):  # small numbers in powers of ten: their digits would leave no room for the labels
            axis.ticklabel_format(axis="y", scilimits=(-2, 4))
        other.grid(False)
        other.spines["right"].set_visible(True)
        legend_of_states(drawing, states, more)
    shape = " in proportion" if far >= 1e-4 else ", heights stretched"
    caption = (
        f"Left: path of the geometric centre{shape}, coloured by state, from the dot on. Right: speed of the "
        "centre, and angular velocity (dotted)."
    )
    return "trajectory", "The path", caption, drawing


def _draw_states(
    result: Mapping[str, Any], numbers: Mapping[str, Array], states: NDArray[np.str_], motion: Mapping[str, Array]
) -> Drawn:
    drawing = draw_states(numbers["t_s"], np.degrees(numbers["theta_rad"]), states)
    caption = (
        "Left: the angle over time. Right: state against angle, as in Figure 6 of the paper: stand (two or more spikes "
        "stick), pivot (one sticks), slip (all that touch slide), hop (none touches)."
    )
    return "states", "Pivot, slip, hop", caption, drawing


def _draw_energy(
    result: Mapping[str, Any], numbers: Mapping[str, Array], states: NDArray[np.str_], motion: Mapping[str, Array]
) -> Drawn:
    time = motion["t_s"]
    gained = 1e3 * (motion["energy_J"] - motion["energy_J"][0])
    work, lost = 1e3 * motion["torque_work_J"], 1e3 * motion["dissipated_J"]
    with styled():
        drawing, (book, rest) = panels(2, 3.0)
        book.plot(time, work, color=BED, label="work of the torque")
        book.plot(time, gained, color=MODEL, ls=(0, (4, 2)), label="energy gained")
        book.plot(time, lost, color=GREY, ls=(0, (1, 1.2)), label="dissipated")
        book.set_xlabel("time [s]")
        book.set_ylabel("energy [mJ]")
        drawing.legend(handles=book.lines, loc="upper left", bbox_to_anchor=(0.075, 1.0), ncols=3)
        residual = gained - work + lost
        most = float(np.abs(residual).max())
        unit, scale = next(((u, k) for u, k in _JOULES if most * k >= 0.999), _JOULES[-1])
        rest.plot(time, scale * residual, color=INK, lw=1.0)
        rest.set_xlabel("time [s]")
        rest.set_ylabel(f"gained − work + dissipated [{unit}]")
    own = result["quantities"].get("coupling_residual")
    residual_words = quantity(own if own is not None else result["quantities"].get("energy_residual"))
    caption = (
        f"Left: what the torque put in, what the platform, counterweight and surface hold, and what friction and "
        f"damping took. Right: what is left over. Its largest, over the work of the torque or W l, is {residual_words}."
    )
    return "energy", "The energy book", caption, drawing


# Animation ------------------------------------------------------------------------------------------------------------


def _animate(path: Path, result: Mapping[str, Any], numbers: Mapping[str, Array], states: NDArray[np.str_]) -> Path:
    """The section of the platform on its way, as a GIF in real time, at most some 60 frames."""
    time, x, y, theta = (numbers[name] for name in ("t_s", "x_m", "y_m", "theta_rad"))
    beyond = np.flatnonzero(np.hypot(x - x[0], y - y[0]) > _FOLLOWED)
    if len(beyond):
        time, x, y, theta = (values[: beyond[0] + 1] for values in (time, x, y, theta))
    length = float(result["trial"]["spike_length"]["value"])
    count = int(result.get("spike_count", 8))
    frame_count = int(min(60, max(2, 25 * time[-1])))
    rows = np.unique(np.searchsorted(time, np.linspace(0.0, time[-1], frame_count)).clip(0, len(time) - 1))
    low_x, high_x = float(x.min()) - 1.35 * length, float(x.max()) + 1.35 * length
    high_y = float(y.max()) + 1.25 * length
    low_y = min(-0.12 * length, float(y.min()) - 1.25 * length)
    scale = min(720 / (high_x - low_x), 480 / (high_y - low_y))
    size = (int(scale * (high_x - low_x)) & ~1, int(scale * (high_y - low_y)) & ~1)
    palette = ["#ffffff", "#ece6dc", "#786e64", "#fafafa", "#5a5a5a", "#c8c8c8", INK, *STATES.values()]
    white, soil, edge, shell, metal, mark, ink = range(7)
    pens = {name: 7 + place for place, name in enumerate(STATES)}

    def page(px: Any, py: Any) -> list[tuple[float, float]]:
        return list(
            zip((np.atleast_1d(px) - low_x) * scale, size[1] - (np.atleast_1d(py) - low_y) * scale, strict=True)
        )

    frames = []
    for row in rows:
        image = Image.new("P", size, white)
        image.putpalette([int(colour[k : k + 2], 16) for colour in palette for k in (1, 3, 5)])
        draw = ImageDraw.Draw(image)
        ((_, ground),) = page(0.0, 0.0)
        draw.rectangle((0, ground, size[0], size[1]), fill=soil)
        draw.line((0, ground, size[0], ground), fill=edge, width=2)
        pen = pens.get(str(states[row]), ink)
        angles = theta[row] + math.pi / count + 2 * math.pi / count * np.arange(count)
        tips = page(x[row] - length * np.sin(angles), y[row] - length * np.cos(angles))
        hull = page(x[row] - 0.82 * length * np.sin(angles), y[row] - 0.82 * length * np.cos(angles))
        draw.polygon(hull, fill=shell, outline=metal)
        (centre,) = page(x[row], y[row])
        for inner, tip in zip(hull, tips, strict=True):
            draw.line((*inner, *tip), fill=metal, width=5)
        draw.line((*centre, *hull[0]), fill=mark, width=2)
        trail = page(x[: row + 1 : 4], y[: row + 1 : 4])
        if len(trail) > 1:
            draw.line(trail, fill=pen, width=2)
        draw.ellipse((centre[0] - 4, centre[1] - 4, centre[0] + 4, centre[1] + 4), fill=pen)
        draw.text((10, 8), f"t = {time[row]:.2f} s   {states[row]}", fill=pen, font_size=18)
        frames.append(image)
    pause = int(round(1000 * time[-1] / max(1, len(rows) - 1) / 10) * 10)
    frames[0].save(path, save_all=True, append_images=frames[1:], duration=max(20, pause), loop=0, optimize=False)
    return path


# The page -------------------------------------------------------------------------------------------------------------


def _value(result: Mapping[str, Any], name: str) -> float | None:
    return (result.get("quantities") or {}).get(name, {}).get("value")


def _degrees(value: float | None) -> str:
    return "none" if value is None else f"{short(math.degrees(value), 3)}°"


def _page(folder: Path, result: Mapping[str, Any], drawn: list[Block], moving: Path, row_count: int) -> Page:
    quantities = result["quantities"]
    tiles = [
        Tile("Trajectory angle", _degrees(_value(result, "trajectory_angle")), "of the first 10 mm"),
        Tile("Largest speed", quantity(quantities["max_speed"]), "of the centre"),
        Tile("Largest angular velocity", quantity(quantities["max_angular_velocity"]), ""),
        Tile("Slips from", _degrees(_value(result, "transition_angle_slip")), "θ at the first slip", second=True),
        Tile("Hops from", _degrees(_value(result, "transition_angle_hop")), "θ at the first hop", second=True),
    ]
    rows = [
        (name, f"{entry['value']:.6g}" if entry["value"] is not None else "–", _unit(entry["unit"]), entry["origin"])
        for name, entry in result["trial"].items()
    ]
    effects = [
        f"{effect['id']} ({', '.join(f'{key} = {value:g}' for key, value in effect['parameters'].items())})"
        for effect in result["effects"]
    ]
    animation = figure(
        moving,
        title="The section of the platform on its way",
        caption=f"In real time, until the centre is {_FOLLOWED:g} m away; a spike stands for the row at its corner. "
        "The dot is the centre, behind it the way it has come, both in the colour of the state of that moment.",
        half=True,
        show_file=True,
    )
    settled = [
        table(("number", "value", "unit", "where from"), rows, words=True),
        text(
            f"Ground: {result['ground']}. Actuator: {result['actuator']}. Integrator: {result['method']}. "
            f"Terms beyond the base model: {', '.join(effects) if effects else 'none'}.",
        ),
    ]
    every = table(
        ("quantity", "value", "unit", "note"),
        [
            (name, "null" if q["value"] is None else f"{q['value']:.6g}", _unit(q["unit"]), q.get("note", ""))
            for name, q in quantities.items()
        ],
        words=True,
    )
    return Page(
        title=str(result["title"]),
        lead=[f"hedgebed {result['version']}", "tumble", f"{result['duration']:g} s", f"{row_count} rows"],
        tiles=tiles,
        warnings=[str(warning)[:1].upper() + str(warning)[1:] for warning in result["warnings"]],
        sections=[
            Section("", [drawn[0], drawn[1], animation]),
            Section("Transitions", passages(result["transitions"], angle="theta", label="θ [degrees]")),
            Section("Energy", [drawn[2]]),
            Section("The trial", settled),
            Section("Every number of the result", [every]),
            Section(
                "To do this again",
                [
                    text(f"With hedgebed {result['version']}, in this folder:"),
                    code("hedgebed tumble run.toml"),
                    text("The same settings give the same trajectory.csv.", small=True),
                ],
            ),
        ],
    )


def _unit(unit: str) -> str:
    return "" if unit == "1" else unit
