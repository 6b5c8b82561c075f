"""Campaigns and models as files: read, checked, written. The format is in docs/campaigns.md.

```
campaign = read_campaign("brick")                 # a folder with campaign.toml and one CSV file per sensor and trial
campaign.tables.platform.mass                     # the tables, by their names in the file
campaign.recording("001", "pose")["theta_rad"]    # arrays, in the format's units
write_campaign("copy", campaign)                  # reading it returns equal values
model = read_model("model.toml")                  # the same tables with [[effect]]
```
"""

import shutil
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np
from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from experiments.runs.folder import toml_value, write_text
from experiments.runs.given import keep_given, kept_copy
from rigid.checks import alike, nearest, why_unread
from rigid.checks.shipped import find_shipped
from rigid.digests import check_as_written

from .digests import changed_files, write_digests
from .from_folder import Found, campaign_from_folder
from .recording import Recording, read_recording, write_recording
from .tables import (
    NOTE_WORDS,
    PenetrationCampaign,
    PenetrationModel,
    PenetrationTrial,
    TumbleCampaign,
    TumbleModel,
    TumbleTrial,
    trial_faults,
)

__all__ = [
    "Campaign",
    "MODEL_COPY",
    "TEMPLATES",
    "check_target",
    "keep_digests",
    "keep_model",
    "new_campaign",
    "new_from_recordings",
    "place_campaign",
    "read_campaign",
    "read_model",
    "write_campaign",
    "write_model",
]

MODEL_COPY = "model.toml"
"""The model that was run, in the run's folder; effects of one's own are beside it."""
TEMPLATES = Path(__file__).resolve().parent.parent / "examples"
_LISTED = 12
"""Files with the same fault that are named; of the rest the number."""
_CAMPAIGNS: dict[str, type[BaseModel]] = {"tumble": TumbleCampaign, "penetration": PenetrationCampaign}
_MODELS: dict[str, type[BaseModel]] = {"tumble": TumbleModel, "penetration": PenetrationModel}


@dataclass(frozen=True)
class Campaign:
    """Measured trials: the tables of campaign.toml, and the recordings by (id of the trial, sensor). The sensors of a
    tumble are ``pose``, ``imu`` and ``wheel``; that of a penetration is ``data``."""

    tables: TumbleCampaign | PenetrationCampaign
    recordings: Mapping[tuple[str, str], Recording] = field(repr=False)
    folder: Path | None = None  # where it was read from

    def recording(self, trial: str, sensor: str) -> Recording | None:
        """What a sensor recorded in the trial of this id; None where it has none. Raises KeyError for an unknown id."""
        if trial not in {known.id for known in self.tables.trial}:
            raise KeyError(f"there is no trial {trial!r} in the campaign {self.tables.name!r}")
        return self.recordings.get((trial, sensor))


def read_campaign(folder: str | Path) -> Campaign:
    """Read the campaign in `folder`, or the one of this name that ships. Raises ValueError with all faults of the
    tables and of every file that can be found, a sentence on a line each. A sentence names the file, the line or key,
    what was found and what was expected. It also names each file that differs from its digest, where the folder has
    digests."""
    folder = _find_campaign(folder)
    path = folder / "campaign.toml"
    if not path.exists() and (within := folder / "campaign").joinpath("campaign.toml").exists():
        raise ValueError(f"{str(folder)!r} is a run folder: its campaign is {str(within)!r}")
    table = _read_toml(path, _CAMPAIGNS)
    tables, faults = _make_tables(path, table, _CAMPAIGNS)
    if tables is None:
        trials = _valid_trials(table)
        sensors = table.get("sensors")
        named = sensors if isinstance(sensors, dict) else {key for _, trial in trials for key in trial.needed}
        faults += [f"{path}: {fault}" for fault in trial_faults(trials, set(named))]
    else:
        assert isinstance(tables, TumbleCampaign | PenetrationCampaign)
        trials = list(enumerate(tables.trial, 1))
    recordings, of_files = {}, dict[str, list[str]]()
    for _, trial in trials:
        for sensor, name in trial.files.items():
            try:
                recordings[trial.id, sensor] = read_recording(folder / name, trial.columns(sensor))
            except ValueError as error:
                for line in str(error).splitlines():
                    of_files.setdefault(line.removeprefix(str(folder / name)), []).append(name)
    faults += [f"{_files_words(folder, names)}{fault}" for fault, names in of_files.items()]
    recorded = [name for _, trial in trials for name in trial.files.values()]
    faults += changed_files(folder, ["campaign.toml", *recorded])
    if faults or tables is None:
        raise ValueError("\n".join(dict.fromkeys(faults)))
    return Campaign(tables, recordings, folder)


def _files_words(folder: Path, names: Sequence[str]) -> str:
    """The files of one fault: a path, or the folder with the names of several."""
    names = list(dict.fromkeys(names))
    if len(names) == 1:
        return str(folder / names[0])
    listed = ", ".join(names[:_LISTED]) + (f" and {len(names) - _LISTED} more" if len(names) > _LISTED else "")
    return f"{folder}: {len(names)} files alike ({listed})"


def _find_campaign(given: str | Path) -> Path:
    shipped = {path.parent.name: path.parent for path in sorted(TEMPLATES.glob("*/campaign.toml"))}
    if found := find_shipped(given, shipped, folder=True):
        return found
    beside = alike(given, folders=True) or f", or one that ships: {nearest(str(given), shipped)}"
    raise ValueError(f"{str(given)!r} is no folder: one with campaign.toml was expected{beside}")


def write_campaign(folder: str | Path, campaign: Campaign) -> Path:
    """Write a campaign with its digests into `folder`, which must be new or empty, and return it. Raises ValueError
    where the folder is in use or a file that a trial names has no recording."""
    folder = Path(folder)
    _refuse_used(folder)
    for trial in campaign.tables.trial:
        for sensor, name in trial.files.items():
            recording = campaign.recordings.get((trial.id, sensor))
            if recording is None:
                raise ValueError(f"trial {trial.id!r} names {sensor} = {name!r}, but there is no recording of it")
            write_recording(folder / name, recording)
    write_text(folder / "campaign.toml", _tables_toml(campaign.tables))  # without it there is no campaign
    keep_digests(folder, campaign)
    return folder


def keep_digests(folder: str | Path, campaign: Campaign) -> None:
    """Write the digests of the campaign in `folder`, so that `read_campaign` refuses a file that changes later."""
    names = [name for trial in campaign.tables.trial for name in trial.files.values()]
    write_digests(Path(folder), ["campaign.toml", *names])


def _used(path: Path) -> bool:
    return path.exists() and (not path.is_dir() or any(path.iterdir()))


def _refuse_used(folder: Path) -> None:
    if _used(folder):
        raise ValueError(f"{str(folder)!r} is in use: a folder that is empty or does not exist yet was expected")


def new_campaign(folder: str | Path, *, kind: Literal["tumble", "penetration"]) -> Path:
    """Write the template of a campaign of this kind into `folder`, and return it: annotated tables, short recordings.

    The recordings are synthetic, from the base model, so that the template can be checked and diagnosed unchanged.
    Raises ValueError for an unknown kind, and where the folder is in use or cannot be written.
    """
    folder = Path(folder)
    if kind not in _CAMPAIGNS:
        raise ValueError(f"kind = {kind!r}: {' or '.join(map(repr, _CAMPAIGNS))} was expected")
    _refuse_used(folder)
    try:
        shutil.copytree(TEMPLATES / f"template-{kind}", folder, dirs_exist_ok=True)
    except OSError as error:
        raise ValueError(f"{str(folder)!r} cannot be written ({error}): a folder that can be was expected") from error
    return folder


def new_from_recordings(folder: str | Path, source: str | Path) -> Found:
    """Write a campaign of the pushes and drops in the CSV files of `source` into `folder`, and return what was found.

    Columns are recognised by their headings. What the recordings do not show is "unknown" in campaign.toml. Raises
    ValueError where the folder is in use, where there is no recording, and where one cannot be read.
    """
    folder = Path(folder)
    _refuse_used(folder)
    return campaign_from_folder(folder, Path(source))


def check_target(target: str | Path, *, keep_out: Path | None = None) -> Path:
    """The folder to write a campaign into. Raises ValueError where it is in use, or is, or lies around, `keep_out`."""
    path = Path(target)
    if _used(path):
        raise ValueError(f"campaign = {str(path)!r} is in use: an empty or new folder is accepted")
    if keep_out is not None and keep_out.resolve().is_relative_to(path.resolve()):
        raise ValueError(
            f"campaign = {str(path)!r} holds the run's own folder {str(keep_out)!r}, where the truth is kept: another "
            f"folder is accepted"
        )
    return path


def place_campaign(target: str | Path, campaign: Campaign, *, keep_out: Path | None = None) -> Path:
    """Write `campaign` to `target`, unless just that is there already (of a run that is resumed); return the folder.
    Raises ValueError as `check_target` does, where something else is there."""
    path = Path(target)
    try:
        same = _same(read_campaign(path), campaign)
    except ValueError:
        same = False
    if not same:
        write_campaign(check_target(path, keep_out=keep_out), campaign)
    return path


def _same(one: Campaign, other: Campaign) -> bool:
    alike = one.tables == other.tables and one.recordings.keys() == other.recordings.keys()
    return alike and all(
        np.array_equal(one.recordings[key][name], recording[name], equal_nan=True)
        for key, recording in other.recordings.items()
        for name in recording.columns
    )


def read_model(path: str | Path) -> TumbleModel | PenetrationModel:
    """Read a model.toml. Raises ValueError as `read_campaign` does; and where it, or an effect beside it, is of a run
    and is not as the run wrote it."""
    check_as_written(Path(path))
    model, faults = _make_tables(Path(path), _read_toml(Path(path), _MODELS), _MODELS)
    if model is None:
        raise ValueError("\n".join(faults))
    assert isinstance(model, TumbleModel | PenetrationModel)
    for effect in model.effect:
        if effect.file is not None:
            check_as_written(Path(path).parent / effect.file)
    return model


def write_model(path: str | Path, model: TumbleModel | PenetrationModel) -> None:
    """Write a model.toml, which reads back as the same."""
    write_text(Path(path), _tables_toml(model))


def keep_model(model: str | Path | None, folder: Path, name: str = MODEL_COPY) -> Path | None:
    """Copy a model.toml and the files of its effects into a run's folder, once; return the copy, None for no model.

    ``name``: Of the copy.

    Raises ValueError as `read_model` does, and where a copy is damaged."""
    if model is None:
        return None
    source = Path(model)
    if (copy := kept_copy(folder, name)) is None:
        for effect in read_model(source).effect:
            if effect.file is not None:
                keep_given(folder, effect.file, (source.parent / effect.file).read_bytes())
        copy = keep_given(folder, name, source.read_bytes())
    return copy


def _read_toml(path: Path, kinds: Mapping[str, type[BaseModel]]) -> dict[str, Any]:
    """The file as TOML has it, its kind being one of `kinds`."""
    try:
        table = tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except OSError as error:
        raise ValueError(f"{path}: {why_unread(path, error)}") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ValueError(f"{path}: is not TOML: {error}") from None
    kind = table.get("kind")
    if not isinstance(kind, str) or kind not in kinds:
        found = "is missing" if kind is None else f"= {kind!r}"
        raise ValueError(f"{path}: kind {found}; {' or '.join(map(repr, kinds))} was expected")
    return table


def _make_tables(
    path: Path, table: Mapping[str, Any], kinds: Mapping[str, type[BaseModel]]
) -> tuple[BaseModel | None, list[str]]:
    """The tables, or None and what is wrong with them, a sentence each."""
    tables = kinds[table["kind"]]
    frozen = {key: value if key == "notes" else _tuples(value) for key, value in table.items()}
    try:
        return tables(**frozen), []
    except ValidationError as error:
        # Trials that are all refused leave pydantic with none: that there are none is not what is wrong.
        found = [detail for detail in error.errors() if not (detail["loc"] == ("trial",) and table.get("trial"))]
        lines = [line for detail in found for line in _sentence(tables, detail, table).splitlines()]
        return None, [f"{path}: {line}" for line in dict.fromkeys(lines)]


def _valid_trials(table: Mapping[str, Any]) -> list[tuple[int, Any]]:
    """Of tables with faults, the trials that have none of their own: (number in the file, trial)."""
    trial_class = TumbleTrial if table["kind"] == "tumble" else PenetrationTrial
    listed = table.get("trial")
    found = []
    for number, raw in enumerate(listed if isinstance(listed, list) else [], 1):
        try:
            found.append((number, trial_class.model_validate(_tuples(raw))))
        except ValidationError:
            continue  # reported already
    return found


def _tuples(value: Any) -> Any:
    """`value` with tuples for lists, at every depth."""
    if isinstance(value, list):
        return tuple(_tuples(item) for item in value)
    return {key: _tuples(item) for key, item in value.items()} if isinstance(value, dict) else value


def _sentence(tables: type[BaseModel], detail: ErrorDetails, table: Mapping[str, Any]) -> str:
    """One fault that pydantic found, as a sentence: where, what was found, what was expected."""
    location, kind = list(detail["loc"]), detail["type"]
    message = detail["msg"].removeprefix("Value error, ")
    model, where, key = _walk(tables, location, table)
    if kind == "value_error" and key is None:
        return f"{where}: {message}" if where else message
    place = f"{where} {key}" if where else str(key)
    if kind == "extra_forbidden":
        names = list(model.model_fields) if model is not None else []
        return f"{place} = {_short(detail['input'])} is an unknown key; {nearest(str(key), names)}"
    field = model.model_fields.get(str(key).split("[")[0]) if model is not None else None
    expected = (field.description if field is not None else None) or message
    if kind == "missing":
        return f"{place} is missing; {expected} was expected"
    if key == "trial" and kind == "too_short":
        return "there is no [[trial]] at all; at least one was expected"
    reason = "" if kind == "literal_error" else f" ({message[:1].lower() + message[1:]})"
    return f"{place} = {_short(detail['input'])}; {expected} was expected{reason}"


def _walk(
    tables: type[BaseModel], location: list[int | str], table: Mapping[str, Any]
) -> tuple[type[BaseModel] | None, str, str | None]:
    """The model that a fault is in, its place as the file has it, and the key (None: the table itself)."""
    model: type[BaseModel] | None = tables
    names: list[str] = []
    where = ""
    value: Any = table
    while location:
        field = model.model_fields.get(str(location[0])) if model is not None else None
        inner = _table_in(field.annotation) if field is not None else None
        if inner is None or (len(location) == 1 and not isinstance(_get(value, location[0]), dict)):
            index = "".join(f"[{part}]" for part in location[1:])
            return model, where, f"{location[0]}{index}"
        name = str(location.pop(0))
        value = _get(value, name)
        names.append(name)
        if location and isinstance(location[0], int):
            number = int(location.pop(0))
            value = value[number] if isinstance(value, list) and number < len(value) else None
            called = f" (id {value['id']!r})" if isinstance(value, dict) and isinstance(value.get("id"), str) else ""
            where = f"[[{'.'.join(names)}]] {number + 1}{called}"
        else:
            where = f"[{'.'.join(names)}]"
        model = inner
    return model, where, None


def _get(value: Any, key: int | str) -> Any:
    return value.get(key) if isinstance(value, dict) else None


def _table_in(hint: Any) -> type[BaseModel] | None:
    """The model inside an annotation, None where there is none."""
    if isinstance(hint, type) and issubclass(hint, BaseModel):
        return hint
    return next((found for item in get_args(hint) if (found := _table_in(item)) is not None), None)


def _short(value: Any) -> str:
    text = repr(list(value)) if isinstance(value, tuple) else repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


def _tables_toml(tables: BaseModel) -> str:
    """The tables as TOML, each number with its meaning in a comment; what is not set is left out."""
    plain, nested, listed = [], [], []
    for name, value in tables:
        if name == "notes":
            if value:
                listed.append(_notes_toml(value))
        elif isinstance(value, BaseModel):
            nested += _table_toml(name, value)
        elif name in ("trial", "effect"):
            listed += ["\n".join([f"[[{name}]]", *_lines(item)]) for item in value]
        elif value is not None:
            plain.append(f"{name} = {toml_value(value)}")
    return "\n\n".join(["\n".join(plain), *nested, *listed]) + "\n"


def _notes_toml(notes: Mapping[str, Any]) -> str:
    """The notes; what a fit leaves is a table of its own, with a comment and a line for each entry."""
    plain = {key: item for key, item in notes.items() if key not in NOTE_WORDS or not isinstance(item, Mapping)}
    blocks = ["\n".join(["[notes]", *(f"{toml_value(str(key))} = {toml_value(item)}" for key, item in plain.items())])]
    for key in notes:
        if key not in plain:
            lines = [f"{toml_value(str(name))} = {_rows(item)}" for name, item in notes[key].items()]
            blocks.append("\n".join([f"# {NOTE_WORDS[key]}", f"[notes.{key}]", *lines]))
    return "\n\n".join(blocks)


def _rows(value: Any) -> str:
    """A value as TOML, a list of lists with a line for each of these."""
    if isinstance(value, list | tuple) and value and all(isinstance(row, list | tuple) for row in value):
        return "\n".join(["[", *(f"  {toml_value(row)}," for row in value), "]"])
    return toml_value(value)


def _table_toml(name: str, table: BaseModel) -> list[str]:
    """A table and those within it, each as a block."""
    lines = _lines(table)
    inner = [_table_toml(f"{name}.{key}", value) for key, value in table if isinstance(value, BaseModel)]
    return [*(["\n".join([f"[{name}]", *lines])] if lines else []), *chain(*inner)]


def _lines(table: BaseModel) -> list[str]:
    fields = type(table).model_fields
    return [
        f"{key} = {toml_value(value)}  # {fields[key].description}"
        for key, value in table
        if value is not None and not isinstance(value, BaseModel) and value != {}
    ]
