"""Sentences are compared with a kept file, tests/golden/<name>.txt: tests themselves assert numbers and structure."""

from __future__ import annotations

import difflib
import html
import re
from collections.abc import Iterable, Mapping
from pathlib import Path

import pytest

FOLDER = Path(__file__).resolve().parent / "golden"
UPDATE = False
"""Whether to write the files instead of comparing with them: `pytest --update-golden`, see tests/conftest.py."""

Text = str | Iterable[str] | Mapping[str, "str | Iterable[str]"]
_CHANGING = (
    (r"\N{NO-BREAK SPACE}|\N{NARROW NO-BREAK SPACE}", " "),
    (r"\b\d{4}-\d\d-\d\d(?:[ T]\d\d:\d\d(?::\d\d(?:\.\d+)?)?(?:Z| ?UTC|[+-]\d\d:?\d\d)?)?", "<date>"),
    (r"\b\d{1,2}:\d\d(?::\d\d)?\b", "<time>"),
    (r"(?<![\w.<])/(?:[\w.+-]+/)+(?:[\w.+-]*\w)?", "<path>/"),
    (r"\b\d+\.\d+\.\d+\w*(?:\.\w+)*(?:\+[\w.]+)?", "<version>"),
    (r"\b(?=[0-9a-f]*[a-f])(?=[0-9a-f]*\d)(?:[0-9a-f]{64}|[0-9a-f]{40}|[0-9a-f]{16}|[0-9a-f]{12})\b", "<hash>"),
)


def golden(name: str, text: Text) -> None:
    """Fails unless `text` is that of tests/golden/<name>.txt, but for dates, times of day, paths, versions, hashes.

    One text, several (a line each), or several by heading.
    """
    path, now = FOLDER / f"{name}.txt", _written(text)
    if UPDATE:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(now, encoding="utf-8")
    elif not path.exists():
        pytest.fail(f"{_shown(path)} is missing: write it with `pytest --update-golden`, read it, commit it")
    elif (kept := path.read_text(encoding="utf-8")) != now:
        lines = difflib.unified_diff(kept.splitlines(), now.splitlines(), "kept", "now", lineterm="", n=1)
        told = f"The text differs from {_shown(path)}; if it is meant to, write it anew with `pytest --update-golden`:"
        pytest.fail("\n".join([told, *lines]), pytrace=False)


def page_lines(page: str) -> list[str]:
    """The text that a browser shows of `page` (HTML), one line a block, the cells of a row with bars between them."""
    bare = re.sub(r"(?s)<(style|script|title)\b.*?</\1>", "", page)
    bare = re.sub(r"</t[dh]>", " | ", re.sub(r"</(span|b)>(?=<)", " ", re.sub(r"\s+", " ", bare)))
    bare = re.sub(
        r"<(?:/?(?:h\d|p|div|li|dt|dd|tr|table|figure|figcaption|section|pre|summary)|br|img)\b[^>]*>", "\n", bare
    )
    lines = (html.unescape(re.sub(r"<[^>]+>", "", line)) for line in bare.split("\n"))
    return [" ".join(line.split()).rstrip(" |") for line in lines if line.strip()]


def _written(text: Text) -> str:
    if isinstance(text, Mapping):
        return "\n".join(f"[{heading}]\n{_written(part)}" for heading, part in text.items())
    said = text if isinstance(text, str) else "\n".join(text)
    for pattern, put in _CHANGING:
        said = re.sub(pattern, put, said)
    return "".join(f"{line.rstrip()}\n" for line in said.strip("\n").split("\n"))


def _shown(path: Path) -> str:
    return f"tests/golden/{path.relative_to(FOLDER).as_posix()}"
