"""The doubt that a number of a named effect is of the testing machine and not of the ground."""

from collections.abc import Mapping
from typing import Any

from vis.page.numbers import foldable, quote

from .sentences import say
from .to_use import number_words

__all__ = ["machine_sentences"]


def machine_sentences(diagnosis: Mapping[str, Any]) -> list[str]:
    """That the stiffness of unloading, or the depth of a layer, is the same in all beds although K is not.

    With what that means for K, and the experiment that shows it. None where the pushes do not show it.
    """
    return [_words(row) for row in diagnosis.get("same_in_all_beds", [])]


def _words(row: Mapping[str, Any]) -> str:
    ends = {key: foldable(quote(row[key], None, row["unit"], significant=4)) for key in ("lowest", "highest")}
    percent = {"most": 100 * row["scatter_at_most"], "scatter": 100 * row["k_scatter"]}
    bound = row["k_at_most"]
    series = "" if bound is None else f" {say('machine_series', bound=number_words(bound))}"
    return say(f"machine_{row['what']}", pushes=row["pushes"], series=series, **ends, **percent)
