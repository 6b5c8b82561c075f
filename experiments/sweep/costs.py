"""What the runs of a sweep cost, reckoned before the first."""

from collections.abc import Sequence

from pydantic import BaseModel

from experiments.converge.costs import core_hours
from experiments.penetrate.settings import PenetrateSettings
from experiments.runs.progress import duration
from experiments.suite.cases import cost_of_tumble
from experiments.tumble.settings import TumbleSettings

from .design import Point

__all__ = ["core_seconds", "cost_words"]

ON_A_LAW = 0.5
"""Of a run of `hop` or `tumble` on a law, one core, without its report [s]: measured, docs/scale.md."""
_CORES = 2
"""Cores that the estimate of a tumble on grains is for."""


def core_seconds(command: str, settings: BaseModel) -> float | None:
    """About how long a run takes one core [s], its bed included; None where nothing is known."""
    if isinstance(settings, PenetrateSettings) and command == "penetrate" and settings.on_grains:
        return 3600 * core_hours(settings) * len(settings.seeds)
    if isinstance(settings, TumbleSettings) and settings.on_grains:
        return _CORES * cost_of_tumble(settings).seconds
    return ON_A_LAW if command in ("hop", "tumble", "penetrate") else None


def cost_words(command: str, points: Sequence[Point], cores: int) -> tuple[list[float], str]:
    """The cost of each run, 1 where it is unknown, and a sentence on the whole cost on so many cores."""
    known = [core_seconds(command, point.settings) for point in points]
    costs = [1.0 if cost is None else cost for cost in known]
    if None in known:
        return costs, f"what a run of {command} costs has no estimate: the first ones will show it"
    whole = sum(costs)
    shared = f", {duration(whole / cores)} on {cores} cores" if cores > 1 else ""
    return costs, f"about {duration(whole)} of one core by the estimate{shared}"
