"""Campaigns and results whose names are HTML, JavaScript or TOML: in the browser and in further files they are text."""

import json
import re
import tomllib
from pathlib import Path

import pytest
from faults.damaged_folders import CALIBRATE, Kind, case, patched

import dem
from benchmarks.view import Browser, chromium
from experiments.campaign.files import new_campaign
from experiments.cli.main import main
from rigid.platform.files import PLATFORM_FOLDER
from vis.report import write_report
from vis.view.page import write_view

pytestmark = [
    pytest.mark.long,
    pytest.mark.skipif(chromium() is None, reason="no Chromium is installed (Debian: apt install chromium)"),
]
MARKUP = (
    "<script>window.taken = 1</script>",
    "</title></style></script><img src=x onerror='window.taken = 1'>",
    '" onmouseover="window.taken = 1" autofocus onfocus="window.taken = 1" x="',
    "<svg onload=window.taken=1>",
    "{{ 7 * 7 }}${7 * 7}<a href='javascript:window.taken = 1'>x</a>",
    'x"\n[[trial]]\nid = "made-by-a-name',
)
INERT = """
[...document.querySelectorAll('*')].filter((e) => [...e.attributes].some((a) => a.name.startsWith('on')
    || a.value.trim().startsWith('javascript:'))).length
"""


@pytest.fixture(scope="module")
def browser():
    """One Chromium for all tests."""
    with Browser((1000, 760)) as started:
        yield started


def opened(browser, page):
    """Open the page, and see that no name ran or can run; its text, and how many scripts it has."""
    browser.open(page)
    for event in ("mouseover", "focus", "click", "error", "load"):
        browser.value(f"document.querySelectorAll('*').forEach((e) => e.dispatchEvent(new Event('{event}')))")
    assert browser.value("window.taken") is None
    assert browser.value(INERT) == 0
    assert browser.value("document.querySelectorAll('img[src=x], svg[onload]').length") == 0
    assert browser.value("[...document.scripts].filter((e) => e.text.trim().startsWith('window.taken')).length") == 0
    return browser.value("document.body.textContent"), browser.value("document.scripts.length")


def marked(folder, markup):
    """Put the markup into the name of a campaign, its surface, its notes and, as far as a file can have it, an id."""
    path = folder / "campaign.toml"
    text, value = path.read_text(encoding="utf-8"), json.dumps(markup)
    text = re.sub(r'(?m)^((?:name|template) = )"[^"]*"', lambda found: found[1] + value, text)
    text = re.sub(r'(\[surface\]\nkind = )"[^"]*"', lambda found: found[1] + value, text)
    text = text.replace('id = "001"', f"id = {json.dumps('1 ' + markup.partition(chr(10))[0].replace('/', ''))}")
    path.write_text(text, encoding="utf-8")
    assert tomllib.loads(text)["name"] == markup


@pytest.mark.parametrize("kind", ["tumble", "penetration"])
def test_no_name_in_a_campaign_runs_in_the_page_of_its_check(kind, browser, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    new_campaign(tmp_path / "plain", kind=kind)
    assert main(["campaign", "check", "plain", "--out", "checked", "--quiet"]) == 0
    _, scripts = opened(browser, tmp_path / "checked" / "report.html")
    for number, markup in enumerate(MARKUP):
        folder, out = tmp_path / f"c{number}", tmp_path / f"o{number}"
        new_campaign(folder, kind=kind)
        marked(folder, markup)
        capsys.readouterr()
        status = main(["campaign", "check", str(folder), "--out", str(out), "--quiet"])
        said = capsys.readouterr().err
        assert status == 0, said
        text, found = opened(browser, out / "report.html")
        assert markup.split("\n")[0] in text and found == scripts


def test_no_name_in_a_campaign_runs_in_the_page_of_its_diagnosis_or_is_toml(browser, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    new_campaign(tmp_path / "plain", kind="penetration")
    assert main(["diagnose", "plain", "--out", "clean", "--quiet"]) == 0
    _, scripts = opened(browser, tmp_path / "clean" / "report.html")
    new_campaign(tmp_path / "c", kind="penetration")
    marked(tmp_path / "c", MARKUP[1])
    assert main(["diagnose", "c", "--out", "out", "--quiet"]) == 0
    assert opened(browser, tmp_path / "out" / "report.html")[1] == scripts
    for path in (tmp_path / "out").rglob("*.toml"):
        trials = tomllib.loads(path.read_text(encoding="utf-8")).get("trial", [])
        assert "made-by-a-name" not in [trial["id"] for trial in trials]
    pushed = ["penetrate", "--ground", "spring-damper", "--model", "out/model.toml", "--tip-diameter", "12mm"]
    assert main([*pushed, "--out", "pushed", "--quiet"]) == 0
    opened(browser, tmp_path / "pushed" / "report.html")


NAME = "<img src=x onerror='window.taken = 1'>"
"""Markup that can be the name of a file: it has no slash."""


def own_platform(name):
    """Write a platform file of this name; the file."""
    shipped = PLATFORM_FOLDER / "cube.toml"
    text = shipped.read_text(encoding="utf-8").replace('name = "cube"', f"name = {json.dumps(name)}")
    Path(f"{name}.toml").write_text(text, encoding="utf-8")
    return f"{name}.toml"


def compared():
    """Two runs whose folders have markup for a name."""
    runs = [f"{number} {NAME}" for number in (1, 2)]
    for run, torque in zip(runs, ("0.2", "0.15"), strict=True):
        assert main(["tumble", "--duration", "0.3", "--torque", torque, "--out", run, "--quiet"]) == 0
    return ["compare", *runs], NAME


def swept():
    """Two platforms, one of a file with markup for a name."""
    over = json.dumps([own_platform(NAME), own_platform("cube")])
    case(f'experiment = "tumble"\nworkers = 1\n[fixed]\nduration = 0.1\nrig = 0.03\n[over]\nplatform = {over}\n')
    return ["sweep", "case.toml"], NAME


def calibrated():
    """A material of a file with markup for a name, which the page does not show."""
    (Path(f"{NAME}.toml")).write_bytes((Path(dem.__file__).parent / "presets" / "sand.toml").read_bytes())
    case(f"material = {json.dumps(f'{NAME}.toml')}\n{CALIBRATE}")
    return ["calibrate", "case.toml"], ""


def diagnosed():
    """A campaign of tumbles with markup in all its names; the page shows those of its trials."""
    new_campaign(Path("campaign"), kind="tumble")
    marked(Path("campaign"), MARKUP[1])
    return ["diagnose", "campaign"], MARKUP[1].replace("/", "")


@pytest.mark.parametrize("make", [compared, swept, calibrated, diagnosed])
def test_no_name_of_a_file_and_no_text_of_a_result_runs_in_the_page_of(make, browser, tmp_path, monkeypatch):
    """Beds of `calibrate` are stand-ins."""
    monkeypatch.chdir(tmp_path)
    with pytest.MonkeyPatch.context() as patch:
        patched(Kind(print, (), fake=True), patch)
        words, shown = make()
        assert main([*words, "--out", "run", "--quiet"]) == 0
    run = tmp_path / "run"
    text, scripts = opened(browser, write_report(run))
    assert shown in text
    result = json.loads((run / "result.json").read_text(encoding="utf-8"))
    (run / "result.json").write_text(json.dumps(texts_marked(result, MARKUP[0])), encoding="utf-8")
    (run / "status.json").write_text('{"status": "done"}')
    text, found = opened(browser, write_report(run))
    assert MARKUP[0] in text and found == scripts


def texts_marked(value, markup):
    """A result with the markup behind each text that is a sentence, a heading or a cell."""
    if isinstance(value, dict):
        return {
            key: f"{item} {markup}" if key in ("title", "note", "summary", "words") and isinstance(item, str)
            else [f"{one} {markup}" for one in item] if key in ("warnings", "sentences", "head")
            else texts_marked(item, markup)
            for key, item in value.items()
        }  # fmt: skip
    return [texts_marked(item, markup) for item in value] if isinstance(value, list) else value


def test_no_text_of_a_result_runs_in_its_report_or_its_view(browser, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["tumble", "--duration", "0.3", "--out", "run", "--quiet"]) == 0
    run = tmp_path / "run"
    _, scripts = opened(browser, run / "report.html")
    markup = " ".join(MARKUP)
    result = json.loads((run / "result.json").read_text(encoding="utf-8"))
    (run / "result.json").write_text(json.dumps(texts_marked(result, markup)), encoding="utf-8")
    (run / "status.json").write_text('{"status": "done"}')
    text, found = opened(browser, write_report(run))
    assert text.count(MARKUP[0]) > 2 and found == scripts
    text, _ = opened(browser, write_view(run))
    assert MARKUP[0] in text
