"""Errors of a fitted law over depth, speed and load, and in held-out beds."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from experiments.runs.types import Json

from .data import Array, Data, PushRun
from .fit import Estimated, Law, LawFit, fit_law, interval, mean_of, solve_law
from .laws import Candidate

__all__ = [
    "Beyond", "ErrorMap", "SinkageCheck", "Within", "beyond", "error_map", "held_out", "paired", "sinkage_check",
    "sinkage_range", "within",
]  # fmt: skip


@dataclass(frozen=True)
class ErrorMap:
    """Error of a law against the mean force over beds, in drives; shapes [speed_count, bin_count]."""

    speeds: tuple[float, ...]  # [m/s]
    depth: Array  # Mean of each interval [m], shape [bin_count]
    force: Array  # Mean over beds [N]
    error: Array  # (law - mean) / mean [1]
    left: tuple[str, ...] = ()  # Drives that are not in it, as they do not fill the same intervals of depth


def error_map(fitted: LawFit[Candidate]) -> ErrorMap | None:
    """Error map of a fit in its own runs; None without drives.

    It has the drives that fill all intervals of depth that the deepest of them fills.
    """
    data, predicted = fitted.data, fitted.predicted
    driven = [number for number, run in enumerate(data.runs) if run.kind == "driven"]
    if not driven:
        return None
    deepest = max((data.runs[number].depth for number in driven), key=lambda depth: (len(depth), depth[-1]))
    apart = 0.5 * float(np.median(np.diff(deepest))) if len(deepest) > 1 else np.inf

    def fills(depth: Array) -> bool:
        return len(depth) == len(deepest) and bool(np.all(np.abs(depth - deepest) < apart))

    left = tuple(data.runs[number].id for number in driven if not fills(data.runs[number].depth))
    driven = [number for number in driven if fills(data.runs[number].depth)]
    speeds = tuple(sorted({data.runs[number].speed for number in driven}))

    def means(values: Array) -> Array:
        rows = {number: values[data.run_of_row == number] for number in driven}
        return np.array([np.mean([rows[n] for n in driven if data.runs[n].speed == speed], axis=0) for speed in speeds])

    force = means(data.force)
    return ErrorMap(speeds, means(data.depth).mean(axis=0), force, means(predicted) / force - 1, left)


@dataclass(frozen=True)
class Within:
    """The longest stretch of depth in which a law is within an error, at one speed."""

    speed: float  # [m/s]
    low: float  # [m]
    high: float
    at_start: float  # Error at the least and at the largest depth [1]
    at_end: float


def within(found: ErrorMap, most: float) -> list[Within]:
    """For each speed the longest stretch of depth with |error| <= `most`; none where no bin is."""
    stretches = []
    edges = np.concatenate([[0.0], 0.5 * (found.depth[1:] + found.depth[:-1]), [found.depth[-1]]])
    for speed, errors in zip(found.speeds, found.error, strict=True):
        low, high = (float(edges[place]) for place in _longest(np.abs(errors) <= most))
        stretches.append(Within(speed, low, high, float(errors[0]), float(errors[-1])))
    return stretches


def sinkage_range(fitted: LawFit[Candidate], found: ErrorMap, most: float) -> tuple[float, float] | None:
    """Range of loads [N] for which the depth predicted by the law is within `most` (relative) of that of the beds.

    The depth of the beds is where the mean force of the slowest drive first reaches the load. The law is taken at that
    speed. None where no load is.
    """
    rising = np.maximum.accumulate(found.force[0])
    deepest = float(found.depth[-1])
    loads = np.linspace(float(rising[0]), float(rising[-1]), 60)
    good = []
    for load in loads:
        bed = float(np.interp(load, rising, found.depth))
        law = fitted.candidate.depth_at(fitted.theta, float(load), found.speeds[0], deepest=10 * deepest)
        good.append(law is not None and abs(law / bed - 1) <= most)
    start, end = _longest(good)
    return (float(loads[start]), float(loads[end - 1])) if end > start else None


def _longest(good: Iterable[bool]) -> tuple[int, int]:
    """The longest stretch of true values, as a slice has it; (0, 0) of none."""
    best, start = (0, 0), None
    for k, one in enumerate([*good, False]):
        if one and start is None:
            start = k
        elif not one and start is not None:
            best, start = max(best, (start, k), key=lambda pair: pair[1] - pair[0]), None
    return best


def held_out(fitted: LawFit[Law]) -> Json:
    """Rms error of the force over the rms force, in held-out runs [1].

    "beds": each bed by the fit to all others. "of_beds": the same of each bed alone, in the order of `Data.beds`.
    "beds_std": the scatter of those. "interval": 90 % of "beds", by leaving out one bed more. "speeds": each speed by
    the fit to all others; None below three speeds.
    """
    data = fitted.data
    beds = [
        (data.only(lambda run, bed=bed: run.bed == bed), theta)  # type: ignore[misc]
        for bed, theta in zip(data.beds, fitted.left_out, strict=True)
    ]
    speeds = []
    if len(data.speeds) > 2:
        for speed in data.speeds:

            def other(run: PushRun, speed: float = speed) -> bool:
                return run.speed != speed

            theta = fit_law(fitted.candidate, data.only(other), jackknife=False).theta
            speeds.append((data.only(lambda run, speed=speed: run.speed == speed), theta))  # type: ignore[misc]
    of_beds, whole = [_rms(fitted, [bed]) for bed in beds], _rms(fitted, beds)
    others = [[bed for bed in beds if bed is not out] for out in beds]
    sure = interval(whole, np.array([_rms(fitted, rest) for rest in others]))
    return {
        "beds": whole, "of_beds": of_beds, "beds_std": float(np.std(of_beds, ddof=1)),
        "interval": [max(0.0, sure.low), sure.high], "speeds": _rms(fitted, speeds) if speeds else None,
    }  # fmt: skip


@dataclass(frozen=True)
class Beyond:
    """Error of a law outside its fitted range: the fit omits the outermost runs."""

    left_out: float  # Speed of the runs [m/s] or largest depth of the rows [m] that were left out
    fitted_to: float  # The largest that is left
    rms: float  # Rms error of the force there over the rms force [1]
    error: float  # Mean force of the law there over that of the runs, less 1 [1]
    interval: tuple[float, float] | None  # 90 % of `error`, over beds; None where the fit or what was left out has one


DEEPEST = 2 / 3
"""Share of the depth below which rows are left out, to see how wrong a law is beyond its depth [1]."""


def beyond(fitted: LawFit[Law]) -> dict[str, Beyond]:
    """ "speed": without the fastest runs, where two other speeds are left. "depth": without the deepest third.

    A law is fitted to the rest and compared with what was left out. An entry is missing where the rest cannot be
    fitted: fewer than two speeds, or fewer rows than parameters.
    """
    data, found = fitted.data, {}
    speeds, deepest = data.speeds, float(data.depth.max())
    if len(speeds) > 2:
        rest, out = data.only(lambda run: run.speed < speeds[-1]), data.only(lambda run: run.speed == speeds[-1])
        found["speed"] = _beyond(fitted, rest, out, left_out=speeds[-1], fitted_to=speeds[-2])
    shallow = data.rows(lambda run: run.depth <= DEEPEST * deepest)
    deep = data.rows(lambda run: run.depth > DEEPEST * deepest)
    if shallow.runs and len(shallow.depth) > 2 * len(fitted.theta):
        found["depth"] = _beyond(fitted, shallow, deep, left_out=deepest, fitted_to=DEEPEST * deepest)
    return found


def _beyond(fitted: LawFit[Law], rest: Data, out: Data, *, left_out: float, fitted_to: float) -> Beyond:
    own = fit_law(fitted.candidate, rest, jackknife=False)

    def error_of(theta: Array, seen: Data) -> float:
        return float(fitted.candidate.predict(theta, seen).sum() / seen.force.sum() - 1)

    law, beds = fitted.candidate.predict(own.theta, out), out.force
    error, ends = error_of(own.theta, out), None
    if min(len(out.beds), len(rest.beds)) > 1:
        # A bed is left out of both: the law depends on the beds that it was fitted to.
        without = [
            error_of(solve_law(fitted.candidate, rest.without_bed(bed), own.theta, own.share)[0], out.without_bed(bed))
            for bed in dict.fromkeys((*out.beds, *rest.beds))
        ]
        sure = interval(error, np.array(without))
        ends = (sure.low, sure.high)
    rms = math.sqrt(float(np.sum((law - beds) ** 2) / np.sum(beds**2)))
    return Beyond(left_out, fitted_to, rms, error, ends)


def paired(one: Sequence[float], other: Sequence[float]) -> Estimated:
    """Mean difference of `one` and `other`, both of the same beds, shapes [bed_count >= 2].

    Effects of a bed on both cancel. The interval is that of Student's t for the mean of the differences.
    """
    return mean_of(np.asarray(one, dtype=float) - np.asarray(other, dtype=float))


def _rms(fitted: LawFit[Law], parts: Sequence[tuple[Data, Array]]) -> float:
    square = drag = 0.0
    for data, theta in parts:
        force = fitted.candidate.predict(theta, data)
        square += float(np.sum((force - data.force) ** 2))
        drag += float(np.sum(data.force**2))
    return math.sqrt(square / drag)


@dataclass(frozen=True)
class SinkageCheck:
    """Depth at rest under a load, of the beds and of the law fitted to the other beds; nothing of it was fitted."""

    load: float  # [N]
    count: int  # Beds
    beds: float  # Mean over beds [m]
    beds_std: float | None  # Scatter of the beds [m]; None of one
    law: float  # Mean of the predictions [m]
    error: float  # law / beds - 1 [1]
    error_std: float | None  # Scatter over beds of the same of each bed [1]; None of one
    rms: float  # Rms over beds of the same of each bed [1]
    interval: tuple[float, float] | None = None  # 90 % of `error`, by leaving out one bed; None of one
    rms_interval: tuple[float, float] | None = None  # The same of `rms`


def sinkage_check(fitted: LawFit[Candidate]) -> list[SinkageCheck]:
    """The check at every load of which there are placements; a bed is predicted by the fit to the other beds.

    Several placements in one bed count as their mean.
    """
    data, found = fitted.data, []
    deepest = 10 * float(data.depth.max())
    without = dict(zip(data.beds, fitted.left_out, strict=True))
    for load in sorted({place.load for place in data.placements}):
        own: dict[str, list[float]] = {}
        for place in data.placements:
            if place.load == load:
                own.setdefault(place.bed, []).append(place.depth)
        laws = [fitted.candidate.depth_at(without.get(bed, fitted.theta), load, deepest=deepest) for bed in own]
        known = np.array([depth for depth in laws if depth is not None])
        if len(known) < len(own):
            continue
        beds = np.array([np.mean(depths) for depths in own.values()])
        each, mean, law = known / beds - 1, float(beds.mean()), float(known.mean())
        stds = [float(values.std(ddof=1)) if len(own) > 1 else None for values in (beds, each)]
        rms = math.sqrt(float(np.mean(each**2)))
        ends = (_ends(known, beds), _ends_of_rms(each)) if len(own) > 1 else (None, None)
        found.append(SinkageCheck(load, len(own), mean, stds[0], law, law / mean - 1, stds[1], rms, *ends))
    return found


def _ends(laws: Array, beds: Array) -> tuple[float, float]:
    """90 % interval of mean(laws) / mean(beds) - 1, shapes [bed_count >= 2]."""
    without = [np.delete(laws, k).mean() / np.delete(beds, k).mean() - 1 for k in range(len(beds))]
    found = interval(float(laws.mean() / beds.mean() - 1), np.array(without))
    return found.low, found.high


def _ends_of_rms(errors: Array) -> tuple[float, float]:
    """90 % interval of the rms of `errors`, shape [bed_count >= 2]."""
    without = [math.sqrt(float(np.mean(np.delete(errors, k) ** 2))) for k in range(len(errors))]
    found = interval(math.sqrt(float(np.mean(errors**2))), np.array(without))
    return max(0.0, found.low), found.high
