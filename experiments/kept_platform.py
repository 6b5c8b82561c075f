"""A platform that is given as a file: the run's folder has a copy, for who reads it and for `hedgebed resume`."""

from __future__ import annotations

from pathlib import Path

from rigid.platform_files import find_platform

from .runfolder import write_text

__all__ = ["PLATFORM_COPY", "keep_platform"]

PLATFORM_COPY = "platform.toml"
"""The copy's name in the run's folder."""


def keep_platform(name: str, folder: Path) -> Path | None:
    """The copy in ``folder`` of the platform's file ``name``, made if it lacks; None for a platform that ships.

    Raises ValueError for a file that will not do, unless the copy is there.
    """
    if Path(name).suffix != ".toml":
        return None
    kept = folder / PLATFORM_COPY
    if not kept.exists():
        find_platform(name)
        write_text(kept, Path(name).read_text(encoding="utf-8"))
    return kept
