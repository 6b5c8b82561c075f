"""What the report says, as plain words and formatted numbers; how it looks is `templates/report.html`'s business.

`summarise(run)` turns a `RunFolder` into a dict of strings, lists and tables. Whatever the folder lacks is left out or
reads "unknown"; nothing here raises for a part that is missing.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from vis.page.folder import RunFolder
from vis.page.numbers import plain, quantity, quote, short
from vis.penetrate.summary_tables import (
    bed_part,
    departures_part,
    facts_table,
    fit_part,
    numbers_table,
    reference_part,
    reproduce_part,
    runs_table,
    settings_table,
)
from vis.penetrate.summary_words import (
    NBSP,
    Departure,
    departure_rows,
    fitted,
    joined,
    list_of,
    mapping_of,
    more_or_less,
    percent,
    plain_value,
    run_words,
    sentence,
    setting_of,
    value_of,
)
from vis.pictures.frames import frame_names

__all__ = ["summarise"]

_REAL_GRAINS = {"sand": 2e-4}
"""Diameter of real grains [m]: 0.2 mm is where fine sand ends and medium sand begins (ISO 14688-1)."""
_STATUS = {
    "stopped": "This run was stopped before it was finished; what follows is what it had by then. `hedgebed resume` on "
    "its folder finishes it.",
    "failed": "This run failed; what follows is what it had by then.",
    "running": "This run was still under way when the report was written; what follows is what it had by then.",
}


def summarise(run: RunFolder) -> dict[str, Any]:
    """Everything the report says but its images.

    Returns:
        A dict with "title", "status", "banner", "lead" (facts under the title), "tiles", "answers", "fit",
        "departures", "reference", "bed", "spike", "runs", "numbers", "settings", "warnings", "missing", "frames" and
        "reproduce"; "caveat" is what to know before any number.
    """
    result = run.result
    quantities = mapping_of(result.get("quantities"))
    experiment = str(result.get("experiment") or setting_of(run, "command") or "")
    return {
        "title": str(result.get("title") or (f"hedgebed {experiment}" if experiment else "A hedgebed run")),
        "experiment": experiment,
        "status": run.status,
        "banner": _banner(run),
        "lead": _lead(run, experiment),
        "seeds": len({r.seed for r in run.runs if r.seed is not None}),
        "tiles": _tiles(run, quantities),
        "caveat": _caveat(result, quantities),
        "answers": _answers(run, quantities),
        "fit": fit_part(result, quantities),
        "departures": departures_part(result),
        "reference": reference_part(result),
        "bed": bed_part(result, quantities),
        "spike": facts_table(_spike(mapping_of(result.get("spike")))),
        "runs": runs_table(run),
        "numbers": numbers_table(quantities),
        "settings": settings_table(run.settings),
        "warnings": [sentence(str(text)) for text in list_of(result.get("warnings"))],
        "missing": list(run.missing),
        "frames": _frames(run),
        "reproduce": reproduce_part(run, experiment),
    }


# ---- the answer ----------------------------------------------------------------------------------------------------


def _banner(run: RunFolder) -> str:
    if run.status == "done":
        return ""
    text = _STATUS.get(run.status, "" if run.result else "Whether this run was finished is not known.")
    reason = f" Reason: {sentence(run.reason)}" if run.reason and text else ""
    return text + reason


def _lead(run: RunFolder, experiment: str) -> list[str]:
    version = run.result.get("version") or setting_of(run, "version")
    created = setting_of(run, "created")
    return [
        text
        for text in (
            f"hedgebed {version}" if version else "",
            experiment,
            f"started {created.replace('T', ' ')[:16]}" if created else "",
            f"status: {run.status}",
        )
        if text
    ]


def _tiles(run: RunFolder, quantities: Mapping[str, Any]) -> list[dict[str, str]]:
    tiles = []
    if _restless(run, quantities):
        model = quantity(quantities.get("sinkage_spring_damper"))
        tiles.append(
            {
                "label": "Sinks to rest at",
                "value": "unknown",
                "note": f"no set-down came to rest in time; the spring-damper says {model}",
            }
        )
    if value_of(quantities, "sinkage_dem") is not None:
        under = (
            f"under {quantity(quantities['load'])}" if value_of(quantities, "load") is not None else "under its load"
        )
        model = quantity(quantities.get("sinkage_spring_damper"))
        tiles.append(
            {
                "label": "Sinks to rest at",
                "value": quantity(quantities["sinkage_dem"]),
                "note": f"{under}; the spring-damper says {model}",
            }
        )
    if push := _push(run):
        tiles.append({"label": "Sand pushes back with", "value": push["value"], "note": push["note"]})
    if value_of(quantities, "drag_gap") is not None:
        tiles.append(
            {
                "label": "Spring-damper wrong by",
                "value": quantity(quantities["drag_gap"], unit="%"),
                "note": "rms difference over rms drag, way in, all driven runs",
            }
        )
    if value_of(quantities, "stiffness") is not None:
        tiles.append(
            {
                "label": "Fitted stiffness K",
                "value": fitted(quantities, "stiffness"),
                "note": _fitted_note(run, quantities),
            }
        )
    return tiles


def _fitted_note(run: RunFolder, quantities: Mapping[str, Any]) -> str:
    words = [f"and damping C = {fitted(quantities, 'damping')}, for motion"]
    drops = [r for r in run.of_kind("drop") if value_of(r.quantities, "stop_time") is not None]
    depths = [float(r.bed.depth.max()) for r in (*run.of_kind("driven"), *drops) if r.bed is not None]
    words[0] += f" down to {quote(max(depths), None, 'm')}" if depths else ""
    if value_of(quantities, "stiffness_standing") is not None:
        words.append(f"for a foot that stands K = {quantity(quantities['stiffness_standing'])}")
    if mapping_of(quantities["stiffness"]).get("std") is None and value_of(quantities, "stiffness_error") is not None:
        words.append("± is the standard error of the fit")
    return "; ".join(words)


def _caveat(result: Mapping[str, Any], quantities: Mapping[str, Any]) -> str:
    """How far the grains of this run are from real ones; empty where that is not known."""
    bed = mapping_of(result.get("bed"))
    overlap, grain = value_of(quantities, "max_overlap"), plain_value(bed.get("grain"))
    factor = plain_value(mapping_of(bed.get("softening")).get("factor"))
    real = _REAL_GRAINS.get(str(bed.get("material")))
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
    return f"The grains are {joined(parts)}: these are numbers of that bed, not of a material."


def _spike(facts: Mapping[str, Any]) -> dict[str, Any]:
    """What there is to say of this spike: only a cone has an angle."""
    return {key: value for key, value in facts.items() if key != "cone_angle" or facts.get("tip") == "cone"}


def _frames(run: RunFolder) -> list[str]:
    """The .pvd files and which run each shows."""
    known = {r.id: r for r in run.runs}
    return [f"{name}.pvd ({run_words(known[name]) if name in known else 'frames'})" for name in frame_names(run.path)]


def _push(run: RunFolder) -> dict[str, str] | None:
    """The greatest force on the way in over all speeds, at which it was met, and the least of the other speeds'."""
    by_speed = _peaks(run, "driven", "peak_force")
    if not by_speed:
        return None
    depth = max((float(r.bed.depth.max()) for r in run.of_kind("driven") if r.bed is not None), default=None)
    to = f" to {quote(depth, unit='m')}" if depth is not None else ""
    speed, high = max(by_speed, key=lambda peak: peak[1][0])
    note = f"largest, driven in{to} at {speed:g}{NBSP}m/s"
    note += " (mean of the beds' largest)" if high[1] is not None else ""
    others = [f"{quote(*peak, 'N')} at {other:g}{NBSP}m/s" for other, peak in by_speed if other != speed]
    return {"value": quote(*high, "N"), "note": f"{note}; {joined(others)}" if others else note}


def _answers(run: RunFolder, quantities: Mapping[str, Any]) -> list[dict[str, str]]:
    answers = []
    said = mapping_of(run.result.get("departures"))

    def also(*names: str) -> str:
        return "".join(f" {sentence(str(said[name]))}" for name in names if said.get(name))

    sunk, law = value_of(quantities, "sinkage_dem"), value_of(quantities, "sinkage_spring_damper")
    if sunk is not None:
        load = f" of {quantity(quantities['load'])}" if value_of(quantities, "load") is not None else ""
        text = f"Set down under its load{load}, the spike comes to rest {quantity(quantities['sinkage_dem'])} deep."
        if law is not None:
            text += f" The fitted spring-damper says {quantity(quantities['sinkage_spring_damper'])}"
            text += f", {_deeper(law / sunk)}." if sunk > 0 else "."
        text += also("set_down", "surface")
        answers.append({"question": "How far does it sink?", "answer": text})
    elif _restless(run, quantities):
        text = "Not known: set down under its load, the spike did not come to rest in the time that was followed."
        if law is not None:
            text += f" The fitted spring-damper says {quantity(quantities['sinkage_spring_damper'])}."
        text += also("set_down", "surface")
        answers.append({"question": "How far does it sink?", "answer": text})
    if push := _push(run):
        text = f"{push['value']} {push['note']}."
        drops = _peaks(run, "drop", "peak_force")
        if drops:
            words = [f"{quote(*peak, 'N')} at {speed:g}{NBSP}m/s" for speed, peak in drops]
            text += f" Dropped, its force peaks at {joined(words)}."
        if value_of(quantities, "work_returned_dem") is not None:
            text += " " + _returned(quantities)
        answers.append({"question": "What does the sand push back with?", "answer": text})
    if value_of(quantities, "drag_gap") is not None:
        text = (
            f"With K = {fitted(quantities, 'stiffness')} and C = {fitted(quantities, 'damping')} it misses "
            f"the bed's drag on the way in by {quantity(quantities['drag_gap'], unit='%')} (rms difference over rms "
            "drag)."
        )
        worst = _worst(run.result)
        if worst:
            text += f" {worst}"
        peaks = _peak_gap(run)
        if peaks is not None:
            text += f" In drops its peak force is {more_or_less(peaks, 'above', 'below')} the bed's on average."
        answers.append({"question": "How wrong is the spring-damper?", "answer": text})
        if said.get("which_stiffness"):
            answers.append({"question": "Which K, and when?", "answer": also("which_stiffness").strip()})
    return answers


def _restless(run: RunFolder, quantities: Mapping[str, Any]) -> bool:
    """Whether the spike was set down but never came to rest in the bed."""
    null = "sinkage_dem" in quantities and value_of(quantities, "sinkage_dem") is None
    return null and bool(run.of_kind("set_down"))


def _returned(quantities: Mapping[str, Any]) -> str:
    """What the bed gives back of the work put in; where that is negative, pulling out takes work as well."""
    share, entry = value_of(quantities, "work_returned_dem"), quantities["work_returned_dem"]
    model = f"(spring-damper: {quantity(quantities.get('work_returned_spring_damper'), unit='%')} given back)"
    if share is not None and share < 0.0:
        std = plain_value(mapping_of(entry).get("std"))
        more = quote(-share, std, "%", significant=2)
        return f"Pulled out, it gives nothing back: that takes another {more} of the work put in {model}."
    return f"Pulled out, it gives back {quantity(entry, unit='%')} of the work put in {model}."


def _worst(result: Mapping[str, Any]) -> str:
    rows = [row for row in departure_rows(result) if row.bed_force > 0]
    if not rows:
        return ""
    worst = max(rows, key=lambda row: abs(row.difference))
    text = f"In newtons it is farthest off {_off(worst)}."
    top = min(row.depth_to for row in rows)
    shallow = [row for row in rows if row.depth_to == top and row is not worst]
    if shallow:
        near = max(shallow, key=lambda row: abs(row.difference / row.bed_force))
        text += f" At the top, where a foot stands, it is farthest off {_off(near)}."
    return text


def _off(row: Departure) -> str:
    apart = f"; {row.known}" if row.known else ""
    if row.bed_std is not None:
        apart += f", {quote(row.bed_std, unit='N', significant=2)} apart"
    return (
        f"at {row.speed:g}{NBSP}m/s between {short(1e3 * row.depth_from)} and {short(1e3 * row.depth_to)}{NBSP}mm: "
        f"{quote(abs(row.difference), unit='N', significant=2)} too {'much' if row.difference > 0 else 'little'} "
        f"({percent(abs(row.difference) / row.bed_force)}{apart})"
    )


def _peak_gap(run: RunFolder) -> float | None:
    ratios = []
    for r in run.of_kind("drop"):
        bed, model = value_of(r.quantities, "peak_force"), value_of(r.quantities, "model_peak_force")
        if bed and model is not None:
            ratios.append(model / bed - 1.0)
    return float(np.mean(ratios)) if ratios else None


def _peaks(run: RunFolder, kind: str, key: str) -> list[tuple[float, tuple[float, float | None]]]:
    """Speed -> mean over seeds and standard deviation between them (None for a single seed)."""
    found = []
    for speed in run.speeds(kind):
        numbers = [
            n
            for r in run.runs
            if r.kind == kind and r.speed == speed and (n := value_of(r.quantities, key)) is not None
        ]
        if numbers:
            std = float(np.std(numbers, ddof=1)) if len(numbers) > 1 else None
            found.append((speed, (float(np.mean(numbers)), std)))
    return found


def _deeper(ratio: float) -> str:
    return f"{plain(ratio, 2)} times as deep" if ratio >= 2.0 else more_or_less(ratio - 1.0, "deeper", "less deep")
