"""Curves of robots and platforms in space: each has a label where a panel has several, and labels lie apart."""

from itertools import pairwise

import numpy as np
import pytest
from matplotlib.figure import Figure

from vis.page.plots import styled
from vis.page.states import draw_forces
from vis.robot.beds import draw_beside
from vis.robot.report import _draw_ground, _draw_joints
from vis.robot.report import _draw_path as path_of_robot
from vis.spatial.report import _draw_path as path_in_space
from vis.spatial.report import draw_energy


def columns(duration: float) -> dict[str, np.ndarray]:
    """Series of a robot and of a platform."""
    time = np.linspace(0.0, duration, 400)
    names = [
        *(f"{axis}_m" for axis in "xyz"), *(f"v{axis}_m_s" for axis in "xyz"), *(f"f{axis}_N" for axis in "xyz"),
        "kinetic_J", "potential_J", "torque_work_J", "taken_J", "sinkage_m", "foot_depth_m", "foot_height_m",
        "heel_depth_m", "heel_height_m", "knee_rad", "knee_rad_s", "rail_m", "rail_m_s", "push_control", "push_force",
        "fz_N_1", "fz_N_2",
    ]  # fmt: skip
    return {"t_s": time} | {name: np.sin((k + 1) * time / duration) for k, name in enumerate(names)}


FIGURES = {
    "path": lambda rows: path_of_robot(rows, rows),
    "ground": lambda rows: _draw_ground(rows, rows, ["foot", "heel"]),
    "joints": _draw_joints,
    "beside": lambda rows: draw_beside([rows], rows, "rft", called="grains"),
    "energy": draw_energy,
    "path in space": path_in_space,
    "forces of two": lambda rows: draw_forces([1.0, 1.0], rows, {"fz_N": "upwards [N]"}, ["one", "other"]),
}


def colours_named(drawing: Figure) -> set[str]:
    """Colours of the lines in the legends."""
    every = [*drawing.legends, *(axis.get_legend() for axis in drawing.axes)]
    return {line.get_color() for one in every if one for line in one.get_lines()}


@pytest.mark.parametrize("name", FIGURES)
def test_every_curve_of_a_panel_with_several_is_in_a_legend(name: str) -> None:
    with styled():
        drawing = FIGURES[name](columns(0.7))
        drawing.draw_without_rendering()
    named = colours_named(drawing)
    for axis in drawing.axes:
        if len(axis.lines) > 1:
            assert {line.get_color() for line in axis.lines} <= named, axis.get_ylabel()


@pytest.mark.parametrize("duration", [0.02, 0.7, 30.0])
@pytest.mark.parametrize("name", FIGURES)
def test_labels_of_the_time_lie_beside_one_another_and_no_axis_is_shorter_than_its_label(name: str, duration: float):
    with styled():
        drawing = FIGURES[name](columns(duration))
        drawing.draw_without_rendering()
    for axis in drawing.axes:
        low, high = axis.get_xlim()
        shown = [tick for tick in axis.xaxis.get_major_ticks() if low <= tick.get_loc() <= high]
        for one, other in pairwise(tick.label1.get_window_extent() for tick in shown):
            assert one.x1 < other.x0
        assert axis.yaxis.label.get_window_extent().height <= axis.get_window_extent().height
