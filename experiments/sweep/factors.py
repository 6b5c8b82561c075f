"""What is varied: lists, ranges and intervals as they are typed, and the rows of a table."""

import csv
import math
import re
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from pydantic import BaseModel

from experiments.runs.reading import nearest
from experiments.runs.strict import plain_kinds
from experiments.runs.units import find_unit, has_unit
from rigid.checks import why_unread

__all__ = ["Factor", "parse_fixed", "parse_over", "read_table", "unit_of", "words_of"]

MOST_VALUES = 100_000
_LONGEST = 60  # letters of a name in a table or on an axis
_ACCEPTED = "[VALUE, VALUE], FROM:TO:STEP, FROM:TO or FROM:TO:log are accepted"


@dataclass(frozen=True)
class Factor:
    """One setting that is varied: its values, or the interval that it is sampled from."""

    key: str
    values: tuple[object, ...] = ()
    low: float = math.nan
    high: float = math.nan
    log: bool = False

    @property
    def sampled(self) -> bool:
        """Whether it is an interval."""
        return not self.values

    def at(self, share: float) -> float:
        """The value at a share of the interval, 0 to 1."""
        if self.log:
            return self.low * (self.high / self.low) ** share
        return self.low + share * (self.high - self.low)


def parse_fixed(texts: Sequence[str], settings_class: type[BaseModel]) -> Mapping[str, object]:
    """Setting -> value of ``KEY=VALUE`` texts. Raises ValueError for a key there is not, or one given twice."""
    found: dict[str, object] = {}
    for text in texts:
        key, value = _pair("fixed", text, settings_class)
        if key in found:
            raise ValueError(f"fixed has {key} twice: give each key once")
        found[key] = value
    return found


def parse_over(texts: Sequence[str], settings_class: type[BaseModel]) -> tuple[Factor, ...]:
    """The factors of ``KEY=VALUES`` texts. Raises ValueError, naming text and key, for what is none."""
    factors: list[Factor] = []
    for text in texts:
        key, value = _pair("over", text, settings_class)
        if key in {factor.key for factor in factors}:
            raise ValueError(f"over has {key} twice: give each key once")
        factors.append(_factor(text, key, value, settings_class))
    return tuple(factors)


def read_table(path: str, settings_class: type[BaseModel]) -> Sequence[Mapping[str, object]]:
    """The rows of a CSV file of settings: setting -> value each, without what a row leaves empty.

    Raises ValueError, naming file and line, for what is no table of settings.
    """
    try:
        with Path(path).open(newline="", encoding="utf-8") as file:
            numbered = [(number, row) for number, row in enumerate(csv.reader(file), 1) if any(map(str.strip, row))]
    except OSError as error:
        raise ValueError(f"table = {path!r} cannot be read: {why_unread(path, error)}") from None
    except (UnicodeDecodeError, csv.Error) as error:
        raise ValueError(f"table = {path!r} is no CSV file: {error}") from None
    if len(numbered) < 2:
        raise ValueError(f"table = {path!r} has no rows: expected a head that names settings, and a row for each run")
    head = [cell.strip() for cell in numbered[0][1]]
    for key in head:
        _check_key(f"table = {path!r}", key, settings_class)
    if len(set(head)) < len(head):
        raise ValueError(f"table = {path!r} names a setting twice in its head: give each once")
    rows = []
    for number, cells in numbered[1:]:
        if len(cells) != len(head):
            raise ValueError(f"{path}:{number}: {len(cells)} cells where the head has {len(head)}")
        rows.append({key: _value(cell) for key, cell in zip(head, map(str.strip, cells), strict=True) if cell})
    return rows


def unit_of(key: str, settings_class: type[BaseModel]) -> str:
    """The unit that the description of a setting states; empty where it states none."""
    described = settings_class.model_fields[key].description or ""
    last = described.rpartition("[")[2].partition("]")[0] if "[" in described else ""
    return "" if last == "1" else last


def words_of(key: str, settings_class: type[BaseModel]) -> str:
    """A setting as tables and plots name it: the start of its help, "friction coefficient between spike and grains".

    Without a unit in its help, or where that is long, it is the key with blanks.
    """
    words, unit, _ = (settings_class.model_fields[key].description or "").replace("\n", " ").partition(" [")
    words = re.split("[;,]", re.sub(r"^[A-Z][\w ,]*: ", "", words))[0]
    if not unit or len(words) > _LONGEST:
        return key.replace("_", " ")
    return words if words.startswith("Young") else words[:1].lower() + words[1:]


def _pair(where: str, text: str, settings_class: type[BaseModel]) -> tuple[str, object]:
    key, equals, value = text.partition("=")
    if not equals or not value.strip():
        raise ValueError(f"{where} = {text!r} gives no value: KEY=VALUE is accepted")
    name = key.strip().replace("-", "_")
    _check_key(f"{where} = {text!r}", name, settings_class)
    return name, _value(value.strip())


def _check_key(where: str, key: str, settings_class: type[BaseModel]) -> None:
    if not key:
        raise ValueError(f"{where}: a column of its head has no name; expected the name of a setting")
    if key not in settings_class.model_fields:
        raise ValueError(f"{where}: {key} is no setting; {nearest(key, settings_class.model_fields)}")


def _value(text: str) -> object:
    """What a text means: a number, a truth value, a list or a text in quotes, as in TOML; other text is itself."""
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        return text


def _factor(text: str, key: str, value: object, settings_class: type[BaseModel]) -> Factor:
    where = f"over = {text!r}"
    if isinstance(value, list):
        if not value:
            raise ValueError(f"{where} is an empty list: {_ACCEPTED}")
        if any(value.count(item) > 1 for item in value):
            raise ValueError(f"{where} has a value twice: give each once")
        return Factor(key, tuple(value))
    words = value.split(":") if isinstance(value, str) else []
    log = words[2:] == ["log"]
    numbers = [_number(where, key, word, settings_class) for word in (words[:2] if log else words)]
    if len(numbers) not in (2, 3):
        raise ValueError(f"{where} is neither a list nor a range: {_ACCEPTED}; one value belongs to fixed")
    if not numbers[0] < numbers[1] or (log and numbers[0] <= 0):
        raise ValueError(f"{where} goes nowhere: FROM below TO{', and above 0,' if log else ''} are accepted")
    whole = int in (kinds := plain_kinds(settings_class.model_fields[key].annotation)) and float not in kinds
    if len(numbers) == 2:
        if whole:
            raise ValueError(f"{where}: {key} is a whole number, which is not sampled: FROM:TO:STEP is accepted")
        return Factor(key, (), numbers[0], numbers[1], log)
    low, high, step = numbers
    if step <= 0 or (high - low) / step > MOST_VALUES:
        raise ValueError(f"{where}: STEP = {step:g} would not do: above 0, for at most {MOST_VALUES:,} values, would")
    count = math.floor((high - low) / step * (1 + 1e-12) + 1e-9) + 1
    values = [float(f"{low + k * step:.12g}") for k in range(count)]
    return Factor(key, tuple(int(item) if whole and item.is_integer() else item for item in values))


def _number(where: str, key: str, word: str, settings_class: type[BaseModel]) -> float:
    """A number of a range, with a unit or without one, in the unit of the setting."""
    word = word.strip()
    unit = find_unit(settings_class.model_fields[key].description)
    try:
        number = unit.value_of(word) if unit is not None and has_unit(word) else float(word)
    except ValueError:
        raise ValueError(f"{where}: {word!r} is no number of a range: {_ACCEPTED}") from None
    if not math.isfinite(number):
        raise ValueError(f"{where}: {word!r} is no finite number")
    return number
