"""What a run of `penetrate` shows on the terminal in the end: a short table, and the findings that matter most.

Everything else is in the report and in result.json, and with ``--verbose`` on the terminal too.
"""

import re
from collections.abc import Mapping, Sequence
from statistics import fmean, stdev
from typing import Any

from experiments.runs.registry import Headline, findings_shown
from rigid.intervals import half_width
from vis.page.numbers import foldable, quote
from vis.penetrate.errors import error_words, in_95
from vis.penetrate.summary_parts import as_foot

from .sure import in_words, known_within

__all__ = ["penetrate_headline"]

_SIDES = ("bed", "spring-damper")
NOT_INCLUDED = "  (without bed size, softness, speed)"
"""Below an interval: what is not in it."""
ON_TOP = "  (negative: on the uppermost grains)"
"""Below a sinkage above depth 0."""
BY_FORMULA = "by Terzaghi, cohesion at 95 %"
"""Depth that a formula gives where grains that stick are too large to show it."""


def penetrate_headline(result: Mapping[str, Any]) -> Headline | None:
    """The short form of a result; None where it has no bed beside a spring-damper."""
    numbers = in_95(result)
    if "stiffness_spring_damper" in numbers and "stiffness" in numbers:
        return _of_model(result)
    if "sinkage_dem" not in numbers or "stiffness" not in numbers:
        return None
    load = f" under {quote(numbers['load']['value'], unit='N')}" if "load" in numbers else ""
    rows = [(f"sinkage at rest{load}", *(_quoted(numbers[f"sinkage_{side}"]) for side in ("dem", "spring_damper")))]
    if "depth_to_rest" in numbers:
        rows[0] = (f"would rest{load} at about", _quoted(numbers["depth_to_rest"]), rows[0][2])
    if (numbers["sinkage_dem"]["value"] or 0.0) < 0:
        rows.append((ON_TOP, "", ""))
    rows += _with_errors(result.get("sure", {}))
    if result.get("rest", {}).get("comes_to_rest"):
        low, high = result["rest"]["depth_range"]
        rows.append((BY_FORMULA, in_words(low, high, "m") if high else "0", ""))
    rows += _drag(result.get("departures", {}).get("table", []))
    rows += _fastest_drop(result.get("runs", []))
    given, back = (numbers.get(f"work_returned_{side}") for side in ("dem", "spring_damper"))
    if given and back and given["value"] is not None:
        rows.append(("work recovered on withdrawal", _quoted(given, "%"), _quoted(back, "%")))
    rows.append(("fitted stiffness K", "", _stiffness(numbers["stiffness"], result)))
    rows.append(("fitted damping C", "", _quoted(numbers["damping"])))
    if "drag_gap" in numbers:
        rows.append(("error of its force (rms, loading)", "", _quoted(numbers["drag_gap"], "%")))
    warnings, said = list(result.get("warnings", [])), list(result.get("departures", {}).get("sentences", []))
    rest = list(result.get("rest", {}).get("sentences", []))
    changes = result.get("reference", {}).get("moved", {})
    parts = [
        f"{words} {100 * changes[name]['change']:+.0f} %"
        for name, words in (("stiffness", "K"), ("damping", "C"), ("sinkage_dem", "the sinkage"))
        if changes.get(name, {}).get("change") is not None
    ]
    moved = [f"Against the reference, {', '.join(parts)}."] if parts else []
    # Of a finding that goes on, as to how far beds differ, the first sentence.
    own = [re.split(r"(?<=\.)\s+(?=[A-Z])", text)[0] for text in said if not text.startswith("Against the reference")]
    shown = [*own[: findings_shown(warnings) - len(moved)], *moved]
    left = len(said) - len(shown)
    shown = [*rest, *shown]
    if result.get("spike", {}).get("tip") == "flat":
        warnings, shown = as_foot(warnings), as_foot(shown)
    known = (f"{side}, 95 %" if any("±" in row[k] for row in rows) else side for k, side in enumerate(_SIDES, 1))
    return Headline(
        ("", *known), tuple(tuple(foldable(cell) for cell in row) for row in rows),
        tuple(map(foldable, warnings)), tuple(map(foldable, shown)), left,
    )  # fmt: skip


def _of_model(result: Mapping[str, Any]) -> Headline:
    """What was asked of the law of a model.toml: peaks of pushes, sinkages, K and C, beside the spring-damper's."""
    numbers = in_95(result)
    effects = " and ".join(result.get("model", {}).get("effects", ())) or "nothing added"

    def cell(name: str, unit: str = "") -> str:
        entry = numbers.get(name, {"value": None})
        return "-" if entry["value"] is None else quote(entry["value"], entry.get("std"), unit or entry["unit"])

    rows = []
    for name in numbers:
        if name.startswith("peak_force_amended"):
            path = numbers[name].get("note", "").partition(", with")[0]
            rows.append((f"peak force, {path}", cell(name), cell(name.replace("amended", "spring_damper"))))
    if "sinkage_amended" in numbers:
        load = quote(numbers["load"]["value"], unit="N")
        rows.append((f"sinkage at rest under {load}", cell("sinkage_amended"), cell("sinkage_spring_damper")))
    for name, words in (("stiffness", "stiffness K"), ("damping", "damping C")):
        rows.append((words, cell(name), cell(f"{name}_spring_damper")))
    rows.append(
        ("work recovered on withdrawal", cell("work_returned_amended", "%"), cell("work_returned_spring_damper", "%"))
    )
    warnings, said = list(result.get("warnings", [])), list(result.get("departures", {}).get("sentences", []))
    shown = said[: findings_shown(warnings)]
    return Headline(
        ("", f"with {effects}, 95 %", "spring-damper"), tuple(tuple(foldable(cell) for cell in row) for row in rows),
        tuple(map(foldable, warnings)), tuple(map(foldable, shown)), len(said) - len(shown), (error_words(result),),
    )  # fmt: skip


def _stiffness(entry: Mapping[str, Any], result: Mapping[str, Any]) -> str:
    """K with both ends of its interval over several beds, which is that of its logarithm, as the report has it."""
    sure = result.get("sure", {}).get("stiffness", {})
    if sure.get("chance") is None or sure["one_bed"]:
        return _quoted(entry)
    value = quote(entry["value"], None, "1", significant=2)
    low, high = sure["chance"]
    return f"{value} ({known_within(low, high, '1')}) {entry['unit']}"


def _with_errors(sure: Mapping[str, Any]) -> list[tuple[str, str, str]]:
    """The sinkage among real grains with the ends of its interval, or the depth to rest; as far as they are known."""
    for name, words in (
        ("depth_to_rest", "the same with its errors, 95 %"),
        ("sinkage_dem", "among real grains, 95 %"),
    ):
        if name in sure:
            low, high = sure[name]["low"], sure[name]["high"]
            known = "not known" if low is None else f"at least {quote(low, None, 'm', significant=2)}"
            shown = [(words, known if high is None else known_within(low, high, "m"), "")]
            return [*shown, (NOT_INCLUDED, "", "")] if low is not None else shown
    return []


def _drag(table: Sequence[Mapping[str, Any]]) -> list[tuple[str, str, str]]:
    """Mean force in the deepest band, driven at the slowest and at the fastest speed."""
    if not table:
        return []
    bottom = max(row["depth_from"] for row in table)
    deep = sorted((row for row in table if row["depth_from"] == bottom), key=lambda row: row["speed"])
    shown = [deep[0], deep[-1]] if len(deep) > 1 else deep
    return [
        (
            f"drag at {row['speed']:g} m/s, {1e3 * row['depth_from']:.3g}-{1e3 * row['depth_to']:.3g} mm deep",
            quote(row["bed_force"], unit="N"),
            quote(row["model_force"], unit="N"),
        )
        for row in shown
    ]


def _fastest_drop(runs: Sequence[Mapping[str, Any]]) -> list[tuple[str, str, str]]:
    """Peak force and deepest point of the fastest drop, means where several beds have it."""
    drops = [run for run in runs if run.get("kind") == "drop"]
    if not drops:
        return []
    speed = max(run["speed"] for run in drops)
    fastest = [run["quantities"] for run in drops if run["speed"] == speed]

    def mean(key: str, unit: str) -> str:
        values = [numbers[key]["value"] for numbers in fastest if numbers.get(key, {}).get("value") is not None]
        half = half_width(stdev(values), len(values)) if len(values) > 1 else None
        return _quoted({"value": fmean(values) if values else None, "std": half, "unit": unit})

    return [
        (f"{words} of the drop at {speed:g} m/s", mean(name, unit), mean(f"model_{name}", unit))
        for name, words, unit in (("peak_force", "peak force", "N"), ("max_depth", "largest depth", "m"))
    ]


def _quoted(entry: Mapping[str, Any], unit: str = "") -> str:
    # A law computed once has no spread, and is no more exact for that.
    return "-" if entry["value"] is None else quote(entry["value"], entry["std"] or None, unit or entry["unit"])
