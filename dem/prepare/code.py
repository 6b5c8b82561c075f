"""The digest of the code that computes beds, by which kept beds are found. Comments and docstrings do not change it."""

import functools
import hashlib
import io
import os
import re
import tokenize
from collections.abc import Iterable
from pathlib import Path

from hedgebed_taichi import version

__all__ = ["cache_folder", "digest_of_code", "fingerprint"]

_ROOT = Path(__file__).parents[1]
# Tokens that are no part of the code by themselves.
_NO_CODE = {
    tokenize.ENCODING, tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT,
    tokenize.ENDMARKER,
}  # fmt: skip


def cache_folder() -> Path:
    """Where prepared beds are kept: ``HEDGEBED_CACHE``, or ~/.cache/hedgebed."""
    given = os.environ.get("HEDGEBED_CACHE")
    return Path(given).expanduser() if given else Path.home() / ".cache" / "hedgebed"


@functools.cache
def fingerprint() -> str:
    """A short digest of the code that computes beds and of Taichi. Another digest means: the bits may differ."""
    return digest_of_code(_ROOT)


def digest_of_code(folder: Path) -> str:
    """A short digest of the Python files below a folder and of Taichi's version.

    The cache keeps it under the digest of all bytes of the files: this takes 1 ms, reading the code 0.3 s.
    """
    sources = [path.read_bytes() for path in sorted(folder.rglob("*.py"))]
    kept = cache_folder() / "code" / _digest(sources)
    try:
        known = kept.read_text(encoding="ascii")
        if re.fullmatch("[0-9a-f]{16}", known):
            return known
    except (OSError, ValueError):
        pass  # There is none yet, or it is damaged.
    found = _digest(map(_bare, sources))
    try:
        kept.parent.mkdir(parents=True, exist_ok=True)
        unfinished = kept.with_suffix(f".{os.getpid()}")
        unfinished.write_text(found, encoding="ascii")
        unfinished.replace(kept)
    except OSError:
        pass  # The cache cannot be written; the next command reads the code again.
    return found


def _digest(parts: Iterable[bytes]) -> str:
    """The first 16 digits of the SHA-256 of Taichi's version and of these bytes, each after its length."""
    digest = hashlib.sha256(version().encode())
    for part in parts:
        digest.update(f"\0{len(part)}\0".encode() + part)
    return digest.hexdigest()[:16]


def _bare(source: bytes) -> bytes:
    """The lines of a module without comments, docstrings, blank lines, and spaces at their ends.

    The rest is the text of the file. An ``ast.dump`` of it would depend on the version of Python.
    """
    tokens = list(tokenize.tokenize(io.BytesIO(source).readline))
    lines = source.decode("utf-8").split("\n")
    rows: set[int] = set()
    ends = {token.start[0]: token.start[1] for token in tokens if token.type == tokenize.COMMENT}
    logical: list[tokenize.TokenInfo] = []
    for token in tokens:
        if token.type == tokenize.NEWLINE:
            if any(part.type != tokenize.STRING for part in logical):
                rows.update(*(range(part.start[0], part.end[0] + 1) for part in logical))
            logical = []
        elif token.type not in _NO_CODE:
            logical.append(token)
    return "\n".join(lines[row - 1][: ends.get(row)].rstrip() for row in sorted(rows)).encode()
