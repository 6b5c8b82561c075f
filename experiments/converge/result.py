"""The result of a sweep in numbers, tables and sentences; and the advice that is printed before its work."""

from collections.abc import Iterator, Mapping, Sequence
from statistics import fmean
from typing import Any

import numpy as np

from dem.grains.materials import caveat
from experiments.penetrate import beds
from experiments.runs.result import Result, quantity
from experiments.runs.types import Json
from vis.page.numbers import column, foldable

from .analysis import QUANTITIES, REST, Finding, findings_of, told, two_finest
from .costs import core_hours, step_count
from .design import BASE, Member, Variant, inertial_number, told_of
from .settings import ConvergeSettings, say
from .statistics import Interval, interval_of

__all__ = ["conclude", "doubts", "plan_told"]

ENOUGH_SIZES, ENOUGH_ACROSS, ENOUGH_WIDE, ENOUGH_BEDS = 3, 10.0, 9.0, 5
"""What a sweep wants to show something: sizes, grains across the tip in the finest, width [tips], beds."""


def plan_told(settings: ConvergeSettings, members: Sequence[Member], left_out: Sequence[Member]) -> Iterator[str]:
    """What the sweep is going to cost, a line for each variant and one for all."""
    for variant in dict.fromkeys(member.variant for member in members):
        own = [member for member in members if member.variant == variant]
        count, steps = variant.settings.grain_count, step_count(variant.settings, bed=variant.what != "speed")
        hours = sum(member.core_hours for member in own)
        numbers = {"grains": count, "steps": steps, "beds": len(own), "hours": hours}
        yield say("cost", id=variant.id, **numbers, speeds=_listed(variant.settings.speeds))
    hours = sum(member.core_hours for member in members)
    yield say("cost_of_all", count=len(members), hours=hours)
    if left_out:
        more = sum(member.core_hours for member in left_out)
        yield say("beyond_budget", budget=settings.budget, count=len(left_out), hours=more)


def doubts(settings: ConvergeSettings) -> Iterator[str]:
    """Questions that the sweep with these settings cannot answer, with what is sufficient and what that costs."""
    finest, seeds = max(settings.ratio, *settings.ratios), len(settings.seeds)
    sizes = {round(settings.ratio, 6), *(round(ratio, 6) for ratio in settings.ratios)}

    def hours(**changed: Any) -> float:
        return seeds * core_hours(settings.model_copy(update=changed))

    if finest < ENOUGH_ACROSS:
        extra = hours(grain=settings.tip_diameter / ENOUGH_ACROSS)
        yield say("coarse", finest=finest, enough=ENOUGH_ACROSS, hours=extra)
    if len(sizes) < ENOUGH_SIZES:
        yield say("few_sizes", count=len(sizes), enough=ENOUGH_SIZES)
    if (widest := max(settings.width, *settings.widths, 0.0)) < ENOUGH_WIDE:
        wide = ENOUGH_WIDE * settings.tip_diameter
        yield say("narrow", widest=widest, enough=ENOUGH_WIDE, hours=hours(bed_size=(wide, wide, settings.bed_size[2])))
    if seeds < ENOUGH_BEDS:
        yield say("few_beds", count=seeds, enough=ENOUGH_BEDS, hours=(ENOUGH_BEDS - seeds) * hours() / seeds)
    for what, key in (("width", "widths"), ("depth", "bed_depths"), ("overlap", "overlaps"), ("speed", "paces")):
        if not getattr(settings, key):
            yield say("not_varied", key=key, what=what)


def conclude(
    settings: ConvergeSettings,
    members: Sequence[Member],
    left_out: Sequence[Member],
    numbers: Mapping[str, Mapping[str, Any]],
    failed: Mapping[str, str],
) -> Result:
    """The result of the members whose `numbers` are there; `failed`: id -> reason."""
    variants = list(dict.fromkeys(member.variant for member in members))
    done = [member for member in members if member.id in numbers]
    values: dict[str, dict[int, Mapping[str, float | None]]] = {}
    for member in done:
        values.setdefault(member.variant.id, {})[member.seed] = numbers[member.id]
    tip, life = settings.tip_diameter, settings.life_grain
    found = findings_of(variants, values, life=life, tip=tip)
    entries = {name: _quantity(finding, settings) for name, finding in found.items()}
    if "sinkage" in found:
        entries |= _standing(found["sinkage"], settings.weight)
    entries |= {
        "load": quantity(settings.weight, "N", "on the spike that is set down"),
        "members": quantity(len(done), "1", f"of {len(members) + len(left_out)} that the sweep has"),
    }
    warnings = [
        *(say("failed", id=name, reason=reason) for name, reason in failed.items()),
        *([say("partial", done=len(done), of=len(members) + len(left_out))] if len(done) < len(members) + len(left_out)
          else []),
        *doubts(settings),
        *_unknown(found),
        *filter(None, [caveat(beds.find_material(settings))]),
    ]  # fmt: skip
    return Result.make(
        "converge",
        code=beds.fingerprint(),
        title=f"A {settings.body_words} in {beds.find_material(settings).name}, with its errors",
        status="done" if len(done) == len(members) else "stopped",
        quantities=entries,
        departures={"sentences": list(_sentences(found, settings, variants))},
        tables=[_errors(entries), _by_size(found), _sizes(settings, variants, values), *_differences(found, variants)],
        convergence={name: told(finding) for name, finding in found.items()},
        life=life / tip,
        variants=[{"id": v.id, **told_of(v)} for v in variants],
        members=[
            {"id": m.id, "variant": m.variant.id, "seed": m.seed, "folder": m.folder, "quantities": numbers[m.id]}
            for m in done
        ],
        warnings=warnings,
    )  # fmt: skip


def _quantity(finding: Finding, settings: ConvergeSettings) -> Json:
    """A finding as a quantity: at the real grain; std: between beds of the finest grains."""
    finest = finding.sizes[0].values
    std = float(np.std(finest, ddof=1)) if len(finest) > 1 else None
    line = finding.at_life
    errors = {"chance": line.chance, "grain_size": line.grain, "rest": finding.rest, "total": finding.total}
    entry = quantity(line.value, QUANTITIES[finding.name].unit, words_of(finding.name, settings), std=std)
    return entry | errors


def words_of(name: str, settings: ConvergeSettings) -> str:
    """What a quantity is."""
    if not name.startswith("force_"):
        return QUANTITIES[name].words
    band, quarter = int(name.removeprefix("force_")), 250 * settings.depth
    return say("force", begin=(band - 1) * quarter, end=band * quarter)


def _standing(sinkage: Finding, load: float) -> dict[str, Json]:
    """The stiffness that gives the sinkage: load / sinkage, with errors load / sinkage^2 times those of the sinkage."""
    deep = sinkage.at_life.value
    if deep <= 0:
        return {}
    steep = load / deep**2
    errors = {
        "chance": sinkage.at_life.chance, "grain_size": sinkage.at_life.grain, "rest": sinkage.rest,
        "total": sinkage.total,
    }  # fmt: skip
    entry = quantity(load / deep, "N/m", "load over the sinkage above: the K of a foot that stands", std=None)
    return {"stiffness_standing": entry | {key: None if of is None else steep * of for key, of in errors.items()}}


_NAMES = {"chance": "± chance", "grain_size": "± grain size", "rest": "± bed, softness, speed", "total": "± all"}


def _errors(entries: Mapping[str, Json]) -> Json:
    """The table of all quantities with their errors."""
    rows = []
    for name, entry in entries.items():
        if "chance" not in entry:
            continue
        size = abs(entry["value"])
        numbers = [entry["value"], *(_without_round_off(entry[key], size) for key in _NAMES)]
        unit, (_, *errors) = column(numbers, entry["unit"], significant=2)
        _, (value, *_) = column(numbers, entry["unit"])
        rows.append([name.replace("_", " "), *map(foldable, (value, *errors, "" if unit == "1" else unit))])
    head = ["quantity", "at the real grain", *_NAMES.values(), "unit"]
    return {"title": say("errors_title"), "head": head, "rows": rows}


def _by_size(found: Mapping[str, Finding]) -> Json:
    """The table of means over beds by grain size, the finest first."""
    ratios = sorted({round(1 / size.x, 6) for finding in found.values() for size in finding.sizes}, reverse=True)
    rows = []
    for name, finding in found.items():
        by_ratio = {round(1 / size.x, 6): interval_of(size.values) for size in finding.sizes}
        unit = QUANTITIES[name].unit
        rows.append([name.replace("_", " "), *(_span(by_ratio.get(ratio), unit) for ratio in ratios)])
    head = ["quantity", *(f"D/d = {ratio:.3g}" for ratio in ratios)]
    return {"title": say("by_size_title"), "head": head, "rows": rows, "words": True}


def _sizes(settings: ConvergeSettings, variants: Sequence[Variant], values: Mapping[str, Any]) -> Json:
    """The table of the variants: grains, speeds, inertial number, and what the bed showed."""
    rows = []
    for variant in variants:
        beds_done = list(values.get(variant.id, {}).values())
        own, life = variant.settings, variant.settings.model_copy(update={"grain": settings.life_grain})
        fastest = max(own.speeds)
        number = inertial_number(own, fastest)
        overlaps = [bed["max_overlap"] for bed in beds_done if bed.get("max_overlap") is not None]
        rows.append([
            variant.id, f"{1e3 * own.grain:.3g}", f"{settings.tip_diameter / own.grain:.3g}",
            f"{min(own.bed_size[:2]) / settings.tip_diameter:.3g} x {own.bed_size[2] / settings.tip_diameter:.3g}",
            f"{1e-6 * float(own.young or 0.0):.3g}",
            f"{100 * max(overlaps):.2g}" if overlaps else "–",
            ", ".join(f"{speed:.3g}" for speed in own.speeds), f"{number:.2g}",
            f"{number / inertial_number(life, 1.0):.3g}",
            str(len(beds_done)), f"{fmean(bed['grain_count'] for bed in beds_done):.0f}" if beds_done else "–",
        ])  # fmt: skip
    head = [
        "variant", "grain [mm]", "D/d", "bed [tips], width x depth", "E [MPa]", "overlap met [%]", "driven at [m/s]",
        "inertial number, fastest", "that in real grains [m/s]", "beds", "grains",
    ]  # fmt: skip
    return {"title": say("variants_title"), "head": head, "rows": rows, "words": True}


def _differences(found: Mapping[str, Finding], variants: Sequence[Variant]) -> Iterator[Json]:
    """The table of what width, depth, overlap and speed change, bed by bed."""
    others = [variant for variant in variants if variant.what in REST]
    rows = []
    for name, finding in found.items():
        by_id = {one.variant.id: one.interval for one in finding.differences}
        if by_id:
            spans = (by_id.get(variant.id) for variant in others)
            rows.append([name.replace("_", " "), *(_span(span, QUANTITIES[name].unit) for span in spans)])
    if rows:
        head = ["quantity", *(variant.id for variant in others)]
        yield {"title": say("differences_title"), "head": head, "rows": rows, "words": True}


def _span(span: Interval | None, unit: str) -> str:
    """An interval in words; a dash for none."""
    if span is None:
        return "–"
    shown, (mean, half) = column((span.mean, span.half), unit, significant=2)
    words = mean if span.half is None else f"{mean} ± {half}"
    return foldable(f"{words} {shown}".strip())


def _sentences(found: Mapping[str, Finding], settings: ConvergeSettings, variants: Sequence[Variant]) -> Iterator[str]:
    """Do the two finest agree; does the interval of C hold 0; which speeds are meant."""
    for name in ("stiffness", "sinkage"):
        verdict = two_finest(found[name]) if name in found else None
        if verdict is not None:
            finer, next_one = verdict["ratios"]
            share, half = (None if verdict[key] is None else 100 * verdict[key] for key in ("difference", "half"))
            by = f"{share:+.2g} %, with one bed of a size" if half is None else f"{share:+.2g} ± {half:.2g} %"
            yield say(f"finest_{verdict['verdict']}", what=name, fine=finer, next=next_one, by=by)
    if "damping" in found:
        line, total = found["damping"].at_life, found["damping"].total
        reach = total if total is not None else line.chance
        if reach is not None:
            key = "damping_zero" if abs(line.value) <= reach else "damping_not_zero"
            of = "all errors" if total is not None else "chance alone"
            yield say(key, low=line.value - reach, high=line.value + reach, of=of, chance=line.chance)
    base = next(variant.settings for variant in variants if variant.what == BASE)
    life = base.model_copy(update={"grain": settings.life_grain})
    real = [inertial_number(base, speed) / inertial_number(life, 1.0) for speed in base.speeds]
    yield say("speeds", speeds=_listed(settings.speeds), grain=1e3 * settings.driven_grain, real=_listed(real),
              life=1e3 * settings.life_grain)  # fmt: skip


def _unknown(found: Mapping[str, Finding]) -> Iterator[str]:
    """Which errors are not in the numbers, for K."""
    finding = found.get("stiffness")
    if finding is not None and finding.unknown:
        yield say("unknown", names=", ".join(finding.unknown))


def _listed(speeds: Sequence[float]) -> str:
    return ", ".join(f"{speed:.3g}" for speed in speeds) + " m/s"


def _without_round_off(error: float | None, size: float) -> float | None:
    return error if error is None or error > 1e-9 * size else 0.0
