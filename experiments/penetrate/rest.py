"""Where a foot comes to rest, and whether it does: before the runs by what a bed bears, after them by what it bore.

Grains without cohesion bear in proportion to gravity and to depth (Kang et al. 2018, Nat. Commun. 9:1101): a load W
rests at W / K, which in low gravity may be far below any foot. That is an answer: the runs that would only go to the
floor are left out. The depth is computed from the bed's own force, as W / K with the fitted K, beside that of a flat
plate in 3D-RFT (`experiments.grains.softening`). Both extrapolate far beyond the drive, hence both are reported. A
power law fitted to a drive is no alternative. A flat tip is carried at depth 0 already, which lowers its exponent (to
0.54 in a test) and turns metres into hundreds of metres.
"""

import math
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from dem.grains.materials import MATERIALS, REAL_GRAINS, real_grain_of
from experiments.grains.bearing import (
    COHESIONS,
    UNSURE,
    bearing_capacity,
    bearing_of,
    cohesion_in_95,
    enough_cohesion,
    footing_angles,
    footing_depths,
    strength,
)
from experiments.runs.types import Json
from rigid.platform.rig import STANDARD_GRAVITY
from vis.penetrate.summary_parts import joined

from . import beds
from .findings import Findings
from .settings import PenetrateSettings, say
from .sure import (
    Interval,
    ends_of,
    in_words,
    interval_of_rest,
    interval_of_sinkage,
    interval_of_stiffness,
    known_within,
)
from .units import Unit

__all__ = ["answer", "how_sure", "made_units", "real_grain", "sinkage_interval"]

_BESIDE = "jsc-1a-loose-cut"
"""The material to try where grains without cohesion do not bear."""


def made_units(settings: PenetrateSettings, units: Sequence[Unit]) -> list[Unit]:
    """Those of the runs that are made: drops and set-downs of a load that only goes to the floor are left out."""
    return [unit for unit in units if unit.kind == "driven"] if beds.sinks_away(settings) else list(units)


def answer(findings: Findings, material: Any) -> Json | None:
    """The entry "rest" of result.json: how deep the load would rest, and what cohesion would change.

    Where a set-down came to rest: what cohesion and K give for a flat foot in grains that stick (`_stuck`), else
    None. None too where a set-down ended otherwise than at rest or at the floor.
    """
    settings = findings.settings
    stood = findings.of("set_down")
    if not (settings.set_down or (settings.dropped_speeds and beds.sinks_away(settings))):
        return None  # nobody asked
    if stood and not all(run.ended == "max_depth" for run in stood):
        rests = any(depth is not None for depth in findings.sinkages(findings.beds))
        return _stuck(settings, material) if rests and settings.tip == "flat" else None
    load, area = settings.weight, math.pi * settings.tip_diameter**2 / 4
    expected = beds.expected_bearing(settings)
    stiffness = findings.fit.stiffness if findings.fit.stiffness > 0 else expected.stiffness
    plate = beds.expected_stiffness(settings) / strength(material)
    depths = [load / stiffness, max(0.0, load - expected.held) / plate]
    low, high = min(depths), max(depths)
    never = low > settings.foot
    angles = footing_angles(material)
    per_pascal = bearing_capacity(1.0, angles[0]) * area
    rows = [{"cohesion": c, "carries": c * per_pascal, "depth": max(0.0, load - c * per_pascal) / stiffness}
            for c in COHESIONS]  # fmt: skip
    enough = [enough_cohesion(load / area, angle) for angle in angles]
    formula = footing_depths(material, load / area, gravity=settings.gravity, diameter=settings.tip_diameter)
    told: Json = {
        "s": settings, "depth": _length(depths[0]), "foot": 1e3 * settings.foot, "floor": 1e3 * settings.bed_size[2],
        "plate": _length(depths[1]), "formula": _lengths(*formula), "angle": angles[0],
        "angles": ends_of(angles[0], angles[-1]), "enough": ends_of(enough[-1], enough[0], digits=2),
        "g": settings.gravity / STANDARD_GRAVITY, "driven": 1e3 * settings.depth,
        "of_k": "the fitted K" if findings.fit.stiffness > 0 else "the expected K",
        "body": say("body_first"),
    }  # fmt: skip
    beside = _beside(settings) if material.cohesion == "none" else None
    sentences = [say("rests_never" if never else "rests_below_the_bed", **told)]
    sentences += [say("by_formula", **told)] if never and beside is not None else []
    sentences += [say("left_out")] if not stood else []
    sentences += [say("with_cohesion", **told)] + ([] if beside is None else [beside.pop("sentence")])
    return {
        "comes_to_rest": False, "at_any_depth_of_the_foot": not never, "load": load, "foot": settings.foot,
        "depth": depths[0], "depth_range": [low, high], "depth_expected": expected.depth(load),
        "depth_formula": list(formula) if material.cohesion == "none" else None,
        "stiffness": stiffness, "stiffness_plate": plate,
        "friction_angle": angles[0], "cohesion_enough": enough[0], "cohesions_enough": enough, "cohesions": rows,
        "sentences": sentences, "source": say("terzaghi"), **({} if beside is None else {"beside": beside}),
    }  # fmt: skip


def _beside(settings: PenetrateSettings) -> Json:
    """The foot on `_BESIDE`: the cohesion that carries it by each angle, and the depth at which it would rest.

    Friction angles and K are those of `_BESIDE`, not of these grains: N_c grows from 32 at 31 degrees to 55 at 37.
    """
    found, told = _by_cohesion(settings, MATERIALS[_BESIDE])
    verdict = say(f"beside_{told.pop('verdict')}", **told)
    return found | {"sentence": say("try_cohesive", **told, verdict=verdict)}


def _stuck(settings: PenetrateSettings, material: Any) -> Json | None:
    """The entry "rest" of a flat foot that rests on grains that stick, larger than real ones; None where the cohesion
    has no known error. K is the one expected of the material (`bearing_of`).
    """
    if cohesion_in_95(material) is None:
        return None
    found, told = _by_cohesion(settings, material)
    verdict = say(f"sticky_{told.pop('verdict')}", **told)
    verdict += f". {say('body_first')}" if found["depth_range"][1] > settings.foot else ""
    return {
        "comes_to_rest": True, "load": settings.weight, **found,
        "sentences": [say("on_sticky", **told, mm=1e3 * settings.grain, verdict=verdict)], "source": say("terzaghi"),
    }  # fmt: skip


def _by_cohesion(settings: PenetrateSettings, material: Any) -> tuple[Json, Json]:
    """The cohesion that a material has and needs, and the depths [m] where the rest of the load is carried.

    Two estimates, and the range holds both: the K expected of the material, times `UNSURE` at the lower end and over it
    at the upper, and Terzaghi's formula over the angles of the material. The cohesion is taken at the ends of its 95 %
    interval. Returns the numbers, and what the sentences on them take, with "verdict": holds, sinks or open.
    """
    found = cohesion_in_95(material)
    assert found is not None
    load, area, angles = settings.weight, math.pi * settings.tip_diameter**2 / 4, footing_angles(material)
    needs = [enough_cohesion(load / area, angle) for angle in angles]  # falls with the angle
    shares = [max(0.0, 1.0 - found.most / needs[-1]), max(0.0, 1.0 - found.least / needs[0])]
    stiffness = bearing_of(material, grain=settings.grain, gravity=settings.gravity, area=area).stiffness
    soft, hard = load * UNSURE / stiffness, load / (UNSURE * stiffness)
    strong, weak = (
        footing_depths(material, load / area, gravity=settings.gravity, diameter=settings.tip_diameter, cohesion=c)
        for c in (found.most, found.least)
    )
    by_k = (hard * shares[1], soft * shares[1])
    low, high = min(hard * shares[0], strong[0]), max(by_k[1], weak[1])
    numbers: Json = {
        "material": material.name, "cohesion": found.value, "cohesion_95": [found.least, found.most],
        "friction_angles": list(angles), "cohesions_enough": needs, "depth_range": [low, high],
        "depth_expected_k": list(by_k), "depth_formula": list(weak),
        "stiffness": stiffness,
    }  # fmt: skip
    told: Json = {
        "name": material.name, "beside": material.name, "cohesion": found.value, "least": found.least,
        "most": found.most, "low": _length(low), "high": _length(high), "by_k": _lengths(*by_k),
        "by_formula": _lengths(*weak), "needs": say("needs", needs=_listed(needs, digits=2), angles=_listed(angles)),
        "without": f"with {found.least:.2g} Pa" if found.least > 0 else "without cohesion",
        "verdict": "holds" if high == 0 else "sinks" if low > 0 else "open",
    }  # fmt: skip
    told["bounds"] = say("bounds", **told)
    return numbers, told | {"branches": say("branches", **told)}


def real_grain(settings: PenetrateSettings, material: Any) -> float:
    """Mean diameter of the real grains [m]; 0 where the material does not state it, which makes errors wider."""
    if material.name in REAL_GRAINS:
        return REAL_GRAINS[material.name]
    return (real_grain_of(settings.material) if Path(settings.material).is_file() else None) or 0.0


def sinkage_interval(findings: Findings, material: Any) -> Interval | None:
    """How sure the depth at rest is; None where no set-down came to rest."""
    settings = findings.settings
    return interval_of_sinkage(
        findings.sinkages(findings.beds), tip=settings.tip, grain=settings.grain,
        real=real_grain(settings, material), cohesive=material.cohesion != "none",
    )  # fmt: skip


def how_sure(findings: Findings, material: Any, rest: Json | None) -> Json:
    """The entry "sure" of result.json: sinkage, K and depth to rest with the ends of their 95 % intervals.

    `rest` gets the sentence on its depth.
    """
    settings, sunk = findings.settings, sinkage_interval(findings, material)
    beds_k = [fit.stiffness for fit in findings.seed_fits.values()] if findings.beds_separate else []
    stiffness = None if not findings.fit.separates else interval_of_stiffness(
        findings.fit.stiffness, beds_k, tip=settings.tip,
        grain=settings.grain, real=real_grain(settings, material), diameter=settings.tip_diameter,
        cohesive=material.cohesion != "none",
    )  # fmt: skip
    found = {
        name: {"unit": unit, **asdict(interval), "sentence": _in_a_sentence(findings, name, interval, unit)}
        for name, interval, unit in (("sinkage_dem", sunk, "m"), ("stiffness", stiffness, "N/m"))
        if interval is not None
    }
    if rest is None or rest["comes_to_rest"]:
        return found
    force = max(float(run.force.max()) for run in findings.of("driven"))
    ends = None if stiffness is None else interval_of_rest(settings.weight, stiffness, rest["depth_range"][1])
    beyond = settings.weight / force if force > 0 else None
    low, high = ends or (None, None)
    one = ", in one of the beds" if len(findings.seeds) > 1 else ""
    times = "" if beyond is None else say("far_beyond", times=_two_digits(beyond), force=f"{force:.2g}", one=one)
    if low is None:
        known = say("rest_unknown", why=_why_unknown(findings, stiffness, cohesive=material.cohesion != "none"))
    else:
        known = say("rest_beyond", low=_length(low)) if high is None else _within(low, high, rest["depth_expected"])
    if low is not None and not findings.beds_separate:
        known = f"{known}. {say('rest_as_of_one_bed')}"
    said = f"{times}{known}"
    rest["sentences"] = [rest["sentences"][0], said, *rest["sentences"][1:]]
    depth = {"unit": "m", "value": rest["depth"], "low": low, "high": high, "times_beyond": beyond, "sentence": said}
    return found | {"depth_to_rest": depth}


def _within(low: float, high: float, expected: float) -> str:
    """The interval of the depth to rest, and whether the depth expected before the run is inside."""
    inside = say("expected_inside" if low <= expected <= high else "expected_outside", expected=_length(expected))
    return say("rest_within", ends=in_words(low, high, "m"), inside=inside)


def _why_unknown(findings: Findings, stiffness: Interval | None, *, cohesive: bool) -> str:
    """What is missing for an interval of K, and so of the depth to rest."""
    if findings.fit.stiffness <= 0:
        return say("k_is_zero")
    if not findings.fit.separates:
        return say("k_not_separated")
    if stiffness is not None and stiffness.chance is None and not cohesive:
        return say("k_of_one_bed")
    return say("k_among_sticky_grains")


def _in_a_sentence(findings: Findings, name: str, interval: Interval, unit: str) -> str:
    """What is known of a number, and which runs would reduce its error."""
    count = sum(value is not None for value in findings.sinkages(findings.beds))
    count = len(findings.seeds) if name == "stiffness" else count
    what = "the sinkage at rest" if name == "sinkage_dem" else "K"
    if interval.low is not None and interval.high is not None:
        whence = say("chance_kept") if interval.one_bed else say("chance_beds", count=count)
        if name == "stiffness" and interval.one_bed and len(findings.seeds) > 1:
            whence = say("chance_not_separated")
        return say("sure_within", what=what, ends=known_within(interval.low, interval.high, unit), whence=whence)
    if interval.chance is None:
        return say("sure_unknown", what=what)
    return say("sure_chance", what=what, ends=known_within(*interval.chance, unit), count=count)


def _two_digits(number: float) -> str:
    return f"{float(f'{number:.2g}'):g}"


def _length(depth: float) -> str:
    return f"{depth:.2g} m" if depth >= 0.1 else f"{1e3 * depth:.2g} mm"


def _lengths(low: float, high: float) -> str:
    """Two depths with one unit, or one where they are the same."""
    return in_words(low, high, "m") if high > low else _length(low)


def _listed(values: Sequence[float], *, digits: int = 3) -> str:
    """Some numbers: "54, 35 or 7.2"."""
    return joined([f"{value:.{digits}g}" for value in values], last="or")
