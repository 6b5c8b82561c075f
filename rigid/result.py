"""The result of a run: result.json as a model, with the one writer and the one reader; files of JSON and TOML.

```
result = Result.load("runs/first")
result.quantities["stiffness"].value, result["quantities"]["stiffness"]["value"]  # the same number
result.to_dataframe()
```
Its JSON schema is experiments/runs/result.schema.json: ``python -m experiments.runs.result`` prints it.
"""

import json
import math
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, PrivateAttr, StrictFloat, StrictInt, ValidationError, model_validator

from .digests import check_digests
from .series import RESULT_FORMAT, ResultFormat, pandas, replacing
from .version import __version__

__all__ = [
    "Departures", "Quantity", "Result", "Table", "plain", "quantities_of", "quantity",
    "read_json", "read_result", "schema", "toml_value", "write_json", "write_text",
]  # fmt: skip

Json = dict[str, Any]
Number = StrictInt | StrictFloat | None


class _Entries(Mapping[str, Any], BaseModel):
    """A model that is looked up by key too, and keeps the keys it was made with in their order."""

    model_config = ConfigDict(extra="allow", frozen=True)
    _keys: tuple[str, ...] = PrivateAttr(())

    @model_validator(mode="wrap")
    @classmethod
    def _in_order(cls, given: Any, handler: Callable[[Any], Self]) -> Self:
        made = handler(given)
        if made is not given:
            made._keys = tuple(given)
        return made

    def __getitem__(self, key: str) -> Any:
        if key not in self._keys:
            raise KeyError(key)
        extra = self.__pydantic_extra__ or {}
        return extra[key] if key in extra else self.__dict__[key]

    def __iter__(self) -> Iterator[str]:  # type: ignore[override]
        return iter(self._keys)

    def __len__(self) -> int:
        return len(self._keys)


class Quantity(_Entries):
    """A number that a person would quote."""

    value: Annotated[Number, Field(description="In `unit`; null where there is none.")]
    std: Annotated[Number, Field(description="Spread between seeds: 0 for what is exact, null where unknown.")]
    unit: Annotated[str, Field(description='SI; "1" for a pure number.')]
    note: str = ""
    interval: Annotated[
        list[float] | None, Field(min_length=2, max_length=2, description="90 % interval, where one is known.")
    ] = None


class Departures(_Entries):
    """What the run says in sentences; further entries are the experiment's own."""

    sentences: list[str]


class Table(_Entries):
    """A table that the terminal shows below the quantities."""

    title: str
    head: list[str]
    rows: list[list[Any]]


class Result(_Entries):
    """The contents of result.json; entries beside these are the experiment's own (docs/architecture.md)."""

    format: ResultFormat
    experiment: Annotated[str, Field(description="The command that made it.")]
    version: str
    code: Annotated[str, Field(description="Digest of the code that computed the grains.")] = ""
    title: str
    status: Literal["done", "stopped"]
    quantities: dict[str, Quantity]
    departures: Departures | None = None
    tables: list[Table] = []
    runs: list[dict[str, Any]] = []
    warnings: list[str] = []

    @classmethod
    def make(cls, experiment: str, /, **entries: Any) -> Self:
        """The result of a finished run of `experiment`, its entries in the order in which they are given.

        Numpy scalars and arrays, paths and models become what JSON knows, NaN and infinities become null. `version`
        and `status` ("done") need not be given. Raises ValueError, naming the key, for what result.json may not hold.
        """
        whole: Json = {"format": RESULT_FORMAT, "experiment": experiment}
        if "version" not in entries:
            whole["version"] = __version__
        for key, value in entries.items():
            whole |= {key: value, "status": "done"} if key == "title" else {key: value}
        return cls._checked(plain(whole), f"the result of {experiment}")

    @classmethod
    def load(cls, folder: str | Path) -> Self:
        """The result in a run folder, or the file itself.

        Raises ValueError, naming file and key, for none, and for one that is damaged.
        """
        path = Path(folder) / "result.json" if Path(folder).is_dir() else Path(folder)
        try:
            entries = read_result(path)
        except OSError as error:
            raise ValueError(f"{path}: cannot be read: {error.strerror}") from None
        return cls._checked(entries, str(path))

    @classmethod
    def _checked(cls, entries: Any, where: str) -> Self:
        try:
            return cls.model_validate(entries)
        except ValidationError as error:
            faults = (f"{where}: {'.'.join(map(str, fault['loc']))}: {fault['msg']}" for fault in error.errors())
            raise ValueError("\n".join(faults)) from None

    def write(self, folder: str | Path) -> Path:
        """Write result.json into `folder`, all of it or nothing; return its path."""
        path = Path(folder) / "result.json"
        write_json(path, self)
        return path

    def to_dataframe(self) -> Any:
        """The quantities as a pandas.DataFrame, a row each: value, std, unit, note. Raises ImportError without it."""
        columns = list(Quantity.model_fields)
        rows = [[getattr(entry, column) for column in columns] for entry in self.quantities.values()]
        return pandas().DataFrame(rows, index=list(self.quantities), columns=columns)


def quantity(value: float | None, unit: str, note: str = "", *, std: float | None = 0.0) -> Json:
    """A quantity as an entry of a result. `std`: 0 where nothing else is given, and null without a value."""
    entry: Json = {"value": value, "std": None if value is None else std, "unit": unit}
    return entry | {"note": note} if note else entry


def quantities_of(found: Mapping[str, tuple[float | None, str, str]], *, std: float | None = 0.0) -> dict[str, Json]:
    """Name -> (value, unit, note) as entries of a result, all with the same `std`."""
    return {name: quantity(value, unit, note, std=std) for name, (value, unit, note) in found.items()}


def schema() -> str:
    """The text of result.schema.json."""
    return json.dumps(Result.model_json_schema(), indent=2) + "\n"


def write_text(path: Path, text: str) -> None:
    """Write `text` to `path` (UTF-8), all of it or nothing."""
    with replacing(Path(path)) as temporary:
        temporary.write_text(text, encoding="utf-8")


def plain(value: Any) -> Any:
    """`value` in terms of what JSON knows; a number that is not finite becomes null."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, BaseModel):
        return plain(value.model_dump())
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, np.generic):
        return plain(value.item())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, list | tuple | set | frozenset):
        return [plain(item) for item in value]
    if isinstance(value, Path):
        return str(value)
    return value


def write_json(path: Path, data: Any) -> None:
    """Write `data` to `path` as JSON, all of it or nothing.

    Takes numpy scalars and arrays, paths and pydantic models as well; NaN and infinities become null. Raises TypeError
    for what JSON cannot hold.
    """
    write_text(path, json.dumps(plain(data), indent=2, allow_nan=False, ensure_ascii=False) + "\n")


def read_json(path: Path) -> Any:
    """The contents of the JSON file `path`. Raises ValueError, naming it, for one that is damaged; OSError for none."""
    try:
        return json.loads(Path(path).read_text(encoding="utf-8"))
    except (ValueError, RecursionError) as error:
        raise ValueError(f"{path}: is no JSON: {error}") from None


def read_result(path: Path) -> Json:
    """The contents of a result.json. Raises ValueError, naming it, for one that is damaged; OSError for none."""
    entries = read_json(path)
    if not isinstance(entries, dict):
        raise ValueError(f"{path}: holds {type(entries).__name__}, a table was expected")
    check_digests(path.parent, path.name)
    return entries


def toml_value(value: Any) -> str:
    """`value` as TOML writes it."""
    import tomlkit  # where the first file is written: the command line starts without it

    if isinstance(value, list | tuple):
        return "[" + ", ".join(toml_value(item) for item in value) + "]"
    if isinstance(value, Mapping):  # keys in quotes; tomlkit writes them bare
        return "{" + ", ".join(f"{toml_value(str(key))} = {toml_value(item)}" for key, item in value.items()) + "}"
    try:
        return tomlkit.item(str(value) if isinstance(value, Path) else value).as_string()
    except (TypeError, ValueError):
        raise TypeError(f"a setting of type {type(value).__name__} cannot be written to run.toml: {value!r}") from None
