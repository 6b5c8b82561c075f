"""Campaigns and results whose names are HTML, JavaScript or TOML: in the browser and in further files they are text."""

import json
import re
import tomllib

import pytest

from benchmarks.view import Browser, chromium
from experiments.campaign.files import new_campaign
from experiments.cli.main import main
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
