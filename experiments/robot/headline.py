"""What a run of a robot shows on the terminal in the end: the rows of the report's answer, warnings, first findings.

Everything else is in the report and in result.json, and with ``--verbose`` on the terminal too.
"""

from collections.abc import Mapping
from typing import Any

from experiments.runs.registry import Headline, findings_shown
from vis.page.answer import answer
from vis.page.numbers import foldable
from vis.robot.answer import answer_tiles

__all__ = ["robot_headline"]


def robot_headline(result: Mapping[str, Any]) -> Headline | None:
    """The short form of a result; None where it has no numbers. The table is the report's, without its remarks."""
    if not result.get("quantities"):
        return None
    table = answer(answer_tiles(result), result)[0]
    rows = [tuple(foldable(cell) for cell in row[:-1]) for row in table.rows]
    warnings, said = result.get("warnings", []), result.get("departures", {}).get("sentences", [])
    shown = said[: findings_shown(warnings)]
    return Headline(
        tuple(table.head[:-1]), tuple(rows), tuple(map(foldable, warnings)), tuple(map(foldable, shown)),
        len(said) - len(shown),
    )  # fmt: skip
