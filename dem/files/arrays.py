"""Arrays in one file (.npz), which is written whole or not at all, and read back whole or refused.

Beds, checkpoints of runs and kept parts of cases are such files.
"""

import tempfile
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

__all__ = ["opened", "read_arrays", "whole_file"]


@contextmanager
def opened(path: str | Path) -> Iterator[zipfile.ZipFile]:
    """A zip file to read from. What goes wrong in reading it raises ValueError that says what, without the path.

    Raises OSError: the file cannot be opened.
    """
    with Path(path).open("rb") as file:
        try:
            with zipfile.ZipFile(file) as archive:
                yield archive
        except Exception as problem:  # zipfile, its compressors and numpy have no common class of errors
            raise ValueError(str(problem) or type(problem).__name__) from None


def read_arrays(path: str | Path) -> dict[str, np.ndarray]:
    """The arrays of a file that ``numpy.savez`` wrote, by name. Pickled objects are refused, other members left out.

    Every member is read to its end, where zip compares the checksum. ``numpy.load`` stops where the array's own header
    says, so that one wrong bit in a shape can give fewer numbers without an error.

    Raises OSError and ValueError as ``opened``.
    """
    found = {}
    with opened(path) as archive:
        for name in archive.namelist():
            with archive.open(name) as member:
                if name.endswith(".npy"):
                    found[name.removesuffix(".npy")] = np.lib.format.read_array(member, allow_pickle=False)
                    if member.read(1):
                        raise ValueError(f"{name} is longer than its header says")
                else:
                    member.read()
    return found


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """A file to write to that becomes ``path`` at the end, so that this is written whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=path.parent) as scratch:
        yield (part := Path(scratch) / path.name)
        part.replace(path)
