"""The report stands on its own, says what it has, and says what it has not."""

import json
import re
import shutil
from html.parser import HTMLParser

import pytest
from PIL import Image

from vis import style
from vis.folder import read_folder, read_series
from vis.plots import PLOTS, make_plots
from vis.report import write_report
from vis.summary import summarise

FIGURES = {"drag", "gap", "set_down", "drops", "drop_peaks", "work", "spread"}


class Page(HTMLParser):
    """What a browser would load, the text it would show, and whether the tags close."""

    def __init__(self, text):
        super().__init__()
        self.sources, self.tags, self.words, self.open = [], [], [], []
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        self.tags.append(tag)
        self.sources += [value for name, value in attributes if name in ("src", "href", "srcset", "data", "poster")]
        if tag not in ("meta", "img", "br", "hr"):
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if not self.open or self.open[-1] != "style":
            self.words.append(data)

    @property
    def text(self):
        return re.sub(r"\s+", " ", " ".join(self.words))


@pytest.fixture(autouse=True)
def coarse_plots(monkeypatch):
    """Plots of a test's own are small; those of the `report` fixture, which comes first, are as large as life."""
    monkeypatch.setitem(style._STYLE, "savefig.dpi", 40)


@pytest.fixture(scope="module")
def report(tmp_path_factory, make_run):
    """A full report, with sections for pictures: the renderer has its own test."""
    folder = make_run(tmp_path_factory.mktemp("report"), frames=2)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("HEDGEBED_NO_OPENGL", "1")
        return write_report(folder)


def test_it_needs_no_network(report):
    text = report.read_text()
    assert not re.search(r"https?:|//[a-z]|@import|url\(", re.sub(r"base64,[A-Za-z0-9+/=]+", "", text))
    page = Page(text)
    assert page.open == []
    assert "script" not in page.tags
    assert "link" not in page.tags
    assert page.sources
    assert all(source.startswith("data:image/") for source in page.sources)


def test_it_holds_every_figure_picture_and_the_animation(report):
    page = Page(report.read_text())
    made = {path.stem for path in (report.parent / "figures").glob("*.png")}
    assert made >= FIGURES
    assert len(page.sources) == len(made) + 1
    assert sum(source.startswith("data:image/gif") for source in page.sources) == 1
    for name in FIGURES:
        with Image.open(report.parent / "figures" / f"{name}.png") as image:
            assert image.width >= 800
            assert len(image.convert("RGB").getcolors(1_000_000)) > 50


def test_it_answers_first(report):
    text = Page(report.read_text()).text.replace("\N{NO-BREAK SPACE}", " ")
    assert text.index("How far does it sink?") < text.index("The spring-damper, fitted") < text.index("Settings")
    for words in (
        "231 ± 12 N/m", "4.2 ± 0.3 N s/m", "28 ± 2 %", "Grains are softened", "On the way out the sand lets go at once",
        "0.5934 ± 0.0011", "Mean diameter of the grains", "hedgebed penetrate run.toml", "no OpenGL",
    ):  # fmt: skip
        assert words in text, words


def test_text_of_the_result_is_no_markup(tmp_path, make_run):
    folder = make_run(tmp_path, frames=0)
    result = json.loads((folder / "result.json").read_text())
    result["title"] = "<script>alert(1)</script>"
    (folder / "result.json").write_text(json.dumps(result))
    assert "<script" not in write_report(folder, pictures=False).read_text()


def test_an_empty_folder_gives_a_report_that_says_so(tmp_path):
    text = Page(write_report(tmp_path).read_text()).text
    assert "no result to answer with" in text
    assert "result.json is missing" in text
    assert "no frames" in text


@pytest.mark.parametrize("status", ["stopped", "failed", "running"])
def test_a_run_that_did_not_finish(tmp_path, status, make_run):
    folder = make_run(tmp_path, frames=0)
    (folder / "result.json").unlink()
    (folder / "status.json").write_text(json.dumps({"status": status, "reason": "a grain left the box"}))
    text = Page(write_report(folder).read_text()).text
    assert "A grain left the box." in text
    assert "Mean diameter of the grains" in text


def test_each_missing_part_is_said_and_the_rest_is_there(tmp_path, make_run):
    folder = make_run(tmp_path, frames=0)
    (folder / "series/driven-0.2-seed1.csv").unlink()
    (folder / "series/drop-0.3-seed1.model.csv").write_text("t_s,depth_m\n0,0\n")
    (folder / "run.toml").write_text("= nonsense")
    result = json.loads((folder / "result.json").read_text())
    for key in ("departures", "fits", "spike", "warnings"):
        del result[key]
    result["runs"][0]["quantities"] = None
    result["quantities"]["damping"] = {"value": None, "std": None, "unit": "N s/m"}
    (folder / "result.json").write_text(json.dumps(result))
    path = write_report(folder, pictures=False)
    text = Page(path.read_text()).text
    assert "driven-0.2-seed1: the bed's series" in text
    assert "has no column velocity_m_s, force_N, phase" in text
    assert "run.toml cannot be read" in text
    assert "Spread between beds: no data." in text
    assert (path.parent / "figures/gap.png").exists()  # made from the series where there is no table
    assert "unknown" in text


def test_one_bed_has_no_spread_and_a_reference_is_compared_with(tmp_path, made_once):
    shutil.copytree(made_once, tmp_path / "run", ignore=shutil.ignore_patterns("frames", "figures"))
    path = tmp_path / "run/result.json"
    result = json.loads(path.read_text())
    result["runs"] = [run for run in result["runs"] if run["id"] in ("driven-0.1-seed1", "drop-0.1-seed1")]
    result["fits"] = result["fits"][:1]
    moved = {"stiffness": {"before": 200.0, "now": 231.4, "change": 0.157, "unit": "N/m"}}
    result["reference"] = {"file": "earlier/result.json", "moved": moved}
    path.write_text(json.dumps(result))
    text = Page(write_report(tmp_path / "run", pictures=False).read_text()).text.replace("\N{NO-BREAK SPACE}", " ")
    assert "There is one bed" in text
    assert "Spread between beds: no data." in text
    assert "200 N/m 231 N/m +16 %" in text


@pytest.mark.parametrize("drop", ["runs", "quantities", "bed"])
def test_no_part_of_the_result_is_required(tmp_path, made_once, drop):
    shutil.copytree(made_once, tmp_path / "run", ignore=shutil.ignore_patterns("frames", "figures"))
    path = tmp_path / "run/result.json"
    result = json.loads(path.read_text())
    result[drop] = None
    path.write_text(json.dumps(result))
    assert write_report(tmp_path / "run", pictures=False).exists()


def test_plots_are_those_that_are_promised(made_once, tmp_path):
    drawn, missing = make_plots(read_folder(made_once), tmp_path)
    assert missing == []
    assert len(drawn) == len(PLOTS)
    assert {plot.name for plot, _ in drawn} == FIGURES
    assert all(path.parent == tmp_path and path.exists() for _, path in drawn)


def test_summary_is_plain_data(made_once):
    said = summarise(read_folder(made_once))
    json.dumps(said)
    assert said["seeds"] == 3
    assert said["banner"] == ""
    assert [tile["label"] for tile in said["tiles"]] == [
        "Sinks to rest at", "Sand pushes back with", "Spring-damper wrong by", "Fitted stiffness K",
    ]  # fmt: skip
    assert ["packing", "not set", "", "Packing fraction to reach"] in said["settings"]["rows"]


def test_a_series_that_is_cut_short_is_refused(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("t_s,depth_m,velocity_m_s,force_N,phase\n0,0,0,0,in\n1,2\n")
    with pytest.raises(ValueError, match="ends too early"):
        read_series(path)
    path.write_text("t_s,depth_m,velocity_m_s,force_N,phase\n")
    with pytest.raises(ValueError, match="no rows"):
        read_series(path)
