"""How the columns of a report's table wrap: sentences do, numbers do not, and long reasons stand beneath their row.

Widths are the stylesheet's; what is known here is the text. A column is judged by its longest cell.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined, Template, select_autoescape

__all__ = ["Columns", "columns", "template"]

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
    """Judge the columns of a table. `head` is empty for a table without one; every row has as many cells as the first.

    Raises ValueError for rows of different lengths.
    """
    texts = [[str(cell) for cell in row] for row in rows]
    by_column = list(zip(*texts, strict=True))
    kinds = tuple(_kind(cells) for cells in by_column)
    longest = max((len(cell) for cell in by_column[-1]), default=0) if by_column else 0
    return Columns(
        kinds=kinds,
        head=tuple(str(cell) for cell in head),
        rows=tuple(tuple(_kept_whole(cell, kind) for cell, kind in zip(row, kinds, strict=True)) for row in texts),
        beneath=len(kinds) >= BENEATH_COLUMNS and kinds[-1].startswith("prose") and longest > BENEATH,
        many=len(kinds) >= MANY_COLUMNS,
    )


def _kept_whole(cell: str, kind: str) -> str:
    """The cell, its parts made unbreakable where it is a number of several."""
    return _INSIDE_PART.sub("\N{NO-BREAK SPACE}", cell) if kind == "parts" else cell


def _kind(cells: Sequence[str]) -> str:
    longest = max(len(cell) for cell in cells)
    numbers = all(len(set(_LETTERS.findall(cell)) - {"none"}) < 2 for cell in cells)
    if longest <= (BRACKET if numbers and any(" (" in cell for cell in cells) else ONE_LINE):
        return ""
    broken = " anywhere" if max((len(word) for cell in cells for word in cell.split()), default=0) > WORD else ""
    if numbers:
        return f"words{broken}" if broken else "parts"
    return ("prose" if longest > SENTENCE else "words") + broken


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
