"""Settings of a penetrate run that this machine or the grains' material cannot serve, refused before any work."""

import math
from collections.abc import Mapping

from dem.engine.values import refuse_sleep
from experiments.campaign.files import check_target
from experiments.grains.bearing import UNSURE
from experiments.grains.lammps import check_lammps
from experiments.grains.softening import check_young, drop_depth
from experiments.grains.staged import check_bed_stages
from experiments.grains.where import check_memory, check_where
from experiments.platform.ground_file import fitted_ground
from rigid.ground_file import GroundFile

from . import beds
from .amended import read_law
from .on_law import MOST_STEPS_ON_LAW, fastest_speed, law_step
from .reference import read_reference
from .rest import made_units
from .settings import PenetrateSettings, say
from .units import Unit, deepest, expected_time, plan_units

__all__ = ["check"]

MOST_GRAINS = 2**26
"""More are refused."""
MOST_STEPS = 1e9
"""Of the grains, in all runs; more are refused."""
_HALVINGS = 60  # Of an interval of depths, to the last digit


def check(settings: PenetrateSettings) -> None:
    """Raise ValueError, naming key, value and what is allowed, for what machine or material cannot serve."""
    if settings.model is not None:
        read_law(settings.model, settings)
    if settings.campaign is not None:
        check_target(settings.campaign)
    if not settings.on_grains:
        _check_steps_on_law(settings, fitted_ground(settings.ground))
        return
    stuff = beds.find_material(settings)
    check_lammps(settings, stuff)
    if settings.bed_stages is not None:
        size, grain, spread = settings.bed_size, settings.grain, settings.spread
        check_bed_stages(settings.bed_stages, stuff, size=size, grain=grain, spread=spread)
    for seeds, speeds in ((settings.seeds[:1], settings.speeds), (settings.seeds[1:], settings.other_speeds)):
        if seeds and not speeds:
            raise ValueError("other_speeds is empty: at least one speed is needed, so that every seed has a fit")
    count = settings.grain_count
    check_memory(count, settings.grain, "bed_size")
    if count > MOST_GRAINS:
        least = settings.grain * (count / MOST_GRAINS) ** (1 / 3)
        raise ValueError(say("grain_count", s=settings, count=count, most=MOST_GRAINS, least=least))
    if settings.sleep:
        refuse_sleep(arch=settings.arch, cohesion=beds.find_material(settings).cohesion)
    check_where(arch=settings.arch, threads=settings.threads, precision=settings.precision)
    if settings.young is not None:
        most = beds.find_material(settings).young
        if settings.young > most:
            young, whose = settings.young, settings.material
            raise ValueError(f"young = {young:g} Pa is more than {whose} itself has: at most {most:g} Pa is accepted")
        chosen = beds.choose_softness(settings.model_copy(update={"young": None})).young
        check_young(settings.young, chosen=chosen, max_overlap=settings.max_overlap)
    _check_reach(settings)
    step = beds.bed_step(settings, beds.choose_softness(settings).young)
    if found := settings.crossing(step, beds.find_material(settings).young):
        raise ValueError(found)
    _check_step_count(settings, step)
    if settings.reference not in (None, "shipped"):
        read_reference(str(settings.reference))


def _check_reach(settings: PenetrateSettings) -> None:
    """Refuse what would end near the floor, but for a load that no depth of the foot bears: that is an answer."""
    if not settings.loaded or beds.sinks_away(settings):
        return
    bears, floor = beds.expected_bearing(settings), deepest(settings)
    deeper = f"{floor:.3g} m, one tip's diameter above the floor"
    rests = bears.depth(settings.weight)
    if settings.weight > beds.resting_load(settings, sure=UNSURE):
        key = "load" if settings.load is not None else "platform_mass"
        value = f"{settings.load:g} N" if settings.load is not None else f"{settings.platform_mass:g} kg"
        on = "" if settings.load is not None else f", {settings.weight:.3g} N on a spike,"
        most = beds.resting_load(settings, sure=1 / UNSURE)
        raise ValueError(say("rests_deep", key=key, value=value, on=on, rests=rests, deeper=deeper, most=most))
    stiffness, load = UNSURE * bears.stiffness, settings.weight - bears.held
    for key in ("drop_speeds", "other_drop_speeds"):
        for speed in settings.used(key):
            with beds.within_numbers(settings):
                depth = drop_depth(speed, settings.mass, load, stiffness)
            if depth > floor:
                room = stiffness * floor**2 - 2 * load * floor
                slower = f"at most {math.sqrt(room / settings.mass):.2g} m/s" if room > 0 else "a smaller load"
                how = {"key": key, "speed": speed, "depth": depth}
                raise ValueError(say("drops_deep", **how, s=settings, deeper=deeper, slower=slower))


def _check_step_count(settings: PenetrateSettings, step: float) -> None:
    stiffness, held = beds.expected_stiffness(settings), beds.expected_bearing(settings).held
    units = made_units(settings, plan_units(settings))
    times = {unit: expected_time(settings, unit, stiffness, held=held) for unit in units}
    if sum(times.values()) / step > MOST_STEPS:
        raise ValueError(_too_long(settings, times, step, "steps", most=MOST_STEPS))


def _check_steps_on_law(settings: PenetrateSettings, fitted: GroundFile | None) -> None:
    """Refuse runs on a law that last too long in any case; `fitted` is the law in a file, None for one of a model.

    Drops and set-downs are counted by the least that they can last; `StepsOnLaw` ends those that last longer.
    """
    step = law_step(settings) * settings.substeps
    times = {}
    for unit in plan_units(settings.model_copy(update={"seeds": settings.seeds[:1]})):
        if unit.kind == "driven":
            times[unit] = settings.depth / unit.speed + settings.hold + settings.depth / settings.retreat_speed
        elif unit.kind == "drop":
            times[unit] = min(settings.drop_time, settings.rest_time, settings.after_stop)
        else:
            times[unit] = _least_sinkage(settings, fitted) / unit.speed + settings.rest_time
    if sum(times.values()) / step > MOST_STEPS_ON_LAW:
        fastest = fastest_speed(settings)
        raise ValueError(_too_long(settings, times, step, "steps_on_law", most=MOST_STEPS_ON_LAW, fastest=fastest))


def _least_sinkage(settings: PenetrateSettings, fitted: GroundFile | None) -> float:
    """Depth at which the law bears the load [m], at most where a set-down is stopped; 0 for the law of a model."""
    if fitted is None:
        return 0.0
    ground, low, high = fitted.ground(), 0.0, deepest(settings)
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if ground.force(middle, 0.0) >= settings.weight else (middle, high)
    return high


def _too_long(
    settings: PenetrateSettings, times: Mapping[Unit, float], step: float, sentence: str, **numbers: float
) -> str:
    """What to say of runs that last `times` [s], in steps of `step` [s]: the setting that the longest is owed to."""
    count = sum(times.values()) / step
    unit = max(times, key=lambda unit: times[unit])
    if unit.kind == "driven":
        parts = {
            f"speeds = {unit.speed:g} m/s": settings.depth / unit.speed,
            f"hold = {settings.hold:g} s": settings.hold,
            f"retreat_speed = {settings.retreat_speed:g} m/s": settings.depth / settings.retreat_speed,
        }
    elif unit.kind == "drop":
        parts = {f"after_stop = {settings.after_stop:g} s": settings.after_stop, f"mass = {settings.mass:g} kg": 0.0}
    else:
        sinking = times[unit] - settings.rest_time
        parts = {f"lowering_speed = {unit.speed:g} m/s": sinking}
        parts[f"rest_time = {settings.rest_time:g} s"] = settings.rest_time
    key = max(parts, key=lambda part: parts[part])
    return say(sentence, key=key, by=key.split()[0], own=times[unit] / step, step=step, count=count, **numbers)
