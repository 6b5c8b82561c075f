"""What is said of the noise of one sensor that was looked at rate by rate."""

from __future__ import annotations

from collections.abc import Sequence

from .colour import Colour

__all__ = ["together"]

_ALIKE = 0.05
"""Spread up to which one number stands for all of them."""


def together(colours: Sequence[Colour]) -> str:
    """One sentence on the noise of a channel, of which `colours` are what was found at its rates."""
    if len(colours) == 1:
        return colours[0].sentence
    return (
        f"the noise of {colours[0].channel} is {_range([colour.std for colour in colours])} of what is stated and a "
        f"sample correlates with the next by {_range([colour.persistence for colour in colours])}, at "
        f"{len(colours)} sampling rates: taken into account"
    )


def _range(numbers: Sequence[float]) -> str:
    low, high = min(numbers), max(numbers)
    return f"{0.5 * (low + high):.2f}" if high - low <= _ALIKE else f"{low:.2f} to {high:.2f}"
