"""How much memory and how many cores there are for this process: of the machine, or of a container with limits."""

import os
from dataclasses import dataclass
from pathlib import Path

__all__ = ["Memory", "cores_there", "memory_there"]

_V2, _V1 = Path("/sys/fs/cgroup"), Path("/sys/fs/cgroup/memory")


@dataclass(frozen=True)
class Memory:
    """All in bytes. `limit` is the container's; None where there is none below the machine's own."""

    total: int
    free: int
    limit: int | None


def cores_there() -> int:
    """How many cores this process may run on."""
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:  # not Linux
        return os.cpu_count() or 1


def memory_there() -> Memory:
    """What /proc/meminfo and the control group say; half of the machine where neither can be read."""
    try:
        lines = Path("/proc/meminfo").read_text(encoding="ascii").splitlines()
        kib = {line.split(":")[0]: int(line.split()[1]) for line in lines if len(line.split()) > 1}
        total, free = kib["MemTotal"] * 1024, kib["MemAvailable"] * 1024
    except (OSError, KeyError, ValueError):
        total = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
        free = total // 2
    for folder, most, now in (
        (_V2, "memory.max", "memory.current"),
        (_V1, "memory.limit_in_bytes", "memory.usage_in_bytes"),
    ):
        limit = _number(folder / most)
        if limit is not None and limit < total:
            # Pages of files count as used until somebody wants them.
            used = max(0, (_number(folder / now) or 0) - (_number(folder / "memory.stat", "inactive_file") or 0))
            return Memory(total, min(free, max(0, limit - used)), limit)
    return Memory(total, free, None)


def _number(path: Path, name: str = "") -> int | None:
    """The number in a file, or the one behind `name` in it; None where there is none."""
    try:
        text = path.read_text(encoding="ascii")
        return int(dict(line.split(maxsplit=1) for line in text.splitlines())[name] if name else text)
    except (OSError, ValueError, KeyError):
        return None
