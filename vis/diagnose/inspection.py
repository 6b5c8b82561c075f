"""Plots and report of `hedgebed campaign check`: reads result.json and series/ of the run folder."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from vis.page.page import Block, Page, Section, Tile, code, figure, listing, table, text, write_page
from vis.page.palette import RED, line_handles, line_styles
from vis.page.style import BED, GREY, MODEL, styled
from vis.tumble.report import read_columns

__all__ = ["write_inspection_report"]

_WIDTH = 8.6
_MOST = 12
"""Trials drawn at most, those with findings first."""
_MOST_LINES = 60
"""Recordings in the chart of what is there."""
#: (sensor, column, factor, label, channel of findings)
_TUMBLE = (
    ("pose", "x_m", 1e3, "x [mm]", "x"),
    ("pose", "y_m", 1e3, "y [mm]", "y"),
    ("pose", "theta_rad", 180 / math.pi, "θ [degrees]", "theta"),
    ("imu", "gyro_rad_s", 1.0, "gyro [rad/s]", "gyro"),
    ("imu", "ax_m_s2", 1.0, "body x [m/s²]", "ax"),
    ("imu", "ay_m_s2", 1.0, "body y [m/s²]", "ay"),
    ("wheel", "omega_rad_s", 1.0, "wheel [rad/s]", "wheel"),
)


def write_inspection_report(folder: str | Path, *, progress: Callable[[float], None] | None = None) -> Path:
    """Make figures/ and report.html of the folder of a checked campaign, and return the report.

    Raises FileNotFoundError where the folder has no result.json or a series is missing.
    """
    folder = Path(folder)
    tell = progress if progress is not None else lambda done: None
    result = json.loads((folder / "result.json").read_text(encoding="utf-8"))
    figures = folder / "figures"
    figures.mkdir(exist_ok=True)
    plans = [
        ("recordings", "What was recorded", _draw_tumbles if result["kind"] == "tumble" else _draw_penetrations,
         "Every channel of every trial, as recorded; replicates share a colour. At most twelve trials are drawn, those "
         "in which something was found first. Red: where, or a trial that is at odds with its replicates."),
        ("coverage", "What is there", _draw_coverage,
         "A line for each recording, from its first to its last row; white are gaps, red is what was found."),
    ]  # fmt: skip
    drawn: list[Block] = []
    for place, (name, title, draw, caption) in enumerate(plans):
        with styled():
            draw(folder, result).savefig(figures / f"{name}.png", dpi=130)
        drawn.append(figure(figures / f"{name}.png", title=title, caption=caption))
        tell(0.4 * (place + 1))
    report = write_page(folder / "report.html", _page(result, drawn))
    tell(1.0)
    return report


def _shown(result: Mapping[str, Any]) -> list[dict[str, Any]]:
    """The trials that are drawn, in the campaign's order."""
    order = sorted(range(len(result["trials"])), key=lambda k: (result["trials"][k]["findings"] == 0, k))
    return [result["trials"][k] for k in sorted(order[:_MOST])]


def _files(folder: Path, result: Mapping[str, Any], trial: str) -> dict[str, dict[str, Any]]:
    return {e["sensor"]: read_columns(folder / e["series"])[0] for e in result["recordings"] if e["trial"] == trial}


def _mark(axis: Axes, result: Mapping[str, Any], channels: Sequence[str], shown: set[str]) -> None:
    """Red where something was found in one of the channels."""
    for finding in result["findings"]:
        if finding["channel"] in channels and finding["trial"] in shown and finding["from_s"] is not None:
            axis.axvspan(finding["from_s"], finding["to_s"], color=RED, alpha=0.18, lw=0)
            axis.axvline(finding["from_s"], color=RED, lw=0.8)


def _draw_tumbles(folder: Path, result: Mapping[str, Any]) -> Figure:
    trials = _shown(result)
    held = {entry["sensor"] for entry in result["recordings"]}
    channels = [channel for channel in _TUMBLE if channel[0] in held]
    drawing = Figure(figsize=(_WIDTH, 1.9 * math.ceil(len(channels) / 2) + 0.12 * len(trials)))
    FigureCanvasAgg(drawing)
    axes = drawing.subplots(math.ceil(len(channels) / 2), 2, sharex=True, squeeze=False).ravel()
    styles, handles = _lines(result, trials)
    for trial in trials:
        files = _files(folder, result, trial["id"])
        for axis, (sensor, column, factor, _, _) in zip(axes, channels, strict=False):
            if sensor in files:
                axis.plot(files[sensor]["t_s"], factor * files[sensor][column], lw=0.9, **styles[trial["id"]])
    names = {trial["id"] for trial in trials}
    for axis, (sensor, _, _, label, channel) in zip(axes, channels, strict=False):
        axis.set_ylabel(label)
        _mark(axis, result, (channel, sensor), names)
    for axis in axes[len(channels) :]:
        axis.set_visible(False)
    for axis in axes[max(0, len(channels) - 2) : len(channels)]:
        axis.set_xlabel("time [s]")
        axis.tick_params(labelbottom=True)
    drawing.legend(handles=handles, loc="outside upper left", ncols=2, fontsize=7.5)
    return drawing


def _draw_penetrations(folder: Path, result: Mapping[str, Any]) -> Figure:
    trials = _shown(result)
    driven = [trial for trial in trials if trial["kind"] == "driven"]
    drops = [trial for trial in trials if trial["kind"] == "drop"]
    plans = []
    if driven:
        plans += [(driven, "depth_m", 1e3, "depth [mm]", "force_N", 1.0, "force [N]", "force"),
                  (driven, "t_s", 1.0, "time [s]", "depth_m", 1e3, "depth [mm]", "depth")]  # fmt: skip
    if drops:
        plans += [(drops, "t_s", 1e3, "time since touch-down [ms]", "depth_m", 1e3, "depth [mm]", "depth"),
                  (drops, "t_s", 1e3, "time since touch-down [ms]", "accel_m_s2", 1.0, "acceleration [m/s²]",
                   "accel")]  # fmt: skip
    rows = len(plans) // 2
    drawing = Figure(figsize=(_WIDTH, 2.7 * rows + 0.1 * len(trials)))
    FigureCanvasAgg(drawing)
    axes = drawing.subplots(rows, 2, squeeze=False).ravel()
    styles, handles = _lines(result, trials)
    for axis, (chosen, across, wide, below, up, tall, label, channel) in zip(axes, plans, strict=True):
        for trial in chosen:
            columns = _files(folder, result, trial["id"])["data"]
            axis.plot(wide * columns[across], tall * columns[up], lw=0.9, **styles[trial["id"]])
            for finding in result["findings"]:
                if finding["trial"] != trial["id"] or finding["from_s"] is None:
                    continue
                if finding["channel"] not in (None, channel):
                    continue
                rows_there = (columns["t_s"] >= finding["from_s"]) & (columns["t_s"] <= finding["to_s"])
                axis.plot(wide * columns[across][rows_there], tall * columns[up][rows_there], ".", color=RED, ms=3)
        axis.axhline(0.0, color=GREY, lw=0.8)
        if up == "depth_m":
            axis.invert_yaxis()
        axis.set_xlabel(below)
        axis.set_ylabel(label)
    drawing.legend(handles=handles, loc="outside upper left", ncols=2, fontsize=7.5)
    return drawing


def _draw_coverage(folder: Path, result: Mapping[str, Any]) -> Figure:
    entries = result["recordings"][:_MOST_LINES]
    colours = {"pose": BED, "imu": MODEL, "wheel": GREY, "data": BED}
    drawing = Figure(figsize=(_WIDTH, 0.8 + 0.17 * max(4, len(entries))))
    FigureCanvasAgg(drawing)
    axis = drawing.subplots()
    of = {"x": "pose", "y": "pose", "theta": "pose", "gyro": "imu", "ax": "imu", "ay": "imu", "depth": "data",
          "force": "data", "accel": "data", None: "data"}  # fmt: skip
    for place, entry in enumerate(entries):
        start, end = entry["from_s"], entry["to_s"]
        axis.barh(place, end - start, left=start, height=0.62, color=colours[entry["sensor"]], lw=0)
        for low, high in entry["gaps"]:
            axis.barh(place, max(high - low, 0.003 * (end - start)), left=low, height=0.7, color="white", lw=0)
        for finding in result["findings"]:
            channel = finding["channel"]
            own = finding["trial"] == entry["trial"] and of.get(channel, channel) == entry["sensor"]
            if own and finding["from_s"] is not None:
                wide = max(finding["to_s"] - finding["from_s"], 0.004 * (end - start))
                axis.barh(place, wide, left=finding["from_s"], height=0.3, color=RED, lw=0)
    words = [f"{entry['trial']}  {entry['sensor'] if entry['sensor'] != 'data' else ''}".strip() for entry in entries]
    axis.set_yticks(range(len(entries)), words, fontsize=7.5)
    axis.invert_yaxis()
    axis.grid(False, axis="y")
    axis.set_xlabel("time [s]")
    kinds = list(dict.fromkeys(entry["sensor"] for entry in entries))
    handles = [Patch(color=colours[kind], label=kind) for kind in kinds] + [Patch(color=RED, label="found")]
    drawing.legend(handles=handles, loc="outside upper left", ncols=4, fontsize=7.5)
    return drawing


def _lines(result: Mapping[str, Any], trials: Sequence[Mapping[str, Any]]) -> tuple[dict[str, Any], list[Line2D]]:
    """Colour and dash of each trial, that of its condition (red: at odds with its replicates), and the legend."""
    odd = [finding["trial"] for finding in result["findings"] if "at odds" in finding["what"]]
    usual = [trial for trial in trials if trial["id"] not in odd]
    by_condition = line_styles([trial["condition"] for trial in usual])
    styles = {trial["id"]: by_condition[trial["condition"]] for trial in usual}
    styles |= {name: {"color": RED, "ls": "-"} for name in odd}
    handles = line_handles([trial["id"] for trial in usual], [trial["condition"] for trial in usual])
    handles += [
        Line2D([], [], lw=1.6, color=RED, label=f"{trial['id']}: at odds") for trial in trials if trial["id"] in odd
    ]
    names = {trial["id"] for trial in trials}
    if any(finding["from_s"] is not None and finding["trial"] in names for finding in result["findings"]):
        handles.append(Line2D([], [], color=RED, ls="", marker="o", ms=4, label="found: see the list"))
    return styles, handles


def _page(result: Mapping[str, Any], drawn: Sequence[Block]) -> Page:
    quantities = result["quantities"]
    (trials,) = result["tables"]
    recordings = [
        (
            f"{entry['trial']} {entry['sensor']}",
            str(entry["rows"]),
            "?" if entry["rate"] is None else f"{entry['rate']:.4g}",
            f"{entry['from_s']:.4g}",
            f"{entry['to_s']:.4g}",
            str(entry["empty_rows"]),
            f"{max((high - low for low, high in entry['gaps']), default=0.0):.3g}" if entry["gaps"] else "–",
        )
        for entry in result["recordings"]
    ]
    head = ("recording", "rows", "rate [Hz]", "from [s]", "to [s]", "rows with gaps", "longest gap [s]")
    found = [what[:1].upper() + what[1:] + "." for what in result["warnings"]]
    return Page(
        title=str(result["title"]),
        lead=[f"hedgebed {result['version']}", "campaign check", str(result["kind"])],
        tiles=[
            Tile("Trials", str(quantities["trial_count"]["value"])),
            Tile("Conditions", str(quantities["condition_count"]["value"])),
            Tile("Rows recorded", str(quantities["row_count"]["value"])),
            Tile("Found", str(quantities["finding_count"]["value"]), second=bool(found)),
        ],
        sections=[
            Section("What was found", [listing(found) if found else text("Nothing odd was found in the recordings.")]),
            Section("", [table(trials["head"], [[str(cell) for cell in row] for row in trials["rows"]], title="Trials",
                               words=True)]),
            Section("The recordings", [*drawn, table(head, recordings)]),
            Section("To do this again", [code("hedgebed campaign check run.toml")]),
        ],
    )  # fmt: skip
