"""Taichi's cache of compiled kernels, which one killed process would switch off for good.

Taichi 1.7, like its fork quadrants, locks the cache by making a file and unlocks it by removing that file
(`taichi/util/file_lock.h`). It does so while it reads or writes the cache's table. Whoever is killed in such a
moment leaves the lock behind: every later process then finds the cache locked, compiles everything anew and keeps
nothing. The kernel that was being written stays an empty file, which would never be written again either.
"""

import time
from pathlib import Path

from hedgebed_taichi import kernel_cache

__all__ = ["free_kernel_cache"]

_STALE = 600.0  # Seconds after which a lock is nobody's: it is held for some milliseconds


def free_kernel_cache(folder: Path | None = None) -> bool:
    """Remove a lock that a killed process has left in `folder` (Taichi's own by default), and the kernels it left
    empty. Says whether there was one; what cannot be removed stays, for without the cache all works, but slowly.
    """
    folder = folder or kernel_cache()
    try:
        lock = next(folder.glob("*cache.lock"))
        left_at = lock.stat().st_mtime
        if time.time() - left_at < _STALE:
            return False
        for kernel in (*folder.glob("*.tic"), *folder.glob("*.qdc")):
            status = kernel.stat()
            if status.st_size == 0 and time.time() - status.st_mtime > _STALE:
                kernel.unlink()
        lock.unlink()
    except (OSError, StopIteration):
        return False
    return True
