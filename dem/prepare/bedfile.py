"""A bed in one file, with what it was made from and what each stage of its preparation left; and the shelf of beds.

The file is what ``Bed.save`` writes (.npz, a zip archive) with ``preparation.json`` in it; ``Bed.load`` reads it too.
"""

import json
import os
import re
import zipfile
from dataclasses import asdict
from pathlib import Path

import numpy as np

from dem.engine.core import BedCore
from dem.engine.state import read_file
from dem.files.arrays import opened, whole_file
from dem.grains.sizes import Json

from .report import B, Prepared, StageReport

__all__ = ["bed_shelf", "find_bed", "list_beds", "load_prepared", "read_preparation", "save_prepared", "share_bed"]

PREPARATION_FORMAT = "hedgebed-preparation/1"
_MEMBER = "preparation.json"
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._+-]*\Z")


def bed_shelf() -> Path:
    """Where beds that have a name are kept: ``HEDGEBED_BEDS``, or ~/.local/share/hedgebed/beds."""
    given = os.environ.get("HEDGEBED_BEDS")
    return Path(given).expanduser() if given else Path.home() / ".local" / "share" / "hedgebed" / "beds"


def find_bed(bed: str | Path) -> Path:
    """The file that ``bed`` means: a path, a run folder that holds bed.npz, or a name on the shelf.

    Raises ValueError: there is none, with the names there are.
    """
    path = Path(bed)
    for candidate in (path, path / "bed.npz", bed_shelf() / f"{path}.npz"):
        if candidate.is_file():
            return candidate
    names = sorted(file.stem for file in bed_shelf().glob("*.npz")) if bed_shelf().is_dir() else []
    there = f"the shelf holds {', '.join(names)}" if names else "the shelf is empty"
    raise ValueError(f"bed = {str(bed)!r} is no file, no run folder with a bed.npz and no bed on the shelf; {there}")


def shelf_path(name: str) -> Path:
    """The file of the bed of that name. Raises ValueError for what cannot name a file."""
    if not _NAME.match(name):
        raise ValueError(f"name = {name!r} cannot name a bed: use letters, digits, '.', '_', '+' and '-'")
    return bed_shelf() / f"{name}.npz"


def save_prepared(prepared: Prepared, path: str | Path) -> Path:
    """Write a bed with its preparation to one file, whole or not at all. Returns the path."""
    path, bed, reports = Path(path), prepared.whole, [asdict(report) for report in prepared.reports]
    about = {"format": PREPARATION_FORMAT, "recipe": prepared.recipe, "reports": reports}
    with whole_file(path) as part:
        bed.save(part)
        with zipfile.ZipFile(part, "a") as archive:
            archive.writestr(_MEMBER, json.dumps(about, indent=1))
    return path


def read_preparation(path: str | Path) -> Prepared:
    """What a bed's file says of its preparation, without the bed; a bed that ``Bed.save`` wrote has none.

    Raises ValueError: no such file, no bed in it, or a preparation that cannot be read.
    """
    path = Path(path)
    try:
        with opened(path) as archive:
            if _MEMBER not in archive.namelist():
                read_file(path)
                return Prepared(None, {}, [])
            about = json.loads(archive.read(_MEMBER))
        if about["format"] != PREPARATION_FORMAT:
            raise ValueError(f"its format is {about['format']!r}, {PREPARATION_FORMAT!r} was expected")
        return Prepared(None, dict(about["recipe"]), [StageReport(**report) for report in about["reports"]])
    except FileNotFoundError:
        raise ValueError(f"{path}: no such file; a bed saved by hedgebed was expected") from None
    except (OSError, KeyError, TypeError, ValueError) as problem:
        raise ValueError(f"{path} is not a bed saved by hedgebed ({problem})") from None


def load_prepared(
    path: str | Path, *, arch: str = "cpu", threads: int | None = None, make: type[B] = BedCore
) -> Prepared[B]:
    """A bed of the class ``make`` with its preparation. Raises ValueError: as ``read_preparation`` and ``Bed.load``."""
    about = read_preparation(path)
    bed = make.load(path, arch=arch, threads=threads)
    bed.recipe = about.recipe
    return Prepared(bed, about.recipe, about.reports)


def share_bed(path: str | Path, to: str | Path) -> Path:
    """Copy a bed's file, compressed, to where it can be sent from. Returns the new file.

    Raises ValueError: ``path`` is no bed; ``to`` is there already.
    """
    path, to = Path(path), Path(to)
    read_preparation(path)
    read_file(path)
    if to.exists():
        raise ValueError(f"to = {str(to)!r} is there already: name a file that is not")
    with (
        whole_file(to) as part,
        zipfile.ZipFile(path) as source,
        zipfile.ZipFile(part, "w", zipfile.ZIP_DEFLATED) as target,
    ):
        for member in source.infolist():
            target.writestr(member.filename, source.read(member))
    return to


def list_beds(folder: str | Path) -> list[Json]:
    """The beds in the .npz files of a folder, by name: file, name, material, size, grains, diameter, packing, stages.

    A file that is no bed is listed with ``problem``.
    """
    return [_entry(path) for path in sorted(Path(folder).glob("*.npz"))]


def _entry(path: Path) -> Json:
    entry: Json = {"file": str(path), "name": path.stem}
    try:
        about = read_preparation(path)
        settings, state, precision = read_file(path)
    except ValueError as problem:
        return entry | {"problem": str(problem)}
    radii = state["position"][:, 3].astype(float)
    return entry | {
        "material": settings.material.name,
        "size": list(settings.size),
        "gravity": float(np.linalg.norm(settings.gravity)),
        "grain_count": len(radii),
        "grain": float(2 * radii.mean()),
        "packing_fraction": float(state["reals"][6]),
        "precision": precision,
        "stages": [report.stage for report in about.reports],
    }
