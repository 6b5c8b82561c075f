"""The page of a run in Chromium, drawn by software: something is there, time and camera change it, keys suffice."""

import io
import json

import numpy as np
import pytest
from PIL import Image

from benchmarks import view
from benchmarks.view import Browser, bed_of, chromium
from experiments.runs.progress import Progress
from vis.page.answer import write_page
from vis.page.page import Page, Section
from vis.view.page import report_scene, write_view

pytestmark = [
    pytest.mark.long,
    pytest.mark.skipif(chromium() is None, reason="no Chromium is installed (Debian: apt install chromium)"),
]
STATE = "document.querySelector('.scene').viewer.state"
DRAW = "document.querySelector('.scene').viewer.draw(1)"


@pytest.fixture(scope="module")
def page(make_run, tmp_path_factory):
    """The page of a made-up run of a spike: three runs with frames, others without."""
    return write_view(make_run(tmp_path_factory.mktemp("run"), frames=6))


@pytest.fixture(scope="module")
def browser():
    """One Chromium for all tests."""
    with Browser((1000, 760)) as started:
        yield started


def seen(browser, what="canvas"):
    """The picture, shape (height, width, 4), as the page has drawn it."""
    url = browser.value(f"({DRAW}, document.querySelector('.scene {what}').toDataURL())")
    from base64 import b64decode

    return np.asarray(Image.open(io.BytesIO(b64decode(url.split(",")[1]))).convert("RGBA")).astype(int)


def differing(one, other):
    """Share of the pixels that differ visibly."""
    return float((np.abs(one - other).max(axis=-1) > 16).mean())


def test_grains_spike_and_scale_are_drawn_and_time_changes_them(browser, page):
    browser.open(page, "frame=0")
    first = seen(browser)
    sand = (first[..., 0] > first[..., 2] + 30) & (first[..., 0] > 90)
    steel = (np.ptp(first[..., :3], axis=-1) < 24) & (first[..., 0] < 235)
    assert 0.03 < sand.mean() < 0.8 and 0.005 < steel.mean() < 0.5
    over = seen(browser, "canvas.over")
    assert (over[..., 3] > 0).mean() > 0.005  # scale bar, axes, colour scale
    browser.open(page, "frame=3")
    assert differing(first, seen(browser)) > 0.005
    assert browser.errors == []


def test_the_picture_is_the_projection_of_the_grains(browser, tmp_path):
    """One grain of radius r in front of the camera covers pi r^2 of the picture's area (parallel projection)."""
    browser.open(write_view(bed_of(tmp_path, 1, frames=1)), "az=0&el=0&cut=-1")
    picture = seen(browser)
    tall = browser.value(
        "(() => { const v = document.querySelector('.scene').viewer;"
        " return v.view(v.stage.clientWidth, v.stage.clientHeight).tall; })()"
    )
    disc = (picture[..., 0] > picture[..., 2] + 4).sum()
    assert disc == pytest.approx(np.pi * (0.0022 / tall * picture.shape[0]) ** 2, rel=0.03)


def test_hidden_grains_are_left_out_without_a_change_of_the_picture(browser, tmp_path):
    browser.open(write_view(bed_of(tmp_path, 4000, frames=1)), "az=0.7&el=0.5&cut=-1")
    picture, drawn = seen(browser), browser.value("document.querySelector('.scene').viewer.picture.drawn")
    browser.value("Picture = document.querySelector('.scene').viewer.picture, Picture.hide = (count) => "
                  "(Picture.list.set(Picture.order.subarray(0, count)), count), 0")  # fmt: skip
    assert differing(picture, seen(browser)) < 2e-4
    assert 0 < drawn < 0.7 * browser.value("Picture.drawn") == 0.7 * 4000


def test_the_keyboard_suffices(browser, page):
    browser.open(page, "frame=0")
    assert browser.value("document.activeElement.tagName") == "CANVAS"
    browser.press("ArrowRight")
    browser.press("ArrowRight")
    assert browser.value(f"{STATE}.frame") == 2
    browser.press("ArrowLeft")
    assert browser.value(f"{STATE}.frame") == 1
    browser.press("PageDown")
    assert browser.value(f"{STATE}.frame") == 5
    browser.press("PageUp")
    before, start = seen(browser), browser.value(f"[{STATE}.az, {STATE}.el, {STATE}.zoom]")
    for _ in range(4):
        browser.press("ArrowRight", shift=True)
    browser.press("ArrowUp")
    browser.press("+")
    browser.press("s")
    assert browser.value(f"{STATE}.pan") == pytest.approx([0.0, 0.1])
    assert browser.value(f"[{STATE}.az, {STATE}.el, {STATE}.zoom]") == pytest.approx(
        [start[0] + 0.48, start[1] + 0.12, 1.2]
    )
    assert differing(before, seen(browser)) > 0.02
    browser.press("Home")
    assert differing(before, seen(browser)) == 0.0
    browser.press(" ")
    assert browser.value(f"{STATE}.playing") is True
    browser.press(" ")
    assert browser.value(f"{STATE}.playing") is False
    reached = []
    for _ in range(6):
        browser.press("Tab")
        reached.append(browser.value("document.activeElement.className || document.activeElement.tagName"))
        assert float(browser.value("getComputedStyle(document.activeElement).outlineWidth").rstrip("px")) >= 2
    assert {"play", "INPUT", "SELECT"} <= set(reached)
    assert browser.errors == []


def test_the_cursor_of_the_curves_follows_and_a_click_sets_the_time(browser, page):
    browser.open(page, "frame=0")
    cursor = "+document.querySelector('.scene .cursor').getAttribute('x1')"
    browser.value(DRAW)
    at_start = browser.value(cursor)
    browser.press("PageDown")
    browser.value(DRAW)
    assert browser.value(cursor) > at_start + 100
    box = browser.value(
        "(() => { const b = document.querySelector('.scene .curves svg[aria-label]').getBoundingClientRect();"
        " return [b.x + 0.55 * b.width, b.y + 0.5 * b.height]; })()"
    )
    for kind in ("mousePressed", "mouseReleased"):
        browser.call("Input.dispatchMouseEvent", type=kind, x=box[0], y=box[1], button="left", clickCount=1)
    assert 0 < browser.value(f"{STATE}.frame") < 5


def test_depth_points_down_and_one_legend_stands_before_panels_of_the_same_lines(browser, page):
    browser.open(page)
    depth = ".scene .curves svg[aria-label^=depth]"
    points = browser.value(f"document.querySelector('{depth} polyline').getAttribute('points')")
    heights = [float(point.split(",")[1]) for point in points.split()]
    assert heights[0] < min(heights) + 1 < max(heights) - 50
    assert browser.value(f"document.querySelector('{depth}').previousSibling.querySelectorAll('text').length") == 2
    assert browser.value("document.querySelectorAll('.scene .curves svg:not([aria-label])').length") == 1


def test_colours_cut_and_runs_can_be_chosen(browser, page):
    browser.open(page, "frame=4&colour=displacement")
    one = seen(browser)
    browser.open(page, "frame=4&colour=force")
    assert differing(one, seen(browser)) > 0.02
    browser.open(page, "frame=4&colour=displacement&cut=-1")
    assert differing(one, seen(browser)) > 0.05
    browser.open(page, "frame=4&colour=nonsense&run=99")
    assert browser.value(f"{STATE}.frame") >= 0 and browser.errors == []
    assert "--frame-count" in browser.value("document.querySelector('.scene .message').textContent")


def standing(folder, states=("stand", "stand", "stand")):
    """A run that was never computed: a platform of 0.2 m stands on a law, its tips 12 mm deep."""
    names = ("t_s", "x_m", "y_m", "theta_rad", "vx_m_s", "vy_m_s", "omega_rad_s")
    rows = [
        f"{time},0.0,{0.2 * np.cos(np.pi / 8) - 0.012},0.0,0.0,0.0,0.0,{state}"
        for time, state in zip((0.0, 0.5, 1.0), states, strict=True)
    ]
    (folder / "trajectory.csv").write_text("\n".join([",".join((*names, "state")), *rows]) + "\n")
    trial = {"spike_length": 0.2, "weight": 1.0, "mass": 5.3, "stiffness": 40.0, "damping": 0.0}
    result = {
        "experiment": "tumble", "title": "made up", "ground": "spring-damper", "surface": "sand", "spike_count": 8,
        "effects": [], "trial": {name: {"value": value} for name, value in trial.items()},
    }  # fmt: skip
    (folder / "result.json").write_text(json.dumps(result))
    return folder


def test_tips_in_the_ground_of_a_law_show_through_it(browser, tmp_path):
    """From behind the block covers the tips: where it hides them once it is opaque, they show through as it is."""
    viewer = "document.querySelector('.scene').viewer"
    browser.open(write_view(standing(tmp_path)), "frame=0&az=3.1416&el=0")
    assert browser.value(f"{viewer}.scene.title").endswith("spring-damper, sand")
    pictures = []
    for change in ("0", "page.opacity = 1", "bodies = () => []", "page.opacity = 0.55"):
        browser.value(f"({viewer}.{change}, 0)" if "=" in change else change)
        pictures.append(seen(browser))
    through, opaque, opaque_alone, alone = pictures
    hidden = np.abs(opaque - opaque_alone).max(axis=-1) == 0
    shown = hidden & (np.abs(through - alone).max(axis=-1) > 12)
    assert 1e-4 < shown.mean() < 0.05
    assert (through[..., 3] == 255).all() and browser.errors == []


def test_the_legend_lists_the_states_in_the_order_of_all_figures(browser, tmp_path):
    browser.open(write_view(standing(tmp_path, states=("hop", "slip", "stand"))))
    listed = (
        "[...document.querySelectorAll('.scene svg[aria-label=\"state over time\"] text')].map((t) => t.textContent)"
    )
    assert browser.value(listed) == ["stand", "slip", "hop"]


def test_a_drag_turns_the_scene(browser, page):
    browser.open(page, "frame=2")
    before = seen(browser)
    for kind, x in (("mousePressed", 300), ("mouseMoved", 360), ("mouseReleased", 360)):
        browser.call("Input.dispatchMouseEvent", type=kind, x=x, y=300, button="left", buttons=1, clickCount=1)
    assert differing(before, seen(browser)) > 0.02


def test_a_title_that_is_a_script_does_not_run(browser, tmp_path):
    title = "</script><script>window.taken = 1</script><img src=x onerror='window.taken = 1'>"
    browser.open(write_view(bed_of(tmp_path, 30, frames=1, title=title)))
    assert browser.value("window.taken") is None
    assert browser.value("document.querySelector('h1').textContent") == title


def test_the_small_scene_of_a_report_is_drawn_when_it_comes_into_sight(browser, page):
    report = write_page(page.parent / "report.html", Page("t", [], [Section("", report_scene(page.parent))]), {})
    browser.open(report)
    browser.value("new Promise((done) => (function wait() { const v = document.querySelector('.scene').viewer;"
                  " v ? v.ready.then(done) : setTimeout(wait, 20); })())")  # fmt: skip
    picture = seen(browser)
    assert (np.ptp(picture[..., :3], axis=-1) > 25).mean() > 0.03
    ends = "((b) => [b.scrollHeight - b.clientHeight, b.scrollWidth - b.clientWidth])"
    assert browser.value(f"{ends}(document.querySelector('.scene .curves'))") == [0, 0]  # no plot is out of sight
    assert browser.errors == []


def test_bench_view_times_frames_and_leaves_nothing_but_its_numbers(tmp_path, capsys):
    bench = view.run(tmp_path, progress=Progress(), grains=300, turns=5)
    for name in ("full", "half"):
        told = bench[name]
        assert told["frames_per_second"] > 0.0 < told["processor_time_per_frame_s"] and told["grains_drawn"] > 0
        assert len(told["rounds"]["frames_per_second"]) == 2
    assert bench["what"] == "view" and bench["full"]["pixels"][0] > bench["half"]["pixels"][0]
    assert list(tmp_path.iterdir()) == [] and "frames/s" in capsys.readouterr().out
