"""The records of campaigns that were diagnosed: a file that grows by a line a campaign."""

import json
from pathlib import Path
from typing import Any

__all__ = ["CASES_FILE", "read_cases"]

CASES_FILE = "cases.jsonl"


def read_cases(out: Path) -> list[dict[str, Any]]:
    """The records in a folder's cases.jsonl, the latest last; none where there is no such file.

    Raises ValueError, naming file and line, for a line that is no record; a last line that was cut short is left out.
    """
    path = out / CASES_FILE
    lines = path.read_text(encoding="utf-8").split("\n") if path.is_file() else []
    found = []
    for number, line in enumerate(lines, 1):
        if not line.strip():
            continue
        try:
            found.append(json.loads(line))
        except ValueError as error:
            if number == len(lines):  # without an end of line: the process ended while it wrote
                break
            raise ValueError(f"{path}, line {number}: {error}; a record of a case was expected") from None
    return found
