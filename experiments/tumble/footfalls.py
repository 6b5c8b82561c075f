"""Footfalls: rows of spikes that touch one after the other, their depths, and whether these increase."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from experiments.grains.spells import spells
from experiments.runs.result import quantity
from experiments.runs.types import Json
from rigid.intervals import student

from . import say

__all__ = ["Footfall", "Sinking", "find_footfalls", "footfall_quantities", "footfall_table", "sinking_over"]

GRAZE = 1e-3  # A row that goes less deep [m] has not come down


@dataclass(frozen=True)
class Footfall:
    """One row of spikes, from its touch until it leaves the ground."""

    row: int
    time: float  # When it touches [s]
    deepest: float  # [m]
    load: float  # Largest upward force on it, mean of one macro step [N]
    set_down: bool  # It was there when the record began, placed
    open: bool  # It was still going down when the record ended

    @property
    def counts(self) -> bool:
        """Whether the row was not placed and has reached its largest depth."""
        return not self.set_down and not self.open


@dataclass(frozen=True)
class Sinking:
    """Increase of the depth from one footfall to the next."""

    slope: float  # [m a footfall]
    error: float  # Its standard error; its 95 % interval is from
    low: float  # to
    high: float
    depth: float  # Mean [m]
    count: int  # Footfalls
    beds: int

    @property
    def verdict(self) -> str:
        """The conclusion, as a sentence."""
        slope, low, high, depth = (1e3 * x for x in (self.slope, self.low, self.high, self.depth))
        rate = say("sinking_rate", slope=slope, low=low, high=high)
        of = say("sinking_of", count=self.count, beds=self.beds, s="s" if self.beds > 1 else "", depth=depth)
        return say(
            "sinking" if self.low > 0 else "less_deep" if self.high < 0 else "not_sinking", rate=rate, of=of
        )  # fmt: skip


def find_footfalls(
    time: NDArray[np.float64], sinkage: NDArray[np.float64], load: NDArray[np.float64]
) -> list[Footfall]:
    """The rows that came down, in the order in which they touched.

    time (n,) [s]; sinkage (n, rows) [m], 0 or less where a row is above the surface; load (n, rows) [N].
    """
    found = []
    for row in range(sinkage.shape[1]):
        for begin, end in spells(sinkage[:, row] > 0):
            depth = sinkage[begin:end, row]
            if depth.max() < GRAZE:
                continue
            still = bool(end == len(time) and depth.argmax() == len(depth) - 1)
            most = float(load[begin:end, row].max())
            found.append(Footfall(row, float(time[begin]), float(depth.max()), most, begin == 0, still))
    return sorted(found, key=lambda fall: (fall.time, fall.row))


def sinking_over(beds: Sequence[Sequence[Footfall]]) -> Sinking | None:
    """Least squares over all beds: one slope, and a mean depth for each bed. None for too few footfalls.

    Rows that were placed, and rows that still sink at the end, are left out. The interval is Student's; the slope and
    every bed take one degree of freedom.
    """
    counted = [[(k, fall.deepest) for k, fall in enumerate(falls) if fall.counts] for falls in beds]
    tables = [np.array(own).T for own in counted if len(own) >= 2]
    free = sum(table.shape[1] for table in tables) - len(tables) - 1
    if free < 1:
        return None
    x = np.concatenate([number - number.mean() for number, _ in tables])
    y = np.concatenate([depth - depth.mean() for _, depth in tables])
    mean = float(np.concatenate([depth for _, depth in tables]).mean())
    slope = float(x @ y / (x @ x))
    left = y - slope * x
    error = float(np.sqrt(left @ left / free / (x @ x)))
    half = student(free) * error
    return Sinking(slope, error, slope - half, slope + half, mean, len(x), len(tables))


def footfall_table(falls: Sequence[Footfall]) -> Json:
    """The footfalls as a table of a result."""
    rows = [
        [
            str(number), str(fall.row), f"{fall.time:.3f}", f"{1e3 * fall.deepest:.2f}", f"{fall.load:.2f}",
            "during the placement" if fall.set_down else "still going down at the end" if fall.open else "",
        ]
        for number, fall in enumerate(falls)
    ]  # fmt: skip
    head = ["footfall", "row", "time [s]", "deepest [mm]", "largest load [N]", ""]
    return {"title": "Rows that came down", "head": head, "rows": rows}


def footfall_quantities(falls: Sequence[Footfall]) -> dict[str, Json]:
    """`sinkage_per_footfall` of one bed, for a result; its value is None where too few rows came down."""
    own = sinking_over([falls])
    value, std = (own.slope, own.error) if own else (None, None)
    return {"sinkage_per_footfall": quantity(value, "m", say("of_footfall"), std=std)}
