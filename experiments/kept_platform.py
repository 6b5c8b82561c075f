"""A platform that is given as a file: the run's folder has a copy, for who reads it and for `hedgebed resume`."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from rigid.platform_files import find_platform

from .runfolder import write_text

__all__ = ["PLATFORM_COPY", "keep_platform"]

PLATFORM_COPY = "platform.toml"
"""The copy's name in the run's folder."""


def keep_platform(name: str, folder: Path, say: Callable[[str], object] | None = None) -> Path | None:
    """The copy in ``folder`` of the platform's file ``name``, made if it lacks; None for a platform that ships.

    ``say`` is told where the file is another by now than the copy. Raises ValueError for a file that will not do,
    unless the copy is there.
    """
    if Path(name).suffix != ".toml":
        return None
    kept = folder / PLATFORM_COPY
    if not kept.exists():
        find_platform(name)
        write_text(kept, Path(name).read_text(encoding="utf-8"))
    elif say is not None and not _same(Path(name), kept):
        say(f"{name} has changed since this run began, or is gone: it goes on with {kept}, which is what it was then")
    return kept


def _same(file: Path, kept: Path) -> bool:
    try:
        return file.read_text(encoding="utf-8") == kept.read_text(encoding="utf-8")
    except (OSError, ValueError):
        return False
