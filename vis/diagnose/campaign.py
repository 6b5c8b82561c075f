"""Plots and report of a campaign that was made up: reads result.json and the recordings under campaign/."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from vis.page.numbers import short
from vis.page.page import Page, Section, Tile, code, figure, table, text, write_page
from vis.page.palette import line_handles, line_styles
from vis.page.style import styled
from vis.tumble.report import read_columns

__all__ = ["write_campaign_report"]

_CHANNELS = (
    ("pose", "x_m", 1e3, "x [mm]"),
    ("pose", "y_m", 1e3, "y [mm]"),
    ("pose", "theta_rad", 180 / math.pi, "θ [degrees]"),
    ("imu", "gyro_rad_s", 1.0, "gyro [rad/s]"),
    ("imu", "ay_m_s2", 1.0, "body-y specific force [m/s²]"),
    ("wheel", "omega_rad_s", 1.0, "wheel [rad/s]"),
)
_MOST = 12
"""Trials drawn at most."""


def write_campaign_report(folder: str | Path, *, progress: Callable[[float], None] | None = None) -> Path:
    """Make figures/ and report.html of the folder of a made-up campaign, and return the report.

    Raises FileNotFoundError where the folder has no result.json or a recording is missing.
    """
    folder = Path(folder)
    result = json.loads((folder / "result.json").read_text(encoding="utf-8"))
    figures = folder / "figures"
    figures.mkdir(exist_ok=True)
    drawing = _draw(folder / result["campaign"], result["trials"])
    with styled():
        drawing.savefig(figures / "recordings.png", dpi=130)
    if progress is not None:
        progress(0.9)
    return write_page(folder / "report.html", _page(result, figures / "recordings.png"))


def _draw(campaign: Path, trials: list[dict[str, Any]]) -> Figure:
    shown = trials[:: -(-len(trials) // _MOST)]
    conditions = [f"{t['actuator']} {t['torque']:g} N m, {t['gravity_sim']:.3g} m/s²" for t in shown]
    styles = line_styles(conditions)
    with styled():
        drawing = Figure(figsize=(8.6, 5.0))
        FigureCanvasAgg(drawing)
        axes = drawing.subplots(2, 3, sharex=True).ravel()
        for trial, condition in zip(shown, conditions, strict=True):
            files = {
                sensor: read_columns(campaign / f"{trial['id']}-{sensor}.csv")[0] for sensor in ("pose", "imu", "wheel")
            }
            for axis, (sensor, column, scale, _) in zip(axes, _CHANNELS, strict=True):
                columns = files[sensor]
                axis.plot(columns["t_s"], scale * columns[column], lw=0.8, **styles[condition])
        for axis, (_, _, _, label) in zip(axes, _CHANNELS, strict=True):
            axis.set_ylabel(label)
        for axis in axes[3:]:
            axis.set_xlabel("time [s]")
        handles = line_handles([str(trial["id"]) for trial in shown], conditions)
        drawing.legend(handles=handles, loc="outside upper left", ncols=2, fontsize=7.5)
    return drawing


def _page(result: Mapping[str, Any], picture: Path) -> Page:
    quantities = result["quantities"]
    rows = [
        (
            trial["id"],
            f"{trial['gravity_sim']:.5g}",
            f"{trial['true_gravity_sim']:.5g}",
            f"{trial['torque']:g}",
            trial["actuator"],
            "–" if trial["trajectory_angle"] is None else short(math.degrees(trial["trajectory_angle"]), 3),
            f"{trial['max_speed']:.3g}",
            " ".join(trial["states"][:6]) + (" ..." if len(trial["states"]) > 6 else ""),
        )
        for trial in result["trials"]
    ]
    head = (
        "trial", "g_sim stated [m/s²]", "true", "torque [N m]", "actuator", "angle [degrees]", "speed [m/s]", "states",
    )  # fmt: skip
    effects = [
        f"{effect['id']} ({', '.join(f'{key} = {value:g}' for key, value in effect['parameters'].items())})"
        for effect in result["effects"]
    ]
    caption = (
        "What camera, IMU and wheel recorded, with their noise; before 0 the platform stands still. Replicates share a "
        "colour; at most twelve trials are drawn."
    )
    return Page(
        title=str(result["title"]),
        lead=[f"hedgebed {result['version']}", "campaign"],
        tiles=[
            Tile("Trials", str(quantities["trial_count"]["value"])),
            Tile("Rows recorded", str(quantities["row_count"]["value"])),
            Tile("Each lasts", f"{quantities['duration']['value']:g} s"),
        ],
        warnings=[str(warning) for warning in result["warnings"]],
        sections=[
            Section("", [figure(picture, title="The recordings", caption=caption)]),
            Section(
                "The trials",
                [
                    text(f"Terms beyond the base model: {', '.join(effects) if effects else 'none'}."),
                    table(head, rows),
                    text("campaign/ is what a laboratory would hand over; truth.toml is what made it.", small=True),
                ],
            ),
            Section("To do this again", [code("hedgebed campaign run.toml")]),
        ],
    )
