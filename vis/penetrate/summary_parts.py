"""Words, numbers and tables of the report: names of quantities, units, how a value is quoted, and its parts."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Mapping
from dataclasses import MISSING, dataclass, fields
from pathlib import Path
from typing import Any, TypedDict

import numpy as np

from vis.page.folder import PYTHON_RUNS, Run, RunFolder, Setting
from vis.page.numbers import column, plain, quantity, quote, short, with_squares
from vis.page.sentences import Sentences, label_of

__all__ = [
    "as_foot", "bed_part", "cell_text", "Departure", "departure_rows", "departures_part", "facts_table",
    "fit_error", "joined", "list_of", "mapping_of", "MINUS",
    "more_or_less", "NBSP", "numbers_table", "percent", "plain_value", "reference_part", "reproduce_part",
    "rest_part", "run_words", "runs_table", "sentence", "setting_of", "settings_table", "SHARES", "signed_percent",
    "std_of", "Table", "value_of",
]  # fmt: skip

NBSP, MINUS = "\N{NO-BREAK SPACE}", "\N{MINUS SIGN}"
say = Sentences(__package__)
_UNITS = {
    "size": "m", "grain": "m", "grain_diameter": "m", "surface": "m", "gravity": "m/s2", "young": "Pa", "real": "Pa",
    "pressure": "Pa", "time_step": "s",
    "diameter": "m", "shaft_diameter": "m", "length": "m", "mass": "kg", "load": "N", "speed": "m/s",
    "cone_angle": "degrees",
}  # fmt: skip
SHARES = {
    "drag_gap", "model_drag_gap", "work_returned_dem", "work_returned_spring_damper", "work_returned_amended",
    "force_gap_spring_damper", "force_gap_amended", "max_overlap", "overlap",
    "overlap_quasi_static", "overlap_impact", "spread",
}  # fmt: skip


@dataclass(frozen=True)
class Departure:
    """One row of the table of departures: mean forces of bed and law in a band of depth at one speed.

    ``speed``: [m/s]. ``depth_from``, ``depth_to``: [m]. ``bed_force``, ``model_force``: [N], the bed's the mean over
    the beds. ``beds``: How many; None where it is not stated. ``bed_std``: Standard deviation of the bed's force
    between beds [N]; None where unknown.
    """

    speed: float
    depth_from: float
    depth_to: float
    bed_force: float
    model_force: float
    beds: float | None = None
    bed_std: float | None = None

    @property
    def difference(self) -> float:
        """Law minus bed [N]."""
        return self.model_force - self.bed_force

    @property
    def share(self) -> float | None:
        """The difference as a share of the bed's [1]; None where the bed does not push."""
        return self.difference / self.bed_force if self.bed_force > 0 else None

    @property
    def known(self) -> str:
        """How well: ``one bed``, ``3 beds``; empty where it is not stated."""
        return "" if self.beds is None else "one bed" if self.beds == 1 else f"{self.beds:.0f} beds"


def departure_rows(result: Mapping[str, Any]) -> list[Departure]:
    """The rows of the table of departures; one without all of its numbers is left out."""
    rows = []
    for entry in list_of(mapping_of(result.get("departures")).get("table")):
        numbers = {field.name: plain_value(mapping_of(entry).get(field.name)) for field in fields(Departure)}
        if all(numbers[field.name] is not None for field in fields(Departure) if field.default is MISSING):
            rows.append(Departure(**numbers))  # type: ignore[arg-type]
    return rows


def run_words(run: Run, *, which_bed: bool = True) -> str:
    """What a run did, in words."""
    words = {"driven": "driven", "drop": "dropped", "set_down": "set down"}.get(run.kind, run.id)
    speed = f" at {run.speed:g}{NBSP}m/s" if run.speed and run.kind != "set_down" else ""
    return f"{words}{speed}" + (f", bed {run.seed}" if run.seed is not None and which_bed else "")


def cell_text(key: str, value: Any) -> str:
    """A value of result.json as a person reads it; units of bare numbers are known by their name."""
    if isinstance(value, Mapping) and "value" in value:
        return quantity(value, unit="%" if key in SHARES else None)
    if isinstance(value, Mapping):
        return ", ".join(f"{label_of(str(k))} {cell_text(str(k), v)}" for k, v in value.items())
    if isinstance(value, list | tuple):
        if key == "size" and all(isinstance(item, int | float) for item in value):
            return " × ".join(short(1e3 * item) for item in value) + f"{NBSP}mm"
        return ", ".join(cell_text(key, item) for item in value)
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, int | float):
        return quote(value, 0.0, "%" if key in SHARES else _UNITS.get(key, "1"))
    return "unknown" if value is None else str(value)


def as_foot(value: Any) -> Any:
    """`value` with its strings, also those inside of lists and mappings, on a foot in place of a spike and its tip.

    A spike with its size before it, "a 12 mm spike", is another one and stays, and so do names of options.
    """
    if isinstance(value, str):
        text = re.sub(r"(?<![\w`-])(?<!mm[ \u00a0])([sS])pike(?![\w-])", _foot, value)
        return re.sub(r"\b([Tt]he|[Aa]) tip\b", r"\1 foot", text)
    if isinstance(value, Mapping):
        return {key: as_foot(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return type(value)(as_foot(item) for item in value)
    return value


def _foot(found: re.Match[str]) -> str:
    return "Foot" if found[1] == "S" else "foot"


def mapping_of(value: Any) -> Mapping[str, Any]:
    """`value` where it is a mapping, else an empty one."""
    return value if isinstance(value, Mapping) else {}


def list_of(value: Any) -> list[Any]:
    """`value` where it is a list, else an empty one."""
    return value if isinstance(value, list) else []


def plain_value(value: Any) -> float | None:
    """`value` where it is a finite number, else None."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not np.isfinite(value):
        return None
    return float(value)


def value_of(quantities: Any, key: str) -> float | None:
    """The value of a quantity; None where there is none that is a number."""
    entry = mapping_of(quantities).get(key)
    return plain_value(entry.get("value") if isinstance(entry, Mapping) else entry)


def std_of(quantities: Any, key: str) -> float | None:
    """The standard deviation of a quantity; None where it is unknown."""
    return plain_value(mapping_of(mapping_of(quantities).get(key)).get("std"))


def fit_error(fit: Mapping[str, Any], key: str) -> float | None:
    """Standard error of a bed's own fit; None where unknown."""
    entry = fit.get(key)
    return plain_value(
        entry.get("std") if isinstance(entry, Mapping) else fit.get(f"{key}_error", fit.get(f"{key}_std"))
    )


def setting_of(run: RunFolder, key: str) -> str:
    """A setting of the run at the top of run.toml, as text; empty where there is none."""
    return next((s.value.strip('"') for s in run.settings if s.key == key and not s.table), "")


def percent(share: float) -> str:
    """A share in per cent."""
    return f"{plain(100.0 * share, 2)}{NBSP}%"


def signed_percent(share: float) -> str:
    """A share in per cent, with its sign."""
    return ("+" if share > 0 else "") + percent(share)


def more_or_less(share: float, above: str, below: str) -> str:
    """A share in per cent without its sign, and the word that its sign stands for."""
    return f"{percent(abs(share))} {above if share > 0 else below}"


def joined(words: list[str], last: str = "and") -> str:
    """ "a, b and c"; ``last``: the word before the last one."""
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} {last} {words[-1]}" if words else ""


def sentence(text: str) -> str:
    """`text` with a capital at its start and a full stop at its end."""
    text = with_squares(text.strip())
    return text[:1].upper() + text[1:] + ("" if text.endswith((".", "!", "?")) else ".") if text else ""


class Table(TypedDict, total=False):
    """The first column is text, the others are numbers unless `text`."""

    head: list[str]
    rows: list[list[str]]
    text: bool


_OF_THE_BED = ("grain_count", "packing_fraction", "coordination_number", "surface", "young", "time_step", "max_overlap")
_BARE_UNITS = {"1", "m", "m/s", "m/s2", "s", "kg", "N", "N/m", "N s/m", "Pa", "degrees"}


def rest_part(result: Mapping[str, Any]) -> dict[str, Any] | None:
    """Text and table for a foot that does not come to rest: its depth at rest with some cohesion; else None."""
    rest = mapping_of(result.get("rest"))
    rows = [mapping_of(row) for row in list_of(rest.get("cohesions"))]
    if rest.get("comes_to_rest") is not False or not rows:
        return None
    none = [
        quote(0.0, 0.0, "Pa"),
        quote(0.0, 0.0, "N"),
        quote(plain_value(rest.get("depth")), None, "m", significant=2),
    ]
    cells = [
        [
            quote(plain_value(row.get("cohesion")), 0.0, "Pa"),
            quote(plain_value(row.get("carries")), None, "N", significant=2),
            "at the surface"
            if row.get("depth") == 0
            else quote(plain_value(row.get("depth")), None, "m", significant=2),
        ]
        for row in rows
    ]
    head = ["cohesion", "carries by itself", "rests"]
    return {
        "sentences": [sentence(str(text)) for text in list_of(rest.get("sentences"))],
        "table": {"head": head, "rows": [none, *cells]},
        "source": sentence(str(rest.get("source") or "")),
    }


def departures_part(result: Mapping[str, Any]) -> dict[str, Any]:
    """Where bed and spring-damper depart: sentences and a table."""
    departures = mapping_of(result.get("departures"))
    entries, dash = departure_rows(result), "\N{EN DASH}"
    counted = any(row.beds is not None for row in entries)
    unit, forces = column([force for row in entries for force in (row.bed_force, row.bed_std, row.model_force)], "N")
    rows = [
        [
            f"{row.speed:g}",
            f"{short(1e3 * row.depth_from)} to {short(1e3 * row.depth_to)}",
            *([f"{row.beds:.0f}" if row.beds is not None else dash] if counted else []),
            bed,
            *([apart] if counted else []),
            model,
            dash if row.share is None else signed_percent(row.share),
        ]
        for row, bed, apart, model in zip(entries, forces[::3], forces[1::3], forces[2::3], strict=True)
    ]
    answered = {sentence(str(departures.get(name, ""))) for name in ("which_stiffness", "surface", "set_down")}
    sentences = [sentence(str(text)) for text in list_of(departures.get("sentences"))]
    head = ["speed [m/s]", "depth [mm]", f"bed [{unit}]", f"spring-damper [{unit}]", "gap"]
    if counted:
        head[2:3] = ["beds", f"bed, mean [{unit}]", f"std between beds [{unit}]"]
    return {
        "sentences": [text for text in sentences if text not in answered],
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
        sides = (
            quote(plain_value(moved.get(of)), plain_value(moved.get(f"{of}_std")), unit) for of in ("before", "now")
        )
        rows.append([label_of(key), *sides, "\N{EN DASH}" if change is None else signed_percent(change)])
    if not rows:
        return None
    head = ["", "there (± std)", "here (± std)", "change"]
    return {"file": str(reference.get("file") or ""), "table": {"head": head, "rows": rows}}


def bed_part(result: Mapping[str, Any], quantities: Mapping[str, Any]) -> dict[str, Any]:
    """What is known of the bed, and a table of the beds of several seeds."""
    bed = mapping_of(result.get("bed"))
    listed = [mapping_of(entry) for entry in list_of(bed.get("seeds")) if isinstance(entry, Mapping)]
    own = {key: value for key, value in bed.items() if not (key == "seeds" and listed) and key != "softening"}
    own |= {key: quantities[key] for key in _OF_THE_BED if key in quantities}
    seeds = None
    if len(listed) > 1:
        keys = [key for key in listed[0] if key != "seed"]
        rows = [[str(e.get("seed", "?")), *(cell_text(key, e.get(key)) for key in keys)] for e in listed]
        seeds = {"head": ["seed", *(label_of(key) for key in keys)], "rows": rows}
    softening = facts_table(mapping_of(bed.get("softening")))
    return {"facts": facts_table(own), "seeds": seeds, "softening": softening}


def runs_table(run: RunFolder) -> Table | None:
    """The runs, one a row."""
    units = {"max_depth": "m", "sinkage": "m", "peak_force": "N", "work_in": "J", "work_out": "J", "drag_gap": "%"}
    titles = {"max_depth": "depth", "sinkage": "at rest"}
    runs = [r for kind in ("driven", "drop", "set_down") for r in run.of_kind(kind)]
    runs += [r for r in run.runs if r not in runs]
    many = len({r.seed for r in runs}) > 1
    head, cells = ["run"], [[run_words(r, which_bed=many) for r in runs]]
    for key, unit in units.items():
        bed = [value_of(r.quantities, key) for r in runs]
        model = [value_of(r.quantities, f"model_{key}") for r in runs]
        shown, texts = column([*bed, *model], unit)  # one unit for both
        title = titles.get(key, key.replace("_", " "))
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
    return {"head": ["quantity", "value (± std)", "note"], "rows": rows, "text": True} if rows else None


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
