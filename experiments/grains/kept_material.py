"""A material given as a file: the run's folder keeps a copy, for readers and for `hedgebed resume`."""

from pathlib import Path

from experiments.runs.given import keep_given, kept_copy
from rigid.digests import check_as_written

__all__ = ["BASE_COPY", "MATERIAL_COPY", "keep_material"]

MATERIAL_COPY = "material.toml"  # The copy's name in the run's folder
BASE_COPY = "base.toml"  # Its name in that of a calibration, whose material.toml is what it found


def keep_material(name: str, folder: Path, *, copy: str = MATERIAL_COPY) -> str:
    """Where the run takes its material from: ``name`` of one that ships, or ``copy`` in ``folder``, made once.

    Raises ValueError for an unknown name and for a faulty file, unless the copy exists. Also for a damaged copy, and
    for the file of a run that has changed since the run wrote it.
    """
    from dem.grains.materials import MATERIALS, material
    from hedgebed_renamed import material_of_today

    if (today := material_of_today(name.lower())) in MATERIALS:
        return today
    if (kept := kept_copy(folder, copy)) is None:
        material(name)
        check_as_written(Path(name))
        kept = keep_given(folder, copy, Path(name).read_bytes())
    return str(kept)
