"""A platform's file is kept with the run: edited or gone, it changes nothing of what is done again or taken up."""

import json
from pathlib import Path

import pytest
from spatial_runs import CUBE

from experiments.cli.main import main
from experiments.platform.numbers import PLATFORM_COPY, keep_platform
from experiments.spatial import experiment as spatial
from experiments.spatial.settings import SpatialSettings
from experiments.tumble import experiment as tumble
from experiments.tumble.on_grains import PlanarOnBed
from experiments.tumble.settings import TumbleSettings

pytestmark = pytest.mark.usefixtures("unreported")

MINE = """\
format = "hedgebed-platform/1"
name = "mine"
[body]
mass = 0.1
inertia = [2e-5, 2e-5, 2e-5]
[hull]
shape = "prism"
sides = 8
diameter = 0.06
height = 0.03
[spikes]
clear = 0.012
diameter = 0.006
[wheels]
inertia = 1e-6
max_speed = 1000.0
motor_torque = 0.01
axes = [[0.0, 1.0, 0.0]]
"""
"""A small platform: eight rows 30 mm from the axis."""


@pytest.fixture
def mine():
    path = Path("mine.toml")
    path.write_text(MINE)
    return path


def changes(path):
    """What may become of the file between two spells: edited, no platform any more, gone."""
    text = path.read_text()
    for other in (text.replace("diameter = 0.006", "diameter = 0.009").replace("mass = 0.1", "mass = 0.2"), "nonsense"):
        path.write_text(other)
        yield
    path.unlink()
    yield


@pytest.mark.parametrize("sweep", [(), ("--sweep", "torque=8e-4:1e-3:1e-4")])
def test_a_tumble_in_the_plane_is_done_again_with_the_platform_that_it_began_with(mine, sweep):
    turn = () if sweep else ("--torque", "1e-3")
    given = ("--platform", str(mine), "--rig", "0.0085", *turn, "--duration", "0.05", "--quiet")
    assert main(["tumble", *given, *sweep, "--out", "a"]) == 0
    assert Path("a", PLATFORM_COPY).read_text() == MINE
    before = json.loads(Path("a/result.json").read_text())
    assert before["trial"]["mass"] == {"value": 0.1, "unit": "kg", "origin": "platform mine.toml"}
    for _ in changes(mine):
        Path("a/result.json").unlink()
        assert main(["resume", "a", "--quiet"]) == 0
        assert json.loads(Path("a/result.json").read_text()) == before


@pytest.mark.parametrize(
    "given",
    [
        ("hop", "--gravity", "0.01", "--surface", "steel", "--distance", "0.1"),
        (
            "paper",
            "--no-sweep",
            "--rigs",
            "0.0085",
            "--surfaces",
            "sand",
            "--motor-torques",
            "1e-3",
            "--brake-torques",
            "0.01",
            "--duration",
            "0.2",
            "--brake-duration",
            "0.2",
            "--workers",
            "1",
        ),
    ],
)
def test_a_hop_and_the_papers_cases_are_done_again_with_the_platform_that_they_began_with(mine, given):
    assert main([*given, "--platform", str(mine), "--out", "a", "--quiet"]) == 0
    before = json.loads(Path("a/result.json").read_text())
    assert before["platform"]["mass"] == 0.1
    for _ in changes(mine):
        Path("a/result.json").unlink()
        assert main(["resume", "a", "--quiet"]) == 0
        assert json.loads(Path("a/result.json").read_text()) == before


def test_on_grains_spikes_and_all_are_those_that_it_began_with(mine, monkeypatch):
    seen = []

    def stop(on_bed, *_):
        seen.append(on_bed.plan)
        raise KeyboardInterrupt

    monkeypatch.setattr(PlanarOnBed, "prepare", stop)
    settings = TumbleSettings(
        ground="bed", surface="sand", platform=str(mine), rig=0.0085, torque=1e-3, duration=0.05,
        bed_size=(0.2, 0.02, 0.04), grain=0.004,
    )  # fmt: skip
    with pytest.raises(KeyboardInterrupt):
        tumble.run(settings, "a")
    assert seen[0].spikes.diameter == 0.006 and seen[0].trial.mass == 0.1
    for _ in changes(mine):
        with pytest.raises(KeyboardInterrupt):
            tumble.resume("a")
        assert (seen[-1].trial, seen[-1].spikes, seen[-1].numbers) == (seen[0].trial, seen[0].spikes, seen[0].numbers)


def test_in_space_the_platform_is_the_one_that_it_began_with(monkeypatch):
    seen = []

    def stop(on_bed, *_):
        seen.append(on_bed.platform)
        raise KeyboardInterrupt

    monkeypatch.setattr("experiments.spatial.on_grains.SpatialOnBed.prepare", stop)
    path = Path("cube.toml")
    path.write_text(CUBE.read_text())
    settings = SpatialSettings(
        surface="sand", ground="bed", platform=str(path), gravity=1.0, velocity=(0.0, 0.0, -0.1), duration=0.02,
        torque=(0.0, 0.01, 0.0), bed_size=(0.14, 0.14, 0.05), grain=0.003,
    )  # fmt: skip
    with pytest.raises(KeyboardInterrupt):
        spatial.run(settings, "a")
    assert Path("a", PLATFORM_COPY).read_text() == CUBE.read_text()
    for other in (path.read_text().replace("diameter", "diametre"), None):
        path.write_text(other) if other else path.unlink()
        with pytest.raises(KeyboardInterrupt):
            spatial.resume("a")
        assert seen[-1].tip_radius == seen[0].tip_radius and seen[-1].mass == seen[0].mass


def test_a_platform_that_ships_needs_no_copy_and_a_file_that_is_none_is_refused(mine, tmp_path):
    assert keep_platform("hedgehog", tmp_path) is None and not (tmp_path / PLATFORM_COPY).exists()
    mine.write_text("nonsense")
    for name, said in (("nowhere.toml", "cannot be read"), (str(mine), "is not TOML")):
        with pytest.raises(ValueError, match=said):
            keep_platform(name, tmp_path)
    assert not (tmp_path / PLATFORM_COPY).exists()


def test_that_the_file_is_another_by_now_is_said(mine, tmp_path):
    told = []
    keep_platform(str(mine), tmp_path, told.append)
    keep_platform(str(mine), tmp_path, told.append)
    assert told == []
    for _ in changes(mine):
        keep_platform(str(mine), tmp_path, told.append)
    assert len(told) == 3 and all(f"{mine} has changed since" in said and PLATFORM_COPY in said for said in told)
