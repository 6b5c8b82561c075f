"""Options of the command line, made from the fields of a settings class."""

import inspect
from collections.abc import Callable
from pathlib import Path
from types import UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from cyclopts import CoercionError, Parameter
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

from experiments.runs.strict import may_be_empty, plain_kinds
from experiments.runs.units import find_unit, has_unit

__all__ = ["as_typed", "option_of", "reserved_option", "with_parameters"]

_RESERVED = {
    "case": (Path | None, None, "TOML file of settings, or the name of a case that ships; options override it."),
    "out": (Path | None, None, "Folder of the run; runs/<command>-<time> if not given."),
    "json": (bool, False, "Print result.json on stdout and nothing else."),
    "quiet": (bool, False, "Show no progress."),
    "verbose": (bool, False, "Print every number and finding of the report at the end."),
}


def _shown(value: Any) -> str:
    """A default, as one would type it."""
    if isinstance(value, list | tuple):
        return " ".join(map(str, value)) or "none"
    return str(value)


def _as_typed(_: Any, tokens: tuple[Any, ...]) -> float | str:
    """A number; with a unit behind it, or ``none``, the text, which the settings class reads."""
    word = tokens[0].value
    try:
        return word if has_unit(word) or word == "none" else float(word)
    except ValueError:
        raise CoercionError(token=tokens[0], target_type=float) from None


_WITH_UNIT = Annotated[float | str, Parameter(converter=_as_typed, metavar="FLOAT")]


def _bare(hint: Any, *, with_unit: bool) -> Any:
    """`hint` without its bounds: pydantic checks these, and its faults become sentences in
    `experiments.runs.reading`. `with_unit`: a unit may stand behind its numbers."""
    origin, inside = get_origin(hint), get_args(hint)
    if origin is Annotated:
        return _bare(inside[0], with_unit=with_unit)
    if hint is float and with_unit:
        return _WITH_UNIT
    if hint is int:  # cyclopts would round 1.5 to 2; `as_typed` makes whole numbers of it again
        return Annotated[float, Parameter(metavar="INT")]
    if not inside or origin is Literal:
        return hint
    if origin in (Union, UnionType):
        return Union[tuple(_bare(item, with_unit=with_unit) for item in inside)]
    return origin[tuple(_bare(item, with_unit=with_unit) for item in inside)]


def as_typed(given: dict[str, Any], fields: dict[str, FieldInfo]) -> dict[str, Any]:
    """The values as the settings class takes them: a float that is whole is an int, a list of ``none`` is empty."""

    def whole(value: Any) -> Any:
        if isinstance(value, tuple):
            return tuple(whole(item) for item in value)
        return int(value) if isinstance(value, float) and value.is_integer() else value

    found = {}
    for name, value in given.items():
        field = fields.get(name)
        if field is not None:
            value = () if may_be_empty(field) and value in ((None,), ("none",)) else value
            kinds = plain_kinds(field.annotation)
            value = whole(value) if int in kinds and float not in kinds else value
        found[name] = value
    return found


def option_of(name: str, field: FieldInfo) -> inspect.Parameter:
    """The command-line parameter of one setting."""
    if name in _RESERVED:
        raise TypeError(f"a setting cannot be called {name!r}: the command line has that already")
    default = None if field.is_required() else field.get_default(call_default_factory=True)
    shown: bool | Callable[[Any], str] = False if default in (None, "", PydanticUndefined) else _shown
    is_flag = field.annotation in (bool, bool | None)
    more = field.json_schema_extra if isinstance(field.json_schema_extra, dict) else {}
    hint = _bare(field.annotation, with_unit=find_unit(field.description) is not None)
    if more.get("as_text"):  # the settings class refuses other words, with what they ask for
        hint = str
    if may_be_empty(field):
        hint = tuple[get_args(hint)[0] | None, ...]  # type: ignore[misc]
    elif field.is_required() and get_origin(field.annotation) is tuple:
        default = ()  # cyclopts checks a list's default, and None is none; what is missing is refused with the settings
    annotation = Annotated[
        hint,  # type: ignore[valid-type]
        Parameter(help=field.description, show_default=shown, consume_multiple=True, negative=None if is_flag else "",
                  show=not more.get("hidden", False),
                  alias=str(more["option_alias"]) if "option_alias" in more else None),
    ]  # fmt: skip
    return inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=annotation)


def reserved_option(name: str) -> inspect.Parameter:
    hint, default, text = _RESERVED[name]
    kind = inspect.Parameter.POSITIONAL_ONLY if name == "case" else inspect.Parameter.KEYWORD_ONLY
    annotation = Annotated[hint, Parameter(help=text, negative="", show_default=False)]  # type: ignore[valid-type]
    return inspect.Parameter(name, kind, default=default, annotation=annotation)


def with_parameters(command: Callable[..., int], parameters: list[inspect.Parameter]) -> Callable[..., int]:
    """`command`, which takes ``**given``, as a function with these parameters."""
    command.__signature__ = inspect.Signature(parameters, return_annotation=int)  # type: ignore[attr-defined]
    command.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
    return command
