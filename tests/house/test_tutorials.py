"""The files in the tutorials are files that hedgebed takes; the tutorial on trials gets the answer that it prints."""

import re
import subprocess
import sys

import pytest
from import_graph import ROOT

from dem import material
from experiments.cli.main import main
from experiments.penetrate.settings import PenetrateSettings
from experiments.runs.reading import read_case, settings_from
from experiments.runs.result import Result

FOLDER = ROOT / "docs" / "tutorials"


def block(page: str, language: str) -> str:
    """The one block of a language on a page."""
    text = (FOLDER / f"{page}.md").read_text(encoding="utf-8")
    found = re.findall(rf"^```{language}\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    assert len(found) == 1
    return found[0]


def test_each_tutorial_is_listed_and_has_300_to_900_words():
    listed = set(re.findall(r"\(([\w-]+)\.md\)", (FOLDER / "README.md").read_text(encoding="utf-8")))
    assert listed == {path.stem for path in FOLDER.glob("*.md")} - {"README"}
    assert all(300 <= len((FOLDER / f"{name}.md").read_text(encoding="utf-8").split()) <= 900 for name in listed)


def test_the_foot_of_the_tutorial_is_a_case(tmp_path):
    file = tmp_path / "foot.toml"
    file.write_text(block("own-foot", "toml"), encoding="utf-8")
    settings = settings_from(PenetrateSettings, [read_case(file)])
    assert (settings.tip, settings.tip_diameter, settings.load) == ("flat", 0.016, 0.5)


def test_the_material_of_the_tutorial_is_a_material(tmp_path):
    file = tmp_path / "my-sand.toml"
    file.write_text(block("own-material", "toml"), encoding="utf-8")
    sand = material(file)
    assert (sand.name, sand.density, sand.friction) == ("my-sand", 2700.0, 0.4)
    assert set(sand.sources) == {"density", "young", "poisson", "friction", "restitution", "rolling_friction"}


def test_the_robot_of_the_tutorial_has_the_feet_that_the_command_names():
    mujoco = pytest.importorskip("mujoco", reason="mujoco is not installed: pip install 'hedgebed[mujoco]'")
    model = mujoco.MjModel.from_xml_string(block("own-robot", "xml"))
    assert {model.geom(number).name for number in range(model.ngeom)} >= {"foot_l", "foot_r"}


@pytest.mark.long
def test_the_trials_of_the_tutorial_are_diagnosed_as_it_says(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    subprocess.run([sys.executable, "-c", block("own-trials", "python")], check=True)
    assert main(["diagnose", "mine", "--out", "runs/mine", "--quiet"]) == 0
    result = Result.load(tmp_path / "runs/mine")
    power = result["quantities"]["depth-hardening.hardening_power"]
    assert power["value"] == pytest.approx(0.5, abs=4 * 0.0036)  # four of the standard errors that the page states
    text = (FOLDER / "own-trials.md").read_text(encoding="utf-8")
    assert f"{power['value']:.3f}" in text
