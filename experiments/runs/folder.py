"""A run is a folder: what it holds, who is writing it, and how far it has come.

Everything that is written goes to a temporary file first and is moved into place. So a reader (or a killed run) finds
either the whole of a file or none of it.

```
run.toml                  the settings, each with its meaning and unit in a comment; reads back to the same settings
status.json               {"status": "running|stopped|failed|done", "reason", "updated", "processor_time"}, and digests
lock                      the process that is writing the folder; the system frees it when that process dies
result.json               the numbers a person would quote
series/<id>.csv           time series, the unit of each column in its name
checkpoint/<name>.npz     arrays to carry on from; <name>.npz.before: those of the checkpoint before
checkpoint/<name>.done.json    says that a piece of the work is finished; with digests of itself and of its series
```
"""

import os
import re
import sys
import tomllib
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from datetime import datetime
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np
from filelock import FileLock, Timeout
from pydantic import BaseModel

from dem.files.arrays import read_arrays
from hedgebed_renamed import BEFORE_RUN_2, BEFORE_RUN_3
from rigid.checks import alike
from rigid.digests import check_digests, digest_of, digest_of_data
from rigid.result import plain, read_json, read_result, toml_value, write_json, write_text
from rigid.series import read_series, replacing, write_series
from rigid.version import __version__

__all__ = [
    "BusyError",
    "RunFolder",
    "Status",
    "fresh_path",
    "holding",
    "plain",
    "read_json",
    "read_series",
    "settings_in",
    "settings_toml",
    "toml_value",
    "write_json",
    "write_series",
    "write_text",
]

Status = Literal["running", "stopped", "failed", "done"]

RUN_FORMAT = "hedgebed-run/3"
_NAMES_OF = {"hedgebed-run/1": BEFORE_RUN_2 | BEFORE_RUN_3, "hedgebed-run/2": BEFORE_RUN_3, RUN_FORMAT: {}}
"""Format of a run.toml -> what it calls otherwise: name of a material or a surface in it -> name of today."""
RUN_FORMATS = tuple(_NAMES_OF)  # what can be read
_NAMED = ("material", "surface", "surfaces")
_NAMES = "names-of-all"  # in a checkpoint: a zip file whose list is cut off is read as a shorter one
_DONE = "hedgebed-done/1"
_MARK = {"format", "data", "digests"}  # Keys of a mark
_WITH_NUMBERS = (".csv", ".json", ".mjb", ".nc", ".py", ".toml")  # Files of a finished run that have a digest
_WITHOUT_DIGEST = ("campaign", "checkpoint", "figures", "frames", "members")
"""Folders whose files have none: a person changes a campaign, frames and checkpoints have digests of their own."""
_BEFORE = ".before"  # ends the name of the checkpoint before the last
_POLL = 0.2  # Between two looks whether a folder is free [s]
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._+-]*")


_TOLD: set[str] = set()
"""Damage that was reported: a folder is read more than once."""


def settings_toml(command: str, settings: BaseModel, version: str, code: str = "") -> str:
    """The text of run.toml: each field of `settings` with its description as a comment above it."""
    values = settings.model_dump(mode="python")
    lines = [
        f"# hedgebed {command}: every setting of this run, as given or by default.",
        f"# `hedgebed {command} run.toml` does the same again.",
        f"format = {toml_value(RUN_FORMAT)}",
        f"version = {toml_value(version)}",
        *([f"code = {toml_value(code)}  # digest of the code that computes beds"] if code else []),
        f"command = {toml_value(command)}",
        f"created = {toml_value(_now())}",
        f"not_set = {toml_value([name for name, value in values.items() if value is None])}",
        "",
        "[settings]",
    ]
    for name, field in type(settings).model_fields.items():
        lines += [f"# {line}" for line in (field.description or "").splitlines()]
        lines += [f"# {name} is not set" if values[name] is None else f"{name} = {toml_value(values[name])}"]
    return "\n".join(lines) + "\n"


def settings_in(table: Mapping[str, Any]) -> dict[str, Any]:
    """The settings in `table`, a run.toml read: name -> value, None for what is not set; materials by today's names."""
    found = {**dict.fromkeys(table.get("not_set", [])), **table["settings"]}
    return _of_today(found, table["format"])


def _of_today(table: Mapping[str, Any], written_as: str) -> dict[str, Any]:
    """Settings or results of a run of this format, with materials and surfaces by today's names."""
    names = _NAMES_OF[written_as]

    def renamed(value: Any) -> Any:
        if isinstance(value, list):
            return [renamed(item) for item in value]
        return names.get(value, value) if isinstance(value, str) else value

    return {key: renamed(value) if key in _NAMED else value for key, value in table.items()}


def _what_else(path: Path) -> str:
    """The end of a sentence: what else the user can do with the run in a folder."""
    try:
        done = RunFolder.open(path).status == "done"
    except ValueError:
        return ""
    return "; that run is done" if done else f", or finish that run with `hedgebed resume {path}`"


def _now() -> str:
    return datetime.now().astimezone().isoformat(timespec="seconds")


def _processor_time() -> float:
    """Of this process and its children that have ended [s]."""
    spent = os.times()
    return spent.user + spent.system + spent.children_user + spent.children_system


def fresh_path(command: str, root: Path = Path("runs")) -> Path:
    """A folder under `root` that does not exist yet: ``<command>-<date>-<time>``."""
    stem = f"{command.replace(' ', '-')}-{datetime.now():%Y%m%d-%H%M%S}"
    path, count = root / stem, 1
    while path.exists():
        count += 1
        path = root / f"{stem}-{count}"
    return path


def _checked(name: str) -> str:
    if not _NAME.fullmatch(name):
        raise ValueError(f"{name!r} cannot name a file of a run folder: use letters, digits, '.', '_', '+' and '-'")
    return name


def _in_use(path: Path) -> list[str]:
    """What a folder holds of a run; not what one leaves that was killed before its run.toml was there."""
    left = re.compile(r"lock|traceback\.txt|\..*\.tmp")
    return sorted(item.name for item in path.iterdir() if not left.fullmatch(item.name)) if path.exists() else []


class BusyError(ValueError):
    """Another process is writing the folder."""


def _numbers_in(folder: Path) -> Iterator[Path]:
    """The files of a run folder that hold numbers, in whatever order; not those of runs and campaigns within it."""
    for path in folder.iterdir():
        own = ("run.toml", "campaign.toml")
        if path.is_dir() and path.name not in _WITHOUT_DIGEST and not any((path / name).exists() for name in own):
            yield from _numbers_in(path)
        elif path.suffix in _WITH_NUMBERS and not path.name.startswith(".") and path != folder / "status.json":
            yield path


@contextmanager
def holding(path: Path, *, waiting: Callable[[str], None] | None = None) -> Iterator[None]:
    """Hold the folder `path` of a run, made where it is not there, for this process, which can take it again within.

    While another process has it: BusyError (a ValueError) is raised that names that process; or, with `waiting`, that
    is called with the sentence, and the folder is waited for. A process that died, however it died, has left it free.
    """
    path.mkdir(parents=True, exist_ok=True)
    file = path.resolve() / "lock"
    lock = FileLock(file, timeout=0, is_singleton=True, thread_local=False)
    try:
        lock.acquire()
    except Timeout:
        owner = file.read_text(encoding="utf-8", errors="replace").strip() or "another"
        said = f"{str(path)!r} is being written by process {owner}: "
        if waiting is None:
            raise BusyError(f"{said}wait for it or stop it first") from None
        waiting(f"{said}this one waits for it")
        lock.acquire(timeout=-1, poll_interval=_POLL)
    _write_owner(file, f"{os.getpid()}\n")
    try:
        yield
    finally:
        if lock.lock_counter == 1:
            _write_owner(file, "")
        lock.release()


def _write_owner(file: Path, text: str) -> None:
    """Who has the lock, for the message to another; without it, as on a full disk, the lock holds all the same."""
    with suppress(OSError):
        file.write_text(text, encoding="utf-8")


class RunFolder:
    """The folder of one run: `create` makes one, `open` takes an old one, `ensure` does either."""

    def __init__(self, path: Path, command: str, version: str, settings: dict[str, Any], code: str = ""):
        self.path = Path(path)
        self.command = command
        self.version = version
        self.code = code  # digest of the code that computes, where the experiment has one
        self.settings = settings  # as run.toml has them: name -> value, None for what is not set
        self.format = RUN_FORMAT  # that of its run.toml
        spent = self._kept_status().get("processor_time")
        self._spent_before = float(spent) if isinstance(spent, int | float) else 0.0
        self._began = _processor_time()

    def __repr__(self) -> str:
        return f"RunFolder({str(self.path)!r}, command={self.command!r}, status={self.status!r})"

    # Making and taking up

    @classmethod
    def create(
        cls, path: Path, command: str, settings: BaseModel, version: str = __version__, code: str = ""
    ) -> "RunFolder":
        """Make the folder of a new run and write its run.toml.

        Raises ValueError, naming the path, if it is in use (a file, or a folder that holds something) or cannot be
        written. Also if the settings would not read back unchanged from run.toml.
        """
        path = Path(path)
        text, where = settings_toml(command, settings, version, code), f"out = {str(path)!r}"
        if type(settings)(**settings_in(tomllib.loads(text))) != settings:
            raise ValueError(f"the settings of {command} cannot be kept: they do not read back unchanged from run.toml")
        if path.exists() and not path.is_dir():
            raise ValueError(f"{where} is a file: name a folder that is empty or does not exist yet")
        cls._check_free(path)
        try:
            with holding(path):
                cls._check_free(path)  # another process may have made its run meanwhile
                write_text(path / "run.toml", text)
                folder = cls.open(path)
                folder.set_status("running")
        except OSError as error:
            raise ValueError(f"{where} cannot be written ({error.strerror}): name a folder that can be") from error
        return folder

    @staticmethod
    def _check_free(path: Path) -> None:
        """Raise ValueError where the folder holds something of a run."""
        if held := _in_use(path):
            what = ", ".join(held[:3]) + (", ..." if len(held) > 3 else "")
            remedy = _what_else(path) if "run.toml" in held else ""
            raise ValueError(
                f"out = {str(path)!r} is in use (it holds {what}): name a folder that is empty or does not exist yet"
                f"{remedy}"
            )

    @classmethod
    def open(cls, path: Path) -> "RunFolder":
        """Take up the folder of an earlier run. Raises ValueError if `path` is not one, or its run.toml is damaged."""
        path = Path(path)
        try:
            table = tomllib.loads((path / "run.toml").read_text(encoding="utf-8"))
        except OSError:
            why = "has no run.toml" if path.is_dir() else f"is not there{alike(path, folders=True)}"
            raise ValueError(f"{str(path)!r} is not a run folder: it {why}") from None
        except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
            raise ValueError(f"{str(path / 'run.toml')!r} cannot be read: {error}") from None
        if table.get("format") not in RUN_FORMATS or not isinstance(table.get("settings"), dict):
            found = f"has format = {table.get('format')!r}, not {RUN_FORMAT!r}"
            if "experiment" in table and "format" not in table:  # as `save` of a script's run writes it
                found = "is of a script, not of a command: vis.write_report draws it"
            raise ValueError(f"{str(path / 'run.toml')!r} {found}")
        check_digests(path, "run.toml")
        command, version, code = (str(table.get(key, "")) for key in ("command", "version", "code"))
        folder = cls(path, command, version, settings_in(table), code)
        folder.format = table["format"]
        return folder

    @classmethod
    def ensure(
        cls, path: Path, command: str, settings: BaseModel, version: str = __version__, code: str = ""
    ) -> "RunFolder":
        """`open` the folder if it is one of the same command with the same settings, else `create` it.

        An experiment calls this first: it then works alike from the command line, which has made the folder already,
        from a script, and when it is resumed. Raises ValueError as `create` does.
        """
        if (Path(path) / "run.toml").is_file():
            folder = cls.open(path)
            if folder.command == command and type(settings)(**folder.settings) == settings:
                return folder
        return cls.create(path, command, settings, version, code)

    @classmethod
    def mend(
        cls, path: Path, command: str, settings: BaseModel, version: str = __version__, code: str = ""
    ) -> "RunFolder":
        """Write the run.toml of a run again, where it is damaged and the settings are known; what is done stays."""
        write_text(path / "run.toml", settings_toml(command, settings, version, code))
        cls(path, command, version, {})._forget_digest("run.toml")
        return cls.open(path)

    # Who is writing

    @contextmanager
    def lock(self) -> Iterator[None]:
        """Hold the folder for this process, as `holding` does. Raises BusyError where another has it."""
        with holding(self.path):
            yield

    # How far

    @property
    def status(self) -> Status | None:
        """What status.json says; None where there is none."""
        status = self._kept_status().get("status")
        return status if status in get_args(Status) else None

    def _kept_status(self) -> dict[str, Any]:
        """What status.json holds; nothing where there is none."""
        try:
            kept = read_json(self.path / "status.json")
        except (OSError, ValueError):
            return {}
        return kept if isinstance(kept, dict) else {}

    @property
    def processor_time(self) -> float:
        """Of this process and its children that have ended, since the folder was opened, and of earlier ones [s].

        Of an earlier process that was killed, until its last checkpoint.
        """
        return round(self._spent_before + _processor_time() - self._began, 2)

    def set_status(self, status: Status, reason: str = "", *, processor_time: float | None = None) -> None:
        """Write status.json, of a run that is done with digests of its files. `reason`: why it stopped or failed.

        `processor_time` [s]: that of a run that was computed elsewhere.
        """
        if status not in get_args(Status):
            raise ValueError(f"status = {status!r} is none of {', '.join(get_args(Status))}")
        spent = self.processor_time if processor_time is None else processor_time
        given, digests = self._digests("given"), self._digests("digests")
        fixed = {"run.toml": digests.get("run.toml") or digest_of(self.path / "run.toml")}  # as the run began
        if status == "done":
            names = sorted(path.relative_to(self.path).as_posix() for path in _numbers_in(self.path))
            fixed |= {name: digest_of(self.path / name) for name in names if name not in (*given, "run.toml")}
        now = {"status": status, "reason": reason, "updated": _now(), "processor_time": spent}
        write_json(self.path / "status.json", now | {"given": given, "digests": fixed})

    # What it holds

    def write_result(self, result: Mapping[str, Any]) -> None:
        """Write result.json (see `write_json`): what the settings determine, so no times of day or of computing."""
        self._forget_digest("result.json")
        write_json(self.path / "result.json", result)

    def read_result(self) -> dict[str, Any]:
        """The contents of result.json, material and surface by today's names.

        Raises ValueError, naming the file, where it or another of a finished run is damaged; OSError where there is
        none.
        """
        check_digests(self.path)
        return self.of_today(read_result(self.path / "result.json"))

    def of_today(self, result: dict[str, Any]) -> dict[str, Any]:
        """A result of this run, with material and surface by today's names."""
        bed, named = result.get("bed"), _of_today(result, self.format)
        return named | ({"bed": _of_today(bed, self.format)} if isinstance(bed, dict) else {})

    def write_series(self, name: str, columns: Mapping[str, Any]) -> str:
        """Write series/<name>.csv (see `write_series`); return its path relative to the folder."""
        path = self._series(name)
        file = path.relative_to(self.path).as_posix()
        self._forget_digest(file)
        write_series(path, columns)
        return file

    def read_series(self, name: str) -> dict[str, np.ndarray]:
        """The columns of series/<name>.csv."""
        return read_series(self._series(name))

    def _digests(self, table: str) -> dict[str, str]:
        """Name of a file -> digest, of a table of status.json."""
        kept = self._kept_status().get(table)
        return dict(kept) if isinstance(kept, dict) else {}

    def _forget_digest(self, name: str) -> None:
        """Take the digest of a file that is written again out of status.json; those of other files stay."""
        digests = self._digests("digests")
        if digests.pop(name, None) is not None:
            write_json(self.path / "status.json", self._kept_status() | {"digests": digests})

    def save_checkpoint(self, name: str, arrays: Mapping[str, Any]) -> None:
        """Write `arrays` (name -> array, number or text) to checkpoint/<name>.npz; the one before is kept beside it.

        Raises TypeError for anything else: a checkpoint never holds pickled objects.
        """
        stored = {key: np.asarray(value) for key, value in arrays.items()}
        for key, array in stored.items():
            if array.dtype.hasobject:
                raise TypeError(f"{key!r} in checkpoint {name!r} is neither numbers nor text: {arrays[key]!r}")
        path = self._checkpoint(name)
        with replacing(path) as temporary:
            with temporary.open("wb") as file:
                np.savez(file, **stored, **{_NAMES: np.array(sorted(stored))})  # type: ignore[arg-type]
            if path.exists():
                path.replace(self._checkpoint(name, _BEFORE))
        if self.status == "running":  # a run that is killed has its processor time until here
            self.set_status("running")

    def load_checkpoint(self, name: str) -> dict[str, np.ndarray] | None:
        """The arrays of checkpoint/<name>.npz; None where there is none.

        A damaged one is reported on stderr, and the one before it is taken; None where that one is damaged too.
        """
        for path in (self._checkpoint(name), self._checkpoint(name, _BEFORE)):
            if not path.exists():
                continue
            try:
                found = read_arrays(path)
                names = found.pop(_NAMES, None)
                if names is not None and sorted(found) != names.tolist():
                    raise ValueError(f"it holds {len(found)} arrays, {len(names)} were written")
                return found
            except (OSError, ValueError) as error:
                said = f"{path} is damaged ({error}): the work goes on from the checkpoint before it, or from its start"
                print(f"hedgebed: {said}", file=sys.stderr, flush=True)
        return None

    def drop_checkpoint(self, name: str) -> None:
        """Remove the checkpoints of that name, if there are any."""
        for before in ("", _BEFORE):
            self._checkpoint(name, before).unlink(missing_ok=True)

    def _checkpoint(self, name: str, before: str = "") -> Path:
        return self.path / "checkpoint" / f"{_checked(name)}.npz{before}"

    def mark_done(self, name: str, data: Any = None) -> None:
        """Say that the piece of work `name` is finished, with what a resumed run wants to know of it (JSON).

        A series of that name belongs to it and has been written before.
        """
        series = self._series(name)
        digests = {"data": digest_of_data(plain(data)), "series": digest_of(series) if series.exists() else None}
        write_json(self._mark(name), {"format": _DONE, "data": data, "digests": digests})

    def is_done(self, name: str) -> bool:
        """Whether `mark_done(name)` has been called, in this process or an earlier one.

        A damaged mark or series is reported on stderr, and the piece of work counts as not done.
        """
        if not self._mark(name).exists():
            return False
        try:
            self.done_data(name)
        except ValueError as error:
            if (said := f"{error}: this piece of the work is done again") not in _TOLD:
                _TOLD.add(said)
                print(f"hedgebed: {said}", file=sys.stderr, flush=True)
            return False
        return True

    def done_data(self, name: str) -> Any:
        """What `mark_done(name, data)` was given; marks of earlier versions have no digests.

        Raises ValueError, naming the file, where it or its series is damaged.
        """
        mark, series = self._mark(name), self._series(name)
        kept = read_json(mark)
        if not isinstance(kept, dict) or len(_MARK & set(kept)) < 2:
            return kept
        digests, known = kept.get("digests"), kept.get("format") == _DONE
        if not known or not isinstance(digests, dict) or digests.get("data") != digest_of_data(kept.get("data")):
            raise ValueError(f"{mark}: is not as the run wrote it: its digest differs")
        if (wanted := digests.get("series")) is not None and (not series.exists() or digest_of(series) != wanted):
            raise ValueError(f"{series}: is not as the run wrote it: its digest differs from that in {mark.name}")
        return kept.get("data")

    def noted(self, name: str, default: Any) -> Any:
        """As `done_data`; `default` where there is no such mark."""
        return self.done_data(name) if self._mark(name).exists() else default

    def _mark(self, name: str) -> Path:
        return self.path / "checkpoint" / f"{_checked(name)}.done.json"

    def _series(self, name: str) -> Path:
        return self.path / "series" / f"{_checked(name)}.csv"

    @property
    def has_work(self) -> bool:
        """Whether anything but the settings has been written: a checkpoint, a series, a result."""
        return any((self.path / name).exists() for name in ("checkpoint", "series", "frames", "result.json"))
