"""The report of `hedgebed ground`: the numbers of one spike, where they come from, what they leave out."""

from __future__ import annotations

from pathlib import Path

from vis.page.numbers import in_two_digits
from vis.page.page import Section, Tile, text
from vis.page.report import Report, report_of

__all__ = ["write_ground_report"]


@report_of(named=True)
def write_ground_report(report: Report) -> Path:
    """Make report.html of the folder of `hedgebed ground`, and return it."""
    numbers, source = report.result["quantities"], report.result["map"]["source"]
    tiles = [
        Tile(name, in_two_digits(numbers[key]), "one standard deviation")
        for name, key in (("K", "stiffness"), ("C", "damping"), ("Sinkage", "sinkage"))
    ]
    sections = [
        Section("", [text(f"Looked up, not computed, in a map of {source}. ground.toml beside this page is the law.")]),
        report.numbers(std=True),
        report.again("hedgebed ground run.toml", "numbers"),
    ]
    return report.write(sections, lead=["ground"], tiles=tiles)
