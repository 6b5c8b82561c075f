"""Tables and sentences of a comparison of laws."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict

from experiments.runs.types import Json

from .data import Data
from .settings import LawFitSettings, say
from .trust import paired

__all__ = ["beyond_rows", "cell_rows", "closing", "ends_of", "error_of", "law_rows", "ranked"]

SAME = 1.01
"""Held-out errors within this factor of the least are the same; of such laws that with fewer parameters goes first."""


def ranked(laws: Sequence[Json]) -> list[Json]:
    """The laws, that with the least held-out error first; each gets how much it is above the first in the same beds."""
    least = min(law["held_out"]["beds"] for law in laws)

    def place(law: Json) -> tuple[int, float]:
        error = law["held_out"]["beds"]
        return len(law["parameters"]) if error <= SAME * least else 1000, error

    best, *others = sorted(laws, key=place)
    for law in (best, *others):
        law["above_best"] = asdict(paired(law["held_out"]["of_beds"], best["held_out"]["of_beds"]))
    return [best, *others]


def law_rows(laws: Sequence[Json]) -> Json:
    """Head and rows of the table of laws, in the order of their held-out error."""
    rows = []
    for law in laws:
        own, other, above = law["held_out"], law["held_out"]["speeds"], law["above_best"]
        sunk = ", ".join(f"{100 * one['error']:+.3g} % ({ends_of(one['interval'])})" for one in law["sinkage"]) or "-"
        rows.append([
            law["name"], f"{100 * own['beds']:.3g} % ({ends_of(own['interval'])})",
            "-" if law is laws[0] else f"{100 * above['value']:+.2g} ± {50 * (above['high'] - above['low']):.2g} %",
            "-" if other is None else f"{100 * other:.3g} %", sunk,
        ])  # fmt: skip
    head = [say(key) for key in ("head_law", "head_beds", "head_above", "head_speeds", "head_sinkage")]
    return {"head": head, "rows": rows}


def ends_of(ends: Sequence[float] | None) -> str:
    """Both ends of an interval in per cent."""
    return "-" if ends is None else " to ".join(f"{100 * end:.3g}" for end in ends)


def closing(settings: LawFitSettings, data: Data, laws: Mapping[str, Json], best: str) -> tuple[list[str], list[str]]:
    """What a reviewer asks: where the spring-damper holds and how wrong it is beyond; and which law is better."""
    pair, winner = laws["spring-damper"], laws[best]
    said = [say("holds", where=text) for text in _where(settings, pair)]
    if pair["sinkage_range"] is not None:
        low, high = pair["sinkage_range"]
        said.append(say("sinkage_holds", percent=100 * settings.sinkage_error, low=low, high=high))
    said += [say(f"beyond_{kind}", **_of_beyond(one)) for kind, one in pair["beyond"].items()]
    rest = [_of_sinkage(one) for one in pair["sinkage"]]
    own, theirs = (law["held_out"] for law in (pair, winner))
    gap = pair["above_best"]
    numbers = {
        "best": best, "own": 100 * own["beds"], "theirs": 100 * theirs["beds"], "std": 100 * own["beds_std"],
        "gap": 100 * gap["value"], "half": 50 * (gap["high"] - gap["low"]),
    }  # fmt: skip
    key = "pair_best" if winner is pair else "better" if gap["low"] > 0 else "alike"
    return said, [*rest, say(key, **numbers)]


def _of_beyond(one: Json) -> Json:
    scale = {name: one[name] for name in ("left_out", "fitted_to")}
    millimetres = {f"{name}_mm": 1e3 * value for name, value in scale.items()}
    return scale | millimetres | {"rms": 100 * one["rms"], "off": _off(one["error"])}


def beyond_rows(cells: Mapping[str, Sequence[Json]]) -> Json:
    """Head and rows of the table of errors beyond the runs; `cells`: name -> its laws."""
    rows = []
    for cell, laws in cells.items():
        for law in laws:
            found = [law["beyond"].get(kind) for kind in ("speed", "depth")]
            if any(found):
                texts = ["-" if one is None else error_of(one["error"], one["interval"]) for one in found]
                rows.append([*([cell] if len(cells) > 1 else []), law["name"], *texts])
    keys = (*(["head_cell"] if len(cells) > 1 else []), "head_law", "head_faster", "head_deeper")
    return {"head": [say(key) for key in keys], "rows": rows}


def cell_rows(cells: Mapping[str, Sequence[Json]]) -> Json:
    """Head and rows of the table of tips and gravities: K and C of each with their 90 % intervals, and its best law."""
    rows = []
    for cell, laws in cells.items():
        pair = next(law for law in laws if law["name"] == "spring-damper")
        found = [pair["parameters"][name] for name in ("stiffness", "damping")]
        texts = [f"{one['value']:.3g} ({one['low']:.3g} to {one['high']:.3g})" for one in found]
        out = pair["held_out"]
        rows.append([cell, *texts, f"{100 * out['beds']:.3g} % ({ends_of(out['interval'])})", laws[0]["name"]])
    head = ("head_cell", "head_stiffness", "head_damping", "head_beds", "head_best")
    return {"head": [say(key) for key in head], "rows": rows}


def error_of(value: float, ends: Sequence[float] | None) -> str:
    """An error in per cent with its interval."""
    return f"{100 * value:+.3g} % ({ends_of(ends)})"


def _where(settings: LawFitSettings, pair: Json) -> list[str]:
    """For each speed where the pair is within the error, and its error at both ends of the depth."""
    texts = []
    for one in pair["within"]:
        ends = {"start": _off(one["at_start"]), "end": _off(one["at_end"])}
        depths = pair["map"]["depth"]
        shallow, deep = (f"{1e3 * depths[place]:.2g}" for place in (0, -1))
        percent = 100 * settings.force_error
        if one["high"] > one["low"]:
            low, high = 1e3 * one["low"], 1e3 * one["high"]
            texts.append(say("within", speed=one["speed"], percent=percent, low=low, high=high, shallow=shallow,
                             deep=deep, **ends))  # fmt: skip
        else:
            texts.append(say("nowhere", speed=one["speed"], percent=percent, shallow=shallow, deep=deep, **ends))
    return texts


def _off(error: float) -> str:
    return f"{100 * abs(error):.{2 if abs(error) < 1 else 3}g} % too {'stiff' if error > 0 else 'soft'}"


def _of_sinkage(one: Json) -> str:
    std = "" if one["beds_std"] is None else f" (std between beds {1e3 * one['beds_std']:.2g} mm)"
    about = {"beds": 1e3 * one["beds"], "law": 1e3 * one["law"], "error": 100 * one["error"], "rms": 100 * one["rms"]}
    return say("sinkage", one=one, std=std, **about)
