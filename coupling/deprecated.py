"""Old names of attributes, which go on for one version."""

import warnings
from typing import Any

__all__ = ["renamed"]


def renamed(old: str, new: str) -> Any:
    """A property `old` that gives the attribute `new`, with a DeprecationWarning."""

    def get(owner: object) -> Any:
        warnings.warn(f"{type(owner).__name__}.{old} is now {new}", DeprecationWarning, stacklevel=2)
        return getattr(owner, new)

    return property(get, doc=f"Old name of `{new}`.")
