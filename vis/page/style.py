"""How every figure looks: fonts, lines, and the colours that are safe for the colour-blind (Okabe and Ito)."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import matplotlib as mpl
from matplotlib.axes import Axes

__all__ = ["BED", "DPI", "GREY", "INK", "MODEL", "STATES", "as_it_lies", "styled"]

BED = "#0072B2"  # what the grains do
MODEL = "#D55E00"  # what the spring-damper does; always dashed as well, for print in grey
INK = "#222222"
GREY = "#8a8a8a"
STATES = {"stand": "#a4a4a4", "pivot": BED, "slip": MODEL, "hop": "#882255"}
"""The states in the order of losing hold, with their colours: apart for the colour-blind too (tests/vis/test_style.py),
to whom Okabe and Ito's green is the grey of standing or the blue of pivoting; Tol's wine is neither."""
DPI = 160
_TOO_LONG = 8.0  # times as long as high: drawn in its true shape such a way is a line

_STYLE: dict[Any, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 9.5,
    "axes.titlesize": 10.0,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.labelsize": 9.5,
    "axes.labelcolor": INK,
    "axes.edgecolor": "#666666",
    "axes.linewidth": 0.8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#e4e4e4",
    "grid.linewidth": 0.7,
    "xtick.color": "#444444",
    "ytick.color": "#444444",
    "xtick.labelsize": 8.5,
    "ytick.labelsize": 8.5,
    "lines.linewidth": 1.8,
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "text.color": INK,
    "figure.facecolor": "white",
    "savefig.facecolor": "white",
    "savefig.dpi": DPI,
    "figure.constrained_layout.use": True,
    "image.cmap": "cividis",
}


@contextmanager
def styled() -> Iterator[None]:
    """The style, for as long as the block lasts; the user's own matplotlib settings stay as they are."""
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(_STYLE)
        yield


def as_it_lies(axis: Axes) -> bool:
    """One scale along and up for the ways drawn in `axis`; where no height would be left of them, it says so.

    Whether they are drawn in proportion.
    """
    ways = axis.dataLim
    if ways.width <= _TOO_LONG * ways.height:
        axis.set_aspect("equal", adjustable="datalim")
        return True
    axis.set_title("heights stretched", fontsize=8.5, fontweight="normal", color=GREY)
    return False
