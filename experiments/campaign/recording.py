"""One sensor's CSV file of one trial: columns whose names carry their unit.

A required quantity may come in any unit there is for it (``theta_deg`` is read as ``theta_rad``, converted). Columns
that are not asked for are kept as text and written back. An empty cell and ``nan`` are gaps; a row of nothing but gaps
is left out. Times rise, or stay the same where a clock is coarse.
"""

import csv
import io
import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from experiments.runs.folder import write_series

from .headers import missing_columns

__all__ = ["Recording", "read_recording", "write_recording"]

_DECIMAL_COMMA = re.compile(r"[-+]?[0-9]+,[0-9]+([eE][-+]?[0-9]+)?")
_MOST_REPORTED = 5  # faults of one kind of one file; of the rest the number
_LARGEST = 1e50  # Of a cell, in its unit: powers of a larger one can overflow

Conversion = Callable[[float], float]


def _thousandth(value: float) -> float:
    return value / 1000  # correctly rounded, as a product with 0.001 is not


#: Unit of the format -> unit in a file -> conversion.
_UNITS: dict[str, dict[str, Conversion]] = {
    "s": {"s": float, "ms": _thousandth},
    "m": {"m": float, "mm": _thousandth},
    "rad": {"rad": float, "deg": math.radians},
    "m_s2": {"m_s2": float, "g": lambda value: value * 9.80665},
    "N": {"N": float, "mN": _thousandth},
    "rad_s": {"rad_s": float, "deg_s": math.radians, "rpm": lambda value: value * (2 * math.pi / 60)},
}


@dataclass(frozen=True)
class Recording:
    """What one file holds: ``x_m`` -> array of shape [row_count] in the format's units, NaN in a gap; ``t_s`` first.
    `extra`: the columns that are not asked for, as text."""

    columns: Mapping[str, NDArray[np.float64]]
    extra: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    def __getitem__(self, name: str) -> NDArray[np.float64]:
        """The column `name`, such as ``x_m``. Raises KeyError for one that was not asked for."""
        return self.columns[name]

    @property
    def time(self) -> NDArray[np.float64]:
        """``t_s`` [s]"""
        return self.columns["t_s"]

    def __len__(self) -> int:
        return len(self.time)


def read_recording(path: Path, wanted: Sequence[tuple[str, str]]) -> Recording:
    """Read the CSV file `path`, which must hold the quantities `wanted`: (name, unit), the time first.

    Raises ValueError, one fault a line, naming file, line and column, what was found and what was expected. Faults of a
    file: missing, without rows, a missing column, a quantity given twice. Faults of a row: text in a number, an
    infinite number, another length, a time that runs backwards or is missing beside numbers.
    """
    header, rows = _read_cells(path)
    faults = _other_csv(path, header, rows) or _header_faults(path, header)
    if faults:
        raise ValueError("\n".join(faults))
    missing = [(name, _UNITS[unit]) for name, unit in wanted if not _columns_of(header, name, unit)]
    faults += [f"{path}, line 1: {missing_columns(header, missing)}"] if missing else []
    absent = [name for name, _ in missing]
    columns_found = [_find_column(path, header, name, unit) for name, unit in wanted if name not in absent]
    faults += [found for found in columns_found if isinstance(found, str)]
    chosen = [found for found in columns_found if not isinstance(found, str)]
    expected = f"cells, expected {len(header)} as in the header"
    long = [f"{path}, line {line}: found {len(row)} {expected}" for line, row in rows if len(row) != len(header)]
    faults += _cut(path, long)
    rows = [(line, row) for line, row in rows if len(row) == len(header)]
    odd: list[str] = []
    parsed = [
        [_number(path, line, header[index], row[index], convert, odd) for line, row in rows]
        for index, convert in chosen
    ]
    faults += _cut(path, odd)
    if len(chosen) < len(wanted):
        raise ValueError("\n".join(faults))
    numbers = np.array(parsed, dtype=float).reshape(len(wanted), len(rows))
    kept = np.flatnonzero(~np.isnan(numbers).all(axis=0))
    if not len(kept) and not faults:
        faults.append(f"{path}: holds no row of numbers, at least one was expected")
    rows, numbers = [rows[index] for index in kept], numbers[:, kept]
    if not odd:
        faults += _time_faults(path, header[chosen[0][0]], [line for line, _ in rows], numbers[0])
    if faults:
        raise ValueError("\n".join(faults))
    columns = {f"{name}_{unit}": values for (name, unit), values in zip(wanted, numbers, strict=True)}
    others = {name: k for k, name in enumerate(header) if name and k not in dict(chosen)}
    return Recording(columns, {name: tuple(row[k] for _, row in rows) for name, k in others.items()})


def _cut(path: Path, faults: Sequence[str]) -> list[str]:
    """The first of these faults, and how many more there are."""
    more = len(faults) - _MOST_REPORTED
    return [*faults[:_MOST_REPORTED], *([f"{path}: and {more} more lines of that kind"] if more > 0 else [])]


def _read_cells(path: Path) -> tuple[list[str], list[tuple[int, list[str]]]]:
    """The names of the header, and the rows with their lines."""
    try:
        text = path.read_text(encoding="utf-8-sig")
    except FileNotFoundError:
        raise ValueError(f"{path}: there is no such file, though campaign.toml names it") from None
    except OSError as error:
        raise ValueError(f"{path}: cannot be read ({error.strerror})") from None
    except UnicodeDecodeError as error:
        raise ValueError(f"{path}: is not UTF-8 text ({error.reason} at byte {error.start})") from None
    reader = csv.reader(io.StringIO(text))
    try:
        rows, begins = list[tuple[int, list[str]]](), 1
        for row in reader:
            if "\n" in "".join(row):
                raise ValueError(
                    f"{path}, line {begins}: a quotation mark opens a cell that goes on over several lines; numbers "
                    "without quotation marks were expected"
                )
            rows.append((reader.line_num, row))
            begins = reader.line_num + 1
        header = [name.strip() for name in rows[0][1]] if rows else []
        return header, [(line, row) for line, row in rows[1:] if row]
    except csv.Error as error:
        raise ValueError(f"{path}, line {reader.line_num}: is no CSV ({error})") from None


def write_recording(path: Path, recording: Recording) -> None:
    """Write `recording` to `path` with all digits, so that reading returns equal values."""
    numbers = {name: np.asarray(values, dtype=float) for name, values in recording.columns.items()}
    write_series(path, numbers | dict(recording.extra))


def _other_csv(path: Path, header: list[str], rows: list[tuple[int, list[str]]]) -> list[str]:
    """Cells parted by semicolons or tabs, and decimal commas, as spreadsheets of some languages write them."""
    expected = "commas between cells and points in numbers were expected"
    for mark, name in ((";", "semicolons"), ("\t", "tabs")):
        if len(header) == 1 and mark in header[0]:
            comma = any("," in cell for cell in (mark.join(",".join(row) for _, row in rows[:5])).split(mark))
            also = ", and its numbers have decimal commas" if comma else ""
            return [f"{path}: its cells are parted by {name}{also}; {expected}"]
    twice = len(rows) > 3 and all(1.5 * len(header) <= len(row) <= 2 * len(header) for _, row in rows[:20])
    if twice or any(_DECIMAL_COMMA.fullmatch(cell.strip()) for _, row in rows[:5] for cell in row):
        return [f"{path}: its numbers look as if they had decimal commas; {expected}"]
    return []


def _header_faults(path: Path, header: list[str]) -> list[str]:
    if not any(header):
        return [f"{path}, line 1: has no header, names of columns were expected"]
    return [
        f"{path}, line 1: column {name!r} is there {header.count(name)} times, once was expected"
        for name in dict.fromkeys(header)
        if name and header.count(name) > 1
    ]


def _find_column(path: Path, header: list[str], name: str, unit: str) -> tuple[int, Conversion] | str:
    """Where a quantity stands and what converts it, or what is wrong."""
    found = _columns_of(header, name, unit)
    if len(found) > 1:
        return f"{path}, line 1: columns {' and '.join(found)} are the same quantity, one was expected"
    ((column, convert),) = found.items()
    return header.index(column), convert


def _columns_of(header: list[str], name: str, unit: str) -> dict[str, Conversion]:
    """Columns that are a quantity in one of its units, and what converts them."""
    known = {f"{name}_{there}": convert for there, convert in _UNITS[unit].items()}
    return {column: known[column] for column in header if column in known}


def _number(path: Path, line: int, name: str, cell: str, convert: Conversion, faults: list[str]) -> float:
    """The number in a cell, NaN for a gap; what is no number goes to `faults`."""
    text = cell.strip()
    if not text:
        return math.nan
    try:
        value = float(text)
    except ValueError:
        faults.append(f"{path}, line {line}: {name} = {cell!r}, a number or nan was expected")
        return math.nan
    if math.isinf(value):
        faults.append(f"{path}, line {line}: {name} = {cell!r}, a finite number or nan was expected")
        return math.nan
    if abs(value) > _LARGEST:
        faults.append(f"{path}, line {line}: {name} = {cell!r}, at most {_LARGEST:g} or nan was expected")
        return math.nan
    return convert(value)


def _time_faults(path: Path, name: str, lines: list[int], times: NDArray[np.float64]) -> list[str]:
    """A time that is missing in a row with numbers, or runs backwards."""
    gaps, there = np.flatnonzero(np.isnan(times)), np.flatnonzero(~np.isnan(times))
    missing = [f"{path}, line {lines[index]}: {name} is missing, a number was expected" for index in gaps]
    known = times[there]
    back = [
        f"{path}, line {lines[there[k + 1]]}: {name} runs backwards, from {known[k]:.10g} s to {known[k + 1]:.10g} s; "
        f"a time no earlier was expected"
        for k in np.flatnonzero(np.diff(known) < 0)
    ]
    return [*_cut(path, missing), *_cut(path, back)]
