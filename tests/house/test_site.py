"""The documentation builds as a site, without a broken link, and has a page for each command and public name."""

import os
import re
import subprocess
import sys
from importlib import import_module

import pytest
from import_graph import ROOT

from experiments.cli.main import build_app


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    pytest.importorskip("mkdocs", reason="`make docs` installs it")
    folder = tmp_path_factory.mktemp("site")
    done = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "--site-dir", str(folder)],
        cwd=ROOT, env=os.environ | {"PYTHONPATH": str(ROOT)}, capture_output=True, text=True, timeout=300,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    return folder


@pytest.mark.long
def test_the_reference_has_each_command_and_each_public_name(site):
    commands = {name for name in build_app() if not name.startswith("-")}
    assert {path.stem for path in (site / "reference/commands").glob("*.html")} == commands
    for package in ("dem", "rigid", "coupling", "coupling.robot", "experiments.robot.own_loop", "vis"):
        page = (site / f"reference/python/{package}.html").read_text(encoding="utf-8")
        headings = set(re.findall(rf'<h2 id="[^"]*">{re.escape(package)}\.(\w+)', page))
        assert headings == set(import_module(package).__all__)


@pytest.mark.long
def test_a_page_of_the_site_asks_no_other_host_for_anything(site):
    asked = r'(?:<script[^>]*src|<link[^>]*rel="stylesheet"[^>]*href|<img[^>]*src)="(https?:[^"]*)"'
    assert {
        url for path in site.rglob("*.html") for url in re.findall(asked, path.read_text(encoding="utf-8"))
    } == set()
