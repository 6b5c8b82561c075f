"""The content of the report as plain text and formatted numbers; `templates/report.html` lays it out.

`summarise(run)` turns a `RunFolder` into a dict of strings, lists and tables. What is missing in the folder is left out
or reads "unknown"; nothing here raises for a part that is missing.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from rigid.intervals import half_width
from vis.page.folder import RunFolder
from vis.page.numbers import between, plain, quantity, quote, short, within
from vis.penetrate import summary_parts as words
from vis.penetrate.errors import fit_part, fitted, in_95
from vis.penetrate.summary_parts import say
from vis.pictures.frames import frame_names

__all__ = ["REAL_GRAINS", "summarise"]

REAL_GRAINS = {"sand": 2e-4, "sand-weak": 2e-4}
"""Diameter of real grains [m]: 0.2 mm is where fine sand ends and medium sand begins (ISO 14688-1)."""


def summarise(run: RunFolder) -> dict[str, Any]:
    """The whole content of the report but its images.

    Returns a dict with "title", "status", "banner", "lead" (facts under the title), "tiles", "answers", "rest"
    (what a foot that does not come to rest needs), "body" (what it is called), "similarity", "fit", "departures",
    "reference", "bed", "spike", "runs", "numbers", "settings", "warnings", "missing", "frames" and "reproduce";
    "caveat" is what to know before any number.
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
        "tiles": named(_with_errors(_tiles(run, numbers), words.mapping_of(result.get("sure")))),
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


def _tiles(run: RunFolder, quantities: Mapping[str, Any]) -> list[dict[str, str]]:
    tiles: list[tuple[str, str, str]] = []
    model = quantity(quantities.get("sinkage_spring_damper"))
    if (needed := words.value_of(quantities, "depth_to_rest")) is not None:
        under = f"under {quantity(quantities['load'])}; " if words.value_of(quantities, "load") is not None else ""
        tiles.append(
            (
                "Sinks to rest",
                "not in this bed",
                f"{under}it would need about {quote(needed, None, 'm', significant=2)}{_needs(run)}",
            )
        )
    elif _restless(run, quantities):
        note = f"no set-down came to rest in time; the spring-damper predicts {model}"
        tiles.append(("Sinks to rest at", "unknown", note))
    if words.value_of(quantities, "sinkage_dem") is not None:
        load = words.value_of(quantities, "load")
        under = f"under {quantity(quantities['load'])}" if load is not None else "under its load"
        note = f"{under}; the spring-damper predicts {model}"
        tiles.append(("Sinks to rest at", _rests_at(quantities), note))
    if push := _push(run):
        tiles.append((f"Largest force of {_grains(run)}", *push))
    if words.value_of(quantities, "drag_gap") is not None:
        note = "rms difference over rms force, loading, all pushes"
        tiles.append(("Error of the spring-damper", quantity(quantities["drag_gap"], unit="%"), note))
    if words.value_of(quantities, "stiffness") is not None:
        tiles.append(("Fitted stiffness K", quantity(quantities["stiffness"]), _fitted_note(run, quantities)))
    return [{"label": label, "value": value, "note": note} for label, value, note in tiles]


def _with_errors(tiles: list[dict[str, str]], sure: Mapping[str, Any]) -> list[dict[str, Any]]:
    """The tiles with their errors of chance and grain size, as result.json states them, and a row of real grains."""
    rows: list[dict[str, Any]] = []
    for tile in tiles:
        name = "stiffness" if tile["label"].startswith("Fitted stiffness") else "sinkage_dem"
        entry = words.mapping_of(sure.get(name))
        if entry and (name == "stiffness" or tile["label"].startswith("Sinks to rest at")):
            value = quote(entry["value"], None, entry["unit"], significant=2)
            if name == "sinkage_dem" and entry["value"] < 0:
                value = tile["value"].split(f"{words.NBSP}±")[0] + f"{words.NBSP}mm above the surface"
                value = value if "±" in tile["value"] else tile["value"]
            rows.append({**tile, "value": value, "errors": _errors(entry)})
            if name == "sinkage_dem":
                known = entry["low"] is not None
                ends = within(entry["low"], entry["high"], "m") if known else "not known"
                note = say("of_real_grains") if known else words.sentence(str(entry["sentence"]))
                rows.append({"label": "Sinkage among real grains (95 %)", "value": ends, "note": note})
            elif entry["low"] is not None:
                ends = within(entry["low"], entry["high"], "N/m")
                rows.append({"label": "K among real grains (95 %)", "value": ends, "note": say("of_real_grains")})
        else:
            rows.append(tile)
    return rows


def _errors(entry: Mapping[str, Any]) -> tuple[str, str, str]:
    """Chance as a half-width or as two ends, grain size as what it may change, and what is not known."""
    value, unit, parts = entry["value"], entry["unit"], []
    for name in ("chance", "grain_size"):
        low, high = entry[name] if entry[name] is not None else (None, None)
        if low is None or high is None:
            parts.append("not known")
        elif abs((high - value) - (value - low)) < 1e-6 * abs(high - low):
            parts.append(quote(high - value, None, unit, significant=2))
        else:
            sides = [(f"{words.MINUS}", value - low), ("+", high - value)]
            parts.append(" ".join(f"{sign}{quote(by, None, unit, significant=2)}" for sign, by in sides if by > 0))
    return parts[0], parts[1] or "0", "not known"


def _fitted_note(run: RunFolder, quantities: Mapping[str, Any]) -> str:
    parts = [f"and damping C = {fitted(quantities, 'damping')}, for motion"]
    drops = [r for r in run.of_kind("drop") if words.value_of(r.quantities, "stop_time") is not None]
    depths = [float(r.bed.depth.max()) for r in (*run.of_kind("driven"), *drops) if r.bed is not None]
    parts[0] += f" down to {quote(max(depths), None, 'm')}" if depths else ""
    if "stiffness_standing" in quantities:
        parts.append(_standing(run, quantities))
    if words.std_of(quantities, "stiffness") is None and words.value_of(quantities, "stiffness_error") is not None:
        parts.append(f"error of the fit, 95{words.NBSP}%: {quantity(quantities['stiffness_error'])}")
    return "; ".join(parts)


def _needs(run: RunFolder) -> str:
    """The ends of the depth to rest and how far it is extrapolated, as far as result.json has them."""
    sure = words.mapping_of(words.mapping_of(run.result.get("sure")).get("depth_to_rest"))
    ends = f" ({between(sure['low'], sure['high'], 'm')} with its errors, 95{words.NBSP}%)" if sure.get("high") else ""
    if sure.get("low") and not ends:
        ends = f" (at least {quote(sure['low'], None, 'm', significant=2)}, 95{words.NBSP}%)"
    times = sure.get("times_beyond")
    return ends + (say("beyond_pushes", times=plain(times, 2)) if times is not None else "")


def _standing(run: RunFolder, quantities: Mapping[str, Any]) -> str:
    """Which K a foot that stands has: load over the ends of its sinkage, or none where it may not sink at all."""
    sure = words.mapping_of(words.mapping_of(run.result.get("sure")).get("sinkage_dem"))
    chance, load = words.list_of(sure.get("chance")), words.value_of(quantities, "load")
    if chance and chance[0] <= 0:
        return say("standing_unknown")
    if sure.get("low") and load is not None:
        return say("standing", k=between(load / sure["high"], load / sure["low"], "N/m"))
    return say("standing", k=quantity(quantities["stiffness_standing"]))


def _caveat(result: Mapping[str, Any], quantities: Mapping[str, Any]) -> str:
    """How far the grains of this run are from real ones; empty where that is not known."""
    bed = words.mapping_of(result.get("bed"))
    overlap, grain = words.value_of(quantities, "max_overlap"), words.plain_value(bed.get("grain"))
    factor = words.plain_value(words.mapping_of(bed.get("softening")).get("factor"))
    real = REAL_GRAINS.get(str(bed.get("material")))
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


def _push(run: RunFolder) -> tuple[str, str] | None:
    """The largest force of loading over all speeds, the speed of it, and the peaks at the other speeds."""
    by_speed = _peaks(run, "driven", "peak_force")
    if not by_speed:
        return None
    depth = max((float(r.bed.depth.max()) for r in run.of_kind("driven") if r.bed is not None), default=None)
    to = f" to {quote(depth, unit='m')}" if depth is not None else ""
    speed, high = max(by_speed, key=lambda peak: peak[1][0])
    note = f"pushed{to} at {speed:g}{words.NBSP}m/s"
    note += " (mean over beds of the largest)" if high[1] is not None else ""
    others = [f"{quote(*peak, 'N')} at {other:g}{words.NBSP}m/s" for other, peak in by_speed if other != speed]
    return quote(*high, "N"), f"{note}; {words.joined(others)}" if others else note


def _answers(run: RunFolder, quantities: Mapping[str, Any]) -> list[dict[str, str]]:
    remarks = words.mapping_of(run.result.get("departures"))

    def also(*names: str) -> str:
        return "".join(f" {words.sentence(str(remarks[name]))}" for name in names if remarks.get(name))

    answers = {"How far does it sink?": _sinks(run, quantities, also("set_down", "surface"))}
    if push := _push(run):
        text = f"{push[0]} {push[1]}."
        drops = _peaks(run, "drop", "peak_force")
        if drops:
            peaks = [f"{quote(*peak, 'N')} at {speed:g}{words.NBSP}m/s" for speed, peak in drops]
            text += f" In drops the force peaks at {words.joined(peaks)}."
        if words.value_of(quantities, "work_returned_dem") is not None:
            text += " " + _returned(quantities)
        answers[f"How large is the force of {_grains(run)}?"] = text
    if words.value_of(quantities, "drag_gap") is not None:
        text = (
            f"With K = {fitted(quantities, 'stiffness')} and C = {fitted(quantities, 'damping')} its "
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
        text = f"Set down under its load{load}, the spike comes to rest {_rests_at(quantities)}"
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


def _grains(run: RunFolder) -> str:
    """What pushes back: the name of the material, where it is known."""
    name = str(words.mapping_of(run.result.get("bed")).get("material") or "bed")
    return name if name.startswith("jsc-") else f"the {name}"


def _size_of_grains(run: RunFolder) -> str:
    """The mean diameter of the grains in brackets, where it is known."""
    grain = words.plain_value(words.mapping_of(run.result.get("bed")).get("grain"))
    return "" if grain is None else f" ({quote(grain, 0.0, 'm')})"


def _by_cohesion(result: Mapping[str, Any]) -> list[str]:
    """What a formula gives for a foot that rests on grains that stick."""
    rest = words.mapping_of(result.get("rest"))
    return [str(text) for text in words.list_of(rest.get("sentences"))] if rest.get("comes_to_rest") is True else []


def _rests_at(quantities: Mapping[str, Any]) -> str:
    """The depth at rest, or how far above depth 0 a spike rests that grains which stick out carry."""
    entry = quantities["sinkage_dem"]
    above = -(words.value_of(quantities, "sinkage_dem") or 0.0)
    return f"{quantity({**entry, 'value': above})} above the surface" if above > 0 else quantity(entry)


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


def _peaks(run: RunFolder, kind: str, key: str) -> list[tuple[float, tuple[float, float | None]]]:
    """Speed -> mean over seeds and half of its 95 % interval (None for a single seed)."""
    found = []
    for speed in run.speeds(kind):
        own = (r for r in run.runs if r.kind == kind and r.speed == speed)
        numbers = [n for r in own if (n := words.value_of(r.quantities, key)) is not None]
        if numbers:
            half = half_width(float(np.std(numbers, ddof=1)), len(numbers)) if len(numbers) > 1 else None
            found.append((speed, (float(np.mean(numbers)), half)))
    return found


def _deeper(ratio: float) -> str:
    far = ratio >= 2.0
    return f"{plain(ratio, 2)} times as deep" if far else words.more_or_less(ratio - 1.0, "deeper", "less deep")
