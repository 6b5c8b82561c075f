"""Numbers and data files in the form that LAMMPS (atom style sphere) and LIGGGHTS read."""

from collections.abc import Iterable, Sequence

import numpy as np

__all__ = ["box_of", "data_file", "digits", "spheres"]


def digits(values: Iterable[float], figures: int = 17) -> str:
    """Numbers, all their digits or so many."""
    return " ".join(f"{value:.{figures}g}" for value in values)


def box_of(*sides: float, low: Sequence[float] = (0.0, 0.0, 0.0), figures: int = 17) -> list[str]:
    """The lines of a box with these sides [m] from its corner ``low`` [m] on."""
    ends = zip(low, sides, "xyz", strict=True)
    return [f"{digits((begin, begin + side), figures)} {axis}lo {axis}hi" for begin, side, axis in ends]


def spheres(
    radii: np.ndarray, places: np.ndarray, density: float, figures: int = 17, *, types: np.ndarray | None = None
) -> list[str]:
    """Type (1 if not given), diameter [m], density [kg/m3] and position [m] of each sphere."""
    rows = zip(np.ones(len(radii), dtype=int) if types is None else types, radii, places, strict=True)
    return [f"{kind} {digits((2 * radius, density, *place), figures)}" for kind, radius, place in rows]


def data_file(
    box: Sequence[str], atoms: Sequence[str], velocities: Sequence[str] = (), *, types: int = 1,
    order: Iterable[int] | None = None,
) -> str:  # fmt: skip
    """A data file: the box, a row of ``spheres`` for each grain, then velocity [m/s] and spin [rad/s].

    ``order``: of the rows of grains, whose ids are those of ``atoms``.
    """
    lines = ["grains of hedgebed\n", f"{len(atoms)} atoms", f"{types} atom types\n", *box, "\nAtoms\n"]
    lines += [f"{k + 1} {atoms[k]}" for k in (range(len(atoms)) if order is None else order)]
    lines += ["\nVelocities\n", *(f"{k} {row}" for k, row in enumerate(velocities, 1))] if velocities else []
    return "\n".join(lines) + "\n"
