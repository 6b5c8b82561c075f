"""Lines that stay apart: eight colours that are safe for the colour-blind, then the same dashed."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from typing import Any

from matplotlib.lines import Line2D

__all__ = ["RED", "line_handles", "line_styles"]

RED = "#c0392b"
"""What was found to be wrong, in every figure."""
_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#222222", "#E69F00", "#56B4E9", "#8a6d3b")
_DASHES: tuple[Any, ...] = ("-", (0, (4, 1.6)), (0, (1, 1.4)))


def line_styles(keys: Sequence[Hashable]) -> dict[Hashable, dict[str, Any]]:
    """Colour and dash of a line for each different key, in their order: replicates that share a key share a line.

    Beyond 24 keys they begin again.
    """
    count = len(_COLOURS)
    return {
        key: {"color": _COLOURS[place % count], "ls": _DASHES[place // count % len(_DASHES)]}
        for place, key in enumerate(dict.fromkeys(keys))
    }


def line_handles(labels: Sequence[str], keys: Sequence[Hashable]) -> list[Line2D]:
    """For the legend: a line for each different key, followed by the labels that share it."""
    styles = line_styles(keys)
    named = {key: [label for label, own in zip(labels, keys, strict=True) if own == key] for key in styles}
    return [Line2D([], [], lw=1.6, label=f"{key}: {_listed(named[key])}", **style) for key, style in styles.items()]


def _listed(labels: Sequence[str]) -> str:
    return ", ".join(labels) if len(labels) <= 4 else f"{labels[0]} to {labels[-1]} ({len(labels)})"
