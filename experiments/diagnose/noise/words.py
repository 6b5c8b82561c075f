"""What is said of the noise of one sensor that was looked at rate by rate."""

from __future__ import annotations

from collections.abc import Sequence

from .colour import Colour

__all__ = ["together"]

_ALIKE = 0.05
"""Spread up to which one number stands for all of them."""


def together(colours: Sequence[Colour]) -> str:
    """One sentence on the noise of a channel, of which `colours` are what was found at its rates."""
    stds, persistences = [colour.std for colour in colours], [colour.persistence for colour in colours]
    as_stated = max(abs(std - 1.0) for std in stds) < _ALIKE
    size = "as large as is stated" if as_stated else f"{_range(stds)} times what is stated"
    white = max(abs(persistence) for persistence in persistences) < _ALIKE
    colour = "" if white else f" and a sample correlates with the next by {_range(persistences)}"
    rates = f", at {len(colours)} sampling rates" if len(colours) > 1 else ""
    return f"the noise of {colours[0].channel} is {size}{colour}{rates}: taken into account"


def _range(numbers: Sequence[float]) -> str:
    low, high = min(numbers), max(numbers)
    return f"{0.5 * (low + high):.2f}" if high - low <= _ALIKE else f"{low:.2f} to {high:.2f}"
