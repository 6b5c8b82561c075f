"""Old names of attributes, which go on for one version."""

import warnings
from typing import Any

__all__ = ["PlacedBody", "renamed"]


def renamed(old: str, new: str) -> Any:
    """A property `old` that gives the attribute `new`, with a DeprecationWarning."""

    def get(owner: object) -> Any:
        warnings.warn(f"{type(owner).__name__}.{old} is now {new}", DeprecationWarning, stacklevel=2)
        return getattr(owner, new)

    return property(get, doc=f"Old name of `{new}`.")


class PlacedBody:
    """The names that bodies gave their placement before."""

    take_in_hand, let_go = renamed("take_in_hand", "begin_placement"), renamed("let_go", "release")
    hold_more_firmly = renamed("hold_more_firmly", "slow_placement")
    held_by_hand = renamed("held_by_hand", "in_placement")
