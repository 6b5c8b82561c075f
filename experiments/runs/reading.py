"""Settings from a case file and from the command line, checked; what is wrong with them in one sentence each.

A layer is what one source gives: name -> value. Later layers win: the defaults of the settings class, a case file,
the command line. Every fault is a ValueError whose text names the key, the value and the remedy.
"""

import re
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from difflib import get_close_matches
from pathlib import Path
from typing import Any, TypeVar, get_args

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from experiments.runs.folder import RUN_FORMATS, settings_in
from experiments.runs.strict import may_be_empty
from experiments.runs.units import find_unit, in_both
from rigid.checks import alike, nearest

__all__ = ["Layer", "find_case", "gravities_told", "option", "read_case", "settings_from"]

Settings = TypeVar("Settings", bound=BaseModel)

_VALUE = re.compile(r"[-+]?[0-9]*\.?[0-9]+([eE][-+]?[0-9]+)?[A-Za-z/0-9]*")
"""A number, maybe with a unit: no name of a case file."""
_NEAR = 4  # Most names that a message suggests for one that does not exist


@dataclass(frozen=True)
class Layer:
    """Values from one source. `source` is how messages call it; None means the command line."""

    source: str | None
    values: Mapping[str, Any] = field(default_factory=dict)

    def called(self, name: str) -> str:
        """How a person knows the setting `name` in this source: ``--spike-mass``, or ``spike_mass`` in a file."""
        return option(name) if self.source is None else f"{self.source}: {name}"


def option(name: str) -> str:
    """The command-line option of the setting `name`."""
    return "--" + name.replace("_", "-")


def find_case(given: Path, shipped: Path, commands: Iterable[str] = ()) -> Path:
    """The case file that `given` means: a path, or the name of one in the folder `shipped`.

    Raises ValueError naming those that ship and are spelt like it, or where none is, those of the folder itself. A word
    of `commands` that is spelt like it is named first, since it may stand in the same place.
    """
    if given.is_file():
        return given
    if given.parent == Path():
        for named in (shipped / f"{given}.toml", *sorted(shipped.glob(f"*/{given.name}.toml"))):
            if named.is_file():
                return named
    if meant := get_close_matches(str(given), list(commands), n=1):
        raise ValueError(f"{str(given)!r} is neither a command nor a file; did you mean {meant[0]!r}?")
    if _VALUE.fullmatch(str(given)):
        raise ValueError(
            f"{str(given)!r} is a number, no case file: an option before it takes one value, unless its help shows more"
        )
    own = given if given.suffix else given.with_suffix(".toml")
    if own.parent.is_dir() and (meant_file := alike(own)):
        raise ValueError(f"case = {str(given)!r}: there is no such file{meant_file}")
    names = sorted(path.stem for path in shipped.glob("*.toml"))
    below = sorted(path.stem for path in shipped.glob("*/*.toml"))
    if close := get_close_matches(given.name.removesuffix(".toml"), [*names, *below], n=_NEAR):
        also = f"; cases of names near it that ship are {', '.join(close)}"
    else:
        also = f"; the cases that ship are {', '.join(names)}" if names else ""
        also += f", and {len(below)} that `hedgebed experiments list` names" if below else ""
    raise ValueError(f"case = {str(given)!r} is no file: give the path of a TOML file{also}")


def read_case(path: Path) -> Layer:
    """The settings in the TOML file `path`: a flat table, or the ``[settings]`` of a run folder's run.toml.

    Raises ValueError if it cannot be read or is not TOML.
    """
    try:
        table = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ValueError(f"case = {str(path)!r} cannot be read: {error.strerror}") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ValueError(f"case = {str(path)!r} is not TOML: {error}") from None
    if table.get("format") in RUN_FORMATS and isinstance(table.get("settings"), dict):
        table = settings_in(table)
    return Layer(str(path), table)


def settings_from(settings_class: type[Settings], layers: Iterable[Layer]) -> Settings:
    """The settings that the `layers` give, later ones over earlier ones, over the defaults.

    A number may be text with a unit (`experiments.runs.units`). Raises ValueError, one sentence a line. An unknown name
    is answered with the nearest known one, a value that is not accepted with the accepted ones. TOML has no null:
    "none" unsets a setting that need not be set.
    """
    names = list(settings_class.model_fields)
    faults = []
    merged: dict[str, Any] = {}
    origin: dict[str, Layer] = {}
    for layer in layers:
        for name, value in layer.values.items():
            if name not in names:
                faults.append(f"{layer.called(name)} = {value!r} is no setting; {nearest(name, names)}")
            else:
                merged[name] = _unset(settings_class, name) if value == "none" else value
                origin[name] = layer
    if faults:
        raise ValueError("\n".join(faults))
    try:
        return settings_class(**merged)
    except ValidationError as error:
        sentences = [_sentence(settings_class, detail, origin) for detail in error.errors() if not _follows(detail)]
        raise ValueError("\n".join(dict.fromkeys(sentences))) from None


def gravities_told(settings: BaseModel, layers: Iterable[Layer]) -> Iterator[str]:
    """What the gravities that the `layers` give mean in m/s2 and in g, a sentence each: their units differ."""
    given = {name for layer in layers for name in layer.values}
    for name, described in type(settings).model_fields.items():
        if name in given:
            yield from in_both(name, getattr(settings, name), find_unit(described.description))


def _unset(settings_class: type[BaseModel], name: str) -> Any:
    """What "none" means for the setting `name`: None, a list of nothing, or where it must be set, the word itself."""
    described = settings_class.model_fields[name]
    if type(None) in get_args(described.annotation):
        return None
    return () if may_be_empty(described) else "none"


def _follows(detail: ErrorDetails) -> bool:
    """Whether a fault is but the echo of another: a list too short because one of its values would not do."""
    return detail["type"] == "too_short" and len(detail["input"]) >= detail["ctx"]["min_length"]


def _sentence(settings_class: type[BaseModel], detail: ErrorDetails, origin: Mapping[str, Layer]) -> str:
    """One fault that pydantic found, as a sentence."""
    message = detail["msg"].removeprefix("Value error, ").removeprefix("Assertion failed, ")
    location = detail["loc"]
    if not location:
        return message  # a check of several settings together: its text names them
    name = str(location[0])
    called = origin[name].called(name) if name in origin else name
    inside = "".join(f"[{part}]" for part in location[1:] if isinstance(part, int))
    described = settings_class.model_fields[name].description if name in settings_class.model_fields else None
    if detail["type"] == "missing":
        said = f"{option(name)} must be given"
    elif detail["type"] == "too_short" and not detail["input"]:
        said = f"{called} is empty: give at least one"
    else:
        said = f"{called}{inside} = {detail['input']!r} is not accepted: {message[:1].lower() + message[1:]}"
    return f"{said} ({described.strip().rstrip('.')})" if described else said
