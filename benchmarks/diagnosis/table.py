"""The figures of `hedgebed bench diagnose`, counted from cases whose answers are known, and their table."""

import json
import math
import sys
from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console

from benchmarks.race.machine import column_table
from experiments.runs.types import Json

__all__ = ["CASES_FILE", "read_cases", "show", "summarise"]

CASES_FILE = "cases.jsonl"
Case = Json
_LABELS = {
    "held_out_at_most_1_2": "right names: held-out gap at most 1.2, sensor noise alone",
    "held_out_with_scatter_at_most_1_2": "right names: held-out gap at most 1.2, with the scatter of fitted replicates",
    "pairs_both_named_both_plain": "pairs both named, the weaker one's signature at least 10",
    "pairs_both_named_weaker_visible": "pairs both named, the weaker one's signature 1 to 10",
    "replicates_that_differ": "right names: campaigns whose fitted replicates differ beyond the sensors",
    "intervals_hold_truth": "95 % intervals that hold the truth",
    "intervals_90_hold_truth": "90 % intervals that hold the truth",
}
"""What the table calls figures whose keys do not say enough."""
_BASE = {
    "base_parameters": "base parameters of the ground", "apparent_parameters": "base parameters, apparent",
    "limit_parameters": "parameters of readings without noise, same weights",
}  # fmt: skip
_BINS = ((0.0, 1.0), (1.0, 3.0), (3.0, 10.0), (10.0, math.inf))
_PLAIN = 10.0
_GAP = 1.5  # chi-square per sample above which there is a gap that can be closed
_NINETY, _NINETY_FIVE = 1.645, 1.96  # standard deviations of a normal law that hold so many percent


def read_cases(out: Path) -> list[Case]:
    """The records in a folder's cases.jsonl, the latest last; none where there is no such file.

    Raises ValueError, naming file and line, for a line that is no record; a last line that was cut short is left out.
    """
    path = out / CASES_FILE
    lines = path.read_text(encoding="utf-8").split("\n") if path.is_file() else []
    found = []
    for number, line in enumerate(lines, 1):
        try:
            found += [json.loads(line)] if line.strip() else []
        except ValueError as error:
            if number < len(lines):  # the last has no end of line: the process ended while it wrote
                raise ValueError(f"{path}, line {number}: {error}; a record of a case was expected") from None
    return found


def summarise(cases: Sequence[Case]) -> Json:
    """The figures of the aims from single cases; a share is {"share", "of"}, its share None where there was no case."""
    nulls = [c for c in cases if not c["truth"] and not c["outside"]]
    single = [c for c in cases if len(c["truth"]) == 1 and not c["outside"]]
    pairs = [c for c in cases if len(c["truth"]) == 2]
    outside = [c for c in cases if c["outside"]]
    seen = [c for c in single if c["signature"] >= 1]
    plain = [c for c in single if c["signature"] >= _PLAIN]
    named = [c for c in single if c["verdict"] in ("named", "ambiguous")]
    right = [c for c in named if _right(c)]
    explained = [*right, *(c for c in pairs if c["verdict"] != "unknown" and _both(c))]
    judged = [*explained, *(c for c in nulls if c["verdict"] == "none")]
    tried = [c for c in cases if "baselines" in c]
    names = sorted({name for c in tried for name in c["baselines"]} - {"code"})
    of_truth = [(_after(c), left) for c in right if (left := _by_truth(c)) is not None]

    def unknown(case: Case) -> bool:
        return case["verdict"] == "unknown"

    def holds(case: Case) -> bool:
        return case["truth"][0] in {*case["effects"], *case["alternatives"]}

    return {
        "cases": len(cases),
        "failed": sum(c["verdict"] == "failed" for c in cases),
        "false_alarms": _share(nulls, lambda c: c["verdict"] != "none"),
        "named_right_plain": _share(plain, _right),
        "named_right_when_visible": _share(seen, _right),
        "missed_when_visible": _share(seen, lambda c: c["verdict"] == "none"),
        "called_unknown_when_plain": _share(plain, unknown),
        "top1_by_effect": _by_effect(single),
        "sets_hold_truth": _share(named, holds),
        "ambiguous_sets_hold_truth": _share([c for c in named if c["verdict"] == "ambiguous"], holds),
        "set_size": float(np.mean([1 + len(c["alternatives"]) for c in named])) if named else None,
        "pairs_both_named": _share(pairs, _both),
        "pairs_both_named_both_plain": _share([c for c in pairs if c["signature"] >= _PLAIN], _both),
        "pairs_both_named_weaker_visible": _share([c for c in pairs if 1 <= c["signature"] < _PLAIN], _both),
        "pairs_one_named": _share(pairs, lambda c: bool(set(c["truth"]) & set(c["effects"]))),
        "pairs_something_false": _share(pairs, lambda c: bool(set(c["effects"]) - set(c["truth"]))),
        "unknown_recall": _share(outside, unknown),
        "unknown_recall_when_visible": _share([c for c in outside if c["signature"] >= 1], unknown),
        "parameters": _parameters(explained),
        "base_parameters": _base_parameters(judged, "base"),
        "apparent_parameters": _base_parameters(judged, "apparent"),
        "limit_parameters": _limit_parameters(judged),
        "held_out_at_most_1_2": _share(explained, lambda c: _after(c) <= 1.2),
        "held_out_with_scatter_at_most_1_2": _share(explained, lambda c: _with_scatter(c) <= 1.2),
        "replicates_that_differ": _share(explained, lambda c: bool(c.get("with_scatter"))),
        "held_out_at_most_1_2_times_what_the_truth_leaves": _share(
            of_truth, lambda pair: pair[0] <= 1.2 * max(pair[1] or 1.0, 1.0)
        ),
        "median_held_out_after": _median([_after(c) for c in right]),
        "median_gap_closed": _median([_closed(c["before"], c["after"]) for c in right if _gap(c["before"]) > _GAP]),
        "baselines": {name: _baseline(name, tried) for name in ("ours", *names)} if tried else {},
        "seconds": _seconds(cases),
    }


def _right(case: Case) -> bool:
    """Whether the first name is the truth, and nothing else is called certain."""
    return case["verdict"] in ("named", "ambiguous") and case["effects"] == case["truth"]


def _both(case: Case) -> bool:
    """Whether the names are the two that are hidden, and no others. A pair's signature is that of the weaker one."""
    return set(case["truth"]) == set(case["effects"])


def _by_truth(case: Case) -> float | None:
    """What the truth itself leaves a sample of the held-out trials, with the stated noise, where its maker tells."""
    left = (case.get("hidden") or {}).get("left")
    if not left or not case["held_out"]:
        return None
    rows = [left[int(trial.lstrip("pd")) - 1] for trial in case["held_out"]]
    return float(sum(total for total, _ in rows) / max(1, sum(count for _, count in rows)))


def _gap(told: Json | None) -> float:
    """Of the held-out trials, or of the fitted ones where none are held out; nan where there is none."""
    if told is None:
        return math.nan
    found = told["held_out"] if told["held_out"] is not None else told["fit"]
    return math.nan if found is None else float(found)


def _after(case: Case) -> float:
    return _gap(case.get("after"))


def _with_scatter(case: Case) -> float:
    """The held-out gap with the scatter that replicates among the fitted trials show; the plain one where they show
    none, and in records of before it was kept."""
    weighed = case.get("with_scatter")
    return _gap(weighed["after"] if weighed else case.get("after"))


def _closed(before: Json | None, after: Json | None) -> float:
    """Share of chi-square beyond the noise that is gone: 1 all, 0 nothing, below 0 worse than before."""
    return 1 - (_gap(after) - 1) / (_gap(before) - 1)


def _by_effect(single: Sequence[Case]) -> dict[str, Json]:
    found: dict[str, dict[str, list[Case]]] = defaultdict(lambda: defaultdict(list))
    for case in single:
        low, high = next(edges for edges in _BINS if edges[0] <= case["signature"] < edges[1])
        found[case["truth"][0]][f"{low:g}-{high:g}"].append(case)
    return {effect: {label: _share(own, _right) for label, own in bins.items()} for effect, bins in found.items()}


def _parameters(right: Sequence[Case]) -> Json:
    """How far the parameters with fixed names are off, and how often their 90 % and 95 % intervals hold the truth."""
    rows: dict[str, list[tuple[float, float]]] = defaultdict(list)
    for case in right:
        for name, true in case.get("true_parameters", {}).items():
            effect, _, short = name.partition(".")
            said = case["found_parameters"].get(effect, {}).get(short)
            if said is not None and said["std"] is not None:
                away = abs(said["value"] - true)
                size = abs(true - 1) if name == "camera-scale.scale" else abs(true)
                rows[name].append((away / max(size, 1e-12), away / max(said["std"], 1e-300)))

    def told(own: Sequence[tuple[float, float]]) -> Json:
        error = _median([row[0] for row in own])
        return {
            "median_relative_error": error,
            "intervals_hold_truth": _share(own, lambda row: row[1] <= _NINETY_FIVE),
            "intervals_90_hold_truth": _share(own, lambda row: row[1] <= _NINETY),
        }

    pooled = told([row for own in rows.values() for row in own])
    return dict(reversed(pooled.items())) | {"by_name": {name: told(own) for name, own in sorted(rows.items())}}


def _base_parameters(cases: Sequence[Case], truth: str) -> Json:
    """How often 90 % intervals of the base model's numbers hold the truth, where the maker of a campaign states it:
    all together, and by number. `cases`: whose verdicts are right. `truth`: "base", the numbers of the ground alone, or
    "apparent", those that the true readings give a model without the maker's structure error."""
    return _intervals((case, (case.get("hidden") or {}).get(truth) or {}) for case in cases)


def _limit_parameters(cases: Sequence[Case]) -> Json:
    """The same of the found model's numbers, those of its effects too, and of readings without noise, to which it was
    fitted with the same rows and weights."""
    limits = [(case, case.get("limit") or {}) for case in cases]
    failed = sum("error" in limit for _, limit in limits)
    return _intervals((case, limit) for case, limit in limits if "error" not in limit) | {"failed": failed}


def _intervals(truths: Iterable[tuple[Case, dict[str, float]]]) -> Json:
    """How often the 90 % intervals of a case's numbers hold these, "name" or "effect.name"."""
    rows: dict[str, list[float]] = defaultdict(list)
    for case, true in truths:
        for name, value in true.items():
            effect, _, short = name.rpartition(".")
            found = case.get("found_parameters", {}).get(effect, {}) if effect else case.get("base_parameters", {})
            told = found.get(short)
            if told is not None and told["std"] is not None:
                rows[name].append(abs(told["value"] - value) / max(told["std"], 1e-300))

    def held(own: Sequence[float]) -> Json:
        return _share(own, lambda away: away <= _NINETY)

    return {"intervals_90_hold_truth": held([away for own in rows.values() for away in own]),
            "by_name": {name: held(own) for name, own in sorted(rows.items())}}  # fmt: skip


def _baseline(name: str, tried: Sequence[Case]) -> Json:
    """The same figures for one that ran beside, or ours, on the very same cases."""
    own = [(c, c if name == "ours" else c["baselines"][name]) for c in tried if name in ("ours", *c["baselines"])]
    nulls = [said for c, said in own if not c["truth"] and not c["outside"]]
    seen = [(c, said) for c, said in own if (c["truth"] or c["outside"]) and c["signature"] >= 1]
    single = [(c, said) for c, said in seen if len(c["truth"]) == 1]
    wide = [said for c, said in seen if _gap(c["before"]) > _GAP]
    points = [c["truth"][0] in said["points_to"] for c, said in single if "points_to" in said]
    shut = [_closed(said["before"], said["after"]) for said in wide]

    def alarm(said: Json) -> bool:
        return said["alarm"] if "alarm" in said else said["verdict"] != "none"

    return {
        "cases": len(own),
        "false_alarms": _share(nulls, alarm),
        "alarm_when_visible": _share([said for _, said in seen], alarm),
        "names_right": _share([_right(c) for c, _ in single] if name == "ours" else points, bool),
        "median_gap_closed": _median(shut),
        "gap_closed_by_half": _share(shut, lambda share: share >= 0.5),
        "held_out_at_most_1_2": _share(wide, lambda said: _gap(said["after"]) <= 1.2),
        "median_seconds": _median([said["seconds"] for _, said in own]),
    }


def _seconds(cases: Sequence[Case]) -> dict[str, float | None]:
    usual = [c for c in cases if c["trials"] == 8]
    return {
        f"{what}_{which}{end}": of([float(c[key]) for c in own])
        for own, end in ((cases, ""), (usual, "_of_8_trials"))
        for what, key in (("wall", "seconds"), ("cpu", "cpu"))
        for which, of in (("median", _median), ("most", partial(max, default=None)))
    }


def _median(values: Sequence[float]) -> float | None:
    """Of those that are numbers; what did not come to an end counts as the worst there is."""
    if not values:
        return None
    found = float(np.median([-math.inf if math.isnan(value) else value for value in values]))
    return found if math.isfinite(found) else None


def _share(of: Sequence[Any], flag: Callable[[Any], bool]) -> Json:
    return {"share": float(np.mean([bool(flag(one)) for one in of])) if of else None, "of": len(of)}


def show(kind: str, summary: Json) -> None:
    """Print the table of one kind of trial."""
    _print(f"diagnose, {kind}: {summary['cases']} campaigns", ("figure", "value", "of"),
           [(name, *_shown(value)) for name, value in _rows(summary)])  # fmt: skip
    if told := summary["baselines"]:
        cells = {figure: [_shown(own[figure]) for own in told.values()] for figure in next(iter(told.values()))}
        rows = [(key, *(f"{shown} of {of}" if of else shown for shown, of in row)) for key, row in cells.items()]
        _print("beside the baselines, on the same campaigns", ("figure", *told), rows)


def _print(title: str, columns: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    table = column_table(columns, left=("figure",), title=title, title_justify="left", box=None)
    for name, *cells in rows:
        table.add_row(name.replace("_", " "), *cells)
    Console().print(table, markup=False)


def _rows(summary: Json) -> list[tuple[str, Any]]:
    apart = ("cases", "top1_by_effect", "parameters", *_BASE, "baselines", "seconds")
    rows = [(_LABELS.get(name, name), value) for name, value in summary.items() if name not in apart]
    told = summary["parameters"]
    kept = ("median_relative_error", "intervals_hold_truth", "intervals_90_hold_truth")
    rows += [(f"parameters of effects, {_LABELS.get(name, name)}", told[name]) for name in kept]
    for key, words in _BASE.items():
        base = summary[key]
        rows.append((f"{words}, {_LABELS['intervals_90_hold_truth']}", base["intervals_90_hold_truth"]))
        rows += [(f"{words}, {name}, 90 % intervals", share) for name, share in base["by_name"].items()]
    rows += [(f"{name}, error", own["median_relative_error"]) for name, own in told["by_name"].items()]
    for effect, bins in sorted(summary["top1_by_effect"].items()):
        rows += [(f"{effect}, signature {label}", share) for label, share in sorted(bins.items())]
    return rows + [(f"seconds, {name}", value) for name, value in summary["seconds"].items()]


def _shown(value: Any) -> tuple[str, str]:
    if isinstance(value, dict):
        return ("-" if value["share"] is None else f"{100 * value['share']:.0f} %"), str(value["of"])
    return ("-" if value is None else f"{value:.3g}"), ""


def main(folders: Sequence[str]) -> None:
    """``python -m benchmarks.diagnosis.table DIR ...``: the table of all that these folders' cases.jsonl hold."""
    cases = {json.dumps([c["kind"], c["case"]], sort_keys=True): c for one in folders for c in read_cases(Path(one))}
    for kind in sorted({case["kind"] for case in cases.values()}):
        show(kind, summarise([case for case in cases.values() if case["kind"] == kind]))


if __name__ == "__main__":
    main(sys.argv[1:])
