"""A platform that is given as a file: the run's folder has a copy, for who reads it and for `hedgebed resume`."""

from collections.abc import Callable
from pathlib import Path

from experiments.runs.folder import write_text
from rigid.platform.files import find_platform

from . import say

__all__ = ["PLATFORM_COPY", "keep_platform"]

PLATFORM_COPY = "platform.toml"
"""The copy's name in the run's folder."""


def keep_platform(name: str, folder: Path, message: Callable[[str], object] | None = None) -> Path | None:
    """The copy in ``folder`` of the platform's file ``name``, made if it lacks; None for a platform that ships.

    ``message`` is called where the file differs by now from the copy. Raises ValueError for a file that will not do,
    unless the copy is there.
    """
    if Path(name).suffix != ".toml":
        return None
    kept = folder / PLATFORM_COPY
    if not kept.exists():
        find_platform(name)
        write_text(kept, Path(name).read_text(encoding="utf-8"))
    elif message is not None and not _same(Path(name), kept):
        message(say("changed", name=name, kept=kept))
    return kept


def _same(file: Path, kept: Path) -> bool:
    try:
        return file.read_text(encoding="utf-8") == kept.read_text(encoding="utf-8")
    except (OSError, ValueError):
        return False
