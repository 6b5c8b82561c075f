"""A tumble on grains beside the spring-damper: paths, forces and sinkage of the spikes; a section of the report."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure

from vis.page.numbers import short
from vis.page.page import Section, table, text
from vis.page.plots import BED, DASHED, GREY, INK, MODEL, Array, as_it_lies, legend_above, mean_over, sheet
from vis.page.report import Report
from vis.tumble.beside import HEAD, beside_rows, beside_words

__all__ = ["grains_section"]

Columns = Mapping[str, Array]
_ROWS = (BED, MODEL, "#009E73", "#CC79A7", GREY, "#56B4E9", "#E69F00", INK)
"""Colours of the rows of spikes."""


def grains_section(report: Report) -> Section:
    """The section, with its figures."""
    result = report.result
    columns = {name: report.columns(file) for name, file in result["grains"]["series"].items()}
    drawn = [
        report.draw("beside", _draw_paths(columns["own"], columns["beside"])),
        report.draw("feet", _draw_feet(columns["feet"])),
    ]
    if "damping_lost_J" in columns.get("bed", {}):
        balance = _balance(report.columns("series/motion.csv"), columns["feet"], columns["bed"])
        drawn.append(report.draw("books", _draw_balance(balance)))
    grains = result["grains"]
    facts = (
        f"{grains['mode']}. {grains['grain_count']} grains, packing {short(grains['packing_fraction'], 3)}, "
        f"E = {short(grains['young'] / 1e6, 3)} MPa ({short(grains['softer_than_real'], 2)} times softer than real), "
        f"step {short(1e6 * grains['time_step'], 3)} µs, {round(grains['macro_step'] / grains['time_step'])} of them "
        f"in one of the platform; largest overlap {short(100 * grains['max_overlap'], 2)} %. "
        f"One spike represents its row of two."
    )
    if (repeats := grains.get("repeats", 1)) > 1:
        facts += (
            f" The bed is a piece of {short(grains['piece_length'], 3)} m laid end to end {repeats} times: the same "
            "grains lie in every copy."
        )
    both = result["quantities"], grains["beside"]
    words = [] if result.get("quantities", {}).get("impact_speed") else [text(beside_words(*both))]
    numbers = table(HEAD, beside_rows(*both))
    blocks = [drawn[0], *words, numbers, drawn[1], text(facts, small=True), *drawn[2:]]
    return Section("On grains and on the spring-damper", blocks)


def _balance(motion: Columns, feet: Columns, bed: Columns) -> Columns:
    """The energy balance at the times of ``bed`` [mJ]."""
    time = bed["t_s"]

    def at(columns: Columns, name: str) -> Array:
        values = 1e3 * np.interp(time, columns["t_s"], columns[name])
        return np.asarray(values - values[0])

    balance = {"time": time, "torque": at(motion, "torque_work_J"), "taken": at(feet, "taken_J")}
    balance["body"] = at(motion, "kinetic_J") + at(motion, "potential_J")
    names = ("kinetic", "potential", "normal", "tangential", "turning")
    held = 1e3 * np.sum([bed[f"{name}_J"] for name in names], axis=0)
    balance["held"] = held - held[0]
    for name in ("damping", "friction", "rolling"):
        balance[name] = 1e3 * bed[f"{name}_lost_J"]
    lost = balance["damping"] + balance["friction"] + balance["rolling"]
    balance["coupling"] = balance["body"] - balance["torque"] + balance["taken"]
    balance["all"] = balance["body"] - balance["torque"] + balance["held"] + lost
    return balance


def _draw_balance(balance: Columns) -> Figure:
    drawing, ((where, left),) = sheet(1, 2, 3.4)
    lines = (
        ("torque", "work of the torque", INK), ("body", "platform", MODEL), ("held", "grains hold", "#56B4E9"),
        ("damping", "dashpots", "#E69F00"), ("friction", "friction", BED), ("rolling", "rolling resistance", "#CC79A7"),
    )  # fmt: skip
    for name, label, colour in lines:
        where.plot(balance["time"], balance[name], color=colour, lw=1.4, label=label)
    where.set(xlabel="time [s]", ylabel="energy [mJ]")
    left.plot(balance["time"], 1e3 * balance["all"], color=INK, lw=1.2, label="all together")
    left.plot(balance["time"], 1e3 * balance["coupling"], color=GREY, lw=1.2, ls=DASHED, label="platform and exchange")
    left.set(xlabel="time [s]", ylabel="left over [µJ]")
    left.legend(frameon=False, fontsize="small")
    legend_above(drawing, where.lines, 6, fontsize="small")
    return drawing


def _draw_paths(own: Columns, beside: Columns) -> Figure:
    drawing, ((path, angle, speed),) = sheet(1, 3, 3.0)
    for columns, label, style in (
        (own, "grains", {"color": BED, "lw": 1.6}),
        (beside, "spring-damper", {"color": MODEL, "lw": 1.3, "ls": DASHED}),
    ):
        x, y = 1e3 * columns["x_m"], 1e3 * columns["y_m"]
        path.plot(x - x[0], y - y[0], label=label, **style)
        angle.plot(columns["t_s"], np.degrees(columns["theta_rad"]), **style)
        speed.plot(columns["t_s"], np.hypot(columns["vx_m_s"], columns["vy_m_s"]), **style)
    path.set(xlabel="x − x(0) [mm]", ylabel="y − y(0) [mm]")
    as_it_lies(path)
    angle.set(xlabel="time [s]", ylabel="θ [degrees]")
    speed.set(xlabel="time [s]", ylabel="speed of the centre [m/s]")
    legend_above(drawing, path.lines, 2)
    return drawing


def _draw_feet(feet: Columns) -> Figure:
    drawing, axes = sheet(2, 1, 4.2)
    force, depth = axes[:, 0]
    time = feet["t_s"]
    rows = [row for row in range(sum(name.startswith("normal_") for name in feet)) if feet[f"normal_{row}_N"].any()]
    means = mean_over(5e-3, time, (feet[f"normal_{row}_N"] for row in rows))
    for row, mean in zip(rows, means, strict=True):
        sinkage, colour = 1e3 * feet[f"sinkage_{row}_m"], _ROWS[row % len(_ROWS)]
        force.plot(time, mean, color=colour, lw=1.0)
        depth.plot(time, np.where(sinkage > 0, sinkage, np.nan), color=colour, lw=1.4, label=f"row {row}")
    force.set_ylabel("upward force [N]")
    depth.set(ylabel="sinkage [mm]", xlabel="time [s]")
    depth.invert_yaxis()
    if depth.lines:
        legend_above(drawing, depth.lines, 8)
    return drawing
