"""A report as a page: title, tiles, warnings, and sections of text, figures and tables, in one file without a network.

What the page says is its author's business (`vis.page.report` and those who use it); how it looks is that of every
report.
"""

from __future__ import annotations

import base64
import io
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from PIL import Image

from vis.page.columns import template

__all__ = [
    "Block", "Page", "Section", "Tile", "code", "figure", "listing", "table", "table_of", "text", "write_page",
    "write_template",
]  # fmt: skip

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
    missing: Sequence[str] = field(default_factory=tuple)


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
    """A table; the first column is text, the others numbers unless `words`; `vis.page.columns` says which wrap."""
    return Block(kind="table", title=title, head=tuple(head), rows=tuple(tuple(row) for row in rows), words=words)


def table_of(
    head: Sequence[str], rows: Sequence[Sequence[str]], *, title: str = "", words: bool = False
) -> list[Block]:
    """The table where there are rows, as the only block."""
    return [table(head, rows, title=title, words=words)] if rows else []


def write_page(path: Path, page: Page) -> Path:
    """Write the page to `path`, all of it or nothing, and return it."""
    return write_template(path, "page.html", page=page)


def write_template(path: Path, name: str, **context: Any) -> Path:
    """The same of a template with what it asks for."""
    temporary = path.with_name(f"{path.name}.part")
    temporary.write_text(template(name).render(**context), encoding="utf-8")
    temporary.replace(path)
    return path
