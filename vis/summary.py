"""What the report says, as plain words and formatted numbers; how it looks is `templates/report.html`'s business.

`summarise(run)` turns a `RunFolder` into a dict of strings, lists and tables. Whatever the folder lacks is left out or
reads "unknown"; nothing here raises for a part that is missing.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from vis.folder import PYTHON_RUNS, Run, RunFolder, Setting
from vis.frames import frame_names
from vis.numbers import column, plain, quantity, quote, short

__all__ = ["Table", "summarise"]

#: {"head": [...], "rows": [[...], ...]}; the first column is text, the others are numbers unless "text" is set.
Table = dict[str, Any]

_NBSP = "\N{NO-BREAK SPACE}"
_REAL_GRAINS = {"sand": 2e-4}
"""Diameter of real grains [m]: 0.2 mm is where fine sand ends and medium sand begins (ISO 14688-1)."""
_BARE_UNITS = {"1", "m", "m/s", "m/s2", "s", "kg", "N", "N/m", "N s/m", "Pa", "degrees"}
_STATUS = {
    "stopped": "This run was stopped before it was finished; what follows is what it had by then. `hedgebed resume` on "
    "its folder finishes it.",
    "failed": "This run failed; what follows is what it had by then.",
    "running": "This run was still under way when the report was written; what follows is what it had by then.",
}
_NAMES = {
    "stiffness": "stiffness K",
    "damping": "damping C",
    "stiffness_error": "stiffness K, standard error of the fit",
    "damping_error": "damping C, standard error of the fit",
    "sinkage_dem": "sinkage at rest, bed",
    "sinkage_spring_damper": "sinkage at rest, spring-damper",
    "drag_gap": "drag gap, spring-damper against bed",
    "work_returned_dem": "work given back, bed",
    "work_returned_spring_damper": "work given back, spring-damper",
    "load": "load set down",
    "drop_mass": "mass dropped",
    "stiffness_standing": "stiffness for a foot that stands (load over sinkage)",
    "surface_force": "force at depth 0, driven",
    "surface_roughness": "how far grains stick out under the tip",
    "grain_count": "grains",
    "packing_fraction": "packing fraction",
    "coordination_number": "contacts per grain",
    "surface": "height of the surface above the floor",
    "young": "Young's modulus of the softened grains",
    "time_step": "time step",
    "max_overlap": "largest overlap of two grains",
    "size": "size (x, y, depth)",
    "grain": "mean diameter of a grain",
    "grain_diameter": "mean diameter of a grain",
    "spread": "spread of the diameters",
    "gravity": "gravity of the grains",
    "seeds": "seeds",
    "material": "material",
    "pressure": "pressure expected under the tip",
    "speed": "speed expected",
    "real": "Young's modulus of the real grain",
    "factor": "softer than the real grain by a factor of",
    "overlap": "overlap expected",
}
_UNITS = {
    "size": "m", "grain": "m", "grain_diameter": "m", "surface": "m", "gravity": "m/s2", "young": "Pa", "real": "Pa",
    "pressure": "Pa", "time_step": "s",
    "diameter": "m", "shaft_diameter": "m", "length": "m", "mass": "kg", "load": "N", "speed": "m/s",
    "cone_angle": "degrees",
}  # fmt: skip
_SHARES = {
    "drag_gap", "model_drag_gap", "work_returned_dem", "work_returned_spring_damper", "max_overlap", "overlap",
    "overlap_quasi_static", "overlap_impact", "spread",
}  # fmt: skip


def summarise(run: RunFolder) -> dict[str, Any]:
    """Everything the report says but its images.

    Returns:
        A dict with "title", "status", "banner", "lead" (facts under the title), "tiles", "answers", "fit",
        "departures", "reference", "bed", "spike", "runs", "numbers", "settings", "warnings", "missing", "frames" and
        "reproduce"; "caveat" is what to know before any number.
    """
    result = run.result
    quantities = _mapping(result.get("quantities"))
    experiment = str(result.get("experiment") or _setting(run, "command") or "")
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
        "fit": _fit(result, quantities),
        "departures": _departures(result),
        "reference": _reference(result),
        "bed": _bed(result, quantities),
        "spike": _facts(_spike(_mapping(result.get("spike")))),
        "runs": _runs(run),
        "numbers": _numbers(quantities),
        "settings": _settings(run.settings),
        "warnings": [_sentence(str(text)) for text in _list(result.get("warnings"))],
        "missing": list(run.missing),
        "frames": _frames(run),
        "reproduce": _reproduce(run, experiment),
    }


# ---- the answer ----------------------------------------------------------------------------------------------------


def _banner(run: RunFolder) -> str:
    if run.status == "done":
        return ""
    text = _STATUS.get(run.status, "" if run.result else "Whether this run was finished is not known.")
    reason = f" Reason: {_sentence(run.reason)}" if run.reason and text else ""
    return text + reason


def _lead(run: RunFolder, experiment: str) -> list[str]:
    version = run.result.get("version") or _setting(run, "version")
    created = _setting(run, "created")
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
    if _value(quantities, "sinkage_dem") is not None:
        under = f"under {quantity(quantities['load'])}" if _value(quantities, "load") is not None else "under its load"
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
    if _value(quantities, "drag_gap") is not None:
        tiles.append(
            {
                "label": "Spring-damper wrong by",
                "value": quantity(quantities["drag_gap"], unit="%"),
                "note": "rms difference over rms drag, way in, all driven runs",
            }
        )
    if _value(quantities, "stiffness") is not None:
        tiles.append(
            {
                "label": "Fitted stiffness K",
                "value": _fitted(quantities, "stiffness"),
                "note": _fitted_note(run, quantities),
            }
        )
    return tiles


def _fitted(quantities: Mapping[str, Any], key: str) -> str:
    """K or C with its spread between beds, or for one bed with the standard error of the fit."""
    entry = _mapping(quantities.get(key))
    error = _value(quantities, f"{key}_error")
    if entry.get("std") is None and error is not None:
        entry = {**entry, "std": error}
    return quantity(entry) if entry else "unknown"


def _fitted_note(run: RunFolder, quantities: Mapping[str, Any]) -> str:
    words = [f"and damping C = {_fitted(quantities, 'damping')}, for motion"]
    depths = [float(r.bed.depth.max()) for r in run.of_kind("driven") if r.bed is not None]
    words[0] += f" down to {quote(max(depths), 0.0, 'm')}" if depths else ""
    if _value(quantities, "stiffness_standing") is not None:
        words.append(f"for a foot that stands K = {quantity(quantities['stiffness_standing'])}")
    if _mapping(quantities["stiffness"]).get("std") is None and _value(quantities, "stiffness_error") is not None:
        words.append("± is the standard error of the fit")
    return "; ".join(words)


def _caveat(result: Mapping[str, Any], quantities: Mapping[str, Any]) -> str:
    """How far the grains of this run are from real ones; empty where that is not known."""
    bed = _mapping(result.get("bed"))
    overlap, grain = _value(quantities, "max_overlap"), _plain_value(bed.get("grain"))
    factor = _plain_value(_mapping(bed.get("softening")).get("factor"))
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
    return f"The grains are {_and(parts)}: these are numbers of that bed, not of a material."


def _spike(facts: Mapping[str, Any]) -> dict[str, Any]:
    """What there is to say of this spike: only a cone has an angle."""
    return {key: value for key, value in facts.items() if key != "cone_angle" or facts.get("tip") == "cone"}


def _frames(run: RunFolder) -> list[str]:
    """The .pvd files and which run each shows."""
    known = {r.id: r for r in run.runs}
    return [f"{name}.pvd ({_run_words(known[name]) if name in known else 'frames'})" for name in frame_names(run.path)]


def _push(run: RunFolder) -> dict[str, str] | None:
    """The greatest force on the way in at the fastest speed, and at the slowest."""
    by_speed = _peaks(run, "driven", "peak_force")
    if not by_speed:
        return None
    depth = max((float(r.bed.depth.max()) for r in run.of_kind("driven") if r.bed is not None), default=None)
    to = f" to {quote(depth, unit='m')}" if depth is not None else ""
    (slow, low), (fast, high) = by_speed[0], by_speed[-1]
    if slow == fast:
        return {"value": quote(*low, "N"), "note": f"at most, driven in{to} at {slow:g}{_NBSP}m/s"}
    note = f"at most, driven in{to} at {fast:g}{_NBSP}m/s; {quote(*low, 'N')} at {slow:g}{_NBSP}m/s"
    return {"value": quote(*high, "N"), "note": note}


def _answers(run: RunFolder, quantities: Mapping[str, Any]) -> list[dict[str, str]]:
    answers = []
    said = _mapping(run.result.get("departures"))

    def also(*names: str) -> str:
        return "".join(f" {_sentence(str(said[name]))}" for name in names if said.get(name))

    sunk, law = _value(quantities, "sinkage_dem"), _value(quantities, "sinkage_spring_damper")
    if sunk is not None:
        load = f" of {quantity(quantities['load'])}" if _value(quantities, "load") is not None else ""
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
            words = [f"{quote(*peak, 'N')} at {speed:g}{_NBSP}m/s" for speed, peak in drops]
            text += f" Dropped, its force peaks at {_and(words)}."
        if _value(quantities, "work_returned_dem") is not None:
            text += " " + _returned(quantities)
        answers.append({"question": "What does the sand push back with?", "answer": text})
    if _value(quantities, "drag_gap") is not None:
        text = (
            f"With K = {_fitted(quantities, 'stiffness')} and C = {_fitted(quantities, 'damping')} it misses "
            f"the bed's drag on the way in by {quantity(quantities['drag_gap'], unit='%')} (rms difference over rms "
            "drag)."
        )
        worst = _worst(run.result)
        if worst:
            text += f" {worst}"
        peaks = _peak_gap(run)
        if peaks is not None:
            text += f" In drops its peak force is {_more(peaks, 'above', 'below')} the bed's on average."
        answers.append({"question": "How wrong is the spring-damper?", "answer": text})
        if said.get("which_stiffness"):
            answers.append({"question": "Which K, and when?", "answer": also("which_stiffness").strip()})
    return answers


def _restless(run: RunFolder, quantities: Mapping[str, Any]) -> bool:
    """Whether the spike was set down but never came to rest in the bed."""
    null = "sinkage_dem" in quantities and _value(quantities, "sinkage_dem") is None
    return null and bool(run.of_kind("set_down"))


def _returned(quantities: Mapping[str, Any]) -> str:
    """What the bed gives back of the work put in; where that is negative, pulling out takes work as well."""
    share, entry = _value(quantities, "work_returned_dem"), quantities["work_returned_dem"]
    model = f"(spring-damper: {quantity(quantities.get('work_returned_spring_damper'), unit='%')} given back)"
    if share is not None and share < 0.0:
        std = _plain_value(_mapping(entry).get("std"))
        more = quote(-share, std, "%", significant=2)
        return f"Pulled out, it gives nothing back: that takes another {more} of the work put in {model}."
    return f"Pulled out, it gives back {quantity(entry, unit='%')} of the work put in {model}."


def _worst(result: Mapping[str, Any]) -> str:
    rows = [row for row in _departure_rows(result) if row["bed_force"] > 0]
    if not rows:
        return ""
    worst = max(rows, key=lambda row: abs(row["model_force"] - row["bed_force"]))
    text = f"In newtons it is farthest off {_off(worst)}."
    top = min(row["depth_to"] for row in rows)
    shallow = [row for row in rows if row["depth_to"] == top and row is not worst]
    if shallow:
        near = max(shallow, key=lambda row: abs(row["model_force"] / row["bed_force"] - 1.0))
        text += f" At the top, where a foot stands, it is farthest off {_off(near)}."
    return text


def _off(row: Mapping[str, float]) -> str:
    difference = row["model_force"] - row["bed_force"]
    return (
        f"at {row['speed']:g}{_NBSP}m/s between {short(1e3 * row['depth_from'])} and {short(1e3 * row['depth_to'])}"
        f"{_NBSP}mm: {quote(abs(difference), unit='N', significant=2)} too {'much' if difference > 0 else 'little'} "
        f"({_percent(abs(difference) / row['bed_force'])})"
    )


def _peak_gap(run: RunFolder) -> float | None:
    ratios = []
    for r in run.of_kind("drop"):
        bed, model = _value(r.quantities, "peak_force"), _value(r.quantities, "model_peak_force")
        if bed and model is not None:
            ratios.append(model / bed - 1.0)
    return float(np.mean(ratios)) if ratios else None


def _peaks(run: RunFolder, kind: str, key: str) -> list[tuple[float, tuple[float, float | None]]]:
    """Speed -> mean over seeds and standard deviation between them (None for a single seed)."""
    found = []
    for speed in run.speeds(kind):
        numbers = [
            n for r in run.runs if r.kind == kind and r.speed == speed and (n := _value(r.quantities, key)) is not None
        ]
        if numbers:
            std = float(np.std(numbers, ddof=1)) if len(numbers) > 1 else None
            found.append((speed, (float(np.mean(numbers)), std)))
    return found


# ---- tables --------------------------------------------------------------------------------------------------------


def _fit(result: Mapping[str, Any], quantities: Mapping[str, Any]) -> dict[str, Any] | None:
    if _value(quantities, "stiffness") is None and not result.get("fits"):
        return None
    own = [_mapping(fit) for fit in _list(result.get("fits"))]
    one = len(own) < 2
    rows = [
        [
            "this bed" if one else "all beds together",
            _fitted(quantities, "stiffness"),
            _fitted(quantities, "damping"),
            quantity(quantities.get("drag_gap"), unit="%"),
        ]
    ]
    if one:
        said = "± is the standard error of the fit, leaving out one run at a time; how much K and C differ from bed to "
        said += "bed is not known."
        known = _value(quantities, "stiffness_error") is not None
        return {"table": {"head": ["fitted to", "K", "C", "drag gap"], "rows": rows}, "note": said if known else ""}
    for i, fit in enumerate(own):
        rows.append(
            [
                f"bed {fit.get('seed', i + 1)} by itself",
                quote(_value(fit, "stiffness"), _fit_error(fit, "stiffness"), "N/m"),
                quote(_value(fit, "damping"), _fit_error(fit, "damping"), "N s/m"),
                quote(_value(fit, "drag_gap"), None, "%") if "drag_gap" in fit else "\N{EN DASH}",
            ]
        )
    errors = [
        f"{name} {quantity(quantities[key])}"
        for name, key in (("K", "stiffness_error"), ("C", "damping_error"))
        if _value(quantities, key) is not None
    ]
    said_of: list[str] = []
    if errors:
        said_of.append(f"Standard error of the fit to all beds, leaving out one run at a time: {_and(errors)}.")
    if any(_fit_error(fit, key) is not None for fit in own for key in ("stiffness", "damping")):
        said_of.append(
            "± is the spread between beds in the first row, the standard error of that bed's fit in the others."
        )
    note = " ".join(said_of)
    return {"table": {"head": ["fitted to", "K", "C", "drag gap"], "rows": rows}, "note": note}


def _fit_error(fit: Mapping[str, Any], key: str) -> float | None:
    return _plain_value(fit.get(f"{key}_error", fit.get(f"{key}_std")))


def _departures(result: Mapping[str, Any]) -> dict[str, Any]:
    departures = _mapping(result.get("departures"))
    entries = _departure_rows(result)
    unit, forces = column([row[key] for row in entries for key in ("bed_force", "model_force")], "N")
    rows = [
        [
            f"{row['speed']:g}",
            f"{short(1e3 * row['depth_from'])} to {short(1e3 * row['depth_to'])}",
            bed,
            model,
            _signed_percent(row["model_force"] / row["bed_force"] - 1.0) if row["bed_force"] > 0 else "\N{EN DASH}",
        ]
        for row, bed, model in zip(entries, forces[::2], forces[1::2], strict=True)
    ]
    answered = {_sentence(str(departures.get(name, ""))) for name in ("which_stiffness", "surface", "set_down")}
    said = [_sentence(str(text)) for text in _list(departures.get("sentences"))]
    head = ["speed [m/s]", "depth [mm]", f"bed [{unit}]", f"spring-damper [{unit}]", "gap"]
    return {
        "sentences": [text for text in said if text not in answered],
        "table": {"head": head, "rows": rows} if rows else None,
    }


def _departure_rows(result: Mapping[str, Any]) -> list[dict[str, float]]:
    names = ("speed", "depth_from", "depth_to", "bed_force", "model_force")
    rows = []
    for entry in _list(_mapping(result.get("departures")).get("table")):
        numbers = {name: _plain_value(_mapping(entry).get(name)) for name in names}
        if all(number is not None for number in numbers.values()):
            rows.append({name: float(number) for name, number in numbers.items() if number is not None})
    return rows


def _reference(result: Mapping[str, Any]) -> dict[str, Any] | None:
    """By how much the numbers moved from those of another result, where it was compared with one."""
    reference = _mapping(result.get("reference"))
    rows = []
    for key, entry in _mapping(reference.get("moved")).items():
        moved = _mapping(entry)
        unit = "%" if key in _SHARES else str(moved.get("unit") or "1")
        change = _plain_value(moved.get("change"))
        rows.append(
            [
                _label(key),
                quote(_plain_value(moved.get("before")), None, unit),
                quote(_plain_value(moved.get("now")), None, unit),
                _signed_percent(change) if change is not None else "\N{EN DASH}",
            ]
        )
    if not rows:
        return None
    return {"file": str(reference.get("file") or ""), "table": {"head": ["", "there", "here", "change"], "rows": rows}}


def _bed(result: Mapping[str, Any], quantities: Mapping[str, Any]) -> dict[str, Any]:
    bed = _mapping(result.get("bed"))
    listed = [_mapping(entry) for entry in _list(bed.get("seeds")) if isinstance(entry, Mapping)]
    own = {key: value for key, value in bed.items() if not (key == "seeds" and listed) and key != "softening"}
    for key in (
        "grain_count",
        "packing_fraction",
        "coordination_number",
        "surface",
        "young",
        "time_step",
        "max_overlap",
    ):
        if key in quantities:
            own[key] = quantities[key]
    seeds = None
    if len(listed) > 1:
        keys = [key for key in listed[0] if key != "seed"]
        rows = [[str(e.get("seed", "?")), *(_cell(key, e.get(key)) for key in keys)] for e in listed]
        seeds = {"head": ["seed", *(_label(key) for key in keys)], "rows": rows}
    softening = _facts(_mapping(bed.get("softening")))
    return {"facts": _facts(own), "seeds": seeds, "softening": softening}


def _runs(run: RunFolder) -> Table | None:
    columns = [
        ("depth", "max_depth", "m"),
        ("at rest", "sinkage", "m"),
        ("peak force", "peak_force", "N"),
        ("work in", "work_in", "J"),
        ("work out", "work_out", "J"),
        ("drag gap", "drag_gap", "%"),
    ]
    runs = [r for kind in ("driven", "drop", "set_down") for r in run.of_kind(kind)]
    runs += [r for r in run.runs if r not in runs]
    many = len({r.seed for r in runs}) > 1
    head, cells = ["run"], [[_run_words(r, which_bed=many) for r in runs]]
    for title, key, unit in columns:
        bed = [_value(r.quantities, key) for r in runs]
        model = [_value(r.quantities, f"model_{key}") for r in runs]
        shown, texts = column([*bed, *model], unit)  # one unit for both
        for name, values, part in ((title, bed, texts[: len(runs)]), ("spring-damper", model, texts[len(runs) :])):
            if any(value is not None for value in values):
                head.append(f"{name} [{shown}]")
                cells.append(part)
    return {"head": head, "rows": [list(row) for row in zip(*cells, strict=True)]} if runs else None


def _run_words(run: Run, *, which_bed: bool = True) -> str:
    words = {"driven": "driven", "drop": "dropped", "set_down": "set down"}.get(run.kind, run.id)
    speed = f" at {run.speed:g}{_NBSP}m/s" if run.speed and run.kind != "set_down" else ""
    return f"{words}{speed}" + (f", bed {run.seed}" if run.seed is not None and which_bed else "")


def _numbers(quantities: Mapping[str, Any]) -> Table | None:
    rows = [
        [_label(key), _cell(key, entry), str(_mapping(entry).get("note") or "")] for key, entry in quantities.items()
    ]
    return {"head": ["quantity", "value", "note"], "rows": rows, "text": True} if rows else None


def _facts(entries: Mapping[str, Any]) -> Table | None:
    rows = [[_label(key), _cell(key, value)] for key, value in entries.items() if value is not None]
    return {"head": [], "rows": rows, "text": True} if rows else None


def _settings(settings: Iterable[Setting]) -> Table | None:
    rows = []
    for setting in settings:
        if not setting.table and setting.key in ("format", "version", "command", "created", "not_set"):
            continue
        units = re.findall(r"\[([^\[\]]+)\]", setting.comment)
        meaning = re.sub(r"\s*\[[^\[\]]+\]", "", setting.comment).strip().rstrip(".")
        if meaning in _BARE_UNITS:  # a run saved from Python: the comment is the unit
            units, meaning = [meaning], ""
        unit = units[-1] if units and units[-1] != "1" else ""
        name = setting.key if setting.table in ("", "settings") else f"{setting.table}.{setting.key}"
        rows.append([name, setting.value, unit, meaning])
    return {"head": ["setting", "value", "unit", "meaning"], "rows": rows, "text": True} if rows else None


def _reproduce(run: RunFolder, experiment: str) -> dict[str, str]:
    called = PYTHON_RUNS.get(experiment, "")
    folder = Path(os.path.relpath(run.path)) if run.path.resolve().is_relative_to(Path.cwd()) else run.path.resolve()
    command = f".venv/bin/hedgebed {experiment or 'penetrate'} {folder / 'run.toml'} --out runs/again"
    return {
        "command": "" if called else command,
        "script": f"coupling.{called}" if called else "",
        "version": str(run.result.get("version") or _setting(run, "version") or "unknown"),
    }


# ---- words and numbers ---------------------------------------------------------------------------------------------


def _cell(key: str, value: Any) -> str:
    """A value of result.json as a person reads it; units of bare numbers are known by their name."""
    if isinstance(value, Mapping) and "value" in value:
        return quantity(value, unit="%" if key in _SHARES else None)
    if isinstance(value, Mapping):
        return ", ".join(f"{_label(str(k))} {_cell(str(k), v)}" for k, v in value.items())
    if isinstance(value, list | tuple):
        if key == "size" and all(isinstance(item, int | float) for item in value):
            return " × ".join(short(1e3 * item) for item in value) + f"{_NBSP}mm"
        return ", ".join(_cell(key, item) for item in value)
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, int | float):
        return quote(value, 0.0, "%" if key in _SHARES else _UNITS.get(key, "1"))
    return "unknown" if value is None else str(value)


def _label(key: str) -> str:
    return _NAMES.get(key, key.replace("_", " "))


def _mapping(value: Any) -> Mapping[str, Any]:
    return value if isinstance(value, Mapping) else {}


def _list(value: Any) -> list[Any]:
    return value if isinstance(value, list) else []


def _plain_value(value: Any) -> float | None:
    if isinstance(value, bool) or not isinstance(value, int | float) or not np.isfinite(value):
        return None
    return float(value)


def _value(quantities: Mapping[str, Any], key: str) -> float | None:
    entry = quantities.get(key)
    return _plain_value(entry.get("value") if isinstance(entry, Mapping) else entry)


def _setting(run: RunFolder, key: str) -> str:
    return next((s.value.strip('"') for s in run.settings if s.key == key and not s.table), "")


def _percent(share: float) -> str:
    return f"{plain(100.0 * share, 2)}{_NBSP}%"


def _signed_percent(share: float) -> str:
    return ("+" if share > 0 else "") + _percent(share)


def _more(share: float, above: str, below: str) -> str:
    return f"{_percent(abs(share))} {above if share > 0 else below}"


def _deeper(ratio: float) -> str:
    return f"{plain(ratio, 2)} times as deep" if ratio >= 2.0 else _more(ratio - 1.0, "deeper", "less deep")


def _and(words: list[str]) -> str:
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}" if words else ""


def _sentence(text: str) -> str:
    text = text.strip()
    return text[:1].upper() + text[1:] + ("" if text.endswith((".", "!", "?")) else ".") if text else ""
