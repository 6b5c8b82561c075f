"""Where the spring-damper departs from the bed: by depth and by speed, in numbers and in words.

All is from the loading of driven runs, in bands of depth. Runs of one speed on several beds are averaged, and their
standard deviation between beds is reported. This separates an error of the law from differences of beds.
"""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from coupling import Penetration
from experiments.runs.types import Json
from rigid.intervals import half_width
from vis.page.numbers import foldable, quote

from .fit import Fit, fit_rows, spread
from .settings import say

__all__ = ["departure_table", "departures", "depth_exponent", "rate_change", "sentences", "with_half"]

Known = tuple[float, float | None]
"""A number and its standard deviation, None where unknown."""
_WHOSE = "the spring-damper's"
BANDS = 4
"""Bands of depth between the surface and the deepest point."""


def departures(
    by_bed: Sequence[Sequence[Penetration]],
    models: Mapping[str, Penetration],
    beds: Mapping[str, Penetration],
    fit: Fit,
    *,
    sinkage: tuple[Known, Known] | None = None,
) -> Json:
    """The entry "departures" of result.json: table, exponents, returned work and sentences.

    `by_bed` are the driven runs, bed by bed. `beds` and `models` are all runs by id, in the bed and on the
    spring-damper. `sinkage` is the resting depth (bed, model) [m], each with half of its 95 % interval (None: unknown).
    """
    driven = [run for runs in by_bed for run in runs]
    table, exponents, rate = departure_table(driven, fit), depth_exponent(driven), rate_change(by_bed, fit)
    pairs = [(beds[name], models[name]) for name in models]
    # Of the work put in, what the way out returns [1].
    pull_out = [
        [run.work_out / run.work_in for run in pair]
        for pair in pairs
        if pair[0].kind == "driven" and all(run.work_in > 0 and (run.phase == "out").any() for run in pair)
    ]
    returned = tuple(float(np.mean(values)) for values in zip(*pull_out, strict=True)) if pull_out else None
    drops = [(bed, model) for bed, model in pairs if bed.kind == "drop"]
    return {
        "sentences": sentences(table, exponents, returned, drops, sinkage, rate=rate),
        "table": table,
        "rate": rate,
        "exponents": [
            {"speed": speed, "exponent": value, "std": std, "beds": count}
            for speed, (value, std, count) in exponents.items()
        ],
        "work_returned": None if returned is None else {"bed": returned[0], "model": returned[1]},
    }


def departure_table(driven: Sequence[Penetration], fit: Fit, bands: int = BANDS) -> list[dict[str, float | None]]:
    """Mean force of the bed and of the law per speed and band of depth [N]; gap = (law - bed) / bed [1].

    "beds" counts the beds driven into at that speed; "bed_std" [N] and "gap_std" [1]: between them, None for one.
    """
    if not driven:
        return []
    deepest = max(run.max_depth for run in driven)
    edges = np.linspace(0.0, deepest, bands + 1)
    table: list[dict[str, float | None]] = []
    for speed, runs in _by_speed(driven).items():
        for low, high in pairwise(edges):
            means = [drag for run in runs if (drag := _mean_drag(run, fit, low, high)) is not None]
            if not means:
                continue
            bed, model = (float(value) for value in np.mean(means, axis=0))
            apart, known = spread([law - force for force, law in means]), bed > 0
            row: dict[str, float | None] = {
                "speed": speed,
                "depth_from": float(low),
                "depth_to": float(high),
                "bed_force": bed,
            }
            row |= {"model_force": model, "gap": (model - bed) / bed if known else None, "beds": len(means)}
            row |= {"bed_std": spread([force for force, _ in means])}
            table.append(row | {"gap_std": apart / bed if known and apart is not None else None})
    return table


def rate_change(by_bed: Sequence[Sequence[Penetration]], fit: Fit) -> Json | None:
    """How the mean drag of loading changes from the slowest to the fastest speed, in the beds that have both.

    Mean over those beds, [1]: "bed", its standard deviation "bed_std" (None for one bed), "model"; "beds": how many;
    "slow", "fast": the widest pair of speeds [m/s]. None where no bed was driven at two speeds.
    """
    means: list[dict[float, tuple[float, float]]] = []
    for bed in by_bed:
        drags = ((speed, _mean_drag(runs[0], fit)) for speed, runs in _by_speed(bed).items())
        means.append({speed: drag for speed, drag in drags if drag is not None and drag[0] > 0})
    pairs = {(min(found), max(found)) for found in means if len(found) > 1}
    if not pairs:
        return None
    slow, fast = max(pairs, key=lambda pair: pair[1] / pair[0])
    both = [(found[slow], found[fast]) for found in means if slow in found and fast in found]
    own = [after[0] / before[0] - 1 for before, after in both]
    law = [after[1] / before[1] - 1 for before, after in both if before[1] > 0]
    found = {"slow": slow, "fast": fast, "beds": len(own), "bed": float(np.mean(own)), "bed_std": spread(own)}
    return found | {"model": float(np.mean(law)) if law else None}


def _mean_drag(run: Penetration, fit: Fit, above: float = 0.0, to: float = np.inf) -> tuple[float, float] | None:
    """Mean force of bed and law during loading, in a band of depth [m] [N]; None where there is none."""
    rows = fit_rows(run) & (run.depth > above) & (run.depth <= to)
    if not rows.any():
        return None
    return float(run.force[rows].mean()), float(fit.force(run.depth[rows], run.velocity[rows]).mean())


def depth_exponent(driven: Sequence[Penetration]) -> dict[float, tuple[float, float | None, int]]:
    """Exponent n of F ~ z^n during loading, per speed: mean over the beds, standard deviation between them, how many.

    A straight line through log F against log z of each run, from the deeper three quarters: mean forces of 12 equal
    bands. Runs in which fewer than four bands push back are left out.
    """
    found = {}
    for speed, runs in _by_speed(driven).items():
        own = [value for run in runs if (value := _exponent(run)) is not None]
        if own:
            found[speed] = float(np.mean(own)), spread(own), len(own)
    return found


def _exponent(run: Penetration) -> float | None:
    edges, rows = pairwise(np.linspace(0.25 * run.max_depth, run.max_depth, 13)), fit_rows(run)
    bands = [rows & (run.depth > low) & (run.depth <= high) for low, high in edges]
    pushing = [band for band in bands if band.any() and run.force[band].mean() > 0]
    depths, forces = ([float(values[band].mean()) for band in pushing] for values in (run.depth, run.force))
    return float(np.polyfit(np.log(depths), np.log(forces), 1)[0]) if len(depths) >= 4 else None


def smoothed_peak(run: Penetration, window: float) -> float:
    """Largest running mean of the ground's force over `window` [s] [N]; grains collide in far less than that."""
    width = max(1, min(len(run.force), round(window / run.macro_step)))
    return float(np.convolve(run.force, np.full(width, 1.0 / width), mode="valid").max())


def sentences(
    table: Sequence[Mapping[str, Any]],
    exponents: Mapping[float, tuple[float, float | None, int]],
    returned: tuple[float, ...] | None,
    drops: Sequence[tuple[Penetration, Penetration]],
    sinkage: tuple[Known, Known] | None,
    *,
    rate: Mapping[str, Any] | None = None,
) -> list[str]:
    """What the numbers say, one finding a sentence."""
    said = [*_by_depth(table), *_by_rate(rate)]
    if exponents:
        shown = "; ".join(
            f"{_of_beds(value, std, count, '1')} at {speed:g} m/s ({_beds(count)})"
            for speed, (value, std, count) in exponents.items()
        )
        said.append(
            f"During loading the bed's force grows with depth to the power {shown}; the spring's to the power 1."
        )
    if sinkage is not None:
        bed, law = sinkage
        against = f", {_deeper(law[0] / bed[0])}" if bed[0] > 0 else ""
        sunk, law_sunk = (with_half(*depth, "m") for depth in sinkage)
        if bed[0] < 0:
            on_top = with_half(-bed[0], bed[1], "m")
            said.append(say("sinkage_on_top", bed=on_top, law=law_sunk))
        else:
            said.append(say("sinkage", bed=sunk, law=law_sunk, against=against))
    if returned is not None:
        back = f"recovers {_share(returned[0])} of the work put in"
        if returned[0] < 0:
            back = f"recovers no work, and withdrawal takes another {_share(-returned[0])} of the work put in"
        said.append(f"On withdrawal the bed {back}; the spring-damper recovers {_share(returned[1])}.")
    if drops:
        said += _of_drops(drops)
    return said


def _of_drops(drops: Sequence[tuple[Penetration, Penetration]]) -> list[str]:
    """Peaks and deepest points of the drops, the law's against the bed's."""
    peaks = [model.peak_force / bed.peak_force - 1 for bed, model in drops if bed.peak_force > 0]
    # A drop that was ended near the floor, or by its time while still sinking, has no deepest point of its own.
    stopped = [(bed, model) for bed, model in drops if bed.stop_time and model.stop_time]
    parts = []
    if peaks:
        gap = _of_peaks(peaks)
        step = 1e3 * max(bed.macro_step for bed, _ in drops)
        text = f"the spring-damper's peak force is {gap} (largest mean of one macro step, {step:.2g} ms"
        if len(peaks) > 1:
            text += f"; {_range(peaks)} in {len(peaks)} drops"
        parts.append(f"{text})")
    if stopped:
        deeper = float(np.mean([model.max_depth / bed.max_depth - 1 for bed, model in stopped]))
        gap = _compared(deeper, "deeper", "less deep", "as deep as the bed's")
        parts.append(f"{'its' if peaks else _WHOSE} largest depth is {gap}")
    said = [f"In drops {', and '.join(parts)}."] if parts else []
    calmed = [[smoothed_peak(run, pair[0].stop_time / 10) for run in pair] for pair in stopped if pair[0].stop_time]
    calm = [law / bed - 1 for bed, law in calmed if bed > 0]
    if calm and peaks:
        said.append(say("calm_peak", gap=_of_peaks(calm), ranged=f" ({_range(calm)})" if len(calm) > 1 else ""))
    return said


def _of_beds(value: float, std: float | None, count: float, unit: str, *, significant: int = 2) -> str:
    """A mean over beds with half of its 95 % interval, as far as beds show one."""
    return with_half(value, half_width(std, int(count)), unit, significant=significant)


def with_half(value: float, half: float | None, unit: str, *, significant: int = 2) -> str:
    """A number as a person quotes it, with half of its 95 % interval where that is known."""
    said = foldable(quote(value, half, unit, significant=significant))
    return f"{said} (95 %)" if "±" in said else said


def _of_peaks(gaps: Sequence[float]) -> str:
    return _compared(float(np.mean(gaps)), "above the bed's", "below the bed's", "as high as the bed's")


def _by_depth(table: Sequence[Mapping[str, Any]]) -> list[str]:
    """The shallowest and the deepest band, at the speed where the law is furthest off there."""
    rows = [row for row in table if row["gap"] is not None]
    if not rows:
        return []
    said = []
    top, bottom = min(row["depth_to"] for row in rows), max(row["depth_from"] for row in rows)
    shallow = [row for row in rows if row["depth_to"] == top]
    deep = [row for row in rows if row["depth_from"] == bottom]
    for where, band in ((f"In the top {1e3 * top:.3g} mm", shallow), (f"Below {1e3 * bottom:.3g} mm", deep)):
        worst = max(band, key=lambda row: abs(row["gap"]))
        others = [row["gap"] for row in band]
        pushes = _compared(worst["gap"], "too hard", "too softly", "as hard as the bed")
        law = foldable(quote(worst["model_force"], None, "N"))
        bed = _of_beds(worst["bed_force"], worst.get("bed_std"), worst["beds"], "N", significant=3)
        text = say("band", where=where, pushes=pushes, row=worst, law=law, bed=bed, beds=_beds(worst["beds"]))
        if len(others) > 1:
            text += f"; over all speeds the gap there is {_range(others)}"
        apart = [row for row in band if row["gap_std"] is not None and row is not worst]
        if worst["beds"] == 1 and apart:
            least = max(apart, key=lambda row: row["beds"])
            text += say("beds_differ", row=least, beds=_beds(least["beds"]), gap_std=_percent(least["gap_std"]))
        said.append(f"{text}.")
    return said


def _by_rate(rate: Mapping[str, Any] | None) -> list[str]:
    """How the force changes from the slowest to the fastest run, in the same beds and in the law, over all depths."""
    if rate is None:
        return []
    whose = "in the one bed that has both" if rate["beds"] == 1 else f"{_beds(rate['beds'])}"
    if rate["bed_std"] is not None:
        whose += f", {_percent(rate['bed_std'])} apart"
    law = f", the spring-damper's by {_signed(rate['model'])} %" if rate["model"] is not None else ""
    return [say("rate", rate=rate, change=_signed(rate["bed"]), whose=whose, law=law)]


def _by_speed(driven: Sequence[Penetration]) -> dict[float, list[Penetration]]:
    """Runs by the speed asked for, slow ones first."""
    speeds = sorted({float(run.settings["speed"]) for run in driven})
    return {speed: [run for run in driven if run.settings["speed"] == speed] for speed in speeds}


def _compared(share: float, more: str, less: str, same: str) -> str:
    """``12 % deeper``, or `same` where the difference would be shown as nothing."""
    return same if abs(share) < 0.0005 else f"{_percent(share)} {more if share > 0 else less}"


def _deeper(ratio: float) -> str:
    return f"{ratio:.2g} times as deep" if ratio >= 2 else _compared(ratio - 1, "deeper", "less deep", "as deep")


def _percent(value: float) -> str:
    size = abs(100 * value)
    return f"{size:.0f} %" if size >= 9.5 else f"{size:.1f} %"


def _share(value: float) -> str:
    return f"{100 * value:.0f} %" if abs(value) >= 0.095 else f"{100 * value:.1f} %"


def _beds(count: float) -> str:
    return "one bed" if count == 1 else f"{count:.0f} beds"


def _range(shares: Sequence[float]) -> str:
    """``-9 to +40 %``."""
    return f"{_signed(min(shares))} to {_signed(max(shares))} %"


def _signed(share: float) -> str:
    text = f"{100 * share:+.0f}"
    return "0" if text in ("+0", "-0") else text
