"""Digests of files: whether a file of a run folder is as the run wrote it.

status.json of a run has two tables of them, name of the file below the folder -> SHA-256: `digests` of what the run has
written, `given` of its copies of files that it was given. A kept result has `digests` in cost.json.
"""

import hashlib
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

__all__ = ["check_as_written", "check_digests", "digest_of", "digest_of_data", "kept_digests"]

_KEEPERS = ("status.json", "cost.json")
_TABLES = ("digests", "given")
_ABOVE = 3  # Folders above a file in which its digest is looked for: laws/NAME.toml of cells/NAME is two below


def digest_of(path: Path) -> str:
    """The digest of a file."""
    return hashlib.sha256(Path(path).read_bytes()).hexdigest()


def digest_of_data(data: Any) -> str:
    """The digest of what JSON can hold, whatever the order of its keys."""
    return hashlib.sha256(json.dumps(data, sort_keys=True).encode()).hexdigest()


def kept_digests(folder: Path) -> dict[str, tuple[str, str]]:
    """Name of each file of a run folder that has a digest -> the digest, and the name of the file that keeps it."""
    return {name: (digest, keeper) for name, digest, keeper in _kept(Path(folder))}


def _kept(folder: Path) -> Iterator[tuple[str, str, str]]:
    for keeper in _KEEPERS:
        try:
            kept = json.loads((folder / keeper).read_text(encoding="utf-8"))
        except (OSError, ValueError, RecursionError):
            continue
        for table in _TABLES:
            digests = kept.get(table) if isinstance(kept, dict) else None
            for name, digest in digests.items() if isinstance(digests, dict) else ():
                yield name, str(digest), keeper


def check_digests(folder: Path, *names: str) -> None:
    """Raise ValueError, naming the file, for a file that has changed since the run wrote it; all files if no `names`.

    Runs of earlier versions have fewer digests or none. A missing file is not checked.
    """
    for name, (digest, keeper) in kept_digests(folder).items():
        path = Path(folder) / name
        if (not names or name in names) and path.is_file() and digest_of(path) != digest:
            raise ValueError(
                f"{path}: is not as the run wrote it: its digest differs from that in {Path(folder) / keeper}"
            )


def check_as_written(path: Path) -> None:
    """Raise ValueError, naming the file, for a file of a run folder that has changed since the run wrote it.

    A file that is in no run folder, or has no digest there, is not checked.
    """
    whole = Path(path).resolve()
    for folder in list(whole.parents)[:_ABOVE]:
        digest, keeper = kept_digests(folder).get(whole.relative_to(folder).as_posix(), ("", ""))
        if digest and whole.is_file() and digest_of(whole) != digest:
            raise ValueError(
                f"{path}: is not as the run wrote it: its digest differs from that in {folder / keeper}; copy it out "
                f"of the run folder to use it with other numbers"
            )
