"""A sweep on a scheduler of dask.distributed with three workers, one killed in the middle of a run, then the client."""

import json
import os
import signal
import subprocess
import sys
import time
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest

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
_PATIENCE = 120.0  # [s]


@contextmanager
def started(*arguments, log):
    """A process, which is killed in the end if it lives."""
    environment = os.environ | {"PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"}
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


@pytest.mark.long
def test_a_sweep_whose_worker_and_client_are_killed_ends_in_the_table_of_a_serial_one(tmp_path):
    """CSV, netCDF and result.json to the bit; no run that was done is done again; the dead worker's run is taken up."""
    pytest.importorskip("distributed")
    case, swept, serial = tmp_path / "sweep.toml", tmp_path / "swept", tmp_path / "serial"
    case.write_text(SWEEP)
    file = tmp_path / "scheduler.json"
    with ExitStack() as stack:
        begun = ["distributed.cli.dask_scheduler", "--port", "0", "--scheduler-file", file, "--no-dashboard"]
        stack.enter_context(started(*begun, log=tmp_path / "scheduler.log"))
        awaited(file.exists)
        workers = {}
        for number in range(3):
            begun = ["distributed.cli.dask_worker", "--scheduler-file", file, "--nthreads", "1", "--no-nanny",
                     "--no-dashboard", "--local-directory", tmp_path / f"worker{number}"]  # fmt: skip
            worker = stack.enter_context(started(*begun, log=tmp_path / f"worker{number}.log"))
            workers[worker.pid] = worker
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
