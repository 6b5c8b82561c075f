"""What a user of pip gets: the wheel, made from the sdist, works without the checkout."""

import os
import re
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest
from import_graph import ROOT

pytestmark = pytest.mark.long
TOP = {"dem", "rigid", "coupling", "experiments", "vis", "hedgebed.py", "hedgebed_renamed.py", "hedgebed_taichi.py"}
BUILD = "import sys; from setuptools import build_meta as b; getattr(b, sys.argv[1])(sys.argv[2])"
COMMANDS = """
import sys
from pathlib import Path
import hedgebed
from experiments.cli.main import main

assert Path(hedgebed.__file__).is_relative_to(sys.argv[1]), hedgebed.__file__
for command in sys.argv[2:]:
    code = main([*command.split()])
    assert code == 0, (command, code)
"""
BASE = (
    "penetrate --tip-diameter 0.012 --grain 0.004 --allow-coarse --bed-size 0.048 0.048 0.03 --depth 0.004 --seeds 1 2"
    " --speeds 0.2 0.4 --drop-speeds 0.2 --frame-count 0 --threads 1 --max-overlap 0.1 --out runs/bed",
    "tumble --out runs/tumble",
    "hop --out runs/hop",
    "campaign new mine --kind penetration",
    "campaign check cmu-plate-sinkage --out runs/check",
    "diagnose mine --out runs/diagnosis",
    "view runs/tumble --no-open",
    "experiments list",
    "effects",
    "bed foot sand cylinder --size 16mm --load 0.5N",
    "ground --gravity 1e-3g --tip-diameter 12mm --out runs/ground",
    "tumble --torque 0.15 --out runs/other",
    "compare runs/tumble runs/other --out runs/beside",
    "calibrate runs/bed --out runs/laws",
    "paper --rigs 0.0085 --surfaces steel brick --torque-rise 0 --no-evidence --out runs/paper",
    "sweep sweep.toml --workers 1 --out runs/sweep",
)
SWEEP = 'experiment = "tumble"\n[fixed]\nsurface = "brick"\n[over]\nmu_s = [0.4, 0.5]\n'


def run(*words: str, cwd: Path, **environment: str) -> str:
    """Stdout of a command; fails with its stderr."""
    done = subprocess.run(
        words, cwd=cwd, env=os.environ | environment, capture_output=True, text=True, timeout=600, check=False
    )
    assert done.returncode == 0, done.stderr[-3000:]
    return done.stdout


@pytest.fixture(scope="module")
def site(wheel, tmp_path_factory):
    """A folder of packages that has the wheel alone; what it needs is in this Python."""
    folder = tmp_path_factory.mktemp("site")
    run(sys.executable, "-m", "pip", "install", "-q", "--no-deps", "--target", str(folder), str(wheel), cwd=folder)
    return folder


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    """The wheel, built from the unpacked sdist, and the sdist from what git would ship."""
    folder = tmp_path_factory.mktemp("wheel")
    files = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    source = folder / "source"
    for name in files.split("\0"):
        if (ROOT / name).is_file() and not name.startswith(("docs/", "tests/", "benchmarks/")):
            (source / name).parent.mkdir(parents=True, exist_ok=True)
            (source / name).write_bytes((ROOT / name).read_bytes())
    run(sys.executable, "-c", BUILD, "build_sdist", str(folder), cwd=source)
    with tarfile.open(next(folder.glob("*.tar.gz"))) as archive:
        archive.extractall(folder, filter="data")
    unpacked = next(path for path in folder.glob("hedgebed-*") if path.is_dir())
    run(sys.executable, "-c", BUILD, "build_wheel", str(folder), cwd=unpacked)
    return next(folder.glob("*.whl"))


def test_the_wheel_has_every_data_file_and_only_the_documented_top_level_names(wheel):
    with zipfile.ZipFile(wheel) as archive:
        inside = set(archive.namelist())
        (points,) = (archive.read(name).decode() for name in inside if name.endswith("entry_points.txt"))
    assert "bed=vis.view.notebook:html_of_bed" in points.replace(" ", "")  # what a notebook shows
    assert {name.split("/")[0] for name in inside if ".dist-info" not in name} == TOP
    tracked = subprocess.run(["git", "ls-files", *TOP], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    assert set(tracked.split()) - inside == set()
    page = (ROOT / "docs/install.md").read_text(encoding="utf-8")
    assert [name for name in TOP if f"`{name.removesuffix('.py')}`" not in page] == []


def test_the_commands_work_from_the_wheel_in_another_folder(site, tmp_path):
    (tmp_path / "sweep.toml").write_text(SWEEP, encoding="utf-8")
    out = run(sys.executable, "-c", COMMANDS, str(site), *BASE, cwd=tmp_path, PYTHONPATH=str(site))
    reports = {path.parent.name for path in tmp_path.glob("runs/*/report.html")}
    assert reports >= {"bed", "tumble", "hop", "diagnosis", "ground", "beside", "laws", "paper", "sweep"}
    assert "stiffness" in out


def printed(page, language, *words):
    """The blocks of a page in this language that have all these words."""
    text = (ROOT / "docs" / page).read_text(encoding="utf-8")
    blocks = re.findall(r"^```(\w*)\n(.*?)^```", text, re.DOTALL | re.MULTILINE)
    return [block for kind, block in blocks if kind == language and all(word in block for word in words)]


def test_commands_and_scripts_of_the_pages_on_robots_and_feet_run_from_the_wheel(site, tmp_path):
    """As printed, but those on a law of 0.05 s and without pictures; on grains other tests run them."""
    for name in ("mujoco", "trimesh"):
        pytest.importorskip(name, reason=f"{name} is not installed: pip install 'hedgebed[mujoco]'")
    (robot,) = printed("tutorials/own-robot.md", "xml")
    (tmp_path / "robot.xml").write_text(robot, encoding="utf-8")
    commands = [
        block.replace("\\\n", " ").strip().removeprefix("hedgebed ")
        for page in ("mujoco.md", "tutorials/own-robot.md")
        for block in printed(page, "", "--surface sand", "--duration")
        if "--ground bed" not in block and ("hopper" in block or "--out" in block)
    ]
    assert len(commands) == 2 and "--controller hopper:control" in commands[0]
    commands = [re.sub("--duration [0-9.]+", "--duration 0.05 --frame-count 0", command) for command in commands]
    commands += [block.strip().removeprefix("hedgebed ") for block in printed("tutorials/own-foot.md", "", "bed foot")]
    run(sys.executable, "-c", COMMANDS, str(site), *commands, cwd=tmp_path, PYTHONPATH=str(site))
    assert (tmp_path / "runs/robot-law/result.json").is_file()
    for script in printed("mujoco.md", "python", "law_of_run"):
        run(sys.executable, "-c", script, cwd=tmp_path, PYTHONPATH=str(site))


def test_an_fmu_is_written_from_the_wheel_and_another_importer_finds_no_fault_in_it(site, tmp_path):
    pytest.importorskip("pythonfmu3", reason="pythonfmu3 is not installed: pip install 'hedgebed[fmi]'")
    run(sys.executable, "-c", COMMANDS, str(site), "fmu hedgehog.fmu", cwd=tmp_path, PYTHONPATH=str(site))
    assert zipfile.ZipFile(tmp_path / "hedgehog.fmu").testzip() is None
    fmpy = pytest.importorskip(
        "fmpy", reason="fmpy is not installed: pip install fmpy; the FMU is written, not imported"
    )
    assert fmpy.read_model_description(str(tmp_path / "hedgehog.fmu")).coSimulation is not None
