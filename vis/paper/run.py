"""What the figures of `hedgebed paper` share: the folder's result and series, and a colour for each torque."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vis.page.plots import Array, handle
from vis.page.report import Progress, Report, Result
from vis.page.tumble_series import read_columns

__all__ = ["VARIANTS", "PaperRun", "in_order"]

_TORQUES = ("#0072B2", "#E69F00", "#CC79A7", "#56B4E9", "#009E73")
_HARD = ("steel", "brick")
VARIANTS = ("low", "nominal", "high", "paper")
"""Of a case: friction at the lower end of its band, as it is, at the upper end; the paper's fixed step."""


class PaperRun(Report):
    """The report, with the result's cases by what they are of."""

    def __init__(self, folder: str | Path, progress: Progress | None = None) -> None:
        super().__init__(folder, progress, dpi=150)
        self.cases: list[Result] = self.result["cases"]
        self.sweep: list[Result] = self.result["sweep"]
        self.table = {(c["surface"], c["rig"], c["torque"], c["variant"]): c for c in self.cases}
        self.rigs = in_order(c["rig"] for c in self.cases)
        self.torques = sorted({c["torque"] for c in self.cases})
        self.surfaces = in_order(c["surface"] for c in self.cases)
        self.hard = [name for name in _HARD if name in self.surfaces]

    def colour(self, torque: float) -> str:
        """Of a torque."""
        return _TORQUES[self.torques.index(torque) % len(_TORQUES)]

    def label(self, torque: float) -> str:
        """Of a torque."""
        brake = any(c["actuator"] == "brake" for c in self.cases if c["torque"] == torque)
        return f"{torque:g} N m ({'brake' if brake else 'motor'})"

    def case(self, surface: str, rig: float, torque: float, variant: str = "nominal") -> Result:
        """One case."""
        return self.table[surface, rig, torque, variant]

    def variants(self, surface: str, rig: float, torque: float, key: str) -> list[Any]:
        """A number of a case in each of the `VARIANTS`."""
        return [self.table[surface, rig, torque, variant][key] for variant in VARIANTS]

    def rows(self, case: Result) -> tuple[dict[str, Array], NDArray[np.str_]]:
        """The series of a case, and its states."""
        return read_columns(self.folder / case["series"])

    def handles(self) -> list[Any]:
        """One line a torque."""
        return [handle(self.label(torque), self.colour(torque), lw=2.2) for torque in self.torques]


def in_order(values: Any) -> list[Any]:
    """Each value once, in the order in which it comes."""
    return list(dict.fromkeys(values))
