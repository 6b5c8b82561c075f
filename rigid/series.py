"""Columns of numbers in a CSV file: what `coupling` and `experiments` share of a run folder."""

from __future__ import annotations

import csv
import os
from collections.abc import Container, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "RESULT_FORMAT",
    "ResultFormat",
    "Series",
    "pandas",
    "read_series",
    "replacing",
    "write_series",
]

ResultFormat = Literal["hedgebed-result/1"]
RESULT_FORMAT: ResultFormat = get_args(ResultFormat)[0]
"""`format` of every result.json."""
SAME = ("s", "m", "N", "J", "Pa", "rad", "deg", "kg", "mm")
UNITS = {name: name for name in SAME} | {"m_s": "m/s", "m_s2": "m/s2", "rad_s": "rad/s", "deg_s": "deg/s", "N_m": "N m"}
"""Unit at the end of a column's name -> unit."""


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Yield a temporary path beside `path`; move it into place if all went well, remove it if not.

    Raises OSError, naming `path`, where it cannot be written, as on a full disk.
    """
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        yield temporary
        with temporary.open("rb") as file:
            os.fsync(file.fileno())
        temporary.replace(path)
    except OSError as error:
        if error.filename in (None, str(temporary)):  # `write` names no file
            raise OSError(error.errno, error.strerror or str(error), str(path)) from error
        raise
    finally:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)


@dataclass(frozen=True)
class Series:
    """A time series: columns by name, the unit of each at the end of its name (``depth_m``, ``vx_m_s``)."""

    columns: Mapping[str, NDArray[Any]]
    """Name -> array, shape [n] each."""

    @property
    def units(self) -> dict[str, str]:
        """Name -> unit; "1" for a number without one, "" for text."""
        return {name: _unit(name) if values.dtype.kind in "fiu" else "" for name, values in self.columns.items()}

    @classmethod
    def read(cls, path: str | Path) -> Series:
        """Read a CSV file; raises as `read_series`."""
        return cls(read_series(path))

    def write(self, path: str | Path) -> None:
        """Write a CSV file; raises as `write_series`."""
        write_series(path, self.columns)

    def to_dataframe(self) -> Any:
        """The columns as a pandas.DataFrame. Raises ImportError, naming the extra, without pandas."""
        return pandas().DataFrame(dict(self.columns))


def write_series(path: str | Path, columns: Mapping[str, Any], *, line_end: str = "\n") -> None:
    """Write `columns` (name -> array of shape [n]) to the CSV file `path`, all of it or nothing.

    A name carries its unit: ``depth_m``, ``force_N``. Numbers are written with all digits, so that reading returns
    equal values. Arrays of text (``phase``) are written unchanged. Raises ValueError where lengths differ.
    """
    path = Path(path)
    arrays = {name: np.asarray(values) for name, values in columns.items()}
    lengths = {name: array.shape for name, array in arrays.items()}
    if len(set(lengths.values())) > 1 or any(len(shape) != 1 for shape in lengths.values()):
        raise ValueError(f"the columns of {path.name} must be one-dimensional and of one length, not {lengths}")
    cells = [[str(v) if array.dtype.kind in "USOb" else repr(v) for v in array.tolist()] for array in arrays.values()]
    with replacing(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator=line_end)
        writer.writerow(arrays)
        writer.writerows(zip(*cells, strict=True))


def read_series(path: str | Path, *, text: Container[str] = ()) -> dict[str, NDArray[Any]]:
    """The columns of the CSV file `path`: name -> array of shape [n], float where all of it is numbers, else text.

    Columns named in `text` stay text, whatever they hold. Raises ValueError, naming the file, for one that is damaged:
    empty, no text, a row that ends too early.
    """
    try:
        with Path(path).open(newline="", encoding="utf-8") as file:
            rows = [row for row in csv.reader(file) if row]
    except (UnicodeDecodeError, csv.Error) as error:
        raise ValueError(f"{path}: is no CSV file: {error}") from None
    if not rows:
        raise ValueError(f"{path}: is empty; a row with the names of the columns was expected")
    names = rows.pop(0)
    if short := next((number for number, row in enumerate(rows, 2) if len(row) < len(names)), None):
        raise ValueError(f"{path}: row {short} has {len(rows[short - 2])} cells, {len(names)} were expected")
    cells = {name: [row[place] for row in rows] for place, name in enumerate(names)}
    return {name: np.array(own, dtype=str) if name in text else _array(own) for name, own in cells.items()}


def pandas() -> Any:
    """The library, an extra of ours. Raises ImportError, saying how to install it."""
    try:
        import pandas as found
    except ImportError as error:
        raise ImportError("to_dataframe needs pandas: pip install 'hedgebed[pandas]'") from error
    return found


def _array(cells: list[str]) -> NDArray[Any]:
    try:
        return np.array([float(cell) for cell in cells])
    except ValueError:
        return np.array(cells)


def _unit(name: str) -> str:
    return next((UNITS[end] for end in sorted(UNITS, key=len, reverse=True) if name.endswith(f"_{end}")), "1")
