"""Words and numbers of the report: names of quantities, units, percentages, and how a value is quoted."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import MISSING, dataclass, fields
from typing import Any

import numpy as np

from vis.page.folder import Run, RunFolder
from vis.page.numbers import plain, quantity, quote, short

__all__ = [
    "NBSP",
    "SHARES",
    "Departure",
    "cell_text",
    "departure_rows",
    "fitted",
    "joined",
    "label_of",
    "list_of",
    "mapping_of",
    "more_or_less",
    "percent",
    "plain_value",
    "run_words",
    "sentence",
    "setting_of",
    "signed_percent",
    "value_of",
]

NBSP = "\N{NO-BREAK SPACE}"
_NAMES = {
    "stiffness": "stiffness K",
    "damping": "damping C",
    "stiffness_error": "stiffness K, standard error of the fit",
    "damping_error": "damping C, standard error of the fit",
    "sinkage_dem": "sinkage at rest, bed",
    "sinkage_spring_damper": "sinkage at rest, spring-damper",
    "drag_gap": "drag gap, spring-damper against bed",
    "work_returned_dem": "work given back, bed",
    "work_returned_amended": "work given back, model's law",
    "sinkage_amended": "sinkage, model's law",
    "force_gap_spring_damper": "off over whole driven runs, spring-damper",
    "force_gap_amended": "off over whole driven runs, model's law",
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
SHARES = {
    "drag_gap", "model_drag_gap", "work_returned_dem", "work_returned_spring_damper", "work_returned_amended",
    "force_gap_spring_damper", "force_gap_amended", "max_overlap", "overlap",
    "overlap_quasi_static", "overlap_impact", "spread",
}  # fmt: skip


def fitted(quantities: Mapping[str, Any], key: str) -> str:
    """K or C with its spread between beds, or for one bed with the standard error of the fit."""
    entry = mapping_of(quantities.get(key))
    error = value_of(quantities, f"{key}_error")
    if entry.get("std") is None and error is not None:
        entry = {**entry, "std": error}
    return quantity(entry) if entry else "unknown"


@dataclass(frozen=True)
class Departure:
    """One row of the table of departures: mean forces of bed and law in a band of depth at one speed."""

    speed: float
    """[m/s]."""
    depth_from: float
    """[m]."""
    depth_to: float
    """[m]."""
    bed_force: float
    """[N], mean over the beds."""
    model_force: float
    """[N]."""
    beds: float | None = None
    """How many; None where it was not told."""
    bed_std: float | None = None
    """Standard deviation of the bed's force between beds [N]; None where unknown."""

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
        """How well: ``one bed``, ``3 beds``; empty where it was not told."""
        return "" if self.beds is None else "one bed" if self.beds == 1 else f"{self.beds:.0f} beds"


def departure_rows(result: Mapping[str, Any]) -> list[Departure]:
    """The rows of the table of departures; one that lacks a number is left out."""
    rows = []
    for entry in list_of(mapping_of(result.get("departures")).get("table")):
        told = {field.name: plain_value(mapping_of(entry).get(field.name)) for field in fields(Departure)}
        if all(told[field.name] is not None for field in fields(Departure) if field.default is MISSING):
            rows.append(Departure(**told))  # type: ignore[arg-type]
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


def label_of(key: str) -> str:
    """The name of a key, as a person reads it."""
    return _NAMES.get(key, key.replace("_", " "))


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


def value_of(quantities: Mapping[str, Any], key: str) -> float | None:
    """The value of a quantity; None where there is none that is a number."""
    entry = quantities.get(key)
    return plain_value(entry.get("value") if isinstance(entry, Mapping) else entry)


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


def joined(words: list[str]) -> str:
    """ "a, b and c"."""
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}" if words else ""


def sentence(text: str) -> str:
    """`text` with a capital at its start and a full stop at its end."""
    text = text.strip()
    return text[:1].upper() + text[1:] + ("" if text.endswith((".", "!", "?")) else ".") if text else ""
