"""Temporary folders of benchmarks, which do not stay: those of a killed process are removed by one an hour later.

A folder belongs to the process that holds its lock. The system releases the lock when the process ends, also by kill.
"""

import fcntl
import os
import shutil
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

__all__ = ["scratch"]

_NEW = 3600.0  # A younger folder may not have its lock yet, or be that of an older version, which took none [s]
_WRITES_ON = 5.0  # For so long processes that were killed may still write into the folder [s]


@contextmanager
def scratch(prefix: str = "hedgebed-bench-") -> Iterator[Path]:
    """A temporary folder whose name begins with `prefix`; in the end it is removed, and others left by killed runs."""
    _remove_left(prefix)
    folder = Path(tempfile.mkdtemp(prefix=prefix))
    lock = _lock(folder)
    try:
        yield folder
    finally:
        _remove(folder)
        if lock is not None:
            os.close(lock)


def _lock(folder: Path) -> int | None:
    """The lock of a folder, as an open descriptor; None where another process has it or it cannot be opened."""
    try:
        found = os.open(folder, os.O_RDONLY)
    except OSError:  # removed meanwhile, or of another user
        return None
    try:
        fcntl.flock(found, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(found)
        return None
    return found


def _remove_left(prefix: str) -> None:
    """Remove folders of this prefix whose process has ended."""
    for folder in Path(tempfile.gettempdir()).glob(f"{prefix}*"):
        with suppress(OSError):
            if folder.is_symlink() or not folder.is_dir() or time.time() - folder.stat().st_mtime < _NEW:
                continue
            if (lock := _lock(folder)) is not None:
                shutil.rmtree(folder, ignore_errors=True)
                os.close(lock)


def _remove(folder: Path) -> None:
    """Remove the folder, again where something was written into it meanwhile."""
    until = time.monotonic() + _WRITES_ON
    shutil.rmtree(folder, ignore_errors=True)
    while folder.exists() and time.monotonic() < until:
        time.sleep(0.05)
        shutil.rmtree(folder, ignore_errors=True)
