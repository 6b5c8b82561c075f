"""A tumble on grains beside the spring-damper: paths, forces and sinkage of the spikes; a section of the report."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from vis.page.numbers import short
from vis.page.page import Section, figure, table, text
from vis.page.style import BED, GREY, INK, MODEL, as_it_lies, styled
from vis.tumble.beside import HEAD, beside_rows, beside_words

__all__ = ["grains_section"]

Columns = tuple[Mapping[str, NDArray[np.float64]], NDArray[np.str_]]
_ROWS = (BED, MODEL, "#009E73", "#CC79A7", GREY, "#56B4E9", "#E69F00", INK)
"""Colours of the rows of spikes."""


def grains_section(result: Mapping[str, Any], figures: Path, tables: Mapping[str, Columns]) -> Section:
    """The section, its figures drawn into `figures`. `tables`: the run's own, motion, feet, bed and beside."""
    feet, beside = tables["feet"][0], tables["beside"][0]
    own = tables["own"][0]
    with styled():
        _draw_paths(own, beside).savefig(figures / "beside.png", dpi=130)
        _draw_feet(feet).savefig(figures / "feet.png", dpi=130)
        books = (
            _books(tables["motion"][0], feet, tables["bed"][0])
            if "damping_lost_J" in tables.get("bed", ({}, ()))[0]
            else None
        )
        if books is not None:
            _draw_books(books).savefig(figures / "books.png", dpi=130)
    grains = result["grains"]
    facts = (
        f"{grains['mode']}. {grains['grain_count']} grains, packing {short(grains['packing_fraction'], 3)}, "
        f"E = {short(grains['young'] / 1e6, 3)} MPa ({short(grains['softer_than_real'], 2)} times softer than real), "
        f"step {short(1e6 * grains['time_step'], 3)} µs, {round(grains['macro_step'] / grains['time_step'])} of them "
        f"in one of the platform; largest overlap {short(100 * grains['max_overlap'], 2)} %. "
        f"One spike stands for its row of two."
    )
    if (repeats := grains.get("repeats", 1)) > 1:
        facts += (
            f" The bed is a piece of {short(grains['piece_length'], 3)} m laid end to end {repeats} times: the same "
            "grains lie in every copy."
        )
    both = result["quantities"], grains["beside"]
    blocks = [
        figure(
            figures / "beside.png", title="Grains and spring-damper",
            caption="The same trial on the bed of grains and on the spring-damper of the same surface.",
        ),
        *([] if result.get("quantities", {}).get("impact_speed") else [text(beside_words(*both))]),
        table(HEAD, beside_rows(*both)),
        figure(
            figures / "feet.png", title="What each row feels",
            caption="Above: upward force, mean over 5 ms. Below: how deep its lowest point is under the surface.",
        ),
        text(facts, small=True),
    ]  # fmt: skip
    if books is not None:
        blocks.append(figure(
            figures / "books.png", title="Where the energy went",
            caption="Left: work of the torque; energy that platform and counterweight gained; what the grains hold "
            "more (moving, lifted, in springs), and lost to dashpots, friction and rolling resistance: all measured, "
            "none by difference. Right: what is left over, of all together and of platform and exchange alone.",
        ))  # fmt: skip
    return Section("On grains, beside the spring-damper", blocks)


def _books(
    motion: Mapping[str, NDArray[np.float64]],
    feet: Mapping[str, NDArray[np.float64]],
    bed: Mapping[str, NDArray[np.float64]],
) -> dict[str, NDArray[np.float64]]:
    """The books at the times of ``bed`` [mJ]."""
    time = bed["t_s"]

    def at(columns: Mapping[str, NDArray[np.float64]], name: str) -> NDArray[np.float64]:
        values = 1e3 * np.interp(time, columns["t_s"], columns[name])
        return np.asarray(values - values[0])

    book = {"time": time, "torque": at(motion, "torque_work_J"), "taken": at(feet, "taken_J")}
    book["body"] = at(motion, "kinetic_J") + at(motion, "potential_J")
    names = ("kinetic", "potential", "normal", "tangential", "turning")
    held = 1e3 * np.sum([bed[f"{name}_J"] for name in names], axis=0)
    book["held"] = held - held[0]
    for name in ("damping", "friction", "rolling"):
        book[name] = 1e3 * bed[f"{name}_lost_J"]
    lost = book["damping"] + book["friction"] + book["rolling"]
    book["coupling"] = book["body"] - book["torque"] + book["taken"]
    book["all"] = book["body"] - book["torque"] + book["held"] + lost
    return book


def _draw_books(book: Mapping[str, NDArray[np.float64]]) -> Figure:
    drawing, ((where, left),) = _panels(1, 2, 3.4)
    lines = (
        ("torque", "work of the torque", INK), ("body", "platform", MODEL), ("held", "grains hold", "#56B4E9"),
        ("damping", "dashpots", "#E69F00"), ("friction", "friction", BED), ("rolling", "rolling resistance", "#CC79A7"),
    )  # fmt: skip
    for name, label, colour in lines:
        where.plot(book["time"], book[name], color=colour, lw=1.4, label=label)
    where.set_xlabel("time [s]")
    where.set_ylabel("energy [mJ]")
    left.plot(book["time"], 1e3 * book["all"], color=INK, lw=1.2, label="all together")
    left.plot(book["time"], 1e3 * book["coupling"], color=GREY, lw=1.2, ls=(0, (4, 2)), label="platform and exchange")
    left.set_xlabel("time [s]")
    left.set_ylabel("left over [µJ]")
    left.legend(frameon=False, fontsize="small")
    drawing.legend(handles=where.lines, loc="outside upper left", ncols=6, fontsize="small")
    return drawing


def _panels(rows: int, columns: int, height: float) -> tuple[Figure, Any]:
    with mpl.rc_context({"figure.constrained_layout.use": True}):
        drawing = Figure(figsize=(8.6, height))
    FigureCanvasAgg(drawing)
    return drawing, drawing.subplots(rows, columns, squeeze=False)


def _draw_paths(own: Mapping[str, NDArray[np.float64]], beside: Mapping[str, NDArray[np.float64]]) -> Figure:
    drawing, ((path, angle, speed),) = _panels(1, 3, 3.0)
    for columns, label, style in (
        (own, "grains", {"color": BED, "lw": 1.6}),
        (beside, "spring-damper", {"color": MODEL, "lw": 1.3, "ls": (0, (4, 2))}),
    ):
        x, y = 1e3 * columns["x_m"], 1e3 * columns["y_m"]
        path.plot(x - x[0], y - y[0], label=label, **style)
        angle.plot(columns["t_s"], np.degrees(columns["theta_rad"]), **style)
        speed.plot(columns["t_s"], np.hypot(columns["vx_m_s"], columns["vy_m_s"]), **style)
    path.set_xlabel("x − x(0) [mm]")
    path.set_ylabel("y − y(0) [mm]")
    as_it_lies(path)
    angle.set_xlabel("time [s]")
    angle.set_ylabel("θ [degrees]")
    speed.set_xlabel("time [s]")
    speed.set_ylabel("speed of the centre [m/s]")
    drawing.legend(handles=path.lines, loc="outside upper left", ncols=2)
    return drawing


def _draw_feet(feet: Mapping[str, NDArray[np.float64]]) -> Figure:
    drawing, axes = _panels(2, 1, 4.2)
    force, depth = axes[:, 0]
    time = feet["t_s"]
    count = sum(name.startswith("normal_") for name in feet)
    window = max(1, round(5e-3 / float(np.median(np.diff(time))))) if len(time) > 1 else 1
    kernel = np.ones(min(window, len(time)))
    held = np.convolve(np.ones(len(time)), kernel, mode="same")  # fewer at both ends
    for row in range(count):
        normal, sinkage = feet[f"normal_{row}_N"], 1e3 * feet[f"sinkage_{row}_m"]
        if not normal.any():
            continue
        colour = _ROWS[row % len(_ROWS)]
        force.plot(time, np.convolve(normal, kernel, mode="same") / held, color=colour, lw=1.0)
        depth.plot(time, np.where(sinkage > 0, sinkage, np.nan), color=colour, lw=1.4, label=f"row {row}")
    force.set_ylabel("upward force [N]")
    depth.set_ylabel("sinkage [mm]")
    depth.set_xlabel("time [s]")
    depth.invert_yaxis()
    if depth.lines:
        drawing.legend(handles=depth.lines, loc="outside upper left", ncols=8)
    return drawing
