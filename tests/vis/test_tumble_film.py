"""Pictures of a tumble on grains: a camera that follows, a colour scale that stays, arrows and tracks in place."""

import json
from dataclasses import replace
from itertools import combinations
from types import SimpleNamespace

import numpy as np
import pytest
from PIL import Image

from vis.compare.report import _alike
from vis.film import film
from vis.film.cameras import _Space, layout
from vis.film.film import Sheet, film_times, moments, run_film_job
from vis.film.reel import Reel, SpaceReel
from vis.page.plots import AXES, AXIS_LINES, DASHED, line_styles
from vis.pictures import canvas
from vis.pictures.canvas import moved_since
from vis.pictures.frames import FrameWriter
from vis.pictures.meshes import spike_mesh
from vis.pictures.scene import GROUND, PARTS, Eye
from vis.pictures.tracks import height_map
from vis.tumble.report import draw_tracks
from vis.view.sources import sources_of

LENGTH, SIZE = 0.04, (0.12, 0.03)


@pytest.fixture
def folder(tmp_path):
    """A platform of 40 mm spikes that slides 30 mm over a bed of 240 grains and moves those in front ever further."""
    time = np.linspace(0.0, 1.0, 11)
    fine = np.linspace(0.0, 1.0, 101)
    names = ("t_s", "x_m", "y_m", "theta_rad", "vx_m_s", "vy_m_s", "omega_rad_s")
    table = [fine, 0.03 * fine, np.full(101, 0.036), 0.1 * fine, np.full(101, 0.03), 0 * fine, np.full(101, 0.1)]
    rows = [",".join([*(repr(float(column[k])) for column in table), "slip"]) for k in range(101)]
    (tmp_path / "trajectory.csv").write_text("\n".join([",".join((*names, "state")), *rows]) + "\n")
    trial = {"spike_length": LENGTH, "weight": 2.0, "mass": 1.0}
    result = {
        "title": "made up", "ground": "bed", "spike_count": 8, "effects": [],
        "trial": {name: {"value": value} for name, value in trial.items()},
    }  # fmt: skip
    (tmp_path / "result.json").write_text(json.dumps(result))
    at = np.array([[0.0025 + 0.005 * i, 0.0025 + 0.005 * j, 0.0025 + 0.005 * k]
                   for i in range(24) for j in range(5) for k in range(2)])  # fmt: skip
    points, triangles = spike_mesh("sphere", diameter=0.004, length=0.008, segments=8)
    points -= points.mean(axis=0)  # about the tip: eight of them about the centre, as real ones are
    angles = np.pi / 8 + np.pi / 4 * np.arange(8)
    tips = LENGTH * np.column_stack([-np.sin(angles), np.zeros(8), -np.cos(angles)])
    writer = FrameWriter(tmp_path, name="tumble")
    for now in time:
        centre = np.array([0.05 + 0.03 * now, 0.015, 0.01 + 0.036])
        spikes = np.concatenate([points + centre + tip * 0.9 for tip in tips])
        faces = np.concatenate([triangles + k * len(points) for k in range(8)])
        moved = np.where((at[:, 0] < 0.06)[:, None], [[2e-3 * now, 0.0, 0.0]], 0.0)
        surface = height_map(
            at - [[0, 0, 1e-3 * now]] * (at[:, :1] < 0.06), np.full(len(at), 0.0025), SIZE, spacing=0.0025
        )
        surface.fields["change"] = surface.fields["height"] - 0.01
        writer.write(
            float(now), {"position": at, "radius": np.full(len(at), 0.0025), "displacement": moved},
            {"spikes": (spikes, faces), "hull": (spikes, faces)},
            clouds={"row_forces": (centre[None] - [[0, 0, 0.04]], {"force": np.array([[0.0, 0.0, 2.0]])})},
            maps={"surface": surface}, values={"theta_deg": 5.7 * float(now), "force_z": 2.0},
        )  # fmt: skip
    return tmp_path


def test_a_length_is_the_same_all_over_the_picture():
    """Parallel projection: places differ by (dx / width, dz cos(pitch) / height), the focus is in the middle."""
    eye = Eye((400, 200), width=0.4, cut=0.01, pitch=0.24)
    points = np.array([[1.0, 0.01, 2.0], [1.1, 0.01, 2.0], [1.0, 0.01, 2.05]])
    placed = eye.place(points, (1.0, 2.0))
    assert placed == pytest.approx(np.array([[0.5, 0.5], [0.75, 0.5], [0.5, 0.5 + 0.25 * np.cos(0.24)]]))


def test_the_camera_follows_and_the_scale_stays_put(folder):
    reel = Reel(folder)
    assert reel.surface == pytest.approx(0.01, abs=1e-6) and reel.cut == pytest.approx(0.015, abs=1e-6)
    sheet = Sheet([reel], (320, 180), by="displacement", opengl=False)
    whole, near = sheet.ways
    assert whole[:, 0] == pytest.approx(reel.centres()[:, 0], abs=1e-3)  # 30 mm further at the end
    assert np.ptp(near[:, 0]) > 0.02 and np.ptp(near[:, 1]) == 0.0
    assert sheet.page.norm.vmax == 2.0  # mm: what the grains that take part moved by the end, in every picture
    sheet.draw(0.0)
    sheet.draw(1.0)
    assert sheet.page.norm.vmax == 2.0


def test_the_picture_from_near_follows_a_tip_that_sinks_deep_so_that_its_arrow_stays_inside(folder):
    """The tip ends 49 mm below the surface, where a picture 25 mm high that stayed there would show it no more."""
    table = (folder / "trajectory.csv").read_text().splitlines()
    rows = [line.split(",") for line in table[1:]]
    sunk = [[r[0], r[1], repr(0.036 - 0.045 * float(r[0])), *r[3:]] for r in rows]
    (folder / "trajectory.csv").write_text("\n".join([table[0], *map(",".join, sunk)]) + "\n")
    reel = Reel(folder)
    sheet = Sheet([reel], (320, 180), by="displacement", opengl=False)
    (_, stage), (_, near) = sheet.stages, sheet.ways
    assert reel.surface - reel.lowest()[-1] > 0.04 > 1.5 * stage.height
    heights = [
        stage.place(np.array([[focus[0], reel.cut, low]]), tuple(focus))[0, 1]
        for focus, low in zip(near, reel.lowest(), strict=True)
    ]
    assert min(heights) > 0.1


def test_a_run_that_goes_on_has_arrows_of_its_forces_and_curves_with_units(folder):
    """Without an experiment's name in its result, as while it goes on, its frames are all there is."""
    (source,) = sources_of(folder)
    assert source.force == ("largest force", pytest.approx(2.0))
    angle, force = source.panels
    assert angle["label"] == "θ [degrees]" and force["label"].endswith("z [N]")
    assert angle["lines"][0]["y"][-1] == pytest.approx(5.7)


def test_the_page_says_that_grains_touch_a_cylinder_inside_the_hull_that_it_draws(folder):
    result = json.loads((folder / "result.json").read_text())
    (folder / "result.json").write_text(json.dumps(result | {"experiment": "tumble"}))
    assert "cylinder" in sources_of(folder)[0].note


def test_a_bed_narrower_than_the_picture_is_seen_down_to_its_floor_unless_two_runs_share_a_scale():
    """A robot that reaches 0.15 m about its centre, 0.1 m above a bed of 0.2 x 0.2 x 0.17 m, seen level."""
    low, high, reach = np.array([0.0, 0.0, -0.17]), np.array([0.2, 0.2, 0.0]), 0.15
    centres = np.column_stack([np.full(9, 0.1), np.full(9, 0.1), np.full(9, 0.1)])
    ends = np.column_stack([np.zeros(9), np.full(9, 0.1 + reach)])
    reel = SimpleNamespace(box=(low, high), centres=centres, ends=ends, on_grains=True, radius=0.006)
    places = {}
    for whole in (True, False):
        stage, way = _Space(whole=whole).set_up(reel, (900, 500), reach, opengl=False)
        ends = np.array([[0.1, 0.1, low[2]], [0.1, 0.1, 0.1 + reach]])
        places[whole] = stage.place(ends, (float(way[0, 0]), float(way[0, 1])))[:, 1]
    assert places[True].min() > 0.02 and places[True].max() < 0.98
    assert np.ptp(places[True]) > 0.85  # it fills the picture
    assert places[False].min() < 0.0


def test_displacement_counts_from_the_first_picture_whatever_the_setting_down_moved_and_however_grains_are_listed():
    rng = np.random.default_rng(3)
    before, moved = rng.normal(size=(6, 3)), np.arange(18.0).reshape(6, 3)
    order = rng.permutation(6)
    first = {"displacement": before, "id": np.arange(6)}
    now = {"displacement": (before + moved)[order], "id": np.arange(6)[order], "radius": np.ones(6)}
    assert moved_since(now, first)["displacement"] == pytest.approx(moved[order])
    assert moved_since(first, first)["displacement"] == pytest.approx(np.zeros((6, 3)))
    assert moved_since({"radius": np.ones(6)}, first).keys() == {"radius"}


def widths_and_reach(points):
    """Extent across and distance of the farthest point from the axis of spikes about (0, 0, 0) [m]."""
    return np.ptp(points[:, 1]), np.hypot(points[:, 0], points[:, 2]).max()


def test_spikes_and_hull_are_drawn_as_thick_and_long_as_the_run_has_them(folder, tmp_path_factory):
    """8 mm thick, 15 mm out of the hull: on grains as its result says; on a law beside it like them, else 12 in 200."""
    told = json.loads((folder / "result.json").read_text()) | {"grains": {"spike_diameter": 8e-3, "spike_clear": 0.015}}
    (folder / "result.json").write_text(json.dumps(told))
    law = tmp_path_factory.mktemp("law")
    (law / "trajectory.csv").write_bytes((folder / "trajectory.csv").read_bytes())
    (law / "result.json").write_text(json.dumps({key: value for key, value in told.items() if key != "grains"}))
    grains, alone = Reel(folder), Reel(law)
    beside = _alike([grains, alone])[1]
    assert grains.spikes == beside.spikes == (8e-3, 0.015)
    assert alone.spikes == pytest.approx((0.0024, 0.008))
    for reel, thick, clear in ((beside, 8e-3, 0.015), (alone, 0.0024, 0.008)):
        across, _ = widths_and_reach(reel._meshes["spikes"][0])
        assert across == pytest.approx(thick, rel=0.02)
        assert widths_and_reach(reel._meshes["hull"][0])[1] == pytest.approx(LENGTH - clear)
    assert widths_and_reach(grains._meshes["hull"][0])[1] == pytest.approx(LENGTH - 0.015)


def test_two_runs_are_pictured_at_the_times_of_the_one_with_frames(folder, tmp_path_factory):
    """Frames every 0.1 s, a law at any time: stills and film of both show the same instants."""
    law = tmp_path_factory.mktemp("law")
    for name in ("trajectory.csv", "result.json"):
        (law / name).write_bytes((folder / name).read_bytes())
    reels = [Reel(folder), Reel(law)]
    for time in (*(moment[2] for moment in moments(reels)), *film_times(reels)):
        assert reels[0].times[reels[0].nearest(time)] == pytest.approx(time, abs=1e-12)
        assert reels[1].times[reels[1].nearest(time)] == pytest.approx(time, abs=1.1e-3)
    assert len(film_times(reels)) == 11 and len(film_times(reels[1:])) == 48


def test_stills_film_and_tracks_are_drawn_without_opengl(folder):
    job = {
        "runs": [(str(folder), Reel(folder).spikes)], "labels": None,
        "pictures": [
            {"file": str(folder / "still.png"), "times": [1.0], "size": [640, 360], "by": "displacement"},
            {"file": str(folder / "film.gif"), "times": [0.0, 0.5, 1.0], "size": [320, 180], "by": "displacement"},
        ],
    }  # fmt: skip
    seen = []
    run_film_job(job, opengl=False, step=lambda: seen.append(1))
    assert len(seen) == 4
    still = np.asarray(Image.open(folder / "still.png")).astype(int)
    assert still.shape == (360, 640, 3)
    red = (abs(still - [176, 0, 32]) < 40).all(axis=2)  # the arrows of the weight and of the row's force
    assert red[:, 280:580].sum() > 60
    with Image.open(folder / "film.gif") as film:
        assert film.n_frames == 3
    tracks = draw_tracks(Reel(folder), folder / "tracks.png")
    assert tracks.file.stat().st_size > 5000


def red_of_the_feet(sheet):
    """Where the sheet at 0 s has the arrows' red in the picture from near, its weight's arrow and text left out."""
    image = sheet.draw(0.0).astype(int)
    left, foot, width, height = sheet.panels[1].place
    rows = slice(round((1 - foot - height) * image.shape[0]), round((1 - foot) * image.shape[0]))
    columns = slice(round((left + 0.3 * width) * image.shape[1]), round((left + width) * image.shape[1]))
    return (abs(image[rows, columns] - [176, 0, 32]) < 40).all(axis=2)


def with_force(monkeypatch, x, force):
    """Every frame with this force [N], shape (3,), on one row at x [m]."""
    kept = Reel.frame

    def frame(self, index):
        point = np.array([[x, self.cut, self.surface]])
        return replace(kept(self, index), clouds={"row_forces": (point, {"force": np.array([force])})})

    monkeypatch.setattr(Reel, "frame", frame)


@pytest.mark.parametrize("aside", [0.0, 6.0])
def test_the_arrow_of_four_weights_is_cut_at_the_edge_and_says_its_number(folder, monkeypatch, aside):
    """Its head would lie outside the picture: longer than that of one weight, up to the edge, with `8.00 N`."""
    sheet = Sheet([Reel(folder)], (640, 360), by="displacement", opengl=False)
    said, x = [], sheet.ways[1][0, 0]
    monkeypatch.setattr(canvas, "_note", lambda axis, end, words: said.append((*end, words)))
    reds = []
    for force in ([0.0, 0.0, 2.0], [aside, 0.0, 8.0]):
        with monkeypatch.context() as patch:
            with_force(patch, x, force)
            reds.append(red_of_the_feet(sheet))
    assert reds[1].sum() > 1.5 * reds[0].sum() > 0
    assert len(said) == 1
    (x, y, words) = said[0]
    assert max(x, y) == pytest.approx(0.99) and min(x, y) > 0.3
    assert words == f"{'10.0' if aside else '8.00'}\N{NO-BREAK SPACE}N, arrow cut"


@pytest.mark.parametrize("words", ["made up", "made up of " + "many words " * 14])
def test_a_title_ends_where_the_panels_end(folder, monkeypatch, words):
    """In full size where it has room; a long one in smaller letters, none of which is cut off."""
    reel, drawn, ends = Reel(folder), canvas.drawn, []
    reel.result["title"] = words

    def measured(page):
        title = next(text for text in page.texts if text.get_text().startswith("Made up"))
        ends.append((title.get_window_extent().x1 / page.bbox.width, title.get_fontsize()))
        return drawn(page)

    monkeypatch.setattr(canvas, "drawn", measured)
    sheet = Sheet([reel], (640, 360), by="displacement", opengl=False)
    sheet.draw(0.0)
    ((end, size),) = ends
    last = max(panel.place[0] + panel.place[2] for panel in sheet.panels)
    assert end <= 1.005 * last and (size == 15.0) == (words == "made up")


def test_an_arrow_is_cut_where_it_leaves_the_picture_and_left_out_where_it_misses_it():
    """From (0.5, 0.2) straight up by 1.2: inside for 0.79 / 1.2 of the way. One beside the picture is nowhere in it."""
    inside = canvas._inside(np.array([0.5, 0.2]), np.array([0.5, 1.4]))
    assert inside == pytest.approx((0.0, 0.79 / 1.2))
    assert canvas._inside(np.array([0.5, 0.2]), np.array([0.6, 0.9])) == (0.0, 1.0)
    for foot, head in (([1.2, 0.2], [1.2, 0.9]), ([1.2, 0.2], [1.1, 0.9])):
        low, high = canvas._inside(np.array(foot), np.array(head))
        assert low >= high


# A robot on a law, from the side --------------------------------------------------------------------------------------

BLOCK = 0.05
"""Edge of the cube that stands for a robot, and of its foot below it [m]."""


@pytest.fixture(params=[0.06, 0.6])
def hop(request, tmp_path):
    """A cube on a cubic foot that hops so high [m] over a law, in 20 frames; it begins 5 mm in the ground."""
    rise, time = request.param, np.linspace(0.0, 1.0, 20)
    trial = {"weight": {"value": 2.0}}
    result = {"title": "cube on sand", "experiment": "mujoco", "ground": "rft", "trial": trial}
    (tmp_path / "result.json").write_text(json.dumps(result))
    (tmp_path / "trajectory.csv").write_text("t_s,z_m\n0.0,0.0\n1.0,0.0\n")
    cube = BLOCK * (np.array([[i, j, k] for i in (0, 1) for j in (0, 1) for k in (0, 1)]) - [0.5, 0.5, 0.0])
    sides = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    faces = np.array([corner for a, b, c, d in sides for corner in ([a, b, c], [a, c, d])])
    writer = FrameWriter(tmp_path, name="robot")
    for now in time:
        low = np.array([0.2 * now, 0.0, rise * 4 * now * (1 - now) - 0.005])
        nothing = {"position": np.zeros((0, 3)), "radius": np.zeros(0)}
        writer.write(float(now), nothing, {"spikes": (cube + low, faces), "hull": (cube + low + [0, 0, BLOCK], faces)})
    return tmp_path, rise


def test_a_robot_on_a_law_is_seen_level_with_the_surface_and_its_height_in_scale(hop):
    """Rows of the picture: what lies between ground and foot, over the pixels of a metre, is the height of the foot."""
    folder, rise = hop
    reel = SpaceReel(folder)
    sheet = Sheet([reel], (1600, 1000), by="displacement", opengl=False)
    (stage,), (way,), (panel,) = sheet.stages, sheet.ways, sheet.panels
    image = sheet.draw(0.5).astype(int)
    index = reel.nearest(0.5)
    up = reel.lowest(reel.frame(index))[2]
    assert up == pytest.approx(4 * rise * reel.times[index] * (1 - reel.times[index]) - 5e-3, abs=1e-6)
    assert f"lowest foot {1e3 * up:.3g} mm above" in reel.line(index)
    assert "5 mm below" in reel.line(0) and sheet.panels[0].camera.arrow
    reel.loads[:] = 345.6
    assert reel.line(0).endswith("force 346\N{NO-BREAK SPACE}N") and "force" not in reel.line(0, short=True)
    beside = round((panel.place[0] + 0.3 * panel.place[2]) * 1600)
    ground = np.flatnonzero((abs(image[:, beside] - np.round(255 * np.array(GROUND))) < 4).all(axis=1))
    if rise > 0.5:  # the camera follows: the ground has left the picture, and the robot is in its middle
        assert not len(ground) and way[index, 1] == pytest.approx(up + BLOCK, abs=0.02)
        return
    middle = round((panel.place[0] + 0.5 * panel.place[2]) * 1600) - 8
    foot = np.flatnonzero((abs(image[:, middle] - np.round(255 * np.array(PARTS["spikes"]))) < 4).all(axis=1))
    pixel = stage.height / (panel.place[3] * 1000)
    # the line of the surface and the rims of ground and foot cover a pixel or so each
    assert (ground[0] - foot[-1]) * pixel == pytest.approx(up, abs=4 * pixel)
    assert np.ptp(way[:, 1]) == 0.0  # the picture stays as high as it was


def test_two_robots_on_laws_share_a_scale_and_one_beside_grains_is_seen_from_above_as_that_is(hop):
    reel = SpaceReel(hop[0])
    sheet = Sheet([reel, SpaceReel(hop[0])], (800, 500), by="displacement", opengl=False, labels=["one", "other"])
    assert sheet.stages[0].height == sheet.stages[1].height
    assert "Both robots" in moments([reel, reel], ["one", "other"])[0][3]
    kinds = {type(panel.camera).__name__ for panel in layout([reel, SpaceReel(hop[0])])}
    reel.__dict__["_first"] = SimpleNamespace(grains={"position": np.zeros((1, 3)), "radius": np.ones(1)})
    assert kinds == {"_Level"} and {type(p.camera) for p in layout([reel, SpaceReel(hop[0])])} == {_Space}


def test_lines_of_x_and_y_on_one_another_both_show_and_joints_have_none_of_the_axes_colours():
    assert AXIS_LINES["x"]["lw"] > 1.5 * AXIS_LINES["y"]["lw"] and AXIS_LINES["y"]["ls"] == DASHED
    assert AXIS_LINES["x"]["zorder"] < AXIS_LINES["z"]["zorder"] < AXIS_LINES["y"]["zorder"]
    beside = line_styles(range(15), beside_axes=True)
    assert not {style["color"] for style in beside.values()} & set(AXES.values())
    assert len({(style["color"], str(style["ls"])) for style in beside.values()}) == 15


def test_words_above_two_pictures_do_not_lie_on_each_other(hop, monkeypatch):
    """Titles, lines of time and state, and the weight's; at the size of a report's picture."""
    drawn, pixels, pages = canvas.drawn, canvas.pixels, []
    monkeypatch.setattr(canvas, "drawn", lambda page: pages.append(page) or drawn(page))
    monkeypatch.setattr(canvas, "pixels", lambda page, over: pages.append(page) or pixels(page, over=over))
    reels = [SpaceReel(hop[0]), SpaceReel(hop[0])]
    Sheet(reels, SpaceReel.still, by="displacement", opengl=False, labels=["bed of sand", "spring-damper"]).draw(0.0)
    boxes = [text.get_window_extent() for page in pages for text in page.texts]
    assert len(boxes) >= 6
    assert not [(a, b) for a, b in combinations(boxes, 2) if a.overlaps(b)]


def test_a_robot_on_grains_is_pictured_at_its_largest_force_and_its_end_shows_what_rose_and_sank(tmp_path, monkeypatch):
    """Under a foot that goes 8 mm deep the scale reaches 8 mm: blue has risen, red has sunk, a level bed is pale.

    The force at 0.5 s is the largest; the foot is seen from near, in the plane of its middle.
    """
    surface, grains = 0.05, np.random.default_rng(1).uniform((0.0, 0.0, 0.0), (0.2, 0.2, 0.055), (300, 3))
    result = {
        "title": "cube on a bed of sand", "experiment": "mujoco", "ground": "bed",
        "grains": {"origin": [0, 0, surface]}, "trial": {"weight": {"value": 2.0}},
    }  # fmt: skip
    (tmp_path / "result.json").write_text(json.dumps(result))
    (tmp_path / "trajectory.csv").write_text("t_s,z_m\n0.0,0.0\n1.0,0.0\n")
    cube = BLOCK * (np.array([[i, j, k] for i in (0, 1) for j in (0, 1) for k in (0, 1)]) - [0.5, 0.5, 0.0])
    faces = np.array([[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5]])
    writer = FrameWriter(tmp_path, name="robot")
    moved = np.random.default_rng(2).uniform(-0.01, 0.01, (300, 3))
    for now, force in ((0.0, 0.0), (0.5, 12.0), (0.75, 3.0), (1.0, 1.0)):
        held = {"position": grains, "radius": np.full(300, 2e-3), "displacement": now * moved}
        low = np.array([0.1, 0.1, surface - 0.008 * now])
        pushed = {"row_forces": (low[None], {"force": np.array([[0.0, 0.0, force]])})}
        bodies = {"spikes": (cube + low, faces), "hull": (cube + low + [0, 0, BLOCK], faces)}
        writer.write(now, held, bodies, clouds=pushed)
    reel, jobs = SpaceReel(tmp_path), []
    monkeypatch.setattr(film, "carry_out", lambda job, *rest, **more: jobs.append(job) or ("opengl", []))
    drawn = film.draw_runs([reel], tmp_path, "robot", by="displacement", film=True)
    assert [picture["by"] for picture in jobs[0]["pictures"]] == [
        "displacement",
        "displacement",
        "height",
        "displacement",
    ]
    assert "sunk" in drawn.stills[-1].caption and "sunk" not in drawn.stills[0].caption
    assert [still.file.stem for still in drawn.stills] == ["robot-start", "robot-force", "robot-end"]
    assert jobs[0]["pictures"][1]["times"] == [0.5] and "12.0\N{NO-BREAK SPACE}N" in drawn.stills[1].caption
    assert reel.colour_top("height") == 8.0
    page = canvas.Page((400, 300), "height", 8.0)
    level, colours = page.colours(reel.frame(0).grains), page.colours(reel.frame(3).grains)
    assert np.ptp(level, axis=0).max() == 0.0 and level[0, :3].min() > 0.9
    assert (colours[moved[:, 2] > 3e-3, 2] > colours[moved[:, 2] > 3e-3, 0]).all()  # blue
    assert (colours[moved[:, 2] < -3e-3, 0] > colours[moved[:, 2] < -3e-3, 2]).all()  # red
    sheet = Sheet([reel], (400, 250), by="height", opengl=False)
    assert sheet.panels[1].camera.arrow and sheet.stages[1].cut == pytest.approx(0.1, abs=1e-6)
    assert sheet.ways[1][:, 0] == pytest.approx(0.1, abs=1e-3)  # the foot in the middle
    assert sheet.stages[1].width < sheet.stages[0].width
    sheet.draw(1.0)


def test_a_picture_has_nothing_of_the_one_that_was_drawn_before_it(folder):
    """What stays is drawn once: a later picture of a sheet is bitwise the first of another, the bar of colours too."""
    reel = Reel(folder)
    sheet, other = (Sheet([reel], (640, 360), by="displacement", opengl=False) for _ in range(2))
    first, later = sheet.draw(0.0), sheet.draw(1.0)
    assert np.array_equal(later, other.draw(1.0)) and not np.array_equal(first, later)
    left, foot, wide, high = reel.bar
    rows = slice(round(360 * (1 - foot - high)), round(360 * (1 - foot)))
    bar = later[rows, round(640 * left) : round(640 * (left + wide))]
    assert len(np.unique(bar.reshape(-1, 3), axis=0)) > 50


def test_the_line_of_the_surface_is_named_in_the_upper_corner_and_hides_no_grains(folder, monkeypatch):
    drawn = []
    monkeypatch.setattr(canvas, "pixels", lambda figure, over=None: drawn.append(figure))
    Sheet([Reel(folder)], (640, 360), by="displacement", opengl=False).draw(0.5)
    words = [
        text for axis in drawn[-1].axes for text in axis.texts if text.get_text() == "undisturbed surface at the cut"
    ]
    assert len(words) == 2 and all(text.get_position()[1] > 0.9 for text in words)
