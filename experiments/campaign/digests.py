"""Digests of a campaign that hedgebed wrote: they show whether a file has changed since.

A changed digit in a recording or a table is a valid number, so no other check finds it. A folder without digests.json,
such as one that a person makes, is not checked.
"""

import json
from collections.abc import Iterable
from pathlib import Path

from experiments.runs.folder import write_json
from rigid.digests import digest_of

__all__ = ["DIGESTS", "changed_files", "write_digests"]

DIGESTS = "digests.json"
"""Name of the file below a campaign: {"digests": {name of a file: its SHA-256}}."""


def write_digests(folder: Path, names: Iterable[str]) -> None:
    """Write the digests of these files of a campaign into its folder."""
    write_json(folder / DIGESTS, {"digests": {name: digest_of(folder / name) for name in sorted(set(names))}})


def changed_files(folder: Path, names: Iterable[str]) -> list[str]:
    """A sentence for each of these files of a campaign that differs from its digest; none without digests.json.

    A file that is missing, or has no digest, is not checked.
    """
    keeper = folder / DIGESTS
    if not keeper.exists():
        return []
    way = f"if the change is intended, delete {keeper}"
    try:
        kept = json.loads(keeper.read_text(encoding="utf-8"))["digests"]
        digests = {str(name): str(digest) for name, digest in kept.items()}
    except (OSError, ValueError, RecursionError, LookupError, TypeError, AttributeError):
        return [f"{keeper}: is damaged; a table of digests was expected; {way}"]
    there = ((folder / name, digests[name]) for name in names if name in digests)
    return [
        f"{path}: has changed since its digest was written (it differs from that in {keeper}): restore it, or {way}"
        for path, digest in there
        if path.is_file() and digest_of(path) != digest
    ]
