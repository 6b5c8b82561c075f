"""What a benchmark ran on, and the head of its bench.json."""

import os
import platform
import sys
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from experiments.runs.memory import cores_there
from experiments.runs.types import Json
from experiments.runs.version import __version__
from hedgebed_taichi import version

__all__ = ["begin_timing", "column_table", "describe_machine", "environment_numbers", "now", "wide_console"]

_BUSY = 0.5  # load per core at the start from which the machine is called busy


def now() -> str:
    """The date, to the second."""
    return datetime.now(UTC).isoformat(timespec="seconds")


def begin_timing(what: str) -> tuple[Json, list[str]]:
    """What the bench.json of a timing begins with, and a remark where the machine is busy at the start."""
    cores, load = cores_there(), os.getloadavg()[0]
    said = f"the machine was busy at the start (load {load:.1f} on {cores} cores): timings mean little"
    bench = {"format": "hedgebed-bench/1", "what": what, "date": now(), "version": __version__}
    return bench | {"machine": describe_machine(cores, load)}, [said] if load > _BUSY * cores else []


def environment_numbers(name: str, default: tuple[int, ...], *, most: int = 1) -> tuple[int, ...]:
    """The positive whole numbers, `most` at most, in the variable HEDGEBED_BENCH_<name> of the environment.

    `default`: where it is empty or not set. Raises ValueError for anything else.
    """
    key = f"HEDGEBED_BENCH_{name}"
    words = os.environ.get(key, "").replace(",", " ").split()
    if not all(word.isdigit() and int(word) > 0 for word in words) or len(words) > most:
        wanted = "one positive whole number" if most == 1 else "positive whole numbers"
        raise ValueError(f"{key} = {os.environ[key]!r} must be {wanted}")
    return tuple(int(word) for word in words) or default


def column_table(columns: Sequence[str], *, left: Sequence[str] = (), **options: Any) -> Table:
    """A table of these columns, to the right but for those named."""
    table = Table(**options)
    for column in columns:
        table.add_column(column, justify="left" if column in left else "right")
    return table


def wide_console() -> Console:
    """As wide as the terminal, or wide enough for a table in a file."""
    return Console(width=None if sys.stdout.isatty() else 150, highlight=False)


def describe_machine(cores: int, load: float) -> Json:
    """Processor, cores, load at the start, system and the versions under us."""
    info = Path("/proc/cpuinfo")
    lines = info.read_text(encoding="utf-8").splitlines() if info.exists() else []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return {
        "processor": names[0] if names else platform.processor() or platform.machine(),
        "cores": cores,
        "load": load,
        "system": platform.platform(),
        "python": platform.python_version(),
        "taichi": version().removeprefix("taichi "),
    }
