"""The report of two runs side by side: reads the comparison's folder, and for pictures those of the runs."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from vis.folder import read_folder
from vis.numbers import short
from vis.page import Block, Page, Section, Tile, code, figure, listing, table, text, write_page
from vis.reel import Reel
from vis.style import BED, GREY, INK, MODEL, as_it_lies, styled
from vis.tumble_pictures import draw_reels, moments
from vis.tumble_series import STATES, state_runs

__all__ = ["write_compare_report"]

Array = NDArray[np.float64]
_LINES: tuple[dict[str, Any], dict[str, Any]] = (
    {"color": BED, "lw": 1.7},
    {"color": MODEL, "lw": 1.4, "ls": (0, (4, 2))},
)
"""Of the first run and of the second, which is dashed as well."""
_ROWS = (BED, "#E69F00", "#009E73", "#CC79A7", GREY, "#56B4E9", INK, MODEL)
_DPI = 130


def write_compare_report(folder: str | Path, *, progress: Callable[[float], None] | None = None) -> Path:
    """Make figures/ and report.html (of tumbles also stills and film.gif) of a comparison, and return the report.

    Raises FileNotFoundError where the folder has no result.json, or a run is gone whose pictures are asked for.
    """
    tell = progress if progress is not None else lambda done: None
    home = Path(folder)
    result = json.loads((home / "result.json").read_text(encoding="utf-8"))
    labels = (result["runs"][0]["label"], result["runs"][1]["label"])
    (home / "figures").mkdir(exist_ok=True)
    sections: list[Section] = []
    if result["kind"] == "tumble":
        columns, states = _columns(home / result["series"])
        drawn = [_drawn(home, *plan) for plan in _plans(result, columns, states, labels)]
        tell(0.3)
        seen = _side_by_side(home, result, labels, lambda done: tell(0.3 + 0.65 * done)) if result["pictures"] else []
        sections = [
            Section("", [listing(result["departures"]["sentences"]), *drawn[:1]]),
            *([Section("Seen side by side", seen)] if seen else []),
            Section("States and angle", drawn[1:2]),
            Section("Into the ground", drawn[2:4]),
            Section("Energy", drawn[4:]),
        ]
    else:
        sections = [Section("", _drives(home, result, labels))]
    page = Page(
        title=f"Compared: {result['title']}",
        lead=[
            f"hedgebed {result['version']}",
            "compare",
            *(f"{run['label']}: {run['title']}" for run in result["runs"]),
        ],
        tiles=_tiles(result),
        warnings=[str(warning)[:1].upper() + str(warning)[1:] for warning in result["warnings"]],
        sections=[
            *sections,
            Section("Every number, side by side", [_numbers(result, labels)]),
            *([Section("What the two were given", [_given(result, labels)])] if result["differs"] else []),
            Section("To do this again", [text("In this folder:"), code("hedgebed compare run.toml")]),
        ],
    )
    report = write_page(home / "report.html", page)
    tell(1.0)
    return report


def _columns(path: Path) -> tuple[dict[str, Array], tuple[NDArray[np.str_], NDArray[np.str_]]]:
    """The columns of compared.csv, and the states of both."""
    head, *rows = [line.split(",") for line in path.read_text(encoding="utf-8").splitlines()]
    by_name = dict(zip(head, zip(*rows, strict=True), strict=True))
    numbers = {name: np.array(values, dtype=float) for name, values in by_name.items() if not name.startswith("state_")}
    return numbers, (np.array(by_name["state_1"]), np.array(by_name["state_2"]))


def _drawn(home: Path, name: str, title: str, caption: str, drawing: Figure) -> Block:
    path = home / "figures" / f"{name}.png"
    with styled():
        drawing.savefig(path, dpi=_DPI)
    return figure(path, title=title, caption=caption)


def _sheet(rows: int, columns: int, height: float, **options: Any) -> tuple[Figure, Any]:
    with mpl.rc_context({"figure.constrained_layout.use": True}):
        drawing = Figure(figsize=(8.6, height))
    FigureCanvasAgg(drawing)
    return drawing, drawing.subplots(rows, columns, squeeze=False, **options)


def _plans(
    result: Mapping[str, Any],
    columns: Mapping[str, Array],
    states: tuple[NDArray[np.str_], NDArray[np.str_]],
    labels: tuple[str, str],
) -> list[tuple[str, str, str, Figure]]:
    with styled():
        return [
            ("path", "Path and speed", "Left: the centre from its start, in proportion. Right: its speed, and dθ/dt.",
             _draw_path(columns, labels)),
            ("states", "Angle and states", "Above: the angle. Below: the states as bands; stand: two rows or more "
             "stick, pivot: one sticks, slip: all that touch slide, hop: none touches.",
             _draw_states(columns, states, labels)),
            ("sinkage", "Sinkage of each row of spikes", "Depth of the lowest point of each row below the undisturbed "
             "surface. Both panels have the same scale; rows that never touch are left out.",
             _draw_rows(result, columns, labels, "sinkage", "m", 1e3, "sinkage [mm]")),
            ("forces", "Forces of the ground", "Left: upwards; the dashed line is the weight. Right: along the motion. "
             "Means over 5 ms, of all rows together, as the platform's acceleration has them.",
             _draw_forces(result, columns, labels)),
            ("energy", "Energy books", "Work of the torque; what was dissipated, in the ground and in friction; and "
             "what is left over: energy gained less the work plus what was dissipated; on grains that is platform and "
             "exchange only, since there what was dissipated is what the bed took less what it holds more.",
             _draw_energy(columns, labels)),
        ]  # fmt: skip


def _legend(drawing: Figure, labels: tuple[str, str]) -> None:
    handles = [Line2D([], [], label=label, **style) for label, style in zip(labels, _LINES, strict=True)]
    drawing.legend(handles=handles, loc="outside upper left", ncols=2)


def _draw_path(columns: Mapping[str, Array], labels: tuple[str, str]) -> Figure:
    drawing, ((path, speed, spin),) = _sheet(1, 3, 3.2)
    time = columns["t_s"]
    for number, style in enumerate(_LINES, 1):
        x, y = (1e3 * columns[f"{name}_m_{number}"] for name in ("x", "y"))
        path.plot(x - x[0], y - y[0], **style)
        speed.plot(time, np.hypot(columns[f"vx_m_s_{number}"], columns[f"vy_m_s_{number}"]), **style)
        spin.plot(time, columns[f"omega_rad_s_{number}"], **style)
    as_it_lies(path)
    path.set_xlabel("x − x(0) [mm]")
    path.set_ylabel("y − y(0) [mm]")
    speed.set_ylabel("speed of the centre [m/s]")
    spin.set_ylabel("dθ/dt [rad/s]")
    for axis in (speed, spin):
        axis.set_xlabel("time [s]")
    _legend(drawing, labels)
    return drawing


def _draw_states(
    columns: Mapping[str, Array], states: tuple[NDArray[np.str_], NDArray[np.str_]], labels: tuple[str, str]
) -> Figure:
    drawing, axes = _sheet(2, 1, 3.8, sharex=True, height_ratios=(2.2, 1.0))
    angle, bands = axes[:, 0]
    time = columns["t_s"]
    for number, style in enumerate(_LINES, 1):
        angle.plot(time, np.degrees(columns[f"theta_rad_{number}"]), **style)
        for low, high, name in state_runs(states[number - 1]):
            last = time[min(high, len(time) - 1)]
            bands.barh(2 - number, last - time[low], left=time[low], height=0.8, color=STATES.get(name, INK))
    angle.set_ylabel("θ [degrees]")
    bands.set_yticks([1, 0], labels)
    bands.set_ylim(-0.55, 1.55)
    bands.set_xlim(time[0], time[-1])
    bands.set_xlabel("time [s]")
    bands.grid(False)
    there = [name for name in STATES if any(name in each for each in states)]
    handles = [Line2D([], [], label=label, **style) for label, style in zip(labels, _LINES, strict=True)]
    handles += [Line2D([], [], color=STATES[name], lw=6, label=name) for name in there]
    drawing.legend(handles=handles, loc="outside upper left", ncols=6)
    return drawing


def _draw_rows(
    result: Mapping[str, Any],
    columns: Mapping[str, Array],
    labels: tuple[str, str],
    what: str,
    unit: str,
    scale: float,
    title: str,
) -> Figure:
    drawing, (axes,) = _sheet(1, 2, 3.2, sharey=True)
    rows = [
        row
        for row in range(int(result["spike_count"]))
        if any(columns[f"{what}_{row}_{unit}_{number}"].any() for number in (1, 2))
    ]
    for number, axis in enumerate(axes, 1):
        for row in rows:
            values = scale * columns[f"{what}_{row}_{unit}_{number}"]
            axis.plot(columns["t_s"], np.where(values > 0, values, np.nan), color=_ROWS[row % len(_ROWS)], lw=1.5)
        axis.set_title(labels[number - 1])
        axis.set_xlabel("time [s]")
    axes[0].set_ylabel(title)
    axes[0].invert_yaxis()
    handles = [Line2D([], [], color=_ROWS[row % len(_ROWS)], lw=2, label=f"row {row}") for row in rows]
    drawing.legend(handles=handles, loc="outside upper left", ncols=8)
    return drawing


def _draw_forces(result: Mapping[str, Any], columns: Mapping[str, Array], labels: tuple[str, str]) -> Figure:
    drawing, ((lift, push),) = _sheet(1, 2, 3.0)
    for number, style in enumerate(_LINES, 1):
        for axis, name in ((lift, "lift_N"), (push, "push_N")):
            if f"{name}_{number}" in columns:
                axis.plot(columns["t_s"], columns[f"{name}_{number}"], **(style | {"lw": 1.1}))
    weights = result["weights"]
    for weight, style in zip(weights, _LINES, strict=True):
        lift.axhline(weight, color=INK if weights[0] == weights[1] else style["color"], lw=0.8, ls=(0, (5, 4)))
    lift.set_ylabel("force upwards [N]")
    push.set_ylabel("force along the motion [N]")
    for axis in (lift, push):
        axis.set_xlabel("time [s]")
    _legend(drawing, labels)
    return drawing


def _draw_energy(columns: Mapping[str, Array], labels: tuple[str, str]) -> Figure:
    drawing, ((work, lost, rest),) = _sheet(1, 3, 3.0)
    work.sharey(lost)
    time = columns["t_s"]
    for number, style in enumerate(_LINES, 1):
        put_in, taken, energy = (
            1e3 * columns[f"{name}_J_{number}"] for name in ("torque_work", "dissipated", "energy")
        )
        work.plot(time, put_in, **style)
        lost.plot(time, taken, **style)
        rest.plot(time, 1e3 * (energy - energy[0] - put_in + taken), **(style | {"lw": 1.0}))
    for axis, name in ((work, "work of the torque [mJ]"), (lost, "dissipated [mJ]"), (rest, "left over [µJ]")):
        axis.set_ylabel(name)
        axis.set_xlabel("time [s]")
    rest.ticklabel_format(axis="y", scilimits=(-2, 4))
    _legend(drawing, labels)
    return drawing


def _side_by_side(
    home: Path, result: Mapping[str, Any], labels: tuple[str, str], tell: Callable[[float], None]
) -> list[Block]:
    """Stills of both at the same moments, and the film."""
    folders = [(home / run["folder"]).resolve() for run in result["runs"]]
    reels = _alike([Reel.open(folder) for folder in folders])
    stills = [
        (home / "figures" / f"seen-{name}.png", f"Both {words}", time,
         "; ".join(f"{label}: {reel.line(reel.nearest(time))}" for label, reel in zip(labels, reels, strict=True)))
        for name, words, time in moments(reels)
    ]  # fmt: skip
    drawn = draw_reels(reels, stills, home / "film.gif", by=result["colour"], labels=labels, progress=tell)
    blocks = [figure(each.file, title=each.title, caption=each.caption) for each in drawn.stills[1:]]
    if drawn.animation is not None:
        shown = drawn.animation
        blocks.insert(0, figure(shown.file, title=shown.title, caption=shown.caption, show_file=True))
    return [*blocks, *(text(note, small=True) for note in drawn.notes)]


def _alike(reels: list[Reel]) -> list[Reel]:
    """A law knows points only: beside a run on grains of spikes as long its platform is drawn with that one's."""
    known = [reel for reel in reels if reel.frames is not None]
    return [
        replace(reel, like=known[0].spikes)
        if reel.frames is None and known and known[0].number("spike_length") == reel.number("spike_length")
        else reel
        for reel in reels
    ]


# Penetrations ---------------------------------------------------------------------------------------------------------


def _drives(home: Path, result: Mapping[str, Any], labels: tuple[str, str]) -> list[Block]:
    """Force against depth of the drives that both have."""
    runs = [{run.id: run for run in read_folder(home / one["folder"]).of_kind("driven")} for one in result["runs"]]
    shared = [name for name in runs[0] if name in runs[1]]
    if not shared:
        return [text("The two have no drive of the same name: their numbers are compared below.")]
    with styled():
        drawing, (axes,) = _sheet(1, min(3, len(shared)), 3.2, sharey=True)
        for axis, name in zip(axes, shared, strict=False):
            for each, style in zip(runs, _LINES, strict=True):
                run = each[name]
                series = run.bed if run.bed is not None else run.model
                if series is not None:
                    axis.plot(1e3 * series.depth, series.force, **style)
            axis.set_title(name)
            axis.set_xlabel("depth [mm]")
        axes[0].set_ylabel("force on the spike [N]")
        _legend(drawing, labels)
    caption = "The same drives in both: force against depth, in and out."
    return [_drawn(home, "drives", "Drag against depth", caption, drawing)]


# Tables ---------------------------------------------------------------------------------------------------------------


def _tiles(result: Mapping[str, Any]) -> list[Tile]:
    wanted = (
        ("trajectory_angle", "Trajectory angle"), ("max_speed", "Largest speed"), ("sinkage_largest", "Deepest row"),
        ("sinkage", "Sinkage"), ("stiffness", "Stiffness"), ("energy_residual", "Energy residual"),
    )  # fmt: skip
    rows = {row["name"]: row for row in result["compared"]}
    tiles = []
    for name, label in wanted:
        row = rows.get(name)
        if row is None or row["first"] is None or row["second"] is None:
            continue
        values = [_said(row[key], row["unit"]) for key in ("first", "second")]
        tiles.append(Tile(label, f"{values[0]} | {values[1]}", "first | second"))
    return tiles[:5]


def _said(value: float, unit: str) -> str:
    if unit == "rad":
        return f"{short(math.degrees(value), 3)}°"
    if unit == "m" and abs(value) < 0.1:
        return f"{short(1e3 * value, 3)} mm"
    return f"{short(value, 3)}{'' if unit == '1' else ' ' + unit}"


def _numbers(result: Mapping[str, Any], labels: tuple[str, str]) -> Block:
    rows = []
    for row in result["compared"]:
        in_degrees = row["unit"] == "rad"
        scale, unit = (180 / math.pi, "°") if in_degrees else (1.0, "" if row["unit"] == "1" else row["unit"])
        cells = ["–" if row[key] is None else f"{scale * row[key]:.5g}" for key in ("first", "second")]
        difference = "–" if row["difference"] is None else f"{scale * row['difference']:+.4g}"
        share = "–" if row["relative"] is None else f"{100 * row['relative']:+.3g} %"
        rows.append((row["name"], *cells, difference, share, unit))
    return table(("quantity", *labels, "difference", "of the first", "unit"), rows)


def _given(result: Mapping[str, Any], labels: tuple[str, str]) -> Block:
    rows = [(row["key"], row["first"], row["second"], row["unit"]) for row in result["differs"]]
    return table(("key", *labels, "unit"), rows, words=True)
