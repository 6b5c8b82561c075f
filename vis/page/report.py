"""What a report is made with: it reads the run folder, draws figures and writes the page; parts that all pages have."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from rigid.result import read_result
from vis.page.answer import write_page
from vis.page.folder import read_columns
from vis.page.limits import limits_words
from vis.page.numbers import typeset, with_squares
from vis.page.page import Block, Page, Section, Tile, code, figure, table, text
from vis.page.plots import Array, styled, title_above
from vis.page.sentences import Sentences

__all__ = [
    "Progress", "Report", "Result", "again", "capital", "given", "number_text", "report_of", "tables", "terms_text",
    "title_of", "unit_text",
]  # fmt: skip

Progress = Callable[[float], None]
"""Called with the share that is done, 0 to 1."""
Result = Mapping[str, Any]
"""What result.json holds, or an object within it (docs/architecture.md)."""


class Report:
    """The report of one run folder; its `figures/` is made with it.

    ``folder``: The run folder. ``progress``: Called with the share that is done, 0 to 1. ``package``: Whose
    figures.toml has the titles and captions. ``dpi``: Of its figures; the style's own if not given. ``named``: Whether
    the title of each figure is that of the result, which names the surface. ``about``: That title; a report may set
    another. Raises FileNotFoundError where the folder has no result.json, and where a series is missing that is drawn.
    """

    def __init__(
        self, folder: str | Path, progress: Progress | None = None, *, package: str = "", dpi: int | None = None,
        named: bool = False,
    ) -> None:  # fmt: skip
        self.folder, self.dpi, self.captions = Path(folder), dpi, Sentences(package, "figures.toml")
        self.done, self.progress = 0.0, progress
        self.result: Result = read_result(self.folder / "result.json")
        self.about = title_of(self.result) if named else ""
        self.figures = self.folder / "figures"
        self.figures.mkdir(exist_ok=True)

    def columns(self, name: str) -> dict[str, Array]:
        """The columns of a CSV file of the folder that are numbers."""
        return read_columns(self.folder / name)[0]

    def draw(self, key: str, drawing: Figure, *, name: str = "", about: str = "", **values: Any) -> Block:
        """Write a figure to figures/`name`.png, or figures/`key`.png, and return what shows it in the report.

        Title and caption are those of `key` in figures.toml, their placeholders filled with `values`. `about` is the
        title on the picture itself where it is another than the report's.
        """
        title_above(drawing, about or self.about)
        path = self.figures / f"{name or key}.png"
        drawing.savefig(path, dpi=self.dpi)
        self.tell(self.done + 0.2 * (1.0 - self.done))
        title, caption = (self.captions(f"{key}.{part}", **values) for part in ("title", "caption"))
        return figure(path, title=title, caption=caption)

    def tell(self, done: float) -> None:
        """Report the share that is done, 0 to 1."""
        self.done = done
        if self.progress is not None:
            self.progress(done)

    def rest(self) -> Progress:
        """A callback for the progress of a part that takes nearly all of the remaining time."""
        start = self.done
        return lambda done: self.tell(start + (0.95 - start) * done)

    def numbers(self, *, std: bool = False, beside: Result | None = None, law: str = "spring-damper") -> Section:
        """Every number of the result with its note, its spread if `std`, and that `beside` it, of the `law`."""
        digits, none = 5 if std else 6, "null" if not std and beside is None else "\N{EN DASH}"
        rows = []
        for name, entry in self.result["quantities"].items():
            cells = [number_text(entry["value"], digits, none=none)]
            cells += [number_text(entry["std"], 2)] if std else []
            cells += [number_text((beside.get(name) or {}).get("value"))] if beside else []
            rows.append((name, *cells, unit_text(entry["unit"]), entry.get("note", "")))
        more = [*(["std"] if std else []), *([law] if beside else [])]
        blocks = [table(("quantity", "value", *more, "unit", "note"), rows, words=True)]
        return Section("Every number of the result", blocks)

    def again(self, command: str, same: str = "") -> Section:
        """How to do the run again with this version, and what is the same then."""
        after = f"The same settings give the same {same}." if same else ""
        return again(command, f"With hedgebed {self.result['version']}, in this folder:", after)

    def write(
        self,
        sections: Sequence[Section],
        *,
        lead: Sequence[str],
        version: bool = True,
        tiles: Sequence[Tile] = (),
        title: str | None = None,
        warnings: Sequence[str] | None = None,
        missing: Sequence[str] = (),
    ) -> Path:
        """Write report.html and return it; title and warnings are the result's where they are not given.

        `lead` stands under the title, after the version of hedgebed where `version` is asked for.
        """
        result = self.result
        warned = [capital(str(warning)) for warning in result["warnings"]] if warnings is None else warnings
        warned = list(map(with_squares, warned))
        top = [f"hedgebed {result['version']}", *lead] if version else lead
        words = str(result["title"]) if title is None else title
        page = Page(typeset(words), top, sections, tiles, warned, missing, limits_words(result))
        report = write_page(self.folder / "report.html", page, result)
        self.tell(1.0)
        return report


def report_of(dpi: int | None = None, *, named: bool = False) -> Callable[[Callable[..., Path]], Callable[..., Path]]:
    """Make of a function of a `Report` one of its folder: `write(folder, *, progress=None, **options)`.

    It draws in the house's style, `dpi` dots an inch, and takes titles and captions from figures.toml of its package.
    `named`: the title of each figure is that of the result.
    Raises FileNotFoundError where the folder has no result.json, or a file that is drawn.
    """

    def decorate(write: Callable[..., Path]) -> Callable[..., Path]:
        @functools.wraps(write)
        def of_folder(folder: str | Path, *, progress: Progress | None = None, **options: Any) -> Path:
            with styled():
                package = write.__module__.rpartition(".")[0]
                return write(Report(folder, progress, package=package, dpi=dpi, named=named), **options)

        return of_folder

    return decorate


def title_of(result: Result) -> str:
    """The title of a result as a figure has it, with the gravity of the bed where the title does not name one."""
    words = str(result.get("title", ""))
    homes = [result.get("bed"), result.get("foundation"), *(result.get("runs") or ())]
    given = [home.get("gravity") for home in homes if isinstance(home, Mapping)]
    numbers = [one.get("value") if isinstance(one, Mapping) else one for one in given]
    found = {number for number in numbers if isinstance(number, int | float)}
    if len(found) == 1 and "m/s2" not in words and "gravities" not in words:
        words += f", at {found.pop():.3g} m/s2"
    return typeset(words)


def again(command: str, before: str = "In this folder:", after: str = "") -> Section:
    """How to do the run again; an empty `before` or `after` is left out."""
    blocks = [text(before)] if before else []
    return Section("To repeat this run", [*blocks, code(command), *([text(after, small=True)] if after else [])])


def given(entries: Mapping[str, Result]) -> Block:
    """The numbers of a trial and where each is from."""
    rows = [(name, number_text(e["value"]), unit_text(e["unit"]), e["origin"]) for name, e in entries.items()]
    return table(("number", "value", "unit", "where from"), rows, words=True)


def terms_text(result: Result) -> str:
    """The terms of the model beyond the base model, in a sentence."""
    effects = [
        f"{effect['id']} ({', '.join(f'{key} = {value:g}' for key, value in effect['parameters'].items())})"
        for effect in result["effects"]
    ]
    return f"Terms beyond the base model: {', '.join(effects) if effects else 'none'}."


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
