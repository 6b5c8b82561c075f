"""The content of the report as plain text and formatted numbers; `templates/report.html` lays it out.

`summarise(run)` turns a `RunFolder` into a dict of strings, lists and tables. What is missing in the folder is left out
or reads "unknown"; nothing here raises for a part that is missing.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import numpy as np

from vis.page.folder import RunFolder
from vis.page.numbers import plain, quantity, quote, short
from vis.penetrate import summary_parts as words
from vis.penetrate.answer import answer_tiles, grains_of, largest_force, peaks_of, rests_at
from vis.penetrate.errors import fit_part, fitted, in_95
from vis.penetrate.summary_parts import say
from vis.pictures.frames import frame_names

__all__ = ["REAL_GRAINS", "summarise"]

REAL_GRAINS = {"sand": 2e-4, "sand-weak": 2e-4}
"""Diameter of real grains [m]: 0.2 mm is where fine sand ends and medium sand begins (ISO 14688-1)."""


def summarise(run: RunFolder) -> dict[str, Any]:
    """The whole content of the report but its images.

    Returns a dict. Its head has "title", "status", "banner", "lead" (facts under the title) and "caveat" (what to know
    before any number). The answer has "tiles", "answers", "rest" (what a foot that does not come to rest needs) and
    "body" (what it is called). Then follow "similarity", "fit", "departures", "reference", "bed", "spike", "runs",
    "numbers", "settings", "warnings", "missing", "frames" and "reproduce".
    """
    result = run.result
    quantities, spike = words.mapping_of(result.get("quantities")), dict(words.mapping_of(result.get("spike")))
    numbers = in_95(result)
    if spike.get("tip") != "cone":
        spike.pop("cone_angle", None)
    experiment = str(result.get("experiment") or words.setting_of(run, "command") or "")
    flat = spike.get("tip") == "flat"
    named = words.as_foot if flat else lambda value: value
    return {
        "body": "foot" if flat else "spike",
        "title": str(result.get("title") or (f"hedgebed {experiment}" if experiment else "A hedgebed run")),
        "experiment": experiment,
        "status": run.status,
        "banner": _banner(run),
        "lead": _lead(run, experiment),
        "seeds": len({r.seed for r in run.runs if r.seed is not None}),
        "tiles": [asdict(tile) for tile in answer_tiles(result)],
        "caveat": _caveat(result, quantities),
        "answers": named(_answers(run, numbers)),
        "rest": named(words.rest_part(result)),
        "similarity": words.sentence(str(words.mapping_of(result.get("similarity")).get("sentence") or "")),
        "fit": fit_part(result, numbers),
        "departures": named(words.departures_part(result)),
        "reference": words.reference_part(result),
        "bed": words.bed_part(result, quantities),
        "spike": words.facts_table(
            {key: spike[key] for key in spike if key != "cone_angle" or spike.get("tip") == "cone"}
        ),
        "runs": words.runs_table(run),
        "numbers": named(words.numbers_table(quantities)),
        "settings": words.settings_table(run.settings),
        "warnings": [named(words.sentence(str(text))) for text in words.list_of(result.get("warnings"))],
        "missing": list(run.missing),
        "frames": _frames(run),
        "reproduce": words.reproduce_part(run, experiment),
    }


def _banner(run: RunFolder) -> str:
    if run.status == "done":
        return ""
    text = "" if run.result else "Whether this run was finished is not known."
    if run.status in ("stopped", "failed", "running"):
        text = say(f"status_{run.status}")
    reason = f" Reason: {words.sentence(run.reason)}" if run.reason and text else ""
    return text + reason


def _lead(run: RunFolder, experiment: str) -> list[str]:
    version = run.result.get("version") or words.setting_of(run, "version")
    created = words.setting_of(run, "created")
    started = f"started {created.replace('T', ' ')[:16]}" if created else ""
    return list(filter(None, (f"hedgebed {version}" if version else "", experiment, started, f"status: {run.status}")))


def _caveat(result: Mapping[str, Any], quantities: Mapping[str, Any]) -> str:
    """How far the grains of this run are from real ones; empty where that is not known."""
    bed = words.mapping_of(result.get("bed"))
    overlap, grain = words.value_of(quantities, "max_overlap"), words.plain_value(bed.get("grain"))
    factor = words.plain_value(words.mapping_of(bed.get("softening")).get("factor"))
    real = words.plain_value(bed.get("real_grain")) or REAL_GRAINS.get(str(bed.get("material")))  # of an older hedgebed
    parts = []
    if factor is not None and factor > 1.05:
        parts.append(f"softened {quote(1.001 * factor, None, '1', significant=2)} times")
    if parts and overlap is not None:
        parts[0] += f" (overlaps of up to {quote(overlap, None, '%', significant=2)} of a diameter)"
    if grain is not None and real is not None and grain > 1.5 * real:
        sizes = f"{quote(grain, 0.0, 'm')} for {quote(real, 0.0, 'm')}"
        parts.append(f"{plain(grain / real, 2)} times larger than real ones ({sizes})")
    if not parts:
        return ""
    return f"The grains are {words.joined(parts)}: the numbers are those of this bed, not of a material."


def _frames(run: RunFolder) -> list[str]:
    """The .pvd files and which run each shows."""
    known = {r.id: r for r in run.runs}
    return [
        f"{name}.pvd ({words.run_words(known[name]) if name in known else 'frames'})" for name in frame_names(run.path)
    ]


def _answers(run: RunFolder, quantities: Mapping[str, Any]) -> list[dict[str, str]]:
    remarks = words.mapping_of(run.result.get("departures"))

    def also(*names: str) -> str:
        return "".join(f" {words.sentence(str(remarks[name]))}" for name in names if remarks.get(name))

    answers = {"How far does it sink?": _sinks(run, quantities, also("set_down", "surface"))}
    if push := largest_force(run.result):
        text = f"{push[0]} {push[2]}."
        drops = peaks_of(run.result, "drop", "peak_force")
        if drops:
            peaks = [f"{quote(*peak, 'N')} at {speed:g}{words.NBSP}m/s" for speed, peak in drops]
            text += f" In drops the force peaks at {words.joined(peaks)}."
        if words.value_of(quantities, "work_returned_dem") is not None:
            text += " " + _returned(quantities)
        answers[f"How large is the force of {grains_of(run.result)}?"] = text
    if words.value_of(quantities, "drag_gap") is not None:
        k, c = (fitted(run.result, quantities, key) for key in ("stiffness", "damping"))
        text = (
            f"With K = {k} and C = {c} its "
            f"error during loading is {quantity(quantities['drag_gap'], unit='%')} of the bed's drag (rms difference "
            "over rms drag)."
        )
        if worst := _worst(run.result):
            text += f" {worst}"
        gap = _peak_gap(run)
        if gap is not None:
            text += f" In drops its mean peak force is {words.more_or_less(gap, 'above', 'below')} the bed's."
        answers["How large is the error of the spring-damper?"] = text
        answers["Which K is to be used?"] = also("which_stiffness").strip()
    return [{"question": question, "answer": answer} for question, answer in answers.items() if answer]


def _sinks(run: RunFolder, quantities: Mapping[str, Any], more: str) -> str:
    """How far it sinks, and `more`; "" where it was not set down."""
    sunk, law = words.value_of(quantities, "sinkage_dem"), words.value_of(quantities, "sinkage_spring_damper")
    model = f" The fitted spring-damper predicts {quantity(quantities.get('sinkage_spring_damper'))}"
    if sunk is not None:
        load = f" of {quantity(quantities['load'])}" if words.value_of(quantities, "load") is not None else ""
        text = f"Set down under its load{load}, the spike comes to rest {rests_at(quantities)}"
        text += " deep." if sunk >= 0 else say("on_uppermost", size=_size_of_grains(run))
        sure = words.mapping_of(words.mapping_of(run.result.get("sure")).get("sinkage_dem")).get("sentence")
        text += f" {words.sentence(str(sure))}" if sure else ""
        text += "".join(f" {words.sentence(said)}" for said in _by_cohesion(run.result))
        if law is not None:
            text += model + (f", {_deeper(law / sunk)}." if sunk > 0 else ".")
        return text + more
    if (rest := words.rest_part(run.result)) is not None:
        return " ".join(rest["sentences"])
    if not _restless(run, quantities):
        return ""
    text = "Not known: set down under its load, the spike did not come to rest in the simulated time."
    return text + (f"{model}." if law is not None else "") + more


def _size_of_grains(run: RunFolder) -> str:
    """The mean diameter of the grains in brackets, where it is known."""
    grain = words.plain_value(words.mapping_of(run.result.get("bed")).get("grain"))
    return "" if grain is None else f" ({quote(grain, 0.0, 'm')})"


def _by_cohesion(result: Mapping[str, Any]) -> list[str]:
    """What a formula gives for a foot that rests on grains that stick."""
    rest = words.mapping_of(result.get("rest"))
    return [str(text) for text in words.list_of(rest.get("sentences"))] if rest.get("comes_to_rest") is True else []


def _restless(run: RunFolder, quantities: Mapping[str, Any]) -> bool:
    """Whether the spike was set down but never came to rest in the bed."""
    null = "sinkage_dem" in quantities and words.value_of(quantities, "sinkage_dem") is None
    return null and bool(run.of_kind("set_down"))


def _returned(quantities: Mapping[str, Any]) -> str:
    """The share of the work of loading that the bed recovers; where it is negative, pulling out takes work as well."""
    share, entry = words.value_of(quantities, "work_returned_dem"), quantities["work_returned_dem"]
    model = f"(spring-damper: {quantity(quantities.get('work_returned_spring_damper'), unit='%')} recovered)"
    if share is not None and share < 0.0:
        more = quote(-share, words.std_of(quantities, "work_returned_dem"), "%", significant=2)
        return f"No work is recovered on withdrawal, which takes another {more} of the work put in {model}."
    return f"On withdrawal, {quantity(entry, unit='%')} of the work put in is recovered {model}."


def _worst(result: Mapping[str, Any]) -> str:
    """Where law and bed differ by most newtons, at any depth and in the topmost band; "" without a table."""
    rows = [row for row in words.departure_rows(result) if row.bed_force > 0]
    if not rows:
        return ""
    worst = max(rows, key=lambda row: abs(row.difference))
    text = f"In newtons it is farthest off {_off(worst)}."
    top = min(row.depth_to for row in rows)
    if worst.depth_to == top:
        return text + (" This is at the top, where a foot stands." if len({row.depth_to for row in rows}) > 1 else "")
    near = max((row for row in rows if row.depth_to == top), key=lambda row: abs(row.difference))
    return f"{text} At the top, where a foot stands, it is farthest off {_off(near)}."


def _off(row: words.Departure) -> str:
    apart = f"; {row.known}" if row.known else ""
    if row.bed_std is not None:
        apart += f", {quote(row.bed_std, unit='N', significant=2)} apart"
    depths = f"{short(1e3 * row.depth_from)} and {short(1e3 * row.depth_to)}{words.NBSP}mm"
    return (
        f"at {row.speed:g}{words.NBSP}m/s between {depths}: "
        f"{quote(abs(row.difference), unit='N', significant=2)} too {'much' if row.difference > 0 else 'little'} "
        f"({words.percent(abs(row.difference) / row.bed_force)}{apart})"
    )


def _peak_gap(run: RunFolder) -> float | None:
    ratios = []
    for r in run.of_kind("drop"):
        bed, model = words.value_of(r.quantities, "peak_force"), words.value_of(r.quantities, "model_peak_force")
        if bed and model is not None:
            ratios.append(model / bed - 1.0)
    return float(np.mean(ratios)) if ratios else None


def _deeper(ratio: float) -> str:
    far = ratio >= 2.0
    return f"{plain(ratio, 2)} times as deep" if far else words.more_or_less(ratio - 1.0, "deeper", "less deep")
