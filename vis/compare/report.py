"""The report that sets two runs side by side: numbers with their differences, and what both did over time."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from rigid.series import read_series
from vis.film.film import ARROWS, draw_runs, shown
from vis.film.reel import AnyReel, Reel, SpaceReel
from vis.page.answer import MOST_ROWS
from vis.page.folder import read_folder
from vis.page.numbers import plain, short, typeset
from vis.page.page import Block, Section, Tile, listing, table, table_of, text
from vis.page.plots import BED, DASHED, GREY, INK, MODEL, Array, as_it_lies, handle, legend_above, sheet
from vis.page.report import Report, Result, again, report_of, unit_text
from vis.page.states import LINES, draw_bands, draw_forces, legend_of_runs
from vis.pictures.frames import frames_of

from .robots import draw_robots

__all__ = ["answer_tiles", "titles_of", "write_compare_report"]

Columns = Mapping[str, Array]
Labels = tuple[str, str]
_ROWS = (BED, "#E69F00", "#009E73", "#CC79A7", GREY, "#56B4E9", INK, MODEL)
"""Colours of rows or spikes."""


@report_of(dpi=130)
def write_compare_report(report: Report) -> Path:
    """Make figures/ and report.html of a comparison, and return the report.

    Raises FileNotFoundError where the folder has no result.json, or a run is gone whose pictures are asked for.
    """
    result = report.result
    labels = (result["runs"][0]["label"], result["runs"][1]["label"])
    report.about = titles_of(result)
    shown = {"penetrate": lambda: [Section("", _drives(report, labels))], "mujoco": lambda: _robots(report, labels)}
    rows = [(row["key"], row["first"], row["second"], row["unit"]) for row in result["differs"]]
    given = table_of(("key", *labels, "unit"), rows, words=True)
    sections = [
        *shown.get(result["kind"], lambda: _tumbles(report, labels))(),
        Section("Every number, side by side", _numbers(result, labels)),
        *([Section("Settings of the two runs", given)] if given else []),
        again("hedgebed compare run.toml"),
    ]
    lead = ["compare", *(f"{run['label']}: {run['title']}" for run in result["runs"])]
    return report.write(sections, lead=lead, tiles=answer_tiles(result), title=f"Compared: {result['title']}")


def titles_of(result: Result) -> str:
    """What both runs are, a line each as their figures have it: label and title, which names the surface."""
    return "\n".join(f"{run['label']}: {typeset(str(run['title']))}" for run in result["runs"])


def _tumbles(report: Report, labels: Labels) -> list[Section]:
    """Figures and pictures of two tumbles."""
    result = report.result
    path, states, *ground, energy = _figures(report, labels)
    seen = _seen(report, labels) if result["pictures"] else []
    return [
        Section("", [listing(result["departures"]["sentences"]), path]),
        *([Section("Pictures side by side", seen)] if seen else []),
        Section("States and angle", [states]),
        Section("Sinkage and forces", [*ground, *_row_sinkage(result, labels)]),
        Section("Energy", [energy]),
    ]


def _robots(report: Report, labels: Labels) -> list[Section]:
    """Figures and pictures of two runs of one robot."""
    result = report.result
    columns = dict(read_series(report.folder / result["series"], text=("state_1", "state_2")))
    drawn = draw_robots(columns, result["feet"], result["weights"], labels)
    kind = "robot"
    path, *others = [report.draw(f"{kind}_{name}", one, name=name) for name, one in drawn.items()]
    seen = _seen(report, labels) if result["pictures"] else []
    return [
        Section("", [listing(result["departures"]["sentences"]), path]),
        *([Section("Pictures side by side", seen)] if seen else []),
        Section("Forces and energy", others),
    ]


def _folders(report: Report) -> list[Path]:
    return [(report.folder / run["folder"]).resolve() for run in report.result["runs"]]


def _seen(report: Report, labels: Labels) -> list[Block]:
    """Stills of both at the same moments, and the film; in space where both have frames."""
    folders = _folders(report)
    if report.result["kind"] == "tumble":
        reels: Sequence[AnyReel] = _alike([Reel(folder) for folder in folders])
    elif without := [label for label, home in zip(labels, folders, strict=True) if frames_of(home) is None]:
        return [text(f"There are no pictures: {' and '.join(without)} kept no frames (frame_count = 0).", small=True)]
    else:
        reels = [SpaceReel(folder) for folder in folders]
    by, in_plane = report.result["colour"], isinstance(reels[0], Reel)
    drawn = draw_runs(reels, report.folder, "seen", by=by, labels=labels, progress=report.rest())
    notes = drawn.notes if in_plane else [ARROWS, *drawn.notes]
    return [*shown(drawn, first=int(in_plane)), *(text(note, small=True) for note in notes)]


def _alike(reels: Sequence[Reel]) -> list[Reel]:
    """A law knows points only: beside a run on grains of spikes as long its platform is drawn with that one's."""
    known = [reel for reel in reels if reel.frames is not None]
    return [
        Reel(reel.folder, like=known[0].spikes)
        if reel.frames is None and known and known[0].number("spike_length") == reel.number("spike_length")
        else reel
        for reel in reels
    ]


def _drives(report: Report, labels: Labels) -> list[Block]:
    """Force against depth of the drives that both have."""
    runs = [{run.id: run for run in read_folder(home).of_kind("driven")} for home in _folders(report)]
    shared = [name for name in runs[0] if name in runs[1]]
    if not shared:
        return [text("The two have no drive of the same name: their numbers are compared below.")]
    drawing, (axes,) = sheet(1, min(3, len(shared)), 3.2, sharey=True)
    for axis, name in zip(axes, shared, strict=False):
        for each, style in zip(runs, LINES, strict=True):
            run = each[name]
            series = run.bed if run.bed is not None else run.model
            if series is not None:
                axis.plot(1e3 * series.depth, series.force, **style)
        axis.set(title=name, xlabel="depth [mm]")
    axes[0].set_ylabel("force of the ground [N]")
    legend_of_runs(drawing, labels)
    return [report.draw("drives", drawing)]


def answer_tiles(result: Result) -> list[Tile]:
    """Numbers that both runs have: first and second, half of the 95 % interval of both, and the difference."""
    wanted = (
        ("trajectory_angle", "Trajectory angle"), ("max_speed", "Largest speed"), ("largest_turn", "Largest turn"),
        ("highest", "Rise"), ("sinkage_largest", "Sinkage"), ("sinkage", "Sinkage"), ("stiffness", "Stiffness"),
        ("largest_force", "Largest force"),
        ("energy_residual", "Energy error"),
    )  # fmt: skip
    rows = {row["name"]: row for row in result["compared"]}
    tiles = []
    for name, label in wanted:
        row = rows.get(name)
        if row is None or row["first"] is None or row["second"] is None:
            continue
        values = " | ".join(_in_unit(row[key], row["unit"]) for key in ("first", "second"))
        halves = [row.get(f"{key}_half") for key in ("first", "second")]
        spread = " | ".join(_in_unit(half, row["unit"], 2) if half else "\N{EN DASH}" for half in halves)
        relative = row["relative"]
        sign = "+" if row["difference"] > 0 else ""
        share = "" if relative is None else f" ({sign if relative > 0 else ''}{plain(100 * relative, 2)} %)"
        change = f"{sign}{_in_unit(row['difference'], row['unit'])}{share}"
        tiles.append(Tile(label, values, "", (spread if any(halves) else "", "", ""), change))
    return tiles[:MOST_ROWS]


def _in_unit(value: float, unit: str, significant: int = 3) -> str:
    if unit == "rad":
        return f"{short(math.degrees(value), significant)}°"
    if unit == "m" and abs(value) < 0.1:
        return f"{short(1e3 * value, significant)} mm"
    return f"{short(value, significant)}{'' if unit == '1' else ' ' + unit}"


def _numbers(result: Result, labels: Labels) -> list[Block]:
    """One table; where one run lasts longer, of the time that both last, and of each as a whole."""
    head = ("quantity", *labels, "difference", "of the first", "unit")
    rows, end = result["compared"], result.get("compared_over")
    if end is None:
        return [table(head, [_row(row) for row in rows])]
    lasts = " and ".join(f"{time:.4g}" for time in result["lasts"])
    shared = [row for row in rows if row["over"] == "shared time"]
    whole = [_row(row | {"first": row["first_whole"], "second": row["second_whole"]}) for row in rows]
    return [
        table(head, [_row(row) for row in shared], title=f"Over the common time, the first {end:.4g} s"),
        table(
            ("quantity", *labels, "unit"),
            [(*row[:3], row[-1]) for row in whole],
            title=f"Over the whole of each run, {lasts} s",
        ),
    ]


def _row(row: Result) -> tuple[str, ...]:
    scale, unit = (180 / math.pi, "°") if row["unit"] == "rad" else (1.0, unit_text(row["unit"]))
    cells = ["–" if row[key] is None else f"{scale * row[key]:.5g}" for key in ("first", "second")]
    difference = "–" if row["difference"] is None else f"{scale * row['difference']:+.4g}"
    share = "–" if row["relative"] is None else f"{100 * row['relative']:+.3g} %"
    return (row["name"], *cells, difference, share, unit)


def _row_sinkage(result: Result, labels: Labels) -> list[Block]:
    """The deepest point of each row, of tumbles in the plane."""
    rows = [
        (str(row["row"]), *(f"{1e3 * row[key]:.3g}" for key in ("first", "second"))) for row in result.get("rows", [])
    ]
    return table_of(("row", *labels), rows, title="Largest sinkage of each row over the common time [mm]")


# Figures --------------------------------------------------------------------------------------------------------------


def _figures(report: Report, labels: Labels) -> list[Block]:
    """The figures of two tumbles, drawn from series/compared.csv: path, states, sinkage, forces, energy."""
    result = report.result
    columns = dict(read_series(report.folder / result["series"], text=("state_1", "state_2")))
    states = columns.pop("state_1"), columns.pop("state_2")
    in_space = result["kind"] == "tumble spatial"
    kind, angle, label = ("space", "turn_rad", "turn [degrees]") if in_space else ("plane", "theta_rad", "θ [degrees]")
    forces = {"lift_N": "force upwards [N]", "push_N": "force along the motion [N]"}
    if in_space:
        forces = {"lift_N": "force upwards [N]", "push_x_N": "force along x [N]", "push_y_N": "force along y [N]"}
        names, called = result["spikes"], "spike"
    else:
        names, called = [str(row) for row in range(int(result["spike_count"]))], "row"
    angles = (np.degrees(columns[f"{angle}_{number}"]) for number in (1, 2))
    path, in_proportion = _draw_way(columns, labels) if in_space else _draw_path(columns, labels)
    drawings = {
        "path": path,
        "states": draw_bands([(columns["t_s"], *run) for run in zip(angles, states, strict=True)], labels, label=label),
        "sinkage": _draw_spikes(columns, names, labels, called=called),
        "forces": draw_forces(result["weights"], columns, forces, labels),
        "energy": _draw_energy(columns, labels),
    }
    shape = "in proportion" if in_proportion else "heights stretched"
    return [report.draw(f"{kind}_{name}", one, name=name, shape=shape) for name, one in drawings.items()]


def _draw_path(columns: Columns, labels: Labels) -> tuple[Figure, bool]:
    """The figure, and whether the path is in proportion."""
    drawing, ((path, speed, spin),) = sheet(1, 3, 3.2)
    time = columns["t_s"]
    for number, style in enumerate(LINES, 1):
        x, y = (1e3 * columns[f"{name}_m_{number}"] for name in ("x", "y"))
        path.plot(x - x[0], y - y[0], **style)
        speed.plot(time, np.hypot(columns[f"vx_m_s_{number}"], columns[f"vy_m_s_{number}"]), **style)
        spin.plot(time, columns[f"omega_rad_s_{number}"], **style)
    in_proportion = as_it_lies(path)
    path.set(xlabel="x − x(0) [mm]", ylabel="y − y(0) [mm]")
    speed.set_ylabel("speed of the centre [m/s]")
    spin.set_ylabel("dθ/dt [rad/s]")
    for axis in (speed, spin):
        axis.set_xlabel("time [s]")
    legend_of_runs(drawing, labels)
    return drawing, in_proportion


def _draw_way(columns: Columns, labels: Labels) -> tuple[Figure, bool]:
    """The figure; its panels are in proportion, over time as they are."""
    drawing, (ways, rates) = sheet(2, 3, 5.0, sharex=True)
    time = columns["t_s"]
    vectors = ("vx_m_s", "vy_m_s", "vz_m_s"), ("wx_rad_s", "wy_rad_s", "wz_rad_s")
    for number, style in enumerate(LINES, 1):
        for axis, name in zip(ways, "xyz", strict=True):
            way = 1e3 * columns[f"{name}_m_{number}"]
            axis.plot(time, way - way[0], **style)
            axis.set_ylabel(f"{name} − {name}(0) [mm]")
        for axis, names in zip(rates, vectors, strict=False):
            axis.plot(time, np.linalg.norm([columns[f"{name}_{number}"] for name in names], axis=0), **style)
    rates[2].plot(time, np.degrees(columns["apart_rad"]), color=INK, lw=1.4)
    words = ("speed of the centre [m/s]", "angular velocity [rad/s]", "between attitudes [degrees]")
    for axis, label in zip(rates, words, strict=True):
        axis.set(ylabel=label, xlabel="time [s]")
    legend_of_runs(drawing, labels)
    return drawing, True


def _draw_spikes(columns: Columns, names: Sequence[str], labels: Labels, *, called: str) -> Figure:
    """How deep each row or spike goes, a panel a run; those that never go in are left out."""
    drawing, (axes,) = sheet(1, 2, 3.2, sharey=True)
    none = np.zeros(len(columns["t_s"]))
    depths = [[1e3 * columns.get(f"sinkage_{name}_m_{number}", none) for name in names] for number in (1, 2)]
    there = [k for k in range(len(names)) if any(run[k].any() for run in depths)]
    dashes = ("-", DASHED, (0, (1, 1)))
    styles = [
        {"color": _ROWS[place % len(_ROWS)], "ls": dashes[place // len(_ROWS) % 3]} for place in range(len(there))
    ]
    for axis, run, label in zip(axes, depths, labels, strict=True):
        for k, style in zip(there, styles, strict=True):
            axis.plot(columns["t_s"], np.where(run[k] > 0, run[k], np.nan), lw=1.5, **style)
        axis.set(title=label, xlabel="time [s]")
    axes[0].set_ylabel("sinkage [mm]")
    axes[0].invert_yaxis()
    names = [name if name == "hull" else f"{called} {name}" for name in names]
    handles = [handle(names[k], lw=2, **style) for k, style in zip(there, styles, strict=True)]
    legend_above(drawing, handles, 8)
    return drawing


def _draw_energy(columns: Columns, labels: Labels) -> Figure:
    """Work of the torque, what was dissipated, what is left over."""
    drawing, ((work, lost, rest),) = sheet(1, 3, 3.0)
    work.sharey(lost)
    time = columns["t_s"]
    for number, style in enumerate(LINES, 1):
        put_in, taken, energy = (
            1e3 * columns[f"{name}_J_{number}"] for name in ("torque_work", "dissipated", "energy")
        )
        work.plot(time, put_in, **style)
        lost.plot(time, taken, **style)
        rest.plot(time, 1e3 * (energy - energy[0] - put_in + taken), **{**style, "lw": 1.0})
    for axis, name in ((work, "work of the torque [mJ]"), (lost, "dissipated [mJ]"), (rest, "left over [µJ]")):
        axis.set(ylabel=name, xlabel="time [s]")
    rest.ticklabel_format(axis="y", scilimits=(-2, 4))
    legend_of_runs(drawing, labels)
    return drawing
