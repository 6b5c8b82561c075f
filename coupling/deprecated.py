"""Old names of keywords and of what bodies offer, which go on for one version."""

import warnings
from collections.abc import Callable
from functools import wraps
from typing import Any, TypeVar, cast

from hedgebed_renamed import renamed

__all__ = ["PlacedBody", "renamed_keywords"]

F = TypeVar("F", bound=Callable[..., Any])


def renamed_keywords(**today: str) -> Callable[[F], F]:
    """A decorator: the method takes a keyword by its old name too, with a DeprecationWarning."""

    def decorate(method: F) -> F:
        @wraps(method)
        def call(owner: object, *args: Any, **options: Any) -> Any:
            for old in today.keys() & options.keys():
                warnings.warn(f"{old} of {type(owner).__name__} is now {today[old]}", DeprecationWarning, stacklevel=2)
                options[today[old]] = options.pop(old)
            return method(owner, *args, **options)

        return cast(F, call)

    return decorate


class PlacedBody:
    """The names that bodies gave their placement before."""

    take_in_hand, let_go = renamed("take_in_hand", "begin_placement"), renamed("let_go", "release")
    hold_more_firmly = renamed("hold_more_firmly", "slow_placement")
    held_by_hand = renamed("held_by_hand", "in_placement")
