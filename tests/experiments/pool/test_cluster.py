"""A sweep on a scheduler of dask.distributed: workers and the client are killed in the middle of runs."""

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
from small_cases import GRAINS

ROOT = Path(__file__).resolve().parents[3]
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
_PATIENCE = 300.0  # [s]
MADE = 100  # Steps of a push, of some 3,200, that its checkpoint has at least when its worker is killed


@contextmanager
def started(*arguments, log, **variables):
    """A process, which is killed in the end if it lives."""
    environment = os.environ | {"PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"} | variables
    with log.open("w") as file:
        process = subprocess.Popen(
            [sys.executable, "-m", *map(str, arguments)], env=environment, stdout=file, stderr=file
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


def busy(folder, workers):
    """The worker that is in the middle of a run, and that run."""
    for lock in folder.glob("members/*/lock"):
        text = lock.read_text().strip()
        if text.isdigit() and int(text) in workers and not (lock.parent / "result.json").exists():
            return workers[int(text)], lock.parent
    return None


def cluster(stack, tmp_path, count, *options, **variables):
    """The file of a scheduler, and its workers by their process ids; all end with the stack."""
    file = tmp_path / "scheduler.json"
    begun = ["distributed.cli.dask_scheduler", "--port", "0", "--scheduler-file", file, "--no-dashboard"]
    stack.enter_context(started(*begun, log=tmp_path / "scheduler.log"))
    awaited(file.exists)
    workers = {}
    for number in range(count):
        begun = ["distributed.cli.dask_worker", "--scheduler-file", file, "--nthreads", "1", "--no-nanny",
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
        tokens = ["hedgebed", "sweep", case, "--scheduler", file, "--out", swept]
        client = stack.enter_context(started(*tokens, log=tmp_path / "client.log"))
        victim, left = awaited(lambda: busy(swept, workers))
        victim.send_signal(signal.SIGKILL)
        victim.wait()
        awaited(lambda: len(done(swept)) >= 3)
        client.send_signal(signal.SIGKILL)
        client.wait()
        before = done(swept)
        assert 3 <= len(before) < 8 and not (swept / "result.json").exists()
        again = stack.enter_context(started("hedgebed", "resume", swept, log=tmp_path / "again.log"))
        assert again.wait(timeout=_PATIENCE) == 0, (tmp_path / "again.log").read_text()
        after = done(swept)
        assert len(after) == 8 and left.name in after
        assert {name: after[name] for name in before} == before
        alone = stack.enter_context(
            started("hedgebed", "sweep", case, "--workers", "1", "--out", serial, log=tmp_path / "serial.log")
        )
        assert alone.wait(timeout=_PATIENCE) == 0, (tmp_path / "serial.log").read_text()
    for name in ("table.csv", "table.nc", "result.json"):
        assert (swept / name).read_bytes() == (serial / name).read_bytes(), name
    assert json.loads((swept / "result.json").read_text())["quantities"]["failed"]["value"] == 0


def pushing(folder, workers):
    """A worker with a checkpoint in the middle of a push, the run, and the steps kept; None where there is none."""
    found = busy(folder, workers)
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
        tokens = ["hedgebed", "sweep", case, "--scheduler", file, "--out", swept]
        client = stack.enter_context(started(*tokens, log=tmp_path / "client.log", **shared))
        victim, run, _ = awaited(lambda: pushing(swept, workers))
        victim.send_signal(signal.SIGKILL)
        victim.wait()
        (checkpoint,) = (run / "checkpoint").glob("*-driven-*.npz")
        kept = steps_in(checkpoint)
        assert kept >= MADE and not notes.exists()
        assert client.wait(timeout=_PATIENCE) == 0, (tmp_path / "client.log").read_text()
        restored = notes.read_text().split()
        tokens = ["hedgebed", "sweep", case, "--workers", "1", "--out", serial]
        alone = stack.enter_context(started(*tokens, log=tmp_path / "serial.log", **shared))
        assert alone.wait(timeout=_PATIENCE) == 0, (tmp_path / "serial.log").read_text()
    (other,) = set(workers) - {victim.pid}
    assert restored == [str(other), "driven", str(kept)]
    for name in ("table.csv", "table.nc", "result.json"):
        assert (swept / name).read_bytes() == (serial / name).read_bytes(), name
    series = Path("members") / run.name / "series" / f"{checkpoint.stem}.csv"
    pushed = (swept / series).read_bytes()
    assert pushed == (serial / series).read_bytes() and len(pushed.splitlines()) > kept
