"""A material that is given as a file: the run's folder has a copy, for who reads it and for `hedgebed resume`."""

from __future__ import annotations

from pathlib import Path

from .runfolder import write_text

__all__ = ["MATERIAL_COPY", "keep_material"]

MATERIAL_COPY = "material.toml"
"""The copy's name in the run's folder."""


def keep_material(name: str, folder: Path) -> str:
    """From where the run takes its material: ``name`` of one that ships, or the copy in ``folder``, made if it lacks.

    Raises ValueError for a name that is none and a file that will not do, unless the copy is there.
    """
    from dem.materials import MATERIALS, material

    copy = folder / MATERIAL_COPY
    if name.lower() in MATERIALS:
        return name
    if not copy.exists():
        material(name)
        write_text(copy, Path(name).read_text(encoding="utf-8"))
    return str(copy)
