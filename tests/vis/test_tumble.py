"""The report of a tumble from its folder alone: figures, animation, page; whatever the states are."""

import json
import re

import numpy as np
import pytest
from PIL import Image

from vis import write_report
from vis.page.answer import write_page
from vis.page.folder import read_columns
from vis.page.page import Page, Section, figure, table, text
from vis.page.report import Report
from vis.page.states import state_runs
from vis.tumble.report import write_tumble_report


@pytest.fixture
def folder(tmp_path):
    """A tumble that was never computed: it stands, pivots and hops."""
    time = np.linspace(0.0, 1.0, 1001)
    theta = 0.5 * time**2
    state = np.where(time < 0.2, "stand", np.where(time < 0.7, "pivot", "hop"))
    rows = {
        "t_s": time, "x_m": 0.05 * time, "y_m": 0.185 + 0.01 * time, "theta_rad": theta,
        "vx_m_s": np.full_like(time, 0.05), "vy_m_s": np.full_like(time, 0.01), "omega_rad_s": time,
    }  # fmt: skip
    (tmp_path / "series").mkdir()
    header = ",".join([*rows, "state"])
    body = [",".join([*(repr(float(v[k])) for v in rows.values()), state[k]]) for k in range(len(time))]
    (tmp_path / "trajectory.csv").write_text("\n".join([header, *body]) + "\n")
    energies = np.stack([time, 0.01 * theta, 0.011 * theta, 0.001 * theta], axis=1)
    np.savetxt(
        tmp_path / "series" / "motion.csv", energies, delimiter=",", comments="",
        header="t_s,energy_J,torque_work_J,dissipated_J",
    )  # fmt: skip
    names = ("trajectory_angle", "max_speed", "max_angular_velocity", "transition_angle_slip", "transition_angle_hop")
    quantities = {name: {"value": 0.3, "std": 0.0, "unit": "rad"} for name in names}
    quantities["transition_angle_slip"]["value"] = None
    result = {
        "experiment": "tumble", "version": "0", "title": "A <made up> tumble", "duration": 1.0, "spike_count": 8,
        "quantities": quantities | {"energy_residual": {"value": 1e-9, "std": 0.0, "unit": "1"}},
        "trial": {
            "spike_length": {"value": 0.2, "unit": "m", "origin": "given"},
            "torque_until": {"value": None, "unit": "s", "origin": "default"},
        },
        "ground": "spring-damper", "actuator": "motor", "method": "located", "warnings": ["mind the gap"],
        "departures": {"sentences": ["It hops early."]},
        "effects": [{"id": "pendulum", "parameters": {"length": 2.2}}],
        "transitions": [{"time": 0.2, "state": "pivot", "theta": 0.02}] * 70,
    }  # fmt: skip
    (tmp_path / "result.json").write_text(json.dumps(result))
    return tmp_path


def test_the_report_of_a_tumble_has_its_figures_numbers_and_warnings(folder):
    page = write_report(folder).read_text()
    assert page.count("data:image/png") == 3 and page.count("data:image/gif") == 1
    for words in (
        "A &lt;made up&gt; tumble",
        "It hops early.",
        "Mind the gap",
        "pendulum (length = 2.2)",
        "And 10 more",
        "17.2°",
        "none",
    ):
        assert words in page, words
    assert "https://" not in page and "<script" not in page


def test_the_report_of_a_tumble_on_a_law_holds_the_scene_which_can_be_turned_and_stays_small(folder):
    result = json.loads((folder / "result.json").read_text())
    for name, value in {"weight": 0.9, "mass": 5.3, "stiffness": 80.0, "damping": 0.3}.items():
        result["trial"][name] = {"value": value, "unit": "SI", "origin": "given"}
    (folder / "result.json").write_text(json.dumps(result))
    page = write_report(folder)
    text = page.read_text()
    assert text.count("class Viewer") == 1 and text.index('class="head"') < text.index("data:image/png")
    assert page.stat().st_size < 1e6
    assert "class Viewer" not in write_tumble_report(folder, pictures=False).read_text()


def test_the_picture_of_the_path_has_the_title_of_the_result(folder, monkeypatch):
    titles, draw = {}, Report.draw

    def keep(report, key, drawing, **values):
        block = draw(report, key, drawing, **values)
        titles[key] = [text.get_text() for text in drawing.texts]
        return block

    monkeypatch.setattr(Report, "draw", keep)
    write_tumble_report(folder)
    assert json.loads((folder / "result.json").read_text())["title"] in titles["trajectory"]


def test_the_animation_lasts_as_long_as_the_tumble(folder):
    write_tumble_report(folder)
    with Image.open(folder / "animation.gif") as movie:
        assert 10 <= movie.n_frames <= 60
        assert movie.n_frames * movie.info["duration"] == pytest.approx(1000, rel=0.15)


def test_pictures_show_the_platform_where_it_is(folder):
    write_tumble_report(folder)
    with Image.open(folder / "animation.gif") as movie:
        movie.seek(0)
        image = np.array(movie.convert("RGB")).astype(int)
    # Where the ground begins, from the bottom up: theta = 0 puts two tips on it, l cos(pi/8) below the centre.
    soil = (np.abs(image - [236, 230, 220]).sum(axis=2) < 6).any(axis=1)
    assert soil[-1] and not soil[: len(soil) // 2].any()


def test_a_folder_without_a_trajectory_is_refused(folder):
    (folder / "trajectory.csv").unlink()
    with pytest.raises(FileNotFoundError, match=r"trajectory\.csv"):
        write_report(folder)


def test_stretches_of_one_state_cover_all_rows():
    states = np.array(["slip", "slip", "hop", "slip"])
    assert state_runs(states) == [(0, 2, "slip"), (2, 3, "hop"), (3, 4, "slip")]
    assert state_runs(np.array([], dtype=str)) == []


def test_columns_read_as_numbers_and_states_as_words(folder):
    numbers, states = read_columns(folder / "trajectory.csv")
    assert numbers["theta_rad"][-1] == 0.5 and states[0] == "stand"
    assert "state" not in numbers


def test_a_page_escapes_what_it_says_and_refuses_what_is_no_picture(tmp_path):
    page = Page("<b>", ["a & b"], [Section("1 < 2", [text("<script>"), table(("x",), [("<i>",)])])])
    written = write_page(tmp_path / "page.html", page, {}).read_text()
    assert "<script>" not in written and "&lt;script&gt;" in written and "&lt;i&gt;" in written
    (tmp_path / "a.txt").write_text("")
    with pytest.raises(ValueError, match=r"a\.txt is no picture"):
        figure(tmp_path / "a.txt", title="", caption="")


def test_a_tumble_that_never_gets_away_has_a_report_without_an_angle(folder):
    result = json.loads((folder / "result.json").read_text())
    result["quantities"]["trajectory_angle"]["value"] = None
    (folder / "result.json").write_text(json.dumps(result))
    page = write_tumble_report(folder).read_text()
    assert re.search(r"<td[^>]*>Trajectory angle</td><td[^>]*>none</td>", page)
