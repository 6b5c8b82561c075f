"""Sentences and tables of a diagnosis: where the model fails, how large and how sure effects are, the candidates."""

import math
import re
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

from scipy.stats import beta

from experiments.diagnose.core.effect_texts import meaning
from experiments.diagnose.core.rivals import LEAD
from experiments.diagnose.core.search import further_gains
from experiments.diagnose.fit.gaps import numeral
from experiments.diagnose.fit.problem import Finding
from vis.diagnose.held_out import worsens_held_out
from vis.page.sentences import Sentences

__all__ = [
    "behind_words", "candidate_rows", "findings_in_words", "remark_sentences", "say",
    "setting_words", "shares_words",
    "size_sentences", "small_names", "sure_sentences", "told_tables", "unnamed_sentence",
    "where_sentences", "worse_sentences",
]  # fmt: skip

say = Sentences(__package__)

Row = Mapping[str, Any]

_MORE = 0.05  # nats by which a set of effects must beat each of its parts to be listed
_SETS = 4  # sets of effects that are listed beside the one that is named
_WORTH_SAYING = 1.0  # nats by which a candidate must beat what is named to be mentioned
_UNITS = {"N_m": "N m", "m_s2": "m/s2", "m_s": "m/s", "m": "m"}
_OTHER = 0.01  # relative difference from which on two settings are two
_SMALL_SHARE, _SMALL_BESIDE = 0.05, 0.2  # of the force, and of the largest signature, up to which an effect is small
_CARRIES = 0.2  # of the force where it is largest, from which on an effect is not called small
_STANDING = 2.0  # chi-square per sample of a platform that stands from which on it is explained
_WORSE_OF_ALL, _WORSE_CELL, _WORSE_SHOWN = 1.1, 1.5, 3
"""Factor from which a condition, and a channel in a phase, has got worse; how many of each are reported."""
_BOUND = 0.95  # confidence of the one-sided bound on a rate (Clopper and Pearson, Biometrika 26 (1934), 404)
_FEW = 20  # samples of a phase below which their number is stated
_MAINLY = 0.5  # share of what is beyond the noise from which a phase, a channel or a setting holds most of it


def where_sentences(diagnosis: Row) -> list[str]:
    """Where the base model fails, in one or two sentences; none where it does not."""
    places = diagnosis["where"]
    if not places:
        return []
    first = say("fails_most", phase=shares_words(places, "phase"), channel=shares_words(places, "channel"),
                first=places[0])  # fmt: skip
    settings = _settings(diagnosis)
    return [first, *([f"Per sample, most of it is at {settings}."] if settings else []), *_parted(diagnosis)]


def sure_sentences(diagnosis: Row) -> list[str]:
    """What is named, how sure that is against the nearest rival, and how it predicts the trials held out."""
    if diagnosis["verdict"] not in ("named", "ambiguous") or not diagnosis["effects"]:
        return []
    names = [effect["id"] for effect in diagnosis["effects"]]
    sentences = [words for name in names if (words := meaning(name))]
    best = next((row for row in diagnosis["evidence"] if set(row["effects"]) == set(names)), None)
    parts = [] if best is None else [f"{' + '.join(names)} is {best['score']:.0f} nats more likely than the base model"]
    before, after = (diagnosis["gap"][stage]["held_out"] for stage in ("before", "after"))
    if before is not None and "gap_with_scatter" not in diagnosis:  # else `scatter_sentence` has the gap that decides
        parts.append(f"on held-out trials it changes the gap from {numeral(before)} to {numeral(after)} "
                     "(1 is noise)")  # fmt: skip
    sure = f"Confidence: {'; '.join(parts)}" if parts else ""
    nearest = diagnosis.get("nearest_each", []) if len(names) > 1 else []
    if nearest:
        sure += say("nearest_answers", each="; ".join(map(_near_words, nearest)))
    elif rivals := diagnosis["equivalence"][1:]:
        near = min(rivals, key=lambda row: row.get("lead", row["evidence_behind"]))
        apart = "these trials distinguish the two" if near["told_apart"] else "these trials do not distinguish the two"
        if near.get("same_meaning"):
            apart = "at the fitted numbers both names mean the same"
        if sure:
            sure += f"; the nearest other name, {near['effect']}, is {behind_words(near)} ({LEAD:.0f} are needed), "
        sure += f"and its change of the data is {near['angle_deg']:.0f} degrees away (0: the same): {apart}"
    return [*sentences, *size_sentences(diagnosis), *([f"{sure}."] if sure else []),
            *_how_often(diagnosis), *unnamed_sentence(diagnosis)]  # fmt: skip


def _how_often(diagnosis: Row) -> list[str]:
    """How often a named verdict was right in the independent count of such campaigns, and what nats are."""
    if diagnosis["verdict"] != "named" or (counted := diagnosis.get("counted")) is None:
        return []
    count, soft = len(diagnosis["effects"]), counted.get("mujoco", {})
    key, row, other = ("how_often", counted, soft) if count == 1 else (
        "how_often_pairs", counted.get("pairs"), soft.get("pairs"))  # fmt: skip
    if row is None:
        return []
    too, more = say("of_mujoco", counted=other) if other else "", say("more_names") if count > 2 else ""
    return [say(key, of=say(f"of_{counted['of']}"), counted=row, pairs=row, too=too, more=more, least=_least(row))]


def _must_gain(own: Row) -> str:
    """The rule of the search for one name more than those of a candidate."""
    asked = further_gains()
    return say("must_gain", **asked, second=say("second_name", **asked) if len(own["effects"]) == 1 else "")


def _least(counted: Row) -> float:
    """The lower bound of a rate [%] of which `right` of `named` were counted."""
    return 100 * float(beta.ppf(1 - _BOUND, counted["right"], counted["named"] - counted["right"] + 1))


def behind_words(rival: Row) -> str:
    """33 nats behind; where prediction was compared, both numbers, since the larger of the two decides."""
    evidence, left_out = rival["evidence_behind"], rival.get("left_out_behind")
    if left_out is None:
        return f"{evidence:.0f} nats behind by evidence"
    return f"{evidence:.0f} nats behind by evidence and {left_out:.0f} in predicting conditions left out"


def _near_words(near: Row) -> str:
    """for depth-hardening: plastic-sinkage + layering, 4 nats behind by evidence"""
    return f"for {near['effect']}: {' + '.join(near['instead'])}, {behind_words(near)} ({_needed(near)})"


def _needed(near: Row) -> str:
    """What the rule for verdicts asks of this one."""
    if near["needed"] >= LEAD:
        return f"a first name needs {LEAD:.0f} in one of them"
    sure = max(near["evidence_behind"], near.get("left_out_behind") or 0.0) >= LEAD
    less = "" if sure else ", so it is the less certain one"
    return f"a further name needs a lead of {near['needed']:.0f} by evidence{less}"


def size_sentences(diagnosis: Row) -> list[str]:
    """How large each effect is, the largest first, in a sentence; what is small is called so."""
    sizes = diagnosis.get("sizes", [])
    if not sizes:
        return []
    most = max(size["signature"] for size in sizes)
    words = [_size_words(size, is_small=_is_small(size, most) and not _carries(size)) for size in sizes]
    own = [f"{size['effect']} {part}" for size in sizes if (part := _own_words(size.get("own_force")))]
    carries = f" In the fitted law {' and '.join(own)}." if own else ""
    if len(sizes) == 1:
        return [f"How large:{carries} {say('refitted_one', effect=sizes[0]['effect'])} {words[0]}."]
    each = "; ".join(f"without {size['effect']} {part}" for size, part in zip(sizes, words, strict=True))
    return [f"How large:{carries} {say('refitted')} {each}."]


def remark_sentences(diagnosis: Row) -> list[str]:
    """Which numbers are implausible."""
    return [f"Hard to believe: {remark.removesuffix('.')}." for remark in diagnosis.get("remarks", [])]


def worse_sentences(diagnosis: Row) -> list[str]:
    """Which conditions, phases and channels the best model explains less well than the base model, in a sentence. Empty
    where there are none, or where it is the base model. A cell counts where it is worse by half and past noise."""
    conditions = diagnosis.get("by_condition", [])
    common = _common(conditions)
    varied = [name for name in (conditions[0]["settings"] if conditions else ()) if name not in common]
    parts = []
    for row in _worst(conditions, _WORSE_OF_ALL):
        settings = ", ".join(setting_words(name, row["settings"][name]) for name in varied if name in row["settings"])
        trials = f"trial{'s' if len(row['trials']) > 1 else ''} {', '.join(row['trials'])}"
        parts.append(f"{trials}{f' ({settings})' if settings else ''} {_from_to(row)}")
    for row in _worst(diagnosis.get("by_phase", []), _WORSE_CELL):
        held = " of trials held out" if row["held_out"] else ""
        few = f" ({row['samples']} samples)" if row.get("samples", _FEW) < _FEW else ""
        parts.append(f"{row['channel']} in phase {row['phase']}{held}{few} {_from_to(row)}")
    return [f"It makes worse, by the gap: {'; '.join(parts)}."] if parts else []


def _common(conditions: Sequence[Row]) -> dict[str, float]:
    """The settings that all conditions share."""
    first = conditions[0]["settings"] if conditions else {}
    return {name: value for name, value in first.items()
            if all(row["settings"].get(name) == value for row in conditions)}  # fmt: skip


def _worst(rows: Sequence[Row], factor: float) -> list[Row]:
    """Those that grow by `factor` and are past noise and its chance then, three deviations of a mean square; at
    most three, by what is added over all samples."""
    grown = [row for row in rows if row["after"] > max(factor * row["before"], _STANDING, _by_chance(row))]
    return sorted(grown, key=lambda row: row["samples"] * (row["before"] - row["after"]))[:_WORSE_SHOWN]


def _by_chance(row: Row) -> float:
    return 1 + 3 * math.sqrt(2 / max(row.get("samples", _FEW), 1))


def _from_to(row: Row) -> str:
    return f"from {numeral(row['before'])} to {numeral(row['after'])}"


def small_names(diagnosis: Row) -> dict[str, str]:
    """Effects that are small beside another one, and how small: effect -> 0.1 % of the force."""
    sizes = diagnosis.get("sizes", [])
    if len(sizes) < 2:
        return {}
    most = max(size["signature"] for size in sizes)
    small = [s for s in sizes if s["signature"] < most and _is_small(s, most) and not _carries(s)]
    return {size["effect"]: _small_words(size) for size in small}


def _small_words(size: Row) -> str:
    """0.1 % of the force at 18 mm, where it is largest; or, of the whole channel, what no other number makes up for."""
    own = size.get("own_force")
    if own and own["force_N"]:
        share = abs(own["force_N"]) / max(abs(own["of_N"]), abs(own["force_N"]))
        return f"at most {100 * share:.2g} % of the force, at {1e3 * own['depth_m']:.3g} mm"
    if size["share"] is not None:
        return f"{100 * size['share']:.2g} % of the {size['channel']}"
    return f"{size['signature']:.2g} times the noise"


def _carries(size: Row) -> bool:
    """Whether an effect holds much of the force somewhere, although others may take its place."""
    own = size.get("own_force")
    return own is not None and abs(own["force_N"]) > _CARRIES * max(abs(own["of_N"]), abs(own["force_N"]))


def _is_small(size: Row, most: float) -> bool:
    share = size["share"]
    return (share is not None and share <= _SMALL_SHARE) or size["signature"] <= _SMALL_BESIDE * most


def _own_words(own: Row | None) -> str:
    """makes 10 N of the 24.3 N at a depth of 18 mm; empty where it has no force of its own."""
    if not own or not own["force_N"]:
        return ""
    verb = "adds" if own["force_N"] > 0 else "takes away"
    of = "leaving" if own["force_N"] < 0 else "to a total of"
    return f"{verb} {abs(own['force_N']):.3g} N at a depth of {1e3 * own['depth_m']:.3g} mm, {of} {own['of_N']:.3g} N"


def _size_words(size: Row, *, is_small: bool) -> str:
    """by 0.4 N in force (root mean square; 1.2 N at most), 21 % of it, 9 times the noise"""
    times = f"{numeral(size['signature'], 2)} times the noise"
    if size["channel"] is None:
        return "by nothing that can be seen"
    share = f", {100 * size['share']:.2g} % of it" if size["share"] is not None else ""
    return say("is_small" if is_small else "changes", size=size, share=share, times=times)


def _parted(diagnosis: Row) -> list[str]:
    """Which channel first leaves the base model, and when; and what a camera's zero at its end means."""
    sentences = []
    parted = [row for row in diagnosis.get("parted", []) if row["at_s"] >= 0]
    if parted:
        times = [
            min(row["at_s"] for row in parted if row["trial"] == trial) for trial in {row["trial"] for row in parted}
        ]
        first = min(parted, key=lambda row: row["at_s"])
        when = " to ".join(dict.fromkeys(f"{end(times):.3g}" for end in (min, max)))
        sentences.append(say("parts_at", when=when, first=first))
    standing = dict.fromkeys(
        row["channel"] for row in diagnosis.get("by_phase", []) if row["phase"] == "stand" and row["before"] > _STANDING
    )
    names = [name for name in standing if name in ("x", "y", "theta")]
    if names:
        felt = sorted(name for name in standing if name in ("ax", "ay"))
        are = "is" if len(felt) == 1 else "are"
        means = say("felt_standing", felt=" and ".join(felt), are=are) if felt else say("no_sign_standing")
        sentences.append(say("off_standing", names=", ".join(names)) + means)
    return sentences


def shares_words(places: Sequence[Row], key: str) -> str:
    """The largest shares of the excess up to `_MAINLY` of it, at most two."""
    total = sum(place["excess"] for place in places)
    sums: dict[str, float] = {}
    for place in places:
        sums[place[key]] = sums.get(place[key], 0.0) + place["excess"]
    ranked = sorted(sums.items(), key=lambda pair: -pair[1])
    shown = ranked[:1] if ranked[0][1] >= _MAINLY * total else ranked[:2]
    return " and ".join(f"{name} ({100 * value / total:.0f} %)" for name, value in shown)


def _settings(diagnosis: Row) -> str:
    """Values of settings at which a sample holds most of what is beyond the noise, where trials differ in them."""
    rows = [row for row in diagnosis.get("by_condition", []) if row["before"] > 1.0]
    shown = []
    for name in dict.fromkeys(name for row in rows for name in row["settings"]):
        beyond: dict[float, list[float]] = {}
        for row in diagnosis["by_condition"]:
            value = row["settings"].get(name)
            if value is not None:
                sums = beyond.setdefault(value, [0.0, 0.0])
                sums[0] += row["samples"]
                sums[1] += row["samples"] * max(row["before"] - 1.0, 0.0)
        means = {value: total / count for value, (count, total) in beyond.items()}
        value, most = max(means.items(), key=lambda pair: pair[1])
        share = most / max(sum(means.values()), 1e-300)
        if max(means) - min(means) > _OTHER * max(map(abs, means)) and share >= _MAINLY:
            shown.append(f"{setting_words(name, value)} ({100 * share:.0f} %)")
    return ", ".join(shown)


def setting_words(name: str, value: float) -> str:
    """torque_N_m, 0.22 as "torque 0.22 N m"."""
    unit = next((unit for unit in sorted(_UNITS, key=len, reverse=True) if name.endswith(f"_{unit}")), None)
    if unit is None:
        return f"{name.replace('_', ' ')} {value:.4g}"
    return f"{name.removesuffix(f'_{unit}').replace('_', ' ')} {value:.4g} {_UNITS[unit]}"


def told_tables(diagnosis: Row) -> list[dict[str, Any]]:
    """What the terminal shows: what is left by phase and channel, and the candidates, one form a set of effects."""
    tables = []
    if diagnosis["by_phase"] and diagnosis["verdict"] != "none":
        tables += _in_units(diagnosis)
        tables.append({
            "title": "gap by phase and channel", "head": ["phase", "channel", *_STAGES],
            "rows": _by_stage(diagnosis["by_phase"], ("phase", "channel"), ("before", "after"), numeral),
        })  # fmt: skip
    if aside := diagnosis.get("set_aside", []):
        tables.append({
            "title": "set aside, in none of the other tables: recorded less modelled, root mean square",
            "head": ["trial", "channel", "unit", "before", "after"],
            "rows": [[row["trial"], row["channel"], row["unit"],
                      *("-" if row[f"rms_{stage}"] is None else f"{row[f'rms_{stage}']:.3g}"
                        for stage in ("before", "after"))] for row in aside],
        })  # fmt: skip
    rows = candidate_rows(diagnosis)
    if rows:
        worse, better = no_better(rows), [row for row in rows if row["better"]]
        title = "candidates, the best form of each" + (f" ({worse})" if worse else "")
        tables.append({
            "title": title if better else say("none_better"),
            "head": ["candidate", "evidence over the base model [nats]", say("excess")],
            "rows": [[row["candidate"], f"{row['score']:.1f}", f"{row['left']:.3g}"] for row in better or rows],
        })  # fmt: skip
    return tables


_STAGES = ("fitted: before", "after", "held out: before", "after")


def _by_stage(
    rows: Sequence[Row], keys: tuple[str, str], stages: Sequence[str], written: Callable[[float], str]
) -> list[list[str]]:
    """A row for each pair of `keys`: the numbers of `stages`, fitted and then held out; - where there is none."""
    cells = {(row[keys[0]], row[keys[1]], row["held_out"]): row for row in rows}
    places = [(held, stage) for held in (False, True) for stage in stages]
    return [
        [*pair, *(written(cells[*pair, held][stage]) if (*pair, held) in cells else "-" for held, stage in places)]
        for pair in dict.fromkeys((first, second) for first, second, _ in cells)
    ]


def _in_units(diagnosis: Row) -> list[dict[str, Any]]:
    """The gap by channel in its unit, and by condition where there are several."""
    tables = []
    if channels := diagnosis.get("by_channel", []):
        tables.append({
            "title": say("in_units"),
            "head": ["channel", "unit", "fitted: before", "after", "noise", "held out: before", "after", "noise"],
            "rows": _by_stage(channels, ("channel", "unit"), ("rms_before", "rms_after", "noise_after"),
                              "{:.3g}".format),
        })  # fmt: skip
    conditions = diagnosis.get("by_condition", [])
    if len(conditions) > 1:
        common = _common(conditions)
        shared = ", ".join(setting_words(*pair) for pair in common.items())
        tables.append({
            "title": "gap by condition" + (f" ({shared} in all)" if shared else ""),
            "head": ["condition", "trials", "before", "after"],
            "rows": [[", ".join(setting_words(*pair) for pair in row["settings"].items() if pair[0] not in common)
                      or "the same", ", ".join(row["trials"]),
                      numeral(row["before"]), numeral(row["after"])] for row in conditions],
        })  # fmt: skip
    return tables


def findings_in_words(found: Sequence[Finding]) -> list[Finding]:
    """Findings whose sentences name their trial, what several channels of one sensor share as one."""
    groups: dict[tuple[str, float | None, float | None, str], list[Finding]] = {}
    for f in found:
        named = f if f.trial in f.what else replace(f, what=f"trial {f.trial}: {f.what}")
        pattern = re.sub(rf"\b{f.channel}\b", "*", named.what) if f.channel else named.what
        groups.setdefault((f.trial, f.from_s, f.to_s, pattern), []).append(named)
    merged = []
    for (_, _, _, pattern), alike in groups.items():
        names = ", ".join(f.channel for f in alike if f.channel)
        together = pattern.replace("*", names).replace(" has no ", " have no ")
        merged.append(replace(alike[0], what=together) if len(alike) > 1 else alike[0])
    return merged


def candidate_rows(diagnosis: Row) -> list[dict[str, Any]]:
    """``candidates`` of diagnosis.json: the best form of each effect, of what is named, and of the sets of effects that
    beat all of their parts. The likeliest come first, those no better than the base model last."""
    best: dict[frozenset[str], Row] = {}
    tried = Counter(frozenset(row["effects"]) for row in diagnosis.get("evidence", []))
    for row in diagnosis.get("evidence", []):
        names = frozenset(row["effects"])
        if names not in best or row["score"] > best[names]["score"]:
            best[names] = row
    alone = {name: row["score"] for names, row in best.items() for name in names if len(names) == 1}
    order = _named(diagnosis)
    named = frozenset(order)
    sets = [names for names, row in best.items()
            if len(names) > 1 and all(row["score"] > alone.get(name, 0.0) + _MORE for name in names)]  # fmt: skip
    sets.sort(key=lambda names: -best[names]["score"])
    shown = [names for names in best if len(names) == 1 or names == named or names in sets[:_SETS]]
    shown.sort(key=lambda names: -best[names]["score"])
    base = diagnosis.get("evidence_base", {}).get("left")

    def left(row: Row) -> float | None:
        """At amplitude 0 every form is the base model, which was fitted once more after the candidates."""
        return min(row["left"], base) if "left" in row and base is not None else row.get("left")

    return [
        {"candidate": _written(best[names], alone, order), "effects": _ordered(names, alone, order),
         "score": best[names]["score"], "left": left(best[names]), "closes": best[names].get("closes"),
         "tried": tried[names], "better": best[names]["score"] > 0, "note": _note(diagnosis, names, best, named)}
        for names in shown
    ]  # fmt: skip


def no_better(rows: Sequence[Row]) -> str:
    """The effects that are no better than the base model, as a clause; empty where all are."""
    names = [" + ".join(row["effects"]) for row in rows if not row["better"]]
    return f"no better than the base model with its parameters fitted: {', '.join(names)}" if names else ""


def unnamed_sentence(diagnosis: Row) -> list[str]:
    """A candidate that is likelier than what is named: which, and why it is not named."""
    rows = candidate_rows(diagnosis)
    own = next((row for row in rows if {*row["effects"]} == {*_named(diagnosis)}), None)
    ahead = [row for row in rows if own is not None and row["score"] > own["score"] + _WORTH_SAYING and row["note"]]
    if own is None or not ahead:
        return []
    row = ahead[0]
    what = "is not named" if diagnosis["effects"] else "does not lead"
    names, ours = (" + ".join(one["effects"]) for one in (row, own))
    return [say("most_evidence", names=names, more=row["score"] - own["score"], own=ours, what=what, row=row)]


def _named(diagnosis: Row) -> tuple[str, ...]:
    """The effects that are named, or of an unknown the best model's, in order."""
    names = tuple(effect["id"] for effect in diagnosis.get("effects", ()))
    leading = tuple(diagnosis.get("leading", {}).get("effects", ()))
    return leading if diagnosis["verdict"] == "unknown" and leading else names


def _ordered(names: frozenset[str], alone: Mapping[str, float], named: Sequence[str]) -> list[str]:
    """What is named first, then those that explain most alone."""
    place = {name: k for k, name in enumerate(named)}
    return sorted(names, key=lambda name: (place.get(name, len(place)), -alone.get(name, -1e300), name))


def _written(row: Row, alone: Mapping[str, float], named: Sequence[str]) -> str:
    """``a:one + two + b:three``: effects in order, each once, with its forms."""
    forms: dict[str, list[str]] = {}
    for part in row.get("candidate", " + ".join(row["effects"])).split(" + "):
        effect, _, form = part.partition(":")
        forms.setdefault(effect, []).append(form)
    order = _ordered(frozenset(forms), alone, named)
    return " + ".join(f"{effect}:{' + '.join(forms[effect])}".removesuffix(":") for effect in order)


def _note(diagnosis: Row, names: frozenset[str], best: Mapping[frozenset[str], Row], named: frozenset[str]) -> str:
    """How a candidate relates to the one that is named; of one that is likelier, why it is not named."""
    if names == named and worsens_held_out(diagnosis):
        return "predicts held-out trials worse than the base model"
    if names == named:
        return {"named": "named", "ambiguous": "named, or another"}.get(diagnosis["verdict"], "leads")
    if not named or named not in best:
        return ""
    rest = _named(diagnosis)[1:]
    if diagnosis["verdict"] == "ambiguous" and any(names == {other, *rest} for other in diagnosis["alternatives"]):
        return "cannot be distinguished from it"
    own, row = best[named], best[names]
    more = row["score"] - own["score"]
    if more <= 0:
        return ""
    together = " + ".join(_named(diagnosis))
    if names > named or len(names) > len(named):
        if diagnosis.get("gate", {}).get("after", {}).get("passed"):
            return f"is not needed: {together} leaves no more than noise"
        left, whole = own.get("left") or 0.0, diagnosis.get("evidence_base", {}).get("left") or 0.0
        if left <= 0:
            return f"fits noise: {together} leaves no more than that"
        what = "a further name" if names > named else f"{len(names)} names in the place of {together}"
        share = f"{100 * (left - row['left']) / left:.0f} % of what {together} leaves"
        of_base = f", {100 * (left - row['left']) / whole:.2g} % of what the base model leaves" if whole > 0 else ""
        return f"gains {more:.1f} nats, {share}{of_base}: less than {what} must gain ({_must_gain(own)})"
    other = next((r for r in diagnosis.get("equivalence", [])[1:] if r["effect"] in names - named), None)
    if other is not None and (other.get("left_out_behind") or 0.0) > 0:
        return f"predicts left-out conditions worse, by {other['left_out_behind']:.0f} nats"
    return "is not confirmed when noise and names are fitted together"
