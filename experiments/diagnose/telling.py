"""What a diagnosis says to a person: what is left by phase and channel, and in which settings the model fails."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from .problem import Array, Finding

__all__ = ["PhaseTable", "findings_in_words", "told_tables", "setting_words", "where_sentences"]

_UNITS = {"N_m": "N m", "m_s2": "m/s2", "m_s": "m/s", "m": "m"}
_OTHER = 0.01
"""Relative difference from which on two settings are two."""
_MORE = 0.05
"""Nats by which a set of names must beat each of its parts to be listed."""
_MAINLY = 0.5
"""Share of what is beyond the noise from which on a phase, a channel or a setting is said to hold it."""


class PhaseTable:
    """Chi-square per sample by phase and channel, of fitted and of held-out trials, gathered trial by trial."""

    def __init__(self) -> None:
        self._sums: dict[tuple[str, str, bool], list[float]] = {}

    def add(self, channel: str, phases: np.ndarray, before: Array, after: Array, *, held_out: bool) -> None:
        """One channel of one trial: the phase, and the residuals over the noise of both models, shapes [n]."""
        for phase in dict.fromkeys(phases.tolist()):
            own = phases == phase
            sums = self._sums.setdefault((str(phase), channel, held_out), [0.0, 0.0, 0.0])
            sums[0] += int(own.sum())
            sums[1] += float(before[own] @ before[own])
            sums[2] += float(after[own] @ after[own])

    @property
    def rows(self) -> list[dict[str, Any]]:
        """``by_phase`` of diagnosis.json."""
        return [
            {"phase": phase, "channel": channel, "held_out": held_out, "samples": int(count), "before": before / count,
             "after": after / count}
            for (phase, channel, held_out), (count, before, after) in sorted(self._sums.items())
        ]  # fmt: skip


def where_sentences(said: Mapping[str, Any]) -> list[str]:
    """Where the base model fails, in one or two sentences; none where it does not."""
    places = said["where"]
    if not places:
        return []
    total = sum(place["excess"] for place in places)
    phase, channel = (_shares(places, key, total) for key in ("phase", "channel"))
    first = places[0]
    said_first = (
        f"The base model fails most in phase {phase} and channel {channel}, shares of the chi-square beyond the "
        f"noise; its worst stretch is {first['channel']} of trial {first['trial']} from {first['from_s']:.4g} to "
        f"{first['to_s']:.4g} s."
    )
    settings = _settings(places, total)
    return [said_first, *([f"Most of it is at {settings}."] if settings else [])]


def _shares(places: Sequence[Mapping[str, Any]], key: str, total: float) -> str:
    """The largest shares up to `_MAINLY` of it all, at most two."""
    sums: dict[str, float] = {}
    for place in places:
        sums[place[key]] = sums.get(place[key], 0.0) + place["excess"]
    ranked = sorted(sums.items(), key=lambda pair: -pair[1])
    shown = ranked[:1] if ranked[0][1] >= _MAINLY * total else ranked[:2]
    return " and ".join(f"{name} ({100 * value / total:.0f} %)" for name, value in shown)


def _settings(places: Sequence[Mapping[str, Any]], total: float) -> str:
    """Values of settings that hold most of what is beyond the noise, where trials differ in them."""
    names = dict.fromkeys(name for place in places for name in place.get("settings", {}))
    shown = []
    for name in names:
        sums: dict[float, float] = {}
        for place in places:
            value = place.get("settings", {}).get(name)
            if value is not None:
                sums[value] = sums.get(value, 0.0) + place["excess"]
        value, most = max(sums.items(), key=lambda pair: pair[1])
        if max(sums) - min(sums) > _OTHER * max(map(abs, sums)) and most >= _MAINLY * total:
            shown.append(f"{setting_words(name, value)} ({100 * most / total:.0f} %)")
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
            return "-" if row is None else f"{row[stage]:.3g}"

        tables.append({
            "title": "chi-square per sample by phase and channel",
            "head": ["phase", "channel", "fitted: before", "after", "held out: before", "after"],
            "rows": [[*key, *(shown(key, held, stage) for held in (False, True) for stage in ("before", "after"))]
                     for key in keys],
        })  # fmt: skip
    best: dict[tuple[str, ...], Mapping[str, Any]] = {}
    for row in said["evidence"]:
        best.setdefault(tuple(sorted(row["effects"])), row)
    singles = [row for names, row in best.items() if len(names) == 1]
    alone = {names[0]: row["score"] for names, row in best.items() if len(names) == 1}
    sets = [row for names, row in best.items()
            if len(names) > 1 and all(row["score"] > alone.get(name, 0.0) + _MORE for name in names)][:2]  # fmt: skip
    chosen = [row for row in best.values() if row in singles or row in sets]
    if chosen:
        tables.append({
            "title": "candidates, the best form of each",
            "head": ["candidate", "evidence over the base model [nats]", "excess a sample"],
            "rows": [[row["candidate"], f"{row['score']:.1f}", f"{row['left']:.3g}"] for row in chosen],
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
