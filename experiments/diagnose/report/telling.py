"""What a diagnosis says to a person: what is left by phase and channel, and in which settings the model fails."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from experiments.diagnose.core.effect_texts import meaning
from experiments.diagnose.fit.gaps import numeral
from experiments.diagnose.fit.problem import Array, Finding

from .candidates import candidate_rows, no_better, say, unnamed_sentence

__all__ = [
    "PhaseTable", "findings_in_words", "remark_sentences", "setting_words", "shares_words", "size_sentences",
    "small_names", "sure_sentences", "told_tables", "valid_residuals", "where_sentences", "worse_sentences",
]  # fmt: skip

_UNITS = {"N_m": "N m", "m_s2": "m/s2", "m_s": "m/s", "m": "m"}
_OTHER = 0.01  # relative difference from which on two settings are two
_SMALL_SHARE, _SMALL_BESIDE = 0.05, 0.2
"""Share of the force up to which an effect is called small, and of the largest one's signature."""
_STANDING = 2.0  # chi-square per sample of a platform that stands from which on it is explained
_WORSE_OF_ALL, _WORSE_CELL, _TOLD_WORSE = 1.1, 1.5, 3
"""Factor from which on a condition, and a channel in a phase, is said to have got worse; how many of each are said."""
_MAINLY = 0.5  # share of what is beyond the noise from which on a phase, a channel or a setting is said to hold it


class PhaseTable:
    """Chi-square per sample by phase and channel, of fitted and of held-out trials, gathered trial by trial."""

    def __init__(self) -> None:
        self._sums: dict[tuple[str, str, bool], list[float]] = {}

    def add(self, channel: str, phases: np.ndarray, before: Array, after: Array, *, held_out: bool) -> None:
        """One channel of one trial: the phase, and the residuals over the noise of both models, shapes [n]; NaN where a
        reading counts for nothing beside that model (`valid_residuals`), as it does in the gap."""
        for phase in dict.fromkeys(phases.tolist()):
            own = phases == phase
            sums = self._sums.setdefault((str(phase), channel, held_out), [0.0, 0.0, 0.0, 0.0])
            for at, rest in ((0, before[own]), (2, after[own])):
                counted = rest[~np.isnan(rest)]
                sums[at] += len(counted)
                sums[at + 1] += float(counted @ counted)

    @property
    def rows(self) -> list[dict[str, Any]]:
        """``by_phase`` of diagnosis.json; without cells in which no reading counts."""
        return [
            {"phase": phase, "channel": channel, "held_out": held_out, "samples": int(count), "before": before / count,
             "after": after / count_after}
            for (phase, channel, held_out), (count, before, count_after, after) in sorted(self._sums.items())
            if count and count_after
        ]  # fmt: skip


def valid_residuals(rest: Array, std: Array) -> Array:
    """Residuals over the noise, NaN where the noise is endless: a reading taken while a contact switched."""
    return np.where(np.isinf(std), np.nan, rest / std)


def where_sentences(said: Mapping[str, Any]) -> list[str]:
    """Where the base model fails, in one or two sentences; none where it does not."""
    places = said["where"]
    if not places:
        return []
    total = sum(place["excess"] for place in places)
    phase, channel = (shares_words(places, key, total) for key in ("phase", "channel"))
    first = places[0]
    said_first = say("fails_most", phase=phase, channel=channel, first=first)
    settings = _settings(said)
    return [said_first, *([f"Sample for sample most of it is at {settings}."] if settings else []), *_parted(said)]


def sure_sentences(said: Mapping[str, Any]) -> list[str]:
    """What is named, how sure that is against the nearest rival, and what it does to the trials held out."""
    if said["verdict"] not in ("named", "ambiguous") or not said["effects"]:
        return []
    sentences = [words for effect in said["effects"] if (words := meaning(effect["id"]))]
    name = " + ".join(effect["id"] for effect in said["effects"])
    own = {effect["id"] for effect in said["effects"]}
    best = next((row for row in said["evidence"] if set(row["effects"]) == own), None)
    sure = f"How sure: {name} is {best['score']:.0f} nats likelier than the base model" if best is not None else ""
    gap = said["gap"]
    if gap["before"]["held_out"] is not None:
        out = f"on the trials that took no part it takes the gap from {numeral(gap['before']['held_out'])} to "
        out += f"{numeral(gap['after']['held_out'])} (1 is noise)"
        sure += f"; {out}" if sure else f"How sure: {out}"
    rivals = said["equivalence"][1:]
    if rivals:
        near = min(rivals, key=lambda row: row["evidence_behind"])
        apart = "these trials tell the two apart" if near["told_apart"] else "these trials do not tell the two apart"
        sure += (
            f"; the nearest other name, {near['effect']}, is {near['evidence_behind']:.0f} nats behind, "
            if sure
            else ""
        )
        sure += f"{near['angle_deg']:.0f} degrees away in what it changes (0: the same): {apart}"
    return [*sentences, *size_sentences(said), *remark_sentences(said), *([f"{sure}."] if sure else []),
            *unnamed_sentence(said)]  # fmt: skip


def size_sentences(said: Mapping[str, Any]) -> list[str]:
    """How large each effect is, the largest first, in a sentence; what is small is called so."""
    sizes = said.get("sizes", [])
    if not sizes:
        return []
    most = max(size["signature"] for size in sizes)
    told = [_size_words(size, is_small=_is_small(size, most)) for size in sizes]
    return [f"How large: {'; '.join(told)}."]


def remark_sentences(said: Mapping[str, Any]) -> list[str]:
    """What of the numbers is hard to believe."""
    return [f"Hard to believe: {remark}." for remark in said.get("remarks", [])]


def worse_sentences(said: Mapping[str, Any]) -> list[str]:
    """Which conditions, phases and channels the best model explains less well than the base model, in a sentence; none
    where there are none, or where it is the base model. A cell counts where it is worse by half and past noise."""
    conditions = said.get("by_condition", [])
    first = conditions[0]["settings"] if conditions else {}
    varied = [name for name in first if any(row["settings"].get(name) != first[name] for row in conditions)]
    told = []
    for row in _worst(conditions, _WORSE_OF_ALL):
        settings = ", ".join(setting_words(name, row["settings"][name]) for name in varied if name in row["settings"])
        trials = f"trial{'s' if len(row['trials']) > 1 else ''} {', '.join(row['trials'])}"
        told.append(f"{trials}{f' ({settings})' if settings else ''} {_from_to(row)}")
    for row in _worst(said.get("by_phase", []), _WORSE_CELL):
        held = " of trials held out" if row["held_out"] else ""
        told.append(f"{row['channel']} in phase {row['phase']}{held} {_from_to(row)}")
    return [f"It makes worse, in chi-square per sample: {'; '.join(told)}."] if told else []


def _worst(rows: Sequence[Mapping[str, Any]], factor: float) -> list[Mapping[str, Any]]:
    """Those that grow by `factor` and are past noise then, at most three, by what is added over all samples."""
    grown = [row for row in rows if row["after"] > max(factor * row["before"], _STANDING)]
    return sorted(grown, key=lambda row: row["samples"] * (row["before"] - row["after"]))[:_TOLD_WORSE]


def _from_to(row: Mapping[str, Any]) -> str:
    return f"from {numeral(row['before'])} to {numeral(row['after'])}"


def small_names(said: Mapping[str, Any]) -> dict[str, str]:
    """Names that are small beside another one that is told, and how small: name -> 0.1 % of the force."""
    sizes = said.get("sizes", [])
    if len(sizes) < 2:
        return {}
    most = max(size["signature"] for size in sizes)
    return {
        size["effect"]: f"{100 * size['share']:.2g} % of the {size['channel']}" if size["share"] is not None
        else f"{size['signature']:.2g} times the noise"
        for size in sizes if size["signature"] < most and _is_small(size, most)
    }  # fmt: skip


def _is_small(size: Mapping[str, Any], most: float) -> bool:
    share = size["share"]
    return (share is not None and share <= _SMALL_SHARE) or size["signature"] <= _SMALL_BESIDE * most


def _size_words(size: Mapping[str, Any], *, is_small: bool) -> str:
    """shaft-friction changes the force by 0.4 N (root mean square, 1.2 N at most), 21 % of it, 9 times the noise"""
    times = f"{numeral(size['signature'], 2)} times the noise of all readings"
    if size["channel"] is None:
        return f"{size['effect']} changes nothing that can be seen"
    share = f", {100 * size['share']:.2g} % of it" if size["share"] is not None else ""
    if is_small:
        return say("is_small", size=size, share=share, times=times)
    return say("changes", size=size, share=share, times=times)


def _parted(said: Mapping[str, Any]) -> list[str]:
    """Which channel first parts from the base model, and when; and what a camera's zero at its end means."""
    sentences = []
    parted = [row for row in said.get("parted", []) if row["at_s"] >= 0]
    if parted:
        times = [min(row["at_s"] for row in parted if row["trial"] == trial)
                 for trial in dict.fromkeys(row["trial"] for row in parted)]  # fmt: skip
        first = min(parted, key=lambda row: row["at_s"])
        sentences.append(say("parts_at", first_s=min(times), last_s=max(times), first=first))
    standing = [row for row in said.get("by_phase", []) if row["phase"] == "stand" and row["before"] > _STANDING
                and row["channel"] in ("x", "y", "theta")]  # fmt: skip
    if standing:
        names = ", ".join(dict.fromkeys(row["channel"] for row in standing))
        felt = sorted({row["channel"] for row in said["by_phase"] if row["phase"] == "stand"
                       and row["before"] > _STANDING and row["channel"] in ("ax", "ay")})  # fmt: skip
        means = say("felt_standing", felt=" and ".join(felt), are=_is_off(felt)) if felt else say("no_sign_standing")
        sentences.append(say("off_standing", names=names) + means)
    return sentences


def _is_off(names: Sequence[str]) -> str:
    return "is" if len(names) == 1 else "are"


def shares_words(places: Sequence[Mapping[str, Any]], key: str, total: float) -> str:
    """The largest shares up to `_MAINLY` of it all, at most two."""
    sums: dict[str, float] = {}
    for place in places:
        sums[place[key]] = sums.get(place[key], 0.0) + place["excess"]
    ranked = sorted(sums.items(), key=lambda pair: -pair[1])
    shown = ranked[:1] if ranked[0][1] >= _MAINLY * total else ranked[:2]
    return " and ".join(f"{name} ({100 * value / total:.0f} %)" for name, value in shown)


def _settings(said: Mapping[str, Any]) -> str:
    """Values of settings at which a sample holds most of what is beyond the noise, where trials differ in them."""
    rows = [row for row in said.get("by_condition", []) if row["before"] > 1.0]
    names = dict.fromkeys(name for row in rows for name in row["settings"])
    shown = []
    for name in names:
        beyond: dict[float, list[float]] = {}
        for row in said["by_condition"]:
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


def told_tables(said: Mapping[str, Any]) -> list[dict[str, Any]]:
    """What the terminal shows: what is left by phase and channel, and the candidates, one form a set of names."""
    tables = []
    rows = said["by_phase"]
    if rows and said["verdict"] != "none":
        keys = dict.fromkeys((row["phase"], row["channel"]) for row in rows)
        cells = {(row["phase"], row["channel"], row["held_out"]): row for row in rows}

        def shown(key: tuple[str, str], held_out: bool, stage: str) -> str:
            row = cells.get((*key, held_out))
            return "-" if row is None else numeral(row[stage])

        tables += _in_units(said)
        tables.append({
            "title": "chi-square per sample by phase and channel",
            "head": ["phase", "channel", "fitted: before", "after", "held out: before", "after"],
            "rows": [[*key, *(shown(key, held, stage) for held in (False, True) for stage in ("before", "after"))]
                     for key in keys],
        })  # fmt: skip
    rows = candidate_rows(said)
    if rows:
        worse = no_better(rows)
        tables.append({
            "title": "candidates, the best form of each" + (f" ({worse})" if worse else ""),
            "head": ["candidate", "evidence over the base model [nats]", "chi-square a sample beyond noise"],
            "rows": [[row["candidate"], f"{row['score']:.1f}", f"{row['left']:.3g}"] for row in rows if row["better"]],
        })  # fmt: skip
    return tables


def _in_units(said: Mapping[str, Any]) -> list[dict[str, Any]]:
    """The gap by channel in its unit, and by condition where there are several."""
    tables = []
    channels = said.get("by_channel", [])
    if channels:
        cells = {(row["channel"], row["held_out"]): row for row in channels}
        names = list(dict.fromkeys((row["channel"], row["unit"]) for row in channels))

        def rms(name: str, held: bool, stage: str) -> str:
            row = cells.get((name, held))
            return "-" if row is None else f"{row[f'rms_{stage}']:.3g}"

        tables.append({
            "title": "measured less modelled, root mean square (after: with the sensors' noise)",
            "head": ["channel", "unit", "fitted: before", "after", "held out: before", "after"],
            "rows": [[name, unit, *(rms(name, held, stage) for held in (False, True) for stage in ("before", "after"))]
                     for name, unit in names],
        })  # fmt: skip
    conditions = said.get("by_condition", [])
    if len(conditions) > 1:
        first = conditions[0]["settings"]
        common = {name for name in first if all(row["settings"].get(name) == first[name] for row in conditions)}
        shared = ", ".join(setting_words(name, first[name]) for name in first if name in common)
        tables.append({
            "title": "chi-square per sample by condition" + (f" ({shared} in all)" if shared else ""),
            "head": ["condition", "trials", "before", "after"],
            "rows": [[", ".join(setting_words(*pair) for pair in row["settings"].items() if pair[0] not in common)
                      or "the same", ", ".join(row["trials"]),
                      numeral(row["before"]), numeral(row["after"])] for row in conditions],
        })  # fmt: skip
    return tables


def findings_in_words(found: Sequence[Finding]) -> list[Finding]:
    """Findings whose sentences name their trial, what several channels of one sensor share as one."""
    return _merged([_named(finding) for finding in found])


def _named(finding: Finding) -> Finding:
    """With the trial in its sentence."""
    what = finding.what if finding.trial in finding.what else f"trial {finding.trial}: {finding.what}"
    return replace(finding, what=what)


def _merged(found: list[Finding]) -> list[Finding]:
    """What is the same of several channels of one sensor as one finding."""
    groups: dict[tuple[str, float | None, float | None, str], list[Finding]] = {}
    for f in found:
        pattern = re.sub(rf"\b{f.channel}\b", "*", f.what) if f.channel else f.what
        groups.setdefault((f.trial, f.from_s, f.to_s, pattern), []).append(f)
    merged = []
    for (_, _, _, pattern), alike in groups.items():
        names = [f.channel for f in alike if f.channel]
        together = pattern.replace("*", ", ".join(names)).replace(" has no ", " have no ")
        said = together if len(alike) > 1 else alike[0].what
        merged.append(replace(alike[0], what=said))
    return merged
