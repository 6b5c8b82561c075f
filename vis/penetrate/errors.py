"""Errors of a run's numbers as halves of 95 % intervals, in place of the standard deviations of result.json.

A number over n beds has t s / sqrt(n), that of a fit t times its standard error by the jackknife over runs. t is
Student's with n - 1 degrees of freedom, n the number of beds or of runs (`rigid.intervals`). Without a bed it is 1.96
standard errors of the model. With the scatter of few beds in it, it is Student's, with the freedom of both together.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rigid.intervals import half_of, half_width, student
from vis.page.numbers import between, quantity, quote
from vis.penetrate.summary_parts import fit_error, joined, list_of, mapping_of, say, std_of, value_of

__all__ = ["contains_beds", "error_words", "fit_part", "fitted", "half_of_fit", "in_95"]

_UNITS = {"stiffness": "N/m", "damping": "N s/m"}


def in_95(result: Mapping[str, Any]) -> dict[str, Any]:
    """The quantities of a result of penetrate, the std of each replaced by half of its 95 % interval over beds.

    0, of exact numbers, stays; None for a number that fewer than two beds have. The standard errors of the fit, which
    are values of their own, become halves of 95 % intervals too, None for fewer than two runs. Without a bed the std of
    a result is the standard error of a model's number, of a normal distribution.
    """
    quantities, fits = mapping_of(result.get("quantities")), _mappings(result, "fits")
    runs = _mappings(result, "runs")
    beds = len({run.get("seed") for run in runs} - {None})
    depths = [value_of(run.get("quantities"), "sinkage") for run in runs if run.get("kind") == "set_down"]
    counts = dict.fromkeys((*_UNITS, "work_returned_spring_damper"), len(fits) or beds) | {
        "sinkage_dem": sum(depth is not None for depth in depths),
        "stiffness_standing": sum((depth or 0.0) > 0 for depth in depths),
        "sinkage_spring_damper": sum((value_of(fit, "stiffness") or 0.0) > 0 for fit in fits) or beds,
    }
    found = {name: dict(entry) if isinstance(entry, Mapping) else entry for name, entry in quantities.items()}
    for name in found:
        if std := std_of(quantities, name):
            found[name]["std"] = half_width(std, counts.get(name, beds)) if beds else half_of(found[name])
    for key in _UNITS:
        if (error := value_of(quantities, f"{key}_error")) is not None:
            found[f"{key}_error"]["value"] = _of_runs(error, _run_count(result, fits[0] if len(fits) == 1 else {}))
    return found


def error_words(result: Mapping[str, Any]) -> str:
    """What ± is in a result on the law of a model: half of a 95 % interval, with or without the scatter of beds."""
    peaks = [entry for name, entry in mapping_of(result.get("quantities")).items() if name.startswith("peak_force_am")]
    if not any(map(contains_beds, peaks)):
        return say("half_of_95")
    freedoms = [entry["freedom"] for entry in peaks if entry.get("freedom") is not None]
    return say("half_of_95_with_beds", by=say("by_student", freedom=min(freedoms)) if freedoms else "")


def contains_beds(entry: Any) -> bool:
    """Whether the error of a peak force contains by what beds differ, by its note."""
    return "scatter of the beds" in str(mapping_of(entry).get("note", ""))


def fitted(result: Mapping[str, Any], numbers: Mapping[str, Any], key: str) -> str:
    """K or C of `in_95` with its error over beds, or for one bed with that of the fit. K has its ends by chance, as in
    the answer, where the result has them."""
    entry = mapping_of(numbers.get(key))
    if key == "stiffness" and (chance := _chance_of_k(result)):
        low, high = chance
        return f"{quote(value_of(numbers, key), None, _UNITS[key], significant=2)} ({between(low, high, _UNITS[key])})"
    error = value_of(numbers, f"{key}_error")
    if entry.get("std") is None and error is not None:
        entry = {**entry, "std": error}
    return quantity(entry) if entry else "unknown"


def _chance_of_k(result: Mapping[str, Any]) -> list[float]:
    """Ends of the interval of K by chance [N/m]; none where it is not known."""
    return list_of(mapping_of(mapping_of(result.get("sure")).get("stiffness")).get("chance"))


def fit_part(result: Mapping[str, Any], numbers: Mapping[str, Any]) -> dict[str, Any] | None:
    """What was fitted: a table of the pooled and the beds' own fits, and a note. ``numbers``: of `in_95`."""
    own = _mappings(result, "fits")
    if value_of(numbers, "stiffness") is None and not own:
        return None
    one = len(own) < 2
    gap = quantity(numbers.get("drag_gap"), unit="%")
    rows = [["this bed" if one else "all beds together", *(fitted(result, numbers, key) for key in _UNITS), gap]]
    halves = [{key: half_of_fit(result, fit, key) for key in _UNITS} for fit in own]
    for i, fit in enumerate([] if one else own):
        gap = quote(value_of(fit, "drag_gap"), None, "%") if "drag_gap" in fit else "\N{EN DASH}"
        cells = (quote(value_of(fit, key), halves[i][key], unit) for key, unit in _UNITS.items())
        cells = cells if fit.get("separates", True) else ("not separated" for _ in _UNITS)
        rows.append([f"bed {fit.get('seed', i + 1)} by itself", *cells, gap])
    errors = [
        f"{name} {quantity(numbers[key])}"
        for name, key in (("K", "stiffness_error"), ("C", "damping_error"))
        if value_of(numbers, key) is not None
    ]
    of_beds = std_of(numbers, "stiffness") is not None  # then one error of K is enough
    if one:
        notes = [say("fit_one_bed")] if value_of(numbers, "stiffness_error") is not None else []
        notes += [say("fit_kept")] if _chance_of_k(result) else []
    else:
        known = any(half is not None for both in halves for half in both.values())
        notes = [say("fit_errors", errors=joined(errors))] if errors and not of_beds else []
        notes += [say("fit_spread")] if known else []
    head = ["fitted to", "K (95 %)", "C (95 %)", "drag gap (95 %)"]
    return {"table": {"head": head, "rows": rows}, "note": " ".join(notes)}


def half_of_fit(result: Mapping[str, Any], fit: Mapping[str, Any], key: str) -> float | None:
    """Half of the 95 % interval of K or C of a bed's own fit; None where its error or its runs are unknown."""
    error = fit_error(fit, key)
    return None if error is None else _of_runs(error, _run_count(result, fit))


def _run_count(result: Mapping[str, Any], fit: Mapping[str, Any]) -> int:
    """The runs of a fit, by its own list, else all pushes and drops of its bed; without a bed those of all."""
    runs = [run for run in _mappings(result, "runs") if run.get("kind") in ("driven", "drop")]
    return len(list_of(fit.get("runs"))) or sum(run.get("seed") == fit.get("seed", run.get("seed")) for run in runs)


def _of_runs(error: float, count: int) -> float | None:
    """Half of the 95 % interval of a fit with this standard error by the jackknife over `count` runs."""
    return student(count - 1) * error if count > 1 else None


def _mappings(result: Mapping[str, Any], name: str) -> list[Mapping[str, Any]]:
    return [mapping_of(entry) for entry in list_of(result.get(name))]
