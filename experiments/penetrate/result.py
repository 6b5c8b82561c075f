"""From the finished runs of a folder to the result of penetrate: the fit, the same runs on the law, what departs."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path

from coupling import Penetration, overdamped_below
from dem.grains.materials import caveat
from experiments.grains.advice import resolution_advice
from experiments.grains.graded import grading_warning, unmatched_warning
from experiments.grains.lammps import cone_note
from experiments.grains.softening import Softening
from experiments.runs.folder import RunFolder
from experiments.runs.progress import Progress
from experiments.runs.result import Result
from experiments.runs.types import Json
from vis.penetrate.summary_parts import joined

from . import beds
from .amended import kept_law, run_beside
from .departures import departures, with_half
from .findings import BedFacts, Findings, bed_entry, bed_quantities, drop_note
from .fit import MOST_CORRELATED
from .reference import compare_with, read_reference
from .rest import answer, how_sure, real_grain, sinkage_interval
from .settings import PenetrateSettings, say
from .similarity import fast_for_gravity, pace_of, similarity_of
from .sure import ends_of, in_words
from .units import Unit, make_spike

__all__ = [
    "SHIPPED_RESULT", "conclude", "departures_in_words", "overlap_warning", "softening_note", "staged_note",
    "stiffer_note", "stiffer_warning", "warnings_of",
]  # fmt: skip

SHIPPED_RESULT = Path(__file__).parents[2] / "docs" / "results" / "penetrate-sand" / "result.json"
"""The result of the case that ships, in a checkout."""


def conclude(
    settings: PenetrateSettings,
    units: list[Unit],
    softening: Softening,
    folder: RunFolder,
    progress: Progress,
    *,
    missing: Mapping[int, str],
    stopped_of: int = 0,
) -> Result:
    """Fit, make the same runs on the law, compare; write the law's series; return the result.

    ``missing``: seed -> why its bed could not be prepared; ``units`` has no runs of it. ``stopped_of``: of how many
    beds these are the whole ones, where the run was stopped.
    """
    progress.stage("spring-damper", total=1.0)
    notes = {unit.id: folder.done_data(unit.id) for unit in units}
    runs = {name: Penetration.from_columns(folder.read_series(name), note) for name, note in notes.items()}
    facts = [BedFacts(**folder.done_data(f"bed-{seed}")) for seed in settings.seeds if seed not in missing]
    material = beds.find_material(settings)
    findings = Findings(settings, units, runs, facts[0].time_step)
    for name, series in findings.models.items():
        folder.write_series(f"{name}.model", series.columns())
    overlap = max((note["max_overlap"] for note in notes.values() if note.get("max_overlap") is not None), default=None)
    stiffened: list[Json] = [note for seed in settings.seeds for note in folder.noted(f"stiffer-{seed}", [])]
    rest = answer(findings, material)
    sure = how_sure(findings, material, rest)
    quantities = findings.quantities() | bed_quantities(facts, overlap, _made(stiffened)) | _depth_needed(rest)
    quantities |= _standing_unknown(quantities, sure)
    codes = ({note.get("code") for note in notes.values()} | {folder.code}) - {None, ""}
    doubts = {
        "fewer than three seeds: the spread between beds is not known well": len(facts) < 3,
        "parts of this run were computed by different versions of the code: it may not repeat to the bit":
            len(codes) > 1,
    }  # fmt: skip
    found = [
        *(say("bed_missing", why=why) for why in missing.values()),
        *fast_for_gravity(settings, material.friction),
        *stiffer_warning(stiffened),
        None if stiffened else overlap_warning(overlap, settings, softening),
        *(grading_warning(entry.grading) for entry in facts if entry.grading is not None),
        unmatched_warning(settings.graded, material, packing=settings.packing, stages=beds.stages_of(settings)),
        caveat(material),
        cone_note(settings),
        *(text for text in doubts if doubts[text]),
    ]
    part = [say("whole_beds", count=len(facts), of=stopped_of)] if stopped_of else []
    warnings = [*part, *warnings_of(findings), *filter(None, found)]
    departures, entries = departures_in_words(findings), findings.run_entries(notes)
    law = kept_law(settings, folder.path)
    if law is not None:
        more, said, numbers = run_beside(law, units, runs, findings.models, folder)
        quantities |= more
        warnings += law.warnings()
        departures["sentences"] = [*departures["sentences"], *said]
        for entry in entries:
            entry["amended_series"] = f"series/{entry['id']}.amended.csv"
            entry["quantities"] |= numbers[entry["id"]]
    result: Json = {
        "code": codes.pop() if len(codes) == 1 else beds.fingerprint(),
        "title": f"A {settings.body_words} in {material.name}",
        "status": "stopped" if stopped_of else "done",
        "quantities": quantities,
        "runs": entries,
        "fits": findings.fit_entries(),
        "departures": departures,
        "bed": bed_entry(facts, settings, softening) | {
            "material": material.name, "rolling_friction": material.rolling_friction, "stiffened": stiffened,
            "real_grain": real_grain(settings, material) or None,
            **({"missing": {str(seed): why for seed, why in missing.items()}} if missing else {}),
        },
        "spike": asdict(make_spike(settings)) | {"load": settings.weight},
        "warnings": warnings,
        "similarity": similarity_of(settings),
        "sure": sure,
        **({} if rest is None else {"rest": rest}),
    }  # fmt: skip
    result |= {} if law is None else {"model": {"file": settings.model, "effects": list(law.effects)}}
    _compare(settings, result)
    return Result.make("penetrate", **result)


def _made(stiffened: list[Json]) -> dict[int, float]:
    """Seed -> Young's modulus [Pa] that its grains got last, of the seeds that were made stiffer."""
    return {note["seed"]: float(note["young"]) for note in stiffened}


def _depth_needed(rest: Json | None) -> Json:
    """The quantity "depth_to_rest" where the foot does not come to rest."""
    if rest is None or rest["comes_to_rest"]:
        return {}
    low, high = rest["depth_range"]
    note = f"where the load would rest, reckoned from the driven runs: {low:.2g} to {high:.2g} m"
    return {"depth_to_rest": {"value": rest["depth"], "std": None, "unit": "m", "note": note}}


def _standing_unknown(quantities: Json, sure: Json) -> Json:
    """No stiffness of a standing foot, with the reason, where its sinkage may be 0; else nothing."""
    chance = sure.get("sinkage_dem", {}).get("chance")
    if chance is None or chance[0] > 0 or "stiffness_standing" not in quantities:
        return {}
    return {"stiffness_standing": {"value": None, "std": None, "unit": "N/m", "note": say("standing_none_note")}}


def _compare(settings: PenetrateSettings, result: Json) -> None:
    """Add the entry "reference" to the result, and what it says, where there is something to compare with."""
    reference, warnings, departures = settings.reference, result["warnings"], result["departures"]
    if reference is None:
        return
    if reference == "shipped" and not SHIPPED_RESULT.exists():
        warnings.append("the result of the shipped case is not here (docs/results of a checkout): nothing compared")
        return
    try:
        entry, said = compare_with(read_reference(SHIPPED_RESULT if reference == "shipped" else reference), result)
    except ValueError as error:  # it was there before the first run
        warnings.append(f"{error}; nothing compared")
        return
    result["reference"] = {"file": reference, **entry}
    departures["sentences"] = [*departures["sentences"], *(f"Against the reference, {text}" for text in said)]
    if not entry["moved"]:
        warnings.append(f"reference = {reference!r} has no run of a kind and speed made here too")


LEAST_CONDITIONS = 3
"""Kinds and speeds that a fit of two numbers needs."""


def departures_in_words(findings: Findings) -> Json:
    """The entry "departures" of result.json: numbers, sentences, and the remarks that explain them, by name."""
    numbers = findings.in_95
    sunk, law = ((numbers[name]["value"], numbers[name]["std"]) for name in ("sinkage_dem", "sinkage_spring_damper"))
    pair = (sunk, law) if sunk[0] is not None and law[0] is not None else None
    by_bed = [runs for seed in findings.seeds if (runs := findings.of("driven", seed))]
    found = departures(by_bed, findings.models, findings.beds, findings.fit, sinkage=pair)
    masses = [run.settings["mass"] for run in findings.of("set_down") if run.settings.get("mass")]
    remarks = {
        "which_stiffness": _which_stiffness(findings),
        "surface": _at_surface(findings),
        "set_down": say("set_down", s=findings.settings, grams=1e3 * float(masses[0])) if masses else None,
        "drop": drop_note(findings.settings) if findings.of("drop") else None,
    }
    notes = {name: f"{text[:1].upper()}{text[1:]}." for name, text in remarks.items() if text}
    return found | notes | {"sentences": [*found["sentences"], *notes.values()]}


def warnings_of(findings: Findings) -> Iterator[str]:
    """What a reader has to know: runs that did not end as they should, a law that came out at its bound."""
    numbers, settings, fit = findings.in_95, findings.settings, findings.fit
    ends = {unit: findings.beds[unit.id].ended for unit in findings.units}
    for unit, ended in ends.items():
        if ended in ("max_time", "max_depth"):
            yield say("max_time" if ended == "max_time" else "near_floor", unit=unit)
        elif ended == "unfinished":
            yield f"{unit.title} is unfinished: it has no depth at rest"
    if bobbing := list(ends.values()).count("stopped"):
        yield say("bobbing", count=bobbing, of=len(findings.of("drop")), s=settings)
    sunk, grain = numbers["sinkage_dem"], settings.grain
    if sunk["value"] is None and findings.of("set_down"):
        yield "no set-down came to rest: there is no sinkage_dem"
    if numbers["sinkage_spring_damper"]["value"] is None and findings.of("set_down"):
        yield "the spring-damper did not come to rest: there is no sinkage_spring_damper"
    if sunk["value"] is not None and sunk["value"] < 2 * grain:  # hardly more than a grain
        several = sum(value is not None for value in findings.sinkages(findings.beds)) > 1
        if sunk["value"] < 0:
            yield say("on_top", shown=_words(sunk | {"value": -sunk["value"]}), mm=1e3 * grain)
        else:
            so = "its spread between seeds is part of the answer" if several else "another seed will give another"
            yield say("shallow", shown=_words(sunk), grains=sunk["value"] / grain, so=so)
    bound = overdamped_below(settings.weight, settings.lowering_speed) / pace_of(settings)
    if findings.of("set_down") and fit.stiffness > bound:
        yield say("overdamped", fit=fit, bound=bound)
    yield from _not_separated(findings)
    yield from resolution_advice(**beds.resolution_of(settings))
    if fit.damping == 0:
        yield say("damping_zero")
    if fit.stiffness == 0:
        yield "the stiffness fitted is 0, its bound: the law has no resting sinkage"


def _not_separated(findings: Findings) -> Iterator[str]:
    """That the runs do not separate K from C, of all beds or of each, and when to act: one warning at most."""
    fit = findings.fit
    conditions = {unit.condition for unit in findings.units if unit.id in fit.runs}
    own = [one.correlation for one in findings.seed_fits.values() if one.correlation is not None]
    each = len(own) >= 2 and not findings.beds_separate
    needed = "" if findings.of("set_down") or not findings.settings.set_down else say("rest_needs_k")
    if len(conditions) < LEAST_CONDITIONS or abs(fit.correlation or 0.0) > MOST_CORRELATED:
        shown = "unknown" if fit.correlation is None else f"{fit.correlation:.2f}"
        listed = ", ".join(f"{kind} at {v:g} m/s" for kind, v in sorted(conditions))
        beds_too = say("nor_of_each_bed") if each else ""
        yield say("inseparable", shown=shown, listed=listed, each=beds_too, needed=needed)
    elif each:
        yield say("traded", least=min(own), needed=needed)


def softening_note(settings: PenetrateSettings, softening: Softening) -> str:
    """How soft the grains are made, and what for: where the fastest speed and the largest pressure come from."""
    fastest = {
        "a driven run": (*settings.speeds, *settings.other_speeds[: len(settings.seeds) - 1]),
        "the pull-out": (settings.retreat_speed,),
        "a drop": (*settings.drop_speeds, *settings.other_drop_speeds),
        "the lowering": (settings.lowering_speed,) if settings.set_down else (),
    }
    whose = next((name for name, speeds in fastest.items() if softening.speed in speeds), "the fastest run")
    return say("softened", softening=softening, percent=100 * settings.max_overlap, whose=whose)


def staged_note(settings: PenetrateSettings) -> str | None:
    """How the bed is prepared, where it goes through stages."""
    stages, first = beds.stages_of(settings), beds.first_gravity(settings)
    if stages is None or settings.bed is not None:
        return None
    of = "bed_stages" if settings.bed_stages is not None else f"the recipe of {beds.find_material(settings).name}"
    lowered = "" if first == settings.gravity else f"; at {first:.3g} m/s2, gravity is lowered when it is at rest"
    return say("staged", of=of, stages=" ".join(stages), lowered=lowered)


def stiffer_note(note: Json) -> str:
    """That grains were made stiffer by the run itself: `note` as the entry "stiffened" of result.json has it."""
    where = note["unit"] or "the preparation of the bed"
    return say("stiffer", note=note, where=where, percent=100 * note["overlap"])


def stiffer_warning(notes: Sequence[Json]) -> list[str]:
    """The same of all seeds as one warning, as the runs were repeated without anybody's help; none without notes."""
    if not notes:
        return []
    seeds = sorted({note["seed"] for note in notes})
    young = {note["seed"]: note["young"] for note in notes}.values()  # the last of each seed
    overlap = max(note["overlap"] for note in notes)
    return [say("stiffer_seeds", seeds=joined(list(map(str, seeds))), percent=100 * overlap,
                last=ends_of(min(young), max(young)), which="seed" if len(seeds) == 1 else "seeds")]  # fmt: skip


def overlap_warning(overlap: float | None, settings: PenetrateSettings, softening: Softening) -> str | None:
    """That grains overlapped nearly as far as they may, and the modulus that would leave a fifth of it free."""
    most = settings.max_overlap
    if overlap is None or overlap <= 0.9 * most:
        return None
    stiffer = softening.stiffer(overlap, 0.8 * most)
    return say("overlap_near", percent=100 * overlap, most=100 * most, stiffer=stiffer, softening=softening,
               beside="above" if overlap > most else "near")  # fmt: skip


def _which_stiffness(findings: Findings) -> str | None:
    """When to use the fitted K, and when that of a foot that stands."""
    standing, fitted = findings.in_95.get("stiffness_standing"), findings.fit.stiffness
    if standing is None or fitted <= 0:
        return None
    interval = sinkage_interval(findings, beds.find_material(findings.settings))
    ratio, load = standing["value"] / fitted, findings.settings.weight
    if ratio >= 1.005:
        wrong = f"overstates the sinkage at rest {ratio:.2g} times"
    elif ratio <= 0.995:
        wrong = f"understates the sinkage at rest {1 / ratio:.2g} times"
    else:
        wrong = "gives the sinkage at rest as well"
    shallowest = None if interval is None or interval.chance is None else interval.chance[0]
    if shallowest is not None and shallowest <= 0:
        there = say("standing_none")
    elif interval is not None and interval.low is not None and interval.high is not None:
        there = say("standing_ends", ends=in_words(load / interval.high, load / interval.low, "N/m"))
    else:
        there = say("standing", standing=_words(standing))
    deepest, s = 1e3 * findings.deepest(), findings.settings
    return say("which_stiffness", deepest=deepest, s=s, wrong=wrong, standing=there)


def _at_surface(findings: Findings) -> str | None:
    """What the bed pushes back with before depth 0, where that matters; None below a tenth of the load."""
    numbers = findings.in_95
    force, load = numbers.get("surface_force"), findings.settings.weight
    if force is None or force["value"] <= 0.1 * load:
        return None
    out = numbers.get("surface_roughness")
    grains = f", because grains extend above the mean surface by up to {_words(out)}" if out else ""
    ratio = force["value"] / load
    share = f"{100 * ratio:.2g} % of the load" if ratio < 0.995 else f"{ratio:.2g} times the load"
    return say("at_surface", force=_words(force), share=share, grains=grains)


def _words(entry: Json) -> str:
    """A quantity of `in_95` as a person quotes it: with its error, else with two figures."""
    return with_half(entry["value"], entry["std"], entry["unit"])
