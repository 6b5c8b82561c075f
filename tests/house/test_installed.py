"""What a user of pip gets in a new environment: the wheel with what it depends on; commands at their cheapest."""

import json
import os
import subprocess
import sys
import venv
from pathlib import Path

import pytest
from import_graph import ROOT
from small_cases import GRAINS

FILES = {
    "spike.toml": GRAINS + "grain = 0.004\nseeds = [1, 2]\nspeeds = [0.4]\ndrop_speeds = [0.2]\nyoung = 2e7\n",
    "sweep.toml": 'experiment = "tumble"\n[over]\ntorque = [0.2, 0.22]\n',
}
EXTRAS = "mujoco,fmi,sweep"
QUICK = (
    "doctor",
    "ground --material sand --gravity 1e-3g --spike-diameter 12mm --out runs/ground",
    "hop --out runs/hop",
    "bed make --stages rain --size 0.024 0.024 0.02 --threads 1 --out runs/bed",
    "mujoco hopper --feet foot --controller hopper:control --duration 0.05 --frame-count 0 --out runs/robot",
    "bed foot sand cylinder --size 16mm --load 0.5N",
)
# All but bench, which needs a checkout, and converge, paper, bed calibrate and bed test, which take long.
COMMANDS = (
    "--help",
    "doctor",
    "penetrate spike.toml --out runs/spike",
    "calibrate runs/spike --laws spring-damper --out runs/law",
    "ground --gravity 1g --tip-diameter 12mm --out runs/ground",
    "mujoco hopper --feet foot --duration 0.05 --frame-count 0 --out runs/robot",
    "fmu hedgehog.fmu",
    "hop --out runs/hop",
    "tumble --out runs/tumble",
    "tumble --torque 0.2 --out runs/slow",
    "tumble spatial --duration 0.1 --out runs/spatial",
    "experiments list",
    "campaign new mine --kind penetration",
    "campaign check mine",
    "campaign from-run runs/spike pushes",
    "diagnose mine --out runs/diagnosis",
    "effects",
    "compare runs/tumble runs/slow --out runs/both",
    "validate --only free-fall --out runs/validate --document runs/validation.md",
    "bed make --stages rain --size 0.024 0.024 0.02 --threads 1 --out runs/bed",
    "bed list",
    "resume runs/tumble",
    "sweep sweep.toml --workers 1 --out runs/sweep",
    "render runs/tumble",
    "view runs/tumble --no-open",
)


def run(*words: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    """A command outside the checkout, without its modules."""
    kept = {key: value for key, value in os.environ.items() if key not in ("PYTHONPATH", "PYTHONHOME", "VIRTUAL_ENV")}
    return subprocess.run(words, cwd=cwd, env=kept, capture_output=True, text=True, timeout=900, check=False)


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    """The `python` of a new environment, into which pip has installed the wheel with the extra `mujoco`; the wheel."""
    folder = tmp_path_factory.mktemp("installed")
    files = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    for name in files.split("\0"):
        if (ROOT / name).is_file() and not name.startswith(("docs/", "tests/", "benchmarks/")):
            copy = folder / "source" / name
            copy.parent.mkdir(parents=True, exist_ok=True)
            copy.write_bytes((ROOT / name).read_bytes())
    build = ("pip", "wheel", "-q", "--no-deps", "-w", str(folder), str(folder / "source"))
    built = run(sys.executable, "-m", *build, cwd=folder)
    assert built.returncode == 0, built.stderr[-3000:]
    (wheel,) = folder.glob("hedgebed-*.whl")
    venv.create(folder / "venv", with_pip=True, system_site_packages=False)
    bin_ = folder / "venv" / ("Scripts" if os.name == "nt" else "bin")
    answer = run(
        str(bin_ / "python"), "-m", "pip", "download", "-q", "--no-deps", "-d", str(folder), "rich", cwd=folder
    )
    if answer.returncode != 0:
        pytest.skip(f"pip finds no index of packages here: {answer.stderr.strip().splitlines()[-1]}")
    done = run(str(bin_ / "python"), "-m", "pip", "install", "-q", f"{wheel}[mujoco]", cwd=folder)
    assert done.returncode == 0, done.stderr[-3000:]
    return bin_ / "python", wheel


def failures(python: Path, commands: tuple[str, ...], folder: Path) -> dict[str, str]:
    """The end of stderr of each command that fails, carried out in this folder."""
    done = {command: run(str(python.with_name("hedgebed")), *command.split(), cwd=folder) for command in commands}
    return {command: one.stderr[-1500:] for command, one in done.items() if one.returncode != 0}


@pytest.mark.long
def test_an_installed_hedgebed_has_all_packages_for_its_first_answers(installed, tmp_path):
    assert failures(installed[0], QUICK, tmp_path) == {}
    found = run(str(installed[0]), "-c", "import experiments; print(experiments.__file__)", cwd=tmp_path).stdout
    assert Path(found.strip()).is_relative_to(installed[0].parents[1])
    bed = json.loads((tmp_path / "runs/bed/result.json").read_text(encoding="utf-8"))
    assert 100 < bed["quantities"]["grain_count"]["value"] < 1000


@pytest.mark.slow
def test_every_command_works_with_no_packages_but_those_that_pip_installs(installed, tmp_path):
    python, wheel = installed
    done = run(str(python), "-m", "pip", "install", "-q", f"{wheel}[{EXTRAS}]", cwd=tmp_path)
    assert done.returncode == 0, done.stderr[-3000:]
    for name, text in FILES.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    assert failures(python, COMMANDS, tmp_path) == {}
