"""The result of a run: result.json as a model, with the one writer and the one reader.

```
result = Result.load("runs/first")
result.quantities["stiffness"].value, result["quantities"]["stiffness"]["value"]  # the same number
result.to_dataframe()
```
result.schema.json beside this file is its JSON schema: ``python -m experiments.runs.result`` prints it.
"""

import json
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, PrivateAttr, StrictFloat, StrictInt, ValidationError, model_validator

from experiments.runs.folder import plain, write_json
from experiments.runs.types import Json
from experiments.runs.version import __version__
from rigid.series import RESULT_FORMAT, ResultFormat, Series, pandas

__all__ = ["Departures", "Quantity", "Result", "Series", "Table", "quantities_of", "quantity", "schema"]

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
        """The result in a run folder, or the file itself. Raises ValueError, naming file and key, for none."""
        path = Path(folder) / "result.json" if Path(folder).is_dir() else Path(folder)
        try:
            return cls._checked(json.loads(path.read_text(encoding="utf-8")), str(path))
        except OSError as error:
            raise ValueError(f"{path}: cannot be read: {error.strerror}") from None
        except json.JSONDecodeError as error:
            raise ValueError(f"{path}: is no JSON: {error}") from None

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


if __name__ == "__main__":
    print(schema(), end="")
