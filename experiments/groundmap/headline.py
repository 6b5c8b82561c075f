"""What `hedgebed ground` shows on the terminal: each number with two digits, lengths in millimetres."""

from collections.abc import Mapping
from typing import Any

from experiments.runs.registry import Headline
from vis.page.numbers import foldable, in_two_digits, quantity

__all__ = ["ground_headline"]

_OF_THE_BED = {"speed": "up to a speed of", "packing_fraction": "packing", "grain_ratio": "grain over tip diameter"}


def ground_headline(result: Mapping[str, Any]) -> Headline:
    """The short form of a result."""
    numbers = result["quantities"]
    under = f"sinkage under {quantity(numbers['load'])}"
    rows = [
        (words, in_two_digits(numbers[name]))
        for name, words in (("stiffness", "stiffness K"), ("damping", "damping C"), ("sinkage", under))
    ]
    rows += [(words, quantity(numbers[name])) for name, words in _OF_THE_BED.items() if name in numbers]
    return Headline(
        ("", "value ± std"),
        tuple(tuple(foldable(cell) for cell in row) for row in rows),
        tuple(map(foldable, result.get("warnings", []))), (), 0,
    )  # fmt: skip
