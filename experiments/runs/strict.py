"""What every settings class shares: closed, frozen, and true to kind."""

from types import UnionType
from typing import Annotated, Any, Literal, get_args, get_origin

from annotated_types import MinLen
from pydantic import BaseModel, ConfigDict, Field, ValidationInfo, field_validator
from pydantic.fields import FieldInfo

from .units import find_unit

__all__ = [
    "MOST_WORKERS", "NotNegative", "Positive", "Scheduler", "SeedNumber", "StrictSettings", "Threads", "Workers",
    "described", "may_be_empty", "plain_kinds",
]  # fmt: skip

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
SeedNumber = Annotated[int, Field(ge=0, lt=2**31)]
Threads = Annotated[int | None, Field(ge=1, le=1024, description="CPU threads; all cores if not given.")]

MOST_WORKERS = 1024
Workers = Annotated[
    int | None,
    Field(
        ge=1,
        le=MOST_WORKERS,
        description="Number of processes on this machine, each with one run at a time; 1 needs no dask. If not "
        "given: one for each core, but 1 for less than a minute of work or where dask is not installed.",
    ),
]
Scheduler = Annotated[
    str | None,
    Field(
        min_length=1,
        description="Cluster of dask.distributed in place of `workers`: tcp://host:port, or a scheduler file. The "
        "variable HEDGEBED_SCHEDULER replaces it, also when the run is resumed.",
    ),
]


def described(kind: Any) -> str:
    """The description that a kind of setting, such as `Workers`, brings along."""
    return next(str(item.description) for item in get_args(kind) if isinstance(item, FieldInfo))


class StrictSettings(BaseModel):
    """Settings of an experiment: frozen, no unknown keys, text is no number but one with a unit, true is not 1.

    A setting's description is the docstring below it, or the one given to `Field`. It states the unit, and another unit
    of the same kind may stand behind a number (`experiments.runs.units`).
    """

    model_config = ConfigDict(frozen=True, extra="forbid", use_attribute_docstrings=True)

    @classmethod
    def __pydantic_init_subclass__(cls, **_: Any) -> None:
        for field in cls.model_fields.values():
            field.description = " ".join((field.description or "").split()) or None

    @field_validator("*", mode="before")
    @classmethod
    def _of_its_kind(cls, value: Any, info: ValidationInfo) -> Any:
        """Text is no number but one with a unit, true is not 1, and one number is no list of them."""
        field = cls.model_fields[str(info.field_name)]
        hint = field.annotation
        kinds = plain_kinds(hint)
        if bool in kinds:
            if not isinstance(value, bool) and not (value is None and type(None) in kinds):
                raise ValueError("it must be true or false")
        elif kinds & {int, float} and value is not None:
            may_be_unset = get_args(hint) if get_origin(hint) is UnionType else ()
            several = tuple in (get_origin(hint), *map(get_origin, may_be_unset))
            if several and not isinstance(value, list | tuple):
                raise ValueError(f"it must be a list such as [{value if _is_number(value) else 0.1}]")
            if not several and isinstance(value, list | tuple):
                raise ValueError("it must be one number, not a list")
            items = [_number(item, field) for item in (value if several else (value,))]
            return type(value)(items) if several else items[0]
        return value


def _number(item: Any, field: FieldInfo) -> Any:
    """`item`; text with a unit as the number that it means in the field's own. Raises ValueError for other text."""
    unit = find_unit(field.description) if isinstance(item, str) else None
    if unit is not None:
        return unit.value_of(item)
    if isinstance(item, bool | str):
        raise ValueError(f"{item!r} is not a valid number")
    return item


def may_be_empty(field: FieldInfo) -> bool:
    """Whether the setting is a list that may hold nothing, which one types as ``none``."""
    endless = get_origin(field.annotation) is tuple and get_args(field.annotation)[-1:] == (Ellipsis,)
    return endless and not any(isinstance(bound, MinLen) for bound in field.metadata)


def plain_kinds(hint: Any) -> set[type]:
    """The plain types inside an annotation."""
    inside = get_args(hint)
    if get_origin(hint) is Literal or not inside:
        return {hint} if isinstance(hint, type) else set()
    if get_origin(hint) is Annotated:
        return plain_kinds(inside[0])
    return set().union(*(plain_kinds(item) for item in inside))


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
