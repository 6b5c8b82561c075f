"""`hedgebed bench diagnose`: campaigns with something hidden in them, diagnosed; what was named, what was missed.

Each kind of trial has a module `benchmarks/hidden_<kind>.py` with ``make_hidden(seed) -> (campaign, Hidden)``; the code
that diagnoses sees the campaign only. HEDGEBED_DIAGNOSE_CASES sets how many campaigns of each kind are made (40),
HEDGEBED_DIAGNOSE_SEED the first seed (1000).
"""

from __future__ import annotations

import json
import os
import time
from collections import defaultdict
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table
from threadpoolctl import threadpool_limits

from experiments.diagnose.diagnosis import diagnose
from experiments.progress import Progress

__all__ = ["run", "summarise"]

_KINDS = ("penetration", "tumble")
_BINS = ((0.0, 1.0), (1.0, 3.0), (3.0, 10.0), (10.0, float("inf")))


def run(out: Path, *, progress: Progress) -> dict[str, Any]:
    """Make, diagnose and count; cases.jsonl in `out` grows as it goes."""
    count, first = _whole("HEDGEBED_DIAGNOSE_CASES", 40), _whole("HEDGEBED_DIAGNOSE_SEED", 1000)
    kinds = [kind for kind in _KINDS if find_spec(f"benchmarks.hidden_{kind}") is not None]
    cases: list[dict[str, Any]] = []
    for kind in kinds:
        make = import_module(f"benchmarks.hidden_{kind}").make_hidden
        problem_of = import_module(f"experiments.diagnose.{kind}_problem").make_problem
        progress.stage(f"diagnose {kind}", total=count)
        for seed in range(first, first + count):
            case = _one(kind, seed, make, problem_of)
            cases.append(case)
            with (out / "cases.jsonl").open("a", encoding="utf-8") as file:
                file.write(json.dumps(case) + "\n")
            progress.message(f"{kind} {seed}: {case['hidden']} ({case['signature']:.2g}): {case['verdict']} "
                             f"{' + '.join(case['effects'])} {case['alternatives'] or ''}")  # fmt: skip
            progress.update(seed - first + 1)
    result: dict[str, Any] = {"format": "hedgebed-bench/1", "what": "diagnose"}
    result |= {"first_seed": first, "cases": len(cases)}
    for kind in kinds:
        result[kind] = summarise([case for case in cases if case["kind"] == kind])
        _show(kind, result[kind])
    return result


def summarise(cases: list[dict[str, Any]]) -> dict[str, Any]:
    """The figures of the aims from single cases."""
    nulls = [c for c in cases if not c["truth"] and not c["outside"]]
    single = [c for c in cases if len(c["truth"]) == 1 and not c["outside"]]
    pairs = [c for c in cases if len(c["truth"]) == 2]
    outside = [c for c in cases if c["outside"]]
    seen = [c for c in outside if c["signature"] >= 1]
    named = [c for c in single if c["verdict"] in ("named", "ambiguous")]
    ambiguous = [c for c in single if c["verdict"] == "ambiguous"]
    plain = [c for c in single if c["signature"] >= 10]
    by_effect: dict[str, dict[str, list[float]]] = defaultdict(lambda: defaultdict(list))
    for c in single:
        low, high = next(b for b in _BINS if b[0] <= c["signature"] < b[1])
        label = f"{low:g}-{high:g}"
        by_effect[c["truth"][0]][label].append(float(_right(c)))
    closed = [1 - (c["after"] - 1) / (c["before"] - 1) for c in named if _right(c) and c["before"] > 1.5]
    return {
        "cases": len(cases),
        "false_alarms": _share([c["verdict"] != "none" for c in nulls]),
        "named_right_plain": _share([_right(c) for c in plain]),
        "named_right_when_visible": _share([_right(c) for c in single if c["signature"] >= 1]),
        "missed_when_visible": _share([c["verdict"] == "none" for c in single if c["signature"] >= 1]),
        "called_unknown_when_plain": _share([c["verdict"] == "unknown" for c in plain]),
        "top1_by_effect": {
            effect: {label: _share([bool(x) for x in v]) for label, v in bins.items()}
            for effect, bins in by_effect.items()
        },
        "ambiguous_sets_hold_truth": _share([c["truth"][0] in {*c["effects"], *c["alternatives"]} for c in ambiguous]),
        "set_size": float(np.mean([1 + len(c["alternatives"]) for c in named])) if named else None,
        "pairs_both_named": _share([set(c["truth"]) == set(c["effects"]) for c in pairs]),
        "pairs_one_named": _share([bool(set(c["truth"]) & set(c["effects"])) for c in pairs]),
        "unknown_recall": _share([c["verdict"] == "unknown" for c in outside]),
        "unknown_recall_when_visible": _share([c["verdict"] == "unknown" for c in seen]),
        "held_out_at_most_1_2": _share([c["after"] <= 1.2 for c in named if _right(c)]),
        "median_held_out_after": float(np.median([c["after"] for c in named if _right(c)])) if named else None,
        "median_gap_closed": float(np.median(closed)) if closed else None,
        "seconds": {"median": float(np.median([c["seconds"] for c in cases])),
                    "most": float(max(c["seconds"] for c in cases)),
                    "cpu_median": float(np.median([c["cpu"] for c in cases])),
                    "cpu_most": float(max(c["cpu"] for c in cases))},
    }  # fmt: skip


def _one(kind: str, seed: int, make: Any, problem_of: Any) -> dict[str, Any]:
    campaign, hidden = make(seed)
    began, cpu = time.monotonic(), time.process_time()
    with threadpool_limits(1):
        found = diagnose(problem_of(campaign))
    return {
        "kind": kind, "seed": seed, "truth": list(hidden.effects), "outside": hidden.outside,
        "hidden": " + ".join(hidden.effects) or hidden.outside or "nothing", "signature": float(hidden.signature),
        "coloured": bool(hidden.coloured), "trials": len(campaign.tables.trial), "verdict": found.verdict,
        "effects": list(found.effects), "alternatives": list(found.alternatives),
        "forms": [form.id for form in found.forms],
        "before": found.before.held_out if found.before.held_out is not None else found.before.fit,
        "after": found.after.held_out if found.after.held_out is not None else found.after.fit,
        "seconds": time.monotonic() - began, "cpu": time.process_time() - cpu,
    }  # fmt: skip


def _right(case: dict[str, Any]) -> bool:
    """Whether the first name is the truth, and nothing else is called certain."""
    return case["verdict"] in ("named", "ambiguous") and case["effects"] == case["truth"]


def _share(flags: list[bool]) -> dict[str, Any]:
    return {"share": float(np.mean(flags)) if flags else None, "of": len(flags)}


def _whole(name: str, default: int) -> int:
    value = os.environ.get(name, str(default))
    if not value.isdigit() or (int(value) < 1 and name.endswith("CASES")):
        raise ValueError(f"{name} = {value!r}: a whole number was expected")
    return int(value)


def _show(kind: str, summary: dict[str, Any]) -> None:
    table = Table(title=f"diagnose, {kind}: {summary['cases']} campaigns", title_justify="left", box=None)
    table.add_column("figure")
    table.add_column("value", justify="right")
    table.add_column("of", justify="right")
    for name, value in summary.items():
        if isinstance(value, dict) and "share" in value:
            table.add_row(name, "-" if value["share"] is None else f"{100 * value['share']:.0f} %", str(value["of"]))
        elif isinstance(value, float):
            table.add_row(name, f"{value:.3g}", "")
    for effect, bins in summary["top1_by_effect"].items():
        for label, share in sorted(bins.items()):
            table.add_row(f"{effect}, signature {label}", f"{100 * share['share']:.0f} %", str(share["of"]))
    for name, value in summary["seconds"].items():
        table.add_row(f"seconds, {name}", f"{value:.3g}", "")
    Console().print(table, markup=False)
