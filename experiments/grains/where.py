"""Checks of the machine for a bed: memory, cores, and the GPU."""

from experiments.runs.memory import cores_there, memory_there

from . import say

__all__ = ["check_memory", "check_where"]

BYTES_PER_GRAIN = 4000
"""Memory of one grain with its lists and contact history, float64, measured generously [bytes]."""


def check_memory(count: float, grain: float, key: str) -> None:
    """Raise ValueError for more grains, of a mean diameter [m], than there is memory for; `key`: the bed's size."""
    need, there = count * BYTES_PER_GRAIN, memory_there().free
    if need > 0.8 * there:
        least = grain * (need / (0.8 * there)) ** (1 / 3)
        raise ValueError(
            say("memory", grain=grain, count=count, need=need / 1e9, free=there / 1e9, least=least, key=key)
        )


def check_where(*, arch: str, threads: int | None, precision: str = "float64") -> None:
    """Raise ValueError for more threads than cores (None: all), and if the backend `arch` does not start here."""
    cores = cores_there()
    if threads is not None and threads > cores:
        raise ValueError(say("few_cores", threads=threads, cores=cores))
    if arch == "cpu":
        return
    from dem.engine import runtime

    try:
        runtime.start(arch=arch, threads=threads, precision=precision)
    except RuntimeError as error:
        said = " ".join(str(error).split())
        raise ValueError(said if "arch" in said else f"arch = {arch!r} does not run here: {said}") from None
