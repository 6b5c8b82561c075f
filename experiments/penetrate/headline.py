"""What a run of `penetrate` shows on the terminal in the end: the table of its report, and the findings that matter.

Everything else is in the report and in result.json, and with ``--verbose`` on the terminal too.
"""

import re
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from experiments.runs.headline import headline_of_tiles
from experiments.runs.registry import Headline, findings_shown
from vis.page.numbers import foldable
from vis.penetrate.answer import answer_tiles
from vis.penetrate.errors import error_words
from vis.penetrate.summary_parts import as_foot

__all__ = ["penetrate_headline"]


def penetrate_headline(result: Mapping[str, Any]) -> Headline | None:
    """The short form of a result; None where it has no rows."""
    shown = headline_of_tiles(answer_tiles(result), result)
    if shown is None:
        return None
    if result.get("ground", "bed") != "bed":
        return shown if "ground_file" in result else replace(shown, notes=(*shown.notes, error_words(result)))
    warnings, said = list(result.get("warnings", [])), list(result.get("departures", {}).get("sentences", []))
    rest = list(result.get("rest", {}).get("sentences", []))
    changes = result.get("reference", {}).get("moved", {})
    parts = [
        f"{words} {100 * changes[name]['change']:+.0f} %"
        for name, words in (("stiffness", "K"), ("damping", "C"), ("sinkage_dem", "the sinkage"))
        if changes.get(name, {}).get("change") is not None
    ]
    moved = [f"Against the reference, {', '.join(parts)}."] if parts else []
    # Of a finding that goes on, as to how far beds differ, the first sentence.
    own = [re.split(r"(?<=\.)\s+(?=[A-Z])", text)[0] for text in said if not text.startswith("Against the reference")]
    kept = [*own[: findings_shown(warnings) - len(moved)], *moved]
    named = as_foot if result.get("spike", {}).get("tip") == "flat" else lambda texts: texts
    return replace(
        shown, warnings=tuple(map(foldable, named(warnings))), sentences=tuple(map(foldable, named([*rest, *kept]))),
        left=len(said) - len(kept),
    )  # fmt: skip
