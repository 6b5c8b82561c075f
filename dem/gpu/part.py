"""What the parts of an engine on a GPU have in common."""

from typing import TYPE_CHECKING, Any

__all__ = ["Part"]


class Part:
    """A part of ``dem.engine.engine.GpuEngine``, whose fields and functions it uses."""

    if TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any: ...
