"""Which K and C of pushes and drops to use, in which law, and what their errors leave out."""

import math
import re
from collections.abc import Mapping
from typing import Any

from experiments.campaign.model_errors import bias_words
from experiments.campaign.tables import SURFACE
from experiments.diagnose.fit.gaps import numeral
from rigid.intervals import half_of
from vis.diagnose.usable import has_numbers_to_use, secant_depth, stiffness_words
from vis.page.numbers import fitted, foldable

from .sentences import say

__all__ = ["SERIES", "law_sentences", "near_model_sentences", "neutral_sentences", "number_words", "peak_sentences",
           "stated_sentences", "unloading_sentences", "use_sentences"]  # fmt: skip

SERIES = {"count": 36, "middle": 0.1, "most": 3.4}
"""By how much K of campaigns without an effect was below the ground's [%]: docs/results/diagnose-second, pushes."""
_STRONG, _PAIRS = 0.9, 3  # correlation from which on it is reported, and of how many pairs
_REFERENCE = re.compile(r"\bD\b")  # the typical depth in an equation
_STATED = 4  # numbers that were stated in the sentence; more are in the table
_SHOWN = 4  # diameters whose K is in the sentence; of more it is in the table


def use_sentences(diagnosis: Mapping[str, Any]) -> list[str]:
    """K by diameter with its error, what C is, and what the errors do not count; none where there is no K to use."""
    if not has_numbers_to_use(diagnosis):
        return []
    after = diagnosis["base"]["after"]
    stiffnesses = {name: entry for name, entry in after.items() if name.startswith("stiffness")}
    if not stiffnesses:
        return []
    shown = [_words(name, entry) for name, entry in list(stiffnesses.items())[:_SHOWN]]
    shown += ["more in the table"] if len(stiffnesses) > _SHOWN else []
    names = " and ".join(effect["id"] for effect in diagnosis["effects"])
    beside = f", together with {names} as in model.toml" if names else ""
    each = say("one_k_each") if len(stiffnesses) > 1 else ""
    is_open = [name for name, entry in after.items() if name.startswith("damping") and entry["std"] is None]
    depth = secant_depth(diagnosis)
    meant = stiffness_words(diagnosis)
    secant = f" ({meant})" if meant else ""
    of_depth = "" if depth is None else say("of_depth")
    dampings = [entry for name, entry in after.items() if name.startswith("damping")]
    known = len(stiffnesses) == len(dampings) == 1 and dampings[0]["std"] is not None
    doubt = any(remark.startswith("C = ") for remark in diagnosis.get("remarks", ()))
    damping = f" and C = {number_words(dampings[0])}{say('c_in_doubt') if doubt else ''}" if known else ""
    sentence = say(
        "use", numbers=", ".join(shown), secant=secant, damping=damping, beside=beside, each=each, of_depth=of_depth
    )
    bounds = "".join(_bound(name, after[name]["at_most"]) for name in is_open[:_SHOWN] if "at_most" in after[name])
    covered = diagnosis.get("covered", {})
    no_way_out = "" if covered.get("withdrawal", True) else f" {say('no_withdrawal')}"
    sentence += (say("c_is_open", bounds=bounds) if is_open else "") + _in_series(covered)
    return [sentence + no_way_out, *_surface(after.get(SURFACE))]


def _surface(entry: Mapping[str, Any] | None) -> list[str]:
    """From which depth on the bed carries, where that is more than 0 by its 95 % interval."""
    half = None if entry is None else half_of(entry)
    if entry is None or half is None or entry["value"] <= half:
        return []
    in_mm = {**entry, "value": 1e3 * entry["value"], "std": 1e3 * entry["std"], "unit": "mm"}
    return [say("surface", depth=number_words(in_mm))]


def _in_series(covered: Mapping[str, Any]) -> str:
    """The warning that the frame bends in pushes as well as the ground, which lowers K; empty without pushes."""
    frame = covered.get("frame_stiffness_N_m")
    if not covered:
        return ""
    return f" {say('in_series', **SERIES)}" if frame is None else f" {say('at_the_tip', frame=frame)}"


def stated_sentences(diagnosis: Mapping[str, Any]) -> list[str]:
    """K and C that campaign.toml states as known, beside those that the pushes give without it; none where there is no
    K to use."""
    if not has_numbers_to_use(diagnosis):
        return []
    rows = diagnosis.get("stated", [])
    if not rows:
        return []
    meant = stiffness_words(diagnosis)
    more = say("stated_more") if len(rows) > _STATED else ""
    more += say("stated_means", meant=meant) if meant and any(row["alone"] for row in rows) else ""
    return [say("stated", each="; ".join(map(_stated_words, rows[:_STATED])), more=more)]


def _stated_words(row: Mapping[str, Any]) -> str:
    """K = 1100 ± 220 N/m is stated, the pushes alone give 1088 ± 25 N/m (1.1 % less): they agree"""
    name, at = {"stiffness": "K", "damping": "C"}[row["parameter"].partition("@")[0]], _at(row["parameter"])
    stated = number_words(row["stated"])
    if row["alone"] is None:
        return say("stated_open", name=name, at=at, stated=stated)
    change = row["difference"]["value"] / row["stated"]["value"]
    by = say("stated_by", share=100 * abs(change), more="more" if change > 0 else "less")
    agrees = say("stated_agrees") if row["agrees"] else say("stated_differs")
    return say("stated_one", name=name, at=at, stated=stated, alone=number_words(row["alone"]), by=by, agrees=agrees)


def _bound(name: str, bound: float) -> str:
    """; it is at most 1.2 N s/m for 60 mm of diameter"""
    return say("c_at_most", at_most=numeral(bound, 2), at=_at(name))


def _words(name: str, entry: Mapping[str, Any]) -> str:
    """K = 5932 ± 7 N/m for 60 mm of diameter"""
    return f"K = {number_words(entry)}{_at(name)}"


def number_words(entry: Mapping[str, Any]) -> str:
    """A fitted number with half of its 95 % interval, both to the same digit, and its unit: 820 ± 120 N/m."""
    known = dict(entry) if entry.get("determined", True) else {**entry, "std": None}
    return foldable(fitted(known, significant=4))


def law_sentences(diagnosis: Mapping[str, Any]) -> list[str]:
    """The law of pushes with its numbers, and which depend on one another; none where nothing is named."""
    rows = [row for row in diagnosis.get("equations", []) if row["equation"]]
    if diagnosis.get("kind") != "penetration" or not (has_numbers_to_use(diagnosis) and rows):
        return []
    numbers = {effect["id"]: effect["parameters"] for effect in diagnosis["effects"]}
    depth, parts = diagnosis.get("typical_depth_m"), []
    for row in rows:
        own = {name: numbers[row["effect"]][name] for name in row["units"] if name in numbers.get(row["effect"], {})}
        listed = ", ".join(f"{name} = {number_words(entry)}" for name, entry in own.items())
        parts.append(f"{row['effect']}: {row['equation']}" + (f", with {listed}" if listed else ""))
    has_depth = any(_REFERENCE.search(row["equation"]) for row in rows)
    reference = say("reference", depth_mm=1e3 * depth) if has_depth and depth is not None else ""
    said = [say("law", parts="; ".join(parts), reference=reference)]
    said += unloading_sentences(diagnosis)
    pairs = _correlated(diagnosis.get("errors", {}))
    return said + ([say("correlated", listed=", ".join(pairs))] if pairs else [])


def neutral_sentences(diagnosis: Mapping[str, Any]) -> list[str]:
    """Which numbers of the effects are not distinguished from 0; none where no law of pushes is named."""
    if diagnosis.get("kind") != "penetration" or not has_numbers_to_use(diagnosis):
        return []
    numbers = {effect["id"]: effect["parameters"] for effect in diagnosis["effects"]}
    weak = [
        f"{name} = {number_words(entry)}"
        for own in numbers.values() for name, entry in own.items()
        if entry["std"] and entry.get("determined", True) and abs(entry["value"]) < (half_of(entry) or 0.0)
    ]  # fmt: skip
    return [say("neutral", listed=", ".join(weak))] if weak else []


def peak_sentences(diagnosis: Mapping[str, Any]) -> list[str]:
    """That the model is too low or too high where pushes are deepest, by more than chance; none where it is not."""
    words = bias_words(diagnosis.get("peaks"))
    return [] if words is None else [say("peaks_off", **words)]


def unloading_sentences(diagnosis: Mapping[str, Any]) -> list[str]:
    """The stiffness of unloading K (1 + u) in N/m, with the error of both and their correlation.

    None where u was not fitted, or K is of several diameters.
    """
    name, base = "plastic-sinkage.unload_stiffness", diagnosis["base"]["after"].get("stiffness")
    errors = diagnosis.get("errors", {})
    own = {effect["id"]: effect["parameters"] for effect in diagnosis["effects"]}.get("plastic-sinkage", {})
    u, names = own.get("unload_stiffness"), list(errors.get("names", []))
    if base is None or u is None or not u.get("determined", True) or {name, "stiffness"} - {*names}:
        return []
    places = [names.index("stiffness"), names.index(name)]
    slopes = [(1 + u["value"]) * errors["std"][places[0]], base["value"] * errors["std"][places[1]]]
    correlation = errors["correlation"][places[0]][places[1]]
    std = math.sqrt(max(slopes[0] ** 2 + slopes[1] ** 2 + 2 * correlation * slopes[0] * slopes[1], 0.0))
    stiffness = {"value": base["value"] * (1 + u["value"]), "std": std, "unit": "N/m"}
    # Both rest on the scatter of the same beds, and each on it by the root of their freedom over its own.
    shares = [slope**2 / math.sqrt(entry["freedom"]) for slope, entry in zip(slopes, (base, u), strict=True)
              if "freedom" in entry]  # fmt: skip
    if shares:
        stiffness["freedom"] = (sum(slope**2 for slope in slopes) / sum(shares)) ** 2
    return [say("unloading", stiffness=number_words(stiffness))]


def _correlated(errors: Mapping[str, Any]) -> list[str]:
    """The pairs of numbers that depend on one another most, with their correlation."""
    names, table = errors.get("names", []), errors.get("correlation", [])
    pairs = [(abs(table[j][k]), j, k) for k in range(len(names)) for j in range(k) if abs(table[j][k]) >= _STRONG]
    shown = sorted(pairs, reverse=True)[:_PAIRS]
    return [f"{names[j]} and {names[k]} ({table[j][k]:.2f})" for _, j, k in shown]


def _at(name: str) -> str:
    _, _, diameter = name.partition("@")
    return f" for {1e3 * float(diameter):g} mm of diameter" if diameter else ""


def near_model_sentences(diagnosis: Mapping[str, Any]) -> list[str]:
    """Which files have the models that trials do not exclude, and the command that predicts with them."""
    files = [row["file"] for row in diagnosis.get("near_models", [])]
    listed = " and ".join(filter(None, (", ".join(files[:-1]), *files[-1:])))
    return [say(f"near_models_{diagnosis['kind']}", files=listed, file=files[0])] if files else []
