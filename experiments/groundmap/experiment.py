"""`hedgebed ground`: K, C and sinkage of a spike from the map that ships, as a result and as a ground.toml."""

import math

from experiments.runs.folder import RunFolder
from experiments.runs.progress import Progress
from experiments.runs.result import Result, quantity
from experiments.runs.whole_runs import computed_run
from rigid.ground.flat_foot import DEPTHS, OVER_BALL
from rigid.ground_file import GROUND_FORMAT, Estimate, Foot, GroundFile
from rigid.platform.files import find_platform

from .answers import Answer, Number, TooDeepError
from .cohesive import CohesiveMap, Held
from .maps import GroundMap, read_map
from .settings import GroundSettings, say

__all__ = ["GROUND_FILE", "check", "ground_file", "resume", "run"]

GROUND_FILE = "ground.toml"
TO_90 = 1.645  # standard deviations of a 90 % interval

Map = GroundMap | CohesiveMap


def _answer(settings: GroundSettings) -> tuple[Map, Answer]:
    if settings.tip != "sphere":
        (shallow, deep), (first, last) = DEPTHS, OVER_BALL
        flat = say("flat_in_grains", shallow=shallow, deep=deep, first=first, last=last)
        raise ValueError(say("of_other_tip", tip=settings.tip, flat=flat if settings.tip == "flat" else ""))
    found = read_map(settings.material)
    return found, found.answer(
        gravity=settings.gravity, diameter=settings.tip_diameter, grain=settings.grain, packing=settings.packing,
        load=settings.load,
    )  # fmt: skip


def check(settings: GroundSettings) -> None:
    """Raise ValueError for a material or a tip without a map and for numbers beyond it."""
    _as_deep_as_known(settings)


def _as_deep_as_known(settings: GroundSettings) -> tuple[Map, Answer, bool]:
    """Map and answer; where the load sinks the spike deeper than the map goes, the answer without it, and True."""
    try:
        return *_answer(settings), False
    except TooDeepError:
        return *_answer(settings.model_copy(update={"load": None})), True


def _in_file(number: Number) -> tuple[float, float]:
    """The 90 % interval of a normal distribution, as ground files have it; it may begin below zero."""
    return number.value - TO_90 * number.std, number.value + TO_90 * number.std


def ground_file(settings: GroundSettings, table: Map, answer: Answer, held: Held | None = None) -> GroundFile:
    """The spring-damper of the answer; ``held``: what it owes to the cohesion of the soil, if that is to be noted."""
    notes = (say("of_map", answer=answer), *([] if held is None else [held.words]))

    def estimate(number: Number) -> Estimate:
        low, high = _in_file(number)
        return Estimate(value=number.value, std=number.std, interval=(max(0.0, low), high))

    depth = table.deepest * settings.tip_diameter
    return GroundFile(
        format=GROUND_FORMAT, law="spring-damper", material=table.name,
        source=f"hedgebed ground: {table.source}", notes=notes,
        foot=Foot(tip="sphere", diameter=settings.tip_diameter),
        parameters={"stiffness": estimate(answer.stiffness), "damping": estimate(answer.damping)},
        range={
            "load": (0.0, answer.stiffness.value * depth + answer.damping.value * answer.speed),
            "depth": (0.0, depth), "speed": (0.0, answer.speed), "gravity": (settings.gravity, settings.gravity),
            "diameter": (settings.tip_diameter, settings.tip_diameter),
        },
    )  # fmt: skip


def _of_no_platform(settings: GroundSettings, table: Map, answer: Answer) -> list[str]:
    """Where the load was not given and is not that of a platform: what that would be, and the sinkage under it."""
    in_rig = math.isclose(settings.gravity, table.reference["gravity"], rel_tol=1e-3)
    weight = table.reference["load"] if in_rig else 0.25 * find_platform("hedgehog").mass * settings.gravity
    if settings.load is not None or math.isclose(answer.load, weight, rel_tol=1e-3):
        return []
    try:
        _, heavier = _answer(settings.model_copy(update={"load": weight}))
        then = say("at_weight", mm=1e3 * heavier.sinkage.value, half=1e3 * heavier.sinkage.half)
    except ValueError:
        then = say("too_heavy", mm=1e3 * table.deepest * settings.tip_diameter)
    where = say("in_rig" if in_rig else "on_its_own")
    told = say("no_platform", answer=answer, reference=table.reference["load"], where=where, weight=weight, then=then)
    return [told]


def _compute(settings: GroundSettings, folder: RunFolder, progress: Progress) -> Result:
    if settings.threads is not None:
        progress.message(say("threads", s=settings))
    progress.stage("look up", total=1.0)
    table, answer, too_deep = _as_deep_as_known(settings)
    load = answer.load if settings.load is None else settings.load
    held = table.held(answer, load=load, gravity=settings.gravity, diameter=settings.tip_diameter)
    ground_file(settings, table, answer, held).write(folder.path / GROUND_FILE)
    progress.update(1.0)
    k, c, sinkage = answer.stiffness, answer.damping, answer.sinkage
    of_sinkage = quantity(sinkage.value, "m", say("of_sinkage", answer=answer), std=sinkage.std)
    quantities = {
        "stiffness": quantity(k.value, "N/m", say("of_stiffness"), std=k.std),
        "damping": quantity(c.value, "N s/m", say("of_damping"), std=c.std),
        "sinkage": quantity(None, "m", say("of_no_sinkage", load=load)) if too_deep else of_sinkage,
        "load": quantity(load, "N", "of the sinkage"),
        "speed": quantity(answer.speed, "m/s", say("of_speed")),
        "packing_fraction": quantity(answer.packing, "1", "of the bed"),
        "grain_ratio": quantity(answer.ratio, "1", "mean grain over tip diameter"),
    }
    words = table.words(answer, gravity=settings.gravity, diameter=settings.tip_diameter)
    unknown = [say("too_deep", load=load, deepest=1e3 * table.deepest * settings.tip_diameter)] if too_deep else []
    if held is not None:
        low, high = held.sinkage
        quantities |= {
            "sinkage_without_cohesion": quantity(low, "m", say("of_least", held=held), std=None),
            "sinkage_without_cohesion_most": quantity(high, "m", say("of_least_most", held=held), std=None),
        }
    unknown = [*([] if held is None else [held.words]), *unknown]
    warnings = [*unknown, *_of_no_platform(settings, table, answer), *words]
    low, high = c.value - c.half, c.value + c.half
    if low <= 0:
        warnings.append(say("unidentified", low=low, high=high))
    if answer.ratio < table.finest:
        warnings.append(say("extrapolated", answer=answer, finest=table.finest))
    if not answer.deep and not too_deep:
        warnings.append(say("shallow", depth=1e3 * table.reference["shallowest"] * settings.tip_diameter))
    if sinkage.value < answer.grain and not too_deep:
        warnings.append(say("below_grain", sinkage=1e3 * sinkage.value, grain=1e3 * answer.grain))
    return Result.make(
        "ground",
        title=say("title", s=settings, mm=1e3 * settings.tip_diameter),
        quantities=quantities,
        map={"source": table.source, "reference": dict(table.reference), "ranges": dict(table.ranges)},
        files={"ground": GROUND_FILE},
        warnings=warnings,
    )


run, resume = computed_run("ground", GroundSettings, _compute, check=check)
