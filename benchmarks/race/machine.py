"""What a benchmark ran on."""

import os
import platform
from importlib.metadata import version
from pathlib import Path
from typing import Any

__all__ = ["count_cores", "describe_machine"]


def count_cores() -> int:
    """The cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def describe_machine(cores: int, load: float) -> dict[str, Any]:
    """Processor, cores, load at the start, system and the versions under us."""
    return {
        "processor": _processor(),
        "cores": cores,
        "load": load,
        "system": platform.platform(),
        "python": platform.python_version(),
        "taichi": version("taichi"),
    }


def _processor() -> str:
    info = Path("/proc/cpuinfo")
    lines = info.read_text(encoding="utf-8").splitlines() if info.exists() else []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()
