"""What a fit of surface laws is made from: runs of a spike in beds, averaged over depth, and placements at rest.

A run is the first loading of a drive or of a drop. Its rows are averaged over intervals of depth that are the same for
all runs. So a slow run has no more weight than a fast one, and bin k is one depth in every run. A placement is a spike
set down that has come to rest under its load.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray

from coupling import Penetration
from experiments.penetrate.fit import fit_rows

__all__ = ["Array", "Data", "Drag", "Foundation", "Placement", "PushRun", "Unloading", "binned", "reached"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Foundation:
    """What all runs of one fit share; SI units."""

    material: str
    tip: str
    diameter: float  # of the tip [m]
    tip_height: float  # Height over which the tip widens to its full diameter [m]
    cone_angle: float  # of a conical tip [degrees]
    gravity: float  # of the grains [m/s2]
    grain: float  # Mean grain diameter [m]
    bulk_density: float  # of the beds [kg/m3]
    surface_friction: float  # of spike and grains [1]


@dataclass(frozen=True)
class PushRun:
    """The first loading of one run, means over intervals of depth; arrays have shape [bin_count]."""

    id: str
    bed: str  # The same text for runs that began in the same bed
    kind: str  # "driven" or "drop"
    speed: float  # as set [m/s]
    depth: Array  # [m]
    rate: Array  # dz/dt [m/s]
    acceleration: Array  # d2z/dt2 [m/s2]
    force: Array  # [N]


@dataclass(frozen=True)
class Placement:
    """A spike at rest under its load."""

    bed: str
    load: float  # [N]
    depth: float  # [m]


@dataclass(frozen=True)
class Unloading:
    """A tip that was driven to a depth, raised by 0.05 of its diameter, and driven on by as much."""

    bed: str
    depth: float  # [m]
    force: float  # Before it was raised, mean over the last twentieth of the way [N]
    stiffness: float  # Force lost over the way up, until a fifth is left [N/m]
    returned: float  # Work of the way up over that of the way down [1]
    again: float  # Mean force while it is driven on, over `force` [1]


@dataclass(frozen=True)
class Drag:
    """A tip that was driven to a depth and moved sideways by its diameter; forces are means of the second half."""

    bed: str
    depth: float  # [m]
    side: float  # Against the motion [N]
    up: float  # On the tip, while it is moved sideways [N]
    before: float  # The same before, mean over the last twentieth of the way down [N]


@dataclass(frozen=True)
class Data:
    """All runs of one fit, and the placements that it may be checked with."""

    foundation: Foundation
    runs: tuple[PushRun, ...]
    placements: tuple[Placement, ...] = ()
    sources: tuple[str, ...] = ()  # The run folders
    unloadings: tuple[Unloading, ...] = ()
    drags: tuple[Drag, ...] = ()
    notes: tuple[str, ...] = field(default=())  # What a reader must know of the runs, a sentence each

    @property
    def beds(self) -> list[str]:
        """The beds, in the order of their first run."""
        return list(dict.fromkeys(run.bed for run in self.runs))

    @property
    def speeds(self) -> list[float]:
        """The speeds that were set, in rising order [m/s]."""
        return sorted({run.speed for run in self.runs})

    def only(self, keep: Callable[[PushRun], bool]) -> Self:
        """The same with those runs for which `keep` is true."""
        return replace(self, runs=tuple(run for run in self.runs if keep(run)))

    def without_bed(self, bed: str) -> Self:
        """The same without the runs of one bed."""
        return self.only(lambda run: run.bed != bed)

    def rows(self, keep: Callable[[PushRun], NDArray[np.bool_]]) -> Self:
        """The same with those rows of each run for which `keep` is true, and without runs that have none left."""
        kept = []
        for run in self.runs:
            if (rows := keep(run)).any():
                names = ("depth", "rate", "acceleration", "force")
                kept.append(replace(run, **{name: getattr(run, name)[rows] for name in names}))
        return replace(self, runs=tuple(kept))

    def _joined(self, name: str) -> Array:
        return np.concatenate([getattr(run, name) for run in self.runs])

    @cached_property
    def depth(self) -> Array:
        """Of all bins [m], shape [row_count]."""
        return self._joined("depth")

    @cached_property
    def rate(self) -> Array:
        """Of all bins [m/s]."""
        return self._joined("rate")

    @cached_property
    def acceleration(self) -> Array:
        """Of all bins [m/s2]."""
        return self._joined("acceleration")

    @cached_property
    def force(self) -> Array:
        """Of all bins [N]."""
        return self._joined("force")

    @cached_property
    def bed_of_row(self) -> NDArray[np.int64]:
        """Number of the bed of each bin, shape [row_count]."""
        place = {bed: number for number, bed in enumerate(self.beds)}
        return np.concatenate([np.full(len(run.depth), place[run.bed]) for run in self.runs])

    @cached_property
    def run_of_row(self) -> NDArray[np.int64]:
        """Number of the run of each bin, shape [row_count]."""
        return np.concatenate([np.full(len(run.depth), number) for number, run in enumerate(self.runs)])


def reached(run: Penetration) -> float:
    """Largest depth of the first loading of `run` [m]; 0 where it has no row to fit."""
    return float(np.max(run.depth[fit_rows(run)], initial=0.0))


def binned(run: Penetration, *, id: str, bed: str, speed: float, bins: int, deepest: float) -> PushRun | None:
    """The first loading of `run` in the intervals of depth from 0 to `deepest` [m], `bins` of equal size.

    Intervals that the run does not reach are left out. None where it has fewer than two rows to fit.
    """
    rows = fit_rows(run)
    if rows.sum() < 2:
        return None
    depth, rate, force = run.depth[rows], run.velocity[rows], run.force[rows]
    # A drive's last macro step is shorter than the others and so slower: that is no acceleration.
    acceleration = np.gradient(rate, run.time[rows]) if run.kind == "drop" else np.zeros_like(rate)
    place = np.minimum((bins * depth / deepest).astype(int), bins - 1)
    count = np.bincount(place, minlength=bins)

    def mean(values: Array) -> Array:
        return np.asarray(np.bincount(place, weights=values, minlength=bins)[count > 0] / count[count > 0])

    return PushRun(
        id, bed, run.kind, speed, mean(depth), mean(np.maximum(rate, 0.0)), mean(acceleration), mean(force)
    )  # fmt: skip
