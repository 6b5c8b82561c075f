"""By how much the answer of a robot depends on the form of its surface law: the same robot on the other laws of sand.

Each law has its own defaults for sand in the gravity of the run. They differ in what a fast or a flat foot meets:
inertia of the grains, damping, the power of the depth. None of them is the truth, so their range is an estimate of
the error that the form of the law makes, and no bound.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

from experiments.runs.types import Json
from vis.page.numbers import between, foldable, quantity

from . import say
from .laws import given_parameters
from .plan import RobotPlan, plan_robot
from .settings import DEFAULT
from .sure import ANSWER, Answer, entry

__all__ = ["MOST_INERTIA", "NO_FORMS", "Forms", "expected_words", "forms_of", "other_laws", "with_grains"]

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


def forms_of(
    plan: RobotPlan, best: Answer, follow: Callable[[RobotPlan], Answer], *, sure: Mapping[str, Json]
) -> Forms:
    """The answer on the law of a run and on the others.

    ``best``: answer of the run. ``follow``: runs the robot of a plan and returns its answer. ``sure``: the ranges of
    the run's own law, which those over the laws include. A law on which the robot cannot run is named and left out.
    """
    answers, lost = {_named(plan.law, plan.settings.ground_parameters): best}, []
    for name, other in other_laws(plan).items():
        try:
            answers[name] = follow(other)
        except (RuntimeError, ValueError):  # lost, or an exchange that would be unstable
            lost.append(name)
    if len(answers) == 1:
        return NO_FORMS
    ends = [{name: one[end] for name, one in sure.items()} for end in ("low", "high")]
    forms = _ranges(answers, best, ends, on_grains=False, duration=plan.settings.duration)
    words = [foldable(say("forms_lost", laws=", ".join(lost)))] if lost else []
    return replace(forms, words=(*forms.words, *words))


def with_grains(laws: Forms, best: Answer) -> Forms:
    """The ranges over `laws`, widened to a run on grains with the answer `best`; nothing where there are no laws."""
    if not laws.numbers:
        return NO_FORMS
    return _ranges(laws.numbers["laws"], best, [best], on_grains=True, duration=laws.numbers.get("duration"))


def _ranges(
    answers: Mapping[str, Answer], best: Answer, more: Sequence[Answer], *, on_grains: bool, duration: float | None
) -> Forms:
    """The ranges over `answers` and `more`, around the answer `best` of the run.

    ``duration``: of each run [s]; None where an older hedgebed has made it.
    """
    ranges = {}
    for name in ANSWER:
        values = [answer[name] for answer in (*answers.values(), *more) if name in answer]
        ranges[name] = entry(name, best[name], min(values), max(values))
    numbers: Json = {"laws": answers, "ranges": ranges, "duration": duration}
    words = expected_words(numbers, best, on_grains=on_grains)
    return Forms(numbers=numbers, words=tuple(map(foldable, words)))


def expected_words(numbers: Json, best: Answer, *, on_grains: bool) -> list[str]:
    """Rise or sinkage on each law, and on which side real sand is expected, in sentences.

    ``numbers``: as of `Forms`. ``best``: answer of the run, on grains (`on_grains`) or on a law.
    """
    answers, ranges = numbers["laws"], numbers["ranges"]
    told = "highest" if best["longest_flight"] > 0 else "sinkage_largest"
    unit, one = ANSWER[told], ranges[told]
    ends = between(one["low"], one["high"], unit)

    def shown(answer: Answer) -> str:
        return quantity({"value": answer[told], "std": None, "unit": unit})

    each = "; ".join(f"{law} {shown(answer)}" for law, answer in answers.items())
    near = next((law for law in (_named(DEFAULT, (DROPPED_INERTIA,)), DEFAULT) if law in answers), None)
    words = {"what": say(f"called_{told}"), "ends": ends, "each": each}
    said = [say("forms_with_grains" if on_grains else "forms_of_laws", **words)]
    if near is not None:
        key = "expected_of_grains" if on_grains else "expected_of_laws"
        said.insert(0, say(key, what=words["what"], law=near, low=shown(answers[near]), high=shown(best)))
    if numbers.get("duration") and any(answer["longest_flight"] > 0 for answer in (best, *answers.values())):
        said.append(say("forms_until", duration=numbers["duration"]))
    return said


def _named(law: str, parameters: tuple[str, ...]) -> str:
    """A law with the parameters that it is given."""
    return ", ".join((law, *parameters))
