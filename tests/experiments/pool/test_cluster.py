"""Lists of runs on a scheduler of dask.distributed: workers, and a client, are killed in the middle of runs."""

import json
import os
import signal
import subprocess
import sys
import time
from contextlib import ExitStack, contextmanager
from pathlib import Path

import numpy as np
import pytest
from faults.test_killed import OF_CASES
from small_cases import CALIBRATE, GRAINS, TUMBLE_ON_GRAINS

ROOT = Path(__file__).resolve().parents[3]
HEDGEBED = ("-m", "hedgebed")
SWEEP = """
experiment = "tumble"
[fixed]
surface = "brick"
rig = 0.0085
duration = 6.0
[over]
torque = "0.14:0.2:0.02"
mu_s = [0.4, 0.6]
"""
ON_GRAINS = f"""
experiment = "penetrate"
[fixed]
{GRAINS.replace("checkpoint_interval = 0.5", "checkpoint_interval = 0.1").replace("depth = 0.006", "depth = 0.005")}
grain = 0.004
young = 2e7
speeds = [0.01]
hold = 0.0
drop_speeds = []
[over]
seeds = [[1], [2]]
"""
#: Of a worker: a line in RESTORED for each run that goes on from a checkpoint: process, kind, steps that were made.
PRELOADED = """
import os
from coupling.penetration import Run

def noted(self, state, restore=Run.restore):
    restore(self, state)
    with open(os.environ["RESTORED"], "a") as file:
        file.write(f"{os.getpid()} {self.kind} {self.count}\\n")

if Run.restore.__name__ != noted.__name__:  # the file may be loaded twice
    Run.restore = noted
"""
CONVERGE = (
    GRAINS
    + """
grain = 0.004
seeds = [1, 2]
speeds = [0.2, 0.4]
hold = 0.0
drop_speeds = []
young = 2e7
ratios = [2.0, 2.4]
widths = []
bed_depths = []
overlaps = []
paces = []
"""
)
LISTS = {
    "converge": (CONVERGE,),
    "calibrate": (CALIBRATE.replace("workers = 1\n", ""),),
    "experiments run": tuple(
        TUMBLE_ON_GRAINS.replace("torque = 0.01", f"torque = {torque}") + "duration = 0.02\ncheckpoint_interval = 0.2\n"
        for torque in (0.01, 0.008)
    ),
    "validate": (),
}
"""Commands that compute a list of runs, with their cases."""
QUICKER = ("calibrate", "validate")
CHECKED = ("hertz-force", "t1")
"""Of the cases of `validate`, those that are computed."""
_PATIENCE = 300.0  # [s]
MADE = 100  # Steps of a push, of some 3,200, that its checkpoint has at least when its worker is killed


@contextmanager
def started(*arguments, log, home=None, **variables):
    """A process of Python, in the folder `home`, which is killed in the end if it lives."""
    environment = os.environ | {"PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"} | variables
    with log.open("w") as file:
        process = subprocess.Popen(
            [sys.executable, *map(str, arguments)], env=environment, cwd=home, stdout=file, stderr=file
        )
    try:
        yield process
    finally:
        process.kill()
        process.wait()


def awaited(what):
    """What `what` says as soon as it says anything."""
    until = time.monotonic() + _PATIENCE
    while not (found := what()):
        assert time.monotonic() < until, "too late"
        time.sleep(0.02)
    return found


def done(folder):
    """Run folder -> when its result was written."""
    found = {}
    for path in folder.glob("members/*/status.json"):
        if '"done"' in path.read_text():
            found[path.parent.name] = (path.parent / "result.json").stat().st_mtime_ns
    return found


def busy(runs, workers):
    """The worker that is in the middle of one of the runs in this folder, and that run."""
    for lock in runs.glob("*/lock"):
        text = lock.read_text().strip()
        if text.isdigit() and int(text) in workers and not (lock.parent / "result.json").exists():
            return workers[int(text)], lock.parent
    return None


def cluster(stack, tmp_path, count, *options, **variables):
    """The file of a scheduler, and its workers by their process ids; all end with the stack."""
    file = tmp_path / "scheduler.json"
    begun = ["-m", "distributed.cli.dask_scheduler", "--port", "0", "--scheduler-file", file, "--no-dashboard"]
    stack.enter_context(started(*begun, log=tmp_path / "scheduler.log"))
    awaited(file.exists)
    workers = {}
    for number in range(count):
        begun = ["-m", "distributed.cli.dask_worker", "--scheduler-file", file, "--nthreads", "1", "--no-nanny",
                 "--no-dashboard", "--local-directory", tmp_path / f"worker{number}", *options]  # fmt: skip
        worker = stack.enter_context(started(*begun, log=tmp_path / f"worker{number}.log", **variables))
        workers[worker.pid] = worker
    return file, workers


@pytest.mark.long
def test_a_sweep_whose_worker_and_client_are_killed_ends_in_the_table_of_a_serial_one(tmp_path):
    """CSV, netCDF and result.json to the bit; no run that was done is done again; the dead worker's run is taken up."""
    pytest.importorskip("distributed")
    case, swept, serial = tmp_path / "sweep.toml", tmp_path / "swept", tmp_path / "serial"
    case.write_text(SWEEP)
    with ExitStack() as stack:
        file, workers = cluster(stack, tmp_path, 3)
        tokens = [*HEDGEBED, "sweep", case, "--scheduler", file, "--out", swept]
        client = stack.enter_context(started(*tokens, log=tmp_path / "client.log"))
        victim, left = awaited(lambda: busy(swept / "members", workers))
        victim.send_signal(signal.SIGKILL)
        victim.wait()
        assert not (left / "result.json").exists()  # it was in the middle of this run
        awaited(lambda: len(done(swept)) >= 3)
        client.send_signal(signal.SIGKILL)
        client.wait()
        before = done(swept)
        assert 3 <= len(before) < 8 and not (swept / "result.json").exists()
        again = stack.enter_context(started(*HEDGEBED, "resume", swept, log=tmp_path / "again.log"))
        assert again.wait(timeout=_PATIENCE) == 0, (tmp_path / "again.log").read_text()
        after = done(swept)
        assert len(after) == 8 and left.name in after
        assert {name: after[name] for name in before} == before
        alone = stack.enter_context(
            started(*HEDGEBED, "sweep", case, "--workers", "1", "--out", serial, log=tmp_path / "serial.log")
        )
        assert alone.wait(timeout=_PATIENCE) == 0, (tmp_path / "serial.log").read_text()
    for name in ("table.csv", "table.nc", "result.json"):
        assert (swept / name).read_bytes() == (serial / name).read_bytes(), name
    assert json.loads((swept / "result.json").read_text())["quantities"]["failed"]["value"] == 0


def pushing(folder, workers):
    """A worker with a checkpoint in the middle of a push, the run, and the steps kept; None where there is none."""
    found = busy(folder / "members", workers)
    if found is None:
        return None
    worker, run = found
    for path in (run / "checkpoint").glob("*-driven-*.npz"):
        if (steps := steps_in(path)) >= MADE:
            return worker, run, steps
    return None


def steps_in(path):
    """Macro steps of the run in a checkpoint."""
    with np.load(path) as kept:
        return int(kept["run.counts"][0])


@pytest.mark.long
def test_a_push_on_grains_of_a_killed_worker_goes_on_elsewhere_from_its_checkpoint(tmp_path):
    """Another worker restores the steps that were kept, and makes the rest; the tables are those of a serial sweep."""
    pytest.importorskip("distributed")
    case, swept, serial, notes = (tmp_path / name for name in ("sweep.toml", "swept", "serial", "restored"))
    case.write_text(ON_GRAINS)
    preloaded = tmp_path / "noted.py"
    preloaded.write_text(PRELOADED)
    shared = {"HEDGEBED_CACHE": str(tmp_path / "cache"), "RESTORED": str(notes)}
    with ExitStack() as stack:
        file, workers = cluster(stack, tmp_path, 2, "--preload", preloaded, **shared)
        tokens = [*HEDGEBED, "sweep", case, "--scheduler", file, "--out", swept]
        client = stack.enter_context(started(*tokens, log=tmp_path / "client.log", **shared))
        victim, run, _ = awaited(lambda: pushing(swept, workers))
        (other,) = set(workers) - {victim.pid}
        os.kill(other, signal.SIGSTOP)  # else it may end the run, and remove the checkpoint, while that is read
        victim.send_signal(signal.SIGKILL)
        victim.wait()
        (checkpoint,) = (run / "checkpoint").glob("*-driven-*.npz")
        kept = steps_in(checkpoint)
        assert kept >= MADE and not notes.exists()
        os.kill(other, signal.SIGCONT)
        assert client.wait(timeout=_PATIENCE) == 0, (tmp_path / "client.log").read_text()
        restored = notes.read_text().split()
        tokens = [*HEDGEBED, "sweep", case, "--workers", "1", "--out", serial]
        alone = stack.enter_context(started(*tokens, log=tmp_path / "serial.log", **shared))
        assert alone.wait(timeout=_PATIENCE) == 0, (tmp_path / "serial.log").read_text()
    assert restored == [str(other), "driven", str(kept)]
    for name in ("table.csv", "table.nc", "result.json"):
        assert (swept / name).read_bytes() == (serial / name).read_bytes(), name
    series = Path("members") / run.name / "series" / f"{checkpoint.stem}.csv"
    pushed = (swept / series).read_bytes()
    assert pushed == (serial / series).read_bytes() and len(pushed.splitlines()) > kept


def in_the_middle(runs, workers):
    """The worker that is in the middle of one of these runs, which has kept something, and that run."""
    found = busy(runs, workers)
    kept = [path for name in ("checkpoint", "series") for path in (found[1] / name).glob("*")] if found else []
    return found if kept else None


def of_list(name, home, out):
    """The command of a list of runs that answers into `out`, and the folder of the runs. Its cases are in `home`."""
    if name == "experiments run":
        (home / "cases" / "grains").mkdir(parents=True, exist_ok=True)
        for number, text in enumerate(LISTS[name]):
            (home / "cases" / "grains" / f"grains1-small{number}.toml").write_text(text)
        return ["-c", OF_CASES, *name.split(), "--work", out / "work", "--results", out], out / "work"
    if name == "validate":
        return [*HEDGEBED, name, "--only", *CHECKED, "--out", out], out / "members"
    (home / "case.toml").write_text("".join(LISTS[name]))
    return [*HEDGEBED, name, "case.toml", "--out", out], out / "members"


def told(name, out):
    """What a list of runs tells: the bytes of its numbers and tables, with those of each run; no times."""
    paths = [path for path in out.rglob("*") if path.suffix in (".csv", ".nc") or path.name == "result.json"]
    if name != "validate":
        return {str(path.relative_to(out)): path.read_bytes() for path in [*paths, *out.glob("ground.toml")]}
    cases = json.loads((out / "result.json").read_text())["cases"]
    rows = [[row[key] for key in ("id", "status", "comparisons", "plots")] for row in cases if row["id"] in CHECKED]
    return {"rows": rows} | {path.name: path.read_bytes() for path in out.glob("series/*.csv")}


@pytest.mark.parametrize(
    "name", [pytest.param(one, marks=pytest.mark.long if one in QUICKER else pytest.mark.slow) for one in LISTS]
)
def test_a_list_of_runs_whose_worker_is_killed_ends_in_the_numbers_of_a_serial_one(name, tmp_path):
    """One of two workers is killed (-9) in the middle of a run, which goes on elsewhere.

    The serial command prepares beds of its own.
    """
    pytest.importorskip("distributed")
    found, alone = tmp_path / "found", tmp_path / "alone"
    with ExitStack() as stack:
        file, workers = cluster(stack, tmp_path, 2, HEDGEBED_CACHE=str(tmp_path / "cache"))
        tokens, runs = of_list(name, tmp_path, found)
        given = {"home": tmp_path, "log": tmp_path / "client.log", "HEDGEBED_CACHE": str(tmp_path / "cache")}
        client = stack.enter_context(started(*tokens, "--scheduler", file, **given))
        where = busy if name == "validate" else in_the_middle
        victim, left = awaited(lambda: where(runs, workers))
        victim.send_signal(signal.SIGKILL)
        victim.wait()
        assert not (left / "result.json").exists()
        assert client.wait(timeout=2 * _PATIENCE) == 0, (tmp_path / "client.log").read_text()
        assert left.name in {path.parent.name for path in runs.glob("*/result.json")}
        tokens, _ = of_list(name, tmp_path, alone)
        given |= {"log": tmp_path / "alone.log", "HEDGEBED_CACHE": str(tmp_path / "own")}
        serial = stack.enter_context(started(*tokens, "--workers", "1", **given))
        assert serial.wait(timeout=2 * _PATIENCE) == 0, (tmp_path / "alone.log").read_text()
    assert told(name, found) == told(name, alone) and len(told(name, found)) > 1
