"""What ships and is found by its name: models of robots, platforms, campaigns."""

from collections.abc import Mapping
from pathlib import Path

__all__ = ["find_shipped"]


def find_shipped(given: str | Path, shipped: Mapping[str, Path], *, folder: bool = False) -> Path | None:
    """The file at the path `given`, else what is `shipped` by this name; None for neither. ``folder``: Not a file."""
    path = Path(given)
    there = path.is_dir() if folder else path.is_file()
    return path if there else shipped.get(str(given))
