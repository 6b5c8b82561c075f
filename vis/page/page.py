"""A report as a page: title, tiles, warnings, and sections of text, figures and tables, in one file without a network.

What the page says is its author's business (`vis.page.report` and those who use it); how it looks is that of every
report.
"""

from __future__ import annotations

import base64
import io
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined, select_autoescape
from PIL import Image

from rigid.series import replacing
from vis.page.numbers import with_squares

__all__ = [
    "Block", "Columns", "Page", "Section", "Tile", "code", "columns", "figure", "listing", "scene_block", "table",
    "table_of", "text", "write_template",
]  # fmt: skip

_KINDS = {".png": "png", ".gif": "gif", ".jpg": "jpeg"}


@dataclass(frozen=True, kw_only=True)
class Block:
    """One piece of a section. Made by `text`, `code`, `listing`, `figure`, `scene_block` and `table`."""

    kind: str
    text: str = ""
    title: str = ""
    caption: str = ""
    data: str | tuple[str, ...] = ""
    head: str | tuple[str, ...] = ()
    file: str = ""
    small: bool = False
    half: bool = False
    words: bool = False
    whole: bool = False
    entries: tuple[str, ...] = ()
    rows: tuple[tuple[str, ...], ...] = ()


@dataclass(frozen=True)
class Section:
    """A heading, "" for none, and what stands under it."""

    heading: str
    blocks: Sequence[Block]


@dataclass(frozen=True)
class Tile:
    """A number that a reader wants first: a row of the report's answer."""

    label: str
    value: str
    note: str = ""
    errors: tuple[str, ...] = ("", "", "")  # Of chance, of grain size, of bed, softness and speed; all; "": not known
    beside: str = ""  # The same number on the spring-damper


@dataclass(frozen=True)
class Page:
    """A whole report."""

    title: str
    lead: Sequence[str]
    sections: Sequence[Section]
    tiles: Sequence[Tile] = ()
    warnings: Sequence[str] = ()
    missing: Sequence[str] = ()
    limits: Sequence[str] = ()  # Known biases of this kind of run


def text(words: str, *, small: bool = False) -> Block:
    """A paragraph."""
    return Block(kind="text", text=with_squares(words), small=small)


def code(words: str) -> Block:
    """Lines as they are typed."""
    return Block(kind="code", text=words)


def listing(items: Sequence[str]) -> Block:
    """A list of sentences."""
    return Block(kind="list", entries=tuple(map(with_squares, items)))


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


def scene_block(head: str, data: Sequence[str], *, whole: bool = False) -> Block:
    """Runs that can be turned and moved through time, as `vis.view` makes them.

    ``head``: JSON in which no tag can begin. ``data``: Base64 for each run. ``whole``: Whether it is all of its page.
    """
    return Block(kind="scene", head=head, data=tuple(data), whole=whole)


def table(head: Sequence[str], rows: Sequence[Sequence[str]], *, title: str = "", words: bool = False) -> Block:
    """A table; the first column is text, the others numbers unless `words`; `columns` decides which wrap."""
    return Block(kind="table", title=title, head=tuple(head), rows=tuple(tuple(row) for row in rows), words=words)


def table_of(head: Sequence[str], rows: Sequence[Sequence[str]], **options: Any) -> list[Block]:
    """The table where there are rows, as the only block; options as those of `table`."""
    return [table(head, rows, **options)] if rows else []


def write_template(path: Path, name: str, **context: Any) -> Path:
    """Write the template `name` of `vis/templates` with its values to `path`, all of it or nothing, and return it.

    It escapes what it is given and refuses a name it was not given.
    """
    environment = Environment(
        loader=PackageLoader("vis"), autoescape=select_autoescape(["html"]), undefined=StrictUndefined,
        trim_blocks=True, lstrip_blocks=True,
    )  # fmt: skip
    environment.globals["columns"] = columns
    text = environment.get_template(name).render(**context)
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return path


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

    ``kinds``: Class of each column's cells. "" stays on one line, "parts" breaks between the parts of a number. "words"
    and "prose" wrap; "prose" is never narrower than a readable line. With "anywhere", long words break. ``head``: Cells
    of the head. ``rows``: Cells of the rows. ``beneath``: Whether the last column stands beneath each row, over the
    table's whole width. ``many``: Whether there are so many columns that they move closer together.
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
