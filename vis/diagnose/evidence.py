"""The figure of candidates: the evidence for each set of names, and what it leaves."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import LogLocator, NullLocator

from vis.diagnose.figures import BASE, NARROW, plain_numbers
from vis.diagnose.held_out import worsens_held_out
from vis.page.plots import AMENDED, DASHED, GREY, INK, MODEL, handle, legend_above, sheet
from vis.page.report import Result

__all__ = ["closed_share", "draw_evidence"]

_MOST_BARS = 14


def draw_evidence(diagnosis: Result) -> Figure | None:
    """Bars of evidence, and what each candidate leaves: the best form of each single name, and the best sets of names
    that beat all of their parts."""
    best: dict[tuple[str, ...], Result] = {}
    orders: dict[frozenset[str], tuple[str, ...]] = {}  # one set of names, in whatever order they were added
    for row in (*diagnosis.get("candidates", []), *diagnosis.get("evidence", [])):
        best.setdefault(orders.setdefault(frozenset(row["effects"]), tuple(row["effects"])), row)
    if not best:
        return None
    score = {names: float(row["score"]) for names, row in best.items()}
    leading = _leading_names(diagnosis, score)
    leading = orders.get(frozenset(leading), leading)
    singles = [names for names in best if len(names) == 1]
    sets = [
        names
        for names in best
        if len(names) > 1 and all(score[names] > score.get((name,), -math.inf) + 0.05 for name in names)
    ]
    names = sorted({*singles, *sets[:5], *([leading] if leading in best else [])}, key=lambda n: (score[n], -len(n)))
    names = names[-_MOST_BARS:]
    drawing, ((axis, beside),) = sheet(1, 2, 1.3 + 0.27 * len(names), sharey=True, width_ratios=(3, 2))
    kinds = {name: _kind(name, leading, diagnosis) for name in names}
    colours = {name: _KINDS[kinds[name]] for name in names}
    places = range(len(names))
    axis.barh(places, [score[name] for name in names], color=[colours[n] for n in names], height=0.66)
    most = max(*(score[name] for name in names), 1.0)
    for place, name in enumerate(names):
        number = f"{score[name]:z.1f}" if abs(score[name]) < 10 else f"{score[name]:.0f}"
        axis.annotate(number,
                      (max(score[name], 0.0), place), xytext=(3, 0), textcoords="offset points", va="center",
                      fontsize=7.5, color=INK)  # fmt: skip
        axis.annotate(_why_not(best[name]), (score[name], place), xytext=(-4, 0), textcoords="offset points",
                      va="center", ha="right", fontsize=7.5, color=INK)  # fmt: skip
    least = min(score[name] for name in names)  # one that is far off does not press the others together
    axis.set_xlim(max(1.1 * least, -0.3 * most) if least < 0 else 0.0, 1.12 * most)
    axis.axvline(0.0, color=INK, lw=0.9)
    axis.set_yticks(places, [" + ".join(name) for name in names])
    axis.grid(False, axis="y")
    axis.set_xlabel("log evidence over the base model [nats]\n(left of 0: not worth its parameters)")
    _draw_left(beside, [best[name] for name in names], [colours[name] for name in names], diagnosis)
    shown = [kind for kind in _KINDS if kind in kinds.values()]
    handles: list[Any] = [Patch(color=_KINDS[kind], label=kind) for kind in shown]
    handles.append(handle("the noise alone", INK, ls=(0, (1, 1.5))))
    handles.append(handle("the base model", BASE, ls=DASHED))
    legend_above(drawing, handles, 5, fontsize=8)
    return drawing


def _why_not(row: Result) -> str:
    """Why a set of names with a longer bar is not the one that is named, in its bar; "" for others."""
    note = str(row.get("note", ""))
    return next((short for start, short in _REASONS.items() if start in note), "")


def closed_share(closes: float) -> str:
    """How much of the gap is closed, in per cent: 94 %, and 99.98 % where whole numbers would read 100 %."""
    share = 100 * min(max(closes, 0.0), 1.0)
    digits = 0
    while digits < 3 and 100 - share < 0.5 * 10.0**-digits and share < 100:
        digits += 1
    return ">99.999 %" if 99.9995 <= share < 100 else f"{share:.{digits}f} %"


_REASONS = {
    "must gain": "gains too little to be added",
    "is not needed": "not needed",
    "fits noise": "fits noise",
}
"""Words of a note on a candidate that is likelier than the named one -> the words in its bar."""
_WORSE = "fits best, but predicts held-out trials worse than the base model"
_KINDS = {"named": AMENDED, "with confidence": AMENDED, "most likely, without confidence": "#80cfb9", _WORSE: "#d9b87f",
          "cannot be distinguished from it": MODEL, "other": "#b5b5b5"}  # fmt: skip
"""What a candidate is -> its colour."""


def _draw_left(axis: Axes, rows: Sequence[Result], colours: Sequence[str], diagnosis: Result) -> None:
    """Chi-square a sample that each candidate leaves, between that of the base model and that of the noise."""
    base = diagnosis.get("evidence_base", {})
    left = [max(1 + float(row["left"]), 1e-2) for row in rows]
    axis.axvline(1.0, color=INK, lw=1.0, ls=(0, (1, 1.5)))
    whole = 1 + float(base["left"]) if base else max(left)
    axis.axvline(whole, color=BASE, lw=1.0, ls=DASHED)
    most = max(whole, *left)
    for place, (row, value, colour) in enumerate(zip(rows, left, colours, strict=True)):
        axis.plot([whole, value], [place, place], color=GREY, lw=1.0, zorder=2)
        axis.plot(value, place, "o", color=colour, ms=5.5, zorder=3)
        closes = row.get("closes")
        if closes is not None:
            axis.annotate(closed_share(closes), (1.01, place), xycoords=("axes fraction", "data"), va="center",
                          fontsize=7.5, color=INK, annotation_clip=False)  # fmt: skip
    if most < NARROW:
        low = min(1.0, *left)
        axis.set_xlim(low - 0.1 * max(most - low, 0.1), most + 0.1 * max(most - low, 0.1))
    else:
        axis.set(xscale="log", xlim=(min(0.9, 0.9 * min(left)), 1.15 * most))
        axis.xaxis.set_major_formatter(plain_numbers)
        if most < 20:
            axis.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
            axis.xaxis.set_minor_locator(NullLocator())
    noise = "noise and replicates" if base.get("with_scatter") else "noise"
    axis.set_xlabel(f"chi-square per sample left\n(1: {noise}; %: excess removed)")
    axis.grid(False, axis="y")


def _leading_names(diagnosis: Result, score: Mapping[tuple[str, ...], float]) -> tuple[str, ...]:
    """The leading set of names: the verdict's; where that is unknown the best model's, or the likeliest single name."""
    if diagnosis["verdict"] != "unknown":
        return tuple(effect["id"] for effect in diagnosis["effects"])
    names = tuple(diagnosis.get("leading", {}).get("effects", ()))
    same = next((known for known in score if sorted(known) == sorted(names)), names)
    singles = [known for known in score if len(known) == 1 and score[known] > 0]
    return same or max(singles, key=lambda known: score[known], default=())


def _kind(name: tuple[str, ...], leading: tuple[str, ...], diagnosis: Result) -> str:
    if diagnosis["verdict"] == "unknown":
        certain = {effect["id"] for effect in diagnosis["effects"]}
        if worsens_held_out(diagnosis):
            return _WORSE if name == leading else "other"
        if certain and set(name) == certain:
            return "with confidence"
        return "most likely, without confidence" if name == leading else "other"
    if name == leading:
        return "named"
    swapped = [(other, *leading[1:]) for other in diagnosis["alternatives"]]
    return "cannot be distinguished from it" if set(name) in [set(s) for s in swapped] else "other"
