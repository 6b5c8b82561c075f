"""Arrows of forces in a picture: one that is too long for it ends at its edge, with the number beside it."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from vis.page.numbers import quote
from vis.page.plots import INK

__all__ = ["FORCE", "HALO", "draw_force", "draw_measure"]

HALO = {"facecolor": "white", "alpha": 0.7, "edgecolor": "none", "pad": 1.5}
"""Box of a word on a picture."""
FORCE = {
    "arrowstyle": "-|>,head_width=0.28,head_length=0.55", "color": "#B00020", "lw": 2.2, "shrinkA": 0, "shrinkB": 0,
}  # fmt: skip
"""How an arrow of a force is drawn."""
_SHORTEST = 0.005
"""A shorter arrow is not drawn, in fractions of the picture."""
_RIM = 0.01
"""Left free at the picture's edge by an arrow that is cut, in fractions of it."""


def draw_force(axis: Any, foot: NDArray[np.float64], head: NDArray[np.float64], force: float) -> None:
    """An arrow from `foot` to `head`, places of shape (2,) in an `axis` from 0 to 1; `force` is its amount [N].

    What would lie outside is cut off, and the number says so. Where nothing of it lies inside, nothing is drawn.
    """
    if np.linalg.norm(head - foot) <= _SHORTEST:
        return
    low, high = _inside(foot, head)
    if low >= high:
        return
    start, end = foot + low * (head - foot), foot + high * (head - foot)
    axis.annotate("", end, start, arrowprops=FORCE)
    if high < 1.0:
        _say(axis, end, f"{quote(force, unit='N')}, arrow cut")


def draw_measure(sheet: Figure, *, right: float, height: float, length: float, weight: float) -> None:
    """The weight [N] as an arrow of `length` [inch] above the pictures, where it hides and meets nothing.

    right, height: where it ends on the sheet, in fractions of that.
    """
    wide = length / float(sheet.get_size_inches()[0])
    axis = sheet.add_axes((right - wide, height - 0.01, wide, 0.02))
    axis.set_axis_off()
    axis.set(xlim=(0.0, 1.0), ylim=(0.0, 1.0))
    axis.annotate("", (1.0, 0.5), (0.0, 0.5), arrowprops=FORCE)
    words = f"weight, {quote(weight, unit='N')}"
    sheet.text(right - wide - 0.008, height, words, fontsize=10, ha="right", va="center", color=INK)


def _inside(foot: NDArray[np.float64], head: NDArray[np.float64]) -> tuple[float, float]:
    """From which share of the way to which it lies inside the rim (Liang and Barsky); from >= to: nowhere."""
    low, high = 0.0, 1.0
    for at, along in zip(foot, head - foot, strict=True):
        if along == 0.0:
            if not _RIM <= at <= 1.0 - _RIM:
                return 1.0, 0.0
            continue
        first, last = sorted(((_RIM - at) / along, (1.0 - _RIM - at) / along))
        low, high = max(low, first), min(high, last)
    return low, high


def _say(axis: Any, end: NDArray[np.float64], words: str) -> None:
    """Words beside the end of an arrow and over its shaft, towards the middle."""
    x, y = float(end[0]), float(np.clip(end[1] + 0.05, 0.06, 0.96))
    aside, side = (0.03, "left") if x < 0.6 else (-0.03, "right")
    axis.text(x + aside, y, words, fontsize=10, ha=side, va="center", color=INK, bbox=HALO)
