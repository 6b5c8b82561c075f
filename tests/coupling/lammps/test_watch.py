"""LAMMPS ends with hedgebed, however hedgebed ends."""

import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from types import SimpleNamespace

import pytest

from coupling.lammps import LammpsEndedError, LammpsMissingError, find_lammps, process, watch

# Without the rest of hedgebed, which takes seconds to load. LAMMPS is to answer when nobody reads any more.
MASTER = """
import sys, time, types
for name in ("coupling", "coupling.lammps"):
    sys.modules[name] = types.ModuleType(name)
    sys.modules[name].__path__ = [sys.argv[1]]  # where relative imports look
from coupling.lammps.process import Lammps
lammps = Lammps(1)
lammps.wait()
print(lammps.folder, *lammps.processes, flush=True)
lammps.tell(["shell sleep 0.5", 'print "1" file answers screen no'])
time.sleep(60)
"""


def alive(pids):
    """Those that still run."""
    found = []
    for pid in pids:
        try:
            state = (Path("/proc") / str(pid) / "stat").read_text().rpartition(")")[2].split()[0]
        except OSError:
            continue
        if state != "Z":
            found.append(pid)
    return found


def all_ended(pids, within=5.0):
    """Whether these processes end within a time [s]."""
    until = time.monotonic() + within
    while alive(pids) and time.monotonic() < until:
        time.sleep(0.02)
    return not alive(pids)


def cores_of(process):
    """On which cores it may run, as text (the suite has its own `os.sched_getaffinity`)."""
    lines = (Path("/proc") / str(process) / "status").read_text().splitlines()
    return next(line for line in lines if line.startswith("Cpus_allowed_list"))


def test_a_closed_pipe_ends_the_command_with_its_children_and_removes_the_folder(tmp_path):
    folder = tmp_path / "work"
    folder.mkdir()
    watcher = subprocess.Popen(
        [sys.executable, "-I", "-S", watch.__file__, str(folder), "sh", "-c", "sleep 60 & echo ready; wait"],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE,
    )  # fmt: skip
    assert watcher.stdout.readline() == b"ready\n"
    started = watch.descendants(watcher.pid)
    assert len(started) == 2
    watcher.stdin.close()
    assert watcher.wait(10) == 128 + signal.SIGTERM
    assert all_ended(started)
    watcher.stdout.close()
    assert not folder.exists()


def test_the_exit_status_of_the_command_is_passed_on_and_the_folder_stays(tmp_path):
    command = [sys.executable, "-I", "-S", watch.__file__, str(tmp_path), "sh", "-c", "exit 3"]
    pipe = os.pipe()
    assert subprocess.run(command, stdin=pipe[0], check=False).returncode == 3
    assert tmp_path.exists()
    for end in pipe:
        os.close(end)


@pytest.mark.long
def test_after_kill_9_of_hedgebed_no_process_of_lammps_is_left():
    try:
        find_lammps()
    except LammpsMissingError as missing:
        pytest.skip(str(missing))
    package = Path(process.__file__).parent
    master = subprocess.Popen([sys.executable, "-c", MASTER, str(package)], stdout=subprocess.PIPE, text=True)
    folder, *pids = master.stdout.readline().split()
    assert len(alive(pids)) >= 2
    master.stdout.close()
    master.kill()
    master.wait()
    assert all_ended(pids, within=10.0)
    assert not Path(folder).exists()


def test_an_error_of_lammps_is_told_apart_from_a_killed_rank():
    try:
        lammps = process.Lammps(1)
    except LammpsMissingError as missing:
        pytest.skip(str(missing))
    with pytest.raises(LammpsEndedError, match="ERROR: Unknown command: nonsense") as ended:
        [lammps.tell(["nonsense"]), lammps.wait()]
    assert ended.value.refused
    lammps.close()


def test_a_rank_may_run_on_every_core_that_hedgebed_may():
    """Open MPI would bind the first rank of each run to the first core: runs beside one another would share it."""
    try:
        lammps = process.Lammps(1)
    except LammpsMissingError as missing:
        pytest.skip(str(missing))
    lammps.wait()
    ranks = [cores_of(pid) for pid in lammps.processes]
    lammps.close()
    assert ranks == [cores_of("self")] * len(ranks)


def test_a_close_that_was_interrupted_leaves_alone_what_has_got_the_numbers_of_its_pipes(tmp_path):
    """Else the pipes of another LAMMPS would be closed, which then ends by SIGTERM."""

    def interrupted(within=None):
        raise KeyboardInterrupt

    lammps = object.__new__(process.Lammps)
    kept = lammps._kept = tempfile.TemporaryDirectory(dir=tmp_path)
    lammps._ended = ""
    lammps._commands, lammps._answers = (os.open(os.devnull, os.O_WRONLY) for _ in range(2))
    lammps._process = SimpleNamespace(wait=interrupted)
    with pytest.raises(KeyboardInterrupt):
        lammps.close()
    other = os.open(os.devnull, os.O_RDONLY)
    assert other == lammps._commands
    lammps.close()
    os.fstat(other)
    [os.close(each) for each in (other, lammps._answers)]
    kept.cleanup()
