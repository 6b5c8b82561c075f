"""Where a bed is computed: on as many cores as there are, or on a GPU that is there."""

from experiments.runs.memory import cores_there

from . import say

__all__ = ["check_where"]


def check_where(*, arch: str, threads: int | None, precision: str = "float64") -> None:
    """Raise ValueError for more threads than cores (None: all), and where the backend `arch` does not start here."""
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
