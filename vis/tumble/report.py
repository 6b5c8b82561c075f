"""Plots, animation and report of a tumble: reads trajectory.csv, series/motion.csv, result.json and run.toml."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.colors import TwoSlopeNorm
from matplotlib.figure import Figure
from PIL import Image, ImageDraw

from vis.film.film import draw_runs, shown
from vis.film.reel import Reel
from vis.page.folder import read_columns
from vis.page.numbers import quantity, short
from vis.page.page import Block, Section, figure, listing, table, text
from vis.page.plots import BED, DASHED, DOTTED, GREY, INK, MODEL, STATES, Array, handle, legend_above, sheet
from vis.page.report import Report, Result, given, report_of, tables, terms_text
from vis.page.sentences import Sentences
from vis.page.states import States, by_state, draw_states, legend_of_states, panels, passages
from vis.pictures.canvas import COLOURS, nice_above
from vis.pictures.pictures import Picture
from vis.tumble.answer import answer_tiles
from vis.tumble.beside import HEAD
from vis.tumble.grains import grains_section
from vis.view.page import report_scene

__all__ = ["draw_tracks", "write_tumble_report"]

say = Sentences(__package__)
Columns = Mapping[str, Array]
_LONGEST_MAP = 40.0
"""Length over width of a map that is drawn to scale."""
_FOLLOWED = 1.2
"""How far from its start the animation follows the centre [m]."""
_JOULES = (("mJ", 1.0), ("µJ", 1e3), ("nJ", 1e6), ("pJ", 1e9), ("fJ", 1e12))
"""Units of energy, and how many of them a mJ has."""


@report_of(dpi=130, named=True)
def write_tumble_report(
    report: Report, *, pictures: bool | None = None, colour: str = "displacement", film: bool = True
) -> Path:
    """Make figures/, animation.gif and report.html of the folder of a tumble, and return the report.

    ``pictures``: Whether to draw the platform on its ground in space, stills and film; None: where there are grains.
    On a law None gives the scene alone, which can be turned.
    ``colour``: What grains are coloured by, a key of `vis.pictures.canvas.COLOURS`. ``film``: Whether to make the film.
    Raises FileNotFoundError where the folder has no trajectory.csv or result.json.
    """
    home, result = report.folder, report.result
    numbers, states = read_columns(home / "trajectory.csv")
    path = _trajectory(report, numbers, states)
    turned = report.draw("states", draw_states(numbers["t_s"], np.degrees(numbers["theta_rad"]), states))
    energy = _energy(report)
    title, caption = report.captions("moving.title"), report.captions("moving.caption", far=_FOLLOWED)
    movie = _animate(home / "animation.gif", result, numbers, states)
    moving = figure(movie, title=title, caption=caption, half=True, show_file=True)
    settled = f"Ground: {result['ground']}. Actuator: {result['actuator']}. Integrator: {result['method']}."
    sections = [
        Section("", [listing(result["departures"]["sentences"]), path, turned, moving]),
        Section("Transitions", passages(result["transitions"], angle="theta", label="θ [degrees]")),
        Section("Energy", [energy]),
        Section("The trial", [given(result["trial"]), text(f"{settled} {terms_text(result)}")]),
        report.numbers(std="ground_file" in result or "law_spread" in result),
        report.again("hedgebed tumble run.toml", "trajectory.csv"),
    ]
    if "sweep" in result:
        sections.insert(0, _sweep_section(report))
    if "footfalls" in result:
        own = [t for t in result["tables"] if tuple(t["head"]) != HEAD]
        listed = [table(t["head"], t["rows"], title=t["title"]) for t in own]
        sections.insert(1, Section("Tumble by tumble", listed))
    if "grains" in result:
        sections.insert(1, grains_section(report))
    if pictures if pictures is not None else "grains" in result and (home / "frames" / "tumble.pvd").exists():
        sections.insert(1, _seen(report, colour, film))
    elif pictures is None and "grains" not in result and "weight" in result["trial"]:  # an older folder has none
        sections.insert(1, Section("Scene", report_scene(report.folder)))
    lead = ["tumble", f"{result['duration']:g} s", f"{len(numbers['t_s'])} rows"]
    return report.write(sections, lead=lead, tiles=answer_tiles(result))


def _seen(report: Report, colour: str, film: bool) -> Section:
    """The platform on its ground, which is a block where there are no frames; the tracks that it leaves in a bed."""
    if colour not in COLOURS:
        raise ValueError(f"colour is {colour!r}; it must be one of {', '.join(COLOURS)}")
    reel = Reel(report.folder)
    drawn = draw_runs([reel], report.folder, "tumble", by=colour, film=film, progress=report.rest())
    if reel.frames is not None and "surface" in reel.frame(len(reel) - 1).maps:
        drawn.stills.append(draw_tracks(reel, report.figures / "tracks.png"))
    notes = [text(say("camera"), small=True), *(text(note) for note in drawn.notes)]
    return Section("Close-up", [*report_scene(report.folder), *shown(drawn), *notes])


def _value(result: Result, name: str) -> float | None:
    return (result.get("quantities") or {}).get(name, {}).get("value")


def _trajectory(report: Report, numbers: Columns, states: States) -> Block:
    far = max(float(np.ptp(numbers["x_m"])), float(np.ptp(numbers["y_m"])))
    height = 3.8
    drawing, (path, rates) = panels(2, height, widths=(1.25, 1.0), right=0.925)
    drawing.subplots_adjust(top=1 - 0.5 / height)  # below the legend there is room for powers of ten
    label = _draw_path(path, numbers, states, far, _value(report.result, "trajectory_angle"))
    more = (handle(label, INK, lw=1.0, ls=(0, (4, 3))),) if label else ()
    speed = np.hypot(numbers["vx_m_s"], numbers["vy_m_s"])
    unit, scale = ("m/s", 1.0) if float(speed.max()) >= 1.0 else ("mm/s", 1e3)
    by_state(rates, numbers["t_s"], scale * speed, states, lw=1.8)
    rates.set(xlabel="time [s]", ylabel=f"speed of the centre [{unit}]", ylim=(0.0, None))
    other = rates.twinx()
    other.plot(numbers["t_s"], numbers["omega_rad_s"], color=INK, lw=1.1, ls=DOTTED)
    other.set_ylabel("dθ/dt [rad/s], dotted")
    for axis in (rates, other):  # small numbers in powers of ten: their digits would leave no room for the labels
        axis.ticklabel_format(axis="y", scilimits=(-2, 4))
    other.grid(False)
    other.spines["right"].set_visible(True)
    legend_of_states(drawing, states, more)
    shape = " in proportion" if far >= 1e-4 else ", heights stretched"
    return report.draw("trajectory", drawing, shape=shape)


def _draw_path(path: Axes, numbers: Columns, states: States, far: float, angle: float | None) -> str:
    """The way of the centre; what to call the line of its first direction, "" where there is none."""
    unit, scale = ("m", 1.0) if far > 2.0 else ("mm", 1e3)
    x, y = scale * numbers["x_m"], scale * numbers["y_m"]
    by_state(path, x, y, states, lw=2.4, solid_capstyle="round")
    path.plot(x[:1], y[:1], "o", color=INK, ms=4)
    if angle is not None:
        reach = np.array([0, 0.35 * scale * max(far, 0.01)])
        path.plot(x[0] + reach * math.cos(angle), y[0] + reach * math.sin(angle), color=INK, lw=1.0, ls=(0, (4, 3)))
    path.ticklabel_format(useOffset=False)
    if far < 1e-4:  # it has not moved to speak of
        half = max(1.5 * scale * far, 1e-3)
        path.set(xlim=(x[0] - half, x[0] + half), ylim=(y[0] - half, y[0] + half))
        path.locator_params(nbins=5)
    else:
        path.set_aspect("equal", adjustable="datalim")
        path.margins(0.08)
    path.set(xlabel=f"x of the centre [{unit}]", ylabel=f"y of the centre above the surface [{unit}]")
    return "" if angle is None else f"trajectory angle {short(math.degrees(angle), 3)}°"


def _energy(report: Report) -> Block:
    result, motion = report.result, report.columns("series/motion.csv")
    time = motion["t_s"]
    gained = 1e3 * (motion["energy_J"] - motion["energy_J"][0])
    work, lost = 1e3 * motion["torque_work_J"], 1e3 * motion["dissipated_J"]
    drawing, (energy, rest) = panels(2, 3.0)
    energy.plot(time, work, color=BED, label="work of the torque")
    energy.plot(time, gained, color=MODEL, ls=DASHED, label="energy gained")
    energy.plot(time, lost, color=GREY, ls=DOTTED, label="dissipated")
    energy.set(xlabel="time [s]", ylabel="energy [mJ]")
    drawing.legend(handles=energy.lines, loc="upper left", bbox_to_anchor=(0.075, 1.0), ncols=3)
    residual = gained - work + lost
    most = float(np.abs(residual).max())
    unit, scale = next(((u, k) for u, k in _JOULES if most * k >= 0.999), _JOULES[-1])
    rest.plot(time, scale * residual, color=INK, lw=1.0)
    rest.set(xlabel="time [s]", ylabel=f"gained − work + dissipated [{unit}]")
    own = result["quantities"].get("coupling_residual")
    residual_words = quantity(own if own is not None else result["quantities"].get("energy_residual"))
    return report.draw("energy", drawing, residual_words=residual_words)


def _animate(path: Path, result: Result, numbers: Columns, states: States) -> Path:
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


def draw_tracks(reel: Reel, file: Path) -> Picture:
    """What the platform has left in the bed: the change of its surface at the end, from above, and along the spikes."""
    assert reel.frames is not None
    last = reel.frame(len(reel) - 1)
    grid = last.maps["surface"]
    change = 1e3 * np.asarray(grid.fields["change"], dtype=float)
    x = 1e3 * (grid.origin[0] + grid.spacing[0] * np.arange(change.shape[1]) - reel.origin[0])
    y = 1e3 * (grid.origin[1] + grid.spacing[1] * np.arange(change.shape[0]) - reel.cut)
    # Single grains that roll count less than what a spike's width of them did.
    most = nice_above(float(np.percentile(np.abs(change), 99.5)))
    drawing, ((above,), (along,)) = sheet(2, 1, 4.6, sharex=True, height_ratios=(1.0, 1.3))
    picture = above.pcolormesh(x, y, change, norm=TwoSlopeNorm(0.0, -most, most), cmap="RdBu", rasterized=True)
    if np.ptp(x) <= _LONGEST_MAP * np.ptp(y):
        above.set(aspect="equal", ylabel="across [mm]")
    else:  # in its true shape it would be a thread
        above.set_ylabel("across [mm], stretched")
    above.grid(False)
    bar = drawing.colorbar(picture, ax=[above, along], shrink=0.6, extend="both")
    bar.set_label("change of the surface's height [mm]")
    wide = max(reel.spikes[0], 2.0 * float(grid.spacing[1]))  # of the strip [m]: two columns of the map at least
    strip = np.abs(y) <= 0.5e3 * wide
    ages = colormaps["viridis_r"]
    for index in np.unique(np.linspace(1, len(reel) - 1, 4).round().astype(int)):
        now = reel.frame(int(index))
        mean = 1e3 * np.asarray(now.maps["surface"].fields["change"], dtype=float)[strip].mean(axis=0)
        colour = ages(0.15 + 0.8 * (index / (len(reel) - 1)))
        along.plot(x, mean, lw=1.2, label=f"{reel.times[index]:.2f} s", color=colour)
    along.axhline(0.0, color=INK, lw=0.8, ls=(0, (5, 4)))
    along.set(xlabel="x from the start of the platform's centre [mm]", ylabel="mean under the spikes [mm]")
    legend_above(drawing, along.lines[:-1], 4)
    file.parent.mkdir(parents=True, exist_ok=True)
    drawing.savefig(file, dpi=130)
    caption = (
        "Above: by how much the top of the grains has risen or fallen since the torque began, from above, at the end. "
        f"Below: the same, mean over {1e3 * wide:.3g} mm across the spikes' way, at four times."
    )
    return Picture(file, "The tracks", caption)


# A sweep: figure and table of sweep.csv ------------------------------------------------------------------------------

_PANELS = (
    ("trajectory_angle_rad", 180 / math.pi, "trajectory angle [degrees]"),
    ("max_speed_m_s", 1.0, "largest speed [m/s]"),
    ("max_angular_velocity_rad_s", 1.0, "largest dθ/dt [rad/s]"),
)
_MOST_LINES = 7
"""Values of the other key that are drawn as lines; with more, colours stand for the numbers."""


def _sweep_section(report: Report) -> Section:
    """The section of the sweep, its figure drawn from the sweep's CSV file."""
    sweep = report.result["sweep"]
    drawing = _draw_sweep(sweep["keys"], report.columns(sweep["file"]))
    names = " and ".join(key["key"] for key in sweep["keys"])
    what, _, given = report.about.partition(": ")
    swept = {key["key"] for key in sweep["keys"]} & {"gravity", "rig"}
    gravity = [part for part in given.split(", ") if " at " in part and not swept]
    about = f"{', '.join([what, *gravity])}: {sweep['trials']} trials over {names}"
    drawn = report.draw("sweep", drawing, about=about, trials=sweep["trials"], names=names)
    made = tables(report.result) if "tables" in report.result else []
    return Section("The sweep", [drawn, *made, listing(sweep["sentences"])])


def _draw_sweep(keys: Sequence[Result], columns: Mapping[str, Array]) -> Figure:
    drawing, (axes,) = sheet(1, len(_PANELS), 3.0)
    shape = [len(key["values"]) for key in keys]
    if len(keys) == 1:
        for axis, (name, scale, label) in zip(axes, _PANELS, strict=True):
            axis.plot(columns[keys[0]["column"]], scale * columns[name], "o-", color=BED, ms=3.5, lw=1.4)
            _note_if_empty(axis, keys[0], columns[name])
            axis.set(xlabel=_words(keys[0]), ylabel=label)
        return drawing
    along, other = (0, 1) if shape[0] >= shape[1] else (1, 0)
    grids = [scale * np.moveaxis(columns[name].reshape(shape), along, 0) for name, scale, _ in _PANELS]
    if min(shape) > _MOST_LINES:
        for axis, grid, (_, _, label) in zip(axes, grids, _PANELS, strict=True):
            mesh = axis.pcolormesh(keys[along]["values"], keys[other]["values"], grid.T, shading="nearest")
            bar = drawing.colorbar(mesh, ax=axis, location="top", shrink=0.95)
            bar.set_label(label)
            axis.set_xlabel(_words(keys[along]))
            axis.grid(False)
        axes[0].set_ylabel(_words(keys[other]))
        return drawing
    colours = [colormaps["viridis"](share) for share in np.linspace(0.0, 0.88, min(shape))]
    for axis, grid, (_, _, label) in zip(axes, grids, _PANELS, strict=True):
        for values, colour, value in zip(grid.T, colours, keys[other]["values"], strict=True):
            axis.plot(keys[along]["values"], values, "o-", color=colour, ms=3, lw=1.3, label=f"{value:g}")
        _note_if_empty(axis, keys[along], grid)
        axis.set(xlabel=_words(keys[along]), ylabel=label)
    legend_above(drawing, axes[0].lines, _MOST_LINES, title=_words(keys[other]))
    return drawing


def _words(key: Result) -> str:
    return key["key"] if key["unit"] == "1" else f"{key['key']} [{key['unit']}]"


def _note_if_empty(axis: Axes, key: Result, values: Array) -> None:
    if np.isnan(values).all():
        axis.set_xlim(min(key["values"]), max(key["values"]))
        axis.set_yticks([])
        axis.text(0.5, 0.5, "never 10 mm away", transform=axis.transAxes, ha="center", va="center")
