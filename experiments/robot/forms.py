"""By how much the answer of a robot depends on the form of its surface law: the same robot on the other laws of sand.

Each law has its own defaults for sand in the gravity of the run. They differ in what a fast or a flat foot meets:
inertia of the grains, damping, the power of the depth. None of them is the truth, so their range is an estimate of
the error that the form of the law makes, and no bound.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from experiments.runs.types import Json
from vis.page.numbers import between, foldable, in_one_unit

from . import say
from .depths import Deepest
from .flight import REST
from .laws import given_parameters
from .plan import RobotPlan, plan_robot
from .settings import DEFAULT
from .sure import ANSWER, Answer, entry

__all__ = ["MOST_INERTIA", "NO_FORMS", "Forms", "OnLaw", "expected_words", "forms_of", "other_laws", "with_grains"]

MOST_INERTIA = "inertia=10"
"""The largest inertia of `rft`, beside its default of plates (rigid/ground/rft.py)."""
DROPPED_INERTIA = "inertia=2"
"""Inertia of `rft` of a dropped ball: real sand is expected between it and grains (docs/notes/mujoco.md)."""
OF_MOTION = {"inertia", "rebound", "loss", "loss_speed"}
"""Parameters that change how a law follows a motion, not how strong the sand is."""
LAWS: tuple[tuple[str, tuple[str, ...]], ...] = (
    (DEFAULT, ()), (DEFAULT, (DROPPED_INERTIA,)), (DEFAULT, (MOST_INERTIA,)), ("spring-damper", ()),
    ("power-irreversible", ()), ("katsuragi-durian", ()), ("bekker", ()),
)  # fmt: skip
"""Laws that have numbers for sand, with their parameters."""
OF_LANDING = ("sinkage_largest", "largest_force")
"""Numbers that a landing after the first flight may decide; the others are those of the push."""


@dataclass(frozen=True, kw_only=True)
class OnLaw:
    """A robot on one law."""

    answer: Answer
    time: float  # Simulated [s]
    rising: bool = False  # Whether it ends on its way up, before it flies: its rise is not known
    deepest: Deepest | None = None  # The part of a foot that went deepest over the depth to which the law holds
    deepest_before: Deepest | None = None  # The same until the first flight
    push_speed: float | None = None  # Of the fastest foot in the ground when the push begins [m/s]
    fast: bool = False  # Whether a foot was faster than laws were compared with grains


@dataclass(frozen=True, kw_only=True)
class Forms:
    """The answer on several laws."""

    numbers: Json = field(default_factory=dict)  # As result.json has it under ``forms``; empty without another law
    words: tuple[str, ...] = ()  # Sentences on it


NO_FORMS = Forms()


def other_laws(plan: RobotPlan) -> dict[str, RobotPlan]:
    """Name of each law of sand that this robot may stand on too, with its parameters -> its plan.

    None where the ground is not sand, or where its numbers are given or from a file: what the other laws have are the
    defaults for sand. Those of `OF_MOTION` may be given. Laws that have no numbers for this gravity are left out.
    """
    s = plan.settings
    own = s.stiffness is not None or s.damping is not None or s.scale_with_gravity is not None
    own |= bool(set(given_parameters(s)) - OF_MOTION)
    if plan.surface.name != "sand" or plan.fitted is not None or own:
        return {}
    found, here = {}, _named(plan.law, s.ground_parameters)
    for law, parameters in LAWS:
        if (name := _named(law, parameters)) == here:
            continue
        settings = s.model_copy(update={"ground": law, "ground_parameters": parameters, "controller": None})
        try:
            other = plan_robot(settings, model=plan.model)
        except ValueError:  # no numbers for this gravity
            continue
        found[name] = replace(other, controller=plan.controller)
    return found


def forms_of(plan: RobotPlan, own: OnLaw, follow: Callable[[RobotPlan], OnLaw], *, sure: Mapping[str, Json]) -> Forms:
    """The answer on the law of a run and on the others.

    ``own``: the run. ``follow``: runs the robot of a plan, for long enough. ``sure``: the ranges of the run's own law,
    which those over the laws include. A law on which the robot cannot run is named and left out. So is one where it is
    on its way up at the end. Where it is so in the run itself, its law runs again, for long enough.
    """
    s, others = plan.settings, other_laws(plan)
    here = _named(plan.law, s.ground_parameters)
    if others and own.rising and own.time < 1.01 * s.duration:
        others = {here: plan, **others}
    runs, lost = {here: own}, []
    for name, other in others.items():
        try:
            runs[name] = follow(other)
        except (RuntimeError, ValueError):  # lost, or an exchange that would be unstable
            lost.append(name)
    if len(runs) == 1:
        return NO_FORMS
    numbers: Json = {
        "laws": {name: one.answer for name, one in runs.items() if not one.rising}, "duration": s.duration,
        "longest": max(one.time for one in runs.values()), "lost": lost,
        "rising": [name for name, one in runs.items() if one.rising], "fast": own.fast,
        "beyond": _beyond(runs, still=math.sqrt(2 * plan.numbers["gravity"].value * REST)),
        "beyond_later": _beyond_later(runs),
    }  # fmt: skip
    held = {} if own.rising else _held(numbers, {here: sure}).get(here, {})
    ends = [{name: one[end] for name, one in held.items()} for end in ("low", "high")]
    return _ranges(numbers, own.answer, ends, on_grains=False)


def _beyond(runs: Mapping[str, OnLaw], *, still: float) -> dict[str, str]:
    """Law -> why none of its numbers is to be quoted, of those outside the range that they hold in.

    A foot went deeper than its law holds before the first flight. Or it still moved when the push began, faster than
    ``still`` [m/s], where it was at rest on another law: the push then meets another state of the robot.
    """
    found = {}
    rested = any(one.push_speed is not None and one.push_speed <= still for one in runs.values())
    for name, one in runs.items():
        if one.rising:
            continue
        why = []
        if one.deepest_before is not None and one.deepest_before.beyond:
            why.append(_too_deep(one.deepest_before))
        if rested and one.push_speed is not None and one.push_speed > still:
            why.append(say("beyond_speed", speed=one.push_speed))
        if why:
            found[name] = say("and").join(why)
    return found


def _beyond_later(runs: Mapping[str, OnLaw]) -> dict[str, str]:
    """Law -> why its numbers of `OF_LANDING` are not to be quoted: a foot goes deeper than the law holds."""
    deep = {name: one.deepest for name, one in runs.items() if not one.rising}
    return {name: _too_deep(one) for name, one in deep.items() if one is not None and one.beyond}


def _held(numbers: Json, found: Mapping[str, Mapping[str, Any]]) -> dict[str, dict[str, Any]]:
    """Law -> those of its numbers that hold; laws without any are left out. ``numbers``: as of `Forms`."""
    beyond, later = numbers.get("beyond", ()), numbers.get("beyond_later", ())
    return {
        law: {name: value for name, value in values.items() if law not in later or name not in OF_LANDING}
        for law, values in found.items()
        if law not in beyond
    }


def _too_deep(one: Deepest) -> str:
    """How deep a foot went, and to which depth its law holds, in words."""
    times, most = one.depth / one.diameter, one.limit / one.diameter
    return say("beyond_depth", name=one.name, depth=1e3 * one.depth, times=times, most=most)


def with_grains(laws: Forms, best: Answer, *, depth: float | None = None) -> Forms:
    """The ranges over `laws`, widened to a run on grains with the answer `best`; as they are where there are none.

    ``depth``: of the bed [m], so that laws on which a foot sinks deeper are named; None: as `laws` have it.
    """
    if not laws.numbers:
        return laws
    numbers = laws.numbers if depth is None else {**laws.numbers, "bed_depth": depth}
    return _ranges(numbers, best, [best], on_grains=True)


def _ranges(numbers: Json, best: Answer, more: Sequence[Answer], *, on_grains: bool) -> Forms:
    """The ranges over the answers of ``laws`` in `numbers` and `more`, around the answer `best` of the run.

    Laws in ``beyond`` are not in them. Where no law is left there are none.
    """
    if not numbers["laws"]:
        return Forms(words=tuple(map(foldable, _left_out(numbers))))
    answers = _held(numbers, numbers["laws"])
    if not answers:
        numbers = {name: value for name, value in numbers.items() if name != "ranges"}
        words = expected_words(numbers, best, on_grains=on_grains)
        return Forms(numbers=numbers, words=tuple(map(foldable, words)))
    ranges = {}
    for name in best:
        values = [answer[name] for answer in (*answers.values(), *more) if name in answer]
        if len(values) > on_grains:  # of one law at least, beside the bed
            ranges[name] = entry(name, best[name], min(values), max(values))
    numbers = {**numbers, "ranges": ranges}
    words = expected_words(numbers, best, on_grains=on_grains)
    return Forms(numbers=numbers, words=tuple(map(foldable, words)))


def expected_words(numbers: Json, best: Answer, *, on_grains: bool) -> list[str]:
    """On which side real sand is expected, and rise or sinkage on each law, in sentences.

    ``numbers``: as of `Forms`. ``best``: answer of the run, on grains (`on_grains`) or on a law.
    """
    answers, ranges = numbers["laws"], numbers.get("ranges", {})
    told = "highest" if best["longest_flight"] > 0 else "sinkage_largest"
    beyond = {**(numbers.get("beyond_later", {}) if told in OF_LANDING else {}), **numbers.get("beyond", {})}
    later = [law for law in numbers.get("beyond_later", ()) if law not in beyond]
    each, ends = _shown(told, answers, ranges.get(told))
    what = say(f"called_{told}")
    near = [law for law in (_named(DEFAULT, (DROPPED_INERTIA,)), DEFAULT) if law in answers]
    held = "; ".join(f"{law} {number}" for law, number in each.items() if law not in beyond)
    key = "forms_with_grains" if on_grains else "forms_of_laws"
    said = [say(key, what=what, ends=ends, each=held)] if told in ranges else [say("forms_of_none", what=what)]
    if beyond:
        reasons = "; ".join(f"{law} {each[law]} ({why})" for law, why in beyond.items() if law in each)
        said.append(say("forms_beyond", each=reasons))
    if later:
        said.append(say("forms_beyond_later", laws="; ".join(later)))
    said += _left_out(numbers)
    if near and told in ranges:
        softer = on_grains and best["sinkage_largest"] > answers[near[0]]["sinkage_largest"]
        said += _expected(near[0], on_grains=on_grains, softer=softer, fast=numbers.get("fast", False))
    bed_depth = numbers.get("bed_depth", math.inf)
    deeper = [law for law, answer in answers.items() if answer["sinkage_largest"] > bed_depth and law not in beyond]
    said += [say("deeper_than_bed", laws="; ".join(deeper), depth=1e3 * bed_depth)] if deeper else []
    duration = numbers.get("duration")
    if duration and any(answer["longest_flight"] > 0 for answer in (best, *answers.values())):
        longest = numbers.get("longest", duration)
        more = say("forms_longer", longest=longest) if longest > 1.01 * duration else ""
        said.append(say("forms_until", duration=duration, more=more))
    return said


def _shown(name: str, answers: Mapping[str, Answer], over: Json | None) -> tuple[dict[str, str], str]:
    """Law -> this number of its answer, and the ends of the range `over` the laws, all in one unit."""
    unit, values = ANSWER[name], [answer[name] for answer in answers.values()]
    low, high = (over["low"], over["high"]) if over is not None else (min(values), max(values))
    shown = dict(zip(answers, in_one_unit(values, unit, widest=(low, high)), strict=True))
    if name == "highest":
        stay = (law for law, answer in answers.items() if answer["longest_flight"] == answer[name] == 0)
        shown |= dict.fromkeys(stay, say("no_hop"))
    return shown, between(low, high, unit)


def _expected(law: str, *, on_grains: bool, softer: bool, fast: bool) -> list[str]:
    """On which side of `law` real sand is expected, in a sentence: of grains that carry more, under a fast foot."""
    if not on_grains:
        return [say("fast_on_laws")] if fast else [say("laws_alone")]
    if softer:
        return [say("softer_grains", law=law)]
    return [say("expected_of_grains", law=law)] if fast else []


def _left_out(numbers: Json) -> list[str]:
    """Which laws are not in the ranges, and why, in sentences."""
    lost, up = (", ".join(numbers.get(key, ())) for key in ("lost", "rising"))
    on_the_way = [say("forms_rising", laws=up, longest=numbers["longest"])] if up else []
    return [*on_the_way, *([say("forms_lost", laws=lost)] if lost else [])]


def _named(law: str, parameters: tuple[str, ...]) -> str:
    """A law with the parameters that it is given."""
    return ", ".join((law, *parameters))
