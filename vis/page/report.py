"""The report of a run folder: what it reads, the figures that it draws, and the parts that every page has."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from vis.page.page import Block, Page, Section, Tile, code, figure, table, text, write_page
from vis.page.plots import Array, Plot
from vis.page.tumble_series import read_columns

__all__ = ["Progress", "Report", "Result", "again", "capital", "given", "number_text", "tables", "unit_text"]

Progress = Callable[[float], None]
"""Called with the share that is done, 0 to 1."""
Result = Mapping[str, Any]
"""What result.json holds, or an object within it (docs/architecture.md)."""


class Report:
    """The report of one run folder; its `figures/` is made with it.

    Args:
        folder: The run folder.
        progress: Called with the share that is done, 0 to 1.
        dpi: Of its figures; the style's own if not given.

    Raises FileNotFoundError where the folder has no result.json, and where a series is missing that is drawn.
    """

    def __init__(self, folder: str | Path, progress: Progress | None = None, *, dpi: int | None = None) -> None:
        self.folder, self.dpi = Path(folder), dpi
        self.tell: Progress = progress if progress is not None else lambda done: None
        self.result: Result = json.loads((self.folder / "result.json").read_text(encoding="utf-8"))
        self.figures = self.folder / "figures"
        self.figures.mkdir(exist_ok=True)

    def columns(self, name: str) -> dict[str, Array]:
        """The columns of a CSV file of the folder that are numbers."""
        return read_columns(self.folder / name)[0]

    def draw(self, plot: Plot) -> Block:
        """Write a plot to `figures/`; what shows it in the report."""
        return figure(plot.save(self.figures, self.dpi), title=plot.title, caption=plot.caption)

    def draw_all(self, plots: Iterable[Plot]) -> list[Block]:
        """The same of several."""
        return [self.draw(plot) for plot in plots]

    def numbers(self, *, std: bool = False) -> Section:
        """Every number of the result with its note, and its spread if `std`."""
        entries = self.result["quantities"].items()
        if std:
            head: tuple[str, ...] = ("quantity", "value", "std", "unit", "note")
            rows: list[tuple[str, ...]] = [
                (name, number_text(q["value"], 5), number_text(q["std"], 2), unit_text(q["unit"]), q["note"])
                for name, q in entries
            ]
        else:
            head = ("quantity", "value", "unit", "note")
            rows = [
                (name, number_text(q["value"], none="null"), unit_text(q["unit"]), q.get("note", ""))
                for name, q in entries
            ]
        return Section("Every number of the result", [table(head, rows, words=True)])

    def write(
        self,
        sections: Sequence[Section],
        *,
        lead: Sequence[str],
        tiles: Sequence[Tile] = (),
        title: str | None = None,
        warnings: Sequence[str] | None = None,
        missing: Sequence[str] = (),
    ) -> Path:
        """Write report.html and return it; title and warnings are the result's where they are not given."""
        result = self.result
        warned = [capital(str(warning)) for warning in result["warnings"]] if warnings is None else warnings
        top = [f"hedgebed {result['version']}", *lead]
        page = Page(str(result["title"]) if title is None else title, top, sections, tiles, warned, missing)
        report = write_page(self.folder / "report.html", page)
        self.tell(1.0)
        return report


def again(command: str, before: str = "In this folder:", after: str = "") -> Section:
    """How to do the run again; an empty `before` or `after` is left out."""
    blocks = [text(before)] if before else []
    return Section("To do this again", [*blocks, code(command), *([text(after, small=True)] if after else [])])


def given(entries: Mapping[str, Result]) -> Block:
    """The numbers of a trial and where each is from."""
    rows = [(name, number_text(e["value"]), unit_text(e["unit"]), e["origin"]) for name, e in entries.items()]
    return table(("number", "value", "unit", "where from"), rows, words=True)


def tables(result: Result) -> list[Block]:
    """The tables that a result has made."""
    return [table(t["head"], t["rows"], title=t["title"], words=t.get("words", False)) for t in result["tables"]]


def number_text(value: float | None, digits: int = 6, *, none: str = "\N{EN DASH}") -> str:
    """A number of a table with so many digits."""
    return none if value is None else f"{value:.{digits}g}"


def unit_text(unit: str) -> str:
    """A unit, as a table has it."""
    return "" if unit == "1" else unit


def capital(words: str) -> str:
    """With a capital at the start."""
    return words[:1].upper() + words[1:]
