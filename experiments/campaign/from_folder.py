"""A campaign from a folder of recordings: columns are recognised by their headings, what nothing shows is "unknown".

The recordings are copied. A copy differs from its recording in the first line at most, where a heading is not the
format's own name. `hedgebed campaign check` refuses the campaign until every "unknown" has a value.
"""

import csv
import io
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from experiments.runs.folder import write_text
from rigid.checks import why_unread
from vis.page.sentences import Sentences

from .headers import READ_UNITS, Column, column_of

__all__ = ["Found", "Recorded", "campaign_from_folder"]

say = Sentences(__package__)
_NEEDED = {"driven": ("t", "depth", "force"), "drop": ("t", "depth", "accel")}


@dataclass(frozen=True)
class Recorded:
    """One recording: its headings, and what each was taken for."""

    file: str
    header: tuple[str, ...]
    names: tuple[str, ...]  # by the format, or the heading as it is
    mode: str  # "driven" or "drop"; "unknown" where neither a force nor an acceleration has a column
    open: tuple[str, ...]  # what is left to do, a sentence each, with the column


@dataclass(frozen=True)
class Found:
    """What was found in a folder of recordings."""

    recordings: tuple[Recorded, ...]

    @property
    def columns(self) -> list[str]:
        """What each set of headings was taken for, with its files, in a line each."""
        alike: dict[tuple[tuple[str, ...], tuple[str, ...]], list[str]] = {}
        for one in self.recordings:
            alike.setdefault((one.header, one.names), []).append(one.file)
        return [
            say("columns_of", files=_listed(files), columns=", ".join(map(_taken_for, header, names)))
            for (header, names), files in alike.items()
        ]

    @property
    def unknown(self) -> list[str]:
        """Everything that is left to fill in, in campaign.toml and in the headings of the copies."""
        modes = [one.mode for one in self.recordings]
        keys = ["tip", "diameter", "kind", "granular"]
        keys += [f"{key}_std" for key, mode in (("force", "driven"), ("accel", "drop")) if mode in modes]
        keys += [key for key, mode in (("mass", "drop"), ("drop_speed", "drop"), ("speed", "driven")) if mode in modes]
        keys += ["mode"] if "unknown" in modes else []
        of_files: dict[str, list[str]] = {}
        for one in self.recordings:
            for sentence in one.open:
                of_files.setdefault(sentence, []).append(one.file)
        left = [f"{_listed(files)}: {sentence}" for sentence, files in of_files.items()]
        return [*left, *(say(f"unknown_{key}") for key in [*keys, "depth_std", "gravity"])]


def campaign_from_folder(folder: Path, source: Path) -> Found:
    """Write a campaign of pushes and drops into `folder`, which exists and is empty, one trial for each CSV file of
    `source`. Raises ValueError, naming the file, for a folder without recordings and a file that is no CSV."""
    try:
        paths = sorted(path for path in source.iterdir() if path.suffix.lower() == ".csv" and path.is_file())
    except OSError as error:
        raise ValueError(f"{source}: {why_unread(source, error)}") from None
    if not paths:
        raise ValueError(say("no_recordings", source=source))
    texts = {path: _text_of(path) for path in paths}
    found = Found(tuple(_recorded(path, text) for path, text in texts.items()))
    folder.mkdir(parents=True, exist_ok=True)
    for one, (path, text) in zip(found.recordings, texts.items(), strict=True):
        first, end, rest = text.partition("\n")
        head = first if one.names == one.header else _line(one.names) + first[len(first.rstrip("\r")) :]
        (folder / path.name).write_bytes(f"{head}{end}{rest}".encode())
    write_text(folder / "campaign.toml", _tables(folder, source, found))
    return found


def _text_of(path: Path) -> str:
    """The recording as text. Raises ValueError for another encoding, and for cells that no comma parts."""
    try:
        text = path.read_bytes().decode("utf-8-sig")
    except OSError as error:
        raise ValueError(f"{path}: {why_unread(path, error)}") from None
    except UnicodeDecodeError as error:
        raise ValueError(f"{path}: is not UTF-8 text ({error.reason} at byte {error.start})") from None
    first = text.partition("\n")[0]
    for mark, name in ((";", "semicolons"), ("\t", "tabs")):
        if "," not in first and mark in first:
            raise ValueError(say("parted", path=path, name=name))
    if not any(letter.isalpha() for letter in first):
        raise ValueError(say("no_header", path=path, first=first.strip()[:40]))
    return text


def _line(names: Sequence[str]) -> str:
    """Headings as the first line of a CSV file."""
    held = io.StringIO()
    csv.writer(held, lineterminator="").writerow(names)
    return held.getvalue()


def _recorded(path: Path, text: str) -> Recorded:
    header = tuple(cell.strip() for cell in next(csv.reader([text.partition("\n")[0].rstrip("\r")])))
    columns = [column_of(cell) for cell in header]
    quantities = {column.quantity for column in columns}
    mode = "driven" if "force" in quantities else "drop" if "accel" in quantities else "unknown"
    names, left = list(header), list[str]()
    for quantity in _NEEDED.get(mode, _NEEDED["driven"]):
        places = [place for place, column in enumerate(columns) if column.quantity == quantity]
        exact = [place for place in places if columns[place].name == header[place]]
        chosen = exact or places
        if len(chosen) == 1 and columns[chosen[0]].name:
            names[chosen[0]] = columns[chosen[0]].name
        else:
            left.append(_left(quantity, header, columns, chosen))
    return Recorded(path.name, header, tuple(names), mode, tuple(left))


def _left(quantity: str, header: Sequence[str], columns: Sequence[Column], places: Sequence[int]) -> str:
    """Why a quantity has no column yet, and what to do."""
    wanted = " or ".join(f"{quantity}_{unit}" for unit in READ_UNITS[quantity])
    if not places:
        key = "no_time" if quantity == "t" else "no_column"
        return say(key, wanted=wanted, held=", ".join(header))
    if len(places) > 1:
        return say("several_columns", wanted=wanted, listed=" and ".join(repr(header[place]) for place in places))
    unit = columns[places[0]].unit
    key = "unit_not_read" if unit else "no_unit"
    return say(key, heading=header[places[0]], unit=unit, wanted=wanted)


def _taken_for(heading: str, name: str) -> str:
    if heading == name:
        return f"{name} (kept)" if column_of(name).name == name else f"{heading!r} (not used)"
    return f"{heading!r} is {name}"


def _listed(files: Sequence[str]) -> str:
    return files[0] if len(files) == 1 else f"{len(files)} files alike ({files[0]} to {files[-1]})"


def _tables(folder: Path, source: Path, found: Found) -> str:
    """campaign.toml: what is known, and "unknown"."""
    modes = {one.mode for one in found.recordings}
    text = say("head", name=json.dumps(folder.resolve().name), source=source.name)
    text += say("mass") if "drop" in modes else ""
    text += say("tables")
    text += say("force_table") if modes - {"drop"} else ""
    text += say("accel_table") if "drop" in modes else ""
    for one in found.recordings:
        lines = {"id": json.dumps(Path(one.file).stem), "mode": json.dumps(one.mode), "data": json.dumps(one.file)}
        lines |= {"speed": '"unknown"  # m/s, at the surface'} if one.mode == "drop" else {}
        text += "\n[[trial]]\n" + "".join(f"{key} = {value}\n" for key, value in lines.items())
    return text
