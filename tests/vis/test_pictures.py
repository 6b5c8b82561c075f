"""Pictures show something, and what they show depends on the data; without OpenGL sections stand in."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure
from PIL import Image

from dem.grains.materials import MATERIALS
from vis.pictures import canvas, pictures
from vis.pictures.canvas import colour_values, nice_above
from vis.pictures.pictures import make_pictures, opengl_available
from vis.pictures.render import ARROW, CUT, write_gif
from vis.pictures.scene import Scene

SMALL = {"size": (400, 300), "animation_size": (200, 150)}


@pytest.fixture
def needs_opengl():
    if not opengl_available():
        pytest.skip("no OpenGL for off-screen pictures here (apt install libegl1 libgl1-mesa-dri)")


def pixels(path):
    return np.asarray(Image.open(path).convert("RGB")).astype(int)


def check(made, folder):
    """Every file is there and shows something: much that is not white, in many colours, sand and dark among them."""
    assert len(made.stills) == 4  # deepest, speed, pulled out; the fastest run at its deepest
    for picture in made.stills:
        image = pixels(picture.file)
        assert image.shape == (300, 400, 3)
        bed = image[120:260, 60:330].reshape(-1, 3)
        assert np.mean(bed.min(axis=1) < 240) > 0.5
        assert len(np.unique(bed, axis=0)) > 100
    with Image.open(folder / "animation.gif") as animation:
        assert animation.n_frames == 5
        assert animation.size == (200, 150)
        first = np.asarray(animation.convert("RGB")).astype(int)
        animation.seek(1)
        second = np.asarray(animation.convert("RGB")).astype(int)
    assert np.abs(first - second).max() > 60  # the spike moves
    assert (first[-1, 0] == 255).all()


def redness(path):
    """Mean of red minus blue over the middle of the bed: it falls as pale sand turns violet."""
    image = pixels(path)[120:260, 100:300]
    image = image[image.min(axis=2) < 240]
    return float((image[:, 0] - image[:, 2]).mean())


def test_sections_stand_in_without_opengl(tmp_path, monkeypatch, make_run):
    monkeypatch.setenv("HEDGEBED_NO_OPENGL", "1")
    assert not opengl_available()
    folder = make_run(tmp_path, frames=5)
    done = []
    made = make_pictures(folder, **SMALL, progress=done.append)
    assert made.method == "sections"
    assert any("OpenGL" in note for note in made.notes)
    assert done == sorted(done)
    assert done[-1] == 1.0
    check(made, folder)
    deepest, speed, end = (picture.file for picture in made.stills[:3])
    assert np.abs(pixels(deepest) - pixels(end)).max() > 100
    assert redness(speed) != pytest.approx(redness(deepest), abs=0.5)


def test_rendered_with_opengl(tmp_path, needs_opengl, make_run):
    folder = make_run(tmp_path, frames=5)
    made = make_pictures(folder, **SMALL)
    assert made.method == "opengl", made.notes
    check(made, folder)
    deepest, speed, end = (picture.file for picture in made.stills[:3])
    assert np.abs(pixels(deepest) - pixels(end)).max() > 100
    assert redness(speed) != pytest.approx(redness(deepest), abs=0.5)


def test_a_flat_tip_meets_the_scale_of_depth(needs_opengl):
    """The spike is cut at the plane that the scale lies in: its lower edge is where `place` puts the tip's depth."""
    from vis.pictures.frames import Frame
    from vis.pictures.meshes import spike_mesh
    from vis.pictures.scene import Scene

    points, triangles = spike_mesh("flat", diameter=0.016, length=0.06)
    tip = np.array([0.036, 0.036, 0.030])
    scene = Scene((400, 300), np.zeros(3), np.array([0.072, 0.072, 0.05]), cut=0.036, radius=0.0012)
    far = {"position": np.array([[0.002, 0.07, 0.002]]), "radius": np.array([0.0012])}
    image = scene.render(Frame(0.0, far, {"spike": (points + tip, triangles)}, {}), np.ones((1, 4))).astype(int)
    scene.close()
    across, up = scene.place(tip[None])[0]
    column = image[:, round(400 * across)]
    lowest = np.flatnonzero((column.max(axis=1) < 245) & (np.arange(300) < 300 * (1 - up) + 20)).max()
    assert lowest == pytest.approx(300 * (1 - up), abs=2.5)


def test_the_set_down_has_a_scale_of_its_own(tmp_path, make_run):
    """What a drive moves by millimetres a set-down moves by less: on the drive's scale nothing would be seen."""
    folder = make_run(tmp_path, frames=2)
    run = pictures.read_folder(folder)
    (folder / "frames/set_down-seed1.pvd").write_text((folder / "frames/driven-0.1-seed1.pvd").read_text())
    job, stills, _ = pictures._plan(run, (40, 30), None, [])
    rest = next(view for view, still in zip(job["views"], stills, strict=True) if "at rest" in still.title)
    assert rest["top"] <= min(view["top"] for view in job["views"] if view["by"] == "displacement")
    tops = {view["top"] for view in job["views"] if view["by"] == "displacement" and view is not rest}
    assert len(tops) == 1


def test_the_camera_is_low_where_a_spike_hardly_sinks(tmp_path, make_run):
    """The surface behind the cut rises by tilt x its extent: no more than the spike sinks, within the bounds."""
    run = pictures.read_folder(make_run(tmp_path, frames=2))
    story = pictures._tell(run, "driven-0.1-seed1")
    for depth, tilt in ((0.0001, 0.06), (0.003, 0.1), (0.030, 0.15)):
        assert pictures._tilt(replace(story, depth=np.array([0.0, depth])), 0.030) == pytest.approx(tilt)


def test_the_undisturbed_surface_is_dashed_across_the_cut(monkeypatch):
    drawn = []
    monkeypatch.setattr(canvas, "pixels", lambda figure: drawn.append(figure))
    page = canvas.Page((400, 300), "displacement", 1.0)
    places = {"place": lambda points: points[:, [0, 2]], "section": (0.2, 0.8, 0.0, 0.1, 0.6)}
    page.compose("A title", "", lambda axis: None, **places)
    (line,) = (line for line in drawn[0].axes[0].lines if line.is_dashed())
    assert line.get_xydata().tolist() == [[0.2, 0.6], [0.8, 0.6]]


@pytest.mark.parametrize(("newtons", "shown", "long"), [(68.8, "10 N", 10 / 68.8), (2.0, "0.5 N", 0.25)])
def test_the_arrow_of_a_force_has_a_scale_beside_the_length(monkeypatch, newtons, shown, long):
    """The arrow of a round force, in fractions of the height of a picture of 4:3, on the line of the length."""
    drawn = []
    monkeypatch.setattr(canvas, "pixels", lambda figure: drawn.append(figure))
    page = canvas.Page((400, 300), "displacement", 1.0)
    places = {"place": lambda points: points[:, [0, 2]], "section": (0.2, 0.8, 0.0, 0.2, 0.6)}
    page.compose("A title", "", lambda axis: None, **places, newtons=newtons)
    page.compose("A title", "", lambda axis: None, **places)
    (arrow,) = (text for text in drawn[0].axes[0].texts if getattr(text, "arrow_patch", None) is not None)
    assert 4 / 3 * (arrow.xy[0] - arrow.xyann[0]) == pytest.approx(long)
    assert shown in [text.get_text() for text in drawn[0].axes[0].texts]
    assert not any(text.get_text().endswith(" N") for text in drawn[1].axes[0].texts)
    (ruler,) = (text for text in drawn[0].axes[0].texts if text.get_text().endswith("00 mm"))
    assert ruler.get_position()[1] == pytest.approx(arrow.xy[1] - 0.012)


def test_words_of_a_page_stay_on_it_and_off_the_bed(monkeypatch, needs_opengl):
    """The longest small print and four lines of numbers, around a bed that is wide and one that is deep."""
    drawn = []
    monkeypatch.setattr(canvas, "pixels", lambda figure: drawn.append(figure))
    for high in ((0.1, 0.1, 0.04), (0.1, 0.1, 0.3)):
        box = np.zeros(3), np.array(high)
        scene, lines = Scene((400, 300), *box, cut=0.5 * high[1], radius=0.001, tilt=0.15), "bed 1\nt\ndepth\nforce"
        page, section = canvas.Page((400, 300), "displacement", 1.0), (0.0, high[0], 0.5 * high[1], 0.0, high[2])
        note = f"1,000,000 grains; {CUT}; {ARROW}"
        page.compose("A\nB\nC", lines, lambda axis: None, place=scene.place, section=section, note=note)
        top = scene.place(np.array([[0.0, high[1], high[2]]]))[0, 1]
        scene.close()
        drawn[-1].draw_without_rendering()
        boxes = [text.get_window_extent().transformed(drawn[-1].transFigure.inverted()) for text in drawn[-1].texts]
        assert all(box.x0 > 0.0 and box.x1 < 1.0 and box.y0 > 0.0 for box in boxes)
        assert min(box.y0 for box in boxes[:2]) > top
        on_page = {text.get_text(): text.get_window_extent() for text in drawn[-1].axes[0].texts}
        edge = drawn[-1].bbox.width * scene.place(np.zeros((1, 3)))[0, 0]
        assert 0.0 < on_page["undisturbed\nsurface"].x0 < on_page["undisturbed\nsurface"].x1 < edge


def test_a_renderer_that_dies_costs_no_pictures(tmp_path, monkeypatch, make_run):
    monkeypatch.setattr(pictures, "opengl_available", lambda: True)
    monkeypatch.setattr(pictures.sys, "executable", "/bin/false")
    made = make_pictures(make_run(tmp_path, frames=2), **SMALL, animate=False)
    assert made.method == "sections"
    assert "exit status 1" in made.notes[0]
    assert all(picture.file.exists() for picture in made.stills)


def test_a_renderer_that_hangs_is_given_up(tmp_path, monkeypatch, make_run):
    hang = tmp_path / "hang"
    hang.write_text("#!/bin/sh\nexec sleep 60\n")
    hang.chmod(0o755)
    monkeypatch.setattr(pictures, "opengl_available", lambda: True)
    monkeypatch.setattr(pictures.sys, "executable", str(hang))
    made = make_pictures(make_run(tmp_path / "run", frames=2), **SMALL, animate=False, stall=0.3)
    assert made.method == "sections"
    assert "no picture within" in made.notes[0]


def test_without_frames_there_are_no_pictures(tmp_path, make_run):
    made = make_pictures(make_run(tmp_path, frames=0))
    assert (made.method, made.stills, made.animation) == ("none", [], None)
    assert "no frames" in made.notes[0]


def test_colours_are_in_the_unit_of_their_label():
    grains = {"displacement": np.array([[0.003, 0.004, 0.0]]), "velocity": np.array([[0.0, 0.0, -0.2]])}
    assert colour_values(grains, "displacement") == pytest.approx([5.0])  # mm
    assert colour_values(grains, "speed") == pytest.approx([200.0])  # mm/s
    with pytest.raises(ValueError, match="force"):
        colour_values(grains, "force")
    assert [nice_above(x) for x in (0.0, 0.93, 1.0, 6.1, 12.0)] == [1.0, 1.0, 1.0, 8.0, 15.0]


def test_gif_keeps_to_its_limit(tmp_path):
    rng = np.random.default_rng(0)
    images = [rng.integers(0, 256, (60, 80, 3), dtype=np.uint8) for _ in range(30)]
    write_gif(tmp_path / "small.gif", images, limit=60_000)
    assert (tmp_path / "small.gif").stat().st_size <= 60_000
    write_gif(tmp_path / "large.gif", images, limit=10_000_000)
    with Image.open(tmp_path / "large.gif") as animation:
        assert animation.n_frames == 30


def test_the_deepest_picture_is_from_before_the_pull_out(tmp_path, make_run):
    folder = make_run(tmp_path, frames=9)
    run = pictures.read_folder(folder)
    for name in pictures.frame_names(folder):
        story = pictures._tell(run, name)
        if story.run.kind != "driven":
            continue
        out = story.run.bed.time[np.flatnonzero(story.run.bed.phase == "out")[0]]
        time, depth = story.frames.times[story.deepest], story.depth[story.deepest]
        assert time < out
        before = [d for d, t in zip(story.depth, story.frames.times, strict=True) if t < out]
        assert depth == pytest.approx(max(before), rel=3e-3)


@pytest.mark.parametrize("material", MATERIALS)
@pytest.mark.parametrize("gravity", ["9.81 m/s²", "0.00981 m/s²"])
def test_a_title_ends_left_of_a_foot_as_wide_as_a_quarter_of_the_bed(material, gravity):
    """Its left edge is at 0.428 of the page of 8 inches; the title begins at 0.03, in bold type of 16 points."""
    figure = Figure(figsize=(8.0, 6.0))
    title = pictures._above("Set down", f"{material}, {gravity}")
    assert title.replace("\n", " ") == f"Set down {material}, {gravity}"
    box = figure.text(0.03, 0.9, title, fontsize=16, fontweight="bold").get_window_extent()
    assert box.x1 < 0.42 * figure.bbox.width
