"""The report of `hedgebed ground`: the numbers of one spike, where they come from, what they leave out."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rigid.intervals import NORMAL
from vis.page.answer import MOST_ROWS
from vis.page.numbers import between, in_two_digits, quantity
from vis.page.page import Section, Tile, text
from vis.page.report import Report, Result, report_of

__all__ = ["answer_tiles", "write_ground_report"]

_OF_THE_BED = {
    "speed": "Up to a speed of", "packing_fraction": "Packing fraction", "grain_ratio": "Grain over tip diameter",
}  # fmt: skip

_WITHOUT = ("sinkage_without_cohesion", "sinkage_without_cohesion_most")


@report_of(named=True)
def write_ground_report(report: Report) -> Path:
    """Make report.html of the folder of `hedgebed ground`, and return it."""
    source = report.result["map"]["source"]
    sections = [
        Section("", [text(f"Looked up, not computed, in a map of {source}. ground.toml beside this page is the law.")]),
        report.numbers(std=True),
        report.again("hedgebed ground run.toml", "numbers"),
    ]
    return report.write(sections, lead=["ground"], tiles=answer_tiles(report.result))


def answer_tiles(result: Result) -> list[Tile]:
    """Rows of the answer: K, C and sinkage, each with half of its 95 % interval, and the bed that they are of."""
    numbers = result["quantities"]
    ends = [numbers[key]["value"] for key in _WITHOUT if key in numbers]
    under = f"Sinkage under {quantity(numbers['load'])}" + (", if cohesion holds" if ends else "")
    rows = [
        Tile(name, in_two_digits(_in_95(numbers[key])))
        for name, key in (("Stiffness K", "stiffness"), ("Damping C", "damping"), (under, "sinkage"))
    ]
    of_bed = [Tile(words, quantity(numbers[key])) for key, words in _OF_THE_BED.items() if key in numbers]
    if not ends:
        return [*rows, *of_bed]
    return [*rows, Tile("The same if it does not hold", between(min(ends), max(ends), "m")), *of_bed][:MOST_ROWS]


def _in_95(entry: Mapping[str, Any]) -> Mapping[str, Any]:
    """A quantity with half of the 95 % interval of a normal distribution in place of its standard deviation."""
    return entry if entry["std"] is None else {**entry, "std": NORMAL * entry["std"]}
