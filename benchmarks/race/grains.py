"""The grains that the race is run on, in a form that every contestant reads, and what is measured on them.

All of it follows from centres and radii alone, so that one measure holds for every code.
"""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from dem import Bed, Material
from experiments.validate.base.peers import box_of, data_file, spheres

__all__ = [
    "BENCH", "DIAMETER", "SPREAD", "Grains", "coordination", "packing", "prepare_grains", "wrapped", "write_data",
]  # fmt: skip

# The spring of friction as the peers have it in the race.
BENCH = Material(
    "bench", density=2600.0, young=5e7, poisson=0.3, friction=0.5, restitution=0.5, tangential="displacement"
)
"""What the peers' decks have as well."""
DIAMETER, SPREAD = 0.004, 0.1  # [m], [1]
SEED = 1
# A large bed is so deep, in diameters; a small one is two thirds as deep as wide.
_DEPTH, _ASPECT = 20.0, 2 / 3
# The bed that is rained in holds about this share more than is kept, and so much more at each further try.
_SURPLUS, _FURTHER = 0.03, 0.05
_PACKING = 0.58  # expected, to begin with
_TRIES = 4


@dataclass(frozen=True)
class Grains:
    """Grains at rest on a floor at z = 0, periodic in x and y."""

    positions: np.ndarray  # centres [m], x and y within the periods, shape [grain_count, 3]
    radii: np.ndarray  # [m], shape [grain_count]
    period: tuple[float, float]  # (x, y) [m]

    @property
    def count(self) -> int:
        """Number of grains."""
        return len(self.radii)

    @property
    def solid_volume(self) -> float:
        """Volume of all grains [m3]."""
        return 4 / 3 * math.pi * float((self.radii**3).sum())


def prepare_grains(count: int, *, threads: int | None = None, arch: str = "cpu", progress: Any = None) -> Grains:
    """Exactly ``count`` grains of a bed that ``Bed.prepare`` made or had in its cache: the lowest of slightly more.

    Raises ValueError for fewer than 250 grains, RuntimeError where the bed that was rained in had too few.
    """
    if count < 250:
        raise ValueError(f"a bed of {count} grains is too small to race on; take at least 250")
    # Volume per grain in the bed, in cubic diameters.
    share = math.pi / 6 * (1 + SPREAD**2) / _PACKING
    width = max((count * share / _ASPECT) ** (1 / 3), math.sqrt(count * share / _DEPTH))
    depth = count * share / width**2
    for attempt in range(_TRIES):
        height = depth * (1 + _SURPLUS + _FURTHER * attempt)
        size = tuple(round(DIAMETER * length, 6) for length in (width, width, height))
        bed = Bed.prepare(
            BENCH, size=size, grain=DIAMETER, spread=SPREAD, young=BENCH.young, seed=SEED, threads=threads,
            arch=arch,
            progress=progress,
        )  # fmt: skip
        if bed.grain_count >= count:
            break
    else:
        raise RuntimeError(f"the bed that was rained in has {bed.grain_count} grains, {count} were wanted")
    grains = bed.grains()
    period = bed.size[:2]
    lowest = np.argsort(grains.position[:, 2], kind="stable")[:count]
    places, radii = wrapped(grains.position[lowest], period), grains.radius[lowest]
    # In slices and rows two diameters wide, so that neighbours in space are near in memory for any code.
    z, y = (np.floor(places[:, k] / (2 * DIAMETER)) for k in (2, 1))
    order = np.lexsort((places[:, 0], y, z))
    return Grains(places[order], radii[order], period)


def wrapped(positions: np.ndarray, period: tuple[float, float]) -> np.ndarray:
    """Positions [m] brought into 0 <= x, y < period, shape [grain_count, 3]."""
    inside = positions.copy()
    inside[:, :2] %= period
    # The remainder of a number just below zero rounds to the period itself.
    inside[:, :2][inside[:, :2] >= period] = 0.0
    return inside


def write_data(path: Path, grains: Grains, *, above: float = 2 * DIAMETER) -> None:
    """Write the data file that LIGGGHTS (atom style granular) and LAMMPS (sphere) read.

    A row is id, type, diameter [m], density [kg/m3], x, y, z [m]. ``above``: room above the highest grain [m].
    """
    top = float((grains.positions[:, 2] + grains.radii).max()) + above
    box = box_of(*grains.period, top, figures=12)
    text = data_file(box, spheres(grains.radii, grains.positions, BENCH.density, figures=12))
    path.write_text(text, encoding="ascii")


def coordination(grains: Grains) -> float:
    """Mean number of grains that a grain touches [1]; the floor does not count.

    Counted from centres and radii, not from anyone's lists: a contact that a list has missed is found here.
    """
    tree = cKDTree(grains.positions, boxsize=(*grains.period, 0.0))
    pairs = tree.query_pairs(2 * float(grains.radii.max()), output_type="ndarray")
    apart = grains.positions[pairs[:, 0]] - grains.positions[pairs[:, 1]]
    apart[:, :2] -= grains.period * np.round(apart[:, :2] / grains.period)
    touching = np.linalg.norm(apart, axis=1) < grains.radii[pairs].sum(axis=1)
    return 2 * float(touching.sum()) / grains.count


def packing(volume: float, period: tuple[float, float], mean_height: float) -> float:
    """A packing fraction that needs no surface: solid over twice the space below the mean height of the centres [1].

    ``volume``: of solid [m3]. ``period``: (x, y) [m]. ``mean_height``: of the centres [m].
    """
    return volume / (period[0] * period[1] * 2 * mean_height)
