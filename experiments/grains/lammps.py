"""`--ground lammps --ranks N`: the prepared bed goes over to LAMMPS."""

from typing import Any

from coupling import BedGround
from experiments.runs.progress import Progress

from . import say

__all__ = ["check_lammps", "in_lammps", "lammps_ended"]


def lammps_ended(error: RuntimeError) -> str:
    """What is said where LAMMPS has ended, as when a rank was killed."""
    return say("lammps_ended", error=error)


def check_lammps(settings: Any) -> None:
    """Raise ValueError, with what to install, where the grains are to live in LAMMPS and it is not there."""
    from coupling.lammps import LammpsMissingError, find_lammps

    if settings.ground == "lammps":
        try:
            find_lammps()
        except LammpsMissingError as error:
            raise ValueError(f"ground = 'lammps': {error}") from None


def in_lammps(
    bed: Any, body: Any, settings: Any, progress: Progress, *, begin: float = 0.0, **options: Any
) -> BedGround:
    """The grains of a prepared bed in LAMMPS, at rest there, under a spike or members; `options`: of `BedGround`."""
    from coupling.lammps import LammpsBed, LammpsGround

    moved = LammpsBed(bed, ranks=settings.ranks or 1, begin=begin)
    taken = moved.settle()
    progress.message(
        say("in_lammps", bed=moved, ranks=moved.ranks, taken=taken, change=1e6 * (moved.surface - bed.surface))
    )
    return LammpsGround(moved, body, begin=begin, **options)
