"""What one standard deviation of K and C changes of a run in space on the spring-damper: the trial again on each."""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from coupling import SpatialRun
from experiments.platform.law_spread import (
    Answer,
    Seen,
    Uncertain,
    spread_entries,
    spread_of_surface,
    uncertain_of,
    with_spread,
)
from experiments.platform.settled import Number, of_earth
from experiments.platform.surfaces import find_surface
from experiments.runs.types import Json

from .result import quantities_of
from .trial import SpatialPlan

__all__ = ["add_spread", "uncertain_in"]

_SPREAD_OF = {"max_speed": "largest speed", "largest_turn": "largest turn", "sinkage_largest": "largest sinkage"}
"""Numbers whose spread a sentence states -> what it calls them."""
_OF_NO_LAW = ("energy_residual", "coupling_residual", "exchange_residual")


def uncertain_in(plan: SpatialPlan) -> list[Uncertain]:
    """K and C as far as they are those of the surface and have a standard deviation."""
    return uncertain_of(plan.numbers, find_surface(plan.surface))


def add_spread(
    plan: SpatialPlan,
    result: Json,
    run_on: Callable[[SpatialPlan], SpatialRun],
) -> None:
    """Add the standard deviations that follow from those of K and C, and a sentence on them.

    `run_on` makes the run of another plan, ready to be stepped.
    """
    uncertain, best = uncertain_in(plan), result["quantities"]
    depends = {name: entry["value"] for name, entry in best.items() if name not in _OF_NO_LAW}

    def moved(name: str, value: float) -> Answer:
        run = run_on(_moved(plan, name, value))
        run.run()
        return {name: entry["value"] for name, entry in quantities_of(run).items()}

    seen, trial = Seen(moved), plan.trial
    weights = {"mass": trial.platform.mass, "counterweight": trial.counterweight}
    weight = float(np.linalg.norm(trial.weight))
    beyond = bool(uncertain and of_earth(plan.numbers, plan.surface, weight=weight, **weights))
    if uncertain:
        stds = dict.fromkeys(depends) if beyond else spread_of_surface(uncertain, seen, depends)
        result["quantities"] = with_spread(best, stds)
    parameters = [one.name for one in uncertain]
    result["law_spread"], sentence = spread_entries(
        result["quantities"],
        _SPREAD_OF,
        surface=plan.surface,
        law="",
        parameters=parameters,
        absent=seen.absent(depends),
        beyond=beyond,
    )
    result["departures"]["sentences"].append(sentence)


def _moved(plan: SpatialPlan, name: str, value: float) -> SpatialPlan:
    """The plan with another K or C."""
    parameters: Mapping[str, float] = {**plan.trial.ground_parameters, name: value}
    numbers = {**plan.numbers, name: Number(value, plan.numbers[name].unit, "moved")}
    return replace(plan, trial=replace(plan.trial, ground_parameters=parameters), numbers=numbers)
