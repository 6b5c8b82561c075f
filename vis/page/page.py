"""A report as a page: title, tiles, warnings, and sections of text, figures and tables, in one file without a network.

`Report` is what a report is made with: it reads the run folder, draws the figures and writes the page. How it looks is
that of every report.
"""

from __future__ import annotations

import base64
import functools
import io
import json
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined, Template, select_autoescape
from matplotlib.figure import Figure
from PIL import Image

from vis.page.folder import read_columns
from vis.page.plots import Array
from vis.page.sentences import Sentences
from vis.page.style import styled

__all__ = [
    "Block", "Columns", "Page", "Progress", "Report", "Result", "Section", "Tile", "again", "capital", "code",
    "columns", "figure", "given", "listing", "number_text", "report_of", "table", "table_of", "tables", "template",
    "text", "unit_text", "write_page", "write_template",
]  # fmt: skip

Progress = Callable[[float], None]
"""Called with the share that is done, 0 to 1."""
Result = Mapping[str, Any]
"""What result.json holds, or an object within it (docs/architecture.md)."""
_KINDS = {".png": "png", ".gif": "gif", ".jpg": "jpeg"}


@dataclass(frozen=True, kw_only=True)
class Block:
    """One piece of a section. Made by `text`, `code`, `listing`, `figure` and `table`."""

    kind: str
    text: str = ""
    title: str = ""
    caption: str = ""
    data: str = ""
    file: str = ""
    small: bool = False
    half: bool = False
    words: bool = False
    entries: tuple[str, ...] = ()
    head: tuple[str, ...] = ()
    rows: tuple[tuple[str, ...], ...] = ()


@dataclass(frozen=True)
class Section:
    """A heading, "" for none, and what stands under it."""

    heading: str
    blocks: Sequence[Block]


@dataclass(frozen=True)
class Tile:
    """A number that a reader wants first. `second` gives it the other colour."""

    label: str
    value: str
    note: str = ""
    second: bool = False


@dataclass(frozen=True)
class Page:
    """A whole report."""

    title: str
    lead: Sequence[str]
    sections: Sequence[Section]
    tiles: Sequence[Tile] = ()
    warnings: Sequence[str] = ()
    missing: Sequence[str] = ()


class Report:
    """The report of one run folder; its `figures/` is made with it.

    ``folder``: The run folder. ``progress``: Called with the share that is done, 0 to 1. ``package``: Whose
    figures.toml has the titles and captions. ``dpi``: Of its figures; the style's own if not given. Raises
    FileNotFoundError where the folder has no result.json, and where a series is missing that is drawn.
    """

    def __init__(
        self, folder: str | Path, progress: Progress | None = None, *, package: str = "", dpi: int | None = None
    ) -> None:
        self.folder, self.dpi, self.captions = Path(folder), dpi, Sentences(package, "figures.toml")
        self.done, self.progress = 0.0, progress
        self.result: Result = json.loads((self.folder / "result.json").read_text(encoding="utf-8"))
        self.figures = self.folder / "figures"
        self.figures.mkdir(exist_ok=True)

    def columns(self, name: str) -> dict[str, Array]:
        """The columns of a CSV file of the folder that are numbers."""
        return read_columns(self.folder / name)[0]

    def draw(self, key: str, drawing: Figure, *, name: str = "", **values: Any) -> Block:
        """Write a figure to figures/`name`.png, or figures/`key`.png, and return what shows it in the report.

        Title and caption are those of `key` in figures.toml, their placeholders filled with `values`.
        """
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
        """What tells the progress of a part that takes nearly all of the time that is left."""
        start = self.done
        return lambda done: self.tell(start + (0.95 - start) * done)

    def numbers(self, *, std: bool = False, beside: Result | None = None) -> Section:
        """Every number of the result with its note, its spread if `std`, and that of the spring-damper `beside` it."""
        digits, none = 5 if std else 6, "null" if not std and beside is None else "\N{EN DASH}"
        rows = []
        for name, entry in self.result["quantities"].items():
            cells = [number_text(entry["value"], digits, none=none)]
            cells += [number_text(entry["std"], 2)] if std else []
            cells += [number_text((beside.get(name) or {}).get("value"))] if beside else []
            rows.append((name, *cells, unit_text(entry["unit"]), entry.get("note", "")))
        more = [*(["std"] if std else []), *(["spring-damper"] if beside else [])]
        blocks = [table(("quantity", "value", *more, "unit", "note"), rows, words=True)]
        return Section("Every number of the result", blocks)

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
        top = [f"hedgebed {result['version']}", *lead] if version else lead
        page = Page(str(result["title"]) if title is None else title, top, sections, tiles, warned, missing)
        report = write_page(self.folder / "report.html", page)
        self.tell(1.0)
        return report


def report_of(dpi: int | None = None) -> Callable[[Callable[..., Path]], Callable[..., Path]]:
    """Make of a function of a `Report` one of its folder: `write(folder, *, progress=None, **options)`.

    It draws in the house's style, `dpi` dots an inch, and takes titles and captions from figures.toml of its package.
    Raises FileNotFoundError where the folder has no result.json, or lacks a file that is drawn.
    """

    def decorate(write: Callable[..., Path]) -> Callable[..., Path]:
        @functools.wraps(write)
        def of_folder(folder: str | Path, *, progress: Progress | None = None, **options: Any) -> Path:
            with styled():
                package = write.__module__.rpartition(".")[0]
                return write(Report(folder, progress, package=package, dpi=dpi), **options)

        return of_folder

    return decorate


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


# Blocks, and the page that they stand on ------------------------------------------------------------------------------


def text(words: str, *, small: bool = False) -> Block:
    """A paragraph."""
    return Block(kind="text", text=words, small=small)


def code(words: str) -> Block:
    """Lines as they are typed."""
    return Block(kind="code", text=words)


def listing(items: Sequence[str]) -> Block:
    """A list of sentences."""
    return Block(kind="list", entries=tuple(items))


def figure(
    path: Path, *, title: str, caption: str, half: bool = False, show_file: bool = False, small: bool = False
) -> Block:
    """A picture, put into the page; if `small` as JPEG, a quarter of a PNG's size.

    Raises ValueError for a file that is neither PNG, GIF nor JPEG.
    """
    if path.suffix not in _KINDS:
        raise ValueError(f"{path} is no picture that a page takes: {', '.join(_KINDS)}")
    kind, content = _KINDS[path.suffix], path.read_bytes()
    if small and kind == "png":
        buffer = io.BytesIO()
        with Image.open(path) as image:
            image.convert("RGB").save(buffer, "JPEG", quality=90, subsampling=0)
        kind, content = "jpeg", buffer.getvalue()
    data = f"data:image/{kind};base64,{base64.b64encode(content).decode('ascii')}"
    return Block(kind="figure", title=title, caption=caption, data=data, half=half, file=path.name if show_file else "")


def table(head: Sequence[str], rows: Sequence[Sequence[str]], *, title: str = "", words: bool = False) -> Block:
    """A table; the first column is text, the others numbers unless `words`; `columns` decides which wrap."""
    return Block(kind="table", title=title, head=tuple(head), rows=tuple(tuple(row) for row in rows), words=words)


def table_of(head: Sequence[str], rows: Sequence[Sequence[str]], **options: Any) -> list[Block]:
    """The table where there are rows, as the only block; options as those of `table`."""
    return [table(head, rows, **options)] if rows else []


def write_page(path: Path, page: Page) -> Path:
    """Write the page to `path`, all of it or nothing, and return it."""
    return write_template(path, "page.html", page=page)


def write_template(path: Path, name: str, **context: Any) -> Path:
    """Write the template `name` with its values to `path`, all of it or nothing, and return it."""
    temporary = path.with_name(f"{path.name}.part")
    temporary.write_text(template(name).render(**context), encoding="utf-8")
    temporary.replace(path)
    return path


def template(name: str) -> Template:
    """A page of `vis/templates`, that escapes what it is given and refuses a name it was not given."""
    environment = Environment(
        loader=PackageLoader("vis"),
        autoescape=select_autoescape(["html"]),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.globals["columns"] = columns
    return environment.get_template(name)


# How the columns of a table wrap: sentences do, numbers do not, long reasons stand beneath their row ------------------

#: Characters: up to here a cell stays on one line; beyond the next, it is a sentence; beyond the next, it may stand
#: beneath its row, where the table has so many columns; a single word beyond the last is broken anywhere (a path).
ONE_LINE, SENTENCE, BENEATH, WORD = 28, 60, 120, 30
#: Characters up to which a number and its bracket stay on one line.
BRACKET = 16
BENEATH_COLUMNS, MANY_COLUMNS = 5, 8
#: Numbers of several parts, "7.1 (6.9 to 7.3; 7.1)": the bracket goes below, and breaks after , or ; only.
_INSIDE_PART = re.compile(r"(?<![,;]) (?!\()")
_LETTERS = re.compile(r"[^\W\d_]{3,}")


@dataclass(frozen=True, kw_only=True)
class Columns:
    """What the template needs beside the cells.

    ``kinds``: Class of each column's cells: "" stays on one line, "parts" breaks between the parts of a number, "words"
    and "prose" wrap, "prose" being never narrower than a readable line; with "anywhere", long words break. ``head``:
    Cells of the head. ``rows``: Cells of the rows. ``beneath``: Whether the last column stands beneath each row, over
    the table's whole width. ``many``: Whether there are so many columns that they move closer together.
    """

    kinds: tuple[str, ...]
    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    beneath: bool
    many: bool


def columns(head: Sequence[Any], rows: Sequence[Sequence[Any]]) -> Columns:
    """Judge the columns of a table, each by its longest cell; widths are the stylesheet's.

    `head` is empty for a table without one; every row has as many cells as the first. Raises ValueError for rows of
    different lengths.
    """
    texts = [[str(cell) for cell in row] for row in rows]
    by_column = list(zip(*texts, strict=True))
    kinds = tuple(_kind(cells) for cells in by_column)
    longest = max((len(cell) for cell in by_column[-1]), default=0) if by_column else 0
    parts = tuple(
        tuple(_INSIDE_PART.sub("\N{NO-BREAK SPACE}", cell) if kind == "parts" else cell
              for cell, kind in zip(row, kinds, strict=True))
        for row in texts
    )  # fmt: skip
    return Columns(
        kinds=kinds,
        head=tuple(str(cell) for cell in head),
        rows=parts,
        beneath=len(kinds) >= BENEATH_COLUMNS and kinds[-1].startswith("prose") and longest > BENEATH,
        many=len(kinds) >= MANY_COLUMNS,
    )


def _kind(cells: Sequence[str]) -> str:
    longest = max(len(cell) for cell in cells)
    numbers = all(len(set(_LETTERS.findall(cell)) - {"none"}) < 2 for cell in cells)
    if longest <= (BRACKET if numbers and any(" (" in cell for cell in cells) else ONE_LINE):
        return ""
    broken = " anywhere" if max((len(word) for cell in cells for word in cell.split()), default=0) > WORD else ""
    if numbers:
        return f"words{broken}" if broken else "parts"
    return ("prose" if longest > SENTENCE else "words") + broken
