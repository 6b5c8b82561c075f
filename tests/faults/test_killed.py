"""Long experiments killed (kill -9) at random moments and resumed: the same bits as of a run left alone.

Each experiment is killed once, `make torture` kills as often as HEDGEBED_KILLS says, in all. HEDGEBED_KILLED_KEPT names
a file to which every run adds a line as it ends, with what each kill met; kills that it has are not done again. A kill
counts only where the run had kept a file before.
"""

import json
import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from small_cases import CALIBRATE, GRAINS, TUMBLE_ON_GRAINS

from coupling.lammps import LammpsMissingError, find_lammps
from coupling.lammps.watch import descendants
from experiments.campaign.files import new_campaign
from experiments.runs.folder import read_series

ROOT = Path(__file__).resolve().parents[2]
KEPT = os.environ.get("HEDGEBED_KILLED_KEPT")
CASES = {
    "penetrate": GRAINS + """
grain = 0.0024
seeds = [1]
speeds = [0.2]
hold = 0.005
mass = 0.05
drop_speeds = [0.1]
after_stop = 0.01
""",
    "calibrate": CALIBRATE,
    "tumble": TUMBLE_ON_GRAINS + "duration = 0.06\nframe_count = 0\ncheckpoint_interval = 0.5\n",
    "sweep": """
experiment = "tumble"
workers = 2
[fixed]
duration = 4.0
[over]
torque = "0.14:0.2:0.02"
mu_s = [0.4, 0.6]
""",
    "diagnose": "campaign = 'dig'\n",
    "bed calibrate": """
name = "mine"
size = [6.0, 6.0, 6.0]
strain = 0.2
inertial_number = 0.05
points = 3
most_points = 3
checks = 1
check_seeds = [2]
threads = 1
[free]
rolling_friction = [0.0, 0.8]
[targets.critical_friction_angle]
value = 31.0
tolerance = 1.0
source = "made up"
""",
}  # fmt: skip
ON_LAMMPS = (
    GRAINS
    + """
ground = "lammps"
ranks = 2
grain = 0.004
seeds = [1]
speeds = [0.2]
hold = 0.0
drop_speeds = []
young = 2e7
"""
)
OF_CASES = """
import sys
from pathlib import Path
import experiments.suite.cases
from experiments.cli.main import main
experiments.suite.cases.CASES = Path("cases")
sys.exit(main(sys.argv[1:]))
"""
"""`hedgebed experiments run` with cases of the test, which are much smaller than those that ship."""
NAMES = (*CASES, "experiments run")
ALL = int(os.environ.get("HEDGEBED_KILLS", str(len(NAMES))))
KILLS = {name: ALL // len(NAMES) + (place < ALL % len(NAMES)) for place, name in enumerate(NAMES)}


def begun(name, out, home):
    """The command, or its resumption, in a process of its own; what it says goes to `home`/log."""
    environment = os.environ | {"PYTHONPATH": str(ROOT), "HEDGEBED_CACHE": str(out) + "-cache"}
    if name == "experiments run":
        work = ["--work", f"{out}/work", "--results", f"{out}/results", "--workers", "1"]
        command = ["-c", OF_CASES, "experiments", "run", *work, "--quiet"]
    elif (out / "run.toml").exists():
        command = ["-m", "hedgebed", "resume", str(out), "--quiet"]
    else:
        command = ["-m", "hedgebed", *name.split(), "case.toml", "--out", str(out), "--quiet"]
    with (home / "log").open("w") as log:
        return subprocess.Popen(
            [sys.executable, *command], env=environment, cwd=home, stdout=subprocess.DEVNULL, stderr=log
        )


def files(folder):
    """What a run says: its numbers, series and tables."""
    paths = [path for path in folder.rglob("*") if path.suffix in (".csv", ".nc") or path.name == "result.json"]
    return {str(path.relative_to(folder)): path.read_bytes() for path in paths}


NOTHING = "nothing yet"


def counted(moments):
    """How many of these kills met a run that had kept something."""
    return sum(moment["last_kept"] != NOTHING for moment in moments)


def test_a_kill_before_anything_is_kept_does_not_count():
    found = [
        counted([{"after_s": 1.0, "last_kept": where(path)}]) for path in (ROOT / "nowhere", ROOT / "tests/faults")
    ]
    assert found == [0, 1]


def where(folder):
    """The part of the work that was kept last when a run was killed."""
    paths = [path for path in folder.rglob("*") if path.is_file() and path.name not in ("lock", "log")]
    last = max(paths, key=lambda path: path.stat().st_mtime_ns, default=None)
    return NOTHING if last is None else str(last.relative_to(folder))


def newest_checkpoint(out):
    """The newest checkpoint of a run, of its members and of its bed under way, from which the run goes on."""
    paths = [*out.rglob("checkpoint/*"), *Path(f"{out}-cache").glob("unfinished/*")]
    whole = [path for path in paths if path.is_file() and path.name[0] != "." and path.suffix != ".before"]
    newest = max(whole, key=lambda path: path.stat().st_mtime_ns, default=None)
    return NOTHING if newest is None else str(newest.relative_to(out.parent))


def test_the_newest_checkpoint_of_a_killed_run_is_that_of_a_bed_under_way_too(tmp_path):
    """No file that was being written, none that a newer one has replaced, and no status."""
    out, found = tmp_path / "out", [newest_checkpoint(tmp_path / "out")]
    names = ("out-cache/unfinished/sand.npz", "out/members/a/checkpoint/b.npz", "out/checkpoint/b.npz.before",
             "out/checkpoint/.b.npz.1.tmp", "out/status.json")  # fmt: skip
    for age, name in enumerate(names):
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
        os.utime(path, (age, age))
        found.append(newest_checkpoint(out))
    assert found == [NOTHING, names[0], *[names[1]] * 4]


def kept_of(name):
    """Lines of runs of the experiment in the file, if there is one."""
    lines = Path(KEPT).read_text().splitlines() if KEPT and Path(KEPT).exists() else []
    return [line for line in map(json.loads, lines) if line["experiment"] == name]


@pytest.mark.parametrize(
    "name", [pytest.param(one, marks=pytest.mark.long if one == "bed calibrate" else pytest.mark.slow) for one in NAMES]
)
def test_an_experiment_killed_at_random_moments_ends_in_the_same_bits(name, tmp_path):
    """A run that comes to its end between two kills is compared, and the next begins."""
    before = kept_of(name)
    killed, runs = sum(counted(line["killed"]) for line in before), len(before)
    assert all(line["same"] for line in before), before
    if killed >= KILLS[name] and before:
        pytest.skip(f"{KEPT} has {killed} kills of it")
    prepared(name, tmp_path)
    started = time.monotonic()
    assert begun(name, tmp_path / "whole", tmp_path).wait() == 0, (tmp_path / "log").read_text()
    lasts, whole = time.monotonic() - started, files(tmp_path / "whole")
    assert any(path.endswith("result.json") for path in whole)
    while killed < KILLS[name]:
        chance, out, moments = random.Random(f"{name} {runs}"), tmp_path / f"broken{runs}", []
        while True:
            process, began = begun(name, out, tmp_path), time.monotonic()
            try:
                status = process.wait(timeout=chance.uniform(0.0, lasts) if killed < KILLS[name] else None)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
                after = {"after_s": round(time.monotonic() - began, 2)}
                moments.append(after | {"last_kept": where(out), "checkpoint": newest_checkpoint(out)})
                killed += counted(moments[-1:])
            else:
                break
        assert status == 0, (tmp_path / "log").read_text()
        runs += 1
        same = files(out) == whole
        if KEPT:
            line = {
                "experiment": name,
                "lasts_s": round(lasts, 1),
                "killed": moments,
                "files": len(whole),
                "same": same,
            }
            with Path(KEPT).open("a") as file:
                file.write(json.dumps(line) + "\n")
        assert same


def prepared(name, home):
    """What the experiment reads: its case, its campaign."""
    if name == "diagnose":
        new_campaign(home / "dig", kind="penetration")
    if name == "experiments run":
        (home / "cases" / "grains").mkdir(parents=True)
        (home / "cases" / "grains" / "grains1-small.toml").write_text(CASES["tumble"].replace("0.06", "0.03"))
    else:
        (home / "case.toml").write_text(CASES[name])


def alive(pids):
    """Those of these processes that still run."""
    found = []
    for pid in pids:
        try:
            state = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
        except OSError:
            continue
        if state != "Z":
            found.append(pid)
    return found


def at_a_checkpoint(process, out):
    """Wait until the run has written its next checkpoint; return the processes that it has started, ranks last."""
    path, before = out / "checkpoint" / "seed1-driven-0.2.npz", 0
    if path.exists():
        before = path.stat().st_mtime_ns
    while not path.exists() or path.stat().st_mtime_ns == before:
        assert process.poll() is None
        time.sleep(0.02)
    return descendants(process.pid)


@pytest.mark.slow
def test_a_run_in_lammps_that_is_killed_leaves_no_process_behind_and_ends_when_it_is_resumed(tmp_path):
    """hedgebed is killed, then a rank of the resumed run. Its bits differ: docs/scale.md has by how much."""
    try:
        find_lammps()
    except LammpsMissingError as missing:
        pytest.skip(str(missing))
    (tmp_path / "case.toml").write_text(ON_LAMMPS.replace("checkpoint_interval = 0.5", "checkpoint_interval = 0.1"))
    assert begun("penetrate", tmp_path / "whole", tmp_path).wait() == 0, (tmp_path / "log").read_text()
    out = tmp_path / "broken"
    for killed in ("hedgebed", "a rank"):
        process = begun("penetrate", out, tmp_path)
        started = at_a_checkpoint(process, out)
        assert len(started) >= 4  # a process that watches, mpiexec, two ranks
        os.kill(process.pid if killed == "hedgebed" else started[-1], signal.SIGKILL)
        status, said = process.wait(60), (tmp_path / "log").read_text()
        until = time.monotonic() + 10.0
        while alive(started) and time.monotonic() < until:
            time.sleep(0.1)
        assert alive(started) == []
        if killed == "hedgebed":
            assert status == -signal.SIGKILL
        else:
            assert status == 1 and "2 ranks has" in said and f"hedgebed resume {out}" in said, said
    assert begun("penetrate", out, tmp_path).wait() == 0, (tmp_path / "log").read_text()
    whole, found = (read_series(home / "series" / "seed1-driven-0.2.csv") for home in (tmp_path / "whole", out))
    assert np.array_equal(found["t_s"], whole["t_s"])
    first = np.abs(found["force_N"] - whole["force_N"])[:50]  # over 1.9 mm; then the motions of grains diverge
    assert first.max() < 0.01 * whole["force_N"].max()
    mean, wanted = (float(rows["force_N"][whole["phase"] == "in"].mean()) for rows in (found, whole))
    assert abs(mean - wanted) < 0.05 * wanted
