"""What the tests that draw their cases at random share: a command's outcome, and the parts that a file has already."""

import json
import os
from collections import Counter
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path

import pytest

from experiments.cli.main import main

__all__ = ["ALL", "CASES", "KEPT", "in_words", "kept", "outcome"]

CASES = int(os.environ.get("HEDGEBED_FUZZ", "300"))
KEPT = Path(os.environ["HEDGEBED_FUZZ_KEPT"]).resolve() if "HEDGEBED_FUZZ_KEPT" in os.environ else None
ALL = CASES > 300


def outcome(*tokens):
    """Exit status and the lines on stderr."""
    said = StringIO()
    with redirect_stderr(said), redirect_stdout(StringIO()):
        status = main(list(map(str, tokens)))
    return status, said.getvalue()


def in_words(said):
    """Whether each line is one of ours, and short enough to be read."""
    return "Traceback" not in said and all(len(line) < 900 for line in said.splitlines())


@contextmanager
def kept(name):
    """Skips a part that the file has already; a part that passes adds its line, with how often each status came."""
    lines = KEPT.read_text(encoding="utf-8").splitlines() if KEPT is not None and KEPT.exists() else []
    if any(json.loads(line)["part"] == name for line in lines):
        pytest.skip(f"{KEPT} has {name}")
    counts = Counter()
    yield counts
    if KEPT is not None:
        line = {"part": name} | {f"exit {status}": count for status, count in sorted(counts.items())}
        with KEPT.open("a", encoding="utf-8") as file:
            file.write(json.dumps(line) + "\n")
