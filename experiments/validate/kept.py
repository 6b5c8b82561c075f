"""The result that docs/validation.md is made of, kept in the checkout; cases that were run by themselves go into it.

Long cases need not all be run in one go then: `hedgebed validate --only sink-from-rest --keep` puts its row into the
table with its own date, command and code, and leaves the others as they are.
"""

import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from experiments.runs.folder import write_text
from experiments.runs.types import Json

from .base.case import Case

__all__ = ["FILE", "merged_rows", "read", "write"]

FILE = Path("docs/results/validate/result.json")
RAN = ("pass", "fail")


def read(root: Path) -> Json | None:
    """The result kept in a checkout, or None where there is none."""
    path = root / FILE
    return dict(json.loads(path.read_text(encoding="utf-8"))) if path.is_file() else None


def write(root: Path, result: Mapping[str, Any]) -> None:
    """Keep a result, without what its plots are drawn from (that is in the run folder)."""
    slim = {key: value for key, value in result.items() if key not in ("departures", "warnings")}
    slim["cases"] = [{key: value for key, value in row.items() if key != "plots"} for row in result["cases"]]
    (root / FILE).parent.mkdir(parents=True, exist_ok=True)
    write_text(root / FILE, json.dumps(slim, indent=0) + "\n")


def merged_rows(
    before: Iterable[Mapping[str, Any]], now: Iterable[Mapping[str, Any]], suite: Sequence[Case], *, command: str
) -> list[Json]:
    """A row for each case of the suite: as run now, or as it was before, or what is known of one that was not run."""
    ran = {row["id"]: dict(row) | {"command": command} for row in now if row["status"] in RAN}
    old = {row["id"]: dict(row) for row in before if row["status"] in RAN}
    rows = []
    for case in suite:
        row = dict(case.head()) | (ran.get(case.id) or old.get(case.id) or {})
        if row.get("status") == "fail":
            row["reason"] = case.reason or row.get("reason", "")
        if "status" not in row:
            row |= {"status": "not run"} if case.compute else {"status": "not yet", "waits_for": case.waits_for}
        rows.append(row)
    return rows
