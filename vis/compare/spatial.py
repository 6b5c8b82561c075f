"""Two tumbles in space side by side: the figures of their comparison, and both seen at the same moments."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from vis.compare.figures import ENERGY, Plan, States, draw_energy, draw_forces, draw_spikes, draw_states, legend
from vis.page.page import Block, figure, text
from vis.page.style import INK, styled
from vis.pictures.frames import frame_names
from vis.spatial.film import NAME
from vis.spatial.pictures import ARROWS, draw_in_space
from vis.tumble.state_figures import LINES, sheet

__all__ = ["plans", "side_by_side"]

Array = NDArray[np.float64]


def plans(
    result: Mapping[str, Any], columns: Mapping[str, Array], states: States, labels: tuple[str, str]
) -> list[Plan]:
    """The figures of two tumbles in space, drawn from series/compared.csv."""
    forces = (("lift_N", "force upwards [N]"), ("push_x_N", "force along x [N]"), ("push_y_N", "force along y [N]"))
    with styled():
        return [
            ("path", "Way and speed", "Above: way of the centre of mass from each run's own start. Below: its speed, "
             "the angular velocity, and the angle of the one turn between both attitudes.",
             _draw_path(columns, labels)),
            ("states", "Turn and states", "Above: the angle of the one turn from each run's own start. Below: the "
             "states as bands; stand: three spikes stick that are not in a line, pivot: those that stick lie in one "
             "line, or one does, slip: all that touch slide, hop: none touches.",
             draw_states(columns, "turn_rad", states, labels, label="turn [degrees]")),
            ("sinkage", "Sinkage of each spike", "Depth of the lowest point of each spike below the undisturbed "
             "surface. Both panels have the same scale; spikes that never go in are left out.",
             draw_spikes(columns, result["spikes"], labels, called="spike")),
            ("forces", "Forces of the ground", "On the platform, means over 5 ms; the dashed line is the weight.",
             draw_forces(result["weights"], columns, forces, labels)),
            ("energy", "Energy books", ENERGY, draw_energy(columns, labels)),
        ]  # fmt: skip


def _draw_path(columns: Mapping[str, Array], labels: tuple[str, str]) -> Figure:
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
        axis.set_ylabel(label)
        axis.set_xlabel("time [s]")
    legend(drawing, labels)
    return drawing


def side_by_side(
    home: Path, result: Mapping[str, Any], labels: tuple[str, str], tell: Callable[[float], None]
) -> list[Block]:
    """Stills of both at the same moments, and the film; where both have frames."""
    folders = [(home / run["folder"]).resolve() for run in result["runs"]]
    without = [label for label, folder in zip(labels, folders, strict=True) if NAME not in frame_names(folder)]
    if without:
        return [text(f"There are no pictures: {' and '.join(without)} kept no frames (frame_count = 0).", small=True)]
    drawn = draw_in_space(folders, home, stem="seen", by=result["colour"], film=True, labels=labels, progress=tell)
    blocks = [figure(each.file, title=each.title, caption=each.caption) for each in drawn.stills]
    if drawn.animation is not None:
        shown = drawn.animation
        blocks.insert(0, figure(shown.file, title=shown.title, caption=shown.caption, show_file=True))
    return [*blocks, *(text(note, small=True) for note in (ARROWS, *drawn.notes))]
