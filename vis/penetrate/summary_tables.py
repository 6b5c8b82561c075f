"""Tables of the report: the fits, the departures, the bed, the runs, every number and every setting."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from vis.page.folder import PYTHON_RUNS, RunFolder, Setting
from vis.page.numbers import column, quantity, quote, short
from vis.penetrate.summary_words import (
    SHARES,
    cell_text,
    departure_rows,
    fitted,
    joined,
    label_of,
    list_of,
    mapping_of,
    plain_value,
    run_words,
    sentence,
    setting_of,
    signed_percent,
    value_of,
)

__all__ = [
    "Table",
    "bed_part",
    "departures_part",
    "facts_table",
    "fit_part",
    "numbers_table",
    "reference_part",
    "reproduce_part",
    "runs_table",
    "settings_table",
]

#: {"head": [...], "rows": [[...], ...]}; the first column is text, the others are numbers unless "text" is set.
Table = dict[str, Any]
_BARE_UNITS = {"1", "m", "m/s", "m/s2", "s", "kg", "N", "N/m", "N s/m", "Pa", "degrees"}


# ---- tables --------------------------------------------------------------------------------------------------------


def fit_part(result: Mapping[str, Any], quantities: Mapping[str, Any]) -> dict[str, Any] | None:
    """What was fitted: a table of the pooled and the beds' own fits, and a note."""
    if value_of(quantities, "stiffness") is None and not result.get("fits"):
        return None
    own = [mapping_of(fit) for fit in list_of(result.get("fits"))]
    one = len(own) < 2
    rows = [
        [
            "this bed" if one else "all beds together",
            fitted(quantities, "stiffness"),
            fitted(quantities, "damping"),
            quantity(quantities.get("drag_gap"), unit="%"),
        ]
    ]
    if one:
        said = "± is the standard error of the fit, leaving out one run at a time; how much K and C differ from bed to "
        said += "bed is not known."
        known = value_of(quantities, "stiffness_error") is not None
        return {"table": {"head": ["fitted to", "K", "C", "drag gap"], "rows": rows}, "note": said if known else ""}
    for i, fit in enumerate(own):
        rows.append(
            [
                f"bed {fit.get('seed', i + 1)} by itself",
                quote(value_of(fit, "stiffness"), _fit_error(fit, "stiffness"), "N/m"),
                quote(value_of(fit, "damping"), _fit_error(fit, "damping"), "N s/m"),
                quote(value_of(fit, "drag_gap"), None, "%") if "drag_gap" in fit else "\N{EN DASH}",
            ]
        )
    errors = [
        f"{name} {quantity(quantities[key])}"
        for name, key in (("K", "stiffness_error"), ("C", "damping_error"))
        if value_of(quantities, key) is not None
    ]
    said_of: list[str] = []
    if errors:
        said_of.append(f"Standard error of the fit to all beds, leaving out one run at a time: {joined(errors)}.")
    if any(_fit_error(fit, key) is not None for fit in own for key in ("stiffness", "damping")):
        said_of.append(
            "± is the spread between beds in the first row, the standard error of that bed's fit in the others."
        )
    note = " ".join(said_of)
    return {"table": {"head": ["fitted to", "K", "C", "drag gap"], "rows": rows}, "note": note}


def _fit_error(fit: Mapping[str, Any], key: str) -> float | None:
    return plain_value(fit.get(f"{key}_error", fit.get(f"{key}_std")))


def departures_part(result: Mapping[str, Any]) -> dict[str, Any]:
    """Where bed and spring-damper depart: sentences and a table."""
    departures = mapping_of(result.get("departures"))
    entries, dash = departure_rows(result), "\N{EN DASH}"
    told = any(row.beds is not None for row in entries)
    unit, forces = column([force for row in entries for force in (row.bed_force, row.bed_std, row.model_force)], "N")
    rows = [
        [
            f"{row.speed:g}",
            f"{short(1e3 * row.depth_from)} to {short(1e3 * row.depth_to)}",
            *([f"{row.beds:.0f}" if row.beds is not None else dash] if told else []),
            bed,
            *([apart] if told else []),
            model,
            dash if row.share is None else signed_percent(row.share),
        ]
        for row, bed, apart, model in zip(entries, forces[::3], forces[1::3], forces[2::3], strict=True)
    ]
    answered = {sentence(str(departures.get(name, ""))) for name in ("which_stiffness", "surface", "set_down")}
    said = [sentence(str(text)) for text in list_of(departures.get("sentences"))]
    head = ["speed [m/s]", "depth [mm]", f"bed [{unit}]", f"spring-damper [{unit}]", "gap"]
    if told:
        head[2:3] = ["beds", f"bed, mean [{unit}]", f"std between beds [{unit}]"]
    return {
        "sentences": [text for text in said if text not in answered],
        "table": {"head": head, "rows": rows} if rows else None,
    }


def reference_part(result: Mapping[str, Any]) -> dict[str, Any] | None:
    """By how much the numbers moved from those of another result, where it was compared with one."""
    reference = mapping_of(result.get("reference"))
    rows = []
    for key, entry in mapping_of(reference.get("moved")).items():
        moved = mapping_of(entry)
        unit = "%" if key in SHARES else str(moved.get("unit") or "1")
        change = plain_value(moved.get("change"))
        rows.append(
            [
                label_of(key),
                quote(plain_value(moved.get("before")), plain_value(moved.get("before_std")), unit),
                quote(plain_value(moved.get("now")), plain_value(moved.get("now_std")), unit),
                signed_percent(change) if change is not None else "\N{EN DASH}",
            ]
        )
    if not rows:
        return None
    return {"file": str(reference.get("file") or ""), "table": {"head": ["", "there", "here", "change"], "rows": rows}}


def bed_part(result: Mapping[str, Any], quantities: Mapping[str, Any]) -> dict[str, Any]:
    """What is known of the bed, and a table of the beds of several seeds."""
    bed = mapping_of(result.get("bed"))
    listed = [mapping_of(entry) for entry in list_of(bed.get("seeds")) if isinstance(entry, Mapping)]
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
        rows = [[str(e.get("seed", "?")), *(cell_text(key, e.get(key)) for key in keys)] for e in listed]
        seeds = {"head": ["seed", *(label_of(key) for key in keys)], "rows": rows}
    softening = facts_table(mapping_of(bed.get("softening")))
    return {"facts": facts_table(own), "seeds": seeds, "softening": softening}


def runs_table(run: RunFolder) -> Table | None:
    """The runs, one a row."""
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
    head, cells = ["run"], [[run_words(r, which_bed=many) for r in runs]]
    for title, key, unit in columns:
        bed = [value_of(r.quantities, key) for r in runs]
        model = [value_of(r.quantities, f"model_{key}") for r in runs]
        shown, texts = column([*bed, *model], unit)  # one unit for both
        for name, values, part in ((title, bed, texts[: len(runs)]), ("spring-damper", model, texts[len(runs) :])):
            if any(value is not None for value in values):
                head.append(f"{name} [{shown}]")
                cells.append(part)
    return {"head": head, "rows": [list(row) for row in zip(*cells, strict=True)]} if runs else None


def numbers_table(quantities: Mapping[str, Any]) -> Table | None:
    """Every quantity with its note."""
    rows = [
        [label_of(key), cell_text(key, entry), str(mapping_of(entry).get("note") or "")]
        for key, entry in quantities.items()
    ]
    return {"head": ["quantity", "value", "note"], "rows": rows, "text": True} if rows else None


def facts_table(entries: Mapping[str, Any]) -> Table | None:
    """Names and values, without those that are not known."""
    rows = [[label_of(key), cell_text(key, value)] for key, value in entries.items() if value is not None]
    return {"head": [], "rows": rows, "text": True} if rows else None


def settings_table(settings: Iterable[Setting]) -> Table | None:
    """Every setting with what it is."""
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


def reproduce_part(run: RunFolder, experiment: str) -> dict[str, str]:
    """How to do the run again."""
    called = PYTHON_RUNS.get(experiment, "")
    folder = Path(os.path.relpath(run.path)) if run.path.resolve().is_relative_to(Path.cwd()) else run.path.resolve()
    command = f".venv/bin/hedgebed {experiment or 'penetrate'} {folder / 'run.toml'} --out runs/again"
    return {
        "command": "" if called else command,
        "script": f"coupling.{called}" if called else "",
        "version": str(run.result.get("version") or setting_of(run, "version") or "unknown"),
    }
