"""What the figures of `hedgebed paper` share: the folder's result and series, colours, an empty figure, a legend."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from vis.tumble.report import read_columns

__all__ = ["WIDTH", "Array", "Case", "Drawn", "PaperRun", "in_order", "legend_above", "new_figure"]

Array = NDArray[np.float64]
Case = Mapping[str, Any]
Drawn = tuple[str, str, Figure]
"""Title, caption and figure."""
WIDTH = 8.6
"""Of every figure [inch]."""
_TORQUES = ("#0072B2", "#E69F00", "#CC79A7", "#56B4E9", "#009E73")
_HARD = ("steel", "brick")


class PaperRun:
    """The result and the series that it names."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.result: dict[str, Any] = json.loads((folder / "result.json").read_text(encoding="utf-8"))
        self.cases: list[dict[str, Any]] = self.result["cases"]
        self.sweep: list[dict[str, Any]] = self.result["sweep"]
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

    def case(self, surface: str, rig: float, torque: float, variant: str = "nominal") -> dict[str, Any]:
        """One case."""
        return self.table[surface, rig, torque, variant]

    def rows(self, case: Case) -> tuple[dict[str, Array], NDArray[np.str_]]:
        """The series of a case, and its states."""
        return read_columns(self.folder / case["series"])

    def handles(self) -> list[Any]:
        """One line a torque."""
        return [Line2D([], [], color=self.colour(torque), lw=2.2, label=self.label(torque)) for torque in self.torques]


def in_order(values: Any) -> list[Any]:
    """Each value once, in the order in which it comes."""
    return list(dict.fromkeys(values))


def new_figure(width: float, height: float) -> Figure:
    """An empty figure [inch]."""
    drawing = Figure(figsize=(width, height))
    FigureCanvasAgg(drawing)
    return drawing


def legend_above(drawing: Figure, handles: Sequence[Any], columns: int = 4) -> None:
    """One legend for the whole figure, in lines above it."""
    drawing.legend(handles=handles, loc="outside upper left", ncols=columns)
