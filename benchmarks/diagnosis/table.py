"""The figures of `hedgebed bench diagnose`, counted from cases whose answers are known, and their table."""

import json
import math
import sys
from collections import defaultdict
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from .records import read_cases

__all__ = ["show", "summarise"]

Case = dict[str, Any]
_BINS = ((0.0, 1.0), (1.0, 3.0), (3.0, 10.0), (10.0, math.inf))
_PLAIN = 10.0
_GAP = 1.5
"""Chi-square per sample above which there is a gap that can be closed."""
_NINETY_FIVE = 1.96


def summarise(cases: Sequence[Case]) -> dict[str, Any]:
    """The figures of the aims from single cases; a share is {"share", "of"}, its share None where there was no case."""
    nulls = [c for c in cases if not c["truth"] and not c["outside"]]
    single = [c for c in cases if len(c["truth"]) == 1 and not c["outside"]]
    pairs = [c for c in cases if len(c["truth"]) == 2]
    outside = [c for c in cases if c["outside"]]
    seen = [c for c in single if c["signature"] >= 1]
    plain = [c for c in single if c["signature"] >= _PLAIN]
    named = [c for c in single if c["verdict"] in ("named", "ambiguous")]
    ambiguous = [c for c in single if c["verdict"] == "ambiguous"]
    right = [c for c in named if _right(c)]
    return {
        "cases": len(cases),
        "failed": sum(c["verdict"] == "failed" for c in cases),
        "false_alarms": _share(nulls, lambda c: c["verdict"] != "none"),
        "named_right_plain": _share(plain, _right),
        "named_right_when_visible": _share(seen, _right),
        "missed_when_visible": _share(seen, lambda c: c["verdict"] == "none"),
        "called_unknown_when_plain": _share(plain, lambda c: c["verdict"] == "unknown"),
        "top1_by_effect": _by_effect(single),
        "sets_hold_truth": _share(named, _holds),
        "ambiguous_sets_hold_truth": _share(ambiguous, _holds),
        "set_size": float(np.mean([1 + len(c["alternatives"]) for c in named])) if named else None,
        "pairs_both_named": _share(pairs, lambda c: set(c["truth"]) == set(c["effects"])),
        "pairs_one_named": _share(pairs, lambda c: bool(set(c["truth"]) & set(c["effects"]))),
        "pairs_something_false": _share(pairs, lambda c: bool(set(c["effects"]) - set(c["truth"]))),
        "unknown_recall": _share(outside, lambda c: c["verdict"] == "unknown"),
        "unknown_recall_when_visible": _share(
            [c for c in outside if c["signature"] >= 1], lambda c: c["verdict"] == "unknown"
        ),
        "parameters": _parameters(right),
        "held_out_at_most_1_2": _share(right, lambda c: _after(c) <= 1.2),
        "held_out_at_most_1_2_times_what_the_truth_leaves": _share(
            [c for c in right if _by_truth(c) is not None], lambda c: _after(c) <= 1.2 * max(_by_truth(c) or 1.0, 1.0)
        ),
        "median_held_out_after": _median([_after(c) for c in right]),
        "median_gap_closed": _median([_closed(c["before"], c["after"]) for c in right if _gap(c["before"]) > _GAP]),
        "baselines": _baselines(cases),
        "seconds": _seconds(cases),
    }


def _right(case: Case) -> bool:
    """Whether the first name is the truth, and nothing else is called certain."""
    return case["verdict"] in ("named", "ambiguous") and case["effects"] == case["truth"]


def _holds(case: Case) -> bool:
    return case["truth"][0] in {*case["effects"], *case["alternatives"]}


def _by_truth(case: Case) -> float | None:
    """What the truth itself leaves a sample of the held-out trials, with the stated noise, where its maker tells."""
    left = (case.get("hidden") or {}).get("left")
    if not left or not case["held_out"]:
        return None
    rows = [left[int(trial.lstrip("pd")) - 1] for trial in case["held_out"]]
    return float(sum(total for total, _ in rows) / max(1, sum(count for _, count in rows)))


def _gap(told: dict[str, Any] | None) -> float:
    """Of the held-out trials, or of the fitted ones where none are held out; nan where there is none."""
    if told is None:
        return math.nan
    found = told["held_out"] if told["held_out"] is not None else told["fit"]
    return math.nan if found is None else float(found)


def _after(case: Case) -> float:
    return _gap(case.get("after"))


def _closed(before: dict[str, Any] | None, after: dict[str, Any] | None) -> float:
    """Share of chi-square beyond the noise that is gone: 1 all, 0 nothing, below 0 worse than before."""
    return 1 - (_gap(after) - 1) / (_gap(before) - 1)


def _by_effect(single: Sequence[Case]) -> dict[str, dict[str, Any]]:
    found: dict[str, dict[str, list[Case]]] = defaultdict(lambda: defaultdict(list))
    for case in single:
        low, high = next(edges for edges in _BINS if edges[0] <= case["signature"] < edges[1])
        found[case["truth"][0]][f"{low:g}-{high:g}"].append(case)
    return {effect: {label: _share(own, _right) for label, own in bins.items()} for effect, bins in found.items()}


def _parameters(right: Sequence[Case]) -> dict[str, Any]:
    """How far the parameters with fixed names are off, and how often their 95 % intervals hold the truth."""
    rows: dict[str, list[tuple[float, float]]] = defaultdict(list)
    for case in right:
        for name, true in case.get("true_parameters", {}).items():
            effect, _, short = name.partition(".")
            said = case["found_parameters"].get(effect, {}).get(short)
            if said is not None:
                away = abs(said["value"] - true)
                size = abs(true - 1) if name == "camera-scale.scale" else abs(true)
                rows[name].append((away / max(size, 1e-12), away / max(said["std"], 1e-300)))
    pooled = [row for own in rows.values() for row in own]
    told: dict[str, Any] = {
        "intervals_hold_truth": _share(pooled, lambda row: row[1] <= _NINETY_FIVE),
        "median_relative_error": _median([row[0] for row in pooled]),
        "by_name": {name: {"median_relative_error": _median([row[0] for row in own]),
                           "intervals_hold_truth": _share(own, lambda row: row[1] <= _NINETY_FIVE)}
                    for name, own in sorted(rows.items())},
    }  # fmt: skip
    return told


def _baselines(cases: Sequence[Case]) -> dict[str, Any]:
    """The same figures for those that ran beside, and ours on the very same cases."""
    tried = [c for c in cases if "baselines" in c]
    names = sorted({name for c in tried for name in c["baselines"] if name != "code"})
    told: dict[str, Any] = {}
    for name in ("ours", *names) if tried else ():
        own = [c for c in tried if name == "ours" or name in c["baselines"]]
        nulls = [c for c in own if not c["truth"] and not c["outside"]]
        seen = [c for c in own if (c["truth"] or c["outside"]) and c["signature"] >= 1]
        single = [c for c in seen if len(c["truth"]) == 1]

        def alarm(case: Case, name: str = name) -> bool:
            return case["verdict"] != "none" if name == "ours" else case["baselines"][name]["alarm"]

        def closed(case: Case, name: str = name) -> float:
            said = case if name == "ours" else case["baselines"][name]
            return _closed(said["before"], said["after"])

        wide = [c for c in seen if _gap(c["before"]) > _GAP]
        points = [c for c in single if name != "ours" and "points_to" in c["baselines"][name]]
        told[name] = {
            "cases": len(own),
            "false_alarms": _share(nulls, alarm),
            "alarm_when_visible": _share(seen, alarm),
            "names_right": _share(single, _right) if name == "ours" else _share(
                points, lambda c, name=name: c["truth"][0] in c["baselines"][name]["points_to"]),
            "median_gap_closed": _median([closed(c) for c in wide]),
            "gap_closed_by_half": _share(wide, lambda c, closed=closed: closed(c) >= 0.5),
            "held_out_at_most_1_2": _share(wide, lambda c, name=name: _gap(
                c["after"] if name == "ours" else c["baselines"][name]["after"]) <= 1.2),
            "median_seconds": _median(
                [c["seconds"] if name == "ours" else c["baselines"][name]["seconds"] for c in own]),
        }  # fmt: skip
    return told


def _seconds(cases: Sequence[Case]) -> dict[str, float | None]:
    usual = [c for c in cases if c["trials"] == 8]
    return {
        f"{what}_{which}{end}": (_median if which == "median" else _most)([float(c[key]) for c in own])
        for own, end in ((cases, ""), (usual, "_of_8_trials"))
        for what, key in (("wall", "seconds"), ("cpu", "cpu"))
        for which in ("median", "most")
    }


def _most(values: Sequence[float]) -> float | None:
    return max(values, default=None)


def _median(values: Sequence[float]) -> float | None:
    """Of those that are numbers; what did not come to an end counts as the worst there is."""
    if not values:
        return None
    found = float(np.median([-math.inf if math.isnan(value) else value for value in values]))
    return found if math.isfinite(found) else None


def _share(of: Sequence[Any], flag: Callable[[Any], bool]) -> dict[str, Any]:
    return {"share": float(np.mean([bool(flag(one)) for one in of])) if of else None, "of": len(of)}


# Shown ----------------------------------------------------------------------------------------------------------------


def show(kind: str, summary: dict[str, Any]) -> None:
    """Print the table of one kind of trial."""
    table = Table(title=f"diagnose, {kind}: {summary['cases']} campaigns", title_justify="left", box=None)
    table.add_column("figure")
    table.add_column("value", justify="right")
    table.add_column("of", justify="right")
    for name, value in _rows(summary):
        _row(table, name, value)
    console = Console()
    console.print(table, markup=False)
    if summary["baselines"]:
        console.print(_beside(summary["baselines"]), markup=False)


def _rows(summary: dict[str, Any]) -> list[tuple[str, Any]]:
    rows = [(name, value) for name, value in summary.items()
            if name not in ("cases", "top1_by_effect", "parameters", "baselines", "seconds")]  # fmt: skip
    told = summary["parameters"]
    rows += [(f"parameters, {name}", told[name]) for name in ("median_relative_error", "intervals_hold_truth")]
    for name, own in told["by_name"].items():
        rows += [(f"{name}, error", own["median_relative_error"])]
    for effect, bins in sorted(summary["top1_by_effect"].items()):
        rows += [(f"{effect}, signature {label}", share) for label, share in sorted(bins.items())]
    return rows + [(f"seconds, {name}", value) for name, value in summary["seconds"].items()]


def _row(table: Table, name: str, value: Any) -> None:
    shown, of = _shown(value)
    table.add_row(name.replace("_", " "), shown, of)


def _shown(value: Any) -> tuple[str, str]:
    if isinstance(value, dict):
        return ("-" if value["share"] is None else f"{100 * value['share']:.0f} %"), str(value["of"])
    return ("-" if value is None else f"{value:.3g}"), ""


def _beside(told: dict[str, Any]) -> Table:
    table = Table(title="beside the baselines, on the same campaigns", title_justify="left", box=None)
    table.add_column("figure")
    for name in told:
        table.add_column(name, justify="right")
    for figure in next(iter(told.values())):
        cells = []
        for own in told.values():
            shown, of = _shown(own[figure])
            cells.append(f"{shown} of {of}" if of else shown)
        table.add_row(figure.replace("_", " "), *cells)
    return table


def main(folders: Sequence[str]) -> None:
    """``python -m benchmarks.diagnosis.table DIR ...``: the table of all that these folders' cases.jsonl hold."""
    cases = {json.dumps([c["kind"], c["case"]], sort_keys=True): c for one in folders for c in read_cases(Path(one))}
    for kind in sorted({case["kind"] for case in cases.values()}):
        show(kind, summarise([case for case in cases.values() if case["kind"] == kind]))


if __name__ == "__main__":
    main(sys.argv[1:])
