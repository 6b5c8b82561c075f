"""Plots and report of a campaign that was made up: reads result.json and the recordings under campaign/."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

from matplotlib.figure import Figure

from vis.page.folder import read_columns
from vis.page.numbers import short
from vis.page.page import Section, Tile, table, text
from vis.page.plots import legend_above, line_handles, line_styles, sheet
from vis.page.report import Report, Result, again, report_of

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


@report_of(dpi=130)
def write_campaign_report(report: Report) -> Path:
    """Make figures/ and report.html of the folder of a made-up campaign, and return the report."""
    result, quantities = report.result, report.result["quantities"]
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
    effects = [
        f"{effect['id']} ({', '.join(f'{key} = {value:g}' for key, value in effect['parameters'].items())})"
        for effect in result["effects"]
    ]
    sections = [
        Section("", [drawn]),
        Section(
            "The trials",
            [
                text(f"Terms beyond the base model: {', '.join(effects) if effects else 'none'}."),
                table(head, rows),
                text("campaign/ is what a laboratory would hand over; truth.toml is what made it.", small=True),
            ],
        ),
        again("hedgebed campaign run.toml", ""),
    ]
    tiles = [
        Tile("Trials", str(quantities["trial_count"]["value"])),
        Tile("Rows recorded", str(quantities["row_count"]["value"])),
        Tile("Each lasts", f"{quantities['duration']['value']:g} s"),
    ]
    warnings = [str(warning) for warning in result["warnings"]]
    return report.write(sections, lead=["campaign"], tiles=tiles, warnings=warnings)


def _draw(campaign: Path, trials: Sequence[Result]) -> Figure:
    shown = trials[:: -(-len(trials) // _MOST)]
    conditions = [f"{t['actuator']} {t['torque']:g} N m, {t['gravity_sim']:.3g} m/s²" for t in shown]
    styles = line_styles(conditions)
    drawing, grid = sheet(2, 3, 5.0, sharex=True)
    axes = grid.ravel()
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
    legend_above(drawing, handles, 2, fontsize=7.5)
    return drawing
