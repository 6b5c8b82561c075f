"""Starts Taichi once, for every bed of the process.

Contract: ``start`` may be called any number of times. With the settings that are in force it does nothing; with other
settings it starts Taichi anew, which invalidates the fields of every earlier bed. Beds remember the generation they
belong to and refuse to go on after it has ended.
"""

import contextlib
import io
import os
import subprocess
import threading
from dataclasses import dataclass
from pathlib import Path

__all__ = ["Runtime", "free_memory", "generation", "refuse_memory", "start", "usable_cores"]

ARCHITECTURES = ("cpu", "cuda")
PRECISIONS = ("float64", "float32")


@dataclass(frozen=True)
class Runtime:
    """What Taichi runs on: architecture, number of threads, precision of the grains' numbers."""

    arch: str
    threads: int
    precision: str


_current: Runtime | None = None
_generation = 0


def generation() -> int:
    """The number of times that Taichi was started; a bed of an earlier generation is no longer valid."""
    return _generation


def _on_gpu() -> bool:
    """Whether Taichi runs on a GPU."""
    return _current is not None and _current.arch == "cuda"


def _free_on_gpu() -> int | None:
    """Bytes that the GPU with most of them has free; None if unknown."""
    query = ["nvidia-smi", "--query-gpu=memory.free", "--format=csv,noheader,nounits"]
    try:
        said = subprocess.run(query, capture_output=True, text=True, check=True, timeout=30).stdout
        return 2**20 * max(int(line) for line in said.split())
    except (OSError, subprocess.SubprocessError, ValueError):
        return None


def free_memory() -> int | None:
    """Bytes that beds may still take: of the GPU if Taichi runs there, else of this process; None if unknown."""
    if _on_gpu():
        return _free_on_gpu()
    found = []
    try:
        rows = dict(line.split(":") for line in Path("/proc/meminfo").read_text().splitlines())
        found.append(1024 * int(rows["MemAvailable"].split()[0]))
    except (OSError, ValueError, KeyError):
        pass
    try:
        most, used, kept = (Path("/sys/fs/cgroup/memory." + name).read_text() for name in ("max", "current", "stat"))
        cached = dict(line.split() for line in kept.splitlines())["inactive_file"]  # given back when it is needed
        found.append(int(most) - int(used) + int(cached))
    except (OSError, ValueError, KeyError):
        pass
    return min(found, default=None)


def refuse_memory(needed: int) -> None:
    """Raise MemoryError, with numbers, where so many bytes cannot be had."""
    free = free_memory()
    if free is not None and needed > free:
        where = " on the GPU" if _on_gpu() else ""
        raise MemoryError(f"needs {needed / 2**30:.3g} GiB of memory, {free / 2**30:.3g} GiB are free{where}")


def start(*, arch: str = "cpu", threads: int | None = None, precision: str = "float64") -> Runtime:
    """Start Taichi, or keep it if it already runs with these settings.

    Args:
        arch: "cpu" or "cuda".
        threads: CPU threads; all that the machine has when None. With a GPU it makes no difference.
        precision: "float64" or "float32".

    Raises ValueError: an unknown architecture or precision, or a number of threads below one. RuntimeError: the
    architecture is not available on this machine.
    """
    global _current, _generation
    if arch not in ARCHITECTURES:
        raise ValueError(f"arch = {arch!r} is unknown; use one of {', '.join(ARCHITECTURES)}")
    if precision not in PRECISIONS:
        raise ValueError(f"precision = {precision!r} is unknown; use one of {', '.join(PRECISIONS)}")
    if threads is None:
        threads = len(usable_cores())
    if threads < 1:
        raise ValueError(f"threads = {threads} must be at least 1")
    wanted = Runtime(arch, threads if arch == "cpu" else 1, precision)
    if wanted == _current:
        return wanted
    from hedgebed_taichi import ti

    real = ti.f64 if precision == "float64" else ti.f32
    # Taichi's own control-flow pass triples the time to compile and LLVM does its work: steps run as fast without it.
    options = dict(default_fp=real, default_ip=ti.i32, fast_math=False, cfg_optimization=False)
    with contextlib.redirect_stdout(io.StringIO()):  # its greeting would spoil what a script prints
        if arch == "cpu":
            before = _own_threads()
            ti.init(arch=ti.cpu, cpu_max_num_threads=threads, **options)
            ours = {thread.native_id for thread in threading.enumerate()}  # started meanwhile by somebody else
            _keep_apart(sorted(_own_threads() - before - ours)[-threads:])
        else:
            # Asked first, since Taichi's start ends the beds there are even where it fails.
            if not ti.lang.misc.is_arch_supported(ti.cuda):
                raise RuntimeError(
                    "arch = 'cuda' is not available here: no NVIDIA GPU with its driver; use arch = 'cpu'"
                )
            _current, _generation = None, _generation + 1
            try:
                ti.init(arch=ti.cuda, enable_fallback=False, **options)
            except Exception as problem:
                raise RuntimeError(f"arch = 'cuda' is not available here ({problem}); use arch = 'cpu'") from None
    _current = wanted
    _generation += 1
    return wanted


def usable_cores() -> list[int]:
    """The cores that this process may run on; all, where the system does not restrict them."""
    try:
        return sorted(os.sched_getaffinity(0))
    except AttributeError:
        return list(range(os.cpu_count() or 1))


def _own_threads() -> set[int]:
    """Ids of this process's threads; none where the system does not list them."""
    try:
        return {int(path.name) for path in Path("/proc/self/task").iterdir()}
    except OSError:
        return set()


def _keep_apart(workers: list[int]) -> None:
    """Give each of Taichi's workers a core of its own where there are as many: the last threads that it has started.

    A launch is some milliseconds. Left to itself Linux may wake two workers on one core, and moves one of them only at
    the next tick, 4 ms later; and a worker that stays where it is has its chunks in that core's cache.
    """
    cores = usable_cores()
    if len(workers) < 2 or len(workers) != len(cores):
        return
    for worker, core in zip(workers, cores, strict=True):
        with contextlib.suppress(OSError, AttributeError):
            os.sched_setaffinity(worker, {core})
