"""By how much the numbers of a run moved from those of another result: a finer bed, stiffer grains, another spike.

K, C and what follows from them are fitted anew on both sides, to the runs whose kind and speed both have. So runs at
other speeds do not look like a change of grain. Each condition weighs on both sides what it weighs in the reference.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from experiments.runs.folder import RunFolder, read_json
from experiments.runs.types import Json
from rigid.series import RESULT_FORMAT
from vis.page.numbers import foldable, quote

from .fit import Moments, fit_moments, gap_of_moments
from .settings import say

__all__ = ["compare_with", "read_reference"]

Condition = tuple[str, float]
Number = tuple[float | None, float | None]
"""A value and its standard deviation, None where unknown."""
_FITTED = ("stiffness", "damping", "sinkage_spring_damper", "drag_gap")
COMPARED = ("stiffness", "damping", "sinkage_dem", "sinkage_spring_damper", "drag_gap")


def read_reference(reference: str | Path) -> Json:
    """The result.json to compare with. Raises ValueError where it is not the result of a penetrate run."""
    try:
        other = read_json(Path(reference))
        if isinstance(other, dict) and (Path(reference).parent / "run.toml").is_file():
            other = RunFolder.open(Path(reference).parent).of_today(other)  # what its materials are called
    except (OSError, ValueError) as error:
        raise ValueError(f"reference = {str(reference)!r} is no result.json that can be read: {error}") from None
    kind = (other.get("format"), other.get("experiment")) if isinstance(other, dict) else (None, None)
    if kind != (RESULT_FORMAT, "penetrate"):
        raise ValueError(say("other_format", reference=str(reference), format=kind[0], experiment=kind[1]))
    if not isinstance(other.get("quantities"), dict) or not isinstance(other.get("runs"), list):
        raise ValueError(
            f"reference = {str(reference)!r} has no quantities or no runs: take a finished run's result.json"
        )
    return other


@dataclass(frozen=True)
class _Side:
    """What is known of the runs of one result."""

    conditions: Counter[Condition]  # how often each kind and speed was run, set-downs left out
    moments: dict[str, tuple[Condition, Moments]]  # by id, of the runs that can be fitted; none before version 0.1
    quantities: Mapping[str, Any]


def _side(result: Mapping[str, Any]) -> _Side:
    names = [field.name for field in fields(Moments)]
    conditions: Counter[Condition] = Counter()
    moments = {}
    for run in result["runs"]:
        if run.get("speed") is None or run.get("kind") == "set_down":
            continue
        condition = str(run.get("kind")), float(run["speed"])
        conditions[condition] += 1
        kept = run.get("moments")
        if isinstance(kept, Mapping) and all(isinstance(kept.get(name), int | float) for name in names):
            moments[str(run.get("id"))] = condition, Moments(*(float(kept[name]) for name in names))
    return _Side(conditions, moments, result["quantities"])


def _refitted(side: _Side, weights: Mapping[Condition, float]) -> dict[str, Number]:
    """K, C and what follows from them, of the runs whose condition has a weight; errors by jackknife over runs."""
    own = {name: part for name, (condition, part) in side.moments.items() if condition in weights}
    if not own:
        return {}
    weight = {name: weights[side.moments[name][0]] for name in own}
    law = fit_moments(own, weight)
    driven = {name: part for name, part in own.items() if side.moments[name][0][0] == "driven"}
    found: dict[str, Number] = {
        "stiffness": (law.stiffness, law.stiffness_error),
        "damping": (law.damping, law.damping_error),
        "drag_gap": (gap_of_moments(driven, law, weight), None),
    }
    load = _number(side.quantities, "load")[0]
    if load is not None and law.stiffness > 0:
        error = None if law.stiffness_error is None else load * law.stiffness_error / law.stiffness**2
        found["sinkage_spring_damper"] = load / law.stiffness, error
    return found


def _number(quantities: Mapping[str, Any], name: str) -> Number:
    entry = quantities.get(name)
    return (entry.get("value"), entry.get("std")) if isinstance(entry, Mapping) else (None, None)


def compare_with(other: Mapping[str, Any], result: Mapping[str, Any]) -> tuple[Json, list[str]]:
    """How far the numbers of `result` moved from those of `other`: the entry "reference", and sentences.

    A number of the entry's "moved" has "before", "now", their standard deviations, "change" [1] and "unit". The
    deviations are by jackknife over the common runs for K, C and the law's sinkage, between seeds for sinkage_dem; null
    where unknown. K and C are left out where they would compare different runs: of a reference without moments that has
    runs not made here.
    """
    there, here = _side(other), _side(result)
    common = sorted(there.conditions.keys() & here.conditions.keys())
    missing = sorted(there.conditions.keys() - here.conditions.keys())
    before, now = ({"sinkage_dem": _number(side.quantities, "sinkage_dem")} for side in (there, here))
    now |= _refitted(here, {c: there.conditions[c] / here.conditions[c] for c in common})
    if there.moments:
        before |= _refitted(there, dict.fromkeys(common, 1.0))
    elif not missing:
        before |= {name: _number(there.quantities, name) for name in _FITTED}
    moved: Json = {}
    said = []
    for name in COMPARED:
        (old, old_std), (new, new_std) = before.get(name, (None, None)), now.get(name, (None, None))
        if old is None or new is None:
            continue
        unit = result["quantities"][name]["unit"]
        change = new / old - 1 if old else None
        moved[name] = {
            "before": old, "before_std": old_std, "now": new, "now_std": new_std, "change": change, "unit": unit,
        }  # fmt: skip
        percent = f" ({100 * change:+.3g} %)" if change is not None else ""
        was, now_is = (foldable(quote(*pair, unit, significant=3)) for pair in ((old, old_std), (new, new_std)))
        said.append(f"{name} moves from {was} to {now_is}{percent}.")
    if moved and common:
        said.append(f"K and C are fitted, on both sides, to what both have: {_listed(common)}.")
    if common and "stiffness" not in moved:
        said.append(say("no_moments"))
    differs = _differences(other, result)
    if moved and differs:
        said.append(f"what differs: {', '.join(differs)}.")
    if moved and missing:
        said.append(f"it has runs that are not made here: {_listed(missing)}.")
    runs = sorted(name for name, (condition, _) in here.moments.items() if condition in common)
    return {"moved": moved, "differs": differs, "runs": runs}, said


def _listed(conditions: Sequence[Condition]) -> str:
    return ", ".join(f"{kind} at {speed:g} m/s" for kind, speed in conditions)


def _differences(other: Mapping[str, Any], result: Mapping[str, Any]) -> list[str]:
    """What was set otherwise there than here, as ``grain 0.0024 m there, 0.0012 m here``."""
    found = []
    for part, name, unit in (
        ("bed", "material", ""), ("bed", "size", "m"), ("bed", "grain", "m"), ("bed", "spread", ""),
        ("bed", "gravity", "m/s2"), ("bed", "max_overlap", "of a diameter"), ("spike", "tip", ""),
        ("spike", "diameter", "m"), ("spike", "shaft_diameter", "m"), ("spike", "cone_angle", "degrees"),
        ("spike", "mass", "kg"), ("spike", "friction", ""), ("spike", "restitution", ""), ("spike", "load", "N"),
    ):  # fmt: skip
        parts = (source.get(part) for source in (other, result))
        before, now = (values.get(name) if isinstance(values, Mapping) else None for values in parts)
        if before is None or now is None or before == now:
            continue
        shown = [f"{value:.4g}" if isinstance(value, float) else str(value) for value in (before, now)]
        found.append(f"{name} {shown[0]} there, {shown[1]} here{f' [{unit}]' if unit else ''}")
    return found
