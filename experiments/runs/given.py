"""Copies that a run folder keeps of the files that the run was given: a resumed run goes on with the same numbers."""

import hashlib
from pathlib import Path
from typing import Any

from rigid.digests import digest_of, kept_digests
from rigid.result import read_json, write_json
from rigid.series import replacing

__all__ = ["keep_given", "kept_copy"]


def kept_copy(folder: Path, name: str) -> Path | None:
    """The copy `name` in the run folder; None where there is none. Raises ValueError where it is damaged."""
    copy = folder / name
    if not copy.exists():
        return None
    digest, keeper = kept_digests(folder).get(name, ("", ""))
    if digest and digest_of(copy) != digest:
        raise ValueError(
            f"{copy}: is damaged: its digest differs from that in {keeper}; put the file that it was copied from in "
            f"its place, or begin the run anew"
        )
    return copy


def keep_given(folder: Path, name: str, content: bytes) -> Path:
    """Write the copy `name` into the run folder and return it; its digest goes into status.json before it.

    Raises OSError, naming the file, where it cannot be written.
    """
    copy, status = folder / name, folder / "status.json"
    if (folder / "run.toml").is_file():
        kept = _table(status)
        given = kept.get("given")
        own = {name: hashlib.sha256(content).hexdigest()}
        write_json(status, kept | {"given": (given if isinstance(given, dict) else {}) | own})
    with replacing(copy) as temporary:
        temporary.write_bytes(content)
    return copy


def _table(status: Path) -> dict[str, Any]:
    try:
        kept = read_json(status)
    except (OSError, ValueError):
        return {}
    return kept if isinstance(kept, dict) else {}
