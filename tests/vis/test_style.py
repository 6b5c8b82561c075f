"""Ways of a platform, drawn in their true shape where something of it can be seen; colours of its states."""

from dataclasses import replace
from itertools import combinations, pairwise

import numpy as np
import pytest
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.text import Text
from PIL import Image, ImageColor

from vis.compare.report import _draw_path
from vis.diagnose.evidence import _KINDS
from vis.diagnose.figures import _PHASES, BASE
from vis.page.folder import read_folder
from vis.page.plots import (
    AMENDED,
    BED,
    MODEL,
    STATES,
    as_it_lies,
    handle,
    legend_above,
    new_figure,
    styled,
    title_above,
)
from vis.page.states import draw_forces
from vis.penetrate.lawfit import _over_beds
from vis.penetrate.plot_drag import OVER_BEDS, by_speed
from vis.penetrate.report import PLOTS
from vis.pictures.render import write_gif
from vis.robot.beds import draw_beside
from vis.robot.report import _draw_ground, _draw_joints
from vis.robot.report import _draw_path as path_of_robot
from vis.spatial.report import _draw_path as path_in_space
from vis.spatial.report import draw_energy


@pytest.mark.parametrize(("length", "aspect", "title"), [(0.3, 1.0, ""), (2.0, "auto", "heights stretched")])
def test_a_way_that_would_be_a_line_is_stretched_and_says_so(length: float, aspect: float | str, title: str) -> None:
    axis = Figure().subplots()
    x = np.linspace(0.0, length, 50)
    axis.plot(x, 0.025 * (1.0 + np.sin(40.0 * x)))
    assert as_it_lies(axis) == (title == "")
    assert axis.get_aspect() == aspect
    assert axis.get_title(loc="left") + axis.get_title() == title


@pytest.mark.parametrize(("height", "words"), [(5e-3, "in proportion"), (1e-5, "heights stretched")])
def test_the_caption_of_two_paths_says_of_their_shape_what_the_picture_does(height: float, words: str) -> None:
    time = np.linspace(0.0, 1.0, 50)
    columns = {"t_s": time}
    for number in (1, 2):
        columns |= {f"x_m_{number}": 0.02 * time, f"y_m_{number}": height * time**2}
        columns |= {f"{name}_{number}": time for name in ("vx_m_s", "vy_m_s", "omega_rad_s")}
    drawing, in_proportion = _draw_path(columns, ("one", "other"))
    assert in_proportion == (words == "in proportion")
    path = drawing.axes[0]
    assert path.get_title(loc="left") + path.get_title() == ("" if in_proportion else words)


@pytest.mark.parametrize("layout", ["constrained", "none"])
def test_a_figure_is_titled_with_its_surface_above_its_legend_and_panels_stay_as_high(layout: str) -> None:
    figure = new_figure(3.0, layout=layout)
    axis = figure.subplots()
    if layout == "none":
        figure.subplots_adjust(bottom=0.17)
    axis.set_title("0.1 m/s")
    legend = figure.legend(handles=[handle("bed", "black")], loc="outside upper center")
    figure.canvas.draw()
    before = axis.get_window_extent().height
    title_above(figure, "Plates in sand")
    figure.canvas.draw()
    words = next(text for text in figure.findobj(Text) if text.get_text() == "Plates in sand")
    box, key = words.get_window_extent(), legend.get_window_extent()
    assert key.y1 <= box.y0 < box.y1 <= figure.bbox.y1 and box.x0 >= 0.0
    assert axis.get_window_extent().height == pytest.approx(before, rel=1e-9)


def test_a_title_longer_than_its_figure_goes_on_in_a_second_line() -> None:
    figure = new_figure(3.0)
    title_above(figure, "A tumble on a bed of sand, " + "and so on " * 12)
    figure.canvas.draw()
    (title,) = figure.texts
    box = title.get_window_extent()
    assert "\n" in title.get_text() and 0.0 <= box.x0 < box.x1 <= figure.bbox.x1 and box.y1 <= figure.bbox.y1


def test_a_figure_whose_panel_names_the_surface_is_left_as_it_is() -> None:
    figure = new_figure(3.0, layout="none")
    figure.subplots().set_title("Plates in sand", loc="left")
    title_above(figure, "Plates in sand")
    assert len(figure.texts) == 0 and figure.get_size_inches()[1] == 3.0


SIGHT = {
    "whole": np.eye(3),
    "no red": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
    "no green": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
    "no blue": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]],
}
"""Linear RGB as it is seen where one kind of cone is missing: Machado, Oliveira and Fernandes, IEEE Transactions on
Visualization and Computer Graphics 15 (2009), 1291, severity 1."""


def lab(colour, sight):
    """CIE L*a*b* (D65) of an sRGB colour, shape (3,)."""
    rgb = np.array(to_rgb(colour))
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    to_xyz = np.array(
        [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.072175], [0.0193339, 0.119192, 0.9503041]]
    )
    share = to_xyz @ np.clip(sight @ linear, 0, 1) / to_xyz.sum(axis=1)
    f = np.where(share > 216 / 24389, np.cbrt(share), (24389 / 27 * share + 16) / 116)
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


@pytest.mark.parametrize("sight", SIGHT.values(), ids=SIGHT)
def test_the_states_have_colours_apart_for_the_colour_blind_too_and_dark_enough_for_a_line(sight):
    """CIE 1976 distance of any two above 30, where 2.3 is just seen; lightness of each at most 70 on white's 100."""
    seen = {name: lab(colour, np.array(sight)) for name, colour in STATES.items()}
    for one, other in combinations(seen, 2):
        assert np.linalg.norm(seen[one] - seen[other]) > 30, (one, other)
    assert max(colour[0] for colour in seen.values()) <= 70


@pytest.mark.parametrize("sight", SIGHT.values(), ids=SIGHT)
def test_a_diagnosis_shows_states_in_their_colours_and_phases_of_pushes_apart_from_both_models(sight):
    """CIE 1976 distances: 30 between phases, 20 from states and both models, for the colour-blind too.

    The line of the base model is apart from every state as well: it had the colour of slipping.
    """
    assert all(_PHASES[name] == colour for name, colour in STATES.items())
    pushed = [lab(_PHASES[name], np.array(sight)) for name in ("free", "in", "rest", "out")]
    assert min(np.linalg.norm(one - other) for one, other in combinations(pushed, 2)) > 30
    apart = [
        lab(line, np.array(sight)) for line in (BASE, AMENDED, *(STATES[name] for name in ("pivot", "slip", "hop")))
    ]
    assert min(np.linalg.norm(pushed[k] - other) for k in (0, 1, 3) for other in apart[:2]) > 20
    assert min(np.linalg.norm(pushed[k] - other) for k in (0, 1) for other in apart[2:]) > 20
    base = lab(BASE, np.array(sight))
    assert min(np.linalg.norm(base - lab(one, np.array(sight))) for one in (*_PHASES.values(), AMENDED)) > 25


def test_a_film_keeps_the_colours_of_the_states_as_they_are_however_rare(tmp_path):
    """Of a picture of all manner of colours, four patches of a few pixels: pivot and hop had come out alike."""
    image = np.random.default_rng(1).integers(0, 256, (120, 160, 3)).astype(np.uint8)
    colours = [ImageColor.getrgb(colour) for colour in STATES.values()]
    for place, colour in enumerate(colours):
        image[4:8, 10 * place : 10 * place + 4] = colour
    write_gif(tmp_path / "film.gif", [image])
    with Image.open(tmp_path / "film.gif") as film:
        page = np.asarray(film.convert("RGB"))
    assert [tuple(page[6, 10 * place + 2]) for place in range(4)] == colours


def test_an_added_effect_has_one_colour_in_all_figures_and_shares_it_with_no_state_and_no_other_line() -> None:
    assert AMENDED not in {BED, MODEL, *STATES.values()}
    assert _KINDS["named"] == _KINDS["with confidence"] == AMENDED


def test_the_mean_over_beds_has_the_95_percent_interval_of_each_depth_and_none_of_one_bed() -> None:
    """Three beds: t = 4.303 for two degrees of freedom, times std / sqrt(3)."""
    depth = np.array([1.0, 1.1, 0.9, 2.0])
    half = _over_beds(depth, np.array([1.0, 2.0, 3.0, 9.0]), np.array([1.0, 2.0]))
    assert half[0] == pytest.approx(4.303 / np.sqrt(3), rel=1e-3) and np.isnan(half[1])


def test_a_bar_over_beds_is_half_of_their_95_percent_interval(tmp_path, make_run) -> None:
    run = read_folder(make_run(tmp_path, frames=0))
    driven = run.of_kind("driven")
    _, half = by_speed(driven, [0.1], "work_in", 1.0)
    works = [r.quantities["work_in"]["value"] for r in driven if r.speed == 0.1]
    assert len(works) == 3 and half[0] == pytest.approx(4.303 * np.std(works, ddof=1) / np.sqrt(3), rel=1e-3)


@pytest.mark.parametrize(
    ("plot", "words"),
    [
        ("Drag against depth", "one standard deviation between beds"),
        ("Spread between beds", "one standard deviation between beds"),
        ("Set down under its load", f"bar and ±: {OVER_BEDS}"),
        ("Work in and out", OVER_BEDS),
        ("Peaks of the drops", OVER_BEDS),
    ],
)
def test_a_legend_names_each_band_and_bar(tmp_path, make_run, plot: str, words: str) -> None:
    legend = PLOTS[plot](read_folder(make_run(tmp_path, frames=0))).figure.legends[0]
    assert any(words in text.get_text() for text in legend.get_texts())


@pytest.mark.parametrize("speeds", [2, 3, 9])
def test_numbers_at_bars_lie_on_no_bar_and_not_on_one_another(tmp_path, make_run, speeds: int) -> None:
    """Work of the bed on the way out is a part in 10,000 of that on the way in: "about 0"."""
    run = read_folder(make_run(tmp_path, frames=0))
    one = next(r for r in run.of_kind("driven"))
    works = {"work_in": 7.9e-3, "work_out": -7.6e-7, "model_work_in": 8.1e-3, "model_work_out": 4.8e-3}
    runs = [replace(one, speed=0.1 * (1 + count), quantities=works) for count in range(speeds)]
    figure = PLOTS["Work in and out"](replace(run, runs=runs)).figure
    figure.draw_without_rendering()
    labels = [text for axis in figure.axes for text in axis.texts]
    assert [text.get_text() for text in labels].count("about 0") == speeds
    boxes = [text.get_window_extent() for text in labels]
    bars = [bar.get_window_extent() for axis in figure.axes for bar in axis.patches if abs(bar.get_height()) > 0.01]
    assert not any(one.overlaps(other) for one, other in combinations(boxes, 2))
    assert not any(box.overlaps(bar) for box in boxes for bar in bars)
    assert all(box.y1 < figure.legends[0].get_window_extent().y0 for box in boxes)


@pytest.mark.parametrize("columns", [None, 2])
def test_a_legend_too_wide_for_its_figure_goes_on_below(columns: int | None) -> None:
    figure = new_figure(3.0)
    legend_above(figure, [handle("a long name of a line that goes on and on and on and on", BED)] * 4, columns)
    figure.draw_without_rendering()
    box = figure.legends[0].get_window_extent()
    assert box.x0 >= 0 and box.x1 <= figure.bbox.width


# Curves of robots and platforms in space


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
