"""How sure the answer of a robot's run is: on a law what its numbers leave open, over several beds their scatter.

On a law the same robot runs again at both ends of what is known. K of the surface is at the ends of its 95 % interval,
or of its range. Of a ground file each uncertain parameter is moved by itself (`law_spread`).
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import replace

from experiments.platform.law_spread import moved, spread_of_law
from experiments.runs.types import Json
from rigid.intervals import NORMAL
from vis.page.numbers import between, foldable, quote
from vis.robot.answer import BALLISTIC

from . import say
from .plan import RobotPlan

__all__ = ["ANSWER", "DISTANCE", "Answer", "answer_of", "entry", "in_words", "sure_of_law"]

ANSWER = {
    "highest": "m", "longest_flight": "s", "clearance_largest": "m", "sinkage_largest": "m", "largest_force": "N",
}  # fmt: skip
"""Numbers that answer how well a robot hops, with their units. The clearance is of any foot."""
DISTANCE = "hop_distance"
"""Also an answer of a robot that can move along the ground [m]."""
_UNITS = {**ANSWER, DISTANCE: "m"}
_SIGNED = ("highest",)  # May be below 0: the centre of mass stays below its start

Answer = Mapping[str, float]


def answer_of(
    quantities: Mapping[str, Json], reached: Mapping[str, Mapping[str, float]], *, hop: bool = True
) -> dict[str, float]:
    """The numbers of `ANSWER` from quantities and ``feet_reached`` of a result, ballistic ones before others.

    That of `DISTANCE` too, of a robot that can move along the ground.

    ``hop``: False where the robot stays on the ground (`experiments.robot.flight.stays`). Its rise is then 0, and so is
    the clearance of a single foot: a robot of several feet may lift one while it stands on others.
    """
    values = {name: one["value"] for name, one in quantities.items()}
    values["clearance_largest"] = max(foot["clearance_largest"] for foot in reached.values())
    if not hop:
        values |= {"highest": 0.0} | ({"clearance_largest": 0.0} if len(reached) == 1 else {})
    along = {DISTANCE: float(values[DISTANCE] or 0.0)} if DISTANCE in values else {}
    return {name: float(values.get(BALLISTIC.get(name, name), values[name])) for name in ANSWER} | along


def entry(name: str, value: float, low: float, high: float) -> Json:
    """An entry of ``sure`` in result.json: a number of `ANSWER` with the ends of its interval.

    None is below 0 but that of the rise.
    """
    least = -math.inf if name in _SIGNED else 0.0
    return {"unit": _UNITS[name], "value": value, "low": max(least, low), "high": max(least, high)}


def in_words(sure: Mapping[str, Json], *, half: bool) -> str:
    """The entries in words: mean and half-width (`half`), or both ends."""
    told = {
        name: quote(one["value"], one["high"] - one["value"], one["unit"])
        if half
        else between(one["low"], one["high"], one["unit"])
        for name, one in sure.items()
    }
    distance = say("answer_distance", **told) if DISTANCE in told else ""
    return foldable(say("answer", **told, distance=distance))


def sure_of_law(plan: RobotPlan, best: Answer, follow: Callable[[RobotPlan], Answer]) -> tuple[Json, str]:
    """The entries of a run on a law, and a sentence on them; no entries, and why, where nothing is known.

    ``best``: answer of the run. ``follow``: runs the robot of a plan and returns its answer.
    """
    try:
        return _of_file(plan, best, follow) if plan.fitted is not None else _of_stiffness(plan, best, follow)
    except (RuntimeError, ValueError) as error:  # lost, or an exchange that would be unstable
        return _not_known(plan, say("end_fails", error=error))


def _of_file(plan: RobotPlan, best: Answer, follow: Callable[[RobotPlan], Answer]) -> tuple[Json, str]:
    """95 % intervals by the errors of the parameters of a ground file."""
    assert plan.fitted is not None
    if not moved(plan.fitted):
        return _not_known(plan, say("no_range_of_law", law=plan.law))
    stds = spread_of_law(plan.fitted, lambda file: follow(replace(plan, fitted=file)), best)
    halves = {name: NORMAL * (std or 0.0) for name, std in stds.items()}
    sure = {name: entry(name, best[name], best[name] - half, best[name] + half) for name, half in halves.items()}
    return sure, say("of_file", words=in_words(sure, half=False))


def _of_stiffness(plan: RobotPlan, best: Answer, follow: Callable[[RobotPlan], Answer]) -> tuple[Json, str]:
    """K of the surface at the ends of what is known of it."""
    surface, known = plan.surface, plan.rule.answer
    if plan.law != "spring-damper":
        return _not_known(plan, say("no_range_of_law", law=plan.law))
    if plan.settings.stiffness is not None:
        return _not_known(plan, say("k_given"))
    share = known.stiffness.std / known.stiffness.value if known is not None else 1.0
    if share < 1.0:
        factors, how = _in_95(share)
    elif surface.stiffness_range is not None:
        low, high = surface.stiffness_range
        factors = (low / surface.stiffness, high / surface.stiffness)
        how = {"key": "k_in_range", "factor": math.sqrt(high / low)}
    else:
        return _not_known(plan, say("no_range_of_k", surface=surface.name))
    found = [best, *(follow(_times(plan, factor)) for factor in factors)]
    sure = {
        name: entry(name, best[name], min(one[name] for one in found), max(one[name] for one in found)) for name in best
    }
    key = str(how.pop("key"))
    return sure, say(key, surface=surface.name, words=in_words(sure, half=False), **how)


def _in_95(share: float) -> tuple[tuple[float, float], Json]:
    """Ends of the 95 % interval of K over its value, and how that is said. ``share``: its standard deviation over it.

    Where the lower end would be 0 or less, which K cannot be, the upper end stands as a factor both ways.
    """
    half = NORMAL * share
    if half < 1.0:
        return (1 - half, 1 + half), {"key": "k_of_map", "share": half}
    return (1 / (1 + half), 1 + half), {"key": "k_in_range", "factor": 1 + half}


def _not_known(plan: RobotPlan, why: str) -> tuple[Json, str]:
    """No entries, why, and what would state them: beds of the grains of the surface, another K of hard ground."""
    return {}, say("not_known" if plan.surface.granular else "not_known_hard", why=why)


def _times(plan: RobotPlan, factor: float) -> RobotPlan:
    """The plan with K of the surface, or of each foot where a map has it, times a factor."""
    stiffness = plan.numbers["stiffness"]
    numbers = {**plan.numbers, "stiffness": replace(stiffness, value=factor * stiffness.value)}
    return replace(plan, numbers=numbers, rule=plan.rule.stiffer(factor))
