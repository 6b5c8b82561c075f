"""`--ground lammps --ranks N`: the prepared bed is handed over to LAMMPS."""

import time
from typing import TYPE_CHECKING, Any

from coupling.ground import part_of

from . import say

if TYPE_CHECKING:
    from coupling import BedGround
    from dem import Material
    from experiments.runs.progress import Progress
    from rigid.ground.reaction import State

__all__ = ["ON_GRAINS", "RANKS", "check_lammps", "cone_note", "in_lammps", "lammps_fault", "moved_to_lammps"]

ON_GRAINS = ("bed", "lammps")
"""Grounds made of grains: in this process, and in LAMMPS."""
_SILENT = 10.0  # Seconds of your clock between two lines while the grains come to rest
RANKS = "Ground lammps: processes under mpiexec [1]; 1 if not given."


def lammps_fault(settings: Any) -> str | None:
    """Message on a setting that is not possible in LAMMPS, or on ranks without LAMMPS; None without a fault."""
    given = settings.model_dump()
    if settings.ground != "lammps":
        return None if settings.ranks is None else say("ranks_without_lammps", s=settings)
    wanted = {"iterations": 1, "sleep": False, "arch": "cpu", "settle_gravity": None, "precision": "float64"}
    for key, value in wanted.items():
        if given.get(key, value) != value:
            return say("not_in_lammps", key=key, value=given[key], use=value, why=say(f"lammps_{key}"))
    shaft = given.get("shaft_diameter")
    if shaft is not None and shaft != given["tip_diameter"]:
        return say("shaft_in_lammps", s=settings)
    return None


def cone_note(settings: Any) -> str | None:
    """By how much the pyramid that stands for a conical tip in LAMMPS differs from it; None for another run."""
    from coupling.lammps.polyhedra import NEARER, WIDER

    if settings.ground != "lammps" or settings.tip != "cone":
        return None
    radius = 0.5e3 * settings.tip_diameter
    return say("cone_in_lammps", nearer=radius * (1 - NEARER), wider=radius * (WIDER - 1))


def check_lammps(settings: Any, material: "Material") -> None:
    """Raise ValueError if grains are to be in LAMMPS and it does not start on `ranks`, or these are too many.

    Also where it refuses the cohesion of ``material``.
    """
    from coupling.lammps import LammpsMissingError, check_ranks, cohesion_fault

    if settings.ground != "lammps":
        return
    try:
        check_ranks(settings.ranks or 1)
        refusal = cohesion_fault(material.cohesion)
    except LammpsMissingError as error:
        raise ValueError(f"ground = 'lammps': {error}") from None
    if refusal is not None:
        raise ValueError(f"material {material.name!r}: {refusal}; or use ground = 'bed'")


def moved_to_lammps(
    bed: Any, settings: Any, progress: "Progress", *, begin: float = 0.0, free: bool = False,
    kept: "State | None" = None,
) -> Any:  # fmt: skip
    """The grains of a prepared bed as a `coupling.lammps.LammpsBed`, at rest there.

    ``free``: for bodies that turn out of the plane of x and z. ``kept``: the checkpoint of a run that is restored next.
    It has the grains, which need not come to rest first.
    """
    from coupling.lammps import FreeLammpsBed, LammpsBed

    moved = (FreeLammpsBed if free else LammpsBed)(bed, ranks=settings.ranks or 1, begin=begin)
    if kept is not None:
        moved.take_surface(part_of(part_of(kept, "ground"), "bed"))
        return moved
    said = time.monotonic()

    def tell(taken: float, energy: float) -> None:
        nonlocal said
        if energy > 1 and time.monotonic() - said > _SILENT:
            said = time.monotonic()
            progress.message(say("coming_to_rest", taken=taken, energy=energy))

    springs = _springs_note(moved, moved.settle(tell))
    progress.message(
        say("in_lammps", bed=moved, ranks=moved.ranks, springs=springs, change=1e6 * (moved.surface - bed.surface))
    )
    return moved


def _springs_note(moved: Any, taken: float) -> str:
    """What became of the springs of contacts; ``taken``: the time in which the grains came to rest [s]."""
    if moved.springs:
        return say("springs_kept", bed=moved, taken=taken)
    why = say("springs_fault", fault=moved.springs_fault) if moved.springs_fault else ""
    return say("springs_at_zero", taken=taken, why=why)


def in_lammps(
    bed: Any, body: Any, settings: Any, progress: "Progress", *, begin: float = 0.0, free: bool = False,
    kept: "State | None" = None, **options: Any,
) -> "BedGround":  # fmt: skip
    """A spike or members on the grains of a prepared bed in LAMMPS; `free`, `kept`: as of `moved_to_lammps`;
    `options`: of `BedGround`."""
    from coupling.lammps import LammpsGround

    moved = moved_to_lammps(bed, settings, progress, begin=begin, free=free, kept=kept)
    return LammpsGround(moved, body, begin=begin, **options)
