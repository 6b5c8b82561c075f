"""A run as a page: it holds the run's numbers, needs no network, keeps to its limit and says what it leaves out."""

import html
import json
import re
import subprocess
import sys
import time
from importlib.metadata import entry_points
from types import SimpleNamespace

import numpy as np
import pytest
from import_graph import ROOT

from benchmarks.view import bed_of
from coupling import drive
from dem import Bed
from experiments.cli.main import BAD_INPUT, DONE, main
from rigid import Spike, SpringDamper
from vis.page.answer import write_page
from vis.page.page import Page, Section
from vis.pictures import render
from vis.pictures.canvas import colour_values
from vis.pictures.frames import FrameWriter, read_frames
from vis.view.curves import line as of_line
from vis.view.curves import of_tumble
from vis.view.packing import Codes, pack, unpack
from vis.view.page import IN_REPORT, report_scene, write_view
from vis.view.scene import Limits, make_scene
from vis.view.sources import sources_of

HEAD = re.compile(r'class="head">(.*?)</script>', re.DOTALL)
DATA = re.compile(r'class="data" data-run="(\d+)">(.*?)</script>', re.DOTALL)


def decoded(page):
    """The scenes of a page and their arrays, by number of the run."""
    from base64 import b64decode

    text = page.read_text()
    scenes = json.loads(HEAD.search(text)[1])["scenes"]
    return scenes, {int(run): unpack(b64decode(data), scenes[int(run)]["arrays"]) for run, data in DATA.findall(text)}


def places(scene, arrays):
    """Positions of the grains [m], shape (frames, n, 3)."""
    return np.array(scene["grains"]["low"]) + scene["grains"]["step"] * arrays["position"]


@pytest.fixture(scope="module")
def page(make_run, tmp_path_factory):
    """The page of a made-up run of 4,800 grains."""
    return write_view(make_run(tmp_path_factory.mktemp("run"), frames=3))


def test_arrays_come_back_as_they_were_packed():
    rng = np.random.default_rng(3)
    arrays = [
        Codes(name, rng.integers(0, np.iinfo(kind).max, shape, dtype=kind, endpoint=True))
        for name, kind, shape in (("a", np.uint16, (5, 7, 3)), ("b", np.uint8, (5, 7, 1)), ("c", np.uint32, (1, 4, 3)))
    ]
    found = unpack(pack(arrays), [array.entry() for array in arrays])
    for array in arrays:
        np.testing.assert_array_equal(found[array.name], array.values)
    with pytest.raises(ValueError, match="bytes"):
        unpack(pack(arrays[:2]), [array.entry() for array in arrays])


def test_the_positions_on_the_page_are_those_of_the_frames_to_half_a_step(page):
    scenes, arrays = decoded(page)
    shown = [k for k, scene in enumerate(scenes) if scene["frames"]]
    assert len(shown) == 3
    for number in shown:
        scene, frames = scenes[number], read_frames(page.parent, scenes[number]["id"])
        assert scene["times"] == pytest.approx(frames.times, rel=1e-6)
        found = places(scene, arrays[number])
        for index, frame in enumerate(frames):
            apart = np.abs(found[index] - frame.grains["position"])
            assert apart.max() <= 0.51 * scene["grains"]["step"] < 2e-6
            radius = arrays[number]["radius"][0, :, 0] / 255 * scene["grains"]["radius"]
            np.testing.assert_allclose(radius, frame.grains["radius"], atol=scene["grains"]["radius"] / 500)


def test_colours_and_bodies_on_the_page_are_those_of_the_frames(page):
    scenes, arrays = decoded(page)
    frame, own = read_frames(page.parent, scenes[0]["id"])[1], arrays[0]
    for colour in scenes[0]["colours"]:
        share = colour_values(frame.grains, colour["name"]) / colour["top"]
        codes = own[f"colour {colour['name']}"][1, :, 0]
        np.testing.assert_allclose(codes / 255, np.clip(share, 0.0, 1.0), atol=0.51 / 255)
    loose = scenes[0]["frames"][1]
    corners = np.array(loose["centre"]) - loose["size"] + 2 * loose["size"] / 65535 * own["body spike"][1]
    points, triangles = frame.bodies["spike"]
    np.testing.assert_allclose(corners, points, atol=2 * loose["size"] / 65535)
    np.testing.assert_array_equal(own["triangles spike"][0], triangles)
    (arrow,) = loose["arrows"]
    assert arrow[2] == pytest.approx(points[:, 2].min(), abs=1e-6)
    assert arrow[5] == pytest.approx(frame.values["force"], rel=1e-3)


def test_a_page_asks_nothing_of_a_network_and_names_run_and_surface(page):
    text = page.read_text()
    assert not re.findall(r"(?:src|href)\s*=|@import|url\(|fetch\(|import\(", text)
    assert not re.search(r"https?:|//[a-z]", DATA.sub("", text))
    title = json.loads((page.parent / "result.json").read_text())["title"]
    assert f"<h1>{title}</h1>" in text and page.parent.name in text


def test_runs_without_frames_have_curves_and_say_how_to_get_frames(make_run, tmp_path):
    page = write_view(make_run(tmp_path, frames=0))
    scenes, arrays = decoded(page)
    assert not arrays and len(scenes) > 5
    for scene in scenes:
        assert scene["panels"] and not scene["frames"] and "--frame-count" in scene["notes"][0]
    assert report_scene(tmp_path) == []


def test_peaks_of_a_curve_survive_its_thinning(page):
    scenes, _ = decoded(page)
    force = next(panel for panel in scenes[0]["panels"] if "force" in panel["label"])
    bed, law = force["lines"]
    assert (bed["name"], law["name"], law["dashed"]) == ("bed", "spring-damper", True)
    table = np.genfromtxt(page.parent / "series" / f"{scenes[0]['id']}.csv", delimiter=",", skip_header=1)
    assert max(bed["y"]) == pytest.approx(table[:, 3].max(), rel=1e-3)


def test_a_small_change_far_from_zero_has_no_steps_and_noise_of_rounding_is_hidden():
    time = np.linspace(0.0, 1.0, 501)
    height = of_line("", time, 179.145 + 0.02 * time)
    assert height["y"] == pytest.approx(179.145 + 0.02 * time, abs=5e-5) and len(set(height["y"])) > 200
    assert set(of_line("", time, 179.145 + 1e-12 * np.sin(99.0 * time))["y"]) == {179.145}


def test_a_force_that_is_a_running_mean_says_so_in_its_label(tmp_path):
    (tmp_path / "series").mkdir()
    rows = [f"{1e-3 * k},{100.0 if k == 50 else 0.0},1.0" for k in range(101)]
    (tmp_path / "series" / "feet.csv").write_text("\n".join(["t_s,normal_1_N,normal_2_N", *rows]) + "\n")
    still = {name: np.zeros(101) for name in ("theta_rad", "y_m", "vx_m_s", "vy_m_s")}
    *others, force = of_tumble(tmp_path, {"t_s": 1e-3 * np.arange(101)} | still, "bed")
    assert max(force["lines"][0]["y"]) == pytest.approx(100.0 / 5 + 1.0)
    assert "over 5 ms" in force["label"] and not any("mean" in panel["label"] for panel in others)


def test_a_small_scene_keeps_the_grains_at_every_face_and_says_so(make_run, tmp_path):
    (source, *_) = sources_of(make_run(tmp_path, frames=3))
    full = make_scene(source, Limits(1e8, 99)).head
    small = make_scene(source, IN_REPORT)
    assert small.head["grains"]["count"] < 0.6 * full["grains"]["count"]
    assert small.head["grains"]["shell"] and len(small.head["notes"]) > len(full["notes"])
    from base64 import b64decode

    shown = places(small.head, unpack(b64decode(small.data), small.head["arrays"]))[0]
    every = source.frame(0).grains["position"]
    behind = every[every[:, 1] >= source.cut]
    assert shown[:, 1].min() >= source.cut - 1e-5
    for axis in range(3):
        for edge in (behind[:, axis].min(), behind[:, axis].max()):
            at_face = np.abs(behind[:, axis] - edge) < 0.0036
            assert np.abs(shown[:, axis] - edge)[np.abs(shown[:, axis] - edge) < 0.0036].size == at_face.sum()


def test_a_scene_stays_within_its_limit_and_one_that_cannot_is_refused(make_run, tmp_path):
    (source, *_) = sources_of(make_run(tmp_path, frames=16))
    whole = make_scene(source, Limits(1e8, 99))
    assert len(whole.head["times"]) == 16
    for share in (0.8, 0.3, 0.1):
        limited = make_scene(source, Limits(share * len(whole.data), 99))
        assert len(limited.data) <= share * len(whole.data)
        assert limited.head["times"][0] == whole.head["times"][0]
    assert limited.head["grains"]["shell"]
    with pytest.raises(ValueError, match="--limit"):
        make_scene(source, Limits(1000, 99))


def test_a_title_is_text_and_never_runs(tmp_path):
    title = "</script><script>document.title = 'taken'</script><img src=x onerror=alert(1)>"
    text = write_view(bed_of(tmp_path, 50, frames=1, title=title)).read_text()
    assert "<img" not in text and text.count("<script") == text.count("</script") == 3
    assert json.loads(HEAD.search(text)[1])["title"] == title


def test_frames_with_other_grains_are_refused_by_number(tmp_path):
    bed_of(tmp_path, 20, frames=1)
    writer = FrameWriter(tmp_path, name="bed", resume=True)
    more = {name: np.zeros((19, 3)) for name in ("position", "velocity", "force", "displacement")}
    writer.write(1.0, more | {"radius": np.ones(19), "id": np.arange(19)})
    with pytest.raises(ValueError, match="frame 1 of bed"):
        write_view(tmp_path)


def test_a_report_holds_the_small_scene_with_its_script_once(make_run, tmp_path):
    blocks = report_scene(make_run(tmp_path, frames=2))
    page = write_page(tmp_path / "report.html", Page("t", [], [Section("", blocks), Section("", blocks)]), {})
    text = page.read_text()
    assert text.count("class Viewer") == 1 and len(HEAD.findall(text)) == 2
    assert page.stat().st_size < 15e6
    # Scenes, a film in base64, and the 4 MB of figures and stills of a spike's run stay below 15 MB.
    assert IN_REPORT.size + 4 / 3 * render._GIF_LIMIT + 4e6 < 15e6
    empty = write_page(tmp_path / "other.html", Page("t", [], [Section("", [])]), {})
    assert "class Viewer" not in empty.read_text()


def test_the_command_writes_the_page_and_refuses_what_it_cannot_show(make_run, tmp_path, capsys):
    run = make_run(tmp_path / "run", frames=2)
    assert main(["view", str(run), "--no-open", "--quiet", "--frames", "1"]) == DONE
    assert capsys.readouterr().out.split() == ["page:", str(run / "view.html")]
    scenes, _ = decoded(run / "view.html")
    assert [len(scene["times"]) for scene in scenes if scene["frames"]] == [1, 1, 1]
    for more in (["--limit", "0"], ["--frames", "0"], ["--interval", "-1"], ["--out", "page.pdf"]):
        assert main(["view", str(run), "--no-open", "--quiet", *more]) == BAD_INPUT
        assert more[0].strip("-") in capsys.readouterr().err
    assert main(["view", str(tmp_path), "--no-open"]) == BAD_INPUT
    (empty := tmp_path / "empty").mkdir()
    (empty / "run.toml").write_text((run / "run.toml").read_text())
    assert main(["view", str(empty), "--no-open", "--quiet"]) == BAD_INPUT
    assert str(empty) in capsys.readouterr().err
    (run / "status.json").unlink(missing_ok=True)
    assert main(["view", str(run), "--no-open", "--quiet"]) == DONE
    assert str(run / "status.json") in capsys.readouterr().err
    result = run / "result.json"
    result.write_bytes(result.read_bytes()[:300])
    assert main(["view", str(run), "--no-open", "--quiet"]) == BAD_INPUT
    assert str(result) in capsys.readouterr().err


def test_a_notebook_shows_a_run_or_a_bed_in_a_frame_of_its_own(make_run, tmp_path):
    from vis import View

    shown = View(make_run(tmp_path / "run", frames=1))._repr_html_()
    source = re.fullmatch(r'<iframe srcdoc="([^"]*)" .*sandbox="allow-scripts".*></iframe>', shown)[1]
    assert len(DATA.findall(html.unescape(source))) == 3
    arrays = {"position": np.random.default_rng(1).random((30, 3)), "radius": np.full(30, 0.01), "id": np.arange(30)}
    bed = SimpleNamespace(time=0.5, grains=lambda: SimpleNamespace(as_dict=lambda: arrays))
    scenes, _ = decoded(View(bed).save(tmp_path / "bed.html"))
    assert scenes[0]["grains"]["count"] == 30
    with pytest.raises(ValueError, match="list"):
        View([1, 2])


def test_a_bed_as_the_last_line_of_a_cell_shows_itself(monkeypatch):
    """The package that draws is found by its entry point, without an import of it."""
    (drawer,) = entry_points(group="hedgebed.html", name="bed")
    assert drawer.value == "vis.view.notebook:html_of_bed"
    arrays = {"position": np.random.default_rng(1).random((30, 3)), "radius": np.full(30, 0.01), "id": np.arange(30)}
    bed = SimpleNamespace(time=0.5, grains=lambda: SimpleNamespace(as_dict=lambda: arrays))
    assert Bed._repr_html_(bed).startswith("<iframe")
    bed.grains = lambda: (_ for _ in ()).throw(RuntimeError("the bed is of an earlier start of Taichi"))
    assert Bed._repr_html_(bed) is None
    monkeypatch.setattr("dem.shown.entry_points", lambda **which: ())
    assert Bed._repr_html_(bed) is None  # without a package that draws, too: a notebook shows the text


def test_a_run_of_a_script_as_the_last_line_of_a_cell_shows_its_curve():
    run = drive(Spike(diameter=0.02), into=SpringDamper(stiffness=1e3, damping=1.0), speed=0.1, depth=0.005)
    shown = html.unescape(run._repr_html_())
    labels = [panel["label"] for panel in json.loads(HEAD.search(shown)[1])["scenes"][0]["panels"]]
    assert shown.startswith("<iframe") and [label[:5] for label in labels] == ["depth", "force", "veloc"]
    assert "surface: " not in shown.split("<body>")[1].split('class="head"')[0]  # what stands there is a height


def test_a_run_that_goes_on_is_shown_again_until_it_ends(make_run, tmp_path, monkeypatch):
    run, slept = make_run(tmp_path / "run", frames=1), []
    (run / "status.json").write_text('{"status": "running"}')

    def sleep(seconds):
        slept.append((seconds, json.loads(HEAD.search((run / "view.html").read_text())[1])["live"]))
        (run / "status.json").write_text('{"status": "done"}')

    monkeypatch.setattr("experiments.cli.view.time.sleep", sleep)
    assert main(["view", str(run), "--no-open", "--quiet", "--live", "--interval", "3"]) == DONE
    assert slept == [(3.0, 3.0)]
    assert json.loads(HEAD.search((run / "view.html").read_text())[1])["live"] == 0


def test_the_script_of_the_page_shows_a_run_in_a_notebook(make_run, tmp_path, monkeypatch):
    make_run(tmp_path / "runs" / "foot-earth", frames=1)
    monkeypatch.chdir(tmp_path)
    text = (ROOT / "docs" / "view.md").read_text(encoding="utf-8")
    (script,) = re.findall(r"^```python\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    imports, cell = script.strip().rsplit("\n", 1)  # the last line of a cell is what a notebook shows
    exec(imports, names := {})
    assert eval(cell, names)._repr_html_().startswith("<iframe")


@pytest.mark.long
def test_a_page_is_rewritten_with_more_frames_while_a_run_goes_on(tmp_path):
    """A real run on a law and `view --live`, each in a process of its own; the page is read while both work."""
    pytest.importorskip("mujoco", reason="mujoco is not installed: pip install 'hedgebed[mujoco]'")
    run, page = tmp_path / "run", tmp_path / "run" / "view.html"
    hedgebed = [sys.executable, "-m", "hedgebed"]
    job = "mujoco hopper --feet foot --surface sand --duration 1 --frame-count 40 --quiet --out"
    counts = []  # Frames of each page that is there while the run goes on
    with subprocess.Popen([*hedgebed, *job.split(), str(run)], cwd=ROOT, stdout=subprocess.DEVNULL) as running:
        while len(list(run.rglob("*.vtu"))) < 2:
            assert running.poll() is None, "the run has ended before it is looked at"
            time.sleep(0.05)
        live = [*hedgebed, "view", str(run), "--no-open", "--quiet", "--live", "--interval", "0.5"]
        with subprocess.Popen(live, cwd=ROOT, stdout=subprocess.DEVNULL) as viewing:
            seen = 0
            while viewing.poll() is None:
                if page.is_file() and page.stat().st_mtime_ns != seen:
                    seen = page.stat().st_mtime_ns
                    head = json.loads(HEAD.search(page.read_text(encoding="utf-8"))[1])
                    if head["live"]:
                        counts.append(max(len(scene["times"]) for scene in head["scenes"]))
                time.sleep(0.05)
        assert viewing.returncode == 0 == running.wait()
    assert len(counts) > 1 and counts == sorted(counts) and counts[-1] > counts[0] > 0
    head = json.loads(HEAD.search(page.read_text(encoding="utf-8"))[1])
    assert head["live"] == 0 and max(len(scene["times"]) for scene in head["scenes"]) >= counts[-1]
