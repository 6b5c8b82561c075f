"""By how much the answer of a robot depends on the form of its surface law: the same robot on the other laws of sand.

Each law has its own defaults for sand in the gravity of the run. They differ in what a fast or a flat foot meets:
inertia of the grains, damping, the power of the depth. None of them is the truth, so their range is an estimate of
the error that the form of the law makes, and no bound.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

from experiments.runs.types import Json
from vis.page.numbers import between, foldable, in_one_unit

from . import say
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


@dataclass(frozen=True, kw_only=True)
class OnLaw:
    """A robot on one law."""

    answer: Answer
    time: float  # Simulated [s]
    rising: bool = False  # Whether it ends on its way up, before it flies: its rise is not known


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
        "rising": [name for name, one in runs.items() if one.rising],
    }  # fmt: skip
    ends = [] if own.rising else [{name: one[end] for name, one in sure.items()} for end in ("low", "high")]
    return _ranges(numbers, own.answer, ends, on_grains=False)


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

    Where the robot is on its way up at the end on all of them there are none.
    """
    answers = numbers["laws"]
    if not answers:
        return Forms(words=tuple(map(foldable, _left_out(numbers))))
    ranges = {}
    for name in best:
        values = [answer[name] for answer in (*answers.values(), *more) if name in answer]
        ranges[name] = entry(name, best[name], min(values), max(values))
    numbers = {**numbers, "ranges": ranges}
    words = expected_words(numbers, best, on_grains=on_grains)
    return Forms(numbers=numbers, words=tuple(map(foldable, words)))


def expected_words(numbers: Json, best: Answer, *, on_grains: bool) -> list[str]:
    """On which side real sand is expected, and rise or sinkage on each law, in sentences.

    ``numbers``: as of `Forms`. ``best``: answer of the run, on grains (`on_grains`) or on a law.
    """
    answers, ranges = numbers["laws"], numbers["ranges"]
    told = "highest" if best["longest_flight"] > 0 else "sinkage_largest"
    unit, one = ANSWER[told], ranges[told]
    shown = in_one_unit([answer[told] for answer in answers.values()], unit, widest=(one["low"], one["high"]))
    if told == "highest":
        no_hop, stay = say("no_hop"), [answer["longest_flight"] == answer[told] == 0 for answer in answers.values()]
        shown = [no_hop if stays else number for stays, number in zip(stay, shown, strict=True)]
    each = "; ".join(f"{law} {number}" for law, number in zip(answers, shown, strict=True))
    words = {"what": say(f"called_{told}"), "ends": between(one["low"], one["high"], unit), "each": each}
    near = next((law for law in (_named(DEFAULT, (DROPPED_INERTIA,)), DEFAULT) if law in answers), None)
    said = [say("forms_with_grains" if on_grains else "forms_of_laws", **words), *_left_out(numbers)]
    if near is not None:
        softer = on_grains and best["sinkage_largest"] > answers[near]["sinkage_largest"]
        of_grains = "softer_grains" if softer else "expected_of_grains"
        said.append(say(of_grains if on_grains else "expected_of_laws", law=near))
    bed_depth = numbers.get("bed_depth", math.inf)
    deeper = [law for law, answer in answers.items() if answer["sinkage_largest"] > bed_depth]
    said += [say("deeper_than_bed", laws="; ".join(deeper), depth=1e3 * bed_depth)] if deeper else []
    duration = numbers.get("duration")
    if duration and any(answer["longest_flight"] > 0 for answer in (best, *answers.values())):
        longest = numbers.get("longest", duration)
        more = say("forms_longer", longest=longest) if longest > 1.01 * duration else ""
        said.append(say("forms_until", duration=duration, more=more))
    return said


def _left_out(numbers: Json) -> list[str]:
    """Which laws are not in the ranges, and why, in sentences."""
    lost, up = (", ".join(numbers.get(key, ())) for key in ("lost", "rising"))
    on_the_way = [say("forms_rising", laws=up, longest=numbers["longest"])] if up else []
    return [*on_the_way, *([say("forms_lost", laws=lost)] if lost else [])]


def _named(law: str, parameters: tuple[str, ...]) -> str:
    """A law with the parameters that it is given."""
    return ", ".join((law, *parameters))
