"""Reports of a synthetic campaign, with its recordings under campaign/, and of `hedgebed campaign check`."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from vis.page.folder import read_columns
from vis.page.numbers import short
from vis.page.page import Section, Tile, listing, table, text
from vis.page.plots import BED, GREY, MODEL, RED, Array, handle, legend_above, line_handles, line_styles, sheet
from vis.page.report import Report, Result, again, capital, report_of, terms_text

__all__ = ["campaign_tiles", "inspection_tiles", "write_campaign_report", "write_inspection_report"]

_MOST = 12
"""Trials drawn at most; of a campaign that is checked those with findings first."""
_MOST_LINES = 60
"""Recordings in the chart of what is there."""
_SLIVER = 0.01  # share of a recording below which a finding has a mark above it
_UNCOVERED = 0.02
"""Share of a trial's time from which on a sensor that begins later or ends earlier than the others is shown."""
_THICKEST, _THINNEST = 2.2, 0.9
"""Lines of the first condition drawn and of the last: runs under others are seen on both sides of these."""
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


@report_of(dpi=130, named=True)
def write_campaign_report(report: Report) -> Path:
    """Make figures/ and report.html of the folder of a synthetic campaign, and return the report."""
    result = report.result
    drawn = report.draw("recordings", _draw(report.folder / result["campaign"], result["trials"]))
    rows = [
        (trial["id"], f"{trial['gravity_sim']:.5g}", f"{trial['true_gravity_sim']:.5g}", f"{trial['torque']:g}",
         trial["actuator"],
         "–" if trial["trajectory_angle"] is None else short(math.degrees(trial["trajectory_angle"]), 3),
         f"{trial['max_speed']:.3g}", " ".join(trial["states"][:6]) + (" ..." if len(trial["states"]) > 6 else ""))
        for trial in result["trials"]
    ]  # fmt: skip
    head = (
        "trial", "g_sim stated [m/s²]", "true", "torque [N m]", "actuator", "angle [degrees]", "speed [m/s]", "states",
    )  # fmt: skip
    note = text("campaign/ is what a laboratory would hand over; truth.toml is what made it.", small=True)
    trials = [text(terms_text(result)), table(head, rows), note]
    sections = [Section("", [drawn]), Section("The trials", trials), again("hedgebed campaign run.toml", "")]
    warnings = [str(warning) for warning in result["warnings"]]
    return report.write(sections, lead=["campaign"], tiles=campaign_tiles(result), warnings=warnings)


def campaign_tiles(result: Result) -> list[Tile]:
    """How large a synthetic campaign is."""
    quantities = result["quantities"]
    return [
        Tile("Trials", str(quantities["trial_count"]["value"])),
        Tile("Rows recorded", str(quantities["row_count"]["value"])),
        Tile("Each lasts", f"{quantities['duration']['value']:g} s"),
    ]


def _draw(campaign: Path, trials: Sequence[Result]) -> Figure:
    shown = trials[:: -(-len(trials) // _MOST)]
    conditions = [f"{t['actuator']} {t['torque']:g} N m, {t['gravity_sim']:.3g} m/s²" for t in shown]
    styles = line_styles(conditions)
    drawing, grid = sheet(2, 3, 5.0, sharex=True)
    axes, channels = grid.ravel(), [channel for channel in _TUMBLE if channel[-1] != "ax"]
    for trial, condition in zip(shown, conditions, strict=True):
        path = f"{campaign / trial['id']}-{{}}.csv"
        files = {sensor: read_columns(Path(path.format(sensor)))[0] for sensor in ("pose", "imu", "wheel")}
        for axis, (sensor, column, scale, label, channel) in zip(axes, channels, strict=True):
            axis.plot(files[sensor]["t_s"], scale * files[sensor][column], lw=0.8, **styles[condition])
            axis.set_ylabel("body-y specific force [m/s²]" if channel == "ay" else label)
    for axis in axes[3:]:
        axis.set_xlabel("time [s]")
    handles = line_handles([str(trial["id"]) for trial in shown], conditions)
    legend_above(drawing, handles, 2, fontsize=7.5)
    return drawing


# What was found in a campaign -----------------------------------------------------------------------------------------


@report_of(dpi=130, named=True)
def write_inspection_report(report: Report) -> Path:
    """Make figures/ and report.html of the folder of a checked campaign, and return the report."""
    result = report.result
    drawing = (_draw_tumbles if result["kind"] == "tumble" else _draw_penetrations)(report)
    drawn = [report.draw("inspection_recordings", drawing, name="recordings")]
    if _has_holes(result):
        drawn.append(report.draw("coverage", _draw_coverage(result)))
    (trials,) = result["tables"]
    head = ("recording", "rows", "rate [Hz]", "from [s]", "to [s]", "rows with gaps", "longest gap [s]")
    found = [capital(what) + "." for what in result["warnings"]]
    said = [text(words) for words in result.get("departures", {}).get("sentences", [])]
    rows = [[str(cell) for cell in row] for row in trials["rows"]]
    sections = [
        Section("Findings", [listing(found) if found else text("Nothing odd was found in the recordings."), *said]),
        Section("", [table(trials["head"], rows, title="Trials", words=True)]),
        Section("The recordings", [*drawn, table(head, [_row(entry) for entry in result["recordings"]])]),
        again("hedgebed campaign check THIS_FOLDER/run.toml", "From where it was started:"),
    ]
    return report.write(
        sections, lead=["campaign check", str(result["kind"])], tiles=inspection_tiles(result), warnings=()
    )


def inspection_tiles(result: Result) -> list[Tile]:
    """How large a checked campaign is, and how much was found."""
    quantities = result["quantities"]
    return [
        Tile("Trials", str(quantities["trial_count"]["value"])),
        Tile("Conditions", str(quantities["condition_count"]["value"])),
        Tile("Rows recorded", str(quantities["row_count"]["value"])),
        Tile("Found", str(quantities["finding_count"]["value"])),
    ]


def _row(entry: Result) -> tuple[str, ...]:
    """What is to say of a recording."""
    return (
        f"{entry['trial']} {entry['sensor']}",
        str(entry["rows"]),
        "?" if entry["rate"] is None else f"{entry['rate']:.4g}",
        f"{entry['from_s']:.4g}",
        f"{entry['to_s']:.4g}",
        str(entry["empty_rows"]),
        f"{max(high - low for low, high in entry['gaps']):.3g}" if entry["gaps"] else "–",
    )


def _shown(result: Result) -> list[Result]:
    """The trials that are drawn, in the campaign's order."""
    order = sorted(range(len(result["trials"])), key=lambda k: (result["trials"][k]["findings"] == 0, k))
    return [result["trials"][k] for k in sorted(order[:_MOST])]


def _files(report: Report, trial: str) -> dict[str, dict[str, Array]]:
    own = (entry for entry in report.result["recordings"] if entry["trial"] == trial)
    return {entry["sensor"]: report.columns(entry["series"]) for entry in own}


def _mark(axis: Axes, result: Result, channels: Sequence[str], shown: set[str]) -> None:
    """Red where something was found in one of the channels."""
    for finding in result["findings"]:
        if finding["channel"] in channels and finding["trial"] in shown and finding["from_s"] is not None:
            axis.axvspan(finding["from_s"], finding["to_s"], color=RED, alpha=0.18, lw=0)
            axis.axvline(finding["from_s"], color=RED, lw=0.8)


def _draw_tumbles(report: Report) -> Figure:
    result, trials = report.result, _shown(report.result)
    held = {entry["sensor"] for entry in result["recordings"]}
    channels = [channel for channel in _TUMBLE if channel[0] in held]
    count = math.ceil(len(channels) / 2)
    drawing, grid = sheet(count, 2, 1.9 * count + 0.12 * len(trials), sharex=True)
    axes = grid.ravel()
    styles, handles = _lines(result, trials)
    for trial in trials:
        files = _files(report, trial["id"])
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
    legend_above(drawing, handles, 2, fontsize=7.5)
    return drawing


def _draw_penetrations(report: Report) -> Figure:
    result, trials = report.result, _shown(report.result)
    driven = [trial for trial in trials if trial["kind"] == "driven"]
    drops = [trial for trial in trials if trial["kind"] == "drop"]
    plans = []
    if driven:
        plans += [
            (driven, "depth_m", 1e3, "depth [mm]", "force_N", 1.0, "force [N]", "force"),
            (driven, "t_s", 1.0, "time [s]", "depth_m", 1e3, "depth [mm]", "depth"),
        ]
    if drops:
        plans += [
            (drops, "t_s", 1e3, "time since touch-down [ms]", "depth_m", 1e3, "depth [mm]", "depth"),
            (drops, "t_s", 1e3, "time since touch-down [ms]", "accel_m_s2", 1.0, "acceleration [m/s²]", "accel"),
        ]
    rows = len(plans) // 2
    drawing, axes = sheet(rows, 2, 2.7 * rows + 0.1 * len(trials))
    styles, handles = _lines(result, trials)
    files = {trial["id"]: _files(report, trial["id"])["data"] for trial in trials}
    widths = _widths(files, trials)
    for axis, (chosen, across, wide, below, up, tall, label, channel) in zip(axes.ravel(), plans, strict=True):
        for trial in sorted(chosen, key=lambda trial: -widths[trial["id"]]):
            columns = files[trial["id"]]
            axis.plot(wide * columns[across], tall * columns[up], lw=widths[trial["id"]], **styles[trial["id"]])
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
        axis.set(xlabel=below, ylabel=label)
    legend_above(drawing, handles, 2, fontsize=7.5)
    return drawing


def _widths(files: Mapping[str, Mapping[str, Array]], trials: Sequence[Result]) -> dict[str, float]:
    """Width of each trial's line: the deepest is the thickest and drawn first, so that no run hides another; replicates
    have the same."""
    depths: dict[str, float] = {}
    for trial in trials:
        deepest = float(np.nanmax(files[trial["id"]]["depth_m"], initial=-math.inf))
        depths[trial["condition"]] = max(depths.get(trial["condition"], -math.inf), deepest)
    order = sorted(depths, key=lambda condition: -depths[condition])
    widths = np.linspace(_THICKEST, _THINNEST, len(order)) if len(order) > 1 else [_THINNEST]
    width = dict(zip(order, map(float, widths), strict=True))
    return {trial["id"]: width[trial["condition"]] for trial in trials}


def _has_holes(result: Result) -> bool:
    """Whether the chart of recorded times shows more than that every trial was recorded: gaps, findings, sensors of a
    trial that do not cover the same time."""
    if any(finding["from_s"] is not None for finding in result["findings"]):
        return True
    ends: dict[str, list[tuple[float, float]]] = {}
    for entry in result["recordings"]:
        if entry["gaps"]:
            return True
        ends.setdefault(entry["trial"], []).append((entry["from_s"], entry["to_s"]))
    return any(
        any(np.ptp(side) > _UNCOVERED * (max(last) - min(first)) for side in (first, last))
        for first, last in (zip(*spans, strict=True) for spans in ends.values())
    )


def _draw_coverage(result: Result) -> Figure:
    entries = result["recordings"][:_MOST_LINES]
    colours = {"pose": BED, "imu": MODEL, "wheel": GREY, "data": BED}
    drawing, ((axis,),) = sheet(1, 1, 0.8 + 0.17 * max(4, len(entries)))
    of = {"x": "pose", "y": "pose", "theta": "pose", "gyro": "imu", "ax": "imu", "ay": "imu", "depth": "data",
          "force": "data", "accel": "data", None: "data"}  # fmt: skip
    marked = False
    for place, entry in enumerate(entries):
        start, end = entry["from_s"], entry["to_s"]
        axis.barh(place, end - start, left=start, height=0.62, color=colours[entry["sensor"]], lw=0)
        for low, high in entry["gaps"]:
            axis.barh(place, max(high - low, 0.003 * (end - start)), left=low, height=0.7, color="white", lw=0)
        for finding in result["findings"]:
            channel = finding["channel"]
            own = finding["trial"] == entry["trial"] and of.get(channel, channel) == entry["sensor"]
            if own and finding["from_s"] is not None:
                marked = True
                wide = max(finding["to_s"] - finding["from_s"], 0.004 * (end - start))
                axis.barh(place, wide, left=finding["from_s"], height=0.3, color=RED, lw=0)
                if finding["to_s"] - finding["from_s"] < _SLIVER * (end - start):  # a single reading
                    axis.plot(finding["from_s"], place - 0.45, "v", color=RED, ms=6, clip_on=False)
    words = [f"{entry['trial']}  {entry['sensor'] if entry['sensor'] != 'data' else ''}".strip() for entry in entries]
    axis.set_yticks(range(len(entries)), words, fontsize=7.5)
    axis.invert_yaxis()
    axis.grid(False, axis="y")
    axis.set_xlabel("time [s]")
    kinds = list(dict.fromkeys(entry["sensor"] for entry in entries))
    handles = [Patch(color=colours[kind], label=kind) for kind in kinds]
    handles += [Patch(color=RED, label="found")] if marked else []
    legend_above(drawing, handles, 4, fontsize=7.5)
    return drawing


def _lines(result: Result, trials: Sequence[Result]) -> tuple[Mapping[str, Any], list[Line2D]]:
    """Colour and dash of each trial, that of its condition (red: at odds with its replicates), and the legend."""
    odd = [finding["trial"] for finding in result["findings"] if "at odds" in finding["what"]]
    usual = [trial for trial in trials if trial["id"] not in odd]
    by_condition = line_styles([trial["condition"] for trial in usual])
    styles = {trial["id"]: by_condition[trial["condition"]] for trial in usual}
    styles |= {name: {"color": RED, "ls": "-"} for name in odd}
    handles = line_handles([trial["id"] for trial in usual], [trial["condition"] for trial in usual])
    handles += [handle(f"{trial['id']}: at odds", RED, lw=1.6) for trial in trials if trial["id"] in odd]
    names = {trial["id"] for trial in trials}
    if any(finding["from_s"] is not None and finding["trial"] in names for finding in result["findings"]):
        handles.append(handle("found: see the list", RED, ls="", marker="o", ms=4))
    return styles, handles
