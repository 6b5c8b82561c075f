"""A process between hedgebed and mpiexec, so that LAMMPS ends even where hedgebed is killed.

    python watch.py FOLDER COMMAND...

It starts the command in FOLDER and ends with its exit status. Its standard input is a pipe that hedgebed holds open.
When that pipe closes, as with kill -9 of hedgebed, it ends the command with all its processes and removes FOLDER.

Imports the standard library alone: it starts as a script, without the rest of hedgebed.
"""

import os
import select
import shutil
import signal
import subprocess
import sys
import threading
from contextlib import suppress
from pathlib import Path

__all__ = ["descendants"]

_GRACE = 3.0  # For mpiexec to end its ranks [s]
_EXIT = 128  # What shells add to the number of a signal


def descendants(pid: int) -> list[int]:
    """Process ids of what this process has started, and of what those have started."""
    children: dict[int, list[int]] = {}
    for entry in Path("/proc").iterdir():
        with suppress(OSError, ValueError):
            if entry.name.isdigit():
                parent = int((entry / "stat").read_text().rpartition(")")[2].split()[1])
                children.setdefault(parent, []).append(int(entry.name))
    found = sorted(children.get(pid, []))
    for each in found:
        found += sorted(children.get(each, []))
    return found


def _end_after_pipe(process: "subprocess.Popen[bytes]") -> None:
    """Wait until standard input closes, then end the command: mpiexec is asked first, what is left is killed."""
    while os.read(0, 1):
        pass
    ranks = descendants(process.pid)
    process.terminate()
    with suppress(subprocess.TimeoutExpired):
        process.wait(_GRACE)
    for pid in [process.pid, *ranks] if process.poll() is None else ranks:
        with suppress(ProcessLookupError):
            os.kill(pid, signal.SIGKILL)


def main() -> int:
    """Run the command; its exit status."""
    folder, command = sys.argv[1], sys.argv[2:]
    process = subprocess.Popen(command, cwd=folder, stdin=subprocess.DEVNULL)
    ends = threading.Thread(target=_end_after_pipe, args=(process,), daemon=True)
    ends.start()
    status = process.wait()
    if select.select([0], [], [], 0.0)[0]:  # nobody writes: the pipe is closed
        ends.join()
        shutil.rmtree(folder, ignore_errors=True)
    return status if status >= 0 else _EXIT - status


if __name__ == "__main__":
    sys.exit(main())
