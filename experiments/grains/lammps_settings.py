"""Settings of beds whose grains live in LAMMPS, and what LAMMPS does not take of the others."""

from typing import Any

from . import say

__all__ = ["ON_GRAINS", "RANKS", "lammps_fault"]

ON_GRAINS = ("bed", "lammps")
"""Grounds made of grains: in this process, and in LAMMPS."""
RANKS = "Ground lammps: processes under mpiexec [1]; 1 if not given."


def lammps_fault(settings: Any) -> str | None:
    """What LAMMPS does not take of these settings, in words; or ranks without LAMMPS. None where all is well."""
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
