"""Rows of the answer of `penetrate`: a bed's numbers with three errors, and the same on the spring-damper."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from rigid.intervals import half_of, half_width
from vis.page.numbers import between, plain, quantity, quote, split_spread, within
from vis.page.page import Tile
from vis.penetrate import summary_parts as words
from vis.penetrate.errors import contains_beds, in_95
from vis.penetrate.summary_parts import NBSP, say

__all__ = ["answer_tiles", "grains_of", "largest_force", "peaks_of", "rests_at", "words_of_effects"]

Entries = Mapping[str, Any]

_ROWS = 6  # of an answer


def answer_tiles(result: Entries) -> list[Tile]:
    """The numbers of a run that a reader wants first, six at most; of a run without a bed those of its law."""
    if result.get("ground", "bed") != "bed":
        return _of_file(result) if "ground_file" in result else _of_model(result)
    numbers = in_95(result)
    tiles = [*_sinkage(result, numbers), *_force(result), *_returned(numbers), *_law(result, numbers)]
    if words.mapping_of(result.get("spike")).get("tip") != "flat":
        return tiles
    return [replace(tile, label=words.as_foot(tile.label), note=words.as_foot(tile.note)) for tile in tiles]


def grains_of(result: Entries) -> str:
    """What pushes back: the name of the material, where it is known."""
    name = str(words.mapping_of(result.get("bed")).get("material") or "bed")
    return name if "-" in name else f"the {name}"


def largest_force(result: Entries) -> tuple[str, str, str] | None:
    """The largest force of loading over all speeds, that of the law at its speed, and how it was pushed."""
    by_speed = peaks_of(result, "driven", "peak_force")
    if not by_speed:
        return None
    depths = [words.value_of(run.get("quantities"), "max_depth") for run in _runs(result, "driven")]
    known = [depth for depth in depths if depth is not None]
    to = f" to {quote(max(known), unit='m')}" if known else ""
    speed, high = max(by_speed, key=lambda peak: peak[1][0])
    law = next((peak for at, peak in peaks_of(result, "driven", "model_peak_force") if at == speed), None)
    note = f"pushed{to} at {speed:g}{NBSP}m/s"
    note += " (mean over beds of the largest)" if high[1] is not None else ""
    others = [f"{quote(*peak, 'N')} at {other:g}{NBSP}m/s" for other, peak in by_speed if other != speed]
    return (
        quote(*high, "N"),
        quote(law[0], law[1] or None, "N") if law else "",
        f"{note}; {words.joined(others)}" if others else note,
    )


def peaks_of(result: Entries, kind: str, key: str) -> list[tuple[float, tuple[float, float | None]]]:
    """Speed -> mean over seeds and half of its 95 % interval (None for a single seed)."""
    found = []
    runs = _runs(result, kind)
    for speed in sorted({speed for run in runs if (speed := words.plain_value(run.get("speed"))) is not None}):
        own = (run for run in runs if run.get("speed") == speed)
        values = [value for run in own if (value := words.value_of(run.get("quantities"), key)) is not None]
        if values:
            half = half_width(float(np.std(values, ddof=1)), len(values)) if len(values) > 1 else None
            found.append((speed, (float(np.mean(values)), half)))
    return found


def rests_at(numbers: Entries) -> str:
    """The depth at rest, or how far above depth 0 a spike rests that grains which stick out carry."""
    entry = numbers["sinkage_dem"]
    above = -(words.value_of(numbers, "sinkage_dem") or 0.0)
    return f"{quantity({**entry, 'value': above})} above the surface" if above > 0 else quantity(entry)


def words_of_effects(result: Entries) -> str:
    """The added effects, in words."""
    effects = words.mapping_of(result.get("model")).get("effects")
    return " and ".join(map(str, effects)) if effects else "nothing added"


def _runs(result: Entries, kind: str) -> list[Entries]:
    runs = map(words.mapping_of, words.list_of(result.get("runs")))
    return [run for run in runs if run.get("kind") == kind]


def _sinkage(result: Entries, numbers: Entries) -> list[Tile]:
    """Where it rests, and where among real grains; or how deep it would have to sink."""
    load = f" under {quantity(numbers['load'])}" if words.value_of(numbers, "load") is not None else ""
    law = _on_law(numbers, "sinkage_spring_damper")
    if (needed := words.value_of(numbers, "depth_to_rest")) is not None:
        return _beyond(result, needed, load, law)
    if words.value_of(numbers, "sinkage_dem") is None:
        restless = "sinkage_dem" in numbers and bool(_runs(result, "set_down"))
        note = "no set-down came to rest in time"
        return [Tile(f"Sinkage{load}", "unknown", note, beside=law)] if restless else []
    first = Tile(f"Sinkage{load}", quantity(numbers["sinkage_dem"]), beside=law)
    if first.value.startswith(words.MINUS):
        first = replace(first, label=f"{first.label} (negative: on the uppermost grains)")
    entry = _sure(result, "sinkage_dem")
    if not entry:
        return [first]
    above = entry["value"] < 0
    value = split_spread(first.value)[0] if above else quote(entry["value"], None, "m", significant=2)
    return [replace(first, value=value, errors=_errors(entry)), _among_real_grains(result, entry)]


def _among_real_grains(result: Entries, entry: Entries) -> Tile:
    """The interval among real grains; where no run shows it, what a formula gives for grains that stick."""
    if entry["low"] is not None:
        ends = within(entry["low"], entry["high"], "m")
        return Tile("Sinkage among real grains (95 %)", ends, say("of_real_grains"))
    rest = words.mapping_of(result.get("rest"))
    bounds = words.list_of(rest.get("depth_range"))
    if rest.get("comes_to_rest") is True and len(bounds) == 2:
        return _by_cohesion(bounds)
    return Tile("Sinkage among real grains (95 %)", "not known", words.sentence(str(entry["sentence"])))


def _by_cohesion(bounds: Sequence[float]) -> Tile:
    """What cohesion, the expected K and a formula give: at the surface, between two depths, or one of both."""
    label, (low, high) = "Sinkage with and without cohesion", bounds
    if not high:
        return Tile(label, quote(0.0, 0.0, "m"), say("supported"))
    if low == 0:
        return Tile(label, f"0, or up to {quote(high, None, 'm', significant=2)}", say("supported_or_not"))
    return Tile(label, between(low, high, "m"), say("bounds_of_k"))


def _beyond(result: Entries, needed: float, load: str, law: str) -> list[Tile]:
    """The depth that a load needs which does not come to rest in this bed."""
    sure = _sure(result, "depth_to_rest")
    times = sure.get("times_beyond")
    note = "not in this bed" + (say("beyond_pushes", times=plain(times, 2)) if times is not None else "")
    tiles = [Tile(f"Would rest{load} at about", quote(needed, None, "m", significant=2), note, beside=law)]
    low, high = sure.get("low"), sure.get("high")
    if sure:
        least = "not known" if low is None else f"at least {quote(low, None, 'm', significant=2)}"
        ends = least if high is None or low is None else within(low, high, "m")
        tiles.append(Tile("The same with its errors (95 %)", ends, say("of_real_grains") if low is not None else ""))
    return tiles


def _force(result: Entries) -> list[Tile]:
    push = largest_force(result)
    if push is None:
        return []
    of_beds = ", mean of beds" if "±" in push[0] else ""
    label = f"Largest force of {grains_of(result)}{of_beds}"
    return [Tile(label, push[0], push[2], beside=push[1])]


def _returned(numbers: Entries) -> list[Tile]:
    if words.value_of(numbers, "work_returned_dem") is None:
        return []
    shown = quantity(numbers["work_returned_dem"], unit="%", significant=2)
    law = _on_law(numbers, "work_returned_spring_damper", "%")
    return [Tile("Work recovered on withdrawal", shown, say("returned"), beside=law)]


def _law(result: Entries, numbers: Entries) -> list[Tile]:
    """K and C, with what is not known of both."""
    if words.value_of(numbers, "stiffness") is None:
        return []
    sure = _sure(result, "stiffness")
    value = quote(sure["value"], None, "N/m", significant=2) if sure else _with_fit_error(result, numbers, "stiffness")
    tile = Tile("Fitted stiffness K", value, _note_of_law(result, numbers, sure))
    tiles = [replace(tile, errors=_errors(sure)) if sure else tile]
    if words.value_of(numbers, "damping") is not None:
        value = _with_fit_error(result, numbers, "damping")
        tiles.append(Tile("Fitted damping C", value, _own_error(numbers, "damping")))
    return tiles


def _note_of_law(result: Entries, numbers: Entries, sure: Entries) -> str:
    """What K is for, what a foot that stands has, and the error of the law's force."""
    drops = [run for run in _runs(result, "drop") if words.value_of(run.get("quantities"), "stop_time") is not None]
    runs = [*_runs(result, "driven"), *drops]
    depths = [depth for run in runs if (depth := words.value_of(run.get("quantities"), "max_depth")) is not None]
    parts = ["for motion" + (f" down to {quote(max(depths), None, 'm')}" if depths else "")]
    if "stiffness_standing" in numbers:
        parts.append(_standing(result, numbers))
    if sure and sure["low"] is not None:
        parts.append(say("k_of_real_grains", k=within(sure["low"], sure["high"], "N/m")))
    if words.value_of(numbers, "drag_gap") is not None:
        parts.append(say("error_of_force", gap=quantity(numbers["drag_gap"], unit="%")))
    known = bool(sure) and sure["low"] is not None  # the interval of real grains contains the error of the fit
    return "; ".join(filter(None, (*parts, "" if known else _own_error(numbers, "stiffness"))))


def _with_fit_error(result: Entries, numbers: Entries, key: str) -> str:
    """K or C; of several beds that do not separate them, with half of the 95 % interval of the fit to all beds."""
    entry, error = numbers[key], words.value_of(numbers, f"{key}_error")
    several = len(words.list_of(result.get("fits"))) > 1
    return quantity({**entry, "std": error} if several and entry.get("std") is None and error is not None else entry)


def _own_error(numbers: Entries, key: str) -> str:
    """The error of the fit, where beds show none."""
    if words.std_of(numbers, key) is not None or words.value_of(numbers, f"{key}_error") is None:
        return ""
    return f"error of the fit, 95{NBSP}%: {quantity(numbers[f'{key}_error'])}"


def _standing(result: Entries, numbers: Entries) -> str:
    """Which K a foot that stands has: load over the ends of its sinkage, or none where it may not sink at all."""
    sure = _sure(result, "sinkage_dem")
    chance, load = words.list_of(sure.get("chance")), words.value_of(numbers, "load")
    if chance and chance[0] <= 0:
        return say("standing_unknown")
    if sure.get("low") and load is not None:
        return say("standing", k=between(load / sure["high"], load / sure["low"], "N/m"))
    return say("standing", k=quantity(numbers["stiffness_standing"]))


def _errors(entry: Entries) -> tuple[str, ...]:
    """Chance as a half-width or as two ends, grain size as what it may change, and what is not known."""
    value, unit, parts = entry["value"], entry["unit"], []
    for name in ("chance", "grain_size"):
        low, high = entry[name] if entry[name] is not None else (None, None)
        if low is None or high is None:
            parts.append("not known")
        elif abs((high - value) - (value - low)) < 1e-6 * abs(high - low):
            parts.append(quote(high - value, None, unit, significant=2))
        else:
            sides = [(f"{words.MINUS}", value - low), ("+", high - value)]
            parts.append(_signed([(sign, by) for sign, by in sides if by > 0], unit))
    return parts[0], parts[1] or "0", "not known"


def _signed(sides: Sequence[tuple[str, float]], unit: str) -> str:
    """Both sides of an error, with one unit where they share it: "-19 +10 N/m"."""
    texts = [f"{sign}{quote(by, None, unit, significant=2)}" for sign, by in sides]
    if len(texts) == 2 and (shown := texts[1].partition(NBSP)[2]) == texts[0].partition(NBSP)[2]:
        texts[0] = texts[0].removesuffix(f"{NBSP}{shown}")
    return " ".join(texts)


def _sure(result: Entries, name: str) -> Entries:
    return words.mapping_of(words.mapping_of(result.get("sure")).get(name))


def _on_law(numbers: Entries, name: str, unit: str | None = None) -> str:
    """A number on the spring-damper; empty where there is none."""
    return quantity(numbers[name], unit=unit) if words.value_of(numbers, name) is not None else ""


# Without a bed --------------------------------------------------------------------------------------------------------


def _of_model(result: Entries) -> list[Tile]:
    """What was asked of the law of a model.toml: peaks of pushes, sinkages, K and C, beside the spring-damper's."""
    numbers = in_95(result)
    pushes = [name for name in numbers if name.startswith("peak_force_amended")]
    room = 3 if words.value_of(numbers, "sinkage_amended") is None else 2  # of six rows
    pushes = pushes if len(pushes) <= room else [pushes[0], pushes[-1]]
    rows: list[tuple[str, str, str, str | None]] = [
        (
            f"Peak force{_without_beds(numbers[name])}, {_path(numbers[name])}",
            name,
            name.replace("amended", "spring_damper"),
            None,
        )
        for name in pushes
    ]
    load = f" under {quantity(numbers['load'])}" if "load" in numbers else ""
    rows += [
        (f"Sinkage{load}", "sinkage_amended", "sinkage_spring_damper", None),
        ("Work recovered on withdrawal", "work_returned_amended", "work_returned_spring_damper", "%"),
        ("Stiffness K", "stiffness", "stiffness_spring_damper", None),
        ("Damping C", "damping", "damping_spring_damper", None),
    ]
    whose = f"with {words_of_effects(result)}"
    tiles = [
        Tile(label, quantity(numbers[name], unit=unit), whose, beside=_on_law(numbers, other, unit))
        for label, name, other, unit in rows
        if words.value_of(numbers, name) is not None
    ]
    every = [tile for name in pushes for tile in _over_forms(result, numbers, name)]
    return [*tiles[: len(pushes)], *every, *tiles[len(pushes) :]][:_ROWS]


def _over_forms(result: Entries, numbers: Entries, name: str) -> list[Tile]:
    """The range of a peak force over all forms that the model's trials do not exclude; empty where there is one."""
    others = [words.mapping_of(one) for one in words.list_of(words.mapping_of(result.get("model")).get("other_forms"))]
    peaks = [(numbers[name]["value"], numbers[name]["std"]), *(
        (peak["value"], half_of(peak)) for one in others if (peak := words.mapping_of(one.get("peaks")).get(name))
    )]  # fmt: skip
    if len(peaks) < 2:
        return []
    ends = [value + sign * (half or 0.0) for value, half in peaks for sign in (-1.0, 1.0)]
    each = [
        f"{quote(value, half, 'N')} with {' and '.join(map(str, one.get('effects', [])))}"
        for (value, half), one in zip(peaks[1:], others, strict=True)
    ]
    label = f"The same, all forms not excluded, {_path(numbers[name]).partition(' at ')[2]}"
    note = say("over_forms", each=words.joined(each))
    return [Tile(label, between(max(min(ends), 0.0), max(ends), "N"), note)]


def _without_beds(entry: Entries) -> str:
    """That the error of a peak force leaves out by what beds differ, where it does."""
    return "" if entry.get("std") is None or contains_beds(entry) else " (± without beds)"


def _path(entry: Entries) -> str:
    return str(entry.get("note", "")).partition(", with")[0]


def _of_file(result: Entries) -> list[Tile]:
    """How deep a foot rests on the law of a ground file, its largest push, and the work that it recovers."""
    numbers = result["quantities"]
    tiles = []
    if words.value_of(numbers, "sinkage_law") is not None:
        load = f" under {quantity(numbers['load'])}" if "load" in numbers else ""
        tiles.append(Tile(f"Sinkage{load}", quantity(numbers["sinkage_law"]), str(result["ground"])))
    pushes = peaks_of(result, "driven", "model_peak_force")
    for speed, peak in sorted(pushes, key=lambda one: -one[1][0])[:1]:
        tiles.append(Tile("Largest force", quote(*peak, "N"), f"pushed at {speed:g}{NBSP}m/s"))
    if words.value_of(numbers, "work_returned_law") is not None:
        tiles.append(Tile("Work recovered on withdrawal", quantity(numbers["work_returned_law"], unit="%")))
    return tiles
